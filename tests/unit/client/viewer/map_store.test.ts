import assert from 'node:assert/strict';
import { test } from 'node:test';
import { MapStore } from 'viewer/state/map_store';
import { ack, event, identity, mesh, object } from './helpers';

function storeWith(...events: ReturnType<typeof event>[]): MapStore {
  const store = new MapStore();
  store.open({ sessionId: 's', objectIds: [] });
  for (const e of events) store.apply(e);
  return store;
}

test('an object and its mesh appear', () => {
  const store = storeWith(object(3, 1), mesh(3, 2));
  assert.equal(store.objects.get('3')?.update.className, 'cup');
  assert.equal(store.objects.get('3')?.mesh?.revision, 2);
  assert.deepEqual([...store.takeChanges().objects], ['3']);
  assert.equal(store.takeChanges().objects.size, 0);
});

test('rule 5: a lower revision of a cuboid is ignored, an equal or higher one is taken', () => {
  const store = storeWith(object(3, 5, { className: 'book' }), object(3, 4, { className: 'old' }));
  assert.equal(store.objects.get('3')?.update.className, 'book');
  store.apply(object(3, 5, { className: 'same' }));
  assert.equal(store.objects.get('3')?.update.className, 'same');
  store.apply(object(3, 9, { className: 'new' }));
  assert.equal(store.objects.get('3')?.update.className, 'new');
});

test('rule 5: a lower revision of a mesh is ignored, and a mesh is compared with the mesh only', () => {
  const store = storeWith(object(3, 9), mesh(3, 7), mesh(3, 6, { steps: '1' }));
  assert.equal(store.objects.get('3')?.mesh?.revision, 7);
});

test('rule 6: a correction moves the mesh and does not replace it', () => {
  const store = storeWith(object(3, 1), mesh(3, 2), object(3, 3, { tWorldMesh: { ...identity, translation: { x: 5, y: 0, z: 0 } }, meshScale: 2 }));
  const entry = store.objects.get('3');
  assert.equal(entry?.mesh?.revision, 2);
  assert.equal(entry?.update.tWorldMesh?.translation.x, 5);
  assert.equal(entry?.update.meshScale, 2);
});

test('rule 9: a mesh without an object, and events after a removal, are ignored', () => {
  const store = storeWith(mesh(8, 1));
  assert.equal(store.objects.size, 0);
  store.apply(object(8, 1));
  store.apply(event({ removed: { id: '8', revision: '2', reason: 'gone' } }));
  store.apply(object(8, 3));
  store.apply(mesh(8, 4));
  assert.equal(store.objects.size, 0);
});

test('a merge removes one object and sets the revision of the other', () => {
  const store = storeWith(object(1, 1), object(2, 4), event({ merged: { from: '1', into: '2', revision: '9' } }));
  assert.deepEqual([...store.objects.keys()], ['2']);
  assert.equal(store.objects.get('2')?.update.revision, 9);
  store.apply(object(2, 8, { className: 'older than the merge' }));
  assert.equal(store.objects.get('2')?.update.className, 'cup');
});

test('rule 10: the map of the newest pose is shown; frames without a pose do not change it', () => {
  const store = storeWith(object(1, 1, { mapId: '1' }), object(2, 1, { mapId: '2' }));
  assert.equal(store.shownMapId(), '1');
  store.apply(ack(1, identity, { mapId: '2' }));
  assert.equal(store.shownMapId(), '2');
  store.apply(ack(2, null, { state: 'TRACKING_STATE_LOST' }));
  assert.equal(store.shownMapId(), '2');
  store.apply(ack(3, identity, { mapId: '1' }));
  assert.equal(store.shownMapId(), '1');
  assert.deepEqual(store.mapIds(), ['1', '2']);
});

test('rule 10: a change of the map marks all objects as changed', () => {
  const store = storeWith(object(1, 1, { mapId: '1' }), object(2, 1, { mapId: '2' }), ack(1, identity));
  store.takeChanges();
  store.apply(ack(2, identity, { mapId: '2' }));
  assert.deepEqual([...store.takeChanges().objects].sort(), ['1', '2']);
});

test('rule 10: merged maps send their objects again with another map', () => {
  const store = storeWith(object(1, 1, { mapId: '1' }), object(2, 1, { mapId: '2' }), object(2, 2, { mapId: '1' }));
  assert.deepEqual(store.mapIds(), ['1']);
});

test('rule 11: a new stream removes the objects that it does not list', () => {
  const store = storeWith(object(1, 1), object(2, 1));
  store.takeChanges();
  store.open({ sessionId: 's', objectIds: ['2', '3'] });
  assert.deepEqual([...store.objects.keys()], ['2']);
  assert.deepEqual([...store.takeChanges().objects], ['1']);
});

test('a server that was restored may begin with lower revisions', () => {
  const store = storeWith(object(1, 9), mesh(1, 9));
  store.open({ sessionId: 's', objectIds: ['1'] });
  store.apply(object(1, 4, { className: 'restored' }));
  store.apply(mesh(1, 3));
  assert.equal(store.objects.get('1')?.update.className, 'restored');
  assert.equal(store.objects.get('1')?.mesh?.revision, 3);
  store.apply(object(1, 2, { className: 'older' }));
  assert.equal(store.objects.get('1')?.update.className, 'restored');
});

test('the history of steps grows with the meshes', () => {
  const store = storeWith(object(1, 1), mesh(1, 2, { steps: '100' }), mesh(1, 3, { steps: '250', trainSeconds: 2 }), mesh(1, 4, { steps: '250' }));
  assert.deepEqual(store.objects.get('1')?.history.map((s) => s.steps), [100, 250]);
});

test('rejected and repeated frames are not the newest frame', () => {
  const store = storeWith(ack(1, identity), ack(2, null, { accepted: false, error: 'bad' }), ack(3, identity, { duplicate: true }));
  assert.equal(store.lastAck?.frameId, '1');
});

test('the statistics hold the present diagnostics, the worst first', () => {
  const note = (code: string, severity: string): object => ({ code, text: 't', severity });
  const store = storeWith(event({ diagnostic: note('over', 'SEVERITY_ERROR') }),
    event({ statistics: { diagnostics: [note('a', 'SEVERITY_INFO'), note('b', 'SEVERITY_ERROR'), note('c', 'SEVERITY_UNSPECIFIED')] } }));
  assert.deepEqual(store.diagnostics().map((d) => d.code), ['b', 'c', 'a']);
  store.apply(event({ diagnostic: note('new', 'SEVERITY_WARNING') }));
  assert.deepEqual(store.diagnostics().map((d) => d.code), ['b', 'c', 'new', 'a']);
});
