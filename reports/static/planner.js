/* The page: drawing, controls, the address. A floor without a map has no drawing (`svg` is null) and no rectangle. */

const svg = $('plan'), box = $('map'), W = M.size[0], H = M.size[1];
const MINUS = '\u2212', NONE = '\u2013';
const writers = [0, 1, 2].map(digits => new Intl.NumberFormat(document.documentElement.lang, { minimumFractionDigits: digits, maximumFractionDigits: digits }));
const nf = (v, digits) => writers[digits].format(v);

/* Figures as the report writes them: 1,234; 121; 4.2; 0.42. */
function fig(v) {
  if (v === null || !Number.isFinite(v)) return NONE;
  const size = Math.abs(v), text = size === 0 || size >= 9.95 ? nf(size, 0) : size >= 0.995 ? nf(size, 1) : size >= 0.0005 ? String(+size.toPrecision(2)) : word('format.tiny');
  return (v < 0 && text !== '0' ? MINUS : '') + text;
}
const range = (low, high) => word('format.likely_between', { low, high });
const between = e => e.lo === null ? '' : e.rate === 0 ? word('at_most', { rate: fig(e.hi) }) : range(fig(e.lo), fig(e.hi));
const points = v => Math.round((v - 1) * 100), percent = n => `${nf(Math.abs(n), 0)}%`;
const fewer = v => points(v) === 0 ? word('format.same') : word(points(v) < 0 ? 'format.fewer' : 'format.more', { percent: percent(points(v)) });
function likely(e) {
  if (e.lo === null || e.hi === null) return '';
  const lo = points(e.lo), hi = points(e.hi), end = v => points(v) === 0 ? word('format.no_change') : fewer(v);
  if (lo === hi) return word('format.likely', { change: end(e.lo) });
  if (lo < 0 && hi < 0) return word('format.likely_fewer', { low: percent(hi), high: percent(lo) });
  if (lo > 0 && hi > 0) return word('format.likely_more', { low: percent(lo), high: percent(hi) });
  return range(end(e.lo), end(e.hi));
}
const hoursText = h => h < 0.95 && h > 0 ? word('format.under_an_hour') : word('format.hours', { n: nf(h, h < 10 && h % 1 ? 1 : 0) }, h);
const hoursFigure = h => nf(h, 1).replace(/[.,]0$/, '');
const verdict = e => { const said = word(`words.${e.verdict}`); return e.theta === null ? said : word('change', { verdict: said, change: fewer(e.theta) }); };
const share = v => { if (v === null || !Number.isFinite(v)) return NONE; const n = Math.round(v * 100); return n === 0 && v > 0 ? word('format.nearly_none', { percent: percent(1) }) : n === 100 && v < 1 ? word('format.nearly_all', { percent: percent(99) }) : percent(n); };
const signed = v => { const n = Math.round(v * 100); return (n > 0 ? '+' : n < 0 ? MINUS : '') + percent(n); };
const KINDS = ['violationRate', 'close', 'encounterRate'];
const shownRate = (k, v) => k === 'close' ? share(v) : fig(v);
const shownRange = (k, e) => k !== 'close' ? between(e) : e.lo === null || e.hi === null ? '' : range(share(e.lo), share(e.hi));
const shownChange = (k, e) => k !== 'close' ? [verdict(e), likely(e)] : [word('change', { verdict: word(`words.${e.verdict}`), change: signed(e.theta - 1) }), e.lo === null || e.hi === null ? '' : word('format.likely_signed', { low: signed(e.lo - 1), high: signed(e.hi - 1) })];
const withLikely = (text, range) => range ? word('likely', { text, range }) : text;
const isTold = e => Boolean(e) && (e.lo !== null || e.hi !== null);

