// The camera of the session: its path, and its frustum with the newest image.
import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, Group, LineBasicMaterial, LinearFilter, LineSegments, Mesh,
  MeshBasicMaterial, SRGBColorSpace, Texture,
} from 'three';
import type { CameraModel } from '../api/types';
import type { PathPose } from '../state/path_store';
import type { SceneColors } from './colors';
import { toMatrix } from './convert';
import type { Stage } from './stage';

const kDefaultCamera: CameraModel = { widthPx: 640, heightPx: 480, fxPx: 550, fyPx: 550, cxPx: 320, cyPx: 240 };

export class CameraLayer {
  readonly group = new Group();
  private readonly path = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
  private readonly frustum = new Group();
  private readonly frustumLines: LineSegments<BufferGeometry, LineBasicMaterial>;
  private readonly image: Mesh<BufferGeometry, MeshBasicMaterial>;
  private texture: Texture | null = null;
  private depth = 0.2;

  constructor(private readonly stage: Stage, private readonly camera: CameraModel = kDefaultCamera) {
    this.path.frustumCulled = false;
    this.frustum.matrixAutoUpdate = false;
    this.frustum.visible = false;
    this.frustumLines = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
    this.image = new Mesh(new BufferGeometry(), new MeshBasicMaterial({ side: DoubleSide, toneMapped: false }));
    this.image.visible = false;
    this.frustum.add(this.frustumLines, this.image);
    this.group.add(this.path, this.frustum);
    stage.scene.add(this.group);
    this.setDepth(0.2);
  }

  /** `poses`: of the shown map only. */
  setPath(poses: readonly PathPose[], colors: SceneColors): void {
    const count = Math.max(0, poses.length - 1);
    const positions = new Float32Array(count * 6);
    const rgb = new Float32Array(count * 6);
    const color = new Color();
    for (let n = 1; n < poses.length; ++n) {
      const from = poses[n - 1]!;
      const to = poses[n]!;
      const a = from.pose.translation;
      const b = to.pose.translation;
      positions.set([a.x, a.y, a.z, b.x, b.y, b.z], (n - 1) * 6);
      color.set(to.isAfterGap ? colors.pathGap : to.state === 'RELOCALIZED' ? colors.relocalized : colors.path);
      rgb.set([color.r, color.g, color.b, color.r, color.g, color.b], (n - 1) * 6);
    }
    this.path.geometry.dispose();
    this.path.geometry = new BufferGeometry();
    this.path.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.path.geometry.setAttribute('color', new BufferAttribute(rgb, 3));
    this.stage.invalidate();
  }

  setPose(pose: PathPose | null, isTracked: boolean, colors: SceneColors): void {
    this.frustum.visible = pose !== null;
    if (pose) {
      this.frustum.matrix.copy(toMatrix(pose.pose));
      this.frustum.matrixWorldNeedsUpdate = true;
    }
    this.frustumLines.material.color.set(isTracked ? colors.frustum : colors.pathGap);
    this.stage.invalidate();
  }

  /** Distance of the image plane from the camera center, map units. */
  setDepth(depth: number): void {
    if (this.frustumLines.geometry.hasAttribute('position') && Math.abs(Math.log(depth / this.depth)) < 0.05) return;
    this.depth = depth;
    const c = this.camera;
    const corner = (u: number, v: number): number[] =>
      [((u - c.cxPx) / c.fxPx) * depth, ((v - c.cyPx) / c.fyPx) * depth, depth];
    const [a, b, d, e] = [corner(-0.5, -0.5), corner(c.widthPx - 0.5, -0.5),
                          corner(c.widthPx - 0.5, c.heightPx - 0.5), corner(-0.5, c.heightPx - 0.5)];
    const o = [0, 0, 0];
    this.frustumLines.geometry.dispose();
    this.frustumLines.geometry = new BufferGeometry();
    this.frustumLines.geometry.setAttribute('position', new BufferAttribute(new Float32Array(
      [o, a, o, b, o, d, o, e, a, b, b, d, d, e, e, a].flat() as number[]), 3));
    this.image.geometry.dispose();
    this.image.geometry = new BufferGeometry();
    this.image.geometry.setAttribute('position',
      new BufferAttribute(new Float32Array([a, b, d, e].flat() as number[]), 3));
    this.image.geometry.setAttribute('uv', new BufferAttribute(new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]), 2));
    this.image.geometry.setIndex([0, 2, 1, 0, 3, 2]);
    this.stage.invalidate();
  }

  /** Takes over the bitmap. */
  setImage(bitmap: ImageBitmap): void {
    const old = this.texture;
    const texture = new Texture(bitmap);
    texture.flipY = false;
    texture.colorSpace = SRGBColorSpace;
    texture.generateMipmaps = false;
    texture.minFilter = LinearFilter;
    texture.needsUpdate = true;
    this.texture = texture;
    this.image.material.map = texture;
    this.image.material.needsUpdate = old === null;
    this.image.visible = true;
    (old?.image as ImageBitmap | undefined)?.close();
    old?.dispose();
    this.stage.invalidate();
  }

  setImageVisible(isVisible: boolean): void {
    this.image.visible = isVisible && this.texture !== null;
    this.stage.invalidate();
  }

  dispose(): void {
    this.texture?.dispose();
    this.path.geometry.dispose();
    this.frustumLines.geometry.dispose();
    this.image.geometry.dispose();
  }
}
