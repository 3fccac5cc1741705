/* What the page knows and what it works out: packed sums by hour, camera, place and cell, and what is selected of them. */

const $ = id => document.getElementById(id), all = s => [...document.querySelectorAll(s)];
const M = JSON.parse($('meta').textContent);

/* A sentence of the page's catalogue with its named places filled. */
const FORMS = new Intl.PluralRules(document.documentElement.lang);
const word = (key, values = {}, plural = 2) => { const entry = M.words[key]; return (entry.other ? entry[FORMS.select(plural)] || entry.other : entry).replace(/\{(\w+)\}/g, (_, name) => values[name]); };

/* ---- the packed data: numbers of seven bits a byte or in planes of bytes, see vsd_analytics/planner/pack.py ---- */
/* Base 85: five signs for four bytes, in the order of their codes; these mean something in a page and are no signs. */
const NO_SIGNS = [34, 38, 39, 60, 62, 92, 96, 123, 125];
function decoded(text) {
  const of = new Uint8Array(127), n = text.length, a = new DataView(new ArrayBuffer(4 * Math.ceil(n / 5)));
  for (let code = 33, k = 0; code < 127; code++) if (!NO_SIGNS.includes(code)) of[code] = k++;
  for (let i = 0, at = 0; i < n; at += 4) { let v = 0; for (const end = i + 5; i < end; i++) v = v * 85 + (i < n ? of[text.charCodeAt(i)] : 84); a.setUint32(at, v); }
  return new Uint8Array(a.buffer, 0, Math.floor(n * 4 / 5));
}
async function unpack(text) {
  const bytes = decoded(text);
  const gzip = new DecompressionStream('gzip'), into = gzip.writable.getWriter();
  into.write(bytes).catch(() => {}); into.close().catch(() => {});
  return new Uint8Array(await new Response(gzip.readable).arrayBuffer());
}

function reader(b) {
  let i = 0;
  const one = () => { let v = b[i++]; if (v < 128) return v; v &= 127; for (let f = 128; ; f *= 128) { const c = b[i++]; v += (c & 127) * f; if (c < 128) return v; } };
  const many = n => {
    const a = new Float64Array(n);
    for (let k = 0; k < n; k++) {
      let v = b[i++];
      if (v > 127) { v &= 127; for (let f = 128; ; f *= 128) { const c = b[i++]; v += (c & 127) * f; if (c < 128) break; } }
      a[k] = v;
    }
    return a;
  };
  const wide = n => { const a = new Float64Array(n); for (let p = b[i++], f = 1; p--; f *= 256) for (let k = 0; k < n; k++) a[k] += b[i++] * f; return a; };
  const keys = n => { const a = many(n); for (let k = 1; k < n; k++) a[k] += a[k - 1]; return a; };
  const part = () => { const n = one(); i += n; return reader(b.subarray(i - n, i)); };
  return { one, many, wide, keys, part };
}

/* What is read only when it is first asked for. */
function lazily(makers, made = {}) {
  for (const [name, make] of Object.entries(makers)) Object.defineProperty(made, name, { configurable: true, get() { const value = make(); Object.defineProperty(made, name, { value }); return value; } });
  return made;
}

function readPanel(r) {
  const C = M.rows, P = M.byHour, S = r.one(), p = { S };
  for (const k of ['day', 'weekday', 'hour', 'fold']) p[k] = r.many(S);
  const rec = r.many(C * S);
  p.recorded = rec.map(v => Math.floor(v / 2) / 3.6e6); p.counted = rec.map(v => v % 2);
  p.n = r.wide(P * C * S); const unit = r.one(); p.time = scaled(r.wide(P * C * S), unit / 3.6e6); p.close = scaled(r.wide(P * C * S), unit / 1e3);
  return p;
}