/* ---- the live sentence and the table of rates ---- */
function sentences(t) {
  const c = t.change, compare = isPair(), [now, before] = M.weeks, parts = [], say = (key, values) => parts.push(word(key, values));
  if (noDay()) return [word('no_day_chosen')];
  if (t.place.id !== 'floor') say('place', { name: t.place.name });
  if (M.isShared && t.place.index && !isWhole()) say('whole_week');
  if (compare && c && c.violationRate.rateA !== null && c.violationRate.rateB !== null && c.violationRate.nA + c.violationRate.nB > 0) {
    say('both', { before, now, a: fig(c.violationRate.rateA), b: fig(c.violationRate.rateB) });
    if (isTold(c.violationRate)) say('changed', { change: withLikely(verdict(c.violationRate), likely(c.violationRate)) }); else if (c.violationRate.isPlain) { say('changed', { change: fewer(c.violationRate.theta) }); say('no_interval', { reason: c.violationRate.reason }); } else say('too_little', { reason: c.violationRate.reason });
    say('hours_both', { hours: hoursText(c.hours) });
    if (c.hours < M.rules.rough) say('rough');
    return parts;
  }
  const o = t.violationRate;
  if (o.rate === null) say('refused', { week: now, reason: o.reason });
  else {
    const rate = withLikely(word('violation_rate', { rate: fig(o.rate) }), between(o));
    say('level', { week: now, rates: t.close.rate === null ? rate : word('with_close', { rate, share: share(t.close.rate) }) });
    if (o.lo === null && o.reason) say('no_interval', { reason: o.reason });
  }
  say('hours', { hours: hoursText(t.hours) });
  if (t.hours < M.rules.rough) say('rough');
  if (compare && M.notCompared) say('not_compared', { reason: M.notCompared }); else if (compare && c) say('few_compared');
  return parts;
}
function tell() {
  const c = changeNow(), said = c && c.spans.length && isPair() ? tellChange(c) : tellWeeks();
  if ($('out').textContent !== said) $('out').textContent = said;
  for (const k of KINDS) $(`side-${k}`).textContent = $(`now-${k}`).querySelector('b').textContent;
  $('side-name').textContent = $('read-name').textContent;
}
function tellWeeks() {
  const t = rates(placeNow()), c = t.change;
  for (const k of KINDS) {
    const e = t[k];
    fill(`now-${k}`, [shownRate(k, e.rate), shownRange(k, e) || (e.rate === null ? e.reason : '')], { rate: e.rate, lo: e.lo, hi: e.hi });
  }
  $('now-hours').textContent = hoursFigure(t.hours);
  if ($('was-violationRate')) {
    $('was-hours').textContent = c ? hoursFigure(c.hours) : NONE;
    for (const k of KINDS) {
      const e = c && c[k], isShown = e && e.rateA !== null && (k === 'violationRate' || e.xA >= M.rules.minExposure);
      fill(`was-${k}`, [isShown ? shownRate(k, e.rateA) : NONE, isShown ? word('same_hours') : '']);
      fill(`change-${k}`, isTold(e) ? shownChange(k, e) : e && e.isPlain ? [fewer(e.theta), e.reason] : [word('words.too_little_data'), e ? e.reason : M.notCompared], e ? { rate: e.theta, lo: e.lo, hi: e.hi, a: e.rateA, b: e.rateB } : { rate: null, lo: null, hi: null, a: null, b: null });
    }
  }
  $('read-name').textContent = t.place.name;
  return sentences(t).join(' ');
}
function fill(id, [big, small], exact) {
  const cell = $(id); cell.querySelector('b').textContent = big; cell.querySelector('small').textContent = small || '';
  for (const [k, v] of Object.entries(exact || {})) cell.dataset[k] = v === null || v === undefined ? '' : v;
}

/* ---- drawing ---- */
/* The page comes with the map of the whole week: until something else is chosen, it is not drawn again. */
let isFresh = true;
function isShipped(p) {
  const same = isFresh && state.show === 'week' && state.map === 'violations' && (M.isShared || isWhole()) && recordedBy(p, p.drawn).every(h => h > 0);
  isFresh = false;
  return same;
}
function draw() {
  const began = performance.now(), map = M.maps[state.map], { now, was, used, usedWas } = pairNow();
  if (state.show === 'hour' && hourNow() < 0) state.show = 'week';
  document.body.dataset.show = state.show; document.body.dataset.map = state.map;
  document.body.classList.toggle('div', state.show === 'difference' || map.kind === 'excess');
  if (state.show === 'hour') { isFresh = false; drawHour(); } else if (now && svg && !isShipped(now)) {
    const here = field(now, used), there = was && isPair() ? field(was, usedWas) : null, isDifference = state.show === 'difference' && there;
    const shown = isDifference ? here.map((v, i) => v - there[i]) : here, seenHere = seenBy(now, used), seenThere = there ? seenBy(was, usedWas) : null;
    if (isDifference && here.known) shown.known = here.known.map((v, i) => v && there.known[i]);
    document.body.classList.toggle('views', Boolean(seen));
    setBands('gb', shown, map);
    setWhites('gb', shown.known, isDifference ? both(seenHere, seenThere) : seenHere);
    if (state.show === 'split' && there) { setBands('ga', there, map); setWhites('ga', there.known, seenThere); } else all('#ga path,#wa path').forEach(p => p.setAttribute('d', ''));
    setSigns(isDifference || map.kind === 'excess' && state.show === 'week' ? shown : null, map);
  }
  setCut(); setRect(); setOverlays(); setChange(); setLayout(); setReplay(); tell(); setControls(); remember();
  document.body.dataset.ms = (performance.now() - began).toFixed(1);
}

