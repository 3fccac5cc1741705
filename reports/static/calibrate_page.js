/* State, undo, and what follows from the points: the homography in use, its error, and the lines to save. */

const $ = id => document.getElementById(id), all = s => [...document.querySelectorAll(s)];
const M = JSON.parse($('meta').textContent), WORDS = M.words, SIZE = M.picture.size;
const word = (key, values = {}) => WORDS[key].replace(/\{(\w+)\}/g, (_, name) => values[name]);
const number = (n, digits = 2) => new Intl.NumberFormat(document.documentElement.lang, { minimumFractionDigits: digits, maximumFractionDigits: digits }).format(n);
const metres = n => `${number(n)} m`;
const round = (n, digits) => +n.toFixed(digits);

let state = { pairs: M.points.map(([u, v, x, y]) => ({ u, v, x, y })), shapes: [], open: [] };
let tool = 'points', active = -1, done = [], undone = [], probe = null, fit = {}, inUse = M.homography;

const copied = () => JSON.stringify(state);
const isWhole = p => [p.u, p.v, p.x, p.y].every(Number.isFinite);
const whole = () => state.pairs.filter(isWhole);

/* Every change goes through here, so that it can be undone. */
function change(act) {
  const before = copied();
  act();
  if (copied() === before) return;
  done.push(before); undone = [];
  update();
}
function goBack(from, to) {
  if (!from.length) return;
  to.push(copied()); state = JSON.parse(from.pop());
  active = Math.min(active, state.pairs.length - 1);
  update(); say(word(from === done ? 'undone' : 'redone'));
}

function update() {
  const pairs = whole();
  fit = fitted(pairs.map(p => [p.u, p.v, p.x, p.y]));
  inUse = fit.h || M.homography;
  if (inUse && !probe) probe = toFloor(inUse, [SIZE[0] / 2, SIZE[1] * 0.7], SIZE);
  writeResult(pairs); writePoints(); writeShapes(); writeOut(); drawPanes();
  $('undo').disabled = !done.length; $('redo').disabled = !undone.length;
  $('finish').disabled = state.open.length < 3;
}

const say = text => { $('said').textContent = text; };

/* How good the calibration is, in words. */
function writeResult(pairs) {
  let text = '';
  if (fit.h) {
    const worst = fit.errors.indexOf(Math.max(...fit.errors)), index = state.pairs.indexOf(pairs[worst]) + 1;
    text = pairs.length === 4 ? word('four') : word('result', { n: pairs.length, error: metres(fit.rms), worst: metres(fit.errors[worst]), point: index });
    if (pairs.length > 5) text += ` ${word('position', { error: metres(fit.rms * Math.sqrt(pairs.length / (pairs.length - 4))) })}`;
  } else text = `${word(fit.why, { n: Math.max(0, 4 - pairs.length) })}${M.homography ? ` ${word('stored')}` : ''}`;
  $('result').textContent = text;
  $('matrix').textContent = inUse ? [0, 3, 6].map(i => inUse.slice(i, i + 3).map(n => n.toPrecision(12)).join(' ')).join('\n') : '';
  $('matrix-box').hidden = !inUse;
}

const made = (tag, attributes = {}, ...inside) => {
  const e = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) if (k in e && k !== 'list' && typeof v !== 'string') e[k] = v; else e.setAttribute(k, v);
  e.append(...inside); return e;
};

/* The points as fields; a field in use is left alone, so that typing is not disturbed. */
function writePoints() {
  const list = $('points');
  while (list.children.length > state.pairs.length) list.lastChild.remove();
  while (list.children.length < state.pairs.length) list.append(pointRow(list.children.length));
  const pairs = whole();
  state.pairs.forEach((p, i) => {
    const row = list.children[i], at = pairs.indexOf(p), error = fit.h && at >= 0 ? fit.errors[at] : null;
    row.classList.toggle('on', i === active);
    for (const key of ['u', 'v', 'x', 'y']) {
      const field = row.querySelector(`[data-key=${key}]`), text = Number.isFinite(p[key]) ? String(p[key]) : '';
      if (document.activeElement !== field && field.value !== text) field.value = text;
    }
    row.querySelector('.err').textContent = error === null ? '' : metres(error);
  });
  $('no-points').hidden = state.pairs.length > 0;
}

function pointRow(i) {
  const field = key => {
    const input = made('input', { type: 'number', step: 'any', inputmode: 'decimal', 'data-key': key, 'aria-label': word(`field_${key}`, { n: i + 1 }) });
    input.addEventListener('change', () => change(() => { state.pairs[i][key] = input.value === '' ? null : +input.value; active = i; }));
    return made('label', {}, made('span', { 'aria-hidden': 'true' }, word(key)), input);
  };
  const remove = made('button', { type: 'button', 'aria-label': word('remove_point', { n: i + 1 }) }, '×');
  remove.addEventListener('click', () => { removePair(i); ($('points').children[i] || $('points').lastElementChild)?.querySelector('button').focus(); });
  return made('li', {}, made('b', {}, String(i + 1)), ...['u', 'v', 'x', 'y'].map(field), made('span', { class: 'err' }), remove);
}
function removePair(i) {
  change(() => { state.pairs.splice(i, 1); active = state.pairs.length - 1; });
  say(word('removed_point', { n: i + 1 }));
}

/* Drawn areas, fixtures and the view, with the fields that vsd.toml needs. */
function writeShapes() {
  const list = $('shapes');
  if (list.contains(document.activeElement) && list.children.length === state.shapes.length) { state.shapes.forEach((s, i) => mark(list.children[i], s, i)); return; }
  list.replaceChildren(...state.shapes.map(shapeRow));
  $('no-shapes').hidden = state.shapes.length > 0;
}

