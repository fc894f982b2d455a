// Reads Protobuf's JSON mapping. A field that is absent or of a wrong type has its default; a geometric value that is
// not finite makes the message unusable, and the reader returns null.
import type {
  CameraModel, Cuboid, Diagnostic, FrameAck, MapEvent, MeshLevel, MeshUpdate, NextView, ObjectState, ObjectUpdate, Quat,
  Rigid, SessionInfo, SessionState, Severity, Statistics, StreamOpened, TrackingState, Vec3,
} from './types';

type Json = Record<string, unknown>;

const asObject = (value: unknown): Json | null =>
  typeof value === 'object' && value !== null && !Array.isArray(value) ? (value as Json) : null;
const asList = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);
const text = (value: unknown): string => (typeof value === 'string' ? value : '');

/** A number; 64-bit integers arrive as strings. `fallback` if it is absent or not finite. */
export function num(value: unknown, fallback = 0): number {
  const n = typeof value === 'string' && value !== '' ? Number(value) : value;
  return typeof n === 'number' && Number.isFinite(n) ? n : fallback;
}

/** A 64-bit id as a decimal string; "0" if it is absent. */
export function id(value: unknown): string {
  if (typeof value === 'number' && Number.isInteger(value) && value >= 0) return String(value);
  return typeof value === 'string' && /^\d{1,20}$/.test(value) ? value : '0';
}

function finite(values: number[]): boolean {
  return values.every(Number.isFinite);
}

export function vec3(value: unknown): Vec3 | null {
  const v = asObject(value);
  if (!v) return null;
  const [x, y, z] = [num(v.x ?? 0, NaN), num(v.y ?? 0, NaN), num(v.z ?? 0, NaN)];
  return finite([x, y, z]) ? { x, y, z } : null;
}

function quat(value: unknown): Quat | null {
  const q = asObject(value);
  if (!q) return null;
  const [x, y, z, w] = [num(q.x ?? 0, NaN), num(q.y ?? 0, NaN), num(q.z ?? 0, NaN), num(q.w ?? 0, NaN)];
  const norm = Math.hypot(x, y, z, w);
  return norm > 0.5 && norm < 2 ? { x: x / norm, y: y / norm, z: z / norm, w: w / norm } : null;
}

export function rigid(value: unknown): Rigid | null {
  const t = asObject(value);
  if (!t) return null;
  const rotation = quat(t.rotation);
  const translation = vec3(t.translation ?? {});
  return rotation && translation ? { rotation, translation } : null;
}

function enumValue<T extends string, F extends string>(
  value: unknown, prefix: string, known: readonly T[], fallback: F): T | F {
  const name = text(value).startsWith(prefix) ? text(value).slice(prefix.length) : '';
  return (known as readonly string[]).includes(name) ? (name as T) : fallback;
}

const trackingState = (value: unknown): TrackingState =>
  enumValue(value, 'TRACKING_STATE_', ['INITIALIZING', 'TRACKING', 'LOST', 'RELOCALIZED'] as const, 'UNKNOWN');
const objectState = (value: unknown): ObjectState =>
  enumValue(value, 'OBJECT_STATE_', ['PROVISIONAL', 'CONFIRMED', 'LOST'] as const, 'UNKNOWN');
const sessionState = (value: unknown): SessionState =>
  enumValue(value, 'SESSION_STATE_', ['OPEN', 'FINISHING', 'FINISHED', 'FAILED', 'RESTORING'] as const,
            'UNKNOWN');
const severity = (value: unknown): Severity =>
  enumValue(value, 'SEVERITY_', ['INFO', 'WARNING', 'ERROR'] as const, 'WARNING');

export function frameAck(value: unknown): FrameAck {
  const a = asObject(value) ?? {};
  const sigma = num(asObject(a.uncertainty)?.positionSigma);
  return {
    frameId: id(a.frameId), accepted: a.accepted === true, error: text(a.error), state: trackingState(a.state),
    tWorldCamera: rigid(a.tWorldCamera), isKeyframe: a.isKeyframe === true, latencyS: num(a.latencyS),
    stateReason: text(a.stateReason), mapId: id(a.mapId), positionSigma: sigma > 0 ? sigma : null,
    duplicate: a.duplicate === true,
  };
}

function cuboid(value: unknown): Cuboid | null {
  const c = asObject(value);
  const tWorldObject = rigid(c?.tWorldObject);
  const halfExtents = vec3(c?.halfExtents);
  if (!c || !tWorldObject || !halfExtents) return null;
  return { tWorldObject, halfExtents, confidence: num(c.confidence) };
}

function objectUpdate(value: unknown): ObjectUpdate | null {
  const o = asObject(value);
  if (!o || id(o.id) === '0') return null;
  const meshScale = num(o.meshScale);
  return {
    id: id(o.id), revision: num(o.revision), state: objectState(o.state), className: text(o.className) || 'object',
    classScore: num(o.classScore), cuboid: cuboid(o.cuboid), observations: num(o.observations),
    tWorldMesh: rigid(o.tWorldMesh), meshScale: meshScale > 0 ? meshScale : 1, mapId: id(o.mapId),
  };
}