const setOverlays = () => overlays.forEach(l => l.set());

function setCut() {
  if (!svg) return;
  const split = state.show === 'split', v = state.view, x = v.x + v.w * state.cut / 100;
  $('cutw').hidden = !split; $('edge').toggleAttribute('hidden', !split);
  const part = (id, from, to) => { $(id).setAttribute('x', from); $(id).setAttribute('width', Math.max(0, to - from)); };
  part('clip-a', -1e4, split ? x : -1e4); part('clip-b', split ? x : -1e4, 1e5);
  for (const k of ['x1', 'x2']) $('edge').setAttribute(k, x);
}

function setRect() {
  if (!svg) return;
  const r = state.rect, mark = $('rect');
  mark.toggleAttribute('hidden', !r);
  if (!r) return;
  const [x, y] = [(r[0] - M.extent[0]) * 100, (M.extent[3] - r[3]) * 100];
  for (const [k, v] of [['x', x], ['y', y], ['width', (r[2] - r[0]) * 100], ['height', (r[3] - r[1]) * 100]]) mark.setAttribute(k, v);
}

function setControls() {
  all('[name=show]').forEach(b => { b.checked = b.value === state.show; });
  $('mapkind').value = state.map; $('place').value = state.place; $('from').value = state.from; $('to').value = state.to;
  all('[data-day]').forEach(b => b.setAttribute('aria-pressed', Boolean(state.days[b.dataset.day])));
  if (!svg) return;
  $('cut').value = state.cut;
  $('draw').setAttribute('aria-pressed', isDrawing); box.classList.toggle('drawing', isDrawing);
  ['left', 'bottom', 'right', 'top'].forEach((id, i) => { if (document.activeElement !== $(id)) $(id).value = state.rect ? state.rect[i] : ''; });
  for (const id of ['left', 'bottom', 'right', 'top']) $(id).parentElement.parentElement.hidden = !(state.rect || isDrawing);
  all('.ar').forEach(path => path.classList.toggle('on', path.dataset.area === state.place));
  all('.hs').forEach((path, i) => path.classList.toggle('on', M.spots[i].id === state.place));
  $('place').querySelector('[value=rect]').disabled = !state.rect; $('clear').hidden = !state.rect;
}

/* ---- where one looks: v is the part of the drawing that is shown ---- */
function look(v) {
  if (!svg) return;
  const w = Math.min(W, Math.max(W / 16, v.w)), h = w * H / W, unit = w / Math.max(1, svg.clientWidth); // read before anything is written
  state.view = { w, h, x: Math.min(W - w, Math.max(0, v.x)), y: Math.min(H - h, Math.max(0, v.y)) };
  svg.setAttribute('viewBox', [state.view.x, state.view.y, w, h].map(n => n.toFixed(2)).join(' '));
  svg.style.setProperty('--u', unit);
  $('hat').setAttribute('patternTransform', `rotate(45) scale(${unit})`); $('dots').setAttribute('patternTransform', `scale(${unit})`);
  $('zl').textContent = `${Math.round(W / w * 100)}%`;
  const all100 = w >= W - 1e-6;
  $('zo').disabled = $('zr').disabled = all100; all('[data-pan]').forEach(b => { b.disabled = all100; });
  box.classList.toggle('whole', all100);
  setCut(); if (unit !== namedAt) overlays.forEach(l => l.look?.()); setNames(unit); setNumbers();
}

