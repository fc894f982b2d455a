// The events of a session and the parts of a map. Ids are numbers, times are bigint nanoseconds, lengths are in the unit
// of the poses. Words such as 'tracking' are the enum values of mapping.proto in lower case without their prefix.

import {cameraFromProto} from './frame.mjs';
import {poseFromProto, quaternionFromProto, vectorFromProto} from './geometry.mjs';

/** @typedef {import('./geometry.mjs').Pose} Pose */

/**
 * The result of one frame.
 * @typedef {object} FrameAck
 * @property {'frameAck'} type
 * @property {number} frameId
 * @property {boolean} accepted
 * @property {string} error why it was rejected
 * @property {string} state of the camera: 'initializing', 'tracking', 'lost' or 'relocalized'
 * @property {string} stateReason
 * @property {Pose | null} pose camera to world; null: not tracked
 * @property {[number, number, number, number] | null} rotation while only the rotation is known
 * @property {number | null} positionSigma standard deviation; null: not known
 * @property {number | null} rotationSigmaRad
 * @property {boolean} isKeyframe
 * @property {number} latencyS
 * @property {number} mapId
 * @property {boolean} duplicate the session had accepted it before
 */
/**
 * The result of masks that were sent after their frame.
 * @typedef {object} MasksAck
 * @property {'masksAck'} type
 * @property {number} frameId
 * @property {boolean} accepted
 * @property {string} error
 * @property {boolean} duplicate
 */
/**
 * @typedef {object} Cuboid
 * @property {Pose} pose object to world; the z axis of the object is up
 * @property {[number, number, number]} halfExtents along the axes of the object
 * @property {number} confidence 0..1
 */
/**
 * @typedef {object} ObjectUpdate
 * @property {'object'} type
 * @property {number} id
 * @property {number} revision
 * @property {string} state 'provisional', 'confirmed' or 'lost'
 * @property {string} className
 * @property {number} classScore
 * @property {Cuboid} cuboid
 * @property {number} observations
 * @property {Pose | null} meshPose of the newest mesh in the world
 * @property {number} meshScale p_world = meshPose * (meshScale * vertex)
 * @property {number} mapId
 */
/**
 * @typedef {object} MeshLevel a simpler version of a final mesh
 * @property {Uint8Array} draco
 * @property {number} triangleCount
 * @property {number} error about the largest distance from the mesh
 */
/**
 * @typedef {object} MeshUpdate
 * @property {'mesh'} type
 * @property {number} id of the object
 * @property {number} revision
 * @property {number} steps
 * @property {number} trainSeconds
 * @property {boolean} isFinal
 * @property {number} vertexCount
 * @property {number} triangleCount
 * @property {Uint8Array} draco see decodeMesh()
 * @property {Uint8Array} texture a PNG or JPEG file; empty: colors only
 * @property {string} textureMediaType
 * @property {MeshLevel[]} levels
 * @property {{direction: [number, number, number], gain: number} | null} nextView
 */
/** @typedef {{type: 'removed', id: number, revision: number, reason: string}} ObjectRemoved */
/** @typedef {{type: 'merged', from: number, into: number, revision: number}} ObjectMerged */
/**
 * @typedef {object} Diagnostic
 * @property {'diagnostic'} type
 * @property {string} code
 * @property {string} text
 * @property {string} severity 'info', 'warning' or 'error'
 * @property {number} firstFrameId
 * @property {number} count
 * @property {string} advice
 */
/**
 * @typedef {object} Statistics
 * @property {'statistics'} type
 * @property {number} framesReceived
 * @property {number} framesProcessed
 * @property {number} framesDropped
 * @property {number} framesRejected
 * @property {number} keyframes
 * @property {number} mapPoints
 * @property {number} objects
 * @property {number} objectsTraining
 * @property {number} trainingSteps
 * @property {number} trainingProgress
 * @property {number} residentBytes
 * @property {Diagnostic[]} diagnostics
 */
/** @typedef {{type: 'durable', frameId: number, masksFrameId: number}} Durable inputs that survive a crash */
/**
 * @typedef {FrameAck | MasksAck | ObjectUpdate | MeshUpdate | ObjectRemoved | ObjectMerged | Statistics | Diagnostic
 *   | Durable} MapEvent
 */
/**
 * @typedef {object} SessionInfo
 * @property {string} id
 * @property {string} name
 * @property {import('./frame.mjs').Camera} camera
 * @property {string} mode 'replay' or 'live'
 * @property {string} state 'open', 'finishing', 'finished', 'failed' or 'restoring'
 * @property {bigint} createdUnixNs
 * @property {boolean} streamOpen
 * @property {Statistics} statistics
 * @property {boolean} durable
 * @property {boolean} pinned
 * @property {number} storedBytes
 * @property {string} tenant
 */
/** @typedef {{object: ObjectUpdate, mesh: MeshUpdate | null}} MapObject */
/**
 * An exported map.
 * @typedef {object} RomapMap
 * @property {string} sessionId
 * @property {string} state
 * @property {Statistics} statistics
 * @property {MapObject[]} objects confirmed and lost ones, by id
 * @property {{timestampNs: bigint, frame: FrameAck}[]} trajectory by frame id
 */

class UnknownValue extends Error {}

/**
 * Throws UnknownValue for a value that this release does not know, which proto-loader leaves as a number.
 * @param {string} prefix
 * @param {unknown} value
 */
