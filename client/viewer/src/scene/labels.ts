// Texts at points of the 3D view, as HTML. Texts that would overlap a nearer one are left out.
import type { Vector3 } from 'three';
import { h } from '../ui/dom';
import type { Stage } from './stage';

export interface Label { key: string; text: string; point: Vector3; className: string; priority: number }

interface Entry { element: HTMLElement; label: Label; width: number; isOn: boolean }

const kMaxLabels = 60;
const kHeightPx = 20;

export class LabelLayer {
  readonly host = h('div', { class: 'labels', 'aria-hidden': 'true' });
  private readonly entries = new Map<string, Entry>();

  constructor(private readonly stage: Stage) {
    stage.host.append(this.host);
  }

  set(labels: readonly Label[]): void {
    const keep = new Set(labels.map((l) => l.key));
    for (const [key, entry] of this.entries) {
      if (keep.has(key)) continue;
      entry.element.remove();
      this.entries.delete(key);
    }
    for (const label of labels) {
      let entry = this.entries.get(label.key);
      if (!entry) {
        entry = { element: h('div', { class: 'label' }), label, width: 0, isOn: false };
        this.entries.set(label.key, entry);
        this.host.append(entry.element);
      }
      if (entry.element.textContent !== label.text) {
        entry.element.textContent = label.text;
        entry.width = 12 + 6.6 * label.text.length;  // measuring would force a layout
      }
      entry.element.className = `label ${label.className}${entry.isOn ? ' on' : ''}`;
      entry.label = label;
    }
    this.place();
  }

  /** After each drawing. */
  place(): void {
    const visible: { entry: Entry; x: number; y: number; distance: number }[] = [];
    for (const entry of this.entries.values()) {
      const at = this.stage.project(entry.label.point);
      if (at && at.x > -40 && at.y > -20 && at.x < this.stage.host.clientWidth + 40 &&
          at.y < this.stage.host.clientHeight + 20) {
        visible.push({ entry, ...at, distance: this.stage.camera.position.distanceTo(entry.label.point) });
      } else {
        this.setOn(entry, false);
      }
    }
    visible.sort((a, b) => b.entry.label.priority - a.entry.label.priority || a.distance - b.distance);
    const taken: { x: number; y: number; width: number }[] = [];
    for (const { entry, x, y } of visible) {
      const isFree = taken.length < kMaxLabels && taken.every(
        (t) => Math.abs(t.x - x) > (t.width + entry.width) / 2 || Math.abs(t.y - y) > kHeightPx);
      this.setOn(entry, isFree);
      if (!isFree) continue;
      taken.push({ x, y, width: entry.width });
      entry.element.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px) translate(-50%, -120%)`;
    }
  }

  private setOn(entry: Entry, isOn: boolean): void {
    if (entry.isOn === isOn) return;
    entry.isOn = isOn;
    entry.element.classList.toggle('on', isOn);
  }
}
