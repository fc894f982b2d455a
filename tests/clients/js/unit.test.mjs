// The parts of the JavaScript client that need no server.

import assert from 'node:assert/strict';
import {test} from 'node:test';

const at = (name) => new URL(`src/${name}.mjs`, `file://${process.env.ROMAP_JS_DIR}/`);
const {labelRuns, labelsFromRuns, imageToProto, masksToProto, depthToProto} = await import(at('frame'));
const {poseMatrix, rotate, transform, transformToProto} = await import(at('geometry'));
const {EventBuffer, MAX_ACKS} = await import(at('event_buffer'));
const {eventFromProto} = await import(at('events'));
const {UnsettledInputs} = await import(at('unsettled'));
const {MapCopy, connect, decodeMesh} = await import(at('index'));
const {staysOnThisMachine} = await import(at('rpc'));

const CAMERA = {width: 64, height: 48, fx: 60, fy: 60, cx: 31.5, cy: 23.5};
const PIXELS = 64 * 48;
const invalid = (pattern) => (error) => {
  assert.equal(error.code, 'INVALID_ARGUMENT');
  assert.match(error.message, pattern);
  assert.doesNotMatch(error.message, /\n/);
  return true;
};

test('label runs: round trip', () => {
  for (const Type of [Uint8Array, Uint16Array, Int32Array, Array]) {
    for (const size of [1, 7, 3072]) {
      const labels = Type.from({length: size}, (_, i) => (i < size / 2 ? 5 : Math.floor(Math.random() * 3)));
      assert.deepEqual([...labelsFromRuns(labelRuns(labels), size)], [...labels]);
    }
  }
  assert.deepEqual(labelRuns([0, 0, 3, 3, 3, 65535]), [0, 2, 3, 3, 65535, 1]);
  assert.throws(() => labelRuns([0, -1]), invalid(/pixel 1 has -1/));
  assert.throws(() => labelRuns([0.5]), invalid(/has 0.5/));
  assert.throws(() => labelsFromRuns([1, 5], 6), invalid(/have 5 pixels; must be 6/));
});

test('images, masks and depth', () => {
  const raw = imageToProto({data: new Uint8Array(3 * PIXELS), format: 'rgb8'}, CAMERA);
  assert.deepEqual([raw.encoding, raw.widthPx, raw.heightPx], ['IMAGE_ENCODING_RAW_RGB8', 64, 48]);
  assert.equal(imageToProto(new Uint8Array([0xff, 0xd8, 0xff]), CAMERA).encoding, 'IMAGE_ENCODING_JPEG');
  assert.throws(() => imageToProto(new Uint8Array(9), CAMERA), invalid(/neither a JPEG nor a PNG/));
  assert.throws(() => imageToProto({data: new Uint8Array(9), format: 'rgb8'}, CAMERA), invalid(/has 9 values; .* 9216/));
  assert.throws(() => imageToProto({data: new Uint8Array(9), format: 'rgba'}, CAMERA), invalid(/rgb8, bgr8, gray8; is rgba/));
  const masks = masksToProto({labels: new Uint8Array(PIXELS).fill(2), instances: [{label: 2, score: 0}]}, CAMERA);
  assert.deepEqual(masks, {labelRuns: {labelLengthPairs: [2, PIXELS]}, instances: [{label: 2, className: 'object', score: 0}]});
  assert.throws(() => masksToProto({labels: [1]}, CAMERA), invalid(/masks: has 1 values; the camera needs 64x48 = 3072/));
  assert.throws(() => masksToProto({}, CAMERA), invalid(/must have labels or png/));
  const meters = new Float32Array(PIXELS).fill(1.5);
  meters.set([NaN, -1, 70, Infinity]);
  const depth = depthToProto({data: meters}, CAMERA).data;
  assert.deepEqual([...new Uint16Array(depth.buffer, depth.byteOffset, 5)], [0, 0, 0, 0, 1500]);
});

test('poses', () => {
  const half = Math.SQRT1_2;
  const pose = {rotation: [0, 0, half, half], translation: [10, 20, 30]};
  const close = (actual, expected) => expected.forEach((value, i) => assert.ok(Math.abs(actual[i] - value) < 1e-12));
  close(rotate(pose.rotation, [1, 0, 0]), [0, 1, 0]);
  close(transform(pose, [1, 2, 3]), [8, 21, 33]);
  const m = poseMatrix(pose, 2); // columns
  close([m[0] + 2 * m[4] + 3 * m[8] + m[12], m[1] + 2 * m[5] + 3 * m[9] + m[13], m[15]], [6, 22, 1]);
  assert.throws(() => transformToProto({rotation: [1, 1, 0, 0], translation: [0, 0, 0]}, 'pose'), invalid(/unit quaternion/));
  assert.throws(() => transformToProto({rotation: [0, 0, 0, 1], translation: [0, NaN, 0]}, 'pose'), invalid(/3 finite/));
});

const frameAck = (frameId, fields = {}) => ({type: 'frameAck', frameId, accepted: true, duplicate: false, ...fields});
function inputs(durable, ...frameIds) {
  const made = new UnsettledInputs();
  made.beginStream(durable);
  for (const frameId of frameIds) made.add({frameId: String(frameId)}, false, 10);
  return made;
}
function takeAll(from) {
  const taken = [];
  for (let request = from.takeNext(); request; request = from.takeNext()) {
    const part = request.frame ?? request.lateMasks;
    taken.push([Number(part.frameId), part.resent]);
  }
  return taken;
}

