// Short messages at the bottom of the page. They are also read by screen readers.
import { h, icon } from './dom';

const kShownMs = 7000;
let host: HTMLElement | null = null;

export function notify(text: string, level: 'info' | 'error' = 'info'): void {
  if (!host) {
    host = h('div', { class: 'notices', role: 'status', 'aria-live': 'polite' });
    document.body.append(host);
  }
  for (const old of [...host.children]) if (old.getAttribute('data-text') === text) old.remove();
  const close = h('button', { class: 'plain', 'aria-label': 'Close message', onclick: () => notice.remove() }, icon('close'));
  const notice = h('div', { class: `notice ${level}`, 'data-text': text }, h('span', {}, text), close);
  host.append(notice);
  while (host.children.length > 3) host.firstElementChild?.remove();
  window.setTimeout(() => notice.remove(), kShownMs);
}
