// A copy of the map of one session, kept by the rules of mapping.proto (the numbers below are theirs).
import type {
  Diagnostic, FrameAck, MapEvent, MeshUpdate, ObjectUpdate, Statistics, StreamOpened,
} from '../api/types';

export interface StepSample { trainSeconds: number; steps: number }

export interface MapObject {
  update: ObjectUpdate;
  mesh: MeshUpdate | null;
  history: StepSample[];  // of the meshes that arrived here, oldest first
}

export interface Changes {
  objects: Set<string>;  // changed, added or deleted
  hasNewFrame: boolean;
  hasNewStatistics: boolean;
}

const kMaxHistory = 400;

export class MapStore {
  readonly objects = new Map<string, MapObject>();
  statistics: Statistics | null = null;
  lastAck: FrameAck | null = null;
  private reported = new Map<string, Diagnostic>();
  private newestMapId = '0';
  private readonly gone = new Set<string>();
  // The first update of an object on a new stream is its present state, whatever its revision.
  private readonly isOld = { update: new Set<string>(), mesh: new Set<string>() };
  private changes: Changes = { objects: new Set(), hasNewFrame: false, hasNewStatistics: false };

  /** A stream begins (again): objects that it does not list no longer exist (rule 11). */
  open(opened: StreamOpened): void {
    const present = new Set(opened.objectIds);
    this.gone.clear();
    for (const id of [...this.objects.keys()]) {
      if (!present.has(id)) this.erase(id);
    }
    this.isOld.update = new Set(this.objects.keys());
    this.isOld.mesh = new Set(this.objects.keys());
  }

  apply(event: MapEvent): void {
    switch (event.kind) {
      case 'object': return this.applyObject(event.object);
      case 'mesh': return this.applyMesh(event.mesh);
      case 'removed': return this.end(event.id);
      case 'merged': return this.applyMerge(event.from, event.into, event.revision);
      case 'frameAck': return this.applyAck(event.ack);
      case 'statistics': return this.applyStatistics(event.statistics);
      case 'diagnostic':
        this.reported.set(event.diagnostic.code, event.diagnostic);
        this.changes.hasNewStatistics = true;
    }
  }

  applyStatistics(statistics: Statistics): void {
    this.statistics = statistics;
    // These are the present ones; what was reported before and is not among them is over.
    this.reported = new Map(statistics.diagnostics.map((d) => [d.code, d]));
    this.changes.hasNewStatistics = true;
  }

  /** The worst first. */
  diagnostics(): Diagnostic[] {
    const rank = { ERROR: 0, WARNING: 1, INFO: 2 };
    return [...this.reported.values()].sort((a, b) => rank[a.severity] - rank[b.severity] || (a.code < b.code ? -1 : 1));
  }

  /** The map to show: that of the newest pose (rule 10); before the first pose, that of the first object. */
  shownMapId(): string {
    if (this.newestMapId !== '0') return this.newestMapId;
    for (const { update } of this.objects.values()) if (update.mapId !== '0') return update.mapId;
    return '0';
  }

  noteNewestMap(mapId: string): void {
    if (mapId === '0' || mapId === this.newestMapId) return;
    this.newestMapId = mapId;
    for (const id of this.objects.keys()) this.changes.objects.add(id);
  }

  /** All map ids, ascending. */
  mapIds(): string[] {
    const ids = new Set<string>();
    for (const { update } of this.objects.values()) if (update.mapId !== '0') ids.add(update.mapId);
    if (this.newestMapId !== '0') ids.add(this.newestMapId);
    return [...ids].sort((a, b) => Number(a) - Number(b));
  }

  /** What changed since the last call. */
  takeChanges(): Changes {
    const changes = this.changes;
    this.changes = { objects: new Set(), hasNewFrame: false, hasNewStatistics: false };
    return changes;
  }

  private applyObject(update: ObjectUpdate): void {
    if (this.gone.has(update.id)) return;  // rule 9
    const object = this.objects.get(update.id);
    if (!object) {
      this.objects.set(update.id, { update, mesh: null, history: [] });
    } else {
      const isFirstOfStream = this.isOld.update.delete(update.id);
      if (update.revision < object.update.revision && !isFirstOfStream) return;  // rule 5
      object.update = update;
    }
    this.changes.objects.add(update.id);
  }

  private applyMesh(mesh: MeshUpdate): void {
    const object = this.objects.get(mesh.id);
    if (!object) return;  // rule 9: the first event of an object is an ObjectUpdate
    const isFirstOfStream = this.isOld.mesh.delete(mesh.id);
    if (object.mesh && mesh.revision < object.mesh.revision && !isFirstOfStream) return;  // rule 5
    object.mesh = mesh;
    const last = object.history[object.history.length - 1];
    if (!last || last.steps !== mesh.steps) {
      object.history.push({ trainSeconds: mesh.trainSeconds, steps: mesh.steps });
      if (object.history.length > kMaxHistory) object.history = object.history.filter((_, n) => n % 2 === 0);
    }
    this.changes.objects.add(mesh.id);
  }

  private applyMerge(from: string, into: string, revision: number): void {
    this.end(from);
    const object = this.objects.get(into);
    if (!object) return;
    object.update = { ...object.update, revision: Math.max(object.update.revision, revision) };
    this.changes.objects.add(into);
  }

  private applyAck(ack: FrameAck): void {
    if (!ack.accepted || ack.duplicate) return;
    this.lastAck = ack;
    this.changes.hasNewFrame = true;
    if (ack.tWorldCamera) this.noteNewestMap(ack.mapId);
  }

  private end(id: string): void {
    this.erase(id);
    this.gone.add(id);
  }

  private erase(id: string): void {
    if (this.objects.delete(id)) this.changes.objects.add(id);
    this.isOld.update.delete(id);
    this.isOld.mesh.delete(id);
  }
}
