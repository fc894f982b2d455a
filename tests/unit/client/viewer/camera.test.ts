import assert from 'node:assert/strict';
import { test } from 'node:test';
import { ApiClient, ApiError } from 'viewer/api/client';
import type { CameraModel, Cuboid, FrameAck } from 'viewer/api/types';
import { makeCamera, sentSize } from 'viewer/camera/camera_model';
import { projectCuboid, projectTop } from 'viewer/camera/projection';
import { SendRate } from 'viewer/camera/send_rate';
import { Sender } from 'viewer/camera/sender';
import { coaching } from 'viewer/state/coaching';
import { identity } from './helpers';

test('the guessed focal length has a field of view of 60 degrees', () => {
  const camera = makeCamera(640, 480, null);
  assert.ok(Math.abs(2 * Math.atan(320 / camera.fxPx) * 180 / Math.PI - 60) < 1e-9);
  assert.equal(camera.fxPx, camera.fyPx);
  assert.equal(camera.cxPx, 319.5);
  assert.equal(makeCamera(640, 480, 500).fxPx, 500);
});

test('pictures are sent with at most 640 pixels and even sizes', () => {
  assert.deepEqual(sentSize(1280, 720), { widthPx: 640, heightPx: 360 });
  assert.deepEqual(sentSize(720, 1280), { widthPx: 360, heightPx: 640 });
  assert.deepEqual(sentSize(321, 241), { widthPx: 322, heightPx: 242 });
});

test('long round trips lower rate and quality, short ones raise them again', () => {
  const rate = new SendRate();
  const gap = rate.gapMs();
  for (let n = 0; n < 30; ++n) rate.noteRoundTrip(1000);
  assert.ok(rate.gapMs() > 10 * gap);
  assert.equal(rate.quality, 0.45);
  for (let n = 0; n < 60; ++n) rate.noteRoundTrip(30);
  assert.ok(rate.gapMs() < 1.01 * gap);
  assert.ok(rate.quality > 0.8);
});

const camera: CameraModel = { widthPx: 640, heightPx: 480, fxPx: 500, fyPx: 500, cxPx: 320, cyPx: 240 };
const box = (z: number, h: number): Cuboid => ({ tWorldObject: { ...identity, translation: { x: 0, y: 0, z } }, halfExtents: { x: h, y: h, z: h }, confidence: 1 });

test('a cuboid before the camera has twelve edges around its center', () => {
  const segments = projectCuboid(box(5, 1), identity, camera);
  assert.equal(segments.length, 12);
  const xs = segments.flatMap(([a, , b]) => [a, b]);
  assert.ok(Math.abs(Math.max(...xs) - (320 + 500 / 4)) < 1e-9);
  assert.ok(Math.abs(Math.min(...xs) - (320 - 500 / 4)) < 1e-9);
  const top = projectTop(box(5, 1), identity, camera)!;
  assert.ok(Math.abs(top[0] - 320) < 1e-9);
});

test('edges behind the camera are cut off, and a cuboid behind it is not drawn', () => {
  assert.deepEqual(projectCuboid(box(-5, 1), identity, camera), []);
  assert.equal(projectTop(box(-5, 1), identity, camera), null);
  const around = projectCuboid(box(0, 1), identity, camera);
  assert.equal(around.length, 8);  // the four edges at the back are gone
  assert.ok(around.flat().every(Number.isFinite));
});

test('coaching fits the reason of the server', () => {
  assert.match(coaching('INITIALIZING', 'too little parallax: median feature motion 2.0 px, 12.0 px needed').text, /sideways/);
  assert.match(coaching('INITIALIZING', 'too little texture: 12 features, 100 needed').text, /detail/);
  assert.match(coaching('LOST', 'too few map points matched').text, /seen before/);
  assert.equal(coaching('TRACKING', '').level, 'good');
  assert.ok(coaching('LOST', 'a reason of a newer server').text.length > 10);
});

/** A server that answers by hand. */
class SlowApi extends ApiClient {
  open: ((ack: FrameAck) => void)[] = [];
  times: bigint[] = [];
  ids: number[] = [];
  override sendFrame(_: string, frameId: number, timestampNs: bigint): Promise<FrameAck> {
    this.ids.push(frameId);
    this.times.push(timestampNs);
    return new Promise((resolve) => this.open.push(resolve));
  }
}

async function until(what: string, done: () => boolean): Promise<void> {
  for (const start = Date.now(); !done();) {
    if (Date.now() - start > 10000) throw new Error(`waited 10 s for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 5));
  }
}

test('one request is in flight, and frames have increasing ids and times', async () => {
  const api = new SlowApi();
  let pictures = 0;
  const sender = new Sender(api, 's', {
    picture: async () => (++pictures, new Blob(['x'])), ack: () => undefined, trouble: () => undefined, ended: assert.fail,
  });
  sender.start();
  for (let n = 1; n <= 4; ++n) {
    await until(`request ${n}`, () => api.open.length === n);
    await new Promise((resolve) => setTimeout(resolve, 100));
    assert.equal(api.open.length, n);
    assert.equal(pictures, n);  // no picture waits
    api.open[n - 1]!({} as FrameAck);
  }
  sender.stop();
  assert.deepEqual(api.ids, [1, 2, 3, 4]);
  assert.ok(api.times.every((t, n) => n === 0 || t > api.times[n - 1]!));
});

test('a lost link is reported and tried again, a refused session is final', async () => {
  const answers: (ApiError | null)[] = [new ApiError(0, 'UNAVAILABLE', ''), null, new ApiError(409, 'FAILED_PRECONDITION', 'finished')];
  class FaultyApi extends ApiClient {
    override async sendFrame(): Promise<FrameAck> {
      const answer = answers.shift();
      if (answer) throw answer;
      return {} as FrameAck;
    }
  }
  const troubles: string[] = [];
  let ended: ApiError | null = null;
  const sender = new Sender(new FaultyApi(), 's', {
    picture: async () => new Blob(['x']), ack: () => undefined, trouble: (t) => troubles.push(t), ended: (e) => (ended = e),
  });
  sender.start();
  await until('the end', () => ended !== null);
  assert.deepEqual(troubles, ['Link lost, retrying', '']);
  assert.equal((ended as ApiError | null)?.status, 409);
});
