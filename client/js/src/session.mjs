// A session that this program feeds.

import {RomapError, invalid} from './errors.mjs';
import {frameToProto, masksToProto} from './frame.mjs';
import {MapOpener} from './link.mjs';
import {retryWhileUnavailable} from './retry.mjs';
import {MAX_MESSAGE_BYTES} from './rpc.mjs';
import {EventStream} from './stream.mjs';
import {ackOf} from './unsettled.mjs';

/**
 * @typedef {import('./stream.mjs').StreamOptions & {
 *   maxBytes?: number,
 *   maxWaiting?: number,
 * }} SessionOptions `maxBytes` (256 MiB): of the inputs that are kept, because they are not known to be safe on the
 * server; `maxWaiting` (16): inputs that wait to be sent
 */

/**
 * Keeps a copy of every input until the server acknowledged it and, if it has a store, has stored it. When the connection
 * breaks or the server restarts, it opens another stream and sends these again. Every input is acknowledged once; objects
 * that are gone after an interruption are reported as removed.
 */
export class Session extends EventStream {
  #server;
  #options;
  #isLive;
  #sending = Promise.resolve();
  #newestFrameId = 0;
  /** @type {bigint | null} */
  #newestTimeNs = null;
  /** Frames of a live session that were not sent, see send(). */
  dropped = 0;

  /**
   * @param {import('./server.mjs').Server} server
   * @param {import('./rpc.mjs').Rpc} rpc
   * @param {import('./events.mjs').SessionInfo} info
   * @param {SessionOptions} options
   */
  constructor(server, rpc, info, options) {
    super(new MapOpener(rpc, info.id), options);
    this.#server = server;
    this.#options = {maxBytes: 256 << 20, maxWaiting: 16, ...options};
    this.#isLive = info.mode === 'live';
    this.id = info.id;
    this.camera = info.camera;
  }

  /**
   * @param {ConstructorParameters<typeof Session>} parameters
   * @returns {Promise<Session>}
   */
  static async open(...parameters) {
    const session = new Session(...parameters);
    await session._open();
    session.#newestFrameId = Number(session.opened.newestFrameId ?? 0);
    return session;
  }

