/* Homographies from picture pixels to floor metres, as vsd_analytics/geometry/homography.py makes them. A matrix is nine
   numbers, row by row. */

const times = (a, b) => [0, 1, 2].flatMap(i => [0, 1, 2].map(j => a[3 * i] * b[j] + a[3 * i + 1] * b[j + 3] + a[3 * i + 2] * b[j + 6]));
const third = (h, [u, v]) => h[6] * u + h[7] * v + h[8];
const mapped = (h, [u, v]) => { const w = third(h, [u, v]); return [(h[0] * u + h[1] * v + h[2]) / w, (h[3] * u + h[4] * v + h[5]) / w]; };

function inverse([a, b, c, d, e, f, g, h, i]) {
  const m = [e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g, c * d - a * f, d * h - e * g, b * g - a * h, a * e - b * d];
  const det = a * m[0] + b * m[3] + c * m[6];
  return m.map(n => n / det);
}

/* Which sign the third coordinate has on the floor: that of the bottom centre of the picture. */
const groundSign = (h, size) => third(h, [size[0] / 2, size[1]]) < 0 ? -1 : 1;
const toFloor = (h, uv, size) => third(h, uv) * groundSign(h, size) > 0 ? mapped(h, uv) : null;
function toPicture(h, xy, size) {
  const g = inverse(h);
  return third(g, xy) * groundSign(h, size) > 0 ? mapped(g, xy) : null;
}

/* Eigenvalues and eigenvectors (columns) of a symmetric matrix, an array of rows: cyclic Jacobi rotations. */
function eigen(symmetric) {
  const n = symmetric.length, a = symmetric.map(r => [...r]), v = a.map((_, i) => a.map((__, j) => +(i === j)));
  for (let sweep = 0; sweep < 60; sweep++) {
    let off = 0, all = 0;
    a.forEach((r, i) => r.forEach((x, j) => { all += x * x; if (i !== j) off += x * x; }));
    if (off <= 1e-30 * all) break;
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) {
      if (a[p][q] === 0) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]), t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1)), c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < n; k++) { const x = a[k][p], y = a[k][q]; a[k][p] = c * x - s * y; a[k][q] = s * x + c * y; }
      for (let k = 0; k < n; k++) { const x = a[p][k], y = a[q][k]; a[p][k] = c * x - s * y; a[q][k] = s * x + c * y; }
      for (let k = 0; k < n; k++) { const x = v[k][p], y = v[k][q]; v[k][p] = c * x - s * y; v[k][q] = s * x + c * y; }
    }
  }
  const order = a.map((_, i) => i).sort((i, j) => a[i][i] - a[j][j]);
  return { values: order.map(i => a[i][i]), vectors: order.map(i => v.map(r => r[i])) };
}

/* The solution of a small system of equations by elimination with pivots. */
function solved(matrix, right) {
  const n = right.length, a = matrix.map((r, i) => [...r, right[i]]);
  for (let i = 0; i < n; i++) {
    const best = a.slice(i).reduce((b, r, k) => Math.abs(r[i]) > Math.abs(a[b][i]) ? k + i : b, i);
    [a[i], a[best]] = [a[best], a[i]];
    for (let k = i + 1; k < n; k++) { const f = a[k][i] / a[i][i]; for (let j = i; j <= n; j++) a[k][j] -= f * a[i][j]; }
  }
  const x = Array(n).fill(0);
  for (let i = n - 1; i >= 0; i--) x[i] = (a[i][n] - a[i].slice(i + 1, n).reduce((s, c, k) => s + c * x[i + 1 + k], 0)) / a[i][i];
  return x;
}

/* The similarity that moves points to mean 0 and root mean square distance sqrt 2. */
function centring(points) {
  const n = points.length, x = points.reduce((s, p) => s + p[0], 0) / n, y = points.reduce((s, p) => s + p[1], 0) / n;
  const k = Math.SQRT2 / Math.sqrt(points.reduce((s, p) => s + (p[0] - x) ** 2 + (p[1] - y) ** 2, 0) / n);
  return [k, 0, -k * x, 0, k, -k * y, 0, 0, 1];
}

