/* The map as a drawing in floor metres, in layers: SVG for any program that draws, DXF for CAD, GeoJSON for analysts.
   It holds what is drawn on the page at that moment, of the whole floor, whatever part is in view. */

/* Floor metres of a point of the map, whose units are centimetres from its upper left corner: x to the right, y up. */
const metres = ([x, y]) => [M.extent[0] + x / 100, M.extent[3] - y / 100].map(v => Math.round(v * 1000) / 1000);

/* The rings of a path, curves as eight straight lines. */
function ringsOf(d) {
  const rings = [], tokens = d.match(/[a-z]|-?\d*\.?\d+(?:e-?\d+)?/gi) || [];
  let at = [0, 0], start = at, command = '', i = 0;
  const number = () => +tokens[i++], to = p => { at = p; rings.at(-1).push(p); };
  const point = isRelative => { const [x, y] = [number(), number()]; return isRelative ? [at[0] + x, at[1] + y] : [x, y]; };
  while (i < tokens.length) {
    if (/[a-z]/i.test(tokens[i])) command = tokens[i++];
    const kind = command.toUpperCase(), isRelative = kind !== command;
    if (kind === 'Z') { at = start; continue; }
    if (kind === 'M') { at = start = point(isRelative); rings.push([at]); command = isRelative ? 'l' : 'L'; }
    else if (kind === 'L') to(point(isRelative));
    else if (kind === 'H') to([isRelative ? at[0] + number() : number(), at[1]]);
    else if (kind === 'V') to([at[0], isRelative ? at[1] + number() : number()]);
    else {
      const from = at, control = Array.from({ length: { Q: 2, C: 3 }[kind] }, () => point(isRelative));
      const bezier = (points, t) => points.length === 1 ? points[0] : bezier(points.slice(1).map((p, k) => p.map((v, n) => points[k][n] + t * (v - points[k][n]))), t);
      for (let k = 1; k <= 8; k++) to(bezier([from, ...control], k / 8));
    }
  }
  return rings.filter(ring => ring.length > 1);
}

