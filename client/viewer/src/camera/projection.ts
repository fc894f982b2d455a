// Cuboids in the picture of the camera.
import type { CameraModel, Cuboid, Rigid, Vec3 } from '../api/types';
import { corners, inverseTransform, kEdges } from '../state/geometry';

export type Segment = [number, number, number, number];  // x y x y, pixels of the camera model

/** The edges of the cuboid, cut off where they pass the camera. */
export function projectCuboid(cuboid: Cuboid, tWorldCamera: Rigid, camera: CameraModel): Segment[] {
  const points = corners(cuboid).map((p) => inverseTransform(tWorldCamera, p));
  const depth = Math.max(...points.map((p) => p.z));
  if (!(depth > 0)) return [];
  const near = depth * 1e-3;
  const segments: Segment[] = [];
  for (const [i, j] of kEdges) {
    let a = points[i]!;
    let b = points[j]!;
    if (a.z < near && b.z < near) continue;
    if (a.z < near) a = cut(a, b, near);
    if (b.z < near) b = cut(b, a, near);
    segments.push([...pixel(a, camera), ...pixel(b, camera)]);
  }
  return segments;
}

/** Where the center of its upper side is, null if it is behind the camera. */
export function projectTop(cuboid: Cuboid, tWorldCamera: Rigid, camera: CameraModel): [number, number] | null {
  const top = corners(cuboid).filter((_, n) => n & 4);
  const center = top.reduce((sum, p) => ({ x: sum.x + p.x / 4, y: sum.y + p.y / 4, z: sum.z + p.z / 4 }), { x: 0, y: 0, z: 0 });
  const p = inverseTransform(tWorldCamera, center);
  return p.z > 0 ? pixel(p, camera) : null;
}

function cut(behind: Vec3, front: Vec3, near: number): Vec3 {
  const t = (near - behind.z) / (front.z - behind.z);
  return { x: behind.x + t * (front.x - behind.x), y: behind.y + t * (front.y - behind.y), z: near };
}

function pixel(p: Vec3, camera: CameraModel): [number, number] {
  return [(camera.fxPx * p.x) / p.z + camera.cxPx, (camera.fyPx * p.y) / p.z + camera.cyPx];
}
