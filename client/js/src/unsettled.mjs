// The inputs of a session that may have to be sent again.

/** @typedef {import('./events.mjs').FrameAck | import('./events.mjs').MasksAck} Ack */

/**
 * @typedef {object} Item
 * @property {any} part the Frame or LateMasks
 * @property {boolean} isMasks
 * @property {number} frameId
 * @property {number} bytes
 * @property {boolean} sent on any stream
 * @property {boolean} waited while there was no stream
 * @property {boolean} sentOnStream on the current one
 * @property {boolean} acked the caller has had its acknowledgement
 * @property {boolean} covered by a Durable event
 */

/**
 * An input is settled, and forgotten, once it was acknowledged and the server keeps it: from a server with a store, once a
 * Durable event covers it; else at once. A rejected input is settled, too.
 */
export class UnsettledInputs {
  /** @type {Map<number, Item>} by sequence number, in ascending order */
  #items = new Map();
  #added = 0;
  #next = 0; // sequence number from which on the inputs were not taken for the current stream
  #isFirst = true;
  #durable = false;
  bytes = 0;

  get size() {
    return this.#items.size;
  }

  /**
   * @param {any} part the Frame or LateMasks
   * @param {boolean} isMasks
   * @param {number} bytes about its size
   */
  add(part, isMasks, bytes) {
    const state = {sent: false, waited: false, sentOnStream: false, acked: false, covered: false};
    this.#items.set(this.#added++, {part, isMasks, frameId: Number(part.frameId), bytes, ...state});
    this.bytes += bytes;
  }

  /** Inputs that were not taken for the current stream. */
  get waiting() {
    let count = 0;
    for (const sequence of this.#items.keys()) if (sequence >= this.#next) ++count;
    return count;
  }

  /**
   * The next request for the current stream; null if all were taken.
   * @returns {object | null}
   */
  takeNext() {
    for (const [sequence, item] of this.#items) {
      if (sequence < this.#next) continue;
      this.#next = sequence + 1;
      const part = {...item.part, resent: item.sent || item.waited};
      item.sent = item.sentOnStream = true;
      return item.isMasks ? {lateMasks: part} : {frame: part};
    }
    return null;
  }

  /**
   * All inputs are sent again on a new stream.
   * @param {boolean} durable the server has a store
   */
  beginStream(durable) {
    this.#durable = durable;
    this.#next = 0;
    for (const [sequence, item] of this.#items) {
      item.sentOnStream = false;
      item.waited = !this.#isFirst;
      this.#forgetSettled(sequence, item);
    }
    this.#isFirst = false;
  }

  /**
   * The acknowledgements that the caller has not had yet.
   *
   * An accepted input proves that all inputs of its kind before it on the same stream arrived, because the server
   * acknowledges in order. Those whose acknowledgements were lost are delivered as duplicates, without a pose.
   * @param {Ack} ack
   * @returns {Ack[]}
   */
  acknowledge(ack) {
    const isMasks = ack.type === 'masksAck';
    const found = this.#find(isMasks, ack.frameId);
    if (!found) return []; // settled: the caller has had the acknowledgement
    const [sequence, item] = found;
    const news = ack.accepted && item.sentOnStream ? this.#acknowledgeBefore(sequence, isMasks) : [];
    if (!item.acked) news.push(ack);
    item.acked = true;
    if (ack.accepted) this.#forgetSettled(sequence, item);
    else this.#remove(sequence);
    return news;
  }

  /**
   * What was never sent cannot be stored, whatever its id.
   * @param {import('./events.mjs').Durable} durable
   */
  cover({frameId, masksFrameId}) {
    for (const [sequence, item] of this.#items) {
      item.covered ||= item.sent && item.frameId <= (item.isMasks ? masksFrameId : frameId);
      this.#forgetSettled(sequence, item);
    }
  }

  /**
   * Its id; null: there is none.
   * @returns {number | null}
   */
  dropOldestUnsentFrame() {
    for (const [sequence, item] of this.#items) {
      if (sequence < this.#next || item.sent || item.isMasks) continue;
      this.#remove(sequence);
      return item.frameId;
    }
    return null;
  }

  clear() {
    this.#items.clear();
    this.bytes = 0;
  }

  get unacknowledged() {
    return [...this.#items.values()].filter((item) => !item.acked).length;
  }

  /** @returns {number | null} */
  get newestFrameId() {
    let newest = null;
    for (const item of this.#items.values()) if (!item.isMasks) newest = Math.max(newest ?? 0, item.frameId);
    return newest;
  }

  /**
   * @param {boolean} isMasks
   * @param {number} frameId
   */
  #find(isMasks, frameId) {
    const found = [...this.#items].filter(
      ([, item]) => item.isMasks === isMasks && item.frameId === frameId && item.sent,
    );
    return found.find(([, item]) => !item.acked) ?? found[0];
  }

  /**
   * @param {number} end
   * @param {boolean} isMasks
   */
  #acknowledgeBefore(end, isMasks) {
    /** @type {Ack[]} */
    const news = [];
    for (const [sequence, item] of this.#items) {
      if (sequence >= end) break;
      if (item.isMasks !== isMasks || !item.sentOnStream) continue;
      if (!item.acked) news.push(ackOf(item, {accepted: true, duplicate: true}));
      item.acked = true;
      this.#forgetSettled(sequence, item);
    }
    return news;
  }

  /**
   * @param {number} sequence
   * @param {Item} item
   */
  #forgetSettled(sequence, item) {
    if (item.acked && (item.covered || !this.#durable)) this.#remove(sequence);
  }

  /** @param {number} sequence */
  #remove(sequence) {
    this.bytes -= this.#items.get(sequence)?.bytes ?? 0;
    this.#items.delete(sequence);
  }
}

/**
 * An acknowledgement that the client makes itself.
 * @param {{frameId: number, isMasks: boolean}} input
 * @param {{accepted: boolean, duplicate?: boolean, error?: string}} result
 * @returns {Ack}
 */
export function ackOf({frameId, isMasks}, {accepted, duplicate = false, error = ''}) {
  if (isMasks) return {type: 'masksAck', frameId, accepted, error, duplicate};
  return {
    type: 'frameAck',
    frameId,
    accepted,
    error,
    state: 'unspecified',
    stateReason: '',
    pose: null,
    rotation: null,
    positionSigma: null,
    rotationSigmaRad: null,
    isKeyframe: false,
    latencyS: 0,
    mapId: 0,
    duplicate,
  };
}
