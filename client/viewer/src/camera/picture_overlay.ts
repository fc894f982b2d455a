// Draws the cuboids of the map over the picture of the camera.
import type { CameraModel, FrameAck } from '../api/types';
import type { MapObject } from '../state/map_store';
import { projectCuboid, projectTop } from './projection';

export function drawCuboids(canvas: HTMLCanvasElement, objects: readonly MapObject[], ack: FrameAck | null, camera: CameraModel): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  context.clearRect(0, 0, width, height);
  const pose = ack?.tWorldCamera;
  if (!pose) return;
  // The picture fills the canvas as by `object-fit: contain`.
  const scale = Math.min(width / camera.widthPx, height / camera.heightPx);
  const x0 = (width - scale * camera.widthPx) / 2;
  const y0 = (height - scale * camera.heightPx) / 2;
  const map = ack.mapId;
  context.font = `600 ${13 * ratio}px system-ui, sans-serif`;
  context.textAlign = 'center';
  for (const { update } of objects) {
    if (!update.cuboid || (map !== '0' && update.mapId !== '0' && update.mapId !== map)) continue;
    const color = update.state === 'CONFIRMED' ? '#2dd4bf' : update.state === 'LOST' ? '#fbbf24' : '#cbd5e1';
    context.strokeStyle = color;
    context.lineWidth = 2 * ratio;
    context.beginPath();
    for (const [xa, ya, xb, yb] of projectCuboid(update.cuboid, pose, camera)) {
      context.moveTo(x0 + scale * (xa + 0.5), y0 + scale * (ya + 0.5));
      context.lineTo(x0 + scale * (xb + 0.5), y0 + scale * (yb + 0.5));
    }
    context.stroke();
    const top = projectTop(update.cuboid, pose, camera);
    if (!top) continue;
    context.lineWidth = 4 * ratio;
    context.strokeStyle = '#06101acc';
    context.strokeText(update.className, x0 + scale * top[0], y0 + scale * top[1] - 6 * ratio);
    context.fillStyle = color;
    context.fillText(update.className, x0 + scale * top[0], y0 + scale * top[1] - 6 * ratio);
  }
}
