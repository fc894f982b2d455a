// Chooses the page by the hash of the address: "#session/ID", else the list.
import { ApiClient } from '../api/client';
import { probeWebGl2 } from '../scene/stage';
import { h, replaceChildren } from './dom';
import type { Page } from './page';
import { SessionPage } from './session_page';
import { SessionsPage } from './sessions_page';
import { askForToken } from './token_dialog';

export class App {
  readonly api = new ApiClient();
  private page: Page | null = null;

  constructor(private readonly host: HTMLElement) {}

  start(): void {
    window.addEventListener('hashchange', () => this.show());
    window.addEventListener('pagehide', () => this.page?.stop());
    this.show();
  }

  get session(): SessionPage | null {
    return this.page instanceof SessionPage ? this.page : null;
  }

  private show(): void {
    this.page?.stop();
    const match = /^#session\/(.+)$/.exec(location.hash);
    const askToken = (reason: string): Promise<boolean> => askForToken(this.api, reason);
    let id = '';
    try {
      id = match ? decodeURIComponent(match[1]!) : '';
    } catch {
      // Not a valid address: the list is shown.
    }
    this.page = id !== '' ? new SessionPage(this.api, id, askToken, probeWebGl2() !== null) : new SessionsPage(this.api, askToken);
    replaceChildren(this.host, this.page.element);
    this.page.start();
  }
}

export function failed(host: HTMLElement, error: unknown): void {
  replaceChildren(host, h('main', { class: 'sessions' }, h('p', { class: 'callout error' },
    `The page cannot start: ${error instanceof Error ? error.message : String(error)}. Reload it; if this stays, ` +
    'use a current version of Chrome, Edge, Firefox or Safari.')));
}
