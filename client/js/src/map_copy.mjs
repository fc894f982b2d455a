// A copy of the server's map that follows the events of a session.

/** @typedef {import('./events.mjs').MapObject} MapObject */

/** Apply all events of a stream in order; then `objects` equals the server's map, including provisional objects. */
export class MapCopy {
  /** @type {Map<number, MapObject>} */
  objects = new Map();

  /**
   * Ignores events that do not concern objects, and cuboids and meshes that are older than the ones it has.
   * @param {import('./events.mjs').MapEvent} event
   */
  apply(event) {
    if (event.type === 'object') {
      const known = this.objects.get(event.id);
      if (known && event.revision < known.object.revision) return;
      this.objects.set(event.id, {object: event, mesh: known?.mesh ?? null});
    } else if (event.type === 'mesh') {
      const known = this.objects.get(event.id);
      if (known && event.revision >= (known.mesh?.revision ?? 0)) this.objects.set(event.id, {...known, mesh: event});
    } else if (event.type === 'removed') {
      this.objects.delete(event.id);
    } else if (event.type === 'merged') {
      this.objects.delete(event.from);
      const into = this.objects.get(event.into);
      if (!into) return;
      const revision = Math.max(into.object.revision, event.revision);
      this.objects.set(event.into, {...into, object: {...into.object, revision}});
    }
  }
}
