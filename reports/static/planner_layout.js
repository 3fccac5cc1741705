/* Try a layout: fixtures are moved, turned, added or taken away on the map, and saved as a file of edits for vsd whatif.
   Nothing is predicted here. What the page can say is where a way gets narrow. */

const NEW = '+', WAY_M = 4, tried = { edits: new Map(), undo: [], redo: [], which: '', isMoving: false };
const shift = (ring, dx, dy) => ring.map(([x, y]) => [x + dx, y + dy].map(v => Math.round(v * 1000) / 1000));
const boxAround = ring => [0, 1].flatMap(k => { const v = ring.map(p => p[k]); return [Math.min(...v), Math.max(...v)]; });
const fixtureNow = id => M.fixtures.find(f => f.id === id);

/* Its place with all edits; null = taken away; undefined = there is none. */
const ringTried = id => tried.edits.has(id) ? tried.edits.get(id).ring : fixtureNow(id) && fixtureNow(id).ring;
const nameTried = id => tried.edits.has(id) ? tried.edits.get(id).name : fixtureNow(id).name;

function remake(edit) {
  tried.undo.push([...tried.edits]); tried.redo = [];
  edit(tried.edits);
  // what is back at its place is no edit
  for (const [id, e] of tried.edits) { const now = fixtureNow(id); if (now && e.ring && JSON.stringify(now.ring) === JSON.stringify(e.ring)) tried.edits.delete(id); }
  showTried();
}
function stepBack(from, to) {
  if (!from.length) return;
  to.push([...tried.edits]); tried.edits = new Map(from.pop());
  if (tried.which !== NEW && ringTried(tried.which) === undefined) tried.which = '';
  showTried();
}
const place = (id, ring) => remake(edits => edits.set(id, { name: nameTried(id), ring }));
const moveTried = (dx, dy) => { const ring = ringTried(tried.which); if (ring) place(tried.which, shift(ring, dx, dy)); };
const turnTried = () => {
  const ring = ringTried(tried.which);
  if (!ring) return;
  const [x0, x1, y0, y1] = boxAround(ring), [cx, cy] = [(x0 + x1) / 2, (y0 + y1) / 2];
  place(tried.which, shift(ring.map(([x, y]) => [cx - (y - cy), cy + (x - cx)]), 0, 0));
};
function addTried() {
  const name = $('try-name').value.trim() || word('try_new'), taken = id => fixtureNow(id) || tried.edits.has(id);
  const wish = name.toLowerCase().replace(/[^a-z0-9_-]+/g, '-').replace(/^[-_]+|[-_]+$/g, '').slice(0, 58) || 'fixture';
  let id = wish;
  for (let k = 2; taken(id); k++) id = `${wish}-${k}`;
  const v = state.view, [x, y] = metres([v.x + v.w / 2, v.y + v.h / 2]).map(Math.round);
  tried.which = id;
  remake(edits => edits.set(id, { name, ring: [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]] }));
}

/* The sides of the box around it: another left or lower side moves it, another width or depth makes a new one larger. */
function setSide(k, value) {
  const ring = ringTried(tried.which);
  if (!ring || !Number.isFinite(value)) return;
  const [x0, x1, y0, y1] = boxAround(ring);
  if (k < 2) moveTried(...k ? [0, value - y0] : [value - x0, 0]);
  else if (value >= 0.1 && value <= 50) { const [w, d] = k === 2 ? [value, y1 - y0] : [x1 - x0, value]; place(tried.which, [[x0, y0], [x0 + w, y0], [x0 + w, y0 + d], [x0, y0 + d]]); }
}

/* The shortest line between two polygons; length 0 where they meet. */
function gapBetween(a, b) {
  const edges = ring => ring.map((p, k) => [p, ring[(k + 1) % ring.length]]);
  const isIn = ([x, y], ring) => edges(ring).reduce((inside, [[x1, y1], [x2, y2]]) => y1 > y !== y2 > y && x < (x2 - x1) * (y - y1) / (y2 - y1) + x1 ? !inside : inside, false);
  const foot = ([x, y], [[x1, y1], [x2, y2]]) => { const [u, v] = [x2 - x1, y2 - y1], t = Math.max(0, Math.min(1, ((x - x1) * u + (y - y1) * v) / (u * u + v * v || 1))); return [x1 + t * u, y1 + t * v]; };
  if (isIn(a[0], b) || isIn(b[0], a) || edges(a).some(e => edges(b).some(f => crosses(e, f)))) return { length: 0, line: [a[0], a[0]] };
  let best = { length: Infinity, line: null };
  for (const [from, to] of [[a, b], [b, a]]) for (const p of from) for (const e of edges(to)) {
    const q = foot(p, e), length = Math.hypot(q[0] - p[0], q[1] - p[1]);
    if (length < best.length) best = { length, line: [p, q] };
  }
  return best;
}
function crosses([p, q], [r, s]) {
  const side = (a, b, c) => Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
  return side(p, q, r) * side(p, q, s) < 0 && side(r, s, p) * side(r, s, q) < 0;
}

