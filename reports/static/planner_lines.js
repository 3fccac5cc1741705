/* Counting lines: who crossed each in the days and hours chosen, on a plate beside the line and in the table below the map. */

const LINES = M.lines.lines, PLATE = { row: 17, pad: 6, gap: 7 }, NOTE = $('crossed').caption.querySelector('small'), EVERY = NOTE.textContent;
state.lines = true;

/* What is chosen of a line: crossings to the left and to the right, quarter-hours not recorded, open ones, for each of its
   days or hours in which it was there; null where readers have no number, which is of some hours of some days. */
function chosenOf(line) {
  const days = [0, 1, 2, 3, 4, 5, 6].filter(d => state.days[d]), isAllHours = state.from === hours[0] && state.to === hours[1];
  const rows = isAllHours ? days.length === 7 ? [line.week] : days.map(d => line.days[d])
    : line.slots ? days.flatMap(d => line.slots[d].slice(state.from, state.to)) : days.length === 7 ? line.hours.slice(state.from, state.to) : null;
  return rows && rows.filter(Boolean);
}

/* The number of a side, or why there is none: one hidden part hides the sum, parts that were not recorded are left out. */
function crossed(rows, side) {
  if (!rows) return { n: null, why: '' };
  const found = rows.map(r => r[side]), known = found.filter(n => n >= 0), reasons = found.filter(n => n < 0).map(n => M.lines.reasons[-1 - n]);
  const why = reasons.find(r => r.hides) || !known.length && reasons[0];
  return why ? { n: null, why: why.why } : { n: sum(known), why: '' };
}

function setLines() {
  document.body.dataset.lines = state.lines ? 'on' : 'off';
  if ($('lines')) $('lines').checked = state.lines;
  const table = [...$('crossed').tBodies[0].rows];
  LINES.forEach((line, k) => {
    const rows = chosenOf(line), isThere = !rows || rows.length > 0, sides = [0, 1].map(side => crossed(rows, side));
    line.now = isThere && sides;
    table[k].hidden = !isThere;
    sides.forEach(({ n, why }, side) => {
      const name = word('lines_of', { side: line[side ? 'right' : 'left'] }), cell = table[k].cells[1 + side];
      cell.querySelector('b').textContent = n === null ? NONE : nf(n, 0);
      cell.querySelector('small').textContent = why ? `${name}: ${why}` : name;
    });
    const [missing, open] = [2, 3].map(i => sum((rows || []).map(r => r[i])));
    table[k].cells[3].textContent = open ? share(1 - missing / open) : NONE;
  });
  NOTE.textContent = LINES.some(line => !chosenOf(line)) ? word('lines_either') : EVERY;
  $('crossed').hidden = LINES.every(line => !line.now);
  if (!svg) return;
  all('.cl').forEach(path => path.classList.toggle('away', !LINES[path.dataset.line].now));
  makePlates();
}

