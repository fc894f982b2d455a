// The events of one session. Connects again by itself after a lost link or a restart of the server.
import { ApiError, sessionPath, type ApiClient } from './client';
import { Backoff } from './backoff';
import * as json from './json';
import { SseParser } from './sse';
import type { MapEvent, StreamOpened } from './types';

export type FeedStatus =
  | { kind: 'connecting' }
  | { kind: 'live' }
  | { kind: 'retrying'; delayMs: number; message: string }
  | { kind: 'ended' }                              // the session is finished
  | { kind: 'gone' }                               // no such session (any more)
  | { kind: 'unauthenticated'; message: string }   // a token is needed, or this one is not valid
  | { kind: 'denied'; message: string };

export interface FeedHandlers {
  opened(opened: StreamOpened): void;
  event(event: MapEvent): void;
  status(status: FeedStatus): void;
}

// The server sends a comment every 10 s.
const kSilenceMs = 25000;

type End = { code: string; message: string };

export class EventFeed {
  private readonly backoff = new Backoff();
  private abort: AbortController | null = null;
  private wake: (() => void) | null = null;
  private isStopped = false;

  constructor(private readonly api: ApiClient, private readonly sessionId: string,
              private readonly handlers: FeedHandlers, private readonly withMeshes = true) {}

  start(): void {
    void this.run();
  }

  stop(): void {
    this.isStopped = true;
    this.abort?.abort();
    this.wake?.();
  }

  /** Ends the wait before the next attempt. */
  retryNow(): void {
    this.backoff.reset();
    this.wake?.();
  }

  private async run(): Promise<void> {
    this.handlers.status({ kind: 'connecting' });
    while (!this.isStopped) {
      let message: string;
      try {
        const end = await this.readStream();
        const final = end && this.finalStatus(end.code, end.message);
        if (final) return this.handlers.status(final);
        message = end?.message || 'The connection was closed.';
      } catch (error) {
        if (this.isStopped) return;
        const final = error instanceof ApiError ? this.finalStatus(error.code, error.message, error.status) : null;
        if (final) return this.handlers.status(final);
        message = error instanceof ApiError ? error.message : 'The connection was lost.';
      }
      if (this.isStopped) return;
      const delayMs = this.backoff.nextMs();
      this.handlers.status({ kind: 'retrying', delayMs, message });
      await this.sleep(delayMs);
    }
  }

  private finalStatus(code: string, message: string, status = 0): FeedStatus | null {
    if (code === 'OK') return { kind: 'ended' };
    if (code === 'NOT_FOUND' || status === 404) return { kind: 'gone' };
    if (code === 'UNAUTHENTICATED' || status === 401) return { kind: 'unauthenticated', message };
    if (code === 'PERMISSION_DENIED' || status === 403) return { kind: 'denied', message };
    return null;
  }

  /** Returns how the stream ended, null if it broke off. */
  private async readStream(): Promise<End | null> {
    const abort = new AbortController();
    this.abort = abort;
    let watchdog = setTimeout(() => abort.abort(), kSilenceMs);
    try {
      const response = await this.api.request(
        `${sessionPath(this.sessionId)}/events?meshes=${this.withMeshes ? 1 : 0}`, { signal: abort.signal });
      const reader = response.body?.getReader();
      if (!reader) return null;
      const parser = new SseParser();
      const decoder = new TextDecoder();
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return null;
        clearTimeout(watchdog);
        watchdog = setTimeout(() => abort.abort(), kSilenceMs);
        for (const { event, data } of parser.push(decoder.decode(value, { stream: true }))) {
          const end = this.handle(event, data);
          if (end) return end;
        }
      }
    } finally {
      clearTimeout(watchdog);
      abort.abort();
    }
  }

  private handle(event: string, data: string): End | null {
    let value: unknown;
    try {
      value = JSON.parse(data);
    } catch {
      return null;  // an event that is not JSON is of an unknown kind
    }
    if (this.isStopped) return null;
    if (event === 'opened') {
      this.handlers.status({ kind: 'live' });
      this.handlers.opened(json.streamOpened(value));
    } else if (event === 'map') {
      this.backoff.reset();
      const parsed = json.mapEvent(value);
      if (parsed) this.handlers.event(parsed);
    } else if (event === 'end') {
      const end = value as Partial<End> | null;
      return { code: String(end?.code ?? 'UNKNOWN'), message: String(end?.message ?? '') };
    }
    return null;
  }

  private sleep(ms: number): Promise<void> {
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, ms);
      this.wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  }
}
