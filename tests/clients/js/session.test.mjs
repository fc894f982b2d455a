// Whole sessions of the JavaScript client with romap-server, also one that is killed.

import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {join} from 'node:path';
import {test} from 'node:test';
import {CAMERA, LIMIT_MS, RomapServer, SEQUENCE, eventually, smallImage, temporaryFolder} from './servers.mjs';

const {MapCopy, connect, worldMesh} = await import(new URL('src/index.mjs', `file://${process.env.ROMAP_JS_DIR}/`));

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
