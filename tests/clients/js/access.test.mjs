// Errors, tokens and TLS of the JavaScript client with romap-server.

import assert from 'node:assert/strict';
import {readdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {test} from 'node:test';
import {CAMERA, LIMIT_MS, RomapServer, SERVER, run, smallImage, temporaryFolder} from './servers.mjs';

const {connect} = await import(new URL('src/index.mjs', `file://${process.env.ROMAP_JS_DIR}/`));

const open = async (t, address, options) => {
  const server = await connect(address, options);
  t.after(() => server.close());
  return server;
};

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
    run(SERVER, 'token', 'create', '--tenant', 'lab', '--role', role, '--data-dir', path('data')).trim();
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
