// What the tests of the JavaScript client share: romap-server, a server that the test scripts, and sequences.

import {execFileSync, spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {createInterface} from 'node:readline';
import {createRequire} from 'node:module';

// The packages of the client, which are installed beside it.
const packages = createRequire(join(process.env.ROMAP_JS_DIR, 'package.json'));
const grpc = packages('@grpc/grpc-js');
const protoLoader = packages('@grpc/proto-loader');

export const SOURCE_DIR = process.env.ROMAP_SOURCE_DIR;
export const SERVER = process.env.ROMAP_SERVER;
export const SEQUENCE = process.env.ROMAP_SEQUENCE; // of `romap synth`, with two objects
export const LIMIT_MS = 200_000;
const SETTINGS = [
  'nerf.first_budget_steps=40',
  'nerf.full_budget_steps=40',
  'nerf.refine_steps_per_view=1',
  'mesh.resolution=32',
  'mesh.min_side_nodes=32',
];

/** A romap-server that trains little. restart() uses the same port and data folder. */
export class RomapServer {
  address = '127.0.0.1:0';

  /** @param {import('node:test').TestContext} test stops it at its end */
  static async start(test, ...options) {
    const server = new RomapServer();
    server.options = options;
    await server.#start();
    test.after(() => server.#end('SIGTERM'));
    return server;
  }

  async #start() {
    const settings = SETTINGS.flatMap((setting) => ['--set', setting]);
    this.process = spawn(SERVER, ['--listen', this.address, ...this.options, ...settings]);
    let log = '';
    this.process.stderr.on('data', (text) => (log += text));
    const marker = 'romap-server listening on ';
    for await (const line of createInterface({input: this.process.stdout})) {
      if (!line.startsWith(marker)) continue;
      this.address = line.slice(marker.length).trim();
      return;
    }
    throw new Error(`romap-server did not start: ${log}`);
  }

  async #end(signal) {
    if (this.process.exitCode !== null || this.process.signalCode !== null) return;
    const ended = once(this.process, 'exit');
    this.process.kill(signal);
    await ended;
  }

  async kill() {
    await this.#end('SIGKILL');
  }

  async restart() {
    await this.kill();
    await this.#start();
  }
}

export function run(...command) {
  return execFileSync(command[0], command.slice(1), {encoding: 'utf8', timeout: LIMIT_MS, stdio: 'pipe'});
}

/** A folder that is removed at the end of the test. */
export function temporaryFolder(test) {
  const folder = mkdtempSync(join(tmpdir(), 'romap_js_'));
  test.after(() => rmSync(folder, {recursive: true, force: true}));
  return folder;
}

export async function eventually(condition, what) {
  const end = Date.now() + LIMIT_MS;
  while (Date.now() < end) {
    const value = await condition();
    if (value) return value;
    await new Promise((resolve) => setTimeout(resolve, 10));
  }
  throw new Error(`not within ${LIMIT_MS} ms: ${what}`);
}

export const CAMERA = {width: 64, height: 48, fx: 60, fy: 60, cx: 31.5, cy: 23.5};

/** 48 x 64 RGB, different for every index. */
export function smallImage(index) {
  const data = new Uint8Array(48 * 64 * 3).map((_, i) => (i * (index + 7) * 31) >> 3);
  return {data, format: 'rgb8'};
}

export const opened = (fields = {}) => ({opened: {sessionId: 'scripted', resumeToken: 'token', ...fields}});
export const event = (fields) => ({event: fields});
export const ack = (frameId, fields = {}) => event({frameAck: {frameId, accepted: true, ...fields}});

/** Thrown by a script: the connection breaks. */
export class Break extends Error {}

/**
 * A server whose Map streams run the functions in `scripts`, one each, with the requests after `start`. It lets tests reach
 * what romap-server does only at rare moments.
 */
export class ScriptedServer {
  starts = [];
  info = {
    id: 'scripted',
    camera: {widthPx: 64, heightPx: 48, fxPx: 60, fyPx: 60, cxPx: 31.5, cyPx: 23.5},
    mode: 'FRAME_MODE_REPLAY',
    state: 'SESSION_STATE_OPEN',
  };

  static async start(test, ...scripts) {
    const scripted = new ScriptedServer();
    scripted.scripts = scripts;
    const options = {longs: String, enums: String, defaults: true, oneofs: true};
    const definition = protoLoader.loadSync(join(SOURCE_DIR, 'proto/romap/v1/mapping.proto'), options);
    const {service} = grpc.loadPackageDefinition(definition).romap.v1.Mapping;
    const limit = {'grpc.max_send_message_length': 64 << 20, 'grpc.max_receive_message_length': 64 << 20};
    scripted.server = new grpc.Server(limit);
    scripted.server.addService(service, {
      listSessions: (call, answer) => answer(null, {sessions: [scripted.info]}),
      createSession: (call, answer) => answer(null, {session: scripted.info}),
      getSession: (call, answer) => answer(null, {session: scripted.info}),
      map: (call) => scripted.#map(call),
      watch: (call) => scripted.#run(call, scripted.watch()),
    });
    const credentials = grpc.ServerCredentials.createInsecure();
    const port = await new Promise((resolve, reject) => {
      scripted.server.bindAsync('127.0.0.1:0', credentials, (error, bound) => (error ? reject(error) : resolve(bound)));
    });
    scripted.address = `127.0.0.1:${port}`;
    test.after(() => scripted.stop());
    return scripted;
  }

  stop() {
    this.server.forceShutdown();
  }

  async #map(call) {
    call.on('error', () => {});
    const requests = call[Symbol.asyncIterator]();
    const first = await requests.next();
    this.starts.push(first.value.start);
    await this.#run(call, this.scripts.shift()(requests));
  }

  async #run(call, answers) {
    try {
      for await (const answer of answers) if (!call.write(answer)) await once(call, 'drain');
      call.end();
    } catch (error) {
      call.emit('error', {code: grpc.status.UNAVAILABLE, details: error instanceof Break ? 'scripted break' : `${error}`});
    }
  }
}

/** Acknowledges all frames until the client ends the stream. */
export async function* untilClosed(requests) {
  for await (const request of requests) yield ack(request.frame.frameId);
}