/* What is drawn, layer by layer from below: polygons, lines and texts in floor metres, each with its colours and name. */
function layersOf() {
  const map = M.maps[state.map], look = e => { const s = getComputedStyle(e); return { fill: +s.fillOpacity ? s.fill : 'none', stroke: s.stroke, dash: s.strokeDasharray }; }, layers = [];
  const isDrawn = e => { const s = getComputedStyle(e); return s.display !== 'none' && s.visibility !== 'hidden' && !e.closest('[hidden]'); };
  const layer = (name, shapes) => { const full = shapes.filter(s => s.rings ? s.rings.length : s.text); if (full.length) layers.push({ name, shapes: full }); };
  const shapes = (selector, named = () => '') => [...svg.querySelectorAll(selector)].filter(isDrawn).map(e => ({ rings: ringsOf(e.getAttribute('d') || '').map(r => r.map(metres)), isClosed: true, name: named(e), ...look(e) }));
  const texts = selector => [...svg.querySelectorAll(selector)].filter(isDrawn).map(e => ({ text: e.textContent, at: metres([+e.getAttribute('x'), +e.getAttribute('y')]), isUpright: e.hasAttribute('transform'), isCentred: getComputedStyle(e).textAnchor === 'middle' }));
  const legend = list => [...document.querySelectorAll(`.leg.${list}-${state.map} li`)].slice(list === 'l' ? 1 : 0).filter(li => !li.querySelector('.b0')).map(li => li.textContent.trim());
  const isHour = state.show === 'hour', isPlain = map.kind !== 'excess' && state.show !== 'difference' && !(isHour && state.as === 'difference'), named = isPlain ? legend('l') : isHour ? all('.replay-difference li').filter(li => !li.querySelector('.b0')).map(li => li.textContent.trim()) : legend('d');
  const bands = (group, name) => [...$(group).children].slice(0, 9).forEach((path, i) => {
    if (!isPlain && i < 5) return;
    const k = isPlain ? i : { f2: 0, f1: 1, m1: 2, m2: 3 }[path.getAttribute('class')];
    layer(`${name}-${k + 1}`, [{ rings: ringsOf(path.getAttribute('d') || '').map(r => r.map(metres)), isClosed: true, name: named[k] || '', ...look(path) }]);
  });
  layer('floor', [{ rings: [ringsOf(`M0 0h${M.size[0]}v${M.size[1]}h-${M.size[0]}z`)[0].map(metres)], isClosed: true, name: '', ...look(svg.querySelector('.fl')) }]);
  const key = sign => document.querySelector(`.k-${sign}`).parentElement.textContent.trim(), place = id => (M.places.find(p => p.id === id) || { name: '' }).name;
  if (state.show === 'split') bands('ga', 'map-before');
  bands(isHour ? 'replayed' : 'gb', 'map');
  if (isHour) shapes('.rg').forEach((s, k) => layer(`rings-${k + 1}`, [{ ...s, name: all('.replay-rings li')[k].textContent.trim() }]));
  layer('not-recorded', shapes('#wb .nv,#replayed .nv,.nv.unseen', () => key('off')));
  layer('too-little-data', shapes('#wb .dt,#replayed .dt', () => key('dots')));
  layer('fixtures', shapes('.fx,.fw'));
  layer('layout-before', shapes('.try-was'));
  layer('layout-tried', shapes('.try', e => nameTried(e.dataset.try)));
  layer('areas', shapes('.ar', e => place(e.dataset.area)));
  layer('hotspots', shapes('.hs', e => (M.spots[all('.hs').indexOf(e)] || { name: '' }).name));
  overlays.forEach(l => l.save(layer, shapes));
  if (state.rect) layer('selection', [{ rings: [[[0, 1], [2, 1], [2, 3], [0, 3]].map(([i, j]) => [state.rect[i], state.rect[j]])], isClosed: true, name: place(state.place), ...look($('rect')) }]);
  layer('names', [...texts('.fn'), ...texts('.pt'), ...texts('.hn'), ...texts('.try-name')]);
  return layers;
}