/* Names stand inside their area, above it where a number or another name is in the way, or not at all until one zooms in. */
const meet = (a, b) => a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
const boxOf = e => { const b = e.getBBox(); return { x: b.x, y: b.y + b.height / 5, width: b.width, height: b.height * 0.6 }; };
const texts = () => all('.hm,.pt:not(.out-of-way)').map(boxOf);
let namedAt = 0;
function setNames(unit) {
  if (unit === namedAt) return;
  namedAt = unit;
  // all sizes are read before any place is written, so that the browser lays the page out once
  const taken = [...all('.hm').map(boxOf), ...all('.cp').map(e => e.getBBox())], names = all('.pt').map(e => [e, boxOf(e), parseFloat(e.getAttribute('dy'))]), fixtures = all('.fn').map(e => [e, e.getBBox()]);
  for (const [e, box, was] of names) {
    const found = [1.15, -0.4].map(dy => [dy, { ...box, y: box.y + (dy - was) * 14 * unit }]).find(([, b]) => b.y > 0 && !taken.some(t => meet(t, b)));
    e.classList.toggle('out-of-way', !found);
    if (found) { e.setAttribute('dy', `${found[0]}em`); taken.push(found[1]); }
  }
  for (const [e, b] of fixtures) {
    const x = b.x + b.width / 2, y = b.y + b.height / 2;
    const own = e.hasAttribute('transform') ? { x: x - b.height / 2, y: y - b.width / 2, width: b.height, height: b.width } : b;
    const fits = b.width <= +e.dataset.along && !taken.some(t => meet(t, own));
    e.classList.toggle('out-of-way', !fits);
    if (fits) taken.push(own);
  }
}
const zoom = (f, px = 0.5, py = 0.5) => { const v = state.view, w = Math.min(W, Math.max(W / 16, v.w / f)); look({ w, x: v.x + (v.w - w) * px, y: v.y + (v.h - w * H / W) * py }); later(); };
const pan = (dx, dy) => { const v = state.view; look({ w: v.w, x: v.x + dx * v.w, y: v.y + dy * v.h }); later(); };
const whole = () => { look({ w: W, x: 0, y: 0 }); later(); };
let waiting = 0;
const later = () => { clearTimeout(waiting); waiting = setTimeout(remember, 150); };

/* ---- the rectangle, in whole metres ---- */
function setRectangle(r, isPlace = true) {
  const g = M.grid, lim = [[g.x0, g.x0 + g.nx], [g.y0, g.y0 + g.ny]];
  const fit = (v, k) => Math.min(lim[k][1], Math.max(lim[k][0], Math.round(v)));
  let [x0, y0, x1, y1] = [fit(r[0], 0), fit(r[1], 1), fit(r[2], 0), fit(r[3], 1)];
  if (x0 > x1) [x0, x1] = [x1, x0];
  if (y0 > y1) [y0, y1] = [y1, y0];
  if (x0 === x1) { if (x1 < lim[0][1]) x1++; else x0--; }
  if (y0 === y1) { if (y1 < lim[1][1]) y1++; else y0--; }
  state.rect = [x0, y0, x1, y1];
  if (isPlace) state.place = 'rect';
}
function middleRectangle() {
  const v = state.view, x = M.extent[0] + (v.x + v.w / 2) / 100, y = M.extent[3] - (v.y + v.h / 2) / 100;
  setRectangle([x - 2, y - 2, x + 2, y + 2]);
}
const retell = () => { setRect(); setOverlays(); tell(); setControls(); later(); };
function floorAt(e) {
  const r = svg.getBoundingClientRect(), v = state.view;
  return [M.extent[0] + (v.x + (e.clientX - r.left) / r.width * v.w) / 100, M.extent[3] - (v.y + (e.clientY - r.top) / r.height * v.h) / 100];
}