/* A table by camera, cell and hour: the sums of each camera and cell, and, read only when asked for, their hours. */
function readTable(sums, hours, cells, kinds, unit) {
  const n = sums.one(), key = sums.keys(n), t = { n, camera: new Uint8Array(n), cell: new Int32Array(n) };
  for (let i = 0; i < n; i++) { t.camera[i] = Math.floor(key[i] / cells); t.cell[i] = key[i] % cells; }
  for (const kind of kinds) t[kind] = scaled(sums.many(n), unit);
  return hours ? lazily({ rows: () => readRows(t, hours, kinds, unit) }, t) : t;
}
const scaled = (a, unit) => { if (unit !== 1) for (let i = 0; i < a.length; i++) a[i] *= unit; return a; };
function readRows(t, r, kinds, unit) {
  const size = r.many(t.n), n = sum(size), rows = { n, camera: new Uint8Array(n), cell: new Int32Array(n), slot: r.many(n) };
  for (let i = 0, k = 0; i < t.n; i++) for (let j = 0, slot = 0; j < size[i]; j++, k++) { slot += rows.slot[k]; rows.slot[k] = slot; rows.camera[k] = t.camera[i]; rows.cell[k] = t.cell[i]; }
  for (const kind of kinds) rows[kind] = scaled(r.wide(n), unit);
  return rows;
}

function readCells(parts, nCells) {
  const across = M.grid.cellsAcross, [violations, violationHours, split, time, timeHours, excess] = parts;
  return lazily({
    violations: () => readTable(violations, violationHours, nCells * across * across, ['v'], 1),
    split: () => readSplit(split, nCells, across),
    time: () => { const unit = time.one() / 3.6e6; return readTable(time, timeHours, nCells, ['v', 'w'], unit); },
    excess: () => {
      const nx = excess.one(), ny = excess.one();
      return { nx, ny, x: excess.one() - 1e6, y: excess.one() - 1e6, v: excess.many(nx * ny).map(v => v ? (v - 1) / 100 : NaN) };
    },
  });
}

/* A page for readers: recorded hours of each camera, of the whole week and of what is compared; their cells come later. */
function readWeek(r, p) {
  const [apart, pair] = [0, 1].map(() => r.many(M.cameras).map(v => v / 3.6e6));
  p.sums = { isSide: true, hours: apart.map((h, c) => h + pair[c]) }; p.pair = M.notCompared ? null : { isSide: true, hours: pair };
}
function readWeekCells(parts, nCells, p) {
  const halves = nCells * M.grid.cellsAcross ** 2, [violations, split, time, violationsOfPair, timeOfPair] = parts;
  const read = (v, t) => ({ violations: () => readTable(v, null, halves, ['v'], 1), time: () => { const unit = t.one() / 3.6e6; return readTable(t, null, nCells, ['v', 'w'], unit); } });
  p.cells = p.sums.cells = lazily({ ...read(violations, time), split: () => readSplit(split, nCells, M.grid.cellsAcross) });
  if (p.pair) p.pair.cells = lazily(read(violationsOfPair, timeOfPair));
}

/* The matched weeks on one side of a logged change: sums over the hours that both sides recorded. */
function readSide(r, hasCells, nCells) {
  const C = M.cameras, n = M.places.length * C, across = M.grid ? M.grid.cellsAcross : 0;
  const p = { isSide: true, hours: r.many(C).map(v => v / 3.6e6), n: r.many(n), time: r.many(n).map(v => v / 3.6e6), close: r.many(n).map(v => v / 1e3) };
  if (hasCells) p.cells = { violations: readTable(r, null, nCells * across * across, ['v'], 1), time: readTable(r, null, nCells, ['v', 'w'], 100 / 3.6e6) };
  return p;
}

/* How violations lie inside cells of half a metre, by camera: in each fine cell, and in all of a cell of half a metre. */
function readSplit(r, nCells, across) {
  const k = M.grid.fineAcross / across, wide = M.grid.nx * M.grid.fineAcross, halves = nCells * across * across, n = r.one(), key = r.keys(n), v = r.many(n);
  const per = k * k, part = new Float64Array(M.cameras * halves * per), total = new Float64Array(M.cameras * halves);
  for (let i = 0; i < n; i++) {
    const c = Math.floor(key[i] / (halves * per)), cell = key[i] % (halves * per), x = cell % wide, y = Math.floor(cell / wide);
    const half = c * halves + Math.floor(y / k) * (wide / k) + Math.floor(x / k);
    part[half * per + (y % k) * k + x % k] += v[i]; total[half] += v[i];
  }
  return { part, total };
}

