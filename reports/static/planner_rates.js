/* Rates with intervals and changes between weeks: the formulas of vsd_analytics/stats/{influence,rates,changes}.py,
   number for number. A panel is {n, x}: one row per camera, one column per day. Tests hold both to be equal. */

const sum = a => { let s = 0; for (const v of a) s += v; return s; };
const dot = (a, b) => { let s = 0; for (let i = 0; i < a.length; i++) s += a[i] * b[i]; return s; };

/* Quantiles come with the page: ln t of Student at nodes in 1/df, interpolated through all of them (barycentric). */
function studentT(q, df) {
  const u = 1 / df;
  let top = 0, bottom = 0;
  for (let i = 0; i < q.u.length; i++) {
    const gap = u - q.u[i];
    if (Math.abs(gap) < 1e-13) return Math.exp(q.lnT[i]);
    top += q.w[i] / gap * q.lnT[i]; bottom += q.w[i] / gap;
  }
  return Math.exp(top / bottom);
}

/* Keep cameras with exposure; what was not recorded counts nothing. */
function asCounts(panel, mask) {
  const rows = [];
  panel.x.forEach((x, c) => {
    const used = x.map((v, d) => v > 0 && (!mask || mask[c][d]));
    if (used.some(Boolean)) rows.push({ c, n: panel.n[c].map((v, d) => used[d] ? v : 0), x: x.map((v, d) => used[d] ? v : 0) });
  });
  const n = rows.map(r => r.n), x = rows.map(r => r.x), nDays = panel.x.length ? panel.x[0].length : 0;
  let days = 0;
  for (let d = 0; d < nDays; d++) if (x.some(r => r[d] > 0)) days++;
  return { n, x, kept: rows.map(r => r.c), nDays: days, width: nDays, events: sum(n.map(sum)) };
}

const rateOf = k => sum(k.n.map((row, c) => sum(row) / sum(k.x[c])));

function influence(k, expected, scale) {
  const totals = k.n.map(sum), hours = k.x.map(sum), rates = totals.map((t, c) => t / hours[c]), rate = sum(rates);
  const byDay = new Array(k.width).fill(0);
  k.n.forEach((row, c) => row.forEach((n, d) => {
    const share = expected ? expected[c][d] : k.x[c][d] / hours[c];
    byDay[d] += (n - totals[c] * share) / hours[c] / rate * (scale ? scale[c][d] : 1);
  }));
  const shares = rates.map(r => r / rate);
  return { rate, byDay, shares, totals, noise: shares.map((p, c) => totals[c] > 0 ? p * p / totals[c] : 0) };
}

const equalWeights = k => k.x.map(row => { const m = row.filter(v => v > 0).length; return row.map(v => v > 0 ? 1 / m : 0); });

/* k and df of var(ln r) = k sum i_d^2 (Bell & McCaffrey, Satterthwaite). */
function smallSample(w, shares, noise) {
  const D = w[0].length, lean = new Array(D).fill(0);
  w.forEach((row, c) => row.forEach((v, d) => { lean[d] += shares[c] * v; }));
  const B = lean.map((u, i) => lean.map((_, j) => (i === j ? u : 0) - sum(w.map((row, c) => shares[c] * row[i] * row[j]))));
  const G = B.map((_, i) => B.map((_, j) => sum(B.map(row => row[i] * row[j]))));
  const trace = sum(G.map((row, i) => row[i])), seen = sum(noise.map((v, c) => v * (1 - dot(w[c], w[c]))));
  if (trace <= 1e-12 || seen <= 0) return [Infinity, 1];
  const factor = Math.max(dot(lean, lean) / trace, sum(noise) / seen);
  return [factor, trace * trace / sum(G.map(row => dot(row, row)))];
}

