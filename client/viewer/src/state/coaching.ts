// What the person with the camera should do, from the state of tracking and the server's reason for it.
import type { TrackingState } from '../api/types';

export interface Coaching { title: string; text: string; level: 'good' | 'wait' | 'bad' }

const kInitializing: [RegExp, string][] = [
  [/too little texture/, 'Point the camera at something with more detail, and make sure that there is enough light.'],
  [/too few features/, 'Too fast. Start again at one place and move slowly.'],
  [/parallax|second view/, 'Move sideways, as if you walked around the objects. Do not only turn the camera.'],
  [/initializ/, 'Keep moving slowly sideways.'],
];

const kLost: [RegExp, string][] = [
  [/too little texture/, 'Too little detail is in view. Point the camera back at the objects.'],
  [/too few map points|match/, 'Go back to a place that was seen before, and hold the camera still for a moment.'],
];

function find(table: [RegExp, string][], reason: string, fallback: string): string {
  return table.find(([pattern]) => pattern.test(reason))?.[1] ?? fallback;
}

export function coaching(state: TrackingState, reason: string): Coaching {
  switch (state) {
    case 'TRACKING':
      return { title: 'Tracking', text: 'Walk slowly around the objects and show them from all sides.', level: 'good' };
    case 'RELOCALIZED':
      return { title: 'Place recognized', text: 'Tracking continues. Move on slowly.', level: 'good' };
    case 'INITIALIZING':
      return {
        title: 'Starting', level: 'wait',
        text: find(kInitializing, reason, 'Move slowly sideways, so that the objects are seen from two places.'),
      };
    case 'LOST':
      return {
        title: 'Lost', level: 'bad', text: find(kLost, reason, 'Go back slowly to a place that was seen before.'),
      };
    case 'UNKNOWN':
      return { title: 'Waiting', text: 'Waiting for the first picture to be processed.', level: 'wait' };
  }
}