/* ---- what is selected ---- */
/* Layers over the map that only some pages have, each in a file of its own. A layer has `set` (shows what is chosen), `write` (its
   part of the address), `read` (from the address), `listen`, `name` (in the words of the controls) and `save` (to a drawing);
   `look`, if it has one, is called when the scale changes. */
const overlays = [];

const hours = M.hours, state = { show: 'week', map: 'violations', days: [1, 1, 1, 1, 1, 1, 1], from: hours[0], to: hours[1], place: 'floor', rect: null, view: null, cut: 50, change: 0, as: 'now' };
let week, before, past, fine, seen = null, isDrawing = false, corner = null;

const chosen = p => Uint8Array.from(p.hour, (h, i) => state.days[p.weekday[i]] && h >= state.from && h < state.to ? 1 : 0);
const isPair = () => state.show === 'split' || state.show === 'difference';
const noDay = () => !state.days.some(Boolean);
const isWhole = () => state.days.every(Boolean) && state.from === hours[0] && state.to === hours[1];

/* For each hour of this week the same hour of the other, or -1; and which camera-hours both can answer for. */
function pairHours() {
  if (!before) return;
  const key = (p, i) => `${p.weekday[i]} ${p.hour[i]} ${p.fold[i]}`, at = new Map();
  for (let i = 0; i < before.S; i++) at.set(key(before, i), i);
  week.twin = Int32Array.from({ length: week.S }, (_, i) => at.has(key(week, i)) ? at.get(key(week, i)) : -1);
  week.same = new Uint8Array(M.rows * week.S); before.same = new Uint8Array(M.rows * before.S);
  for (let c = 0; c < M.rows; c++) for (let i = 0; i < week.S; i++) {
    const j = week.twin[i];
    if (j >= 0 && M.comparable[c] && week.counted[c * week.S + i] && before.counted[c * before.S + j]) week.same[c * week.S + i] = before.same[c * before.S + j] = 1;
  }
}

/* Sums by camera and day of a place over some camera-hours: {n, x} for the violation rate, {n, x} of one row for the encounter rate. */
function panelOf(p, used, place, close_cameras = closeCameras(place, p)) {
  const on = chosen(p), C = M.rows, S = p.S, days = [], weekday = [], column = new Int32Array(S).fill(-1);
  for (let i = 0; i < S; i++) if (on[i]) {
    if (days[days.length - 1] !== p.day[i]) { days.push(p.day[i]); weekday.push(p.weekday[i]); }
    column[i] = days.length - 1;
  }
  const blank = () => new Array(days.length).fill(0), n = [], x = [], time = blank(), close = blank(), closeTime = blank();
  for (let c = 0; c < C; c++) {
    const nc = blank(), xc = blank(); n.push(nc); x.push(xc);
    if (!place.rows[c] && !close_cameras[c]) continue;
    const base = (place.index * C + c) * S, told = place.index >= 0;
    for (let i = 0; i < S; i++) if (column[i] >= 0 && used[c * S + i]) {
      const d = column[i];
      if (told && close_cameras[c]) { closeTime[d] += p.time[base + i]; close[d] += p.close[base + i]; }
      if (!place.rows[c]) continue;
      xc[d] += p.recorded[c * S + i];
      if (told) { nc[d] += p.n[base + i]; time[d] += p.time[base + i]; }
    }
  }
  if (place.index < 0) {
    const inside = place.squares, A = M.grid.cellsAcross, wide = M.grid.nx * A, square = k => Math.floor(Math.floor(k / wide) / A) * M.grid.nx + Math.floor(k % wide / A);
    const v = p.cells.violations.rows, t = p.cells.time.rows;
    for (let i = 0; i < v.n; i++) if (on[v.slot[i]] && used[v.camera[i] * S + v.slot[i]] && place.cameras[v.camera[i]] && inside[square(v.cell[i])]) n[v.camera[i]][column[v.slot[i]]] += v.v[i];
    for (let i = 0; i < t.n; i++) if (on[t.slot[i]] && used[t.camera[i] * S + t.slot[i]] && place.cameras[t.camera[i]] && inside[t.cell[i]]) {
      const d = column[t.slot[i]]; time[d] += t.v[i];
      if (close_cameras[t.camera[i]]) { closeTime[d] += t.v[i]; close[d] += t.w[i] * 3600; }
    }
  }
  const total = time.map((_, d) => sum(n.map(row => row[d])));
  return { violationRate: { n, x }, encounterRate: { n: [total], x: [time] }, close: { n: [close], x: [closeTime] }, weekday, hours: sum(x.map(sum)) / Math.max(1, sum(place.rows)) };
}