/* ---- the address: only what is expected is read from it ---- */
function remember() {
  const s = state, v = s.view, out = [];
  if (s.change) out.push(`change=${s.change}`);
  if (s.show !== 'week') out.push(`show=${s.show}`);
  if (s.show === 'hour' && s.as !== 'now') out.push(`as=${s.as}`);
  if (s.map !== 'violations') out.push(`map=${s.map}`);
  out.push(...overlays.map(l => l.write()).filter(Boolean));
  if (!s.days.every(Boolean)) out.push(`days=${s.days.map(d => d ? 1 : 0).join('')}`);
  if (s.from !== hours[0]) out.push(`from=${s.from}`);
  if (s.to !== hours[1]) out.push(`to=${s.to}`);
  if (s.place !== 'floor') out.push(`place=${encodeURIComponent(s.place)}`);
  if (s.rect) out.push(`rect=${s.rect.join(',')}`);
  if (v && v.w < W - 1e-6) out.push(`view=${[v.x, v.y, v.w].map(n => Math.round(n)).join(',')}`);
  if (s.show === 'split' && s.cut !== 50) out.push(`cut=${s.cut}`);
  const hash = out.length ? `#${out.join('&')}` : location.pathname + location.search;
  if (location.hash.slice(1) !== out.join('&')) history.replaceState(null, '', hash);
}
function recall() {
  const got = new Map(location.hash.slice(1, 400).split('&').map(part => { const i = part.indexOf('='); return [part.slice(0, i), part.slice(i + 1)]; }));
  const s = state, take = (key, rule) => { const m = rule.exec(got.get(key) || ''); return m && m[0]; };
  const whole = (key, lo, hi, otherwise) => { const n = take(key, /^\d{1,2}$/); return n !== null && +n >= lo && +n <= hi ? +n : otherwise; };
  const numbers = (key, n) => { const m = take(key, /^-?\d{1,6}(,-?\d{1,6}){2,3}$/); const list = m ? m.split(',').map(Number) : []; return list.length === n ? list : null; };
  s.change = whole('change', 1, 99, 0); const change = changeNow(), isPaired = Boolean(change && change.spans.length);
  if (!change) s.change = 0;
  s.show = take('show', before || isPaired ? /^(week|split|difference)$/ : /^week$/) || (replayed && take('show', /^hour$/)) || 'week'; s.as = take('as', /^(typical|difference)$/) || 'now';
  if (s.show === 'difference' && M.notCompared && !isPaired) s.show = 'week';
  const kind = take('map', /^[a-z]{1,12}$/); s.map = kind && Object.hasOwn(M.maps, kind) ? kind : 'violations';
  if (s.map === 'excess' && s.show !== 'week' && (isPaired || s.show === 'difference')) s.map = 'violations';
  overlays.forEach(l => l.read(take));
  s.days = (take('days', /^[01]{7}$/) || '1111111').split('').map(Number);
  s.from = whole('from', hours[0], hours[1] - 1, hours[0]); s.to = whole('to', s.from + 1, hours[1], hours[1]);
  if (s.show === 'hour') { s.map = 'exposure'; s.change = 0; if (hourNow() < 0) s.show = 'week'; }
  const r = numbers('rect', 4); s.rect = null; if (r && week.cells) setRectangle(r, false);
  let place = ''; try { place = decodeURIComponent(got.get('place') || ''); } catch { place = ''; }
  s.place = place === 'rect' && s.rect || M.places.some(p => p.id === place) || week.cells && M.spots.some(p => p.id === place) ? place : 'floor';
  s.cut = whole('cut', 0, 99, 50);
  const v = numbers('view', 3); look(v && v[2] > 0 ? { x: v[0], y: v[1], w: v[2] } : { w: W, x: 0, y: 0 });
}

