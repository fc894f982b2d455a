// A connection to a romap-server.

import {createReadStream, createWriteStream} from 'node:fs';
import {rename, rm} from 'node:fs/promises';
import {Readable} from 'node:stream';
import {pipeline} from 'node:stream/promises';
import {RomapError, invalid} from './errors.mjs';
import {frameAck, meshUpdate, objectUpdate, sessionInfo, statistics, word} from './events.mjs';
import {cameraToProto} from './frame.mjs';
import {vectorToProto} from './geometry.mjs';
import {WatchOpener} from './link.mjs';
import {retryWhileUnavailable} from './retry.mjs';
import {Rpc, readToken} from './rpc.mjs';
import {Session} from './session.mjs';
import {EventStream} from './stream.mjs';

/** @typedef {import('./events.mjs').SessionInfo} SessionInfo */

const MODES = {replay: 'FRAME_MODE_REPLAY', live: 'FRAME_MODE_LIVE'};
const POSE_USES = {given: 'POSE_USE_GIVEN', prior: 'POSE_USE_PRIOR', ignore: 'POSE_USE_IGNORE'};
const PIECE_BYTES = 1 << 20;

/**
 * Connects to a server and verifies that it is a romap-server.
 * @param {string} address 'HOST:PORT'
 * @param {object} [options]
 * @param {string} [options.token] for a server that wants one; sent only with TLS, or to this machine
 * @param {string} [options.tokenFile] the file with it; by default the one that ROMAP_TOKEN_FILE names
 * @param {import('./rpc.mjs').Tls} [options.tls] connect with TLS
 * @param {number} [options.waitMs] how long to wait for a server that is not there yet
 * @returns {Promise<Server>}
 */
export async function connect(address, {token, tokenFile, tls, waitMs = 0} = {}) {
  const secret = readToken(token, tokenFile);
  return retryWhileUnavailable(
    async () => {
      const rpc = new Rpc(address, secret, tls);
      try {
        await rpc.waitUntilReady();
        const server = new Server(rpc);
        await server.sessions().catch((error) => {
          if (['UNAUTHENTICATED', 'PERMISSION_DENIED'].includes(error.code)) throw error;
          const reason = error instanceof RomapError ? error.reason : String(error);
          const message = `${address} accepts connections but is not a working romap-server: ${reason}`;
          throw new RomapError('UNAVAILABLE', message);
        });
        return server;
      } catch (error) {
        rpc.close();
        throw error;
      }
    },
    {maxDownMs: waitMs},
  );
}

/**
 * Made by connect(). Every call throws RomapError: UNAVAILABLE without a connection, DEADLINE_EXCEEDED, UNAUTHENTICATED
 * without a valid token, PERMISSION_DENIED if its role does not allow the call, NOT_FOUND for a session that does not
 * exist.
 */
export class Server {
  #rpc;

  /** @param {Rpc} rpc */
  constructor(rpc) {
    this.#rpc = rpc;
  }

