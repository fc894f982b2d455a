// Opens the streams of a session and decides which errors are worth another attempt.

import {RomapError} from './errors.mjs';

/**
 * One stream.
 * @typedef {object} Link
 * @property {boolean} takesInputs it is a Map stream
 * @property {any} call
 * @property {any} opened StreamOpened
 * @property {boolean} ended
 */
/** What must be on the server before it is enough to watch a finished session.
 * @typedef {{unacknowledged: number, newestFrameId: number | null}} Kept
 */
/** @typedef {{open: (broken: RomapError | null, kept: Kept) => Promise<Link>,
 *             mayReopen: (error: RomapError) => Promise<boolean>}} Opener */
/** @typedef {import('./rpc.mjs').Rpc} Rpc */

export class Refused extends Error {
  /**
   * @param {RomapError} error
   * @param {boolean} retry the next attempt may succeed
   */
  constructor(error, retry) {
    super(error.message);
    this.error = error;
    this.retry = retry;
  }
}

/**
 * @param {Rpc} rpc
 * @param {string} sessionId
 * @returns {Promise<Link>}
 */
async function watch(rpc, sessionId) {
  const {call, opened} = await rpc.open('Watch', {sessionId});
  return {takesInputs: false, call, opened, ended: false};
}

export class WatchOpener {
  #rpc;
  #id;

  /**
   * @param {Rpc} rpc
   * @param {string} sessionId
   */
  constructor(rpc, sessionId) {
    this.#rpc = rpc;
    this.#id = sessionId;
  }

  async open() {
    return watch(this.#rpc, this.#id).catch((error) => {
      throw new Refused(error, error.mayPass);
    });
  }

  /** @param {RomapError} error */
  async mayReopen(error) {
    return error.mayPass;
  }
}

export class MapOpener {
  #rpc;
  #id;
  #token = '';
  #unanswered = 0; // openings without an answer, which may still reach the server

  /**
   * @param {Rpc} rpc
   * @param {string} sessionId
   */
  constructor(rpc, sessionId) {
    this.#rpc = rpc;
    this.#id = sessionId;
  }

  /**
   * Throws Refused.
   * @param {RomapError | null} broken how the last stream ended; null before the first one
   * @param {Kept} kept
   * @returns {Promise<Link>}
   */
  async open(broken, kept) {
    try {
      const start = {start: {sessionId: this.#id, resumeToken: this.#token}};
      const {call, opened} = await this.#rpc.open('Map', start);
      this.#token = opened.resumeToken;
      return {takesInputs: true, call, opened, ended: false};
    } catch (error) {
      if (!(error instanceof RomapError)) throw error;
      if (error.code === 'FAILED_PRECONDITION') return this.#openFinished(error, broken, kept);
      if (error.mayPass) ++this.#unanswered;
      // Too many streams: that of the broken connection may be among them. INTERNAL may come from gRPC.
      throw new Refused(error, error.mayPass || ['RESOURCE_EXHAUSTED', 'INTERNAL'].includes(error.code));
    }
  }

  /** @param {RomapError} error */
  async mayReopen(error) {
    // A stream is replaced if an earlier opening of this client reaches the server late.
    if (error.code === 'ABORTED' && this.#unanswered > 0) {
      --this.#unanswered;
      return true;
    }
    if (error.code !== 'INTERNAL') return error.mayPass;
    // From gRPC's transport, or because the session failed.
    return this.#state().then(
      (state) => state !== 'SESSION_STATE_FAILED',
      () => true,
    );
  }

  async #state() {
    return (await this.#rpc.call('GetSession', {sessionId: this.#id})).session.state;
  }

  /**
   * The session exists but accepts no Map stream.
   * @param {RomapError} refusal
   * @param {RomapError | null} broken
   * @param {Kept} kept
   * @returns {Promise<Link>}
   */
  async #openFinished(refusal, broken, kept) {
    const ask = async (/** @type {() => Promise<any>} */ question) =>
      question().catch((error) => {
        throw new Refused(error, error.mayPass);
      });
    switch (await ask(() => this.#state())) {
      case 'SESSION_STATE_RESTORING':
        throw new Refused(refusal, true);
      case 'SESSION_STATE_OPEN':
        // An opening of this client whose answer was lost may hold the session, until the server notices.
        throw new Refused(refusal, !this.#token && (this.#unanswered > 0 || broken !== null));
      case 'SESSION_STATE_FAILED':
        // The stream may have told the cause before.
        throw new Refused(broken?.code === 'INTERNAL' ? broken : refusal, false);
      default:
    }
    if (!broken || kept.unacknowledged > 0) throw new Refused(refusal, false);
    const link = await ask(() => watch(this.#rpc, this.#id));
    // A server that was restarted may have lost what it acknowledged before it was stored.
    if (kept.newestFrameId !== null && Number(link.opened.newestFrameId ?? 0) < kept.newestFrameId) {
      link.call.cancel();
      throw new Refused(refusal, false);
    }
    return link;
  }
}
