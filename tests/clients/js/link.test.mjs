// The streams of the JavaScript client against a scripted server: broken connections, limits, and what servers may send.

import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Break, CAMERA, LIMIT_MS, ScriptedServer, ack, event, opened, smallImage, untilClosed} from './servers.mjs';

const {connect} = await import(new URL('src/index.mjs', `file://${process.env.ROMAP_JS_DIR}/`));
const retry = {initialDelayMs: 10, maxDelayMs: 50};
const STILL = {rotation: {x: 0, y: 0, z: 0, w: 1}, translation: {x: 0, y: 0, z: 0}};
const CUBOID = {tWorldObject: STILL, halfExtents: {x: 1, y: 1, z: 1}};

async function serve(t, ...scripts) {
  const scripted = await ScriptedServer.start(t, ...scripts);
  const server = await connect(scripted.address, {waitMs: LIMIT_MS});
  t.after(() => server.close());
  return {scripted, server};
}

async function open(t, server, options = {}) {
  const session = await server.session(CAMERA, {retry, ...options});
  t.after(() => session.close());
  return session;
}

const send = (session, index) => session.send({image: smallImage(index), timestampNs: index});
async function* acknowledgeAll(requests) {
  yield opened();
  yield* untilClosed(requests);
}

test('what is not stored is sent again, in order', async (t) => {
  const got = [];
  async function* first(requests) {
    yield opened({durable: true});
    for (const expected of [1, 2, 3]) {
      assert.equal(Number((await requests.next()).value.frame.frameId), expected);
      yield ack(expected);
    }
    yield event({durable: {frameId: 1}});
    throw new Break();
  }
  async function* second(requests) {
    yield opened({durable: true, newestFrameId: 3});
    for await (const {frame} of requests) {
      got.push([Number(frame.frameId), frame.resent]);
      yield ack(frame.frameId, {duplicate: Number(frame.frameId) <= 3});
      yield event({durable: {frameId: frame.frameId}});
    }
  }
  const {scripted, server} = await serve(t, first, second);
  const link = [];
  const session = await open(t, server, {onLink: (isUp, reason) => link.push([isUp, reason])});
  for (const index of [1, 2, 3]) await send(session, index);
  const acks = [];
  for (let i = 0; i < 3; ++i) acks.push(await session.next(LIMIT_MS));
  await send(session, 4);
  await session.flush(LIMIT_MS);
  assert.deepEqual(got.slice(0, 2), [[2, true], [3, true]]);
  assert.equal(got[2][0], 4);
  assert.deepEqual(scripted.starts.map((start) => start.resumeToken), ['', 'token']);
  assert.deepEqual(link, [[false, 'scripted break'], [true, '']]);
  for (let each = await session.next(0); each; each = await session.next(0)) acks.push(each);
  const frames = acks.filter((each) => each.type === 'frameAck').map((each) => each.frameId);
  assert.deepEqual(frames, [1, 2, 3, 4], 'each frame is acknowledged once');
});

test('objects that are gone after a break are removed', async (t) => {
  async function* first() {
    yield opened();
    yield event({object: {id: 7, revision: 3, state: 'OBJECT_STATE_CONFIRMED', cuboid: CUBOID}});
    throw new Break();
  }
  async function* second(requests) {
    yield opened({objectIds: [8]});
    yield* untilClosed(requests);
  }
  const {server} = await serve(t, first, second);
  const session = await open(t, server);
  assert.equal((await session.next(LIMIT_MS)).type, 'object');
  const removed = await session.next(LIMIT_MS);
  assert.deepEqual([removed.type, removed.id, removed.revision], ['removed', 7, 4]);
});

test('a mesh larger than the default limit of gRPC arrives', async (t) => {
  const texture = Buffer.alloc(9 << 20);
  async function* script(requests) {
    yield opened();
    yield event({mesh: {id: 1, revision: 1, texture}});
    yield* untilClosed(requests);
  }
  const {server} = await serve(t, script);
  const mesh = await (await open(t, server)).next(LIMIT_MS);
  assert.equal(mesh.texture.length, texture.length);
});

test('a message that is too large is refused at once', async (t) => {
  const {server} = await serve(t, acknowledgeAll);
  const session = await open(t, server);
  const image = Buffer.concat([Buffer.from([0xff, 0xd8, 0xff]), Buffer.alloc(33 << 20)]);
  await assert.rejects(session.send({image, timestampNs: 1}), /RESOURCE_EXHAUSTED: the message has .* 33554432/);
});

test('send waits for a busy server', async (t) => {
  let mayRead;
  const reading = new Promise((resolve) => (mayRead = resolve));
  async function* script(requests) {
    yield opened();
    await reading;
    yield* untilClosed(requests);
  }
  const {server} = await serve(t, script);
  const session = await open(t, server, {maxWaiting: 2, maxBytes: 40_000}); // four frames
  const sent = [];
  const sending = (async () => {
    for (let index = 1; index <= 20; ++index) sent.push(await send(session, index));
  })();
  await new Promise((resolve) => setTimeout(resolve, 300));
  assert.ok(sent.length <= 4, `${sent.length}`);
  mayRead();
  await sending;
  await session.flush(LIMIT_MS);
  assert.deepEqual(sent, Array.from({length: 20}, (_, i) => i + 1));
});

