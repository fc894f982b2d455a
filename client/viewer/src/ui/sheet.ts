// On a narrow screen the panel is a sheet at the bottom with three heights; its handle is dragged or pressed.
import { h } from './dom';

type Height = 'low' | 'half' | 'full';
const kOrder: Height[] = ['low', 'half', 'full'];

export class Sheet {
  readonly handle: HTMLButtonElement;
  private height: Height = 'half';

  constructor(private readonly panel: HTMLElement) {
    this.handle = h('button', { class: 'handle', 'aria-label': 'Change the height of the panel', onclick: () => this.cycle() });
    this.set('half');
    let start: { y: number; height: number } | null = null;
    let isDragged = false;
    this.handle.addEventListener('pointerdown', (event) => {
      start = { y: event.clientY, height: panel.clientHeight };
      isDragged = false;
      this.handle.setPointerCapture(event.pointerId);
    });
    this.handle.addEventListener('pointermove', (event) => {
      if (!start || Math.abs(event.clientY - start.y) < 6) return;
      isDragged = true;
      panel.classList.add('dragging');
      panel.style.height = `${Math.max(60, start.height + start.y - event.clientY)}px`;
    });
    const end = (): void => {
      if (start && isDragged) this.snap();
      start = null;
    };
    this.handle.addEventListener('pointerup', end);
    this.handle.addEventListener('pointercancel', end);
    this.handle.addEventListener('click', (event) => {
      if (isDragged) event.stopImmediatePropagation();
    }, { capture: true });
  }

  set(height: Height): void {
    this.height = height;
    this.panel.style.height = '';
    this.panel.classList.remove('dragging');
    this.panel.dataset.height = height;
  }

  /** At least half, so that what was asked for is seen. */
  raise(): void {
    if (this.height === 'low') this.set('half');
  }

  private cycle(): void {
    this.set(kOrder[(kOrder.indexOf(this.height) + 1) % kOrder.length] ?? 'half');
  }

  private snap(): void {
    const share = this.panel.clientHeight / window.innerHeight;
    this.set(share < 0.25 ? 'low' : share < 0.68 ? 'half' : 'full');
  }
}