/* Some squares of the floor as a place: the cameras that ever counted anybody in them. */
function squaresAsPlace(id, name, numbers) {
  const g = M.grid, A = g.cellsAcross, squares = new Uint8Array(g.nx * g.ny), place = { id, name, index: -1, squares, cameras: new Array(M.cameras).fill(0), hidden: [null, null] };
  place.rows = place.cameras;
  for (const k of numbers) squares[k] = 1;
  for (const p of [week, before]) if (p && p.cells) for (const [t, a] of [[p.cells.violations, A], [p.cells.time, 1]]) for (let i = 0; i < t.n; i++) {
    const x = Math.floor(t.cell[i] % (g.nx * a) / a), y = Math.floor(Math.floor(t.cell[i] / (g.nx * a)) / a);
    if (squares[y * g.nx + x] && M.able[t.camera[i]]) place.cameras[t.camera[i]] = 1;
  }
  return place;
}
function rectangle() {
  const [x0, y0, x1, y1] = state.rect, g = M.grid, inside = [];
  for (let y = y0; y < y1; y++) for (let x = x0; x < x1; x++) inside.push((y - g.y0) * g.nx + x - g.x0);
  return squaresAsPlace('rect', word('rectangle'), inside);
}

const spotNow = () => M.spots.find(s => s.id === state.place);
function placeNow() {
  if (state.place === 'rect' && state.rect) return rectangle();
  const spot = spotNow();
  return spot && week.cells ? squaresAsPlace(spot.id, spot.name, spot.squares) : M.places.find(p => p.id === state.place) || M.places[0];
}

/* Whose person-time makes the share of time too close, as in the report (M6): cameras that know distances. */
const closeCameras = (place, p) => { const [now, then] = (place.index >= 0 ? place : M.places[0]).close; return p === before ? then : now; };
const closeInBoth = place => closeCameras(place, week).map((v, c) => v & closeCameras(place, before)[c]);

const nothing = reason => ({ rate: null, lo: null, hi: null, n: null, ok: false, reason });

/* A page for readers: the report's figures of the whole week; of squares, plain sums of the week without a range. */
function weekRates(place) {
  const isSquares = place.index < 0, plain = p => isSquares && p ? sideRates(p, place) : null, now = plain(week.sums), [a, b] = [before && before.pair, week.pair].map(plain);
  const few = isSquares && now.n < M.rules.mask ? word('reason.masked', { n: M.rules.mask }) : null, hide = place.hidden[0] || (sum(place.cameras) ? few : word('reason.nobody'));
  const none = k => M.noViolations || k !== 'violationRate' && M.noExposure || hide, hoursOf = p => sum(p.hours.filter((_, c) => place.cameras[c])) / Math.max(1, sum(place.cameras));
  const told = { place, hours: hoursOf(week.sums), change: null };
  for (const k of KINDS) told[k] = none(k) ? nothing(none(k)) : isSquares ? { rate: now[k], lo: null, hi: null, n: now.n, ok: true, reason: word('no_range') } : { ...place.week[k], n: null, ok: true };
  if (!before || M.notCompared || hide || place.hidden[1] || M.noViolations) return told;
  told.change = { hours: hoursOf(week.pair) };
  const pair = (rateA, theta, more) => ({ rateA, rateB: rateA === null || theta === null ? null : rateA * theta, theta, nA: 1, nB: 1, xA: Infinity, lo: null, hi: null, verdict: 'too_little_data', reason: '', ...more });
  for (const k of KINDS) {
    const report = place.report && place.report[k], isMany = isSquares && a && a.n >= M.rules.mask && b.n >= M.rules.mask;
    told.change[k] = none(k) ? null : report ? pair(report.previous, report.theta, report) : isMany ? pair(a[k], a[k] ? b[k] / a[k] : null, { isPlain: Boolean(a[k]), reason: word('no_range') }) : pair(null, null, { reason: isSquares ? word('reason.masked', { n: M.rules.mask }) : '' });
  }
  return told;
}