/* What the weeks before expect of each day: see stats/influence.py, weekday_profile. */
function weekdayProfile(k, past, weekday, pastWeekday, minWeeks) {
  const ratio = (a, b) => b > 0 ? a / b : 0;
  return k.x.map((x, c) => {
    const n = k.n[c], D = x.length, rate = new Array(D).fill(0), known = new Array(D).fill(0);
    let has = true, missed = false, weekN = 0, weekX = 0;
    for (const day of [...new Set([...weekday, ...pastWeekday])].sort((a, b) => a - b)) {
      const then = pastWeekday.flatMap((w, i) => w === day ? [i] : []);
      const isRecorded = x.some((v, d) => weekday[d] === day && v > 0);
      const nRecorded = then.filter(i => past.x[c][i] > 0).length;
      if (isRecorded && !(nRecorded >= minWeeks - 1 && then.length >= minWeeks)) has = false;
      if (!isRecorded && nRecorded > 0) missed = true;
      const nThen = sum(then.map(i => past.n[c][i])), xThen = sum(then.map(i => past.x[c][i]));
      for (let d = 0; d < D; d++) if (weekday[d] === day) { rate[d] = ratio(nThen, xThen); known[d] = xThen; }
      weekN += ratio(nThen, nRecorded); weekX += ratio(xThen, nRecorded);
    }
    const expected = x.map((v, d) => v * rate[d]), total = sum(expected), hours = sum(x);
    if (!(total > 0) || n.some((v, d) => v > 0 && expected[d] === 0)) has = false;
    return {
      has, expected: x.map((v, d) => has ? expected[d] / total : v / hours),
      scale: x.map((v, d) => has ? 1 / Math.sqrt(1 + ratio(v, known[d])) : 1),
      gap: has && missed ? ratio(ratio(weekN, weekX), ratio(total, hours)) : 1,
    };
  });
}

/* What earlier days say beyond their weekdays: see stats/earlier_days.py. First count over the usual one less 1, by day. */
function residuals(past, weekday) {
  const expected = past.x.map((x, c) => {
    const n = {}, h = {};
    x.forEach((v, d) => { n[weekday[d]] = (n[weekday[d]] || 0) + past.n[c][d]; h[weekday[d]] = (h[weekday[d]] || 0) + v; });
    return x.map((v, d) => h[weekday[d]] > 0 ? v * n[weekday[d]] / h[weekday[d]] : 0);
  });
  const residual = [], days = new Set();
  weekday.forEach((w, d) => {
    const usual = sum(expected.map(row => row[d]));
    if (usual > 0) { residual.push(sum(past.n.map(row => row[d])) / usual - 1); days.add(w); }
  });
  return [residual, days.size];
}
/* How days in a row resemble each other, and what that does to a variance. */
function dayCorrelation([residual, nWeekdays], R) {
  const squares = dot(residual, residual), D = residual.length, free = D - nWeekdays;
  if (free <= 0 || squares <= 0) return R.correlation;
  const own = dot(residual.slice(1), residual.slice(0, -1)) / squares * D / (D - 1);
  return Math.min(Math.max((free * own + R.priorDays * R.correlation) / (free + R.priorDays), 0), R.correlationMost);
}
function inflation(r, D) {
  let A = 1;
  for (let k = 1; k < D; k++) A += 2 * (1 - k / D) * r ** k;
  return A / (1 - (A - 1) / (D - 1));
}
/* A few days may have much more than the others, which moves the upper end (Johnson 1978). */
function daySkewness([residual, nWeekdays], R) {
  const squares = dot(residual, residual), D = residual.length, free = D - nWeekdays, part = nWeekdays / D;
  if (squares <= 0 || D <= 2 * nWeekdays) return 0;
  const own = sum(residual.map(r => r ** 3)) / D / (squares / D) ** 1.5 * Math.sqrt(1 - part) / (1 - 2 * part);
  return Math.max(free * own / (free + R.priorDays), 0);
}
const skewed = (t, skewness, D) => t + skewness * (2 * t * t + 1) / (6 * Math.sqrt(D));

const refused = (k, rate, reason) => ({ rate, lo: null, hi: null, n: k.events, days: k.nDays, ok: false, reason });

