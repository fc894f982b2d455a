// The list of objects in the panel.
import type { MapObject } from '../state/map_store';
import { count } from './format';
import { h, icon, setAttribute, setText } from './dom';

interface Row { element: HTMLButtonElement; name: HTMLElement; detail: HTMLElement; badge: HTMLElement }

const kOrder = new Intl.Collator('en');

export class ObjectList {
  readonly element: HTMLElement;
  private readonly list = h('div', { class: 'object-list', role: 'list' });
  private readonly empty = h('p', { class: 'empty' });
  private readonly rows = new Map<string, Row>();

  constructor(private readonly onSelect: (id: string) => void) {
    this.element = h('div', {}, this.empty, this.list);
  }

  /** `faultOf`: why the mesh of an object is not shown, or "". */
  update(objects: readonly MapObject[], selected: string | null, faultOf: (id: string) => string, emptyText: string): void {
    setText(this.empty, objects.length === 0 ? emptyText : '');
    this.empty.hidden = objects.length > 0;
    const sorted = ObjectList.sorted(objects);
    const keep = new Set(sorted.map((o) => o.update.id));
    for (const [id, row] of this.rows) {
      if (keep.has(id)) continue;
      row.element.parentElement?.remove();
      this.rows.delete(id);
    }
    sorted.forEach((object, n) => {
      const row = this.rows.get(object.update.id) ?? this.addRow(object.update.id);
      const item = row.element.parentElement!;
      if (this.list.children[n] !== item) this.list.insertBefore(item, this.list.children[n] ?? null);
      this.fill(row, object, object.update.id === selected, faultOf(object.update.id));
    });
  }

  /** Confirmed objects first, then by class and id. */
  static sorted(objects: readonly MapObject[]): MapObject[] {
    const rank = (o: MapObject): number => (o.update.state === 'PROVISIONAL' ? 1 : 0);
    return [...objects].sort((a, b) => rank(a) - rank(b) || kOrder.compare(a.update.className, b.update.className) ||
      Number(a.update.id) - Number(b.update.id));
  }

  private addRow(id: string): Row {
    const name = h('span', { class: 'name' });
    const detail = h('span', { class: 'sub' });
    const badge = h('span', { class: 'badge' });
    const element = h('button', { class: 'object-row', 'data-object': id, onclick: () => this.onSelect(id) },
      h('span', { class: 'dot' }), h('span', { class: 'texts' }, name, detail), badge, icon('next'));
    this.list.append(h('div', { role: 'listitem' }, element));
    const row = { element, name, detail, badge };
    this.rows.set(id, row);
    return row;
  }

  private fill(row: Row, object: MapObject, isSelected: boolean, fault: string): void {
    const { update, mesh } = object;
    setAttribute(row.element, 'aria-current', String(isSelected));
    setAttribute(row.element, 'data-state', update.state.toLowerCase());
    setText(row.name, `${update.className} #${update.id}`);
    setText(row.detail, mesh ? `${count(update.observations)} views · ${count(mesh.triangleCount)} triangles`
      : `${count(update.observations)} views · no mesh yet`);
    const badge = fault ? 'mesh damaged' : update.state === 'PROVISIONAL' ? 'not confirmed'
      : update.state === 'LOST' ? 'not seen' : mesh?.isFinal ? 'final' : mesh ? `${shortCount(mesh.steps)} steps` : '';
    setText(row.badge, badge);
    setAttribute(row.badge, 'data-kind', fault ? 'error' : mesh?.isFinal && update.state === 'CONFIRMED' ? 'good' : '');
  }
}

function shortCount(n: number): string {
  return n >= 10000 ? `${Math.round(n / 1000)}k` : n >= 1000 ? `${(n / 1000).toFixed(1)}k` : String(n);
}
