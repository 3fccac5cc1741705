/* The layer of flow: none, lines from area to area, or arrows. An area that is chosen shows its own lines only. */

state.flow = 'none';
overlays.push({
  set() {
    const of = state.place.startsWith('area:') ? state.place : '';
    document.body.dataset.flow = $('flow').value = state.flow;
    all('.dl').forEach(p => p.classList.toggle('off', of !== '' && p.dataset.from !== of && p.dataset.to !== of));
  },
  write: () => state.flow === 'none' ? '' : `flow=${state.flow}`,
  read(take) { const kind = take('flow', /^[a-z]{1,12}$/); state.flow = [...$('flow').options].some(o => o.value === kind) ? kind : 'none'; },
  listen(on) { on('flow', 'change', e => { state.flow = e.target.value; retell(); }); },
  name: () => state.flow === 'none' ? '' : $('flow').selectedOptions[0].textContent.trim(),
  save(layer, shapes) { if (state.flow !== 'none') layer('flow', shapes('.dl').map(s => ({ ...s, isClosed: false }))); },
});