/* The rate of checked counts with its interval. `q` holds the quantiles of one confidence level. */
function level(k, profile, R, q, kind) {
  const rate = rateOf(k);
  if (k.nDays < R.minDays) return refused(k, rate, word('reason.days', { n: R.minDays, has: k.nDays }));
  if (k.events === 0) {
    const least = Math.min(...k.x.map(sum));
    return { rate: 0, lo: 0, hi: q.zero / least, n: 0, days: k.nDays, ok: true, reason: word(`reason.none_${kind}`, { hours: nf(least, 1) }) };
  }
  if (k.events < R.minEvents) return refused(k, rate, word('reason.events', { n: R.minEvents, has: k.events }));
  let weights = equalWeights(k), missed = 0, days;
  if (!profile) days = influence(k);
  else {
    days = influence(k, profile.map(p => p.expected), profile.map(p => p.scale));
    weights = weights.map((row, c) => profile[c].has ? profile[c].expected : row);
    missed = Math.log1p(sum(days.shares.map((p, c) => p * (profile[c].gap - 1))));
  }
  const [factor, df] = smallSample(weights, days.shares, days.noise);
  if (!Number.isFinite(factor)) return refused(k, rate, word('reason.camera'));
  const widened = factor * inflation(profile ? profile.correlation : R.correlation, k.nDays);
  const t = studentT(q, df), se = Math.sqrt(widened * dot(days.byDay, days.byDay));
  const least = k.events < R.smallCount ? q.z * Math.sqrt(sum(days.noise)) : 0;
  const below = Math.max(t * se, least), above = Math.max(skewed(t, profile ? profile.skewness : 0, k.nDays) * se, least);
  const plain = !profile || profile.some((p, c) => days.totals[c] > 0 && !p.has);
  return { rate, lo: rate * Math.exp(Math.min(missed, 0) - below), hi: rate * Math.exp(Math.max(missed, 0) + above), n: k.events, days: k.nDays, df, ok: true, reason: null, wide: plain || missed !== 0 };
}

function profileOf(k, past, weekday, R) {
  if (!past || !past.weekday.length) return null;
  const kept = { n: k.kept.map(c => past.n[c]), x: k.kept.map(c => past.x[c]) };
  const profile = weekdayProfile(k, kept, weekday, past.weekday, R.minWeeks);
  const earlier = residuals(kept, past.weekday);
  profile.correlation = dayCorrelation(earlier, R);
  profile.skewness = daySkewness(earlier, R);
  return profile;
}

/* Violation rate (M0): sum over cameras of violations / recorded open hours. */
function violationRateOf(panel, R, weekday, past) {
  const k = asCounts(panel);
  if (!k.kept.length) return refused(k, null, word('reason.unrecorded'));
  return level(k, profileOf(k, past, weekday, R), R, R.q, 'per_open_h');
}

/* Encounter rate (M7): violations per person-hour; the panel has one row. */
function encounterRateOf(panel, R, weekday, past) {
  const k = asCounts(panel), hours = sum(k.x.map(sum));
  if (!k.kept.length || hours < R.minExposure) return refused(k, null, word('reason.person_hours', { n: R.minExposure, has: nf(hours, 1) }));
  return level(k, profileOf(k, past, weekday, R), R, R.q, 'per_person_h');
}

/* Share of time too close (M6): person-seconds in violation stand for events, see figures/close_time.py. */
function howClose(panel, R, weekday, past) {
  const k = asCounts(panel), hours = sum(k.x.map(sum));
  if (!k.kept.length) return refused(k, null, word('reason.nobody_seen'));
  const e = level(k, profileOf(k, past, weekday, R), R, R.q, 'per_person_h'), part = v => v === null ? null : Math.min(1, v / 3600);
  if (e.n === 0) return { ...e, lo: null, hi: null, ok: true, reason: word('reason.nobody_close') };
  const least = hours < R.minExposure && e.lo !== null;
  return { ...e, rate: part(e.rate), lo: least || e.lo === null ? null : e.lo / 3600, hi: least ? null : part(e.hi), reason: least ? word('reason.interval_person_hours', { n: R.minExposure, has: nf(hours, 1) }) : e.reason };
}
const inSeconds = e => ({ ...e, rateA: e.rateA === null ? null : e.rateA / 3600, rateB: e.rateB === null ? null : e.rateB / 3600 });

