// The state of the connection, in the top bar.
import type { FeedStatus } from '../api/feed';
import { h, setText } from './dom';

export class LinkChip {
  readonly element: HTMLElement;
  private readonly text = h('span', { role: 'status', 'aria-live': 'polite' });
  private readonly retry: HTMLButtonElement;

  constructor(onRetry: () => void) {
    this.retry = h('button', { class: 'plain small', onclick: onRetry }, 'Retry now');
    this.element = h('span', { class: 'link-chip', 'data-state': 'connecting' }, h('i', {}), this.text, this.retry);
    this.update({ kind: 'connecting' });
  }

  update(status: FeedStatus): void {
    this.element.dataset.state = status.kind;
    this.retry.hidden = status.kind !== 'retrying';
    setText(this.text, kTexts[status.kind]);
    this.element.title = status.kind === 'retrying' ? status.message : '';
  }
}

const kTexts: Record<FeedStatus['kind'], string> = {
  connecting: 'connecting', live: 'live', retrying: 'link lost, retrying', ended: 'complete', gone: 'deleted',
  unauthenticated: 'token needed', denied: 'not allowed',
};