function nextView(value: unknown): NextView | null {
  const n = asObject(value);
  const direction = vec3(n?.direction);
  if (!n || !direction) return null;
  const length = Math.hypot(direction.x, direction.y, direction.z);
  if (!(length > 0.1)) return null;
  return {
    direction: { x: direction.x / length, y: direction.y / length, z: direction.z / length }, gain: num(n.gain),
  };
}

/** `bytes`: the sizes of the bytes fields, which are sent apart. */
function meshUpdate(value: unknown, bytes: unknown): MeshUpdate | null {
  const m = asObject(value);
  const sizes = asObject(bytes) ?? {};
  if (!m || id(m.id) === '0') return null;
  const levelBytes = asList(sizes.levels);
  const levels: MeshLevel[] = asList(m.levels).map((level, n) => {
    const l = asObject(level) ?? {};
    return { bytes: num(levelBytes[n]), triangleCount: num(l.triangleCount), errorMu: num(l.errorMu) };
  });
  return {
    id: id(m.id), revision: num(m.revision), steps: num(m.steps), trainSeconds: num(m.trainSeconds),
    isFinal: m.isFinal === true, vertexCount: num(m.vertexCount), triangleCount: num(m.triangleCount),
    bytes: num(sizes.draco), textureBytes: num(sizes.texture), levels, nextView: nextView(m.nextView),
  };
}

function diagnostic(value: unknown): Diagnostic | null {
  const d = asObject(value);
  if (!d || text(d.code) === '') return null;
  return {
    code: text(d.code), text: text(d.text), severity: severity(d.severity), firstFrameId: id(d.firstFrameId),
    count: num(d.count), advice: text(d.advice),
  };
}

export function statistics(value: unknown): Statistics {
  const s = asObject(value) ?? {};
  return {
    framesReceived: num(s.framesReceived), framesProcessed: num(s.framesProcessed),
    framesDropped: num(s.framesDropped), framesRejected: num(s.framesRejected), keyframes: num(s.keyframes),
    mapPoints: num(s.mapPoints), objects: num(s.objects), objectsTraining: num(s.objectsTraining),
    trainingSteps: num(s.trainingSteps), trainingProgress: Math.min(1, Math.max(0, num(s.trainingProgress))),
    residentBytes: num(s.residentBytes),
    diagnostics: asList(s.diagnostics).map(diagnostic).filter((d): d is Diagnostic => d !== null),
  };
}

function cameraModel(value: unknown): CameraModel | null {
  const c = asObject(value);
  if (!c) return null;
  const camera = {
    widthPx: num(c.widthPx), heightPx: num(c.heightPx), fxPx: num(c.fxPx), fyPx: num(c.fyPx), cxPx: num(c.cxPx),
    cyPx: num(c.cyPx),
  };
  return camera.widthPx > 0 && camera.heightPx > 0 && camera.fxPx > 0 && camera.fyPx > 0 ? camera : null;
}

export function sessionInfo(value: unknown): SessionInfo | null {
  const s = asObject(value);
  if (!s || text(s.id) === '') return null;
  return {
    id: text(s.id), name: text(s.name), camera: cameraModel(s.camera), isLive: s.mode === 'FRAME_MODE_LIVE',
    state: sessionState(s.state), createdUnixMs: num(s.createdUnixNs) / 1e6, streamOpen: s.streamOpen === true,
    statistics: statistics(s.statistics), durable: s.durable === true, pinned: s.pinned === true,
    storedBytes: num(s.storedBytes), tenant: text(s.tenant),
  };
}

export function sessionList(value: unknown): SessionInfo[] {
  return asList(asObject(value)?.sessions).map(sessionInfo).filter((s): s is SessionInfo => s !== null);
}

export function streamOpened(value: unknown): StreamOpened {
  const o = asObject(value) ?? {};
  return { sessionId: text(o.sessionId), objectIds: asList(o.objectIds).map(id) };
}

/** Null for events of unknown kind, and for those that are not usable (compatibility rule 3). */
export function mapEvent(value: unknown): MapEvent | null {
  const e = asObject(value);
  if (!e) return null;
  if (e.frameAck) return { kind: 'frameAck', ack: frameAck(e.frameAck) };
  if (e.object) {
    const object = objectUpdate(e.object);
    return object && object.state !== 'UNKNOWN' ? { kind: 'object', object } : null;
  }
  if (e.mesh) {
    const mesh = meshUpdate(e.mesh, e.bytes);
    return mesh && { kind: 'mesh', mesh };
  }
  const removed = asObject(e.removed);
  if (removed) {
    return { kind: 'removed', id: id(removed.id), revision: num(removed.revision), reason: text(removed.reason) };
  }
  const merged = asObject(e.merged);
  if (merged) {
    return { kind: 'merged', from: id(merged.from), into: id(merged.into), revision: num(merged.revision) };
  }
  if (e.statistics) return { kind: 'statistics', statistics: statistics(e.statistics) };
  if (e.diagnostic) {
    const d = diagnostic(e.diagnostic);
    return d && { kind: 'diagnostic', diagnostic: d };
  }
  return null;
}
