// A server with the HTTP interface of romap-server for what the real one does not do on demand: damaged meshes, many
// objects, revoked tokens, cut links. It keeps its state like the real one: a viewer that joins gets the present objects.
import http from 'node:http';
import fs from 'node:fs';
import path from 'node:path';

export const kPolicy =
  "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; style-src 'self'; " +
  "img-src 'self' blob: data:; connect-src 'self'; media-src 'self' blob:; base-uri 'none'; form-action 'none'; " +
  "frame-ancestors 'none'";

const kTypes = { '.html': 'text/html; charset=utf-8', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml',
                 '.wasm': 'application/wasm' };

export const kCamera = { widthPx: 640, heightPx: 480, fxPx: 540, fyPx: 540, cxPx: 319.5, cyPx: 239.5 };

export function statistics(values = {}) {
  return { framesReceived: '0', framesProcessed: '0', framesDropped: '0', framesRejected: '0', keyframes: '0', mapPoints: '0',
           objects: '0', objectsTraining: '0', trainingSteps: '0', trainingProgress: 0, residentBytes: '0', diagnostics: [],
           ...values };
}

class Session {
  constructor(id, values) {
    this.info = { id, name: '', camera: kCamera, mode: 'FRAME_MODE_REPLAY', state: 'SESSION_STATE_OPEN',
                  createdUnixNs: String(BigInt(Date.now()) * 1000000n), streamOpen: true, durable: false, pinned: false,
                  storedBytes: '0', tenant: '', statistics: statistics(), ...values };
    this.objects = new Map();  // id -> {object, mesh}
    this.files = new Map();    // path below the session -> {type, bytes}
    this.trajectory = [];
    this.points = Buffer.alloc(0);
    this.readers = new Set();
    this.frames = [];          // what was posted
    this.end = null;
  }

  /** `event`: a MapEvent as JSON. */
  emit(event) {
    if (event.object) {
      const entry = this.objects.get(event.object.id) ?? { object: null, mesh: null };
      entry.object = event.object;
      this.objects.set(event.object.id, entry);
    }
    if (event.mesh && this.objects.has(event.mesh.id)) this.objects.get(event.mesh.id).mesh = event;
    if (event.removed) this.objects.delete(event.removed.id);
    if (event.merged) this.objects.delete(event.merged.from);
    if (event.statistics) this.info.statistics = event.statistics;
    if (event.frameAck) this.trajectory.push({ frame: event.frameAck, timestampNs: '0' });
    for (const reader of this.readers) send(reader, 'map', event);
  }

  setFile(name, bytes, type = 'application/octet-stream') {
    this.files.set(name, { bytes: Buffer.from(bytes), type });
  }

  finish(code = 'OK', message = '') {
    this.end = { code, message };
    if (code === 'OK') this.info.state = 'SESSION_STATE_FINISHED';
    for (const reader of this.readers) {
      send(reader, 'end', this.end);
      reader.end();
    }
  }
}

const send = (response, event, data) => response.write(`event: ${event}\ndata: ${JSON.stringify(data)}\n\n`);

export class MockServer {
  constructor(distDir) {
    this.distDir = distDir;
    this.sessions = new Map();
    this.token = '';
    this.requests = [];
    this.onFrame = () => ({ accepted: true, state: 'TRACKING_STATE_TRACKING' });
    this.frameDelayMs = 0;
    this.port = 0;
  }

  add(id, values = {}) {
    const session = new Session(id, values);
    this.sessions.set(id, session);
    return session;
  }

  /** On the port of the first time, so that `stop` and `start` are a restart. */
  async start() {
    this.server = http.createServer((request, response) => this.handle(request, response).catch((error) => {
      response.destroy(error);
    }));
    this.server.keepAliveTimeout = 1000;
    await new Promise((resolve, reject) => {
      this.server.once('error', reject);
      this.server.listen(this.port, '127.0.0.1', resolve);
    });
    this.port = this.server.address().port;
    this.keepAlive = setInterval(() => {
      for (const session of this.sessions.values()) for (const reader of session.readers) reader.write(': keep-alive\n\n');
    }, 5000);
    return this.url;
  }

  get url() {
    return `http://127.0.0.1:${this.port}/`;
  }

  async stop() {
    clearInterval(this.keepAlive);
    for (const session of this.sessions.values()) session.readers.clear();
    const closed = new Promise((resolve) => this.server.close(resolve));
    this.server.closeAllConnections();
    await closed;
  }

