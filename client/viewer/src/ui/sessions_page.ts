// The list of sessions.
import { ApiError, type ApiClient } from '../api/client';
import type { SessionInfo } from '../api/types';
import { ago, bytes, percent, plural } from './format';
import { h, icon, replaceChildren } from './dom';
import type { Page } from './page';
import { Poller } from './pollers';
import { kSessionStates } from './session_panel';
import { topBar } from './top_bar';

export class SessionsPage implements Page {
  readonly element: HTMLElement;
  private readonly list = h('div', { class: 'cards', role: 'list' });
  private readonly message = h('div', { class: 'list-message', role: 'status', 'aria-live': 'polite' });
  private readonly poller: Poller;
  private key = '';

  constructor(private readonly api: ApiClient, private readonly onToken: (reason: string) => Promise<boolean>) {
    this.poller = new Poller(() => this.load(), () => 3000);
    this.element = h('div', { class: 'page' }, topBar([], [], false),
      h('main', { class: 'sessions' },
        h('div', { class: 'row' }, h('h1', {}, 'Sessions'), h('span', { class: 'grow' }),
          h('a', { class: 'button primary', href: '/camera' }, icon('camera'), 'Map with this camera')),
        this.message, this.list));
  }

  start(): void {
    document.title = 'Sessions – romap';
    this.poller.poke();
  }

  stop(): void {
    this.poller.stop();
  }

  private async load(): Promise<void> {
    try {
      this.show(await this.api.sessions());
    } catch (error) {
      await this.showError(error);
    }
  }

  private async showError(error: unknown): Promise<void> {
    this.key = '';
    if (error instanceof ApiError && error.status === 401) {
      replaceChildren(this.message, h('p', {}, 'The server shows its sessions only to people with a token. ',
        h('button', { class: 'button', onclick: () => void this.askToken(error.message) }, 'Enter token')));
      await this.askToken(error.message);
    } else if (error instanceof ApiError && error.status === 403) {
      replaceChildren(this.message, h('p', {}, `Your token does not allow this: ${error.message}`));
    } else {
      replaceChildren(this.message, h('p', { class: 'callout error' },
        'The server cannot be reached; trying again. Is romap-server running, and is its address right?'));
    }
  }

  private asked = false;

  private async askToken(reason: string): Promise<void> {
    if (this.asked) return;
    this.asked = true;
    const text = this.api.hasToken ? `The token was not accepted: ${reason}` : 'This server needs a token.';
    const isEntered = await this.onToken(text);
    if (isEntered) {
      this.asked = false;
      this.poller.poke();
    } else {
      // Not asked again until the person presses the button.
      window.setTimeout(() => (this.asked = false), 0);
      this.poller.stop();
    }
  }

  private show(sessions: SessionInfo[]): void {
    const key = JSON.stringify(sessions);
    if (key === this.key) return;
    this.key = key;
    replaceChildren(this.message, sessions.length > 0 ? null
      : h('div', { class: 'first' }, h('h2', {}, 'No sessions yet'),
        h('p', {}, 'A session begins when a client sends a video. Two ways to begin one:'),
        h('ul', {}, h('li', {}, 'run ', h('code', {}, 'romap run SEQUENCE --out DIR'), ' on a computer with a recording'),
          h('li', {}, h('a', { href: '/camera' }, 'map with the camera of this device')))));
    const newestFirst = [...sessions].sort((a, b) => b.createdUnixMs - a.createdUnixMs);
    replaceChildren(this.list, newestFirst.map((s) => h('div', { role: 'listitem' }, card(s))));
  }
}

function card(s: SessionInfo): HTMLElement {
  const statistics = s.statistics;
  const facts = [
    plural(statistics.objects, 'object'), plural(statistics.framesProcessed, 'frame'),
    s.storedBytes > 0 ? `${bytes(s.storedBytes)} stored` : '', s.tenant, s.pinned ? 'pinned' : '',
  ].filter((t) => t !== '');
  const problems = statistics.diagnostics.filter((d) => d.severity !== 'INFO').length;
  return h('a', { class: 'card', href: `#session/${encodeURIComponent(s.id)}`, 'data-session': s.id },
    h('div', { class: 'row' }, h('h2', {}, s.name || 'Unnamed session'),
      h('span', { class: 'chip', 'data-state': s.state.toLowerCase() },
        s.state === 'OPEN' && s.streamOpen ? 'receiving' : kSessionStates[s.state])),
    h('p', { class: 'facts-line' }, facts.join(' · ')),
    statistics.trainingSteps > 0 ? h('progress', {
      class: 'wide', max: 1, value: statistics.trainingProgress, 'aria-label': `Training ${percent(statistics.trainingProgress)}`,
    }) : null,
    h('p', { class: 'hint' }, [
      s.createdUnixMs > 0 ? ago(s.createdUnixMs, Date.now()) : '', `id ${s.id}`,
      problems > 0 ? plural(problems, 'warning') : '',
    ].filter((t) => t !== '').join(' · ')));
}