/* SVG: layers as Inkscape names them, by a name that looks like an address and is none; one unit is one metre, printed 1 to 100; y is minus the floor's y. */
function drawingSvg(layers, lines) {
  const space = svg.namespaceURI, inkscape = ['http:', '', 'www.inkscape.org', 'namespaces', 'inkscape'].join('/'), [x0, y0, x1, y1] = M.extent;
  const head = 0.6 * (lines.length + 1), maps = layers.filter(l => l.name.startsWith('map')), foot = 0.6 * (maps.length + 1), font = getComputedStyle(document.body), root = document.implementation.createDocument(space, 'svg').documentElement;
  const add = (parent, tag, attributes, text) => { const e = parent.ownerDocument.createElementNS(space, tag); for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v); if (text !== undefined) e.textContent = text; parent.append(e); return e; };
  root.setAttribute('viewBox', `${x0} ${-y1 - head} ${x1 - x0} ${y1 - y0 + head + foot}`); root.setAttribute('width', `${(x1 - x0) * 10}mm`); root.setAttribute('height', `${(y1 - y0 + head + foot) * 10}mm`);
  add(root, 'title', {}, lines[0]); add(root, 'desc', {}, [...lines.slice(1), word('drawing_svg')].join('\n'));
  add(root, 'rect', { x: x0, y: -y1 - head, width: x1 - x0, height: y1 - y0 + head + foot, fill: font.backgroundColor });
  const hatch = add(add(root, 'defs', {}), 'pattern', { id: 'hatch', width: 0.2, height: 0.2, patternUnits: 'userSpaceOnUse', patternTransform: 'rotate(45)' });
  add(hatch, 'path', { d: 'M0 0V0.2', stroke: getComputedStyle($('hatline')).stroke, 'stroke-width': 0.04 });
  const group = name => { const g = add(root, 'g', { id: name }); g.setAttributeNS(inkscape, 'inkscape:groupmode', 'layer'); g.setAttributeNS(inkscape, 'inkscape:label', name); return g; };
  const titles = group('title');
  lines.forEach((line, k) => add(titles, 'text', { x: x0 + 0.2, y: -y1 - head + 0.6 * (k + 1), 'font-size': k ? 0.3 : 0.45, 'font-family': 'sans-serif', fill: font.color }, line));
  for (const { name, shapes } of layers) {
    const g = group(name);
    for (const s of shapes) {
      if (s.text !== undefined) {
        const [x, y] = s.isCentred ? [s.at[0], -s.at[1]] : [s.at[0] + 0.1, -s.at[1] + 0.35];
        add(g, 'text', { x, y, 'font-size': 0.3, 'font-family': 'sans-serif', fill: font.color, ...s.isCentred ? { 'text-anchor': 'middle', 'dominant-baseline': 'central' } : {}, ...s.isUpright ? { transform: `rotate(-90 ${x} ${y})` } : {} }, s.text);
        continue;
      }
      const fill = s.fill.startsWith('url') ? 'url(#hatch)' : s.isClosed ? s.fill : 'none', d = s.rings.map(r => `M${r.map(([x, y]) => `${x} ${-y}`).join('L')}${s.isClosed ? 'Z' : ''}`).join('');
      const path = add(g, 'path', { d, fill, stroke: s.stroke, 'stroke-width': 0.03, 'fill-rule': 'evenodd', ...s.dash && s.dash !== 'none' ? { 'stroke-dasharray': '0.1 0.13' } : {} });
      if (s.name) add(path, 'title', {}, s.name);
    }
  }
  const legend = group('legend');
  maps.forEach((l, k) => {
    const y = -y0 + 0.6 * (k + 1);
    add(legend, 'path', { d: `M${x0 + 0.2} ${y - 0.3}h0.6v0.35h-0.6z`, fill: l.shapes[0].fill, stroke: font.color, 'stroke-width': 0.02 });
    add(legend, 'text', { x: x0 + 1, y, 'font-size': 0.3, 'font-family': 'sans-serif', fill: font.color }, l.shapes[0].name);
  });
  return `${new XMLSerializer().serializeToString(root)}\n`;
}

/* DXF in the oldest form (AC1009), which every CAD program reads: outlines and texts on layers, in metres. */
function drawingDxf(layers, lines) {
  const out = [], put = (code, value) => out.push(`${String(code).padStart(3)}\n${value}`);
  const text = s => [...s.replace(/[\u0000-\u001f\u007f]/g, ' ')].map(c => c > '~' ? [...Array(c.length).keys()].map(i => `\\U+${c.charCodeAt(i).toString(16).toUpperCase().padStart(4, '0')}`).join('') : c).join('');
  const layer = name => name.toUpperCase().replaceAll('-', '_'), colour = name => { const k = /^map.*-(\d)$/.exec(name); return k ? [51, 41, 31, 21, 11][k[1] - 1] : { hotspots: 1, areas: 5, fixtures: 8, names: 7, 'layout-tried': 3, 'layout-before': 6 }[name] || 9; };
  const write = (name, words, [x, y], height, turn) => { put(0, 'TEXT'); put(8, layer(name)); put(10, x); put(20, y); put(40, height); put(1, text(words)); if (turn) put(50, turn); };
  put(0, 'SECTION'); put(2, 'HEADER'); put(9, '$ACADVER'); put(1, 'AC1009'); put(9, '$INSUNITS'); put(70, 6); put(9, '$MEASUREMENT'); put(70, 1); put(0, 'ENDSEC');
  put(0, 'SECTION'); put(2, 'TABLES'); put(0, 'TABLE'); put(2, 'LAYER'); put(70, layers.length + 1);
  for (const name of ['title', ...layers.map(l => l.name)]) { put(0, 'LAYER'); put(2, layer(name)); put(70, 0); put(62, colour(name)); put(6, 'CONTINUOUS'); }
  put(0, 'ENDTAB'); put(0, 'ENDSEC'); put(0, 'SECTION'); put(2, 'ENTITIES');
  for (const { name, shapes } of layers) for (const s of shapes) {
    if (s.text !== undefined) { write(name, s.text, s.at, 0.25, s.isUpright ? 90 : 0); continue; }
    for (const ring of s.rings) {
      put(0, 'POLYLINE'); put(8, layer(name)); put(66, 1); put(10, 0); put(20, 0); put(30, 0); put(70, s.isClosed ? 1 : 0);
      for (const [x, y] of ring) { put(0, 'VERTEX'); put(8, layer(name)); put(10, x); put(20, y); put(30, 0); }
      put(0, 'SEQEND'); put(8, layer(name));
    }
  }
  [...lines, ...layers.filter(l => l.name.startsWith('map')).map(l => `${layer(l.name)}: ${l.shapes[0].name}`)].forEach((line, k) => write('title', line, [M.extent[0], M.extent[1] - 0.6 * (k + 1)], 0.3));
  put(0, 'ENDSEC'); put(0, 'EOF');
  return `${out.join('\n')}\n`;
}

