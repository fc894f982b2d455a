// Arrows from where the camera would see most of what it has not observed yet to the object.
import { ArrowHelper, Group, Vector3 } from 'three';
import type { MapObject } from '../state/map_store';
import { rotate } from '../state/geometry';
import { toVector3 } from './convert';

const kMinGain = 0.02;

/** In the world, from the object to the camera; null if no view would add much. */
export function nextViewDirection(object: MapObject): Vector3 | null {
  const next = object.mesh?.nextView;
  const pose = object.update.tWorldMesh;
  if (!next || !pose || next.gain < kMinGain) return null;
  return toVector3(rotate(pose.rotation, next.direction));
}

export class NextViewArrows {
  readonly group = new Group();

  /** Returns the tails of the arrows. */
  set(objects: readonly MapObject[], color: string): Map<string, Vector3> {
    for (const child of [...this.group.children]) {
      (child as ArrowHelper).dispose();
      this.group.remove(child);
    }
    const tails = new Map<string, Vector3>();
    for (const object of objects) {
      const direction = nextViewDirection(object);
      const cuboid = object.update.cuboid;
      if (!direction || !cuboid) continue;
      const { x, y, z } = cuboid.halfExtents;
      const radius = Math.hypot(x, y, z);
      const tail = toVector3(cuboid.tWorldObject.translation).addScaledVector(direction, 2.6 * radius);
      const length = 1.5 * radius;
      this.group.add(new ArrowHelper(direction.clone().negate(), tail, length, color, 0.32 * length, 0.18 * length));
      tails.set(object.update.id, tail);
    }
    return tails;
  }
}