function verdictOf(lo, hi, same) {
  if (lo === null && hi === null) return 'too_little_data';
  const low = lo === null ? 0 : lo, high = hi === null ? Infinity : hi;
  if (high < 1) return 'clear_fall';
  if (low > 1) return 'clear_rise';
  return 1 - same <= low && high <= 1 + same ? 'about_same' : 'cannot_tell';
}

function changed(a, b, more) {
  const [rateA, rateB] = [a, b].map(k => k.kept.length ? rateOf(k) : null);
  const theta = rateA && rateB !== null ? rateB / rateA : null;
  return { theta, rateA, rateB, nA: a.events, nB: b.events, xA: sum(a.x.map(sum)), xB: sum(b.x.map(sum)), days: a.nDays, lo: null, hi: null, verdict: 'too_little_data', reason: null, ...more };
}

/* Limits of one side of a change: days as clusters, or exact Poisson limits of very few violations. */
function limits(k, R) {
  if (k.events >= R.minEvents) { const e = level(k, null, R, R.q2, 'per_open_h'); return [e.lo || 0, e.hi === null ? Infinity : e.hi]; }
  const hours = k.x.map(sum), each = k.events ? rateOf(k) / k.events : 1 / Math.min(...hours), [lo, hi] = R.poisson[k.events];
  return [lo * each, hi * each];
}

/* The ratio of the rates of two weeks over the same camera-hours, same weekdays paired. */
function compareRates(A, B, R, isRisky) {
  const both = A.x.map((row, c) => row.map((v, d) => v > 0 && B.x[c][d] > 0));
  const a = asCounts(A, both), b = asCounts(B, both), least = Math.min(sum(a.x.map(sum)), sum(b.x.map(sum)));
  if (a.nDays < R.minDays) return changed(a, b, { reason: word('reason.pairs', { n: R.minDays, has: a.nDays }) });
  if (isRisky && least < R.minExposure) return changed(a, b, { reason: word('reason.person_hours_each', { n: R.minExposure, has: nf(least, 1) }) });
  const low = Math.min(a.events, b.events);
  if (Math.max(a.events, b.events) < R.minEvents) return changed(a, b, { reason: word('reason.few') });
  if (low < R.minEvents) {
    const [[loA, hiA], [loB, hiB]] = [limits(a, R), limits(b, R)], lo = loB / hiA, hi = loA > 0 ? hiB / loA : null;
    const verdict = verdictOf(lo, hi, R.aboutSame);
    return changed(a, b, verdict.startsWith('clear') ? { lo, hi, verdict } : { reason: word('reason.few') });
  }
  const before = influence(a), after = influence(b), noise = before.noise.map((v, c) => v + after.noise[c]);
  const [factor, df] = smallSample(equalWeights(a), before.shares.map((p, c) => (p + after.shares[c]) / 2), noise);
  if (!Number.isFinite(factor)) return changed(a, b, { reason: word('reason.camera_both') });
  const gap = after.byDay.map((v, d) => v - before.byDay[d]);
  const byDays = factor * dot(gap, gap), ownWeeks = 2 * R.weekSd ** 2 / Math.max(1, a.nDays / 7);
  const byWeeks = byDays + Math.max(R.stepExtra * (byDays - sum(noise)), ownWeeks);
  let half = studentT(R.q, df) * Math.sqrt(byDays), halfDf = df;
  // how weeks differ beyond their days: any part of a week has no history here, so the prior speaks
  if (studentT(R.q, R.stepDf) * Math.sqrt(byWeeks) > half) { half = studentT(R.q, R.stepDf) * Math.sqrt(byWeeks); halfDf = R.stepDf; }
  if (low < R.smallCount) half = Math.max(half, R.q.z * Math.sqrt(sum(noise)));
  const theta = after.rate / before.rate, lo = theta * Math.exp(-half), hi = theta * Math.exp(half);
  return changed(a, b, { lo, hi, df: halfDf, verdict: verdictOf(lo, hi, R.aboutSame) });
}