  /**
   * Creates a session and opens it.
   * @param {import('./frame.mjs').Camera} camera
   * @param {import('./session.mjs').SessionOptions & {
   *   name?: string,
   *   mode?: 'replay' | 'live',
   *   poseUse?: 'given' | 'prior' | 'ignore',
   *   upWorld?: ArrayLike<number>,
   *   estimateUp?: boolean,
   * }} [options] mode: a busy server slows the program down ('replay'), or drops the oldest frame ('live'). poseUse: poses
   * of the frames are exact ('given'), corrected by the images, or ignored. upWorld: up in the world of the poses, if it is
   * not z. estimateUp: estimate it from the images
   * @returns {Promise<Session>}
   */
  async session(camera, options = {}) {
    const {name = '', mode = 'replay', poseUse = 'given', upWorld, estimateUp = false} = options;
    if (!MODES[mode]) throw invalid(`mode: must be one of ${Object.keys(MODES).join(', ')}; is ${mode}`);
    if (!POSE_USES[poseUse]) {
      throw invalid(`poseUse: must be one of ${Object.keys(POSE_USES).join(', ')}; is ${poseUse}`);
    }
    const answer = await this.#rpc.call('CreateSession', {
      name,
      camera: cameraToProto(camera),
      mode: MODES[mode],
      poseUse: POSE_USES[poseUse],
      estimateUp,
      ...(upWorld ? {upWorld: vectorToProto(upWorld, 'upWorld')} : {}),
    });
    return Session.open(this, this.#rpc, sessionInfo(answer.session), options);
  }

  /**
   * Continues an open session. Session.opened.newestFrameId tells what it has.
   * @param {string} sessionId
   * @param {import('./session.mjs').SessionOptions} [options]
   * @returns {Promise<Session>}
   */
  async open(sessionId, options = {}) {
    return Session.open(this, this.#rpc, await this.info(sessionId), options);
  }

  /**
   * The events of a session that another program feeds, beginning with its current objects. After a broken connection it
   * starts again; then objects that are gone are reported as removed.
   * @param {string} sessionId
   * @param {import('./stream.mjs').StreamOptions} [options]
   * @returns {Promise<EventStream>}
   */
  async watch(sessionId, options = {}) {
    const stream = new WatchStream(new WatchOpener(this.#rpc, sessionId), options);
    await stream.start();
    return stream;
  }

  /** @returns {Promise<SessionInfo[]>} */
  async sessions() {
    return (await this.#rpc.call('ListSessions')).sessions.map(sessionInfo);
  }

  /** @param {string} sessionId */
  async info(sessionId) {
    return sessionInfo((await this.#rpc.call('GetSession', {sessionId})).session);
  }

  /**
   * Ends the input of a session. See Session.finish() for one that this program feeds.
   * @param {string} sessionId
   */
  async finish(sessionId) {
    return sessionInfo((await this.#rpc.call('FinishSession', {sessionId})).session);
  }

  /** @param {string} sessionId */
  async delete(sessionId) {
    await this.#rpc.call('DeleteSession', {sessionId});
  }

  /**
   * A pinned session is not deleted by age or size.
   * @param {string} sessionId
   */
  async pin(sessionId, pinned = true) {
    return sessionInfo((await this.#rpc.call('PinSession', {sessionId, pinned})).session);
  }

  /**
   * The current map.
   * @param {string} sessionId
   * @returns {Promise<import('./events.mjs').RomapMap>}
   */
  async export(sessionId) {
    /** @type {any} */
    let header = null;
    const objects = [];
    const trajectory = [];
    for await (const part of this.#rpc.read('ExportMap', {sessionId})) {
      header ??= part.header;
      if (part.object) {
        const {object, mesh} = part.object;
        objects.push({object: objectUpdate(object), mesh: mesh && meshUpdate(mesh)});
      }
      for (const {frame, timestampNs} of part.trajectory?.points ?? []) {
        trajectory.push({timestampNs: BigInt(timestampNs), frame: frameAck(frame)});
      }
    }
    if (!header) throw new RomapError('DATA_LOSS', 'the exported map has no header');
    return {
      sessionId: header.sessionId,
      state: word('SESSION_STATE', header.state),
      statistics: statistics(header.statistics),
      objects,
      trajectory,
    };
  }

  /**
   * Saves the whole session as a file (*.romap).
   * @param {string} sessionId
   * @param {string} file
   */
  async save(sessionId, file) {
    const partial = `${file}.part`;
    const answers = this.#rpc.read('SaveSession', {sessionId});
    const pieces = async function* () {
      for await (const {piece} of answers) yield piece;
    };
    try {
      await pipeline(Readable.from(pieces()), createWriteStream(partial));
      await rename(partial, file);
    } finally {
      await rm(partial, {force: true});
    }
  }

  /**
   * Adds a saved session; it gets another id.
   * @param {string} file
   */
  async load(file) {
    const requests = async function* () {
      for await (const piece of createReadStream(file, {highWaterMark: PIECE_BYTES})) yield {piece};
    };
    return sessionInfo((await this.#rpc.write('LoadSession', requests())).session);
  }

  /** Closes the connection. Close its streams before. Sessions stay on the server. */
  close() {
    this.#rpc.close();
  }
}

class WatchStream extends EventStream {
  start() {
    return this._open();
  }
}
