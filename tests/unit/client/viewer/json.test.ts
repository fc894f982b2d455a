import assert from 'node:assert/strict';
import { test } from 'node:test';
import * as json from 'viewer/api/json';
import { identity } from './helpers';

test('64-bit ids stay exact', () => {
  assert.equal(json.id('18446744073709551615'), '18446744073709551615');
  assert.equal(json.id(7), '7');
  assert.equal(json.id('-1'), '0');
  assert.equal(json.id({}), '0');
});

test('events of unknown kind, and objects of unknown state, are ignored', () => {
  assert.equal(json.mapEvent({ somethingNew: { id: '1' } }), null);
  assert.equal(json.mapEvent(null), null);
  assert.equal(json.mapEvent([1]), null);
  assert.equal(json.mapEvent({ object: { id: '1', state: 'OBJECT_STATE_NEW_IDEA' } }), null);
});

test('geometry that is not finite is left out', () => {
  for (const bad of ['NaN', 'Infinity', '', 'x', null]) {
    const parsed = json.mapEvent({
      object: { id: '1', state: 'OBJECT_STATE_CONFIRMED', cuboid: { tWorldObject: identity, halfExtents: { x: bad === null ? {} : bad, y: 1, z: 1 } } },
    });
    assert.equal(parsed?.kind === 'object' && parsed.object.cuboid, null, String(bad));
  }
});

test('a rotation is normalized, and one that is none is refused', () => {
  assert.deepEqual(json.rigid({ rotation: { x: 0, y: 0, z: 0, w: 1.0005 }, translation: {} })?.rotation.w, 1);
  assert.equal(json.rigid({ rotation: { x: 0, y: 0, z: 0, w: 0 }, translation: {} }), null);
});

test('a mesh has the sizes of its bytes from the sibling field', () => {
  const parsed = json.mapEvent({
    mesh: { id: '4', revision: '17', isFinal: true, triangleCount: 100, levels: [{ triangleCount: 25, errorMu: 0.01 }],
            nextView: { direction: { x: 0, y: 0, z: 2 }, gain: 0.4 } },
    bytes: { draco: 1000, texture: 500, levels: [300] },
  });
  assert.equal(parsed?.kind, 'mesh');
  if (parsed?.kind !== 'mesh') return;
  assert.deepEqual(parsed.mesh.levels, [{ bytes: 300, triangleCount: 25, errorMu: 0.01 }]);
  assert.equal(parsed.mesh.bytes, 1000);
  assert.equal(parsed.mesh.textureBytes, 500);
  assert.deepEqual(parsed.mesh.nextView?.direction, { x: 0, y: 0, z: 1 });
});

test('an absent mesh scale is 1', () => {
  const parsed = json.mapEvent({ object: { id: '1', state: 'OBJECT_STATE_LOST', meshScale: 0 } });
  assert.equal(parsed?.kind === 'object' && parsed.object.meshScale, 1);
});

test('sessions without an id are left out of the list', () => {
  const list = json.sessionList({ sessions: [{ id: 'a', state: 'SESSION_STATE_RESTORING', createdUnixNs: '1700000000000000000' }, { name: 'x' }, 5] });
  assert.equal(list.length, 1);
  assert.equal(list[0]?.state, 'RESTORING');
  assert.equal(list[0]?.createdUnixMs, 1700000000000);
});
