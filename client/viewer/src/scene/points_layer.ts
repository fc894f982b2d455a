// The sparse points of the map. Asked for every few seconds while the session is open.
import { BufferAttribute, BufferGeometry, Points, PointsMaterial } from 'three';
import { sessionPath, type ApiClient } from '../api/client';
import type { Stage } from './stage';

const kMaxPoints = 2_000_000;

export class PointsLayer {
  readonly points: Points<BufferGeometry, PointsMaterial>;
  private revision = '';

  constructor(private readonly stage: Stage, private readonly api: ApiClient, private readonly sessionId: string) {
    this.points = new Points(new BufferGeometry(), new PointsMaterial({ size: 2, sizeAttenuation: false }));
    this.points.frustumCulled = false;
    this.points.visible = false;
    stage.scene.add(this.points);
  }

  get count(): number {
    return this.points.geometry.getAttribute('position')?.count ?? 0;
  }

  setColor(color: string): void {
    this.points.material.color.set(color);
  }

  setVisible(isVisible: boolean): void {
    this.points.visible = isVisible;
    this.stage.invalidate();
  }

  /** Throws ApiError. */
  async load(signal: AbortSignal): Promise<void> {
    const response = await this.api.request(`${sessionPath(this.sessionId)}/points`, { signal });
    const revision = response.headers.get('X-Romap-Revision') ?? '';
    if (revision !== '' && revision === this.revision) {
      await response.body?.cancel();
      return;
    }
    const buffer = await response.arrayBuffer();
    const count = Math.min(kMaxPoints, Math.floor(buffer.byteLength / 12));
    if (count === 0 && this.count > 0) return;  // the server forgets the points of a finished session
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(buffer, 0, count * 3), 3));
    this.points.geometry.dispose();
    this.points.geometry = geometry;
    this.revision = revision;
    this.stage.invalidate();
  }

  dispose(): void {
    this.points.geometry.dispose();
    this.points.material.dispose();
  }
}
