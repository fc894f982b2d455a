// A stream of events that survives a broken connection, with the inputs that it sends again.

import {RomapError, fromRpc} from './errors.mjs';
import {EventBuffer, SeenObjects} from './event_buffer.mjs';
import {eventFromProto} from './events.mjs';
import {Refused} from './link.mjs';
import {Delays, Signal, withDefaults} from './retry.mjs';
import {written} from './rpc.mjs';
import {UnsettledInputs} from './unsettled.mjs';

/** @typedef {import('./events.mjs').MapEvent} MapEvent */
/** @typedef {import('./link.mjs').Link} Link */
/**
 * @typedef {object} StreamOptions
 * @property {import('./retry.mjs').Retry} [retry]
 * @property {(event: MapEvent) => void} [onEvent] is called with every event, instead of iterating
 * @property {(isUp: boolean, reason: string, attempt: number) => void} [onLink] is called when the connection breaks,
 *   after every attempt to restore it, and when it is back
 */

/** Iterate over it with `for await`. It ends when the session is finished or close() is called, and throws
 * RomapError for other reasons. */
export class EventStream {
  /** @type {import('./link.mjs').Opener} */
  #opener;
  /** @type {StreamOptions} */
  #options;
  #retry;
  #delays;
  /** @type {number | null} the first break of the link since the last progress */
  #downSince = null;
  #seen = new SeenObjects();
  /** @protected */
  _buffer = new EventBuffer();
  /** @protected */
  _changed = new Signal();
  /** @protected */
  _inputs = new UnsettledInputs();
  /** @protected @type {RomapError | null} the session accepts no more inputs, although its stream goes on */
  _sendError = null;
  /** @protected */
  _ended = false;
  #closed = false; // by this program
  /** @protected @type {RomapError | null} */
  _endError = null;
  /** @type {Link | null} */
  #link = null;
  /** @type {any} StreamOpened of the first stream */
  opened = null;

  /**
   * @param {import('./link.mjs').Opener} opener
   * @param {StreamOptions} options
   */
  constructor(opener, options) {
    this.#opener = opener;
    this.#options = options;
    this.#retry = withDefaults(options.retry);
    this.#delays = new Delays(this.#retry);
  }

  /**
   * Waits for the first opening, as for later ones.
   * @protected
   */
  async _open() {
    const link = await this.#establish(null);
    this.opened = link.opened;
    this.#begin(link);
    this.#run(link).catch((error) => this.#end(asError(error)));
  }

  // ------------------------------------------------------------------------------------------------------- the caller

  async *[Symbol.asyncIterator]() {
    for (let event = await this.next(); event; event = await this.next()) yield event;
  }

  /**
   * The next event; null: the stream has ended, or no event came within `timeoutMs`.
   * @param {number} [timeoutMs]
   * @returns {Promise<MapEvent | null>}
   */
  async next(timeoutMs) {
    await this._changed.until(() => this._ended || this._buffer.size > 0, timeoutMs);
    const event = this._buffer.pop();
    if (!event) this.#throwUnlessClosed();
    return event;
  }

  /**
   * Waits until the session is finished; false: not within `timeoutMs`.
   * @param {number} [timeoutMs]
   */
  async wait(timeoutMs) {
    const ended = await this._changed.until(() => this._ended, timeoutMs);
    this.#throwUnlessClosed();
    return ended;
  }

  /** What reads the events of a stream that this program closed simply ends. */
  #throwUnlessClosed() {
    if (this._endError && !this.#closed) throw this._endError;
  }

  /** Ends the stream, not the session. Inputs that are not known to be safe are forgotten. */
  close() {
    this.#closed = true;
    this.#end(new RomapError('CANCELLED', 'the stream was closed'));
  }

  // ----------------------------------------------------------------------------------------------------- its receiver

