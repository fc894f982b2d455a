// Sends the newest picture whenever the last one was answered: at most one request is in flight, and no old picture waits.
import { ApiError, type ApiClient } from '../api/client';
import { Backoff } from '../api/backoff';
import type { FrameAck } from '../api/types';
import { SendRate } from './send_rate';

export interface SenderHandlers {
  picture(quality: number): Promise<Blob | null>;
  ack(ack: FrameAck): void;
  /** A lost link; "" when it is back. */
  trouble(text: string): void;
  /** The server takes no more pictures of this session. */
  ended(error: ApiError): void;
}

export class Sender {
  readonly rate = new SendRate();
  sent = 0;
  isPaused = false;
  private isStopped = false;
  private frameId = 0;
  private lastTimestampNs = 0n;
  private readonly backoff = new Backoff(500, 8000);

  constructor(private readonly api: ApiClient, private readonly sessionId: string, private readonly handlers: SenderHandlers) {}

  start(): void {
    void this.run();
  }

  stop(): void {
    this.isStopped = true;
  }

  private async run(): Promise<void> {
    while (!this.isStopped) {
      const start = performance.now();
      let waitMs = this.rate.gapMs();
      if (!this.isPaused) {
        try {
          await this.sendOne(start);
        } catch (error) {
          if (this.isStopped) return;
          if (error instanceof ApiError && isFinal(error)) return this.handlers.ended(error);
          this.rate.noteLost();
          this.handlers.trouble(error instanceof ApiError && error.status === 429 ? 'The server is busy, waiting'
            : 'Link lost, retrying');
          waitMs = performance.now() - start + this.backoff.nextMs();
        }
      }
      const rest = start + waitMs - performance.now();
      await new Promise((resolve) => setTimeout(resolve, Math.max(0, rest)));
    }
  }

  private async sendOne(start: number): Promise<void> {
    const timestampNs = this.nextTimestamp();
    const jpeg = await this.handlers.picture(this.rate.quality);
    if (!jpeg || this.isStopped) return;
    this.frameId += 1;
    const ack = await this.api.sendFrame(this.sessionId, this.frameId, timestampNs, jpeg);
    this.rate.noteRoundTrip(performance.now() - start);
    this.backoff.reset();
    this.sent += 1;
    if (this.isStopped) return;
    this.handlers.trouble('');
    this.handlers.ack(ack);
  }

  // Strictly increasing, also if the clock of the device is set back.
  private nextTimestamp(): bigint {
    const now = BigInt(Math.round((performance.timeOrigin + performance.now()) * 1000)) * 1000n;
    this.lastTimestampNs = now > this.lastTimestampNs ? now : this.lastTimestampNs + 1n;
    return this.lastTimestampNs;
  }
}

// Neither waiting nor sending again helps.
function isFinal(error: ApiError): boolean {
  return error.status !== 0 && error.status !== 429 && error.status < 500 && error.status !== 408;
}