test('inputs are kept until the server has them for good', () => {
  const plain = inputs(false, 1, 2);
  assert.deepEqual(takeAll(plain), [[1, false], [2, false]]);
  assert.equal(plain.acknowledge(frameAck(1)).length, 1);
  assert.deepEqual([plain.size, plain.unacknowledged, plain.bytes], [1, 1, 10]);

  const stored = inputs(true, 1, 2);
  takeAll(stored);
  stored.acknowledge(frameAck(1));
  stored.acknowledge(frameAck(2));
  assert.deepEqual([stored.size, stored.unacknowledged], [2, 0]);
  stored.cover({frameId: 1, masksFrameId: 0});
  stored.beginStream(true);
  assert.deepEqual(takeAll(stored), [[2, true]]);
  assert.deepEqual(stored.acknowledge(frameAck(2)), []);
  stored.cover({frameId: 2, masksFrameId: 0});
  assert.deepEqual([stored.size, stored.bytes], [0, 0]);
});

test('inputs: lost acknowledgements, rejections, late masks and dropped frames', () => {
  const lost = inputs(false, 1, 2, 3);
  takeAll(lost);
  lost.beginStream(false);
  takeAll(lost);
  const acks = lost.acknowledge(frameAck(3)).map((each) => [each.frameId, each.accepted, each.duplicate]);
  assert.deepEqual(acks, [[1, true, true], [2, true, true], [3, true, false]]);

  const rejected = inputs(true, 1);
  takeAll(rejected);
  assert.equal(rejected.acknowledge(frameAck(1, {accepted: false})).length, 1);
  assert.equal(rejected.size, 0);

  const late = inputs(true, 1);
  late.add({frameId: '1'}, true, 5);
  takeAll(late);
  late.acknowledge(frameAck(1));
  late.acknowledge({type: 'masksAck', frameId: 1, accepted: true});
  late.cover({frameId: 1, masksFrameId: 0});
  assert.equal(late.size, 1);
  late.cover({frameId: 1, masksFrameId: 1});
  assert.equal(late.size, 0);

  const dropped = inputs(false, 1, 2, 3);
  dropped.takeNext();
  assert.equal(dropped.waiting, 2);
  assert.deepEqual([1, 2, 3].map(() => dropped.dropOldestUnsentFrame()), [2, 3, null]);
});

test('a copy of buffered events equals one of all events', () => {
  const [whole, copy, buffer, alive] = [new MapCopy(), new MapCopy(), new EventBuffer(), []];
  const state = (map) =>
    [...map.objects].sort(([a], [b]) => a - b).map(([id, {object, mesh}]) => [id, object.revision, mesh?.revision]);
  let longest = 0;
  for (let revision = 1; revision < 500; ++revision) {
    const kind = Math.floor(Math.random() * 10);
    const id = alive[Math.floor(Math.random() * alive.length)];
    let event = {type: 'mesh', id, revision};
    if (alive.length === 0 || kind === 0) {
      event = {type: 'object', id: revision, revision: 1};
      alive.push(revision);
    } else if (kind < 5) {
      event = {type: 'object', id, revision};
    } else if (kind > 7) {
      alive.splice(alive.indexOf(id), 1);
      event = {type: 'removed', id, revision, reason: ''};
      if (kind === 9 && alive.length > 0) event = {type: 'merged', from: id, into: alive[0], revision};
    }
    whole.apply(event);
    buffer.add(event);
    longest = Math.max(longest, buffer.size);
    if (Math.random() > 0.02 && revision < 499) continue;
    for (let next = buffer.pop(); next; next = buffer.pop()) copy.apply(next);
    assert.deepEqual(state(copy), state(whole));
  }
  assert.ok(longest < 200);
});

test('the newest acknowledgements are kept', () => {
  const buffer = new EventBuffer();
  for (let frameId = 1; frameId <= MAX_ACKS + 10; ++frameId) buffer.add(frameAck(frameId));
  assert.equal(buffer.size, MAX_ACKS);
  assert.equal(buffer.pop().frameId, 11);
});

test('unknown kinds and values of events are ignored', () => {
  assert.equal(eventFromProto({event: 'brandNew', brandNew: {}}), null);
  assert.equal(eventFromProto({}), null);
  assert.equal(eventFromProto({event: 'frameAck', frameAck: {frameId: '1', state: 77}}), null);
});

test('the token is not sent in clear text', async () => {
  for (const address of ['127.0.0.1:1', '127.9.9.9:1', 'localhost:1', '[::1]:1', 'unix:/tmp/romap']) {
    assert.ok(staysOnThisMachine(address), address);
  }
  for (const address of ['127.0.0.1.evil.org:1', '10.0.0.1:1', '0.0.0.0:1', 'example:1']) {
    assert.ok(!staysOnThisMachine(address), address);
    await assert.rejects(connect(address, {token: 'secret'}), invalid(/in clear text/));
  }
});

test('bad addresses, files and meshes', async () => {
  for (const address of ['localhost', ':1', 'host:x', 'host:70000']) {
    await assert.rejects(connect(address), invalid(/must be HOST:PORT/));
  }
  await assert.rejects(connect('localhost:1', {tls: {ca: '/none.pem'}}), /NOT_FOUND: cannot read \/none.pem/);
  await assert.rejects(connect('localhost:1', {tls: {key: '/none.pem'}}), invalid(/both the certificate and its key/));
  await assert.rejects(connect('localhost:1', {token: 'two words'}), invalid(/the token is not one that/));
  await assert.rejects(connect('127.0.0.1:1'), /UNAVAILABLE: cannot connect to romap-server at 127.0.0.1:1/);
  for (const data of ['', 'DRACO', 'DRACO\x02\x02\x01\x01\0\0\0aaaaaaaaaaaaaaaaaaaa']) {
    await assert.rejects(decodeMesh(Buffer.from(data, 'latin1')), invalid(/Draco/));
  }
});