/* A plate beside each line: its name, and for each side an arrow, how many went there, and the side's name where the map is wide. */
function makePlates() {
  const plates = $('plates'), unit = state.view.w / Math.max(1, svg.clientWidth), add = (tag, attributes, text = '') => { const e = document.createElementNS(svg.namespaceURI, tag); for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v); e.textContent = text; plates.append(e); return e; };
  plates.textContent = '';
  if (!state.lines) { namedAt = 0; setNames(unit); return; }
  const taken = all('.hm').map(boxOf), isWide = svg.clientWidth >= 600, px = v => v * unit * (isWide ? 1 : 0.85);
  for (const line of LINES.filter(l => l.now && l.ends.length)) {
    const [[x0, y0], [x1, y1]] = line.ends, long = Math.hypot(x1 - x0, y1 - y0), left = [(y1 - y0) / long, (x0 - x1) / long];
    const box = add('rect', { class: 'cp', rx: px(3) }), name = add('text', { class: 'ct' }, line.name);
    const rows = line.now.map(({ n }, side) => [add('path', { class: `ca${side}` }), add('text', { class: 'cn' }, n === null ? NONE : nf(n, 0)), isWide ? add('text', { class: 'ct' }, line[side ? 'right' : 'left']) : null]);
    const wide = t => t ? t.getComputedTextLength() : 0, numbers = Math.max(...rows.map(r => wide(r[1]))), inner = Math.max(wide(name), px(20) + numbers + Math.max(...rows.map(r => r[2] ? px(PLATE.gap) + wide(r[2]) : 0)));
    const [width, height] = [inner + px(2 * PLATE.pad), px(3 * PLATE.row + 2 * PLATE.pad - 2)], away = (width * Math.abs(left[0]) + height * Math.abs(left[1])) / 2 + px(PLATE.gap);
    const places = [0.5, 0.15, 0.85].flatMap(t => [1, -1].map(s => ({ x: x0 + t * (x1 - x0) + s * left[0] * away - width / 2, y: y0 + t * (y1 - y0) + s * left[1] * away - height / 2, width, height })));
    const isIn = b => b.x > 0 && b.y > 0 && b.x + width < W && b.y + height < H, at = places.find(b => isIn(b) && !taken.some(t => meet(t, b)));
    const parts = [box, name, ...rows.flat().filter(Boolean)];
    if (!at) { parts.forEach(e => e.remove()); continue; }
    taken.push(at);
    for (const [k, v] of Object.entries(at)) box.setAttribute(k, v);
    const put = (e, x, row) => { e.setAttribute('x', x); e.setAttribute('y', at.y + px(PLATE.pad + PLATE.row * (row + 0.5) - 1)); };
    put(name, at.x + px(PLATE.pad), 0);
    rows.forEach(([arrow, number, side], k) => {
      const from = at.x + px(PLATE.pad), [ux, uy] = left.map(v => k ? -v : v), cx = from + px(6), cy = at.y + px(PLATE.pad + PLATE.row * (k + 1.5) - 1);
      const point = (along, across) => `${(cx + px(along) * ux - px(across) * uy).toFixed(1)} ${(cy + px(along) * uy + px(across) * ux).toFixed(1)}`;
      arrow.setAttribute('d', `M${point(-6, 0)}L${point(6, 0)}M${point(1.5, -4)}L${point(6, 0)}L${point(1.5, 4)}`);
      put(number, from + px(20) + numbers - wide(number), k + 1);
      if (side) put(side, from + px(20) + numbers + px(PLATE.gap), k + 1);
    });
  }
  namedAt = 0; setNames(unit);
}

const saidOf = line => `${line.name}: ${line.now.map(({ n }, side) => `${n === null ? NONE : nf(n, 0)} ${word('lines_of', { side: line[side ? 'right' : 'left'] })}`).join(', ')}`;
overlays.push({
  set: setLines,
  look: makePlates,
  write: () => state.lines ? '' : 'lines=off',
  read(take) { state.lines = take('lines', /^off$/) === null; },
  listen(on) { on('lines', 'change', e => { state.lines = e.target.checked; retell(); }); },
  name: () => '',
  save(layer, shapes) {
    const drawn = state.lines ? LINES.filter(l => l.now && l.ends.length) : [];
    layer('counting-lines', shapes('.cl:not(.over)').map((s, k) => ({ ...s, isClosed: false, name: saidOf(drawn[k]) })));
    layer('crossings', drawn.map(l => {
      const [[x0, y0], [x1, y1]] = l.ends, isUpright = Math.abs(y1 - y0) > Math.abs(x1 - x0), beside = [isUpright ? -30 : 0, isUpright ? 0 : -30];
      return { text: saidOf(l), at: metres([(x0 + x1) / 2 + beside[0], (y0 + y1) / 2 + beside[1]]), isUpright, isCentred: true };
    }));
  },
});
