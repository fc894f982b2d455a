// Draco meshes to geometries, in workers. A decoder that fails or hangs is replaced by a new one.
import { BufferAttribute, BufferGeometry } from 'three';
import { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
import wrapperUrl from 'three/examples/jsm/libs/draco/draco_wasm_wrapper.js?url';
import wasmUrl from 'three/examples/jsm/libs/draco/draco_decoder.wasm?url';

const kTimeoutMs = 30000;
const kWorkers = 2;

// What the loader of three.js has beyond its type declaration.
interface DecoderInternals {
  decodeGeometry(buffer: ArrayBuffer, task: object): Promise<BufferGeometry>;
}

class HashedDracoLoader extends DRACOLoader {
  // The loader asks for fixed names; the build gives the files names with content hashes.
  _loadLibrary(name: string, responseType: 'text' | 'arraybuffer'): Promise<unknown> {
    const url = name.endsWith('.wasm') ? wasmUrl : wrapperUrl;
    return fetch(url, { credentials: 'omit' }).then((response): Promise<unknown> => {
      if (!response.ok) throw new Error(`the mesh decoder could not be loaded (status ${response.status})`);
      return responseType === 'text' ? response.text() : response.arrayBuffer();
    });
  }
}

// `GENERIC` is the first generic attribute: the observation confidence, one byte per vertex.
const kTask = {
  attributeIDs: { position: 'POSITION', normal: 'NORMAL', color: 'COLOR', uv: 'TEX_COORD', confidence: 'GENERIC' },
  attributeTypes: {
    position: 'Float32Array', normal: 'Float32Array', color: 'Uint8Array', uv: 'Float32Array',
    confidence: 'Uint8Array',
  },
  useUniqueIDs: false,
  vertexColorSpace: '',  // the shader takes the bytes as they are: sRGB
};

export class DracoDecoder {
  private loader = this.make();

  /** Takes over `buffer`. Rejects with a message for people if the data are damaged or take too long. */
  async decode(buffer: ArrayBuffer): Promise<BufferGeometry> {
    // Garbage is mostly found here, and no worker has to report it.
    const magic = String.fromCharCode(...new Uint8Array(buffer.slice(0, 5)));
    if (magic !== 'DRACO') throw new Error('the data are not a Draco mesh');
    const loader = this.loader;
    let timer = 0;
    const timeout = new Promise<never>((_, reject) => {
      timer = window.setTimeout(() => reject(new Error(`decoding took more than ${kTimeoutMs / 1000} s`)), kTimeoutMs);
    });
    try {
      const geometry = await Promise.race([
        (loader as unknown as DecoderInternals).decodeGeometry(buffer, kTask), timeout]);
      check(geometry);
      return geometry;
    } catch (error) {
      // A worker may be out of memory or stuck. Other meshes of this loader fail with it and are asked for again.
      if (this.loader === loader) this.loader = this.make();
      window.setTimeout(() => loader.dispose(), kTimeoutMs);
      throw new Error(describe(error));
    } finally {
      window.clearTimeout(timer);
    }
  }

  dispose(): void {
    this.loader.dispose();
  }

  private make(): HashedDracoLoader {
    const loader = new HashedDracoLoader();
    loader.setWorkerLimit(kWorkers);
    return loader;
  }
}

function describe(error: unknown): string {
  const text = error instanceof Error ? error.message : String((error as { error?: unknown } | null)?.error ?? error);
  return text.replace(/^THREE\.DRACOLoader: /, '').replace(/^Decoding failed: /, 'decoding failed: ');
}

function check(geometry: BufferGeometry): void {
  const position = geometry.getAttribute('position') as BufferAttribute | undefined;
  const index = geometry.getIndex();
  if (!position || !index || index.count === 0) throw new Error('the mesh is empty');
  for (const [name, size] of [['normal', 3], ['color', 3], ['uv', 2], ['confidence', 1]] as const) {
    const attribute = geometry.getAttribute(name) as BufferAttribute | undefined;
    if (attribute && attribute.itemSize < size) geometry.deleteAttribute(name);
    else if (attribute && (name === 'color' || name === 'confidence')) attribute.normalized = true;
  }
  geometry.computeBoundingSphere();
  if (!Number.isFinite(geometry.boundingSphere?.radius ?? NaN)) throw new Error('a vertex of the mesh is not finite');
}
