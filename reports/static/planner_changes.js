/* Logged changes: a click shows the matched weeks before and after one. Verdicts and ranges come with the page from the
   analysis; nothing is estimated here. */

const changeNow = () => M.changes.find(c => c.number === state.change);

function readChanges(r) {
  const nCells = M.grid ? M.grid.nx * M.grid.ny : 0;
  for (const c of M.changes) if (c.spans.length) for (const side of ['before', 'after']) {
    const part = r.part();
    lazily({ [side]: () => readSide(part, c.hasCells, nCells) }, c);
  }
}

/* Turn to a change of the log: time too close of its area, the difference between the weeks; or back to the week. */
function chooseChange(number) {
  const c = M.changes.find(each => each.number === number);
  state.change = c && state.change !== number ? number : 0;
  if (state.change && c.spans.length) { state.show = 'difference'; state.map = 'burden'; state.place = c.area || 'floor'; } else state.show = 'week';
  draw();
}

/* Both sides of the chosen change as a pair of maps in one scale, under the slider. */
function choosePair() {
  state.show = 'split'; draw();
  $('cut').focus();
}

function clearPair() {
  all('.both').forEach(e => e.remove());
}

/* On paper a slider cannot be moved: both maps are printed whole, one beside the other. */
function printPair() {
  clearPair();
  document.body.classList.toggle('paired', Boolean(svg) && state.show === 'split');
  if (!svg || state.show !== 'split') return;
  const both = document.createElement('div');
  both.className = 'both';
  for (const [name, others] of [['cut-was', '#gb,#gs,#wb'], ['cut-now', '#ga,#wa']]) {
    const figure = document.createElement('figure'), caption = document.createElement('figcaption'), map = svg.cloneNode(true);
    caption.textContent = $(name).textContent;
    map.querySelectorAll(`${others},#edge,defs`).forEach(e => e.remove());
    map.querySelectorAll('[clip-path="url(#ca)"],[clip-path="url(#cb)"]').forEach(e => e.removeAttribute('clip-path'));
    for (const e of [map, ...map.querySelectorAll('[id]')]) e.removeAttribute('id');
    figure.append(caption, map); both.append(figure);
  }
  box.after(both);
}

/* What is drawn and over which camera-hours: the week, the other week, or the two sides of a change. */
function pairNow() {
  const c = changeNow();
  if (c && c.spans.length && isPair()) return c.hasCells ? { now: c.after, was: c.before } : {};
  if (!week.cells) return {};
  if (M.isShared) { const of = p => isPair() && p.pair || p.sums, has = before && before.cells && isPair(); return { now: has ? of(week) : week.sums, was: has ? of(before) : null }; }
  const has = before && before.cells && isPair(), isSame = has && !M.notCompared;
  return { now: week, used: isSame ? week.same : week.drawn, was: has ? before : null, usedWas: has ? isSame ? before.same : before.drawn : null };
}

/* The plain rates of a place on one side of a change: sums divided by sums. */
function sideRates(p, place) {
  const C = M.cameras, k = place.index * C, told = { violationRate: 0, close: null, encounterRate: null }, g = M.grid;
  let n = 0, time = 0, close = 0, any = false;
  const perCamera = new Float64Array(C);
  if (place.index >= 0) for (let c = 0; c < C; c++) { perCamera[c] = p.n[k + c]; time += p.time[k + c]; close += p.close[k + c]; } else {
    const A = g.cellsAcross, wide = g.nx * A, v = p.cells.violations, t = p.cells.time;
    for (let i = 0; i < v.n; i++) if (place.squares[Math.floor(Math.floor(v.cell[i] / wide) / A) * g.nx + Math.floor(v.cell[i] % wide / A)]) perCamera[v.camera[i]] += v.v[i];
    for (let i = 0; i < t.n; i++) if (place.squares[t.cell[i]]) { time += t.v[i]; close += t.w[i] * 3600; }
  }
  for (let c = 0; c < C; c++) if (place.cameras[c] && p.hours[c] > 0) { any = true; n += perCamera[c]; told.violationRate += perCamera[c] / p.hours[c]; }
  if (!any) told.violationRate = null;
  if (time > 0) { told.encounterRate = n / time; told.close = Math.min(1, close / 3600 / time); }
  told.hours = sum(p.hours.filter((_, c) => place.cameras[c])) / Math.max(1, sum(place.cameras)); told.n = n;
  return told;
}

