// The camera of the device as the server needs it. Browsers do not tell the focal length.
import type { CameraModel } from '../api/types';

export const kGuessedFovDeg = 60;

/** `fPx`: the focal length if the person gave it; else that of a horizontal field of view of 60 degrees. */
export function makeCamera(widthPx: number, heightPx: number, fPx: number | null): CameraModel {
  const longer = Math.max(widthPx, heightPx);
  const f = fPx ?? longer / 2 / Math.tan((kGuessedFovDeg * Math.PI) / 360);
  return { widthPx, heightPx, fxPx: f, fyPx: f, cxPx: (widthPx - 1) / 2, cyPx: (heightPx - 1) / 2 };
}

/** The size to send: at most `limit` on the longer side, even numbers. */
export function sentSize(width: number, height: number, limit = 640): { widthPx: number; heightPx: number } {
  const scale = Math.min(1, limit / Math.max(width, height));
  const even = (v: number): number => Math.max(16, 2 * Math.round((v * scale) / 2));
  return { widthPx: even(width), heightPx: even(height) };
}