/* Everything said about a place: this week's rates and, where the weeks can be compared, the change. */
function rates(place) {
  if (M.isShared && (place.index || isWhole())) return weekRates(place);
  const now = panelOf(week, week.counted, place), hide = place.hidden[0] || (sum(place.cameras) ? null : word('reason.nobody'));
  const usual = place.index >= 0 && place.past && past ? panelOf(past, past.counted, place) : null;
  const history = (kind, k) => usual && { n: usual[kind].n, x: usual[kind].x, weekday: usual.weekday };
  const told = {
    place, hours: now.hours,
    violationRate: M.noViolations ? nothing(M.noViolations) : hide ? nothing(hide) : violationRateOf(now.violationRate, M.rules, now.weekday, history('violationRate')),
    encounterRate: M.noViolations || M.noExposure ? nothing(M.noViolations || M.noExposure) : hide ? nothing(hide) : encounterRateOf(now.encounterRate, M.rules, now.weekday, history('encounterRate')),
    close: M.noExposure ? nothing(M.noExposure) : hide ? nothing(hide) : !sum(closeCameras(place, week)) ? nothing(word('no_close')) : howClose(now.close, M.rules, now.weekday, history('close')),
    change: null,
  };
  if (noDay()) { told.violationRate = told.close = told.encounterRate = nothing(word('no_day')); return told; }
  if (told.violationRate.rate === 0 && M.rules.mask > 1 && !(isWhole() && place.index >= 0)) told.violationRate = told.close = told.encounterRate = nothing(word('reason.masked', { n: M.rules.mask }));
  if (before && !M.notCompared && !hide && !place.hidden[1] && !M.noViolations) {
    const inBoth = closeInBoth(place), a = panelOf(before, before.same, place, inBoth), b = panelOf(week, week.same, place, inBoth);
    told.change = {
      hours: b.hours, violationRate: compareRates(a.violationRate, b.violationRate, M.rules, false),
      encounterRate: M.noExposure ? null : compareRates(a.encounterRate, b.encounterRate, M.rules, true),
      close: M.noExposure || !sum(inBoth) ? null : inSeconds(compareRates(a.close, b.close, M.rules, true)),
    };
    if (isWhole() && place.report) for (const k of ['violationRate', 'close', 'encounterRate']) if (told.change[k] && place.report[k]) Object.assign(told.change[k], place.report[k]);
  }
  return told;
}

