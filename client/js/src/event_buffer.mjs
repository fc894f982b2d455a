// The events that a program has not read yet.

/** @typedef {import('./events.mjs').MapEvent} MapEvent */

export const MAX_ACKS = 4096;

/**
 * Bounded, so that a program may send without reading events: of an object only its newest update and mesh wait, and of
 * the acknowledgements the newest MAX_ACKS. A MapCopy of the events still equals the server's map.
 */
export class EventBuffer {
  /** @type {Map<string, MapEvent>} */
  #events = new Map();
  /** @type {Set<string>} */
  #acks = new Set();

  get size() {
    return this.#events.size;
  }

  /** @param {MapEvent} event */
  add(event) {
    // A newer update takes the place of an older one, so that the update that announces an object stays before all other
    // events of the object.
    switch (event.type) {
      case 'object':
      case 'mesh':
        this.#events.set(`${event.type} ${event.id}`, event);
        break;
      case 'removed':
      case 'merged': {
        const id = event.type === 'removed' ? event.id : event.from;
        for (const kind of ['object', 'mesh']) this.#events.delete(`${kind} ${id}`);
        this.#events.set(`gone ${id}`, event);
        break;
      }
      case 'frameAck':
      case 'masksAck':
        this.#addAck(`${event.type} ${event.frameId} ${event.accepted}`, event);
        break;
      case 'diagnostic':
        this.#events.set(`diagnostic ${event.code}`, event);
        break;
      default:
        this.#events.set(event.type, event);
    }
  }

  /**
   * The oldest one.
   * @returns {MapEvent | null}
   */
  pop() {
    const [entry] = this.#events;
    if (!entry) return null;
    this.#events.delete(entry[0]);
    this.#acks.delete(entry[0]);
    return entry[1];
  }

  /**
   * @param {string} key
   * @param {MapEvent} event
   */
  #addAck(key, event) {
    this.#acks.add(key);
    this.#events.set(key, event);
    if (this.#acks.size <= MAX_ACKS) return;
    const [oldest] = this.#acks;
    this.#acks.delete(oldest);
    this.#events.delete(oldest);
  }
}

/** The objects that the events of a stream announced, with their newest revision. */
export class SeenObjects {
  /** @type {Map<number, number>} */
  #revisions = new Map();

  /** @param {MapEvent} event */
  note(event) {
    const raise = (/** @type {number} */ id, /** @type {number} */ revision) =>
      this.#revisions.set(id, Math.max(revision, this.#revisions.get(id) ?? 0));
    if (event.type === 'object') raise(event.id, event.revision);
    if (event.type === 'mesh' && this.#revisions.has(event.id)) raise(event.id, event.revision);
    if (event.type === 'removed') this.#revisions.delete(event.id);
    if (event.type === 'merged') {
      this.#revisions.delete(event.from);
      if (this.#revisions.has(event.into)) raise(event.into, event.revision);
    }
  }

  /**
   * A new stream begins, whose server has only these objects. Returns the removals of the others.
   * @param {Set<number>} existing
   * @returns {import('./events.mjs').ObjectRemoved[]}
   */
  keepOnly(existing) {
    const gone = [...this.#revisions].filter(([id]) => !existing.has(id));
    for (const [id] of gone) this.#revisions.delete(id);
    const reason = 'removed while the connection was broken';
    return gone.map(([id, revision]) => ({type: 'removed', id, revision: revision + 1, reason}));
  }
}