/* The table of rates beside a change: before and after as they are; what the change did is said above the map. */
function tellChange(c) {
  const place = placeNow(), hide = sum(place.cameras) ? null : word('reason.nobody');
  const [was, now] = [c.before, c.after].map(p => place.index < 0 && !p.cells ? null : sideRates(p, place));
  const few = hide || M.noViolations || (!was || was.n < M.rules.mask || now.n < M.rules.mask ? word('reason.masked', { n: M.rules.mask }) : null);
  const shown = (e, kind) => few ? NONE : kind === 'close' ? share(e.close) : fig(e[kind]);
  for (const kind of KINDS) {
    fill(`now-${kind}`, [shown(now, kind), kind === 'violationRate' && few || ''], { rate: few ? null : now[kind], lo: null, hi: null });
    if (!$(`was-${kind}`)) continue;
    fill(`was-${kind}`, [shown(was, kind), '']);
    const ratio = few || !was[kind] ? null : now[kind] / was[kind];
    fill(`change-${kind}`, [ratio === null ? NONE : signed(ratio - 1), ratio === null ? '' : word('plain')], { rate: ratio, lo: null, hi: null, a: was && was[kind], b: now && now[kind] });
  }
  $('now-hours').textContent = hoursFigure(now ? now.hours : 0); if ($('was-hours')) $('was-hours').textContent = hoursFigure(was ? was.hours : 0);
  $('read-name').textContent = place.name;
  const parts = few ? [word('place', { name: place.name }), word('refused_place', { reason: few })] : [word('place', { name: place.name }), word('matched', { a: share(was.close), b: share(now.close), before: c.spans[0], after: c.spans[1] })];
  return parts.join(' ');
}

/* What stood on the floor in the chosen days; beside another range, the outline of what stood there and does no longer. */
function setLayout() {
  const k = M.changes.indexOf(changeNow()), isBeside = isPair(), own = k >= 0 && M.changes[k].spans.length;
  const [was, now] = isBeside && own ? [2 + 2 * k, 3 + 2 * k] : [1, 0];
  let anyMoved = false;
  for (const e of all('[data-in]')) {
    const among = e.dataset.in.split(' '), isNow = among.includes(`${now}`), isLeft = isBeside && !isNow && among.includes(`${was}`);
    e.classList.toggle('left', isLeft); e.classList.toggle('away', !isNow && !(isLeft && e.tagName === 'g'));
    anyMoved = anyMoved || isLeft;
  }
  if ($('moved')) $('moved').hidden = !anyMoved;
}

/* The strip of the log, the card of the chosen change, and what cannot be chosen beside it. */
function setChange() {
  const c = changeNow(), isPaired = Boolean(c && c.spans.length && isPair());
  all('[data-change]').forEach(b => b.setAttribute('aria-pressed', +b.dataset.change === state.change));
  all('[data-card]').forEach(e => { e.hidden = +e.dataset.card !== state.change; });
  document.body.classList.toggle('changed', Boolean(c));
  for (const id of ['days', 'hours']) $(id).disabled = isPaired;
  $('all-hours').hidden = !isPaired;
  const names = isPaired ? [word('after', { days: c.spans[1] }), word('before', { days: c.spans[0] })] : M.weeks;
  for (const [name, ids] of [[names[0], ['row-now', 'cut-now']], [names[1] || '', ['row-was', 'cut-was']]]) for (const id of ids) if ($(id)) $(id).textContent = name;
  if ($('cut')) $('cut').setAttribute('aria-label', word('cut', { week: names[0] }));
  all('[name=show][value=split],[name=show][value=difference]').forEach(b => { b.disabled = isPaired ? false : b.value === 'difference' && Boolean(M.notCompared) || !before; });
}
