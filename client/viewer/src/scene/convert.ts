import { Matrix4, Quaternion, Vector3 } from 'three';
import type { Rigid, Vec3 } from '../api/types';

export const toVector3 = (v: Vec3): Vector3 => new Vector3(v.x, v.y, v.z);

export function toMatrix(t: Rigid, scale = 1): Matrix4 {
  const { x, y, z, w } = t.rotation;
  return new Matrix4().compose(toVector3(t.translation), new Quaternion(x, y, z, w), new Vector3(scale, scale, scale));
}
