// The overlay with all controls.
import { h, icon } from './dom';

const kKeys: [string, string][] = [
  ['?', 'this help'],
  ['O · F · C', 'orbit, fly, follow the camera'],
  ['R', 'show the whole map'],
  ['Z', 'zoom to the selected object'],
  ['J · K', 'next, previous object'],
  ['M', 'measure a distance: pick two points'],
  ['1 · 2 · 3', 'colors: image, normals, observation'],
  ['B · L · P · G', 'cuboids, labels, points, grid'],
  ['N', 'arrows: where to look next'],
  ['T', 'dark or light'],
  ['Esc', 'close, stop measuring, deselect'],
];

const kPointer: [string, string][] = [
  ['Drag', 'turn the view'],
  ['Right drag, or two fingers', 'move the view'],
  ['Wheel, or pinch', 'zoom'],
  ['Click', 'select an object'],
  ['Double click', 'zoom to it'],
  ['Arrow keys', 'turn, while the view has the focus; + and − zoom'],
  ['W A S D, Q E, Shift', 'fly, down and up, fast'],
];

function table(rows: [string, string][]): HTMLElement {
  return h('dl', { class: 'keys' }, rows.flatMap(([key, text]) => [h('dt', {}, key), h('dd', {}, text)]));
}

export function showHelp(): void {
  if (document.querySelector('dialog.help')) return;
  const dialog = h('dialog', { class: 'dialog help', 'aria-labelledby': 'help-title' },
    h('form', { method: 'dialog' },
      h('div', { class: 'row' }, h('h2', { id: 'help-title' }, 'Controls'),
        h('button', { class: 'plain', 'aria-label': 'Close help' }, icon('close'))),
      h('div', { class: 'columns' },
        h('section', {}, h('h3', {}, 'Keys'), table(kKeys)),
        h('section', {}, h('h3', {}, 'Mouse and touch'), table(kPointer))),
      h('p', { class: 'hint' }, 'Boxes are cuboids of objects: teal confirmed, gray not confirmed yet, amber not seen where ' +
        'it should be. The line is the path of the camera; red parts join places between which it was lost.')));
  dialog.addEventListener('close', () => dialog.remove());
  dialog.addEventListener('click', (event) => {
    if (event.target === dialog) dialog.close();
  });
  document.body.append(dialog);
  dialog.showModal();
}