const isId = text => /^[a-z0-9][a-z0-9_-]{0,62}$/.test(text);
const isTaken = (shape, i) => (M.taken[shape.kind] || []).includes(shape.id) || state.shapes.some((s, k) => k !== i && s.kind === shape.kind && s.id === shape.id);
function mark(row, shape, i) {
  const field = row.querySelector('[data-key=id]');
  if (field) field.setAttribute('aria-invalid', String(!isId(shape.id) || isTaken(shape, i)));
}

function shapeRow(shape, i) {
  const set = (key, value) => change(() => { state.shapes[i][key] = value; });
  const text = (key, label) => {
    const input = made('input', { type: 'text', 'data-key': key, value: shape[key] ?? '', autocomplete: 'off', spellcheck: 'false' });
    input.addEventListener('change', () => set(key, input.value.trim()));
    return made('label', {}, made('span', {}, word(label)), input);
  };
  const parts = [made('b', {}, `${word(`shape_${shape.kind}`)} ${i + 1}`)];
  if (shape.kind !== 'view') parts.push(text('id', 'id'), text('name', 'name'));
  if (shape.kind === 'fixture') {
    const kinds = made('select', {}, ...M.kinds.map(k => made('option', { value: k }, word(`kind_${k}`))));
    kinds.value = shape.what; kinds.addEventListener('change', () => set('what', kinds.value));
    const height = made('input', { type: 'number', min: '0.01', step: '0.01', value: shape.height ?? '' });
    height.addEventListener('change', () => set('height', height.value === '' ? null : +height.value));
    const movable = made('input', { type: 'checkbox', checked: !!shape.movable });
    movable.addEventListener('change', () => set('movable', movable.checked));
    parts.push(made('label', {}, made('span', {}, word('kind')), kinds), made('label', {}, made('span', {}, word('height')), height), made('label', { class: 'tick' }, movable, word('movable')));
  }
  const remove = made('button', { type: 'button', 'aria-label': word('remove_shape', { name: shape.name || word('shape_view') }) }, '×');
  remove.addEventListener('click', () => { change(() => { state.shapes.splice(i, 1); }); say(word('removed_shape')); $('undo').focus(); });
  const row = made('li', {}, ...parts, remove);
  mark(row, shape, i);
  return row;
}

function finish() {
  if (state.open.length < 3) { say(word('corners')); return; }
  const count = 1 + state.shapes.filter(s => s.kind === tool).length, points = state.open.map(p => p.map(n => round(n, 2)));
  change(() => {
    if (tool === 'view') state.shapes = state.shapes.filter(s => s.kind !== 'view');
    let n = count;
    while (tool !== 'view' && isTaken({ kind: tool, id: `${tool}-${n}` }, -1)) n++;
    state.shapes.push({ kind: tool, points, id: `${tool}-${n}`, name: `${word(`shape_${tool}`)} ${n}`, what: M.kinds[0], movable: false, height: null });
    state.open = [];
  });
  say(word('finished', { name: word(`shape_${tool}`) }));
}

/* What to save. */
const quoted = text => JSON.stringify(text.replace(/[\u0000-\u001f\u007f]/g, ' '));
const polygon = points => `[${points.map(([x, y]) => `[${x.toFixed(2)}, ${y.toFixed(2)}]`).join(', ')}]`;
function tomlLines() {
  const lines = [];
  for (const s of state.shapes) {
    if (s.kind === 'view') { lines.push(`# ${word('toml_view', { camera: M.camera })}`, `view = ${polygon(s.points)}`, ''); continue; }
    lines.push(`[[${s.kind}]]`, `id = ${quoted(s.id)}`, `name = ${quoted(s.name)}`, `floor = ${quoted(M.floor)}`, `polygon = ${polygon(s.points)}`);
    if (s.kind === 'fixture') { lines.push(`kind = ${quoted(s.what)}`, `movable = ${!!s.movable}`); if (s.height > 0) lines.push(`height_m = ${s.height}`); }
    lines.push('');
  }
  return lines.join('\n');
}
const csvLines = () => ['u,v,x,y', ...whole().map(p => [p.u, p.v, p.x, p.y].join()), ''].join('\n');
function writeOut() {
  if (document.activeElement !== $('csv')) $('csv').value = csvLines();
  $('toml').value = tomlLines();
  $('save-csv').href = `data:text/csv;charset=utf-8,${encodeURIComponent(csvLines())}`;
  $('save-toml').href = `data:text/plain;charset=utf-8,${encodeURIComponent(tomlLines())}`;
}

/* Points typed or pasted as CSV; a line that is not four numbers is named, and nothing changes then. */
function readCsv() {
  const rows = $('csv').value.split('\n').map(r => r.trim()).filter(r => r && !/^u\s*,/i.test(r) && !r.startsWith('#'));
  const pairs = rows.map(r => r.split(',').map(Number)), bad = pairs.findIndex(p => p.length !== 4 || !p.every(Number.isFinite));
  if (bad >= 0) { say(word('bad_csv', { line: rows[bad].slice(0, 60) })); return; }
  change(() => { state.pairs = pairs.map(([u, v, x, y]) => ({ u, v, x, y })); active = -1; });
  say(word('read_csv', { n: pairs.length }));
}
async function copy(area) {
  try { await navigator.clipboard.writeText(area.value); say(word('copied')); } catch { area.select(); say(word(document.execCommand('copy') ? 'copied' : 'no_copy')); }
}
