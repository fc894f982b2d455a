// The JavaScript client against romap-server: whole sessions, errors, TLS and tokens, and a server that is killed.

import assert from 'node:assert/strict';
import {execFile} from 'node:child_process';
import {copyFileSync, readFileSync, readdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {test} from 'node:test';
import {promisify} from 'node:util';
import * as servers from './servers.mjs';

const {CAMERA, LIMIT_MS, RomapServer, SEQUENCE, SOURCE_DIR, eventually, run, smallImage, temporaryFolder} = servers;
const {MapCopy, connect, worldMesh} = await import(
  new URL('src/index.mjs', `file://${process.env.ROMAP_JS_DIR}/`)
);
const PROGRAMS = join(process.env.ROMAP_JS_DIR, '../program');

const open = async (t, address, options) => {
  const server = await connect(address, options);
  t.after(() => server.close());
  return server;
};

/** The frames of a folder of `romap synth`, and its camera. */
function readSequence(folder) {
  const rows = (name) => readFileSync(join(folder, name), 'utf8').split('\n').filter((line) => line && line[0] !== '#');
  const values = Object.fromEntries(rows('camera.yaml').map((line) => line.split(':').map((part) => part.trim())));
  const camera = Object.fromEntries(['width', 'height', 'fx', 'fy', 'cx', 'cy'].map((key) => [key, Number(values[key])]));
  const masks = rows('mask.txt').map((line) => line.split(' '));
  const poses = rows('groundtruth.txt').map((line) => line.split(' ').map(Number));
  const frames = rows('rgb.txt').map((line, index) => {
    const [time, name] = line.split(' ');
    const [x, y, z, ...rotation] = poses[index].slice(1);
    return {
      image: readFileSync(join(folder, name)),
      timestampNs: BigInt(Math.round(Number(time) * 1e9)),
      masks: {png: readFileSync(join(folder, masks[index][1]))},
      pose: {translation: [x, y, z], rotation},
    };
  });
  return {camera, frames};
}

async function checkMap(map, frames) {
  assert.equal(map.state, 'finished');
  assert.deepEqual(map.trajectory.map((point) => point.frame.frameId), Array.from({length: frames}, (_, i) => i + 1));
  assert.equal(map.objects.length, 2);
  for (const each of map.objects) {
    assert.equal(each.object.state, 'confirmed');
    for (const half of each.object.cuboid.halfExtents) assert.ok(half > 0.01 && half < 0.5, `${half}`);
    assert.ok(each.mesh.isFinal);
    const mesh = await worldMesh(each);
    assert.equal(mesh.triangles.length, 3 * each.mesh.triangleCount);
    assert.ok(mesh.triangles.length > 150);
    assert.ok(Math.max(...mesh.triangles) < mesh.vertices.length / 3);
    assert.equal(mesh.colors.length, mesh.vertices.length);
    assert.ok(new Set(mesh.colors).size > 8);
    for (let i = 0; i < mesh.normals.length; i += 3) {
      assert.ok(Math.abs(Math.hypot(...mesh.normals.subarray(i, i + 3)) - 1) < 0.02);
    }
    // In the world, the mesh is about where the cuboid is.
    const count = mesh.vertices.length / 3;
    const mean = [0, 1, 2].map((axis) => mesh.vertices.filter((_, i) => i % 3 === axis).reduce((a, b) => a + b) / count);
    const {pose, halfExtents} = each.object.cuboid;
    const distance = Math.hypot(...mean.map((value, axis) => value - pose.translation[axis]));
    assert.ok(distance < Math.hypot(...halfExtents), `${distance}`);
  }
}

test('a sequence becomes a map', async (t) => {
  const sequence = readSequence(SEQUENCE);
  const server = await open(t, (await RomapServer.start(t, '--ephemeral')).address);
  const session = await server.session(sequence.camera, {name: 'desk'});
  t.after(() => session.close());
  const [watched, copy, acks] = [new MapCopy(), new MapCopy(), []];
  const watch = await server.watch(session.id, {onEvent: (event) => watched.apply(event)});
  const reading = (async () => {
    for await (const event of session) {
      copy.apply(event);
      if (event.type === 'frameAck') acks.push(event.frameId);
    }
  })();
  for (const frame of sequence.frames) await session.send(frame);
  await session.finish(LIMIT_MS);
  await reading;
  assert.ok(await watch.wait(LIMIT_MS));
  const info = await server.info(session.id);
  assert.deepEqual([info.name, info.state, info.camera.fx], ['desk', 'finished', sequence.camera.fx]);
  const map = await server.export(session.id);
  await checkMap(map, sequence.frames.length);
  assert.equal(map.trajectory[0].timestampNs, sequence.frames[0].timestampNs);
  assert.deepEqual(acks, sequence.frames.map((_, i) => i + 1));
  const revisions = (objects) =>
    [...objects]
      .filter(({object}) => object.state !== 'provisional')
      .map(({object, mesh}) => [object.id, object.revision, mesh?.revision])
      .sort(([a], [b]) => a - b);
  for (const each of [copy, watched]) assert.deepEqual(revisions(each.objects.values()), revisions(map.objects));
  await server.delete(session.id);
  assert.deepEqual(await server.sessions(), []);
});

test('a killed server loses nothing', async (t) => {
  const folder = temporaryFolder(t);
  const {camera, frames} = readSequence(SEQUENCE);
  const process = await RomapServer.start(t, '--data-dir', join(folder, 'data'));
  const server = await open(t, process.address);
  let breaks = 0;
  const onLink = (isUp, reason, attempt) => (breaks += attempt === 0 ? 1 : 0);
  const session = await server.session(camera, {onLink});
  t.after(() => session.close());
  for (const [index, frame] of frames.entries()) {
    if (index === 10 || index === 20) await process.restart();
    await session.send(frame);
  }
  await checkMap(await session.result(LIMIT_MS), frames.length);
  assert.ok(breaks >= 1);
  // The file holds the whole session, also on another server.
  await server.save(session.id, join(folder, 'desk.romap'));
  const copy = await server.load(join(folder, 'desk.romap'));
  assert.notEqual(copy.id, session.id);
  assert.equal((await server.pin(copy.id)).pinned, true);
  await eventually(async () => (await server.info(copy.id)).state === 'finished', 'the loaded session is finished');
  await checkMap(await server.export(copy.id), frames.length);
});

test('a session is continued by another program', async (t) => {
  const server = await open(t, (await RomapServer.start(t, '--ephemeral')).address);
  const session = await server.session(CAMERA);
  await session.send({image: smallImage(1), timestampNs: 1});
  await session.flush(LIMIT_MS);
  session.close();
  const continued = await eventually(() => server.open(session.id).catch(() => null), 'the stream is free');
  t.after(() => continued.close());
  assert.equal(Number(continued.opened.newestFrameId), 1);
  assert.equal(await continued.send({image: smallImage(2), timestampNs: 2}), 2);
  await continued.sendMasks(2, {labels: new Uint8Array(48 * 64)});
  await continued.flush(LIMIT_MS);
  const events = [];
  for (let each = await continued.next(0); each; each = await continued.next(0)) events.push(each);
  assert.ok(events.some((each) => each.type === 'masksAck' && each.frameId === 2 && each.accepted));
});

test('errors have a code and one line', async (t) => {
  const folder = temporaryFolder(t);
  const process = await RomapServer.start(t, '--ephemeral');
  const server = await open(t, process.address);
  const fails = (promise, code, pattern) =>
    assert.rejects(promise, (error) => {
      assert.equal(error.code, code, error.message);
      assert.match(error.message, pattern);
      assert.doesNotMatch(error.message, /\n/);
      return true;
    });
  for (const method of ['info', 'export', 'delete', 'finish', 'open', 'watch']) {
    await fails(server[method]('none'), 'NOT_FOUND', /session 'none' does not exist/);
  }
  await fails(server.save('none', join(folder, 'file')), 'NOT_FOUND', /'none'/);
  assert.deepEqual(readdirSync(folder), [], 'no partial file is left');
  await fails(server.session({...CAMERA, fx: 0}), 'INVALID_ARGUMENT', /fx/);
  await fails(server.session(CAMERA, {mode: 'fast'}), 'INVALID_ARGUMENT', /mode/);
  const session = await server.session(CAMERA);
  t.after(() => session.close());
  await fails(server.open(session.id), 'FAILED_PRECONDITION', /stream/);
  assert.throws(() => session.send({image: smallImage(0), timestampNs: 1, masks: {labels: [1]}}), /has 1 values/);
  await session.send({image: smallImage(1), timestampNs: 1});
  // What only the server can see is reported by the acknowledgement, and the session goes on.
  await session.send({image: smallImage(2), timestampNs: 2, masks: {png: Buffer.from('not a PNG file')}});
  await session.send({image: Buffer.from([0xff, 0xd8, 0xff, 1, 2]), timestampNs: 3});
  await session.send({image: smallImage(4), timestampNs: 4});
  await session.flush(LIMIT_MS);
  const acks = new Map();
  for (let each = await session.next(0); each; each = await session.next(0)) {
    if (each.type === 'frameAck') acks.set(each.frameId, each);
  }
  assert.deepEqual([1, 2, 3, 4].map((id) => acks.get(id).accepted), [true, false, false, true]);
  assert.match(acks.get(2).error, /mask/);
  await session.finish(LIMIT_MS);
  await session.wait(LIMIT_MS);
  const late = session.send({image: smallImage(9), timestampNs: 9});
  await fails(late, 'FAILED_PRECONDITION', /is finished and accepts no more inputs/);
  await process.kill();
  await fails(connect(process.address), 'UNAVAILABLE', /cannot connect to romap-server at/);
});

test('connect waits for a server', async (t) => {
  const process = await RomapServer.start(t, '--ephemeral');
  await process.kill();
  const restarted = new Promise((resolve) => setTimeout(resolve, 300)).then(() => process.restart());
  const server = await open(t, process.address, {waitMs: LIMIT_MS});
  assert.deepEqual(await server.sessions(), []);
  await restarted;
});

test('TLS and tokens', async (t) => {
  const folder = temporaryFolder(t);
  const path = (name) => join(folder, name);
  const request = ['openssl', 'req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes'];
  run(...request, '-keyout', path('ca.key'), '-out', path('ca.pem'), '-subj', '/CN=test authority');
  const extensions = ['-addext', 'subjectAltName=IP:127.0.0.1', '-addext', 'basicConstraints=critical,CA:FALSE'];
  const signed = ['-subj', '/CN=romap-server', '-CA', path('ca.pem'), '-CAkey', path('ca.key'), ...extensions];
  run(...request, '-keyout', path('key.pem'), '-out', path('server.pem'), ...signed);
  const token = (role) =>
    run(servers.SERVER, 'token', 'create', '--tenant', 'lab', '--role', role, '--data-dir', path('data')).trim();
  const [owner, viewer] = [token('owner'), token('viewer')];
  const files = ['--tls-cert', path('server.pem'), '--tls-key', path('key.pem')];
  const {address} = await RomapServer.start(t, '--data-dir', path('data'), ...files);
  const tls = {ca: path('ca.pem')};
  const server = await open(t, address, {token: owner, tls});
  const session = await server.session(CAMERA);
  t.after(() => session.close());
  const pose = {rotation: [0, 0, 0, 1], translation: [0, 0, 0]};
  await session.send({image: smallImage(1), timestampNs: 1, pose});
  assert.equal((await session.result(LIMIT_MS)).state, 'finished');
  writeFileSync(path('viewer.token'), `${viewer}\n`);
  const watching = await open(t, address, {tokenFile: path('viewer.token'), tls});
  assert.equal((await watching.export(session.id)).trajectory.length, 1);
  await assert.rejects(watching.delete(session.id), /PERMISSION_DENIED: .*the role owner/);
  await assert.rejects(watching.session(CAMERA), /PERMISSION_DENIED: .*the role owner/);
  await assert.rejects(connect(address, {tls}), /UNAUTHENTICATED: this server needs a token/);
  await assert.rejects(connect(address, {token: `${owner}x`, tls}), /UNAUTHENTICATED: the token is not valid/);
  for (const wrong of [undefined, {}, {...tls, serverName: 'another.name'}]) {
    await assert.rejects(connect(address, {token: owner, tls: wrong}), /UNAVAILABLE: cannot connect/);
  }
  writeFileSync(path('viewer.token'), 'two words');
  await assert.rejects(connect(address, {tokenFile: path('viewer.token'), tls}), /must have one token/);
});

test('the program of the README and the example', async (t) => {
  const page = readFileSync(join(SOURCE_DIR, 'client/js/README.md'), 'utf8');
  const [, program] = /```js\n([\s\S]*?)```/.exec(page);
  assert.ok(program.split('\n').length <= 24);
  writeFileSync(join(PROGRAMS, 'program.mjs'), program);
  copyFileSync(join(SOURCE_DIR, 'client/js/examples/stream_folder.mjs'), join(PROGRAMS, 'stream_folder.mjs'));
  const {address} = await RomapServer.start(t, '--ephemeral');
  const node = async (...command) =>
    (await promisify(execFile)(process.execPath, command, {cwd: PROGRAMS, timeout: LIMIT_MS})).stdout.trim().split('\n');
  assert.equal((await node('program.mjs', address, SEQUENCE)).length, 2);
  const printed = await node('stream_folder.mjs', SEQUENCE, '--server', address);
  assert.match(printed[0], /^1 \w+: [\d.]+ x [\d.]+ x [\d.]+, mesh with \d+ triangles$/);
});