export function word(prefix, value) {
  if (typeof value !== 'string') throw new UnknownValue();
  return value.slice(prefix.length + 1).toLowerCase();
}

/**
 * @param {any} p
 * @returns {FrameAck}
 */
export function frameAck(p) {
  return {
    type: 'frameAck',
    frameId: Number(p.frameId),
    accepted: p.accepted,
    error: p.error,
    state: word('TRACKING_STATE', p.state),
    stateReason: p.stateReason,
    pose: poseFromProto(p.tWorldCamera),
    rotation: p.rotationWorldCamera && quaternionFromProto(p.rotationWorldCamera),
    positionSigma: p.uncertainty?.positionSigma ?? null,
    rotationSigmaRad: p.uncertainty?.rotationSigmaRad ?? null,
    isKeyframe: p.isKeyframe,
    latencyS: p.latencyS,
    mapId: Number(p.mapId),
    duplicate: p.duplicate,
  };
}

/**
 * @param {any} p
 * @returns {ObjectUpdate}
 */
export function objectUpdate(p) {
  const pose = poseFromProto(p.cuboid?.tWorldObject);
  if (!pose) throw new UnknownValue();
  return {
    type: 'object',
    id: Number(p.id),
    revision: Number(p.revision),
    state: word('OBJECT_STATE', p.state),
    className: p.className,
    classScore: p.classScore,
    cuboid: {pose, halfExtents: vectorFromProto(p.cuboid.halfExtents), confidence: p.cuboid.confidence},
    observations: Number(p.observations),
    meshPose: poseFromProto(p.tWorldMesh),
    meshScale: p.meshScale || 1,
    mapId: Number(p.mapId),
  };
}

/**
 * @param {any} p
 * @returns {MeshUpdate}
 */
export function meshUpdate(p) {
  return {
    type: 'mesh',
    id: Number(p.id),
    revision: Number(p.revision),
    steps: Number(p.steps),
    trainSeconds: p.trainSeconds,
    isFinal: p.isFinal,
    vertexCount: p.vertexCount,
    triangleCount: p.triangleCount,
    draco: p.draco,
    texture: p.texture,
    textureMediaType: p.textureMediaType,
    levels: p.levels.map((/** @type {any} */ level) => ({
      draco: level.draco,
      triangleCount: level.triangleCount,
      error: level.errorMu,
    })),
    nextView: p.nextView && {direction: vectorFromProto(p.nextView.direction), gain: p.nextView.gain},
  };
}

/**
 * @param {any} p
 * @returns {Diagnostic}
 */
export function diagnostic(p) {
  const severity = word('SEVERITY', p.severity);
  return {
    type: 'diagnostic',
    code: p.code,
    text: p.text,
    severity: severity === 'unspecified' ? 'warning' : severity,
    firstFrameId: Number(p.firstFrameId),
    count: Number(p.count),
    advice: p.advice,
  };
}

/**
 * @param {any} p
 * @returns {Statistics}
 */
export function statistics(p) {
  return {
    type: 'statistics',
    framesReceived: Number(p?.framesReceived),
    framesProcessed: Number(p?.framesProcessed),
    framesDropped: Number(p?.framesDropped),
    framesRejected: Number(p?.framesRejected),
    keyframes: Number(p?.keyframes),
    mapPoints: Number(p?.mapPoints),
    objects: Number(p?.objects),
    objectsTraining: Number(p?.objectsTraining),
    trainingSteps: Number(p?.trainingSteps),
    trainingProgress: p?.trainingProgress,
    residentBytes: Number(p?.residentBytes),
    diagnostics: (p?.diagnostics ?? []).map(diagnostic),
  };
}

/** @type {Record<string, (p: any) => MapEvent>} */
const READERS = {
  frameAck,
  object: objectUpdate,
  mesh: meshUpdate,
  diagnostic,
  statistics,
  masksAck: (p) => ({
    type: 'masksAck',
    frameId: Number(p.frameId),
    accepted: p.accepted,
    error: p.error,
    duplicate: p.duplicate,
  }),
  removed: (p) => ({type: 'removed', id: Number(p.id), revision: Number(p.revision), reason: p.reason}),
  merged: (p) => ({type: 'merged', from: Number(p.from), into: Number(p.into), revision: Number(p.revision)}),
  durable: (p) => ({type: 'durable', frameId: Number(p.frameId), masksFrameId: Number(p.masksFrameId)}),
};

/**
 * null: of a kind, or with an enum value, that this release does not know; such events are ignored.
 * @param {any} p MapEvent
 * @returns {MapEvent | null}
 */
export function eventFromProto(p) {
  const read = READERS[p?.event];
  if (!read) return null;
  try {
    return read(p[p.event]);
  } catch (error) {
    if (error instanceof UnknownValue) return null;
    throw error;
  }
}

/**
 * @param {any} p
 * @returns {SessionInfo}
 */
export function sessionInfo(p) {
  return {
    id: p.id,
    name: p.name,
    camera: cameraFromProto(p.camera),
    mode: p.mode === 'FRAME_MODE_LIVE' ? 'live' : 'replay',
    state: word('SESSION_STATE', p.state),
    createdUnixNs: BigInt(p.createdUnixNs),
    streamOpen: p.streamOpen,
    statistics: statistics(p.statistics),
    durable: p.durable,
    pinned: p.pinned,
    storedBytes: Number(p.storedBytes),
    tenant: p.tenant,
  };
}
