// What lies over the 3D view: messages, the camera image with the tracking state, legends.
import type { FrameAck } from '../api/types';
import type { ColorMode } from '../scene/mesh_material';
import { coaching } from '../state/coaching';
import { percent } from './format';
import { h, icon, replaceChildren, setText } from './dom';

export interface OverlayState { ack: FrameAck | null; gridStep: number | null; color: ColorMode; progress: number | null }

export class StageOverlay {
  private readonly center = h('p', { class: 'stage-message', role: 'status' });
  private readonly faultBox = h('div', { class: 'stage-fault', role: 'alert', hidden: true });
  private readonly hintBox = h('p', { class: 'stage-hint', role: 'status', hidden: true });
  private readonly image = h('img', { class: 'frame', alt: 'Newest image of the camera' });
  private readonly tracking = h('span', { class: 'tracking' });
  private readonly picture: HTMLElement;
  private readonly legend = h('div', { class: 'legend' });
  private readonly scale = h('div', { class: 'scale' }, h('span', {}, 'not observed'), h('i', {}), h('span', {}, 'well observed'));
  private readonly grid = h('span', {});
  private readonly training = h('span', {});
  private url = '';

  constructor(host: HTMLElement) {
    const hide = h('button', {
      class: 'plain', 'aria-label': 'Hide or show the image of the camera', 'aria-expanded': 'true',
      onclick: () => hide.setAttribute('aria-expanded', String(!this.picture.classList.toggle('small'))),
    }, icon('camera'));
    this.picture = h('figure', { class: 'picture', hidden: true }, this.image, h('figcaption', {}, hide, this.tracking));
    this.legend.append(this.scale, this.training, this.grid);
    host.append(this.center, this.hintBox, this.picture, this.legend, this.faultBox);
  }

  /** In the middle of the empty view; "" hides it. */
  message(text: string): void {
    setText(this.center, text);
    this.center.hidden = text === '';
  }

  hint(text: string): void {
    setText(this.hintBox, text);
    this.hintBox.hidden = text === '';
  }

  /** What went wrong and what to do; "" hides it. */
  fault(text: string, way?: { text: string; href?: string; action?: () => void }): void {
    this.faultBox.hidden = text === '';
    replaceChildren(this.faultBox, h('p', {}, text),
      way?.href ? h('a', { class: 'button', href: way.href }, way.text) : null,
      way?.action ? h('button', { class: 'button', onclick: way.action }, way.text) : null);
  }

  setImage(blob: Blob): void {
    const url = URL.createObjectURL(blob);
    this.image.src = url;
    if (this.url !== '') URL.revokeObjectURL(this.url);
    this.url = url;
    this.picture.hidden = false;
  }

  update(state: OverlayState): void {
    const { ack } = state;
    const advice = ack ? coaching(ack.state, ack.stateReason) : null;
    setText(this.tracking, advice?.title ?? 'Camera');
    this.tracking.dataset.level = advice?.level ?? '';
    this.tracking.title = ack?.stateReason ?? '';
    this.scale.hidden = state.color !== 'confidence';
    setText(this.grid, state.gridStep === null ? '' : `grid ${Number(state.gridStep.toPrecision(1))} map units`);
    setText(this.training, state.progress === null ? '' : `training ${percent(state.progress)}`);
  }
}
