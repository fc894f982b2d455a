// The camera path: the trajectory as the server corrected it, continued by the acknowledgements since then.
import type { FrameAck, Rigid, TrackingState } from '../api/types';

export interface PathPose {
  frameId: string;
  pose: Rigid;
  state: TrackingState;
  mapId: string;
  isAfterGap: boolean;  // frames before it had no pose
}

const kMaxPoses = 20000;

export class PathStore {
  poses: PathPose[] = [];
  private hasGap = false;

  addAck(ack: FrameAck): void {
    if (!ack.accepted || ack.duplicate) return;
    if (!ack.tWorldCamera) {
      this.hasGap = this.poses.length > 0;
      return;
    }
    this.poses.push({
      frameId: ack.frameId, pose: ack.tWorldCamera, state: ack.state, mapId: ack.mapId, isAfterGap: this.hasGap,
    });
    this.hasGap = false;
    if (this.poses.length > kMaxPoses) this.thin();
  }

  /** `trajectory`: in order of frames. Poses of newer frames are kept. */
  replace(trajectory: PathPose[]): void {
    const last = trajectory[trajectory.length - 1];
    if (!last) return;
    const lastId = BigInt(last.frameId);
    this.poses = trajectory.concat(this.poses.filter((p) => BigInt(p.frameId) > lastId));
    if (this.poses.length > kMaxPoses) this.thin();
  }

  newest(): PathPose | null {
    return this.poses[this.poses.length - 1] ?? null;
  }

  // Every second pose of the older half.
  private thin(): void {
    const half = this.poses.length >> 1;
    this.poses = this.poses.filter((p, n) => n >= half || n % 2 === 0 || p.isAfterGap);
  }
}
