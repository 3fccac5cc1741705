/* An hour at a time: the week's table chooses it, squares of the floor show person-time, rings time too close. For readers
   squares come as classes, for the operator as numbers; what is typical comes with them. They are read when first asked for. */

let replayed = null, playing = 0;
const dayName = d => document.querySelector(`[data-day="${d}"]`).getAttribute('aria-label');
const hourName = h => [...$('from').options].find(o => +o.value === h).textContent;

async function openReplay() {
  if (replayed || !M.replay) return;
  const r = reader(await unpack($('replay-data').textContent.trim())), n = M.replay.nx * M.replay.ny, states = r.many(week.S), weeks = r.many(week.S);
  const table = () => {
    const rows = r.one(), key = r.keys(rows), time = r.many(rows), close = r.many(rows), found = Array.from({ length: week.S }, () => new Map());
    for (let i = 0; i < rows; i++) found[Math.floor(key[i] / n)].set(key[i] % n, [time[i], close[i]]);
    return found;
  };
  replayed = { states, weeks, now: table(), typical: table() };
  if (!$('replay-hours').rows.length) makeHours();
}

/* The hour that is chosen, as a position in the week's hours; -1 where more than one is, or none. */
function hourNow() {
  const d = state.days.findIndex(Boolean);
  return sum(state.days) !== 1 || state.to !== state.from + 1 ? -1 : week.hour.findIndex((h, i) => h === state.from && week.weekday[i] === d);
}
function chooseHour(i) {
  state.days = state.days.map((_, d) => d === week.weekday[i] ? 1 : 0); state.from = week.hour[i]; state.to = state.from + 1;
  draw();
}
/* Violations of an hour on the floor; null where the page has no number. */
function countOf(i) {
  if (replayed.states[i] >= 4) return null;
  let n = 0, any = false;
  for (let c = 0; c < M.rows; c++) if (week.counted[c * week.S + i]) { n += week.n[c * week.S + i]; any = true; }
  return any ? n : null;
}

async function enterReplay() {
  await openReplay();
  state.show = 'hour'; state.map = 'exposure'; state.change = 0;
  if (hourNow() >= 0) { draw(); return; }
  const counts = Array.from(week.hour, (_, i) => replayed.states[i] % 4 ? -1 : countOf(i) ?? 0);
  chooseHour(counts.indexOf(Math.max(...counts)));
}
function leaveReplay() {
  play(false);
  state.days = state.days.map(() => 1); [state.from, state.to] = hours;
}

/* The week's table: a button an hour, one of them in the order of Tab, arrow keys among them. */
function makeHours() {
  const table = $('replay-hours'), add = (parent, tag, text, attributes = {}) => { const e = document.createElement(tag); if (text) e.textContent = text; for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v); parent.append(e); return e; };
  const counts = Array.from(week.hour, (_, i) => countOf(i)), most = Math.max(1, ...counts.map(n => n ?? 0)), head = add(add(table, 'thead'), 'tr'), body = add(table, 'tbody');
  add(head, 'td');
  for (let d = 0; d < 7; d++) add(add(head, 'th', '', { scope: 'col' }), 'abbr', dayName(d).slice(0, 3), { title: dayName(d) });
  for (let h = hours[0]; h < hours[1]; h++) {
    const row = add(body, 'tr');
    add(row, 'th', hourName(h), { scope: 'row' });
    for (let d = 0; d < 7; d++) {
      const i = week.hour.findIndex((v, k) => v === h && week.weekday[k] === d), cell = add(row, 'td'), n = counts[i] ?? null;
      if (i < 0) continue;
      const label = word(n === null ? 'replay_no_count' : 'replay_count', { day: dayName(d), hour: hourName(h), n: n === null ? '' : fig(n) });
      add(cell, 'button', n === null ? NONE : fig(n), { type: 'button', 'data-slot': i, class: n === null ? 'b0' : `b${Math.ceil(5 * n / most)}`, 'aria-label': label });
    }
  }
  table.addEventListener('click', e => { const b = e.target.closest('[data-slot]'); if (b) { play(false); chooseHour(+b.dataset.slot); } });
  table.addEventListener('keydown', e => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key], b = e.target.closest('[data-slot]');
    if (!step || !b || e.ctrlKey || e.metaKey || e.altKey) return;
    e.preventDefault();
    for (let d = week.weekday[+b.dataset.slot] + step[0], h = week.hour[+b.dataset.slot] + step[1]; d >= 0 && d < 7 && h >= hours[0] && h < hours[1]; d += step[0], h += step[1]) {
      const i = week.hour.findIndex((v, k) => v === h && week.weekday[k] === d);
      if (i >= 0) { play(false); chooseHour(i); table.querySelector(`[data-slot="${i}"]`).focus(); break; }
    }
  });
}

/* The next hour of the day or the one before, or -1. */
const besideHour = step => { const i = hourNow(), j = i + step; return i >= 0 && week.day[j] === week.day[i] ? j : -1; };
function play(isOn) {
  clearInterval(playing); playing = 0;
  if (!$('replay-play')) return;
  if (isOn) {
    if (besideHour(1) < 0) chooseHour(week.day.indexOf(week.day[hourNow()])); // the day is over: from its start
    playing = setInterval(() => { const next = besideHour(1); if (next < 0) play(false); else chooseHour(next); }, matchMedia('(prefers-reduced-motion: reduce)').matches ? 3000 : 1200);
  }
  $('replay-play').textContent = word(isOn ? 'replay_pause' : 'replay_play');
  $('out').setAttribute('aria-live', isOn ? 'off' : 'polite');
}

