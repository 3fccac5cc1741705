/* The two drawings: the camera's picture in pixels, and the floor plan in metres with y up. */

const SVG = 'http://www.w3.org/2000/svg';
const svgOf = (tag, attributes, text) => {
  const e = document.createElementNS(SVG, tag);
  for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
  if (text !== undefined) e.textContent = text;
  return e;
};

/* A pane maps its own coordinates (`at`: pixels or floor metres) to those of its drawing and back. */
function pane(name, size, forth, back) {
  const svg = $(`${name}-svg`), p = { name, svg, box: $(name), size, forth, back, view: { x: 0, y: 0, w: size[0], h: size[1] }, cross: null };
  p.units = () => p.view.w / Math.max(1, svg.getBoundingClientRect().width);
  p.atPointer = e => { const r = svg.getBoundingClientRect(); return p.back([p.view.x + (e.clientX - r.left) / r.width * p.view.w, p.view.y + (e.clientY - r.top) / r.height * p.view.h]); };
  p.look = v => {
    const w = Math.min(size[0], Math.max(size[0] / 12, v.w)), h = w * size[1] / size[0];
    p.view = { w, h, x: Math.min(size[0] - w, Math.max(0, v.x)), y: Math.min(size[1] - h, Math.max(0, v.y)) };
    svg.setAttribute('viewBox', `${p.view.x} ${p.view.y} ${w} ${h}`);
    p.box.classList.toggle('whole', w > size[0] - 1e-6);
    drawPane(p);
  };
  p.zoom = (factor, mid = [p.view.x + p.view.w / 2, p.view.y + p.view.h / 2]) => { const v = p.view, w = v.w / factor, h = v.h / factor; p.look({ w, h, x: mid[0] - (mid[0] - v.x) / factor, y: mid[1] - (mid[1] - v.y) / factor }); };
  return p;
}

const PLAN = M.plan.extent, CM = 100;
const PICTURE_PANE = pane('picture', SIZE, uv => uv, uv => uv);
const PLAN_PANE = pane('plan', [(PLAN[2] - PLAN[0]) * CM, (PLAN[3] - PLAN[1]) * CM], ([x, y]) => [(x - PLAN[0]) * CM, (PLAN[3] - y) * CM], ([x, y]) => [PLAN[0] + x / CM, PLAN[3] - y / CM]);
const PANES = [PICTURE_PANE, PLAN_PANE];
const isPicture = p => p === PICTURE_PANE;
const floorOf = (p, at) => isPicture(p) ? (inUse ? toFloor(inUse, at, SIZE) : null) : at;
const shown = (p, xy) => isPicture(p) ? (inUse ? toPicture(inUse, xy, SIZE) : null) : p.forth(xy);

function drawPanes() { PANES.forEach(drawPane); }

function drawPane(p) {
  const k = p.units(), g = p.svg.querySelector('.live-layer');
  const parts = [];
  const line = (points, cls, isClosed) => {
    let d = '', isOn = false;
    for (const q of points) { if (!q || Math.abs(q[0]) > 2e5 || Math.abs(q[1]) > 2e5) { isOn = false; continue; } d += `${isOn ? 'L' : 'M'}${q[0].toFixed(1)} ${q[1].toFixed(1)}`; isOn = true; }
    if (d) parts.push(svgOf('path', { class: cls, d: d + (isClosed && points.every(Boolean) ? 'Z' : '') }));
  };
  if ($('grid').checked && (inUse || !isPicture(p))) grid(p, line, parts, k);
  for (const v of M.views) if (!isPicture(p)) line(v.map(q => shown(p, q)), 'seen', true);
  for (const s of M.known) if (!isPicture(p) || inUse) line(ring(s.points).map(q => shown(p, q)), `known ${s.kind}`, true);
  for (const s of state.shapes) line(ring(s.points).map(q => shown(p, q)), `drawn ${s.kind}`, true);
  for (const s of [...M.known.filter(s => !isPicture(p) || s.kind === 'area'), ...state.shapes.filter(s => s.kind !== 'view')]) name(p, parts, s.points, s.name, k);
  circles(p, line, parts, k);
  if (state.open.length) {
    line((state.open.length > 2 ? ring(state.open) : state.open).map(q => shown(p, q)), 'open', false);
    state.open.map(q => shown(p, q)).filter(Boolean).forEach((q, i) => parts.push(svgOf('circle', { class: i ? 'corner' : 'corner first', cx: q[0], cy: q[1], r: (i ? 5 : 7) * k })));
  }
  if (tool !== 'points') for (const s of state.shapes) if (s.kind === tool) s.points.map(q => shown(p, q)).filter(Boolean).forEach(q => parts.push(svgOf('circle', { class: 'corner', cx: q[0], cy: q[1], r: 5 * k })));
  points(p, line, parts, k);
  if (p.cross && document.activeElement === p.box) { const [x, y] = p.forth(p.cross), r = 16 * k; line([[x - r, y], [x + r, y]], 'cross'); line([[x, y - r], [x, y + r]], 'cross'); }
  g.replaceChildren(...parts);
  $(`${p.name}-zoom`).textContent = `${Math.round(p.size[0] / p.view.w * 100)}%`;
}