/* Ways beside a fixture, as vsd whatif has them: to another one at most 4 m away, with none between. */
function waysBeside(id) {
  const own = ringTried(id), ids = [...M.fixtures.map(f => f.id), ...tried.edits.keys()].filter((k, i, list) => k !== id && list.indexOf(k) === i && ringTried(k));
  const isBlocked = (line, other) => ids.some(k => k !== other && ringTried(k).some((p, i, ring) => crosses(line, [p, ring[(i + 1) % ring.length]])));
  return ids.map(k => ({ id: k, ...gapBetween(own, ringTried(k)) })).filter(w => w.length <= WAY_M && !(w.length && isBlocked(w.line, w.id))).sort((a, b) => a.length - b.length);
}

/* What is said of one edit. */
function editWords(id, e) {
  const was = fixtureNow(id);
  if (!e.ring) return word('try_gone', { name: e.name });
  const [x0, , y0] = boxAround(e.ring), from = was && boxAround(was.ring), far = was ? Math.hypot(x0 - from[0], y0 - from[2]) : 0;
  const what = was ? word('try_moved', { name: e.name, m: nf(far, 1) }) : word('try_added', { name: e.name });
  const ways = waysBeside(id), over = ways.filter(w => !w.length).map(w => word('try_over', { other: nameTried(w.id) }));
  const narrow = ways.filter(w => w.length && w.length < Math.max(...M.freeWay)).map(w => word('try_narrow', { m: nf(w.length, 2), other: nameTried(w.id), least: nf(Math.min(...M.freeWay.filter(f => w.length < f)), 1) }));
  return [what, ...over, ...narrow.length ? narrow : over.length ? [] : [word('try_wide', { least: nf(Math.max(...M.freeWay), 1) })]].join(' ');
}

function showTried() {
  const make = (tag, attributes, text) => { const e = document.createElementNS(svg.namespaceURI, tag); for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v); if (text) e.textContent = text; return e; };
  const unit = ([x, y]) => [(x - M.extent[0]) * 100, (M.extent[3] - y) * 100].map(v => Math.round(v * 10) / 10), path = ring => `M${ring.map(p => unit(p).join(' ')).join('L')}Z`;
  const parts = [];
  for (const [id, e] of tried.edits) {
    const was = fixtureNow(id);
    if (was) parts.push(make('path', { class: 'try-was', d: path(was.ring) }));
    if (!e.ring) continue;
    const own = make('path', { class: 'try', d: path(e.ring), 'data-try': id }); own.classList.toggle('on', id === tried.which); parts.push(own);
    for (const w of waysBeside(id)) if (w.length && w.length < Math.max(...M.freeWay)) parts.push(make('path', { class: 'try-way', d: `M${unit(w.line[0]).join(' ')}L${unit(w.line[1]).join(' ')}` }));
    const [x0, x1, y0, y1] = boxAround(e.ring), [x, y] = unit([(x0 + x1) / 2, (y0 + y1) / 2]);
    parts.push(make('text', { class: 'try-name', x, y, 'text-anchor': 'middle', 'dominant-baseline': 'central' }, e.name));
  }
  $('tried').replaceChildren(...parts);
  const which = $('try-which'), ring = tried.which === NEW ? null : ringTried(tried.which), added = [...tried.edits].filter(([id]) => !fixtureNow(id));
  which.replaceChildren(new Option(word('try_choose'), ''), ...M.fixtures.map(f => new Option(f.name, f.id)), ...added.map(([id, e]) => new Option(e.name, id)), new Option(word('try_new'), NEW));
  which.value = tried.which;
  $('try-new').hidden = tried.which !== NEW; $('try-sides').hidden = !ring;
  if (!ring) tried.isMoving = false;
  if (ring) { const [x0, x1, y0, y1] = boxAround(ring); ['x', 'y', 'w', 'd'].forEach((k, i) => { const field = $(`try-${k}`), v = [x0, y0, x1 - x0, y1 - y0][i]; if (document.activeElement !== field) field.value = Math.round(v * 100) / 100; field.disabled = i > 1 && Boolean(fixtureNow(tried.which)); }); }
  for (const id of ['move', 'turn', 'away']) $(`try-${id}`).disabled = !ring;
  $('try-move').setAttribute('aria-pressed', tried.isMoving); box.classList.toggle('moving', tried.isMoving);
  $('try-undo').disabled = !tried.undo.length; $('try-redo').disabled = !tried.redo.length;
  for (const id of ['save', 'over']) $(`try-${id}`).disabled = !tried.edits.size;
  $('try-list').replaceChildren(...[...tried.edits].map(([id, e]) => { const li = document.createElement('li'); li.textContent = editWords(id, e); return li; }));
}

