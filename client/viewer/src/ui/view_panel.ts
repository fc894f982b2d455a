// What the 3D view shows.
import type { ColorMode } from '../scene/mesh_material';
import type { ViewSettings } from '../scene/view_settings';
import { h, replaceChildren } from './dom';

const kColors: [ColorMode, string, string][] = [
  ['rgb', 'Image colors', '1'], ['normal', 'Surface normals', '2'], ['confidence', 'How well it was observed', '3'],
];

const kToggles: [Exclude<keyof ViewSettings, 'color' | 'map'>, string, string][] = [
  ['meshes', 'Meshes', ''], ['cuboids', 'Cuboids', 'B'], ['labels', 'Class names', 'L'], ['points', 'Map points', 'P'],
  ['path', 'Camera path', ''], ['image', 'Image in the frustum', ''], ['grid', 'Grid', 'G'],
  ['arrows', 'Where to look next', 'N'], ['provisional', 'Objects not confirmed yet', ''],
];

export class ViewPanel {
  readonly element = h('div', { class: 'view-panel' });
  private readonly maps = h('div', {});
  private readonly inputs = new Map<string, HTMLInputElement>();
  private mapKey = '';

  constructor(private readonly get: () => ViewSettings, private readonly set: (settings: ViewSettings) => void) {
    const colors = kColors.map(([value, text, key]) => {
      const input = h('input', {
        type: 'radio', name: 'color', value, onchange: () => this.set({ ...this.get(), color: value }),
      });
      this.inputs.set(`color-${value}`, input);
      return h('label', { class: 'check' }, input, h('span', {}, text), h('kbd', {}, key));
    });
    const toggles = kToggles.map(([name, text, key]) => {
      const input = h('input', {
        type: 'checkbox', name, onchange: () => this.set({ ...this.get(), [name]: input.checked }),
      });
      this.inputs.set(name, input);
      return h('label', { class: 'check' }, input, h('span', {}, text), key ? h('kbd', {}, key) : null);
    });
    this.element.append(
      h('fieldset', {}, h('legend', {}, 'Color of meshes'), colors),
      h('div', { class: 'scale', 'aria-hidden': 'true' }, h('span', {}, 'not observed'), h('i', {}), h('span', {}, 'well observed')),
      h('fieldset', {}, h('legend', {}, 'Show'), toggles), this.maps);
    this.update();
  }

  update(): void {
    const settings = this.get();
    for (const [value] of kColors) {
      const input = this.inputs.get(`color-${value}`);
      if (input) input.checked = settings.color === value;
    }
    for (const [name] of kToggles) {
      const input = this.inputs.get(name);
      if (input) input.checked = settings[name];
    }
    this.element.dataset.color = settings.color;
  }

  /** A choice is offered if the session has several maps, whose relation is not known. */
  updateMaps(mapIds: readonly string[], newest: string): void {
    const key = `${mapIds.join()}/${newest}/${this.get().map}`;
    if (key === this.mapKey) return;
    this.mapKey = key;
    if (mapIds.length < 2) return replaceChildren(this.maps);
    const select = h('select', {
      id: 'map', onchange: () => this.set({ ...this.get(), map: select.value === '' ? null : select.value }),
    }, h('option', { value: '' }, `That of the camera (map ${newest})`), mapIds.map((id) => h('option', { value: id }, `Map ${id}`)));
    select.value = this.get().map ?? '';
    replaceChildren(this.maps, h('label', { for: 'map', class: 'field' }, 'Map of this session'), select,
      h('p', { class: 'hint' }, 'The maps are not connected: the camera has not seen a common place yet.'));
  }
}