/* ---- maps ---- */
/* Recorded hours of each camera in the selection. */
function recordedBy(p, used) {
  if (p.isSide) return p.hours;
  const on = chosen(p), S = p.S, out = new Float64Array(M.cameras);
  for (let c = 0; c < M.cameras; c++) for (let i = 0; i < S; i++) if (on[i] && used[c * S + i]) out[c] += p.recorded[c * S + i];
  return out;
}
/* Sums by camera and cell of the selection; of a whole week they come with the page. */
function cellSums(p, used, t, kind, cells) {
  const sums = new Float64Array(M.cameras * cells);
  if (p.isSide || used === p.drawn && isWhole()) { const values = t[kind]; for (let i = 0; i < t.n; i++) sums[t.camera[i] * cells + t.cell[i]] += values[i]; return sums; }
  const on = chosen(p), S = p.S, r = t.rows, values = r[kind];
  for (let i = 0; i < r.n; i++) { const c = r.camera[i], s = r.slot[i]; if (on[s] && used[c * S + s]) sums[c * cells + r.cell[i]] += values[i]; }
  return sums;
}
/* Sum over cameras of (what lies in a cell / the camera's recorded hours), per m2, spread over the fine cells. */
function spread(p, used, t, kind, across, isPerHour) {
  const g = M.grid, k = g.fineAcross / across, per = k * k, out = new Float64Array(fine.nx * fine.ny), hoursOf = recordedBy(p, used);
  const cells = g.nx * across * g.ny * across, sums = cellSums(p, used, t, kind, cells), wide = g.nx * across;
  const split = kind === 'v' && across > 1 && !state.change ? p.cells.split : null;
  for (let j = 0; j < sums.length; j++) if (sums[j]) {
    const c = Math.floor(j / cells), cell = j - c * cells, x = cell % wide * k, y = Math.floor(cell / wide) * k;
    const f = isPerHour ? sums[j] / hoursOf[c] * g.fineAcross * g.fineAcross : sums[j];
    for (let b = 0; b < k; b++) for (let a = 0; a < k; a++) out[(y + b) * fine.nx + x + a] += f * (split && split.total[j] ? split.part[j * per + b * k + a] / split.total[j] : 1 / per);
  }
  return out;
}

/* The field of a map over the fine cells, in the unit of its legend. */
function field(p, used) {
  const map = M.maps[state.map], v = p.cells.violations, t = p.cells.time, A = M.grid.cellsAcross;
  if (map.kind === 'violations') return smooth(spread(p, used, v, 'v', A, true), fine, M.grid.sigma);
  if (map.kind === 'exposure') return smooth(spread(p, used, t, 'v', 1, true), fine, M.grid.sigma).map(h => h * 60);
  if (map.kind === 'burden') return smooth(spread(p, used, t, 'w', 1, true), fine, M.grid.sigma).map(h => h * 3600);
  if (map.kind === 'risk') {
    const inView = spread(p, used, t, 'v', 1, false), near = smooth(inView, fine, M.grid.sigmaRisk), tooClose = smooth(spread(p, used, t, 'w', 1, false), fine, M.grid.sigmaRisk);
    return filled(tooClose.map((w, i) => near[i] >= M.grid.leastRisk && inView[i] > 0 ? Math.min(1, w / near[i]) * 100 : NaN));
  }
  const e = p.cells.excess, k = M.grid.fineAcross, out = new Float64Array(fine.nx * fine.ny).fill(NaN);
  for (let j = 0; j < e.ny; j++) for (let i = 0; i < e.nx; i++) for (let b = 0; b < k; b++) for (let a = 0; a < k; a++) {
    const x = (e.x + i - M.grid.x0) * k + a, y = (e.y + j - M.grid.y0) * k + b;
    if (x >= 0 && y >= 0 && x < fine.nx && y < fine.ny) out[y * fine.nx + x] = e.v[j * e.nx + i];
  }
  return filled(out);
}

/* Carry values a little into floor where nothing is known, so that bands run to its border and are cut there. */
function filled(values) {
  const { nx, ny } = fine, known = values.map(v => v >= 0 ? 1 : 0), out = Float64Array.from(values);
  for (let round = 0; round < 3; round++) {
    const was = Float64Array.from(out);
    for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++) {
      const i = y * nx + x;
      if (was[i] >= 0) continue;
      let n = 0, s = 0;
      for (const j of [x > 0 ? i - 1 : -1, x + 1 < nx ? i + 1 : -1, y > 0 ? i - nx : -1, y + 1 < ny ? i + nx : -1]) if (j >= 0 && was[j] >= 0) { n++; s += was[j]; }
      if (n) out[i] = s / n;
    }
  }
  const made = out.map(v => v >= 0 ? v : 0);
  made.known = known;
  return made;
}

