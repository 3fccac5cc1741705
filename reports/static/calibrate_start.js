/* Pointers, keys, buttons, and the start. */

function moveProbe(p, at) {
  const xy = floorOf(p, at);
  if (xy) { probe = xy; drawPanes(); }
}

/* Drag moves what lies below the pointer, else the drawing where it is enlarged; a click places; two fingers enlarge. */
function pointers(p) {
  const down = new Map(); let from = null;
  const inSvg = e => { const r = p.svg.getBoundingClientRect(); return [p.view.x + (e.clientX - r.left) / r.width * p.view.w, p.view.y + (e.clientY - r.top) / r.height * p.view.h]; };
  p.box.addEventListener('wheel', e => { if (!e.ctrlKey && !e.metaKey) return; e.preventDefault(); p.zoom(Math.exp(-Math.max(-60, Math.min(60, e.deltaY)) / 200), inSvg(e)); }, { passive: false });
  p.box.addEventListener('pointerdown', e => {
    if (e.button) return;
    p.box.focus({ preventScroll: true, focusVisible: false }); p.box.setPointerCapture(e.pointerId); down.set(e.pointerId, [e.clientX, e.clientY]);
    p.cross = null;
    const hit = down.size > 1 ? null : grabbed(p, p.atPointer(e), e.pointerType === 'mouse' ? 13 : 24);
    from = { x: e.clientX, y: e.clientY, view: p.view, hit, before: copied(), moved: false, isPinch: down.size > 1, apart: spread(down) };
  });
  p.box.addEventListener('pointermove', e => {
    const at = p.atPointer(e);
    if (!from || !down.has(e.pointerId)) { moveProbe(p, at); return; }
    down.set(e.pointerId, [e.clientX, e.clientY]);
    if (down.size > 1) { from.isPinch = true; const now = spread(down); if (now && from.apart) { p.look(from.view); p.zoom(now / from.apart); } else from.apart = now; return; }
    from.moved ||= Math.hypot(e.clientX - from.x, e.clientY - from.y) > 5;
    if (!from.moved || from.isPinch) return;
    if (from.hit) { from.hit.move(at); probe = floorOf(p, at) || probe; update(); } else {
      const k = from.view.w / p.svg.getBoundingClientRect().width;
      p.look({ ...from.view, x: from.view.x - (e.clientX - from.x) * k, y: from.view.y - (e.clientY - from.y) * k });
    }
  });
  const up = e => {
    if (!down.delete(e.pointerId) || !from) return;
    const f = from; if (!down.size) from = null;
    if (e.type === 'pointercancel' || f.isPinch) return;
    if (f.hit && f.moved) { done.push(f.before); undone = []; update(); say(word('moved')); return; }
    if (f.moved) return;
    if (f.hit) { pick(f.hit); return; }
    moveProbe(p, p.atPointer(e)); act(p, p.atPointer(e));
  };
  p.box.addEventListener('pointerup', up); p.box.addEventListener('pointercancel', up);
  p.box.addEventListener('focus', () => { if (p.box.matches(':focus-visible')) p.cross ||= p.back([p.view.x + p.view.w / 2, p.view.y + p.view.h * 0.6]); drawPane(p); });
  p.box.addEventListener('blur', () => drawPane(p));
  p.box.addEventListener('keydown', e => keys(p, e));
}
const spread = down => { const [a, b] = [...down.values()]; return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0; };

/* A click on a handle: the first corner of an open shape closes it, a point becomes the one in hand. */
function pick(hit) {
  if (hit.points === state.open && hit.index === 0 && state.open.length > 2) { finish(); return; }
  if (tool !== 'points') return;
  active = handles(PICTURE_PANE).findIndex((h, i) => { const p = state.pairs[i]; return hit.at[0] === p.u && hit.at[1] === p.v || hit.at[0] === p.x && hit.at[1] === p.y; });
  update(); say(word('picked', { n: active + 1 }));
}

function keys(p, e) {
  if (e.altKey || e.ctrlKey || e.metaKey) return;
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
  if (step) {
    const far = (e.shiftKey ? 1 : 12) * p.units(), [x, y] = p.forth(p.cross || p.back([p.view.x + p.view.w / 2, p.view.y + p.view.h / 2]));
    const to = [Math.min(p.size[0], Math.max(0, x + step[0] * far)), Math.min(p.size[1], Math.max(0, y + step[1] * far))];
    p.cross = p.back(to);
    if (to[0] < p.view.x || to[1] < p.view.y || to[0] > p.view.x + p.view.w || to[1] > p.view.y + p.view.h) p.look({ ...p.view, x: to[0] - p.view.w / 2, y: to[1] - p.view.h / 2 });
    moveProbe(p, p.cross); drawPane(p);
  } else if ((e.key === 'Enter' || e.key === ' ') && p.cross) act(p, p.cross);
  else if (e.key === '+' || e.key === '=') p.zoom(1.5, p.cross ? p.forth(p.cross) : undefined);
  else if (e.key === '-') p.zoom(1 / 1.5);
  else if (e.key === '0') p.look({ x: 0, y: 0, w: p.size[0], h: p.size[1] });
  else if ((e.key === 'f' || e.key === 'F') && tool !== 'points') finish();
  else if ((e.key === 'Delete' || e.key === 'Backspace') && tool === 'points' && state.pairs[active]) removePair(active);
  else if ((e.key === 'Delete' || e.key === 'Backspace') && state.open.length) change(() => { state.open.pop(); });
  else if (e.key === 'Escape' && state.open.length) change(() => { state.open = []; });
  else return;
  e.preventDefault();
}

function choose(chosen) {
  tool = chosen; document.body.dataset.tool = tool;
  if (state.open.length) change(() => { state.open = []; });
  update();
}

function begin() {
  document.body.classList.add('live');
  PANES.forEach(pointers);
  all('[name=tool]').forEach(b => b.addEventListener('change', () => choose(b.value)));
  $('undo').addEventListener('click', () => goBack(done, undone));
  $('redo').addEventListener('click', () => goBack(undone, done));
  $('finish').addEventListener('click', finish);
  $('grid').addEventListener('change', drawPanes);
  $('csv').addEventListener('change', readCsv);
  for (const what of ['csv', 'toml']) $(`copy-${what}`).addEventListener('click', () => copy($(what)));
  for (const p of PANES) {
    for (const [id, factor] of [['in', 1.5], ['out', 1 / 1.5]]) $(`${p.name}-${id}`).addEventListener('click', () => p.zoom(factor));
    $(`${p.name}-all`).addEventListener('click', () => p.look({ x: 0, y: 0, w: p.size[0], h: p.size[1] }));
  }
  addEventListener('keydown', e => {
    const isField = /^(INPUT|TEXTAREA|SELECT)$/.test(e.target.tagName) && e.target.type !== 'radio' && e.target.type !== 'checkbox';
    if (!(e.ctrlKey || e.metaKey) || isField) return;
    if (e.key === 'z' && !e.shiftKey) goBack(done, undone); else if (e.key === 'y' || e.key === 'Z' || e.key === 'z') goBack(undone, done); else return;
    e.preventDefault();
  });
  addEventListener('beforeunload', e => { if (done.length) e.preventDefault(); });
  new ResizeObserver(drawPanes).observe(PLAN_PANE.svg);
  choose('points');
  document.body.dataset.ready = 'yes';
}
begin();