/* A ring with points between its corners, as straight lines of the floor may leave the camera's view. */
function ring(points) {
  return points.flatMap((a, i) => { const b = points[(i + 1) % points.length]; return Array.from({ length: 12 }, (_, t) => [a[0] + (b[0] - a[0]) * t / 12, a[1] + (b[1] - a[1]) * t / 12]); });
}
/* The name of a shape in its middle, where it has room; along the longer side. */
function name(p, parts, points, text, k) {
  const at = points.map(q => shown(p, q));
  if (at.some(q => !q)) return;
  const range = i => [Math.min(...at.map(q => q[i])), Math.max(...at.map(q => q[i]))], [x0, x1] = range(0), [y0, y1] = range(1), room = text.length * 7.2 * k;
  const isUpright = y1 - y0 > x1 - x0 && x1 - x0 < room, x = (x0 + x1) / 2, y = (y0 + y1) / 2;
  if ((isUpright ? y1 - y0 : x1 - x0) < room || Math.min(x1 - x0, y1 - y0) < 13 * k) return;
  parts.push(svgOf('text', { class: 'label', x, y, 'font-size': 13 * k, ...(isUpright ? { transform: `rotate(-90 ${x} ${y})` } : {}) }, text));
}

/* Lines of one metre on the floor; in the picture around what its lower part sees. */
function grid(p, line, parts, k) {
  let [x0, y0, x1, y1] = PLAN.map(Math.floor);
  if (isPicture(p)) {
    const seen = [0, 0.25, 0.5, 0.75, 1].flatMap(s => [0.35, 0.5, 0.7, 1].map(t => toFloor(inUse, [SIZE[0] * s, SIZE[1] * t], SIZE))).filter(q => q && Math.hypot(q[0] - probe?.[0], q[1] - probe?.[1]) < 60);
    if (!seen.length) return;
    [x0, y0] = [0, 1].map(i => Math.floor(Math.min(...seen.map(q => q[i])))); [x1, y1] = [0, 1].map(i => Math.ceil(Math.max(...seen.map(q => q[i]))));
  }
  for (const axis of [0, 1]) for (let n = [x0, y0][axis]; n <= [x1, y1][axis]; n++) {
    const from = [x0, y0][1 - axis], to = [x1, y1][1 - axis], steps = isPicture(p) ? (to - from) * 2 : 1;
    const points = Array.from({ length: steps + 1 }, (_, i) => { const along = from + (to - from) * i / steps; return shown(p, axis ? [along, n] : [n, along]); });
    line(points, n % 5 ? 'grid' : 'grid strong');
    if (n % 5 === 0 && !isPicture(p)) { const [x, y] = p.forth(axis ? [PLAN[0], n] : [n, PLAN[1]]); parts.push(svgOf('text', { class: 'tick', x: x + 3 * k, y: y - 4 * k, 'font-size': 12 * k }, String(n))); }
  }
}