/* The file of edits; names are data, so they are written as TOML's strings. */
function editsToml() {
  const text = s => JSON.stringify(s).replace(/\u007f/g, '\\u007F'), lines = [`# ${word('try_file')}`, `# vsd whatif ${M.file}-layout.toml --range ${M.range}`, `floor = ${text(M.floor)}`];
  for (const [id, e] of tried.edits) {
    lines.push('', '[[fixture]]', `id = ${text(id)}`, `name = ${text(e.name)}`);
    lines.push(e.ring ? `polygon = [${e.ring.map(p => `[${p.join(', ')}]`).join(', ')}]` : 'remove = true');
    if (e.ring && fixtureNow(id)) lines.push(`# follow_share = 0.5   # ${word('try_follow')}`);
  }
  return `${lines.join('\n')}\n`;
}

function listenTried() {
  const on = (id, kind, act) => $(`try-${id}`).addEventListener(kind, act);
  on('which', 'change', e => { tried.which = e.target.value; tried.isMoving = false; showTried(); if (tried.which === NEW) $('try-name').focus(); });
  on('add', 'click', () => { addTried(); $('try-x').select(); });
  ['x', 'y', 'w', 'd'].forEach((k, i) => on(k, 'change', e => { if (e.target.value !== '') setSide(i, +e.target.value); }));
  on('move', 'click', e => { tried.isMoving = !tried.isMoving; if (isDrawing) drawing(false); say(tried.isMoving ? word('try_moving') : ''); showTried(); if (tried.isMoving) { if (e.detail === 0) box.focus({ preventScroll: true }); for (const shown of [box, $('said')]) shown.scrollIntoView({ block: 'nearest' }); } });
  on('turn', 'click', turnTried); on('away', 'click', () => { if (fixtureNow(tried.which)) place(tried.which, null); else { const id = tried.which; tried.which = ''; remake(edits => edits.delete(id)); } });
  on('undo', 'click', () => stepBack(tried.undo, tried.redo)); on('redo', 'click', () => stepBack(tried.redo, tried.undo));
  on('over', 'click', () => remake(edits => edits.clear()));
  on('save', 'click', () => saveFile(editsToml(), 'application/toml', `${M.file}-layout.toml`));
  box.addEventListener('keydown', e => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key], isUndo = (e.ctrlKey || e.metaKey) && e.key.toLowerCase() === 'z';
    if (isUndo) stepBack(...e.shiftKey ? [tried.redo, tried.undo] : [tried.undo, tried.redo]);
    else if (tried.isMoving && step && !e.ctrlKey && !e.metaKey && !e.altKey) moveTried(...step.map(v => v * (e.shiftKey ? 1 : 0.1)));
    else if (tried.isMoving && e.key === 'Escape') { tried.isMoving = false; say(''); showTried(); } else return;
    e.preventDefault(); e.stopImmediatePropagation();
  }, true);
  let from = null; // a drag is one step, however many moves it has
  const stop = e => { e.preventDefault(); e.stopImmediatePropagation(); };
  box.addEventListener('pointerdown', e => { if (e.button || !tried.isMoving || !ringTried(tried.which)) return; from = { at: floorAt(e), ring: ringTried(tried.which), steps: tried.undo.length }; box.setPointerCapture(e.pointerId); box.focus({ preventScroll: true, focusVisible: false }); stop(e); }, true);
  box.addEventListener('pointermove', e => {
    if (!from) return;
    const [x, y] = floorAt(e), snap = v => Math.round(v * 10) / 10;
    place(tried.which, shift(from.ring, snap(x - from.at[0]), snap(y - from.at[1])));
    tried.undo.length = Math.min(tried.undo.length, from.steps + 1); stop(e);
  }, true);
  for (const kind of ['pointerup', 'pointercancel']) box.addEventListener(kind, e => { if (from) { from = null; stop(e); } }, true);
  showTried();
}
