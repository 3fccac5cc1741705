/* The live page: asks its server for itself every minute. While the server is away the page stays, and says how old it is. */
const EVERY_MS = 60000, OLD_MIN = 2, away = document.getElementById('away');
let gotMs = Date.now();

const renew = async () => {
  try {
    const answer = await fetch(location.href, { cache: 'no-store', credentials: 'same-origin' });
    if (!answer.ok || answer.redirected) throw new Error(answer.status);
    const page = new DOMParser().parseFromString(await answer.text(), 'text/html');
    document.getElementById('main').replaceWith(page.getElementById('main'));
    document.title = page.title;
    gotMs = Date.now();
  } catch { /* it is tried again in a minute */ }
  const minutes = Math.floor((Date.now() - gotMs) / EVERY_MS);
  away.textContent = away.dataset.text.replace('{n}', minutes);
  away.hidden = minutes < OLD_MIN;
};
setInterval(renew, EVERY_MS);
