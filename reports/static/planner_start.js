/* Controls and the start. */

function listen() {
  const on = (id, kind, act) => { const e = $(id); if (e) e.addEventListener(kind, act); };
  all('[name=show]').forEach(b => b.addEventListener('change', () => { if (b.value === 'hour') { enterReplay(); return; } if (state.show === 'hour') leaveReplay(); state.show = b.value; if (state.show === 'week') state.change = 0; if (state.map === 'excess' && (state.show === 'difference' || state.change)) state.map = 'violations'; draw(); }));
  all('[data-day]').forEach(b => b.addEventListener('click', () => { const d = b.dataset.day; state.days[d] = state.days[d] ? 0 : 1; draw(); }));
  all('[data-pick]').forEach(b => b.addEventListener('click', () => { state.days = b.dataset.pick.split('').map(Number); draw(); }));
  on('mapkind', 'change', e => { state.map = e.target.value; if (state.map === 'excess' && (state.show === 'difference' || state.change)) { state.show = 'week'; state.change = 0; } draw(); });
  overlays.forEach(l => l.listen(on));
  all('[data-change]').forEach(b => b.addEventListener('click', () => chooseChange(+b.dataset.change)));
  all('[data-pair]').forEach(b => b.addEventListener('click', choosePair)); addEventListener('beforeprint', printPair); addEventListener('afterprint', clearPair);
  on('from', 'change', e => { state.from = +e.target.value; if (state.to <= state.from) state.to = state.from + 1; draw(); });
  on('to', 'change', e => { state.to = +e.target.value; if (state.from >= state.to) state.from = state.to - 1; draw(); });
  on('place', 'change', e => { state.place = e.target.value; retell(); });
  on('cut', 'input', e => { state.cut = Math.min(99, +e.target.value); setCut(); later(); });
  on('zi', 'click', () => zoom(1.5)); on('zo', 'click', () => zoom(1 / 1.5)); on('zr', 'click', whole);
  all('[data-pan]').forEach(b => b.addEventListener('click', () => pan(...b.dataset.pan.split(',').map(Number))));
  on('draw', 'click', e => { drawing(!isDrawing); if (isDrawing && e.detail === 0) box.focus(); if (isDrawing) for (const e of [box, $('said')]) e.scrollIntoView({ block: 'nearest' }); });
  on('clear', 'click', () => { state.rect = null; state.place = 'floor'; drawing(false); $('draw').focus(); });
  ['left', 'bottom', 'right', 'top'].forEach((id, i) => on(id, 'change', e => {
    if (e.target.value === '' || !Number.isFinite(+e.target.value)) { retell(); return; }
    if (!state.rect) middleRectangle();
    const r = [...state.rect], lim = i % 2 ? [M.grid.y0, M.grid.y0 + M.grid.ny] : [M.grid.x0, M.grid.x0 + M.grid.nx];
    r[i] = Math.min(lim[1], Math.max(lim[0], Math.round(+e.target.value)));
    if (i < 2 && r[i + 2] <= r[i]) r[i + 2] = r[i] + 1; else if (i > 1 && r[i - 2] >= r[i]) r[i - 2] = r[i] - 1;
    setRectangle(r); e.target.value = state.rect[i]; retell();
  }));
  on('link', 'click', copyLink); on('png', 'click', picture);
  all('[data-save]').forEach(b => b.addEventListener('click', () => saveDrawing(b.dataset.save)));
  listenReplay();
  addEventListener('hashchange', async () => { if (/show=hour/.test(location.hash)) await openReplay(); recall(); draw(); });
  if (!svg) return;
  listenTried();
  box.addEventListener('keydown', key);
  pointers();
  new ResizeObserver(() => look(state.view)).observe(svg);
}

/* A rectangle is drawn from here on, or no more; how is said below the map. */
function drawing(isOn) {
  isDrawing = isOn; corner = null;
  if (isOn && !state.rect) middleRectangle(); else if (isOn) state.place = 'rect';
  say(isOn ? word('drawing') : '');
  retell();
}

/* Keys on the map. While a rectangle is drawn arrows move it and Shift with arrows changes its size. */
function key(e) {
  if (e.ctrlKey || e.metaKey || e.altKey) return;
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
  if (step && isDrawing && state.rect) {
    const [dx, dy] = step, [x0, y0, x1, y1] = state.rect, g = M.grid;
    if (e.shiftKey) setRectangle([x0, y0, Math.max(x0 + 1, x1 + dx), Math.max(y0 + 1, y1 + dy)]);
    else if (x0 + dx >= g.x0 && x1 + dx <= g.x0 + g.nx && y0 + dy >= g.y0 && y1 + dy <= g.y0 + g.ny) setRectangle([x0 + dx, y0 + dy, x1 + dx, y1 + dy]);
    retell();
  } else if (step) pan(step[0] * 0.12, -step[1] * 0.12);
  else if (e.key === '+' || e.key === '=') zoom(1.5);
  else if (e.key === '-') zoom(1 / 1.5);
  else if (e.key === '0') whole();
  else if (e.key === 'r' || e.key === 'R') drawing(!isDrawing);
  else if (e.key === 'a' || e.key === 'A') nextArea(e.shiftKey ? -1 : 1);
  else if (e.key === 'Escape' && isDrawing) drawing(false);
  else return;
  e.preventDefault();
}

/* The next area of the map, or the one before. */
function nextArea(step) {
  const ids = M.places.map(p => p.id), at = ids.indexOf(state.place);
  state.place = ids[((at < 0 ? 0 : at) + step + ids.length) % ids.length]; retell();
}

