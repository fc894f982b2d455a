// Poses, and their form on the wire.

import {invalid} from './errors.mjs';

/**
 * p_to = rotation * p_from + translation. The rotation is a unit quaternion x, y, z, w (Hamilton).
 * @typedef {object} Pose
 * @property {[number, number, number, number]} rotation
 * @property {[number, number, number]} translation
 */

/**
 * The vector, rotated by a quaternion x, y, z, w.
 * @param {ArrayLike<number>} rotation
 * @param {ArrayLike<number>} vector
 * @returns {[number, number, number]}
 */
export function rotate(rotation, vector) {
  const [x, y, z, w] = /** @type {number[]} */ (rotation);
  const [a, b, c] = /** @type {number[]} */ (vector);
  const tx = 2 * (y * c - z * b);
  const ty = 2 * (z * a - x * c);
  const tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

/**
 * The point in the other frame.
 * @param {Pose} pose
 * @param {ArrayLike<number>} point
 * @returns {[number, number, number]}
 */
export function transform(pose, point) {
  const [x, y, z] = rotate(pose.rotation, point);
  const [tx, ty, tz] = pose.translation;
  return [x + tx, y + ty, z + tz];
}

/**
 * The 4x4 matrix of a pose with its columns one after the other, as in WebGL and three.js.
 * @param {Pose} pose
 * @param {number} [scale] of the points, before they are rotated
 */
export function poseMatrix(pose, scale = 1) {
  const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(pose.rotation, axis));
  const rows = columns.flatMap((column) => [...column.map((value) => scale * value), 0]);
  return new Float64Array([...rows, ...pose.translation, 1]);
}

/**
 * @param {ArrayLike<number>} vector
 * @param {string} name
 */
export function vectorToProto(vector, name) {
  const numbers = Array.from(vector ?? []);
  if (numbers.length !== 3 || !numbers.every(Number.isFinite)) throw invalid(`${name}: must be 3 finite numbers`);
  return {x: numbers[0], y: numbers[1], z: numbers[2]};
}

/**
 * @param {Pose} pose
 * @param {string} name
 */
export function transformToProto(pose, name) {
  const [x, y, z, w, ...more] = Array.from(pose.rotation ?? []);
  const norm = Math.hypot(x, y, z, w);
  if (more.length > 0 || !(Math.abs(norm - 1) < 1e-3)) {
    throw invalid(`${name}.rotation: must be a unit quaternion x, y, z, w`);
  }
  return {rotation: {x, y, z, w}, translation: vectorToProto(pose.translation, `${name}.translation`)};
}

/**
 * @param {any} proto
 * @returns {[number, number, number]}
 */
export const vectorFromProto = (proto) => [proto.x, proto.y, proto.z];

/**
 * @param {any} proto
 * @returns {[number, number, number, number]}
 */
export const quaternionFromProto = (proto) => [proto.x, proto.y, proto.z, proto.w];

/**
 * @param {any} proto RigidTransform, or null
 * @returns {Pose | null}
 */
export function poseFromProto(proto) {
  if (!proto?.rotation || !proto.translation) return null;
  return {rotation: quaternionFromProto(proto.rotation), translation: vectorFromProto(proto.translation)};
}
