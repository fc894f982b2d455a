// Client of romap-server: streams images with instance masks, receives a live map of objects.

export {RomapError} from './errors.mjs';
export {labelRuns, labelsFromRuns} from './frame.mjs';
export {poseMatrix, rotate, transform} from './geometry.mjs';
export {MapCopy} from './map_copy.mjs';
export {decodeMesh, worldMesh} from './mesh.mjs';
export {Server, connect} from './server.mjs';
export {Session} from './session.mjs';
export {EventStream} from './stream.mjs';

/** @typedef {import('./events.mjs').FrameAck} FrameAck */
/** @typedef {import('./events.mjs').MapEvent} MapEvent */
/** @typedef {import('./events.mjs').MapObject} MapObject */
/** @typedef {import('./events.mjs').MeshUpdate} MeshUpdate */
/** @typedef {import('./events.mjs').ObjectUpdate} ObjectUpdate */
/** @typedef {import('./events.mjs').RomapMap} RomapMap */
/** @typedef {import('./events.mjs').SessionInfo} SessionInfo */
/** @typedef {import('./frame.mjs').Camera} Camera */
/** @typedef {import('./frame.mjs').Depth} Depth */
/** @typedef {import('./frame.mjs').FrameInput} FrameInput */
/** @typedef {import('./frame.mjs').Instance} Instance */
/** @typedef {import('./frame.mjs').Masks} Masks */
/** @typedef {import('./geometry.mjs').Pose} Pose */
/** @typedef {import('./mesh.mjs').Mesh} Mesh */
/** @typedef {import('./retry.mjs').Retry} Retry */
/** @typedef {import('./rpc.mjs').Tls} Tls */
