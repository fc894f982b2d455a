// Geometry of the map without the 3D library: rays, cuboids, directions.
import type { Cuboid, Quat, Rigid, Vec3 } from '../api/types';

export const add = (a: Vec3, b: Vec3): Vec3 => ({ x: a.x + b.x, y: a.y + b.y, z: a.z + b.z });
export const sub = (a: Vec3, b: Vec3): Vec3 => ({ x: a.x - b.x, y: a.y - b.y, z: a.z - b.z });
export const scale = (a: Vec3, s: number): Vec3 => ({ x: a.x * s, y: a.y * s, z: a.z * s });
export const dot = (a: Vec3, b: Vec3): number => a.x * b.x + a.y * b.y + a.z * b.z;
export const norm = (a: Vec3): number => Math.hypot(a.x, a.y, a.z);

export function rotate(q: Quat, v: Vec3): Vec3 {
  const tx = 2 * (q.y * v.z - q.z * v.y);
  const ty = 2 * (q.z * v.x - q.x * v.z);
  const tz = 2 * (q.x * v.y - q.y * v.x);
  return {
    x: v.x + q.w * tx + q.y * tz - q.z * ty,
    y: v.y + q.w * ty + q.z * tx - q.x * tz,
    z: v.z + q.w * tz + q.x * ty - q.y * tx,
  };
}

export const conjugate = (q: Quat): Quat => ({ x: -q.x, y: -q.y, z: -q.z, w: q.w });
export const transform = (t: Rigid, p: Vec3): Vec3 => add(rotate(t.rotation, p), t.translation);
export const inverseTransform = (t: Rigid, p: Vec3): Vec3 => rotate(conjugate(t.rotation), sub(p, t.translation));

/** The corners in the world; corner n has the signs of the bits of n (x: 1, y: 2, z: 4). */
export function corners(cuboid: Cuboid): Vec3[] {
  const h = cuboid.halfExtents;
  return Array.from({ length: 8 }, (_, n) => transform(cuboid.tWorldObject, {
    x: n & 1 ? h.x : -h.x, y: n & 2 ? h.y : -h.y, z: n & 4 ? h.z : -h.z,
  }));
}

/** The edges as pairs of corner numbers. */
export const kEdges: readonly (readonly [number, number])[] =
  [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/** Distance along the ray (direction of unit length) to where it enters the cuboid, null if it misses (slab method). */
export function rayCuboid(origin: Vec3, direction: Vec3, cuboid: Cuboid): number | null {
  const o = inverseTransform(cuboid.tWorldObject, origin);
  const d = rotate(conjugate(cuboid.tWorldObject.rotation), direction);
  let near = -Infinity;
  let far = Infinity;
  for (const axis of ['x', 'y', 'z'] as const) {
    const h = cuboid.halfExtents[axis];
    if (Math.abs(d[axis]) < 1e-12) {
      if (Math.abs(o[axis]) > h) return null;
      continue;
    }
    const a = (-h - o[axis]) / d[axis];
    const b = (h - o[axis]) / d[axis];
    near = Math.max(near, Math.min(a, b));
    far = Math.min(far, Math.max(a, b));
  }
  if (near > far || far < 0) return null;
  return near >= 0 ? near : far;
}

/** In words, seen from the object: the world's axes name the sides, because north is not known. */
export function describeDirection(world: Vec3): string {
  const elevation = Math.round((Math.asin(Math.max(-1, Math.min(1, world.z))) * 180) / Math.PI);
  if (elevation > 65) return 'from above';
  if (elevation < -65) return 'from below';
  const height = Math.abs(elevation) < 10 ? 'at its height' : `${Math.abs(elevation)}° ${elevation > 0 ? 'above' : 'below'} it`;
  const sides = ['+x', '+x +y', '+y', '−x +y', '−x', '−x −y', '−y', '+x −y'];
  const side = sides[Math.round(((Math.atan2(world.y, world.x) / Math.PI) * 4 + 8)) % 8];
  return `from the ${side} side, ${height}`;
}

/** 1, 2 or 5 times a power of ten, near `value`. */
export function niceStep(value: number): number {
  if (!(value > 0) || !Number.isFinite(value)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  const mantissa = value / power;
  return power * (mantissa < 1.5 ? 1 : mantissa < 3.5 ? 2 : mantissa < 7.5 ? 5 : 10);
}