/* Pointers: drag moves the map or draws a rectangle, two fingers zoom, the wheel zooms; a click does the same in steps. */
function pointers() {
  const down = new Map(); let from = null;
  const spot = e => { const r = svg.getBoundingClientRect(); return [(e.clientX - r.left) / r.width, (e.clientY - r.top) / r.height]; };
  box.addEventListener('wheel', e => {
    if (!e.ctrlKey && state.view.w >= W - 1e-6 && e.deltaY > 0) return;
    e.preventDefault(); zoom(Math.exp(-Math.max(-60, Math.min(60, e.deltaY)) / 300), ...spot(e));
  }, { passive: false });
  box.addEventListener('pointerdown', e => {
    if (e.button) return;
    box.focus({ preventScroll: true, focusVisible: false }); box.setPointerCapture(e.pointerId); down.set(e.pointerId, spot(e));
    from = { at: spot(e), floor: floorAt(e), view: state.view, moved: false, isPinch: down.size > 1, target: e.target };
  });
  box.addEventListener('pointermove', e => {
    if (!down.has(e.pointerId)) return;
    const was = [...down.values()].map(p => [...p]); down.set(e.pointerId, spot(e)); const is = [...down.values()];
    if (is.length === 2) {
      const gap = p => Math.hypot(p[0][0] - p[1][0], p[0][1] - p[1][1]), mid = [(is[0][0] + is[1][0]) / 2, (is[0][1] + is[1][1]) / 2];
      if (gap(was) > 0) zoom(gap(is) / gap(was), ...mid);
      from.moved = from.isPinch = true; return;
    }
    const [dx, dy] = [is[0][0] - from.at[0], is[0][1] - from.at[1]];
    if (!from.moved && Math.hypot(dx * svg.clientWidth, dy * svg.clientHeight) < 5) return;
    from.moved = true;
    if (isDrawing) { corner = null; setRectangle([...from.floor, ...floorAt(e)]); retell(); } else look({ w: from.view.w, x: from.view.x - dx * from.view.w, y: from.view.y - dy * from.view.h });
  });
  const up = e => {
    if (!down.delete(e.pointerId) || down.size) return;
    if (e.type === 'pointerup' && from && !from.moved) {
      if (isDrawing) {
        if (corner) { setRectangle([...corner, ...from.floor]); drawing(false); } else { corner = from.floor; say(word('corner')); }
      } else if (from.target.dataset.spot) { state.place = from.target.dataset.spot; retell();
      } else if (from.target.dataset.area) { state.place = from.target.dataset.area === state.place ? 'floor' : from.target.dataset.area; retell();
      } else if (state.view.w < W - 1e-6) { const v = state.view; look({ w: v.w, x: v.x + (from.at[0] - 0.5) * v.w, y: v.y + (from.at[1] - 0.5) * v.h }); }
    }
    if (e.type === 'pointerup' && from && from.moved && isDrawing && !from.isPinch) drawing(false);
    from = null; later();
  };
  box.addEventListener('pointerup', up); box.addEventListener('pointercancel', up);
}

/* Flags as run lengths; the first run is of zeros. */
function runs(r, n) {
  const a = new Uint8Array(n);
  for (let i = 0, on = 0; i < n; on ^= 1) { const k = r.one(); if (on) a.fill(1, i, i + k); i += k; }
  return a;
}

/* Fixtures: the nearest free cell of each cell, cells near free floor, and open steps to the right and upwards. */
function readWalkable(r) {
  const n = fine.nx * fine.ny, free = runs(r, n);
  fine.right = runs(r, n); fine.up = runs(r, n); fine.edge = runs(r, n);
  fine.home = Int32Array.from(free, (_, i) => i); fine.carried = new Float64Array(fine.nx);
  for (let i = 0; i < n; i++) if (!free[i]) fine.home[i] = r.one();
}

/* The page comes with the map of the whole week, so it opens before what lies where is unpacked, unless that is chosen
   by the address, or a camera recorded nothing and the map has to say so. */
async function start() {
  const began = performance.now(), g = M.grid, r = reader(await unpack($('data').textContent.trim()));
  fine = g ? { nx: g.nx * g.fineAcross, ny: g.ny * g.fineAcross, home: null } : null;
  document.body.classList.add('live');
  const read = k => { const p = readPanel(r); p.cells = null; if (M.isShared) readWeek(r, p); p.drawn = M.ranked[k] ? p.counted : p.recorded.map(v => v > 0 ? 1 : 0); return p; };
  week = read(0); before = M.hasBefore ? read(1) : null; past = M.hasPast ? readPanel(r) : null;
  if (g && r.one()) readWalkable(r);
  if (M.hasSeen) seen = runs(r, M.cameras * fine.nx * fine.ny);
  pairHours();
  let first = 0;
  const show = () => { recall(); draw(); first = performance.now() - began; };
  const drawn = M.isShared ? week.sums.hours : recordedBy(week, week.drawn), parts = n => Array.from({ length: n }, () => cells.part()), nCells = g ? g.nx * g.ny : 0;
  if (!location.hash && drawn.every(h => h > 0)) show();
  const cells = reader(await unpack($('cells').textContent.trim()));
  for (const [k, p] of [week, before].entries()) if (M.hasCells[k]) { if (M.isShared) readWeekCells(parts(5), nCells, p); else p.cells = readCells(parts(6), nCells); }
  readChanges(cells);
  if (/show=hour/.test(location.hash)) await openReplay();
  if (!first) show();
  listen();
  document.body.dataset.first = first.toFixed(1); document.body.dataset.ready = (performance.now() - began).toFixed(1);
}
start().catch(e => { document.body.classList.remove('live'); say(word('cannot_open')); throw e; });
