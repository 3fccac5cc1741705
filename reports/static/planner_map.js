/* From sums by cell to bands over the floor: the report's smoothing (vsd_analytics/figures/week/density.py) and outlines. */

/* scipy.ndimage.gaussian_filter, mode "constant", truncate 4, over a grid of nx times ny. */
function gaussian(src, nx, ny, sigma) {
  const r = Math.floor(4 * sigma + 0.5), w = new Float64Array(r + 1);
  let total = 0;
  for (let i = 0; i <= r; i++) { w[i] = Math.exp(-i * i / (2 * sigma * sigma)); total += i ? 2 * w[i] : w[i]; }
  for (let i = 0; i <= r; i++) w[i] /= total;
  const mid = new Float64Array(nx * ny), out = new Float64Array(nx * ny), first = new Int32Array(ny).fill(nx), last = new Int32Array(ny).fill(-1);
  for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++) {
    const v = src[y * nx + x];
    if (v === 0) continue;
    const o = y * nx, lo = Math.max(0, x - r), hi = Math.min(nx - 1, x + r);
    if (lo < first[y]) first[y] = lo;
    last[y] = hi;
    for (let k = lo; k <= hi; k++) mid[o + k] += v * w[k < x ? x - k : k - x];
  }
  for (let k = 0; k < ny; k++) if (last[k] >= 0) for (let y = Math.max(0, k - r); y <= Math.min(ny - 1, k + r); y++) {
    const f = w[k < y ? y - k : k - y], from = k * nx, to = y * nx, end = last[k];
    for (let x = first[k]; x <= end; x++) out[to + x] += f * mid[from + x];
  }
  return out;
}

/* Heat that flows along the floor around fixtures (vsd_analytics/figures/week/walkable.py), else the plain Gaussian. What lies
   in a fixture is added to the nearest free floor first. */
function smooth(src, g, sigma) {
  if (!g.home) return gaussian(src, g.nx, g.ny, sigma);
  const { nx, ny, home, right, up } = g, heat = new Float64Array(nx * ny);
  for (let i = 0; i < src.length; i++) if (src[i]) heat[home[i]] += src[i];
  const rounds = Math.max(1, Math.ceil(3 * sigma * sigma - 1e-9)), share = sigma * sigma / (2 * rounds);
  const along = () => { for (let y = 0; y < ny; y++) { let carried = 0; const o = y * nx; for (let x = 0; x < nx; x++) { const i = o + x, flow = x + 1 < nx && right[i] ? share * (heat[i + 1] - heat[i]) : 0; heat[i] += flow - carried; carried = flow; } } };
  const across = () => { for (let x = 0; x < nx; x++) g.carried[x] = 0; for (let y = 0; y < ny; y++) { const o = y * nx; for (let x = 0; x < nx; x++) { const i = o + x, flow = y + 1 < ny && up[i] ? share * (heat[i + nx] - heat[i]) : 0; heat[i] += flow - g.carried[x]; g.carried[x] = flow; } } };
  for (let k = 0; k < rounds; k++) { if (k % 2) { across(); along(); } else { along(); across(); } }
  return heat;
}

/* For outlines: fixtures take the value of the nearest free floor, two cells in; they are drawn over it. */
function outlined(values, g) {
  if (!g.home) return values;
  return values.map((v, i) => g.home[i] === i ? v : g.edge[i] ? values[g.home[i]] : 0);
}

/* Closed outlines of the floor where a field reaches a level: linear between the middles of cells, 0 outside. */
function outlines(field, nx, ny, at) {
  const W = nx + 2, H = ny + 2, next = new Int32Array(2 * W * H).fill(-1), starts = [];
  const value = (i, j) => i < 1 || j < 1 || i > nx || j > ny ? 0 : field[(j - 1) * nx + i - 1] || 0;
  const link = (from, to) => { next[from] = to; starts.push(from); };
  const first = new Int32Array(H).fill(W), last = new Int32Array(H).fill(-1);
  for (let j = 1; j <= ny; j++) for (let i = 0, o = (j - 1) * nx; i < nx; i++) if (field[o + i] >= at) { if (last[j] < 0) first[j] = i; last[j] = i + 1; }
  for (let j = 0; j < H - 1; j++) {
    const from = Math.min(first[j], first[j + 1]), end = Math.max(last[j], last[j + 1]);
    let a = from < W ? value(from, j) : 0, d = from < W ? value(from, j + 1) : 0;
    for (let i = from; i <= end; i++) {
      const b = value(i + 1, j), c = value(i + 1, j + 1);
      const kind = (a >= at ? 1 : 0) | (b >= at ? 2 : 0) | (c >= at ? 4 : 0) | (d >= at ? 8 : 0);
      if (kind && kind !== 15) {
        const o = 2 * (j * W + i), south = o, west = o + 1, east = o + 3, north = o + 2 * W;
        const joined = (a + b + c + d) / 4 >= at;
        switch (kind) {
          case 1: link(south, west); break;
          case 2: link(east, south); break;
          case 3: link(east, west); break;
          case 4: link(north, east); break;
          case 6: link(north, south); break;
          case 7: link(north, west); break;
          case 8: link(west, north); break;
          case 9: link(south, north); break;
          case 11: link(east, north); break;
          case 12: link(west, east); break;
          case 13: link(south, east); break;
          case 14: link(west, south); break;
          case 5: if (joined) { link(south, east); link(north, west); } else { link(south, west); link(north, east); } break;
          case 10: if (joined) { link(west, south); link(east, north); } else { link(east, south); link(west, north); } break;
        }
      }
      a = b; d = c;
    }
  }
  const rings = [];
  for (const start of starts) {
    if (next[start] < 0) continue;
    const ring = [];
    for (let e = start; next[e] >= 0;) {
      const cell = e >> 1, i = cell % W, j = (cell - i) / W, up = e & 1;
      const p = value(i, j), q = up ? value(i, j + 1) : value(i + 1, j), t = (at - p) / (q - p);
      ring.push(up ? [i - 1, j - 1 + t] : [i - 1 + t, j - 1]);
      const to = next[e]; next[e] = -1; e = to;
    }
    if (ring.length > 2) rings.push(ring);
  }
  return rings;
}

const ringArea = ring => { let s = 0; ring.forEach((p, i) => { const q = ring[(i + 1) % ring.length]; s += p[0] * q[1] - q[0] * p[1]; }); return s / 2; };

/* Rings in cells as a path in the drawing's units: curves through the middles of the edges, as in the report. */
function pathOf(rings, place) {
  let d = '';
  for (const ring of rings) {
    if (Math.abs(ringArea(ring)) < 1) continue;
    const pts = ring.map(place), n = pts.length, mid = (p, q) => `${Math.round((p[0] + q[0]) / 2)} ${Math.round((p[1] + q[1]) / 2)}`;
    d += `M${mid(pts[n - 1], pts[0])}`;
    for (let i = 0; i < n; i++) d += `Q${Math.round(pts[i][0])} ${Math.round(pts[i][1])} ${mid(pts[i], pts[(i + 1) % n])}`;
    d += 'z';
  }
  return d;
}