/* GeoJSON: a ring that lies in an odd number of others is a hole. */
function drawingGeoJson(layers, lines) {
  const area = ring => ring.reduce((sum, [x, y], k) => { const [u, v] = ring[(k + 1) % ring.length]; return sum + x * v - u * y; }, 0) / 2;
  const isIn = ([x, y], ring) => ring.reduce((inside, [x1, y1], k) => { const [x2, y2] = ring[(k + 1) % ring.length]; return y1 > y !== y2 > y && x < (x2 - x1) * (y - y1) / (y2 - y1) + x1 ? !inside : inside; }, false);
  const closed = (ring, isHole) => { const way = area(ring) < 0 === isHole ? ring : [...ring].reverse(); return [...way, way[0]]; };
  const polygons = rings => {
    const depth = rings.map((ring, k) => rings.filter((other, j) => j !== k && isIn(ring[0], other)).length);
    return rings.flatMap((ring, k) => depth[k] % 2 ? [] : [[closed(ring, false), ...rings.filter((hole, j) => depth[j] === depth[k] + 1 && isIn(hole[0], ring)).map(hole => closed(hole, true))]]);
  };
  const feature = (name, s) => ({ type: 'Feature', properties: { layer: name, name: s.text === undefined ? s.name : s.text },
    geometry: s.text !== undefined ? { type: 'Point', coordinates: s.at } : s.isClosed ? { type: 'MultiPolygon', coordinates: polygons(s.rings.filter(r => r.length > 2)) } : { type: 'MultiLineString', coordinates: s.rings } });
  return `${JSON.stringify({ type: 'FeatureCollection', title: lines[0], shown: lines.slice(1), unit: M.maps[state.map].unit, coordinates: word('drawing_geojson'), features: layers.flatMap(l => l.shapes.map(s => feature(l.name, s))) })}\n`;
}

/* Save the map in a format: svg, dxf or geojson. */
function saveDrawing(format) {
  const lines = [...drawn(), M.maps[state.map].unit], make = { svg: drawingSvg, dxf: drawingDxf, geojson: drawingGeoJson }[format];
  saveFile(make(layersOf(), lines), { svg: 'image/svg+xml', dxf: 'image/vnd.dxf', geojson: 'application/geo+json' }[format], fileName(format));
}
function saveFile(text, type, name) {
  const link = document.createElement('a'); link.download = name; link.href = URL.createObjectURL(new Blob([text], { type })); link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  say(word('picture', { file: name }));
}
