/* The look page: asks its server once a second for the newest frame, and draws the people on the plan. */
const byId = id => document.getElementById(id);
const meta = JSON.parse(byId('meta').textContent);
const SVG = 'http://www.w3.org/2000/svg', UNIT = 100, EVERY_MS = 1000;
const [x0, , , y1] = meta.extent;
const said = (key, values = {}) => meta.words[key].replace(/\{(\w+)\}/g, (_, name) => values[name]);
const sliders = ['horizontal', 'vertical'].map(byId);
const isTrying = () => byId('try').checked;

const drawn = (tag, of) => {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(of)) element.setAttribute(key, value);
  return element;
};
const onPlan = ([x, y]) => [(x - x0) * UNIT, (y1 - y) * UNIT];

/* Show the camera's part of the plan, and everybody on it. */
const frame = persons => {
  const [xs, ys] = [persons.map(p => p[0]), persons.map(p => p[1])];
  const [left, low, right, high] = [
    Math.min(meta.extent[0], ...xs.map(x => Math.floor(x - 1))), Math.min(meta.extent[1], ...ys.map(y => Math.floor(y - 1))),
    Math.max(meta.extent[2], ...xs.map(x => Math.ceil(x + 1))), Math.max(meta.extent[3], ...ys.map(y => Math.ceil(y + 1))),
  ];
  const [u, v] = onPlan([left, high]);
  byId('plan').setAttribute('viewBox', `${u} ${v} ${(right - left) * UNIT} ${(high - low) * UNIT}`);
  const ground = byId('ground');
  for (const [key, value] of [['x', u], ['y', v], ['width', (right - left) * UNIT], ['height', (high - low) * UNIT]]) ground.setAttribute(key, value);
  let d = '';
  const every = right - left > 60 || high - low > 60 ? 10 : 1;
  for (let x = left; x <= right; x += every) d += `M${onPlan([x, 0])[0]} ${v}v${(high - low) * UNIT}`;
  for (let y = low; y <= high; y += every) d += `M${u} ${onPlan([0, y])[1]}h${(right - left) * UNIT}`;
  byId('grid').replaceChildren(drawn('path', { d }));
};

const show = now => {
  const picture = byId('picture');
  if (now.picture) { picture.src = now.picture; picture.hidden = false; }
  const layer = byId('people');
  layer.replaceChildren();
  frame(now.persons);
  for (const [x, y, isClose] of now.persons) {
    const [cx, cy] = onPlan([x, y]);
    const person = drawn('g', { class: isClose ? 'close' : 'apart' });
    person.append(drawn('circle', { class: 'space', cx, cy, r: meta.radius_m * UNIT }));
    person.append(drawn('circle', { class: 'foot', cx, cy, r: 0.12 * UNIT }));
    layer.append(person);
  }
  for (const [a, b] of now.pairs) {
    const [from, to] = [onPlan(now.persons[a]), onPlan(now.persons[b])];
    layer.append(drawn('line', { x1: from[0], y1: from[1], x2: to[0], y2: to[1] }));
  }
  const state = byId('state');
  const isOn = now.state === 'on' && now.picture;
  state.classList.toggle('away', !isOn);
  const at = now.at ? new Date(now.at).toLocaleTimeString(document.documentElement.lang, { timeZone: meta.zone }) : '-';
  let text = isOn ? said('now', { at, people: now.n_people, pairs: now.pairs.length })
    : now.at ? said('away', { at }) : said('nothing');
  if (isOn && now.calibration === null) text += ' ' + said(isTrying() ? 'too_few' : 'uncalibrated');
  if (state.textContent !== text) state.textContent = text;
  byId('save').disabled = !isTrying() || now.calibration === null;
};

let timer = 0, turn = 0;
const ask = async () => {
  clearTimeout(timer);
  const mine = turn += 1;
  const query = new URLSearchParams({ camera: meta.camera });
  if (isTrying()) for (const slider of sliders) query.set(slider.id, slider.value);
  try {
    const answer = await fetch('/now?' + query, { cache: 'no-store' });
    if (!answer.ok) throw new Error(answer.status);
    const now = await answer.json();
    if (mine === turn) show(now);
  } catch {
    if (mine === turn) { byId('state').textContent = said('stopped'); byId('state').classList.add('away'); }
  }
  if (mine === turn) timer = setTimeout(ask, EVERY_MS);
};

const sure = isAsked => {
  byId('sure').hidden = !isAsked;
  byId('save').hidden = isAsked;
  byId(isAsked ? 'yes' : 'save').focus();
};

byId('try').addEventListener('change', () => {
  for (const slider of sliders) slider.disabled = !isTrying();
  byId('save').disabled = true;
  ask();
});
for (const slider of sliders) {
  slider.addEventListener('input', () => {
    byId(slider.id + '-value').textContent = Number(slider.value).toFixed(2);
    ask();
  });
}
byId('save').addEventListener('click', () => sure(true));
byId('no').addEventListener('click', () => sure(false));
byId('sure').addEventListener('keydown', event => { if (event.key === 'Escape') sure(false); });
byId('yes').addEventListener('click', async () => {
  const asked = { camera: meta.camera };
  for (const slider of sliders) asked[slider.id] = Number(slider.value);
  let text = said('not_saved');
  try {
    const answer = await fetch('/calibration', {
      method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(asked),
    });
    const done = await answer.json();
    if (done.calibration) text = said('saved', { id: done.calibration });
    else if (done.error) text += ' ' + done.error;
  } catch { /* the text says that it was not saved */ }
  byId('said').textContent = text;
  byId('try').checked = false;
  byId('try').dispatchEvent(new Event('change'));
  sure(false);
  byId('try').focus();
});

frame([]);
ask();