/* Points lie on a line when they are spread across by less than a hundredth of their spread along. */
function isLine(points) {
  const [kx, , cx, , ky, cy] = centring(points), sum = [[0, 0], [0, 0]];
  for (const p of points) { const d = [kx * p[0] + cx, ky * p[1] + cy]; for (const i of [0, 1]) for (const j of [0, 1]) sum[i][j] += d[i] * d[j]; }
  const { values } = eigen(sum);
  return values[0] < 1e-4 * values[1];
}

/* The homography of pairs [u, v, x, y] with the least squared error on the floor: a direct linear transform of centred
   points, then Gauss-Newton with damping. Gives { why } where the points fix none. */
function fitted(given) {
  const pairs = [...new Map(given.map(p => [p.join(), p])).values()], uv = pairs.map(p => [p[0], p[1]]), xy = pairs.map(p => [p[2], p[3]]);
  const different = points => new Set(points.map(p => p.join())).size;
  if (Math.min(different(uv), different(xy)) < 4) return { why: 'few' };
  if (isLine(uv)) return { why: 'line_picture' };
  if (isLine(xy)) return { why: 'line_floor' };
  const fromUv = centring(uv), fromXy = centring(xy), a = uv.map(p => mapped(fromUv, p)), b = xy.map(p => mapped(fromXy, p));
  const equations = a.flatMap(([u, v], i) => { const [x, y] = b[i]; return [[u, v, 1, 0, 0, 0, -x * u, -x * v, -x], [0, 0, 0, u, v, 1, -y * u, -y * v, -y]]; });
  const { values, vectors } = eigen(Array.from({ length: 9 }, (_, i) => Array.from({ length: 9 }, (__, j) => equations.reduce((s, r) => s + r[i] * r[j], 0))));
  if (values[1] < 1e-8 * values[8]) return { why: 'three' };
  if (Math.abs(vectors[0][8]) < 1e-9) return { why: 'horizon' };
  const near = refined(vectors[0].map(n => n / vectors[0][8]), a, b), h = times(times(inverse(fromXy), near), fromUv);
  const matrix = h.map(n => n / (Math.abs(h[8]) > 1e-12 * Math.max(...h.map(Math.abs)) ? h[8] : Math.max(...h.map(Math.abs))));
  const sides = new Set(uv.map(p => Math.sign(third(matrix, p))));
  if (sides.size > 1 || matrix.some(n => !Number.isFinite(n))) return { why: 'horizon' };
  const errors = given.map(p => { const [x, y] = mapped(matrix, p); return Math.hypot(x - p[2], y - p[3]); });
  return { h: matrix, errors, rms: Math.sqrt(errors.reduce((s, e) => s + e * e, 0) / errors.length) };
}

function refined(start, a, b) {
  const loss = h => a.reduce((s, p, i) => { const [x, y] = mapped(h, p); return s + (x - b[i][0]) ** 2 + (y - b[i][1]) ** 2; }, 0);
  let h = start, best = loss(h), damping = 1e-3;
  for (let round = 0; round < 100 && damping < 1e12; round++) {
    const normal = Array.from({ length: 8 }, () => Array(8).fill(0)), right = Array(8).fill(0);
    a.forEach(([u, v], i) => {
      const w = third(h, [u, v]), [x, y] = mapped(h, [u, v]);
      for (const [row, off] of [[[u, v, 1, 0, 0, 0, -x * u, -x * v], b[i][0] - x], [[0, 0, 0, u, v, 1, -y * u, -y * v], b[i][1] - y]]) {
        const g = row.map(n => n / w);
        for (let r = 0; r < 8; r++) { right[r] += g[r] * off; for (let c = 0; c < 8; c++) normal[r][c] += g[r] * g[c]; }
      }
    });
    const step = solved(normal.map((r, i) => r.map((n, j) => i === j ? n * (1 + damping) + 1e-18 : n)), right);
    const next = [...h.slice(0, 8).map((n, i) => n + step[i]), 1], now = loss(next);
    if (now < best) { const gain = best - now; h = next; best = now; damping /= 10; if (gain <= 1e-16 * best) break; } else damping *= 10;
  }
  return h;
}
