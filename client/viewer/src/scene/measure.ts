// The distance between two points that the person picked.
import { BufferAttribute, BufferGeometry, Group, LineBasicMaterial, LineSegments, Points, PointsMaterial, Vector3 } from 'three';
import type { Stage } from './stage';

export class MeasureTool {
  isActive = false;
  readonly points: Vector3[] = [];
  private readonly group = new Group();
  private readonly line = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ depthTest: false }));
  private readonly dots = new Points(new BufferGeometry(), new PointsMaterial({ size: 9, sizeAttenuation: false, depthTest: false }));

  constructor(private readonly stage: Stage) {
    this.group.renderOrder = 10;
    this.line.frustumCulled = false;
    this.dots.frustumCulled = false;
    this.group.add(this.line, this.dots);
    stage.scene.add(this.group);
  }

  setColor(color: string): void {
    this.line.material.color.set(color);
    this.dots.material.color.set(color);
  }

  setActive(isActive: boolean): void {
    this.isActive = isActive;
    if (!isActive) this.points.length = 0;
    this.draw();
  }

  /** A third point begins a new measurement. */
  addPoint(point: Vector3): void {
    if (this.points.length >= 2) this.points.length = 0;
    this.points.push(point.clone());
    this.draw();
  }

  /** Map units; null before there are two points. */
  distance(): number | null {
    const [a, b] = this.points;
    return a && b ? a.distanceTo(b) : null;
  }

  middle(): Vector3 | null {
    const [a, b] = this.points;
    return a && b ? a.clone().add(b).multiplyScalar(0.5) : null;
  }

  private draw(): void {
    const positions = new BufferAttribute(new Float32Array(this.points.flatMap((p) => [p.x, p.y, p.z])), 3);
    for (const object of [this.line, this.dots]) {
      object.geometry.dispose();
      object.geometry = new BufferGeometry();
      object.geometry.setAttribute('position', positions);
    }
    this.line.visible = this.points.length === 2;
    this.dots.visible = this.points.length > 0;
    this.stage.invalidate();
  }
}
