// The messages of romap.v1 as the viewer uses them, read from Protobuf's JSON mapping. Units and frames are those of
// mapping.proto. Ids are decimal strings, because they may exceed 2^53.

export interface Vec3 { x: number; y: number; z: number }
export interface Quat { x: number; y: number; z: number; w: number }
export interface Rigid { rotation: Quat; translation: Vec3 }

export interface CameraModel {
  widthPx: number; heightPx: number;
  fxPx: number; fyPx: number; cxPx: number; cyPx: number;
}

export type SessionState = 'OPEN' | 'FINISHING' | 'FINISHED' | 'FAILED' | 'RESTORING' | 'UNKNOWN';
export type TrackingState = 'INITIALIZING' | 'TRACKING' | 'LOST' | 'RELOCALIZED' | 'UNKNOWN';
export type ObjectState = 'PROVISIONAL' | 'CONFIRMED' | 'LOST' | 'UNKNOWN';
export type Severity = 'INFO' | 'WARNING' | 'ERROR';

export interface Diagnostic {
  code: string; text: string; severity: Severity; firstFrameId: string; count: number; advice: string;
}

export interface Statistics {
  framesReceived: number; framesProcessed: number; framesDropped: number; framesRejected: number;
  keyframes: number; mapPoints: number; objects: number; objectsTraining: number;
  trainingSteps: number; trainingProgress: number; residentBytes: number;
  diagnostics: Diagnostic[];
}

export interface SessionInfo {
  id: string; name: string; camera: CameraModel | null; isLive: boolean; state: SessionState;
  createdUnixMs: number; streamOpen: boolean; statistics: Statistics; durable: boolean; pinned: boolean;
  storedBytes: number; tenant: string;
}

export interface ServerInfo { version: string; needsToken: boolean; maxMessageBytes: number }

export interface FrameAck {
  frameId: string; accepted: boolean; error: string; state: TrackingState; tWorldCamera: Rigid | null;
  isKeyframe: boolean; latencyS: number; stateReason: string; mapId: string; positionSigma: number | null;
  duplicate: boolean;
}

export interface Cuboid { tWorldObject: Rigid; halfExtents: Vec3; confidence: number }

export interface ObjectUpdate {
  id: string; revision: number; state: ObjectState; className: string; classScore: number; cuboid: Cuboid | null;
  observations: number; tWorldMesh: Rigid | null; meshScale: number; mapId: string;
}

export interface MeshLevel { bytes: number; triangleCount: number; errorMu: number }
export interface NextView { direction: Vec3; gain: number }

export interface MeshUpdate {
  id: string; revision: number; steps: number; trainSeconds: number; isFinal: boolean;
  vertexCount: number; triangleCount: number; bytes: number; textureBytes: number; levels: MeshLevel[];
  nextView: NextView | null;
}

export interface StreamOpened { sessionId: string; objectIds: string[] }

export type MapEvent =
  | { kind: 'frameAck'; ack: FrameAck }
  | { kind: 'object'; object: ObjectUpdate }
  | { kind: 'mesh'; mesh: MeshUpdate }
  | { kind: 'removed'; id: string; revision: number; reason: string }
  | { kind: 'merged'; from: string; into: string; revision: number }
  | { kind: 'statistics'; statistics: Statistics }
  | { kind: 'diagnostic'; diagnostic: Diagnostic };