/* ---- picture and link ---- */
const say = text => { $('said').textContent = text; };
/* What is drawn, in the words of the controls: a picture that is passed on has no controls. */
function drawn() {
  const s = state, plain = e => e.textContent.trim().replace(/\s+/g, ' '), option = id => plain($(id).selectedOptions[0]), c = changeNow();
  const isPaired = Boolean(c && c.spans.length && isPair()), days = all('[data-day]').filter((_, k) => s.days[k]).map(b => b.getAttribute('aria-label'));
  const what = [option('mapkind')];
  if (isPaired) what.push(`${word('after', { days: c.spans[1] })}, ${word('before', { days: c.spans[0] })}`);
  else what.push(isPair() ? M.weeks.join(', ') : M.weeks[0]);
  for (const name of s.show === 'week' ? [] : s.show === 'hour' ? ['show', 'as'] : ['show']) what.push(plain(document.querySelector(`[name=${name}]:checked`).parentElement));
  if (!isPaired && days.length < 7) what.push(days.join(', '));
  if (!isPaired && (s.from !== hours[0] || s.to !== hours[1])) what.push(`${option('from')}–${option('to')}`);
  what.push(...overlays.map(l => l.name()).filter(Boolean));
  const card = c && document.querySelector(`[data-card="${c.number}"]`);
  return [isPaired ? plain(document.querySelector('h1')) : document.title, what.join(' · '), ...all('.tag').map(plain), ...card ? [`${plain(card.querySelector('.what'))} ${plain(card.querySelector('.verdict'))}`] : []];
}
const fileName = ending => `${[M.file, ...state.change ? [`change-${state.change}`] : [], ...state.show === 'week' ? [] : [state.show], ...state.map === 'violations' ? [] : [state.map]].join('-')}.${ending}`;
async function copyLink() {
  remember();
  const copied = () => say(word(location.protocol === 'file:' ? 'link_file' : 'link'));
  try { await navigator.clipboard.writeText(location.href); copied(); } catch {
    const area = document.createElement('textarea'); area.value = location.href; area.className = 'vh'; document.body.append(area); area.select();
    if (document.execCommand('copy')) copied(); else say(word('no_link')); area.remove(); $('link').focus();
  }
}
async function picture() {
  const [title, ...lines] = drawn(), scale = 2, width = 1200, k = width / state.view.w * scale, head = (60 + 24 * lines.length) * scale, foot = 116 * scale;
  const canvas = document.createElement('canvas'); canvas.width = width * scale; canvas.height = Math.round(state.view.h * k) + head + foot;
  const c = canvas.getContext('2d'), css = e => getComputedStyle(e), page = css(document.body);
  c.fillStyle = page.backgroundColor; c.fillRect(0, 0, canvas.width, canvas.height);
  c.fillStyle = page.color; c.font = `600 ${22 * scale}px ${page.fontFamily}`; c.fillText(title, 16 * scale, 40 * scale, canvas.width - 32 * scale);
  c.font = `${15 * scale}px ${page.fontFamily}`; lines.forEach((line, i) => c.fillText(line, 16 * scale, (66 + 24 * i) * scale, canvas.width - 32 * scale));
  c.save(); c.beginPath(); c.rect(0, head, canvas.width, canvas.height - head - foot); c.clip();
  c.translate(-state.view.x * k, head - state.view.y * k); c.scale(k, k);
  const unit = 1 / k * scale, cut = state.view.x + state.view.w * state.cut / 100;
  for (const e of svg.querySelectorAll('rect,path,line,circle,text,image,use')) {
    if (e.closest('defs') || e.hasAttribute('hidden')) continue;
    const s = css(e); if (s.display === 'none' || s.visibility === 'hidden') continue;
    c.save();
    const bands = e.closest('#ga,#gb'); if (e.closest('#gs')) for (const id of ['sure', 'known-gb']) c.clip(new Path2D($(id).getAttribute('d') || [...$(id).children].map(p => p.getAttribute('d')).join('')), 'evenodd'); if (bands) c.clip(new Path2D($(`known-${bands.id}`).getAttribute('d')), 'evenodd');
    if (e.matches('.dl,.da')) c.clip(new Path2D($('known-gb').getAttribute('d')), 'evenodd');
    if (state.show === 'split' && e.closest('#ga,#gb,#gs,#wa,#wb')) { const left = e.closest('#ga,#wa'); c.beginPath(); c.rect(left ? -1e5 : cut, -1e5, left ? cut + 1e5 : 2e5, 3e5); c.clip(); }
    if (s.filter !== 'none') c.filter = s.filter;
    if (s.mixBlendMode !== 'normal') c.globalCompositeOperation = s.mixBlendMode;
    const a = n => +e.getAttribute(n) || 0, a2 = n => parseFloat(e.getAttribute(n)) || 0;
    if (e.tagName === 'image') { const i = new Image(); i.src = e.getAttribute('href'); try { await i.decode(); c.drawImage(i, a('x'), a('y'), a('width'), a('height')); } catch { /* a plan that cannot be drawn is left out */ } } else if (e.tagName === 'text') {
      c.font = `${s.fontWeight} ${parseFloat(s.fontSize)}px ${s.fontFamily}`; c.textAlign = { middle: 'center', end: 'right' }[s.textAnchor] || 'left'; c.textBaseline = s.dominantBaseline === 'central' ? 'middle' : 'alphabetic';
      const em = parseFloat(s.fontSize), x = a('x') + a2('dx') * em, y = a('y') + a2('dy') * em;
      if (e.hasAttribute('transform')) { c.translate(x, y); c.rotate(-Math.PI / 2); c.translate(-x, -y); }
      if (e.classList.contains('halo')) { c.strokeStyle = s.stroke; c.lineWidth = 4 * unit; c.lineJoin = 'round'; c.strokeText(e.textContent, x, y); }
      c.fillStyle = s.fill; c.fillText(e.textContent, x, y);
    } else {
      const p = new Path2D(e.tagName === 'path' ? e.getAttribute('d') : e.tagName === 'use' ? $(e.getAttribute('href').slice(1)).getAttribute('d') : ''); if (e.tagName === 'rect') p.rect(a('x'), a('y'), a('width'), a('height'));
      if (e.tagName === 'line') { p.moveTo(a('x1'), a('y1')); p.lineTo(a('x2'), a('y2')); }
      if (e.tagName === 'circle') p.arc(a('cx'), a('cy'), parseFloat(s.r) || a('r'), 0, 7);
      if (s.fill.includes('#dots')) { c.save(); c.clip(p, 'evenodd'); c.fillStyle = css($('dot')).fill; for (let x = 0; x < W; x += 8 * unit) for (let y = 0; y < H; y += 8 * unit) { c.beginPath(); c.arc(x, y, 1.2 * unit, 0, 7); c.fill(); } c.restore(); } else if (s.fill.startsWith('url')) { c.save(); c.clip(p, 'evenodd'); c.strokeStyle = css($('hatline')).stroke; c.lineWidth = 1.2 * unit; c.beginPath(); for (let x = -H; x < W + H; x += 9 * unit) { c.moveTo(x, 0); c.lineTo(x + H, H); } c.stroke(); c.restore(); } else if (s.fill !== 'none') { c.fillStyle = s.fill; c.globalAlpha = +s.fillOpacity; c.fill(p, 'evenodd'); c.globalAlpha = 1; }
      if (s.stroke !== 'none') { c.strokeStyle = s.stroke; c.lineWidth = parseFloat(s.strokeWidth) * unit; c.setLineDash(s.strokeDasharray === 'none' ? [] : s.strokeDasharray.split(/[, ]+/).map(n => parseFloat(n) * unit)); c.stroke(p); }
    }
    c.restore();
  }
  c.restore();
  let y = canvas.height - foot + 26 * scale; c.font = `${14 * scale}px ${page.fontFamily}`;
  for (const list of all('.leg').filter(l => css(l).display !== 'none')) {
    let x = 16 * scale;
    for (const item of [...list.children].filter(i => css(i).display !== 'none')) {
      const key = item.querySelector('i'), top = y - 11 * scale, [wide, high] = [22 * scale, 12 * scale];
      c.save(); c.beginPath(); c.rect(x, top, wide, high); c.clip();
      c.fillStyle = css(key).backgroundColor; c.fillRect(x, top, wide, high);
      c.strokeStyle = c.fillStyle = css($('hatline')).stroke; c.lineWidth = 1.2 * scale;
      if (key.className === 'k-off') for (let i = -high; i < wide; i += 6 * scale) { c.beginPath(); c.moveTo(x + i, top); c.lineTo(x + i + high, top + high); c.stroke(); }
      if (key.className === 'k-dots') for (let i = 3 * scale; i < wide; i += 6 * scale) for (let j = 3 * scale; j < high; j += 6 * scale) c.fillRect(x + i, top + j, 2 * scale, 2 * scale);
      c.strokeRect(x, top, wide, high); c.restore(); x += 28 * scale;
      c.fillStyle = page.color; c.fillText(item.textContent.trim(), x, y); x += c.measureText(item.textContent.trim()).width + 18 * scale;
    }
    y += 22 * scale;
  }
  c.fillText(M.maps[state.map].unit, 16 * scale, y, canvas.width - 32 * scale);
  c.font = `600 ${14 * scale}px ${page.fontFamily}`; c.fillText($('out').textContent, 16 * scale, y + 24 * scale, canvas.width - 32 * scale);
  const link = document.createElement('a'); link.download = fileName('png'); link.href = canvas.toDataURL('image/png'); link.click();
  say(word('picture', { file: link.download }));
  return link.href;
}