const toDrawing = ([i, j]) => [(M.grid.x0 + (i + 0.5) * M.grid.fine - M.extent[0]) * 100, (M.extent[3] - M.grid.y0 - (j + 0.5) * M.grid.fine) * 100];
const bandPath = (values, at) => pathOf(outlines(values, fine.nx, fine.ny, at), toDrawing);

function setBands(group, values, map) {
  const known = values.known, isRatio = map.kind === 'excess', drawn = outlined(values, fine);
  $(`known-${group}`).setAttribute('d', known ? bandPath(outlined(known, fine), 0.5) : `M0 0h${M.size[0]}v${M.size[1]}h-${M.size[0]}z`);
  const plain = !isRatio && state.show !== 'difference';
  all(`#${group} path`).forEach((path, i) => {
    let d = '';
    if (i < 5 && plain) d = map.steps[i] === undefined ? '' : bandPath(drawn, map.steps[i]);
    else if (i >= 5 && !plain) d = bandPath(i < 7 ? drawn.map(v => isRatio ? (v > 0 ? 1 / v : 0) : -v) : drawn, map.diverging[(i - 5) % 2]);
    path.setAttribute('d', d);
  });
  // more than the crowd explains is certain only inside the hotspots, which passed their test: full colour there alone
  if (group === 'gb') all('#gs path').forEach((path, i) => path.setAttribute('d', isRatio ? all('#gb path')[7 + i].getAttribute('d') : ''));
}

/* Cells that some camera recorded in the selection; null where it is not known what the cameras see. */
function seenBy(p, used) {
  const on = recordedBy(p, used), n = fine.nx * fine.ny, out = new Uint8Array(n);
  if (!seen) return on.some(h => h > 0) ? null : out;
  for (let c = 0; c < M.cameras; c++) if (on[c] > 0) for (let i = 0, o = c * n; i < n; i++) out[i] |= seen[o + i];
  return out;
}
const both = (a, b) => a && b ? a.map((v, i) => v & b[i]) : a || b;

/* White has three looks: recorded and less than the lowest step (plain), recorded by no camera (hatched), too little (dots). */
function setWhites(group, known, recorded) {
  const [off, dots] = all(group === 'gb' ? '#wb path' : '#wa path');
  off.setAttribute('d', recorded ? bandPath(recorded.map(v => 1 - v), 0.5) : '');
  dots.setAttribute('d', known ? bandPath(known.map((v, i) => !v && (!recorded || recorded[i]) && (!fine.home || fine.home[i] === i) ? 1 : 0), 0.5) : '');
}

/* Signs where a difference is greatest, so that direction is not told by colour alone. */
function setSigns(values, map) {
  const group = $('signs'); group.textContent = '';
  if (!values) return;
  const at = map.diverging[0], isRatio = map.kind === 'excess', known = values.known, size = v => isRatio ? (v > 0 ? Math.abs(Math.log(v)) : 0) : Math.abs(v), least = isRatio ? Math.log(at) : at;
  const best = []; values.forEach((v, i) => { if (size(v) >= least && (!known || known[i])) best.push(i); });
  best.sort((a, b) => size(values[b]) - size(values[a]));
  const unit = W / Math.max(1, svg.clientWidth), apart = Math.max(300, 40 * unit), taken = texts(), placed = [];
  for (const i of best) {
    const x = i % fine.nx, y = Math.floor(i / fine.nx), [a, b] = toDrawing([x, y]), own = { x: a - 9 * unit, y: b - 9 * unit, width: 18 * unit, height: 18 * unit };
    if (placed.length >= 8) break;
    if (placed.some(q => Math.hypot(q[0] - a, q[1] - b) < apart) || taken.some(t => meet(t, own))) continue;
    placed.push([a, b]);
    const text = document.createElementNS('http://www.w3.org/2000/svg', 'text');
    text.setAttribute('x', a.toFixed(0)); text.setAttribute('y', b.toFixed(0)); text.setAttribute('class', 'sg');
    text.textContent = (isRatio ? values[i] > 1 : values[i] > 0) ? '+' : '\u2212';
    group.append(text);
  }
}