  /**
   * Sends a frame and returns its id. Await it: it waits while the server or the connection is busy. In a live session,
   * the oldest frame that was not sent yet is dropped instead, and reported as rejected.
   *
   * The server checks the content. It reports an invalid frame by a frameAck with `accepted: false`, and the session goes
   * on. Throws RomapError at once for wrong sizes, and if the session has ended.
   * @param {import('./frame.mjs').FrameInput} input
   * @returns {Promise<number>}
   */
  send(input) {
    const frame = frameToProto(input, this.camera);
    return this.#inOrder(async () => {
      const time = BigInt(input.timestampNs);
      const frameId = input.frameId ?? this.#newestFrameId + 1;
      if (this.#newestTimeNs !== null && time <= this.#newestTimeNs) {
        throw invalid(`timestampNs: must increase; is ${time} after ${this.#newestTimeNs}`);
      }
      if (frameId <= this.#newestFrameId) {
        throw invalid(`frameId: must increase; is ${frameId} after ${this.#newestFrameId}`);
      }
      await this.#add({...frame, frameId: String(frameId)}, false);
      this.#newestFrameId = frameId;
      this.#newestTimeNs = time;
      return frameId;
    });
  }

  /**
   * Sends the masks of a frame that was sent without them. They are acknowledged with a masksAck.
   * @param {number} frameId
   * @param {import('./frame.mjs').Masks} masks
   * @returns {Promise<void>}
   */
  sendMasks(frameId, masks) {
    const late = {frameId: String(frameId), masks: masksToProto(masks, this.camera)};
    return this.#inOrder(() => this.#add(late, true));
  }

  /**
   * Calls that are not awaited keep their order.
   * @template Result
   * @param {() => Promise<Result>} send
   * @returns {Promise<Result>}
   */
  #inOrder(send) {
    const sent = this.#sending.then(send);
    this.#sending = sent.then(
      () => {},
      () => {},
    );
    return sent;
  }

  /**
   * @param {any} part
   * @param {boolean} isMasks
   */
  async #add(part, isMasks) {
    const masks = part.masks;
    const runs = masks?.labelRuns?.labelLengthPairs.length ?? 0;
    const files = [part.image?.data, part.depth?.data, masks?.labelPng].map((data) => data?.length ?? 0);
    const size = files.reduce((sum, bytes) => sum + bytes, 3 * runs + 256);
    if (size > MAX_MESSAGE_BYTES) {
      throw new RomapError('RESOURCE_EXHAUSTED', `the message has ${size} bytes; the limit is ${MAX_MESSAGE_BYTES}`);
    }
    if (!this.#isLive) {
      await this._changed.until(() => this._ended || this._sendError !== null || !this.#isFull(size));
    }
    if (this._ended || this._sendError) {
      const ended = new RomapError('FAILED_PRECONDITION', 'the session is finished and accepts no more inputs');
      throw this._endError ?? this._sendError ?? ended;
    }
    this._inputs.add(part, isMasks, size);
    if (this.#isLive) this.#dropToFit();
    this._changed.notify();
  }

  /**
   * An input that alone exceeds the limit is sent when no other is kept.
   * @param {number} size
   */
  #isFull(size) {
    if (this._inputs.size === 0) return false;
    const {maxBytes, maxWaiting} = this.#options;
    return this._inputs.bytes + size > maxBytes || this._inputs.waiting >= maxWaiting;
  }

  #dropToFit() {
    const {maxBytes, maxWaiting} = this.#options;
    while (this._inputs.bytes > maxBytes || this._inputs.waiting > maxWaiting) {
      const frameId = this._inputs.dropOldestUnsentFrame();
      if (frameId === null) return;
      ++this.dropped;
      const error = "dropped: the connection is broken or too slow, and the client's memory for frames is full";
      this._deliver(ackOf({frameId, isMasks: false}, {accepted: false, error}));
    }
  }

  /** Inputs that are kept, because they are not known to be safe on the server. */
  get unsettled() {
    return this._inputs.size;
  }

  /**
   * Waits until the server has processed all inputs and, if it has a store, has stored them.
   * @param {number} [timeoutMs] then it throws DEADLINE_EXCEEDED
   */
  async flush(timeoutMs) {
    if (!(await this._changed.until(() => this._ended || this._inputs.size === 0, timeoutMs))) {
      throw new RomapError('DEADLINE_EXCEEDED', `${this._inputs.size} inputs are not safe on the server yet`);
    }
    if (this._endError) throw this._endError;
  }

  /**
   * Waits as flush() and ends the input of the session. Its objects are trained to completion after that; wait() and the
   * iteration end when this is done.
   * @param {number} [timeoutMs] of flush()
   */
  async finish(timeoutMs) {
    // A restarted server could not get inputs again that it lost if the session were finished before.
    await this.flush(timeoutMs);
    return retryWhileUnavailable(() => this.#server.finish(this.id), this.#options.retry);
  }

  /**
   * Finishes the session, waits until its objects are trained, and returns its map. Events that nobody reads meanwhile do
   * not matter.
   * @param {number} [timeoutMs]
   */
  async result(timeoutMs) {
    const start = Date.now();
    await this.finish(timeoutMs);
    const leftMs = timeoutMs === undefined ? undefined : Math.max(0, timeoutMs - (Date.now() - start));
    if (!(await this.wait(leftMs))) {
      throw new RomapError('DEADLINE_EXCEEDED', `the session was not finished within ${timeoutMs} ms`);
    }
    return retryWhileUnavailable(() => this.#server.export(this.id), this.#options.retry);
  }
}