  async handle(request, response) {
    const url = new URL(request.url, this.url);
    this.requests.push(`${request.method} ${url.pathname}${url.search}`);
    response.setHeader('Content-Security-Policy', kPolicy);
    response.setHeader('X-Content-Type-Options', 'nosniff');
    response.setHeader('Referrer-Policy', 'no-referrer');
    if (!url.pathname.startsWith('/api/')) return this.file(url.pathname, response);
    const parts = url.pathname.split('/').slice(3).map(decodeURIComponent);
    if (parts[0] === 'server') {
      return this.json(response, 200, { version: 'mock', needsToken: this.token !== '', maxMessageBytes: '33554432' });
    }
    if (this.token !== '' && request.headers.authorization !== `Bearer ${this.token}`) {
      return this.error(response, 401, 'UNAUTHENTICATED', 'a valid token is needed');
    }
    if (request.method !== 'GET' && request.headers['x-romap'] !== '1') {
      return this.error(response, 403, 'PERMISSION_DENIED', 'the header X-Romap is missing');
    }
    if (parts.length === 1 && request.method === 'GET') {
      return this.json(response, 200, { sessions: [...this.sessions.values()].map((s) => s.info) });
    }
    if (parts.length === 1) {
      const session = this.add(`s${this.sessions.size + 1}`, JSON.parse(await body(request)));
      return this.json(response, 200, { session: session.info });
    }
    const session = this.sessions.get(parts[1]);
    if (!session) return this.error(response, 404, 'NOT_FOUND', `no session ${parts[1]}`);
    return this.sessionRequest(request, response, url, session, parts.slice(2).join('/'));
  }

  async sessionRequest(request, response, url, session, what) {
    if (what === '' && request.method === 'DELETE') {
      this.sessions.delete(session.info.id);
      session.finish('NOT_FOUND', 'the session was deleted');
      return this.json(response, 200, {});
    }
    if (what === '') return this.json(response, 200, session.info);
    if (what === 'events') return this.events(request, response, session);
    if (what === 'finish') {
      session.info.state = 'SESSION_STATE_FINISHING';
      return this.json(response, 200, session.info);
    }
    if (what === 'trajectory') return this.json(response, 200, session.trajectory);
    if (what === 'points') return this.bytes(response, session.points, 'application/octet-stream', { 'X-Romap-Revision': String(session.points.length) });
    if (what === 'frames') return this.frame(request, response, url, session);
    const file = session.files.get(what);
    if (!file) return this.error(response, 404, 'NOT_FOUND', `no ${what}`);
    return this.bytes(response, file.bytes, file.type, file.claims ? { 'Content-Length': file.claims } : {});
  }

  events(request, response, session) {
    response.writeHead(200, { 'Content-Type': 'text/event-stream', 'Cache-Control': 'no-store' });
    send(response, 'opened', { sessionId: session.info.id, resumeToken: '', durable: false, objectIds: [...session.objects.keys()] });
    for (const { object, mesh } of session.objects.values()) {
      send(response, 'map', { object });
      if (mesh) send(response, 'map', mesh);
    }
    send(response, 'map', { statistics: session.info.statistics });
    if (session.end) {
      send(response, 'end', session.end);
      return response.end();
    }
    session.readers.add(response);
    request.on('close', () => session.readers.delete(response));
  }

  async frame(request, response, url, session) {
    const image = await body(request);
    const frameId = url.searchParams.get('frame_id');
    session.frames.push({ frameId, timestampNs: url.searchParams.get('timestamp_ns'), bytes: image.length, time: Date.now() });
    if (this.frameDelayMs > 0) await new Promise((resolve) => setTimeout(resolve, this.frameDelayMs));
    if (session.end || response.destroyed) return this.error(response, 409, 'FAILED_PRECONDITION', 'the session accepts no more frames');
    return this.json(response, 200, { frameId, ...this.onFrame(session.frames.length, image) });
  }

  file(name, response) {
    const relative = name === '/' ? 'index.html' : name === '/camera' ? 'camera.html' : name.slice(1);
    const full = path.join(this.distDir, path.normalize(relative));
    if (!full.startsWith(this.distDir) || !fs.existsSync(full) || !fs.statSync(full).isFile()) {
      return this.error(response, 404, 'NOT_FOUND', `no page ${name}`);
    }
    return this.bytes(response, fs.readFileSync(full), kTypes[path.extname(full)] ?? 'application/octet-stream');
  }

  json(response, status, value) {
    response.writeHead(status, { 'Content-Type': 'application/json' });
    response.end(JSON.stringify(value));
  }

  error(response, status, code, message) {
    this.json(response, status, { code, message });
  }

  bytes(response, bytes, type, headers = {}) {
    response.writeHead(200, { 'Content-Type': type, 'Content-Length': bytes.length, ...headers });
    response.end(bytes);
  }
}

async function body(request) {
  const pieces = [];
  for await (const piece of request) pieces.push(piece);
  return Buffer.concat(pieces);
}
