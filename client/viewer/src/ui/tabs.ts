// Tabs by the ARIA pattern: arrow keys move between them.
import { h } from './dom';

export interface Tab { id: string; title: string; content: HTMLElement }

export class Tabs {
  readonly bar = h('div', { class: 'tabs', role: 'tablist' });
  readonly pages = h('div', { class: 'pages' });
  private readonly buttons = new Map<string, HTMLButtonElement>();
  private readonly badges = new Map<string, HTMLElement>();
  active: string;
  onOpen: () => void = () => undefined;

  constructor(private readonly tabs: readonly Tab[]) {
    for (const tab of tabs) {
      const badge = h('span', { class: 'count' });
      const button = h('button', {
        role: 'tab', id: `tab-${tab.id}`, 'aria-controls': `page-${tab.id}`,
        onclick: () => {
          this.open(tab.id);
          this.onOpen();
        },
      }, tab.title, badge);
      button.addEventListener('keydown', (event) => this.onKey(event, tab.id));
      this.buttons.set(tab.id, button);
      this.badges.set(tab.id, badge);
      this.bar.append(button);
      this.pages.append(h('div', { role: 'tabpanel', id: `page-${tab.id}`, 'aria-labelledby': `tab-${tab.id}` }, tab.content));
    }
    this.active = tabs[0]?.id ?? '';
    this.open(this.active);
  }

  open(id: string): void {
    this.active = id;
    this.tabs.forEach((tab, n) => {
      const isOpen = tab.id === id;
      const button = this.buttons.get(tab.id);
      button?.setAttribute('aria-selected', String(isOpen));
      button?.setAttribute('tabindex', isOpen ? '0' : '-1');
      (this.pages.children[n] as HTMLElement).hidden = !isOpen;
    });
  }

  setBadge(id: string, text: string, severity = ''): void {
    const badge = this.badges.get(id);
    if (!badge) return;
    if (badge.textContent !== text) badge.textContent = text;
    badge.dataset.severity = severity;
    badge.hidden = text === '';
  }

  private onKey(event: KeyboardEvent, id: string): void {
    const step = event.key === 'ArrowRight' ? 1 : event.key === 'ArrowLeft' ? -1 : 0;
    if (step === 0) return;
    const n = this.tabs.findIndex((t) => t.id === id);
    const next = this.tabs[(n + step + this.tabs.length) % this.tabs.length];
    if (!next) return;
    this.open(next.id);
    this.buttons.get(next.id)?.focus();
    event.preventDefault();
  }
}