test('a live session drops the oldest frames instead', async (t) => {
  let mayRead;
  const reading = new Promise((resolve) => (mayRead = resolve));
  async function* script(requests) {
    yield opened();
    await reading;
    yield* untilClosed(requests);
  }
  const {scripted, server} = await serve(t, script);
  scripted.info.mode = 'FRAME_MODE_LIVE';
  const session = await open(t, server, {mode: 'live', maxWaiting: 2});
  const image = Buffer.concat([Buffer.from([0xff, 0xd8, 0xff]), Buffer.alloc(2 << 20)]); // more than flow control lets by
  for (let index = 1; index <= 20; ++index) await session.send({image, timestampNs: index});
  assert.ok(session.dropped > 10, `${session.dropped}`);
  mayRead();
  await session.flush(LIMIT_MS);
  const acks = [];
  for (let each = await session.next(0); each; each = await session.next(0)) acks.push(each);
  assert.deepEqual(acks.map((each) => each.frameId).sort((a, b) => a - b), Array.from({length: 20}, (_, i) => i + 1));
  assert.equal(acks.filter((each) => !each.accepted).length, session.dropped);
});

test('events are bounded while nobody reads them', async (t) => {
  async function* script(requests) {
    yield opened();
    for (let revision = 1; revision < 3000; ++revision) {
      yield event({object: {id: 1, revision, state: 'OBJECT_STATE_CONFIRMED', cuboid: CUBOID}});
    }
    yield* untilClosed(requests);
  }
  const {server} = await serve(t, script);
  const session = await open(t, server);
  await send(session, 1);
  await session.flush(LIMIT_MS);
  assert.equal((await session.next(LIMIT_MS)).revision, 2999);
  assert.equal((await session.next(LIMIT_MS)).type, 'frameAck');
});

test('callbacks get all events, and their errors end the session', async (t) => {
  const {server} = await serve(t, acknowledgeAll);
  const got = [];
  const onEvent = ({frameId}) => {
    got.push(frameId);
    if (frameId === 3) throw new Error('no such thing');
  };
  const session = await open(t, server, {onEvent});
  for (const index of [1, 2, 3]) await send(session, index);
  await assert.rejects(session.wait(LIMIT_MS), /INTERNAL: the callback .*no such thing/);
  assert.deepEqual(got, [1, 2, 3]);
  await assert.rejects(send(session, 4), /the callback of the session failed/);
});

test('a connection that the program closed', async (t) => {
  const {scripted, server} = await serve(t, acknowledgeAll);
  const session = await open(t, server);
  server.close();
  await assert.rejects(server.sessions(), /FAILED_PRECONDITION: this connection was closed by the program/);
  scripted.stop();
  await assert.rejects(session.wait(LIMIT_MS), /closed by the program/);
});

test('gives up after the time of retry', async (t) => {
  const {scripted, server} = await serve(t, acknowledgeAll);
  const session = await open(t, server, {retry: {...retry, maxDownMs: 300}});
  scripted.stop();
  await assert.rejects(session.wait(LIMIT_MS), /\(gave up after 0\.\d s\)/);
});

test('a session that another program finishes early', async (t) => {
  async function* script(requests) {
    yield opened();
    await requests.next(); // and ends the stream without an acknowledgement
  }
  const {server} = await serve(t, script);
  const session = await open(t, server);
  await send(session, 1);
  await assert.rejects(session.wait(LIMIT_MS), /FAILED_PRECONDITION: the session was finished before 1 inputs/);
});

test('frames must be in order', async (t) => {
  async function* script(requests) {
    yield opened({newestFrameId: 5});
    yield* untilClosed(requests);
  }
  const {server} = await serve(t, script);
  const session = await open(t, server);
  assert.equal(await session.send({image: smallImage(1), timestampNs: 10n}), 6);
  await assert.rejects(session.send({image: smallImage(2), timestampNs: 10}), /timestampNs: must increase; is 10 after 10/);
  const again = {image: smallImage(2), timestampNs: 11, frameId: 6};
  await assert.rejects(session.send(again), /frameId: must increase; is 6 after 6/);
});

test('a watch begins again after a break', async (t) => {
  const {scripted, server} = await serve(t);
  let streams = 0;
  scripted.watch = async function* () {
    ++streams;
    yield {opened: {sessionId: 'scripted'}};
    yield event({statistics: {keyframes: streams}});
    if (streams === 1) throw new Break();
  };
  const watch = await server.watch('scripted', {retry});
  const seen = [];
  for await (const each of watch) seen.push(each.keyframes);
  assert.equal(seen.at(-1), 2);
});
