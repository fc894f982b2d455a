// Fetches and decodes the versions of meshes, a few at a time, the most wanted first.
import {
  BufferGeometry, LinearFilter, LinearMipmapLinearFilter, NoColorSpace, Texture,
} from 'three';
import { ApiError, sessionPath, type ApiClient } from '../api/client';
import { DracoDecoder } from './draco_decoder';

export interface MeshKey { id: string; revision: number; level: number }

export interface MeshJob extends MeshKey {
  bytes: number;  // announced size
  priority: number;  // larger is earlier
}

export interface MeshSink {
  loaded(key: MeshKey, geometry: BufferGeometry): void;
  failed(key: MeshKey, note: string): void;
  texture(key: MeshKey, texture: Texture): void;
}

export const kMaxMeshBytes = 48 << 20;
const kMaxTextureBytes = 32 << 20;
const kParallel = 3;
const kAttempts = 3;

const nameOf = (key: MeshKey): string => `${key.id}/${key.revision}/${key.level}`;

export class MeshSource {
  private readonly decoder = new DracoDecoder();
  private readonly waiting = new Map<string, MeshJob>();
  private readonly running = new Map<string, AbortController>();
  private isDisposed = false;

  constructor(private readonly api: ApiClient, private readonly sessionId: string, private readonly sink: MeshSink) {}

  /** Level -2 is the texture. Asking again changes the priority. */
  want(job: MeshJob): void {
    const name = nameOf(job);
    if (this.running.has(name)) return;
    this.waiting.set(name, job);
    this.next();
  }

  /** Forgets what has not begun; called before the wishes of a new view. */
  clearWaiting(): void {
    this.waiting.clear();
  }

  get pending(): number {
    return this.waiting.size + this.running.size;
  }

  dispose(): void {
    this.isDisposed = true;
    this.waiting.clear();
    for (const abort of this.running.values()) abort.abort();
    this.decoder.dispose();
  }

  private next(): void {
    while (!this.isDisposed && this.running.size < kParallel && this.waiting.size > 0) {
      let best: [string, MeshJob] | null = null;
      for (const entry of this.waiting) if (!best || entry[1].priority > best[1].priority) best = entry;
      if (!best) return;
      const [name, job] = best;
      this.waiting.delete(name);
      const abort = new AbortController();
      this.running.set(name, abort);
      this.load(job, abort.signal)
        .catch((error: unknown) => {
          if (!this.isDisposed) this.sink.failed(job, error instanceof Error ? error.message : String(error));
        })
        .finally(() => {
          this.running.delete(name);
          this.next();
        });
    }
  }

  private async load(job: MeshJob, signal: AbortSignal): Promise<void> {
    const limit = job.level === -2 ? kMaxTextureBytes : kMaxMeshBytes;
    if (job.bytes > limit) {
      throw new Error(`it is too large for the browser (${Math.round(job.bytes / 1048576)} MB, ` +
                      `limit ${limit / 1048576} MB)`);
    }
    const path = `${sessionPath(this.sessionId)}/objects/${job.id}/mesh/${job.revision}`;
    const url = job.level === -2 ? `${path}/texture` : job.level < 0 ? path : `${path}/levels/${job.level}`;
    const data = await this.fetchWithRetry(url, signal);
    if (!data || this.isDisposed) return;
    if (job.level === -2) {
      const texture = await decodeTexture(data);
      if (!this.isDisposed) this.sink.texture(job, texture);
      return;
    }
    const geometry = await this.decoder.decode(await data.arrayBuffer());
    if (this.isDisposed) geometry.dispose();
    else this.sink.loaded(job, geometry);
  }

  /** Null if there is a newer revision, whose event is on its way. */
  private async fetchWithRetry(url: string, signal: AbortSignal): Promise<Blob | null> {
    for (let attempt = 1; ; ++attempt) {
      try {
        return await (await this.api.request(url, { signal })).blob();
      } catch (error) {
        if (signal.aborted || (error instanceof ApiError && error.status === 404)) return null;
        const canRetry =
          !(error instanceof ApiError) || error.status === 0 || error.status === 429 || error.status >= 500;
        if (!canRetry) throw error;
        if (attempt >= kAttempts) throw error instanceof ApiError ? error : new Error('the transfer breaks off');
        await new Promise((resolve) => setTimeout(resolve, 1000 * attempt));
      }
    }
  }
}

async function decodeTexture(blob: Blob): Promise<Texture> {
  let bitmap: ImageBitmap;
  try {
    bitmap = await createImageBitmap(blob, { colorSpaceConversion: 'none', premultiplyAlpha: 'none' });
  } catch {
    throw new Error('the texture is not a usable image');
  }
  const texture = new Texture(bitmap);
  texture.flipY = false;  // v points down, as in glTF
  texture.colorSpace = NoColorSpace;
  texture.generateMipmaps = true;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.magFilter = LinearFilter;
  texture.anisotropy = 4;
  texture.needsUpdate = true;
  return texture;
}
