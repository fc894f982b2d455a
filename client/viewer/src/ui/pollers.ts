// What is asked for again and again: the camera image, the sparse points, the trajectory, and the state of the session.
import { ApiError, sessionPath, type ApiClient } from '../api/client';
import type { PathPose } from '../state/path_store';
import type { TrajectoryAnswer, TrajectoryRequest } from '../state/trajectory_worker';

/** Runs `work` again `pauseMs()` after its end; null: not until `poke`. Pauses while the page is hidden. */
export class Poller {
  private timer = 0;
  private isRunning = false;
  private isPoked = false;
  private isStopped = false;
  private readonly abort = new AbortController();

  constructor(private readonly work: (signal: AbortSignal) => Promise<void>, private readonly pauseMs: () => number | null) {
    document.addEventListener('visibilitychange', this.onVisible);
  }

  /** Runs it now, or once more if it is running. */
  poke(): void {
    if (this.isStopped) return;
    window.clearTimeout(this.timer);
    this.timer = 0;
    if (this.isRunning) {
      this.isPoked = true;
      return;
    }
    void this.run();
  }

  stop(): void {
    this.isStopped = true;
    this.abort.abort();
    window.clearTimeout(this.timer);
    document.removeEventListener('visibilitychange', this.onVisible);
  }

  private async run(): Promise<void> {
    this.isRunning = true;
    this.isPoked = false;
    try {
      await this.work(this.abort.signal);
    } catch {
      // The feed of events shows and repairs a broken link; these are tried again anyway.
    }
    this.isRunning = false;
    if (this.isStopped) return;
    if (this.isPoked) return this.poke();
    const pause = this.pauseMs();
    if (pause !== null && !document.hidden) this.timer = window.setTimeout(() => this.poke(), pause);
  }

  private readonly onVisible = (): void => {
    if (!document.hidden && this.timer === 0 && this.pauseMs() !== null) this.poke();
  };
}

/** The newest image; null if there is none. Throws if the server is not reached. */
export async function loadFrame(api: ApiClient, sessionId: string, signal: AbortSignal): Promise<Blob | null> {
  try {
    const response = await api.request(`${sessionPath(sessionId)}/frame.jpg`, { signal, cache: 'no-store' });
    return response.status === 204 ? null : await response.blob();
  } catch (error) {
    if (error instanceof ApiError && error.status === 404) return null;
    throw error;
  }
}

const kMaxPoses = 20000;

export class TrajectoryLoader {
  private worker: Worker | null = null;
  lastSeconds = 0;

  constructor(private readonly api: ApiClient, private readonly sessionId: string) {}

  /** Null if it is not available. */
  load(): Promise<PathPose[] | null> {
    const worker = this.worker ?? new Worker(new URL('../state/trajectory_worker.ts', import.meta.url), { type: 'module' });
    this.worker = worker;
    const request: TrajectoryRequest = {
      url: `${sessionPath(this.sessionId)}/trajectory`, headers: this.api.headers(), maxPoses: kMaxPoses,
    };
    return new Promise((resolve) => {
      worker.onmessage = (message: MessageEvent<TrajectoryAnswer>) => {
        if ('error' in message.data) return resolve(null);
        this.lastSeconds = message.data.seconds;
        resolve(message.data.poses);
      };
      worker.onerror = () => resolve(null);
      worker.postMessage(request);
    });
  }

  dispose(): void {
    this.worker?.terminate();
  }
}
