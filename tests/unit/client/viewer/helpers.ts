import { mapEvent } from 'viewer/api/json';
import type { MapEvent, Rigid } from 'viewer/api/types';

export const identity: Rigid = { rotation: { x: 0, y: 0, z: 0, w: 1 }, translation: { x: 0, y: 0, z: 0 } };

export function at(x: number, y: number, z: number): Rigid {
  return { rotation: identity.rotation, translation: { x, y, z } };
}

/** An event as it comes from the server. */
export function event(value: object): MapEvent {
  const parsed = mapEvent(value);
  if (!parsed) throw new Error(`not an event: ${JSON.stringify(value)}`);
  return parsed;
}

export const object = (id: number, revision: number, values: object = {}): MapEvent => event({
  object: { id: String(id), revision: String(revision), state: 'OBJECT_STATE_CONFIRMED', className: 'cup', mapId: '1',
            cuboid: { tWorldObject: identity, halfExtents: { x: 1, y: 1, z: 1 }, confidence: 0.5 }, ...values },
});

export const mesh = (id: number, revision: number, values: object = {}): MapEvent => event({
  mesh: { id: String(id), revision: String(revision), steps: '100', trainSeconds: 1, ...values }, bytes: { draco: 10, texture: 0, levels: [] },
});

export const ack = (frameId: number | string, pose: Rigid | null, values: object = {}): MapEvent => event({
  frameAck: { frameId: String(frameId), accepted: true, state: 'TRACKING_STATE_TRACKING', mapId: pose ? '1' : '0',
              ...(pose ? { tWorldCamera: pose } : {}), ...values },
});