/* Two circles on the floor around the pointer: the safe space, and the distance. */
function circles(p, line, parts, k) {
  if (!probe) return;
  M.radii.forEach((radius, i) => {
    const points = Array.from({ length: 73 }, (_, t) => shown(p, [probe[0] + radius.m * Math.cos(t * Math.PI / 36), probe[1] + radius.m * Math.sin(t * Math.PI / 36)]));
    line(points, `under c${i}`, false); line(points, `circle c${i}`, false);
    const at = points.filter(Boolean).reduce((a, q) => !a || q[0] > a[0] ? q : a, null);
    if (at && isPicture(p)) parts.push(svgOf('text', { class: 'label far', x: at[0] + 4 * k, y: at[1], 'font-size': 13 * k }, radius.text));
  });
  const middle = shown(p, probe);
  if (middle) parts.push(svgOf('circle', { class: 'foot', cx: middle[0], cy: middle[1], r: 3.5 * k }));
}

/* The points with their numbers; an arrow from where one was clicked to where the calibration puts it. */
function points(p, line, parts, k) {
  state.pairs.forEach((pair, i) => {
    const at = isPicture(p) ? [pair.u, pair.v] : [pair.x, pair.y];
    if (!at.every(Number.isFinite)) return;
    const [x, y] = p.forth(at), isOn = i === active;
    if (fit.h && isWhole(pair)) {
      const there = isPicture(p) ? toPicture(fit.h, [pair.x, pair.y], SIZE) : p.forth(mapped(fit.h, [pair.u, pair.v]));
      if (there && Math.hypot(there[0] - x, there[1] - y) > 2 * k) line([[x, y], there], 'off-by');
    }
    parts.push(svgOf('circle', { class: isOn ? 'point on' : 'point', cx: x, cy: y, r: 9 * k }), svgOf('circle', { class: 'dot', cx: x, cy: y, r: 1.6 * k }), svgOf('text', { class: 'no', x: x + 11 * k, y: y - 9 * k, 'font-size': 14 * k }, String(i + 1)));
  });
}

/* What a pointer can take hold of: points, or corners of the shapes that the tool draws; the nearest within reach. */
function handles(p) {
  if (tool === 'points') return state.pairs.map((pair, i) => ({ at: isPicture(p) ? [pair.u, pair.v] : [pair.x, pair.y], move: at => { const [a, b] = isPicture(p) ? at.map(n => round(n, 1)) : at.map(n => round(n, 3)); if (isPicture(p)) { state.pairs[i].u = a; state.pairs[i].v = b; } else { state.pairs[i].x = a; state.pairs[i].y = b; } active = i; } }));
  const corner = points => points.map((q, i) => ({ at: isPicture(p) ? shown(p, q) : q, index: i, points, move: at => { const xy = floorOf(p, at); if (xy) points[i] = xy.map(n => round(n, 2)); } }));
  return [...corner(state.open), ...state.shapes.filter(s => s.kind === tool).flatMap(s => corner(s.points))];
}
function grabbed(p, at, reachPx) {
  const [x, y] = p.forth(at), k = p.units();
  return handles(p).filter(h => h.at && h.at.every(Number.isFinite)).map(h => { const q = p.forth(h.at); return { h, d: Math.hypot(q[0] - x, q[1] - y) / k }; }).filter(o => o.d < reachPx).sort((a, b) => a.d - b.d)[0]?.h;
}

/* A click or Enter at a place. */
function act(p, at) {
  if (tool === 'points') placePoint(p, at); else addCorner(p, at);
}
function placePoint(p, at) {
  const keys = isPicture(p) ? ['u', 'v'] : ['x', 'y'], others = isPicture(p) ? ['x', 'y'] : ['u', 'v'], digits = isPicture(p) ? 1 : 3;
  change(() => {
    const now = state.pairs[active], isOpen = now && !isWhole(now) && (!Number.isFinite(now[keys[0]]) || !Number.isFinite(now[others[0]]));
    if (!isOpen) { state.pairs.push({ u: null, v: null, x: null, y: null }); active = state.pairs.length - 1; }
    keys.forEach((key, i) => { state.pairs[active][key] = round(at[i], digits); });
  });
  const pair = state.pairs[active], n = active + 1;
  say(isWhole(pair) ? word('placed', { n }) : word(isPicture(p) ? 'now_plan' : 'now_picture', { n }));
}
function addCorner(p, at) {
  const xy = floorOf(p, at);
  if (!xy) { say(word(inUse ? 'above' : 'no_floor')); return; }
  change(() => { state.open.push(xy.map(n => round(n, 2))); });
  say(word('corner', { n: state.open.length, x: number(xy[0]), y: number(xy[1]) }));
}
