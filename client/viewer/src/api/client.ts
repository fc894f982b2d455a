// Requests to the HTTP interface of romap-server. The token is sent as a header, never in a URL.
import * as json from './json';
import type { FrameAck, ServerInfo, SessionInfo } from './types';

/** `status` 0: the server was not reached. `code`: a gRPC status code by name. */
export class ApiError extends Error {
  constructor(readonly status: number, readonly code: string, message: string) {
    super(message);
  }
}

const kTimeoutMs = 15000;
const kTokenKey = 'romap-token';

function readStoredToken(): string {
  try {
    return sessionStorage.getItem(kTokenKey) ?? '';
  } catch {
    return '';  // storage is switched off in this browser
  }
}

export class ApiClient {
  private token = readStoredToken();

  get hasToken(): boolean {
    return this.token !== '';
  }

  /** `keep`: until the tab is closed; else until the page is left. */
  setToken(token: string, keep: boolean): void {
    this.token = token;
    try {
      if (keep && token !== '') sessionStorage.setItem(kTokenKey, token);
      else sessionStorage.removeItem(kTokenKey);
    } catch {
      // Without storage the token is kept in memory.
    }
  }

  /** For requests that are not made here, e.g. in a worker. */
  headers(): Record<string, string> {
    return this.token === '' ? {} : { Authorization: `Bearer ${this.token}` };
  }

  /** Throws ApiError for every answer that is not a success. No time limit beyond that of `init.signal`. */
  async request(path: string, init: RequestInit = {}): Promise<Response> {
    const headers = new Headers(init.headers);
    for (const [name, value] of Object.entries(this.headers())) headers.set(name, value);
    if (init.method && init.method !== 'GET') headers.set('X-Romap', '1');
    let response: Response;
    try {
      response = await fetch(path, { ...init, headers, credentials: 'omit' });
    } catch (error) {
      if (init.signal?.aborted) throw error;
      throw new ApiError(0, 'UNAVAILABLE', 'The server cannot be reached.');
    }
    if (response.ok) return response;
    let code = 'UNKNOWN';
    let message = `The server answered with status ${response.status}.`;
    try {
      const body = (await response.json()) as { code?: unknown; message?: unknown };
      if (typeof body.code === 'string') code = body.code;
      if (typeof body.message === 'string' && body.message !== '') message = body.message;
    } catch {
      // Something between the server and the page answered; the status has to do.
    }
    throw new ApiError(response.status, code, message);
  }

  private async json(path: string, init: RequestInit = {}): Promise<unknown> {
    const response = await this.request(path, { signal: AbortSignal.timeout(kTimeoutMs), ...init });
    return response.json();
  }

  private post(path: string, body: unknown): Promise<unknown> {
    return this.json(path, {
      method: 'POST', body: JSON.stringify(body), headers: { 'Content-Type': 'application/json' },
    });
  }

  async server(): Promise<ServerInfo> {
    const s = (await this.json('/api/v1/server')) as Record<string, unknown>;
    return {
      version: typeof s.version === 'string' ? s.version : '', needsToken: s.needsToken === true,
      maxMessageBytes: json.num(s.maxMessageBytes, 32 << 20),
    };
  }

  async sessions(): Promise<SessionInfo[]> {
    return json.sessionList(await this.json('/api/v1/sessions'));
  }

  async session(sessionId: string): Promise<SessionInfo> {
    return this.toInfo(await this.json(sessionPath(sessionId)));
  }

  async create(request: unknown): Promise<SessionInfo> {
    const response = (await this.post('/api/v1/sessions', request)) as { session?: unknown };
    return this.toInfo(response.session);
  }

  async finish(sessionId: string): Promise<SessionInfo> {
    return this.toInfo(await this.post(`${sessionPath(sessionId)}/finish`, {}));
  }

  async remove(sessionId: string): Promise<void> {
    await this.json(sessionPath(sessionId), { method: 'DELETE' });
  }

  async sendFrame(sessionId: string, frameId: number, timestampNs: bigint, jpeg: Blob): Promise<FrameAck> {
    const path = `${sessionPath(sessionId)}/frames?timestamp_ns=${timestampNs}&frame_id=${frameId}`;
    return json.frameAck(await this.json(path, {
      method: 'POST', body: jpeg, headers: { 'Content-Type': 'image/jpeg' },
    }));
  }

  private toInfo(value: unknown): SessionInfo {
    const info = json.sessionInfo(value);
    if (!info) throw new ApiError(0, 'INTERNAL', 'The server sent a session without an id.');
    return info;
  }
}

export function sessionPath(sessionId: string): string {
  return `/api/v1/sessions/${encodeURIComponent(sessionId)}`;
}