/* ---- drawing ---- */
const cornerOf = k => [(M.replay.x0 + k % M.replay.nx * M.replay.side - M.extent[0]) * 100, (M.extent[3] - M.replay.y0 - (Math.floor(k / M.replay.nx) + 1) * M.replay.side) * 100];
const squarePath = k => { const [x, y] = cornerOf(k), a = M.replay.side * 100; return `M${x} ${y}h${a}v${a}h${-a}z`; };
function ringPath(k) {
  const a = M.replay.side * 50, [x, y] = cornerOf(k).map(v => v + a), r = 0.6 * a, c = 0.5523 * r;
  return `M${x - r} ${y}C${x - r} ${y - c} ${x - c} ${y - r} ${x} ${y - r}C${x + c} ${y - r} ${x + r} ${y - c} ${x + r} ${y}C${x + r} ${y + c} ${x + c} ${y + r} ${x} ${y + r}C${x - c} ${y + r} ${x - r} ${y + c} ${x - r} ${y}z`;
}
const classesOf = found => M.isShared ? found : new Map([...found].map(([k, v]) => [k, v.map((n, kind) => (kind ? M.replay.rings : M.replay.steps).filter(step => n >= step).length)]));

function drawHour() {
  const i = hourNow(), why = replayed.states[i] % 4, paths = Array(9).fill(''), rings = ['', ''], isTypical = state.as === 'typical';
  const now = why ? new Map() : classesOf(replayed.now[i]), typical = classesOf(replayed.typical[i]), isDifference = state.as === 'difference';
  let unsure = '';
  if (isDifference && !why && replayed.weeks[i]) for (const k of new Set([...now.keys(), ...typical.keys()])) {
    const [a, b] = [now, typical].map(of => (of.get(k) || [0])[0]), step = Math.max(-2, Math.min(2, a - b));
    if (M.isShared && (!a || !b)) unsure += a || b ? squarePath(k) : '';
    else if (step) paths[step < 0 ? 4 - step : 6 + step] += squarePath(k);
  } else if (!isDifference) for (const [k, [c, ring]] of isTypical ? typical : now) {
    if (c) paths[c - 1] += squarePath(k);
    if (c && ring) rings[ring - 1] += ringPath(k);
  }
  const whole = `M0 0h${W}v${H}h${-W}z`, off = isTypical ? 0 : why;
  [...paths, ...rings, off === 1 ? whole : '', off === 2 ? whole : unsure].forEach((d, n) => $('replayed').children[n].setAttribute('d', d));
  document.body.dataset.as = state.as;
  const named = word('replay_hour', { day: dayName(week.weekday[i]), from: hourName(week.hour[i]), to: [...$('to').options].find(o => +o.value === week.hour[i] + 1).textContent, week: M.weeks[0] });
  const says = isTypical || isDifference && !why ? [replayed.weeks[i] ? word('replay_typical', { n: nf(replayed.weeks[i], 0) }, replayed.weeks[i]) : word('replay_no_typical')] : why ? [word(why === 1 ? 'replay_unrecorded' : 'replay_few')] : [];
  $('replay-now').textContent = [named[0].toLocaleUpperCase(document.documentElement.lang) + named.slice(1), ...says].join(' ');
  setNumbers();
}
/* The operator's numbers: person-minutes in the squares, where these are large enough to read them. */
function setNumbers() {
  const group = $('numbers'), i = state.show === 'hour' && replayed ? hourNow() : -1;
  if (!group || group.textContent === '' && i < 0) return;
  group.textContent = '';
  if (i < 0 || state.as === 'difference' || M.replay.side * 100 / state.view.w * svg.clientWidth < 34 || state.as === 'now' && replayed.states[i] % 4) return;
  for (const [k, [time]] of replayed[state.as][i]) if (time >= 10) {
    const [x, y] = cornerOf(k).map(v => v + M.replay.side * 50), text = document.createElementNS(svg.namespaceURI, 'text');
    text.setAttribute('x', x); text.setAttribute('y', y); text.setAttribute('class', 'rn'); text.textContent = fig(time / 10); group.append(text);
  }
}
function setReplay() {
  const isOn = state.show === 'hour', i = isOn ? hourNow() : -1;
  if (!$('replay')) return;
  $('replay').hidden = !isOn; $('mapkind').disabled = isOn;
  if (!isOn) { if (playing) play(false); setNumbers(); return; }
  all('[name=as]').forEach(b => { b.checked = b.value === state.as; });
  all('[data-slot]').forEach(b => { const isNow = +b.dataset.slot === i; b.setAttribute('aria-pressed', isNow); b.tabIndex = isNow ? 0 : -1; });
  $('replay-back').disabled = besideHour(-1) < 0; $('replay-next').disabled = besideHour(1) < 0;
}
function listenReplay() {
  if (!$('replay')) return;
  all('[name=as]').forEach(b => b.addEventListener('change', () => { state.as = b.value; draw(); }));
  for (const [id, step] of [['replay-back', -1], ['replay-next', 1]]) $(id).addEventListener('click', () => { play(false); chooseHour(besideHour(step)); });
  $('replay-play').addEventListener('click', () => play(!playing));
}
