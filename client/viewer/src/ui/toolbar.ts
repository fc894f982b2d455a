// The buttons over the 3D view.
import type { ViewMode } from '../scene/controls';
import { h, icon } from './dom';

export interface ToolbarActions { mode(mode: ViewMode): void; fit(): void; measure(): void }

const kModes: [ViewMode, string, string][] = [
  ['orbit', 'Orbit around a point', 'O'], ['fly', 'Fly with W A S D', 'F'], ['follow', 'Follow the camera', 'C'],
];

export class Toolbar {
  readonly element = h('div', { class: 'toolbar', role: 'toolbar', 'aria-label': 'View' });
  private readonly modes = new Map<ViewMode, HTMLButtonElement>();
  private readonly measure: HTMLButtonElement;

  constructor(actions: ToolbarActions) {
    const button = (name: string, title: string, key: string, action: () => void): HTMLButtonElement =>
      h('button', { class: 'tool', title: `${title} (${key})`, 'aria-label': title, 'aria-pressed': 'false', onclick: action },
        icon(name));
    const group = h('div', { class: 'group' });
    for (const [mode, title, key] of kModes) {
      const element = button(mode, title, key, () => actions.mode(mode));
      this.modes.set(mode, element);
      group.append(element);
    }
    this.measure = button('measure', 'Measure a distance', 'M', () => actions.measure());
    const fit = button('fit', 'Show the whole map', 'R', () => actions.fit());
    fit.removeAttribute('aria-pressed');
    this.element.append(group, h('div', { class: 'group' }, fit, this.measure));
  }

  update(mode: ViewMode, isMeasuring: boolean): void {
    for (const [name, element] of this.modes) element.setAttribute('aria-pressed', String(name === mode));
    this.measure.setAttribute('aria-pressed', String(isMeasuring));
  }
}