  /** @param {Link} first */
  async #run(first) {
    for (let link = first; ; ) {
      const sending = this.#sendOn(link);
      const broken = await this.#receive(link);
      await sending;
      if (!broken || this._ended || !(await this.#opener.mayReopen(broken))) return this.#end(broken);
      link = await this.#establish(broken);
      this.#begin(link);
    }
  }

  /**
   * Opens a stream, with further attempts.
   * @param {RomapError | null} broken how the last one ended; null before the first one
   * @returns {Promise<Link>}
   */
  async #establish(broken) {
    let failure = broken;
    for (let attempt = 0; ; ++attempt) {
      if (failure) {
        this.#downSince ??= Date.now();
        this.#options.onLink?.(false, failure.reason, attempt);
        const giveUp = this.#downSince + this.#retry.maxDownMs;
        await this._changed.until(() => this._ended, Math.min(this.#delays.nextMs(), Math.max(0, giveUp - Date.now())));
        if (this._ended) throw failure;
        if (Date.now() >= giveUp) {
          const down = ((Date.now() - this.#downSince) / 1000).toFixed(1);
          throw new RomapError(failure.code, `${failure.reason} (gave up after ${down} s)`);
        }
      }
      try {
        const {unacknowledged, newestFrameId} = this._inputs;
        const link = await this.#opener.open(broken, {unacknowledged, newestFrameId});
        if (failure) this.#options.onLink?.(true, '', attempt);
        return link;
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        if (!error.retry) throw error.error;
        failure = error.error;
      }
    }
  }

  /** @param {Link} link */
  #begin(link) {
    if (this._ended) {
      link.ended = true;
      link.call.cancel();
      return;
    }
    this._inputs.beginStream(link.opened.durable);
    if (!link.takesInputs) {
      this._inputs.clear(); // everything is on the server; see MapOpener
      this._sendError = new RomapError('FAILED_PRECONDITION', 'the session was finished and accepts no more inputs');
    }
    if (this._inputs.size === 0) this.#downSince = null;
    this.#link = link;
    const existing = new Set((link.opened.objectIds ?? []).map(Number));
    for (const removal of this.#seen.keepOnly(existing)) this._deliver(removal);
    this._changed.notify();
  }

  /**
   * Reads the stream to its end. null: the server ended it, because the session is finished.
   * @param {Link} link
   * @returns {Promise<RomapError | null>}
   */
  async #receive(link) {
    /** @type {unknown} */
    let thrown = null;
    const failure = await new Promise((resolve) => {
      link.call.on('data', (/** @type {any} */ response) => {
        try {
          const event = this._ended ? null : eventFromProto(response.event);
          if (event) for (const each of this.#process(event)) this._deliver(each);
        } catch (error) {
          thrown ??= error; // of a callback
          link.call.cancel();
        }
      });
      link.call.on('end', () => resolve(null));
      link.call.on('error', resolve);
      link.call.resume();
    });
    link.ended = true;
    this.#link = null;
    this._changed.notify();
    if (thrown) throw thrown;
    return failure ? fromRpc(failure) : null;
  }

  /**
   * @param {MapEvent} event
   * @returns {MapEvent[]}
   */
  #process(event) {
    const before = this._inputs.size;
    /** @type {MapEvent[]} */
    let deliver = [event];
    if (event.type === 'frameAck' || event.type === 'masksAck') {
      deliver = this._inputs.acknowledge(event);
    } else {
      if (event.type === 'durable') this._inputs.cover(event);
      this.#seen.note(event);
      if (this._inputs.size === before) return deliver;
    }
    if (deliver.length > 0 || this._inputs.size !== before) {
      // The server gets on with the inputs, so that a later break is a new one.
      this.#downSince = null;
      this.#delays.reset();
    }
    this._changed.notify();
    return deliver;
  }

  /**
   * @protected
   * @param {MapEvent} event
   */
  _deliver(event) {
    if (this.#options.onEvent) return this.#options.onEvent(event);
    this._buffer.add(event);
    this._changed.notify();
  }

  /** @param {RomapError | null} error */
  #end(error) {
    if (this._ended) return;
    const missing = this._inputs.unacknowledged;
    this._endError = error;
    if (!error && missing > 0) {
      const message = `the session was finished before ${missing} inputs were accepted`;
      this._endError = new RomapError('FAILED_PRECONDITION', message);
    }
    this._ended = true;
    this._inputs.clear();
    if (this.#link) {
      this.#link.ended = true;
      this.#link.call.cancel();
    }
    this._changed.notify();
  }

  // ------------------------------------------------------------------------------------------------------- its inputs

  /** @param {Link} link */
  async #sendOn(link) {
    while (link.takesInputs) {
      await this._changed.until(() => link.ended || this._inputs.waiting > 0);
      if (link.ended) return;
      const request = this._inputs.takeNext();
      this._changed.notify(); // send() may wait
      if (request && !(await written(link.call, request))) return;
    }
  }
}

/** @param {unknown} error */
function asError(error) {
  return error instanceof RomapError
    ? error
    : new RomapError('INTERNAL', `the callback of the session failed: ${error}`);
}
