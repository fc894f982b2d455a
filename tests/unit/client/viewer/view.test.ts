import assert from 'node:assert/strict';
import { test } from 'node:test';
import { chooseLevels, type LodCandidate } from 'viewer/scene/lod';
import { corners, describeDirection, niceStep, rayCuboid, transform, inverseTransform } from 'viewer/state/geometry';
import { PathStore } from 'viewer/state/path_store';
import { ack, at, identity } from './helpers';
import type { Cuboid, FrameAck } from 'viewer/api/types';

const object = (id: string, distanceMu: number): LodCandidate => ({
  id, distanceMu, triangleCount: 16000,
  levels: [{ triangleCount: 4000, errorMu: 0.001 }, { triangleCount: 1000, errorMu: 0.004 }, { triangleCount: 250, errorMu: 0.016 }],
});
const options = { pxPerMuAtUnitDistance: 1000, tolerancePx: 1, maxTriangles: 1e9 };

test('the coarsest level whose error is not visible is chosen', () => {
  const chosen = chooseLevels([object('near', 0.5), object('a', 1), object('b', 4), object('far', 100)], options);
  assert.deepEqual(Object.fromEntries(chosen), { near: -1, a: 0, b: 1, far: 2 });
});

test('a limit of triangles coarsens all objects, but keeps the order of distance', () => {
  const objects = Array.from({ length: 100 }, (_, n) => object(String(n), 0.3 + 0.05 * n));
  const chosen = chooseLevels(objects, { ...options, maxTriangles: 100_000 });
  const levels = objects.map((o) => chosen.get(o.id) ?? -1);
  const triangles = levels.reduce((sum, l) => sum + (l < 0 ? 16000 : objects[0]!.levels[l]!.triangleCount), 0);
  assert.ok(triangles <= 100_000, String(triangles));
  for (let n = 1; n < levels.length; ++n) assert.ok(levels[n]! >= levels[n - 1]!);
});

test('a mesh without levels is drawn as it is', () => {
  assert.equal(chooseLevels([{ id: 'x', distanceMu: 1e6, triangleCount: 1e6, levels: [] }], { ...options, maxTriangles: 10 }).get('x'), -1);
});

const turned = { x: 0, y: 0, z: Math.SQRT1_2, w: Math.SQRT1_2 };  // 90 degrees about z
const cuboid: Cuboid = { tWorldObject: { rotation: turned, translation: { x: 10, y: 0, z: 0 } }, halfExtents: { x: 3, y: 1, z: 2 }, confidence: 1 };

test('a ray enters a turned cuboid where its side is', () => {
  assert.ok(Math.abs(rayCuboid({ x: 0, y: 0, z: 0 }, { x: 1, y: 0, z: 0 }, cuboid)! - 9) < 1e-9);
  assert.ok(rayCuboid({ x: 0, y: 2.9, z: 0 }, { x: 1, y: 0, z: 0 }, cuboid) !== null);
  assert.equal(rayCuboid({ x: 0, y: 3.1, z: 0 }, { x: 1, y: 0, z: 0 }, cuboid), null);
  assert.equal(rayCuboid({ x: 0, y: 0, z: 0 }, { x: -1, y: 0, z: 0 }, cuboid), null);
});

test('from inside, the ray ends where it leaves', () => {
  assert.ok(Math.abs(rayCuboid({ x: 10, y: 0, z: 0 }, { x: 0, y: 1, z: 0 }, cuboid)! - 3) < 1e-9);
});

test('corners are where the pose puts them, and transforms invert', () => {
  const corner = corners(cuboid)[7]!;  // +x +y +z of the object
  for (const [value, expected] of [[corner.x, 9], [corner.y, 3], [corner.z, 2]]) assert.ok(Math.abs(value! - expected!) < 1e-9);
  const p = inverseTransform(cuboid.tWorldObject, transform(cuboid.tWorldObject, { x: 1, y: 2, z: 3 }));
  for (const [value, expected] of [[p.x, 1], [p.y, 2], [p.z, 3]]) assert.ok(Math.abs(value! - expected!) < 1e-9);
});

test('directions are described in words', () => {
  assert.equal(describeDirection({ x: 0, y: 0, z: 1 }), 'from above');
  assert.equal(describeDirection({ x: 0, y: -1, z: 0 }), 'from the −y side, at its height');
  assert.equal(describeDirection({ x: Math.SQRT1_2, y: 0, z: Math.SQRT1_2 }), 'from the +x side, 45° above it');
});

test('steps of the grid are round', () => {
  assert.deepEqual([0.013, 0.02, 0.9, 4, 70].map(niceStep).map((v) => Number(v.toPrecision(3))), [0.01, 0.02, 1, 5, 50]);
  assert.equal(niceStep(NaN), 1);
});

const ackOf = (e: ReturnType<typeof ack>): FrameAck => (e.kind === 'frameAck' ? e.ack : assert.fail());

test('the path has a gap where the camera was lost', () => {
  const path = new PathStore();
  path.addAck(ackOf(ack(1, null)));
  path.addAck(ackOf(ack(2, at(1, 0, 0))));
  path.addAck(ackOf(ack(3, null, { state: 'TRACKING_STATE_LOST' })));
  path.addAck(ackOf(ack(4, at(2, 0, 0), { state: 'TRACKING_STATE_RELOCALIZED' })));
  assert.deepEqual(path.poses.map((p) => p.isAfterGap), [false, true]);
});

test('the corrected trajectory replaces the path and keeps newer frames, also with ids beyond 2^53', () => {
  const path = new PathStore();
  for (const id of ['9007199254740993', '9007199254740995', '9007199254740997']) path.addAck(ackOf(ack(id, at(1, 1, 1))));
  path.replace(['9007199254740993', '9007199254740995'].map((frameId) => ({ frameId, pose: identity, state: 'TRACKING' as const, mapId: '1', isAfterGap: false })));
  assert.deepEqual(path.poses.map((p) => [p.frameId, p.pose.translation.x]), [['9007199254740993', 0], ['9007199254740995', 0], ['9007199254740997', 1]]);
});

test('a long path is thinned, and its newest part is kept', () => {
  const path = new PathStore();
  for (let n = 1; n <= 50000; ++n) path.addAck(ackOf(ack(n, at(n, 0, 0))));
  assert.ok(path.poses.length <= 20001, String(path.poses.length));
  assert.equal(path.newest()?.frameId, '50000');
  const ids = path.poses.map((p) => Number(p.frameId));
  assert.ok(ids.every((id, n) => n === 0 || id > ids[n - 1]!));
});
