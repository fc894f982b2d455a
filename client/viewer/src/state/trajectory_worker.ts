// Fetches and parses the trajectory apart from the page: for an hour of video it has tens of megabytes.
import * as json from '../api/json';
import type { PathPose } from './path_store';

export interface TrajectoryRequest { url: string; headers: Record<string, string>; maxPoses: number }
export type TrajectoryAnswer = { poses: PathPose[]; seconds: number } | { error: string };

async function load(request: TrajectoryRequest): Promise<TrajectoryAnswer> {
  const start = performance.now();
  const response = await fetch(request.url, { headers: request.headers, credentials: 'omit' });
  if (!response.ok) return { error: `status ${response.status}` };
  const points = (await response.json()) as unknown;
  if (!Array.isArray(points)) return { error: 'not a list' };
  const stride = Math.max(1, Math.ceil(points.length / request.maxPoses));
  const poses: PathPose[] = [];
  let previousId = -1n;
  points.forEach((point: { frame?: unknown } | null, n) => {
    const ack = json.frameAck(point?.frame);
    const frameId = BigInt(ack.frameId);
    const isAfterGap = ack.state === 'RELOCALIZED' && previousId >= 0n;
    previousId = frameId;
    if (!ack.tWorldCamera || (n % stride !== 0 && n !== points.length - 1 && !isAfterGap)) return;
    poses.push({ frameId: ack.frameId, pose: ack.tWorldCamera, state: ack.state, mapId: ack.mapId, isAfterGap });
  });
  return { poses, seconds: (performance.now() - start) / 1000 };
}

self.onmessage = (message: MessageEvent<TrajectoryRequest>) => {
  load(message.data)
    .catch((error: unknown): TrajectoryAnswer => ({ error: String(error) }))
    .then((answer) => self.postMessage(answer));
};
