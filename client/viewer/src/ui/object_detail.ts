// Everything about one object.
import type { MapObject } from '../state/map_store';
import type { ObjectMesh } from '../scene/object_mesh';
import { describeDirection, rotate } from '../state/geometry';
import { stepsChart } from './chart';
import { count, length, percent, plural, seconds } from './format';
import { h, icon, replaceChildren } from './dom';

export interface DetailActions { close(): void; zoom(id: string): void; download(id: string): void }

const kStates = { CONFIRMED: 'confirmed', PROVISIONAL: 'not confirmed yet', LOST: 'not seen where it should be', UNKNOWN: 'unknown' };

export class ObjectDetail {
  readonly element = h('div', { class: 'detail' });
  private readonly body = h('div', {});
  private readonly title = h('h2', {});
  private readonly state = h('span', { class: 'chip' });
  private id = '';
  private key = '';

  constructor(actions: DetailActions) {
    this.element.append(
      h('div', { class: 'row detail-head' },
        h('button', { class: 'plain', 'aria-label': 'Back to all objects', onclick: () => actions.close() }, icon('back')),
        this.title, this.state),
      h('div', { class: 'row' },
        h('button', { class: 'button', onclick: () => actions.zoom(this.id) }, icon('target'), 'Zoom to it'),
        h('button', { class: 'button download', onclick: () => actions.download(this.id) }, icon('download'), 'GLB')),
      this.body);
  }

  update(object: MapObject, shown: ObjectMesh | null): void {
    const { update, mesh } = object;
    const key = [update.id, update.revision, mesh?.revision, shown?.fault, shown?.observedShare, shown?.shownTriangles].join();
    if (key === this.key) return;
    this.key = key;
    this.id = update.id;
    this.title.textContent = `${update.className} #${update.id}`;
    this.state.textContent = kStates[update.state];
    this.state.dataset.state = update.state.toLowerCase();
    const download = this.element.querySelector<HTMLButtonElement>('button.download');
    if (download) download.disabled = !mesh;
    replaceChildren(this.body,
      shown?.fault ? h('p', { class: 'callout error', role: 'status' }, shown.fault) : null,
      facts([
        ['Class', `${update.className}, ${percent(update.classScore)} of detections`],
        ['Views', plural(update.observations, 'frame')],
        ['Cuboid confidence', update.cuboid ? meter(update.cuboid.confidence) : 'no cuboid yet'],
        ['Size', update.cuboid ? size(update.cuboid.halfExtents) : '–'],
        ['Observed surface', shown?.observedShare != null ? meter(shown.observedShare) : '–'],
      ]),
      h('h3', {}, 'Mesh'),
      mesh ? facts([
        ['State', mesh.isFinal ? 'final' : 'in training'],
        ['Training', `${count(mesh.steps)} steps, ${seconds(mesh.trainSeconds)}`],
        ['Triangles', count(mesh.triangleCount) +
          (mesh.levels.length > 0 ? `, simpler: ${mesh.levels.map((l) => count(l.triangleCount)).join(', ')}` : '')],
        ['Colors', mesh.textureBytes > 0 ? 'texture from the images' : 'per vertex'],
      ]) : h('p', { class: 'empty' }, 'The field of this object has not been trained long enough for a mesh.'),
      mesh ? h('figure', {}, stepsChart(object.history), h('figcaption', {}, 'Training steps over training time')) : null,
      this.nextView(object));
  }

  private nextView(object: MapObject): HTMLElement | null {
    const next = object.mesh?.nextView;
    const pose = object.update.tWorldMesh;
    if (!next || !pose) return null;
    return h('p', { class: 'callout' }, icon('eye'), h('span', {}, h('b', {}, 'Look here next: '),
      `${describeDirection(rotate(pose.rotation, next.direction))}. This view would show ${percent(next.gain)} of the ` +
      'surface that is badly observed so far; the arrow points from there.'));
  }
}

function facts(rows: [string, string | Node][]): HTMLElement {
  return h('dl', { class: 'facts' }, rows.flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)]));
}

function meter(share: number): HTMLElement {
  return h('span', { class: 'meter-row' },
    h('progress', { max: 1, value: Math.max(0, Math.min(1, share)), 'aria-label': percent(share) }), percent(share));
}

function size(half: { x: number; y: number; z: number }): string {
  return `${length(2 * half.x)} × ${length(2 * half.y)} × ${length(2 * half.z)}`;
}
