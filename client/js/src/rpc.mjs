// The connection to a server: its channel, and calls with the token, time limits and errors of this package.

import {existsSync, readFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';
import {isIPv4} from 'node:net';
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import {RomapError, fromRpc, invalid} from './errors.mjs';

export const MAX_MESSAGE_BYTES = 32 << 20; // as the server's transport.max_message_bytes
const CONNECT_TIMEOUT_MS = 3000;
const CALL_TIMEOUT_MS = 30_000;
const EXPORT_TIMEOUT_MS = 300_000;
const KEEPALIVE_MS = 20_000;

/**
 * How the client proves the server's identity and its own. All files are PEM files.
 * @typedef {object} Tls
 * @property {string} [ca] who may have signed the server's certificate; absent: as Node.js says
 * @property {string} [certificate] the client's own, for servers that want one
 * @property {string} [key]
 * @property {string} [serverName] in the server's certificate; absent: the host of the address
 */

/** @type {any} */
let mapping;

/** The service of mapping.proto. 64-bit integers are strings, enums their names, fields have camel case. */
function mappingClient() {
  if (mapping) return mapping;
  // In the package, or in the source tree of romap.
  const places = ['../proto/', '../../../proto/'].map((place) => fileURLToPath(new URL(place, import.meta.url)));
  const folder = places.find((place) => existsSync(`${place}romap/v1/mapping.proto`));
  if (!folder) throw new RomapError('NOT_FOUND', `mapping.proto is neither in ${places.join(' nor in ')}`);
  const definition = protoLoader.loadSync('romap/v1/mapping.proto', {
    includeDirs: [folder],
    longs: String,
    enums: String,
    defaults: true,
    oneofs: true,
  });
  const loaded = /** @type {any} */ (grpc.loadPackageDefinition(definition));
  mapping = loaded.romap.v1.Mapping;
  return mapping;
}

/**
 * `token`, or the content of `tokenFile` or of the file that ROMAP_TOKEN_FILE names.
 * @param {string | undefined} token
 * @param {string | undefined} tokenFile
 */
export function readToken(token, tokenFile) {
  const path = tokenFile || process.env.ROMAP_TOKEN_FILE;
  let text = token;
  if (text === undefined && path) {
    text = read(path).toString('utf8').trim();
    if (!text || /\s/.test(text)) {
      throw invalid(`${path}: must have one token, as printed by: romap-server token create`);
    }
  }
  text = text?.trim();
  if (text && !/^[!-~]+$/.test(text)) throw invalid('the token is not one that romap-server token create printed');
  return text || undefined;
}

/** @param {string} path */
function read(path) {
  try {
    return readFileSync(path);
  } catch (error) {
    const {code, message} = /** @type {NodeJS.ErrnoException} */ (error);
    throw new RomapError(code === 'ENOENT' ? 'NOT_FOUND' : 'FAILED_PRECONDITION', `cannot read ${path}: ${message}`);
  }
}

/**
 * Only numbers and "localhost" count: a name may lead anywhere.
 * @param {string} address
 */
export function staysOnThisMachine(address) {
  const host = address.slice(0, address.lastIndexOf(':'));
  if (address.startsWith('unix:') || host === 'localhost' || host === '[::1]') return true;
  return isIPv4(host) && host.startsWith('127.');
}

/**
 * @param {string} address
 * @param {Tls} tls
 * @param {Record<string, unknown>} options is added to
 */
function tlsCredentials(address, tls, options) {
  if ((tls.certificate === undefined) !== (tls.key === undefined)) {
    throw invalid('TLS: a client certificate needs both the certificate and its key');
  }
  const [ca, key, certificate] = [tls.ca, tls.key, tls.certificate].map((path) => (path ? read(path) : null));
  if (tls.serverName) options['grpc.ssl_target_name_override'] = tls.serverName;
  try {
    return grpc.credentials.createSsl(ca, key, certificate);
  } catch (error) {
    throw invalid(`TLS for ${address}: ${/** @type {Error} */ (error).message}`);
  }
}

/** Every call throws RomapError. */
export class Rpc {
  #client;
  #closed = false;
  #metadata = new grpc.Metadata();

  /**
   * @param {string} address
   * @param {string | undefined} token
   * @param {Tls | undefined} tls
   */
  constructor(address, token, tls) {
    const [, host, port] = /^(.+):(\d+)$/.exec(address) ?? [];
    if (!address.startsWith('unix:') && !(host && Number(port) < 65536)) {
      throw invalid(`the address must be HOST:PORT, is '${address}'`);
    }
    if (token && !tls && !staysOnThisMachine(address)) {
      throw invalid(`the token is not sent to ${address} in clear text; connect with TLS`);
    }
    this.address = address;
    this.tls = tls;
    if (token) this.#metadata.set('authorization', `Bearer ${token}`);
    /** @type {Record<string, unknown>} */
    const options = {
      'grpc.max_receive_message_length': MAX_MESSAGE_BYTES,
      'grpc.max_send_message_length': MAX_MESSAGE_BYTES,
      // Detects a server that disappears without closing the connection (power or network failure).
      'grpc.keepalive_time_ms': KEEPALIVE_MS,
      'grpc.keepalive_timeout_ms': KEEPALIVE_MS,
      // Connects quickly to a server that is still starting.
      'grpc.initial_reconnect_backoff_ms': 100,
      'grpc.max_reconnect_backoff_ms': 2000,
      // The global pool would share the back-off with other channels to the same address.
      'grpc.use_local_subchannel_pool': 1,
    };
    const credentials = tls ? tlsCredentials(address, tls, options) : grpc.credentials.createInsecure();
    this.#client = new (mappingClient())(address, credentials, options);
  }

  async waitUntilReady() {
    const failure = await new Promise((resolve) => {
      this.#client.waitForReady(Date.now() + CONNECT_TIMEOUT_MS, resolve);
    });
    if (!failure) return;
    const hint = this.tls
      ? 'with TLS (does it run there, with TLS, and did the CA sign its certificate for this name?)'
      : `(start it with: romap-server --listen ${this.address}; if it uses TLS: the option tls)`;
    throw new RomapError('UNAVAILABLE', `cannot connect to romap-server at ${this.address} ${hint}`);
  }

  /**
   * A call with one answer.
   * @param {string} method
   * @param {object} [request]
   * @returns {Promise<any>}
   */
  async call(method, request = {}) {
    this.#checkOpen();
    return new Promise((resolve, reject) => {
      const options = {deadline: Date.now() + CALL_TIMEOUT_MS};
      this.#client[method](request, this.#metadata, options, (/** @type {any} */ failure, /** @type {any} */ answer) =>
        failure ? reject(fromRpc(failure)) : resolve(answer),
      );
    });
  }

  /**
   * The answers of a call that ends by itself.
   * @param {string} method
   * @param {object} request
   * @returns {AsyncGenerator<any>}
   */
  async *read(method, request) {
    this.#checkOpen();
    const call = this.#client[method](request, this.#metadata, {deadline: Date.now() + EXPORT_TIMEOUT_MS});
    try {
      yield* call;
    } catch (failure) {
      throw fromRpc(failure);
    } finally {
      call.cancel();
    }
  }

  /**
   * A call with many requests and one answer.
   * @param {string} method
   * @param {AsyncIterable<object>} requests
   * @returns {Promise<any>}
   */
  async write(method, requests) {
    this.#checkOpen();
    /** @type {any} */
    let call;
    const answer = new Promise((resolve, reject) => {
      const options = {deadline: Date.now() + EXPORT_TIMEOUT_MS};
      call = this.#client[method](this.#metadata, options, (/** @type {any} */ failure, /** @type {any} */ value) =>
        failure ? reject(fromRpc(failure)) : resolve(value),
      );
    });
    answer.catch(() => {}); // it is awaited below
    try {
      for await (const request of requests) if (!(await written(call, request))) break; // the answer says why
      call.end();
    } catch (error) {
      call.cancel();
      throw error;
    }
    return answer;
  }

  /**
   * Opens a stream and waits for its first answer, StreamOpened. The stream is paused.
   * @param {'Map' | 'Watch'} method
   * @param {object} first the first request
   * @returns {Promise<{call: any, opened: any}>}
   */
  async open(method, first) {
    this.#checkOpen();
    const call = method === 'Map' ? this.#client.Map(this.#metadata) : this.#client.Watch(first, this.#metadata);
    if (method === 'Map') call.write(first);
    let isLate = false;
    const timer = setTimeout(() => {
      isLate = true;
      call.cancel();
    }, CALL_TIMEOUT_MS);
    try {
      const opened = await new Promise((resolve, reject) => {
        call.once('data', (/** @type {any} */ answer) => {
          call.pause();
          resolve(answer.opened);
        });
        call.once('end', () => reject(new RomapError('UNKNOWN', 'the server closed the stream without an answer')));
        call.once('error', reject);
      });
      return {call, opened};
    } catch (failure) {
      call.on('error', () => {});
      if (isLate) throw new RomapError('DEADLINE_EXCEEDED', `the server did not answer within ${CALL_TIMEOUT_MS} ms`);
      throw fromRpc(failure);
    } finally {
      clearTimeout(timer);
    }
  }

  #checkOpen() {
    if (this.#closed) throw new RomapError('FAILED_PRECONDITION', 'this connection was closed by the program');
  }

  close() {
    this.#closed = true;
    this.#client.close();
  }
}

/**
 * Writes a request and waits until it has left, as flow control allows. False: the stream has ended.
 * @param {any} call
 * @param {object} request
 * @returns {Promise<boolean>}
 */
export function written(call, request) {
  return new Promise((resolve) => {
    const ended = () => resolve(false);
    call.once('status', ended);
    call.write(request, (/** @type {any} */ error) => {
      call.off('status', ended);
      resolve(!error);
    });
  });
}
