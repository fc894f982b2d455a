// The camera page with the camera of the test browser, which shows a moving picture.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { openPage, until } from './support/browser.mjs';
import { ack, objectUpdate, stripesPng } from './support/draco_scene.mjs';
import { MockServer } from './support/mock_server.mjs';
import { distDir } from './support/viewer_modules.mjs';

const kGl = ['--disable-gpu', '--enable-unsafe-swiftshader'];
const kCamera = [...kGl, '--use-fake-device-for-media-stream', '--use-fake-ui-for-media-stream'];

async function serve(t) {
  const server = new MockServer(distDir);
  await server.start();
  t.after(() => server.stop());
  return server;
}

async function start(t, server, options = {}) {
  const page = await openPage(t, `${server.url}camera`, { flags: kCamera, permissions: ['camera'], ...options });
  await page.getByLabel('Name of the session').fill('My desk');
  await page.getByRole('button', { name: 'Start mapping' }).click();
  return page;
}

test('pictures are sent one at a time, the state is shown, cuboids are drawn, and it finishes', async (t) => {
  const server = await serve(t);
  const replies = [{ accepted: true, state: 'TRACKING_STATE_INITIALIZING', stateReason: 'too little parallax: median feature motion 1.0 px, 12.0 px needed' }];
  server.onFrame = (n) => replies[0] ?? ack(n, { x: 0, y: -1, z: 0 });
  const page = await start(t, server);
  await page.getByText('Move sideways').waitFor();
  await page.picture('camera_starting');
  const session = [...server.sessions.values()][0];
  session.setFile('frame.jpg', stripesPng(64), 'image/png');
  assert.equal(session.info.name, 'My desk');
  assert.equal(session.info.mode, 'FRAME_MODE_LIVE');
  assert.equal(session.info.poseUse, 'POSE_USE_IGNORE');
  const { widthPx, fxPx } = session.info.camera;
  assert.ok(Math.abs(2 * Math.atan(widthPx / 2 / fxPx) * 180 / Math.PI - 60) < 0.01);
  session.emit({ object: objectUpdate(1, { half: { x: 0.2, y: 0.2, z: 0.2 } }) });
  replies.length = 0;
  await page.getByText('Walk slowly around').waitFor();
  await until(page, 'the cuboid over the picture', () => {
    const canvas = document.querySelector('.camera canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value) => value > 0);
  });
  await page.picture('camera_tracking');
  assert.deepEqual(page.problems, []);
  assert.match(await page.getByRole('link', { name: 'Open in viewer' }).getAttribute('href'), /^\/#session\//);
  await page.getByRole('button', { name: 'Finish' }).click();
  await page.getByText('The camera is off').waitFor();
  assert.equal(session.info.state, 'SESSION_STATE_FINISHING');
  const times = session.frames.map((f) => BigInt(f.timestampNs));
  assert.ok(times.length > 3 && times.every((time, n) => n === 0 || time > times[n - 1]));
  assert.ok(session.frames.every((f, n) => Number(f.frameId) === n + 1 && f.bytes > 1000));
  assert.deepEqual(page.foreign, []);
});

test('a slow server gets fewer and smaller pictures, and never two at a time', async (t) => {
  const server = await serve(t);
  let open = 0;
  let most = 0;
  const handle = server.frame.bind(server);
  server.frame = async (...args) => {
    open += 1;
    most = Math.max(most, open);
    await handle(...args);
    open -= 1;
  };
  const page = await start(t, server);
  await until(page, '10 pictures', () => window.romapCamera.sender?.sent >= 10);
  const before = await page.evaluate(() => ({ gap: window.romapCamera.sender.rate.gapMs(), quality: window.romapCamera.sender.rate.quality }));
  server.frameDelayMs = 800;
  await until(page, '8 more pictures', (sent) => window.romapCamera.sender.sent >= sent + 8, await page.evaluate(() => window.romapCamera.sender.sent), 40000);
  const after = await page.evaluate(() => ({ gap: window.romapCamera.sender.rate.gapMs(), quality: window.romapCamera.sender.rate.quality }));
  assert.ok(after.gap > 1.5 * before.gap, JSON.stringify([before, after]));
  assert.ok(after.quality < 0.8, String(after.quality));
  assert.equal(most, 1);
});

test('a restart of the server is survived', async (t) => {
  const server = await serve(t);
  server.onFrame = (n) => ack(n, { x: 0, y: -1, z: 0 });
  const page = await start(t, server);
  await until(page, '3 pictures', () => window.romapCamera.sender?.sent >= 3);
  await server.stop();
  await page.getByText('Link lost, retrying').waitFor();
  const sent = await page.evaluate(() => window.romapCamera.sender.sent);
  await server.start();
  await until(page, 'more pictures', (n) => window.romapCamera.sender.sent > n + 2, sent);
  await page.getByText('Link lost, retrying').waitFor({ state: 'hidden' });
});

test('a session that ends under the page stops the camera', async (t) => {
  const server = await serve(t);
  const page = await start(t, server);
  await until(page, '3 pictures', () => window.romapCamera.sender?.sent >= 3);
  server.sessions.clear();
  await page.getByText('it was deleted').waitFor();
  assert.equal(await page.evaluate(() => document.querySelector('video').srcObject), null);
});

test('the server asks for a token', async (t) => {
  const server = await serve(t);
  server.token = 'secret';
  const page = await start(t, server);
  await page.getByLabel('Token', { exact: true }).fill('secret');
  await page.getByRole('button', { name: 'Use token' }).click();
  await until(page, 'a picture', () => window.romapCamera.sender?.sent >= 1);
});

test('a refused camera says what to do', async (t) => {
  const server = await serve(t);
  const page = await openPage(t, `${server.url}camera`, { flags: [...kGl, '--use-fake-device-for-media-stream', '--deny-permission-prompts'] });
  await page.getByRole('button', { name: 'Start mapping' }).click();
  await page.getByText('The camera was refused').waitFor();
  await page.picture('camera_refused');
  assert.equal(server.sessions.size, 0);
});

test('a device without a camera says so', async (t) => {
  const server = await serve(t);
  const page = await openPage(t, `${server.url}camera`, { flags: [...kGl, '--use-fake-ui-for-media-stream', '--use-fake-device-for-media-stream=device-count=0'], permissions: ['camera'] });
  await page.getByRole('button', { name: 'Start mapping' }).click();
  await page.getByText('This device has no camera').waitFor();
});

test('a page that is not in a secure context says why it has no camera', async (t) => {
  const server = await serve(t);
  // The name is not "localhost", so the browser treats it as a foreign host.
  const page = await openPage(t, `${server.url.replace('127.0.0.1', 'map.example')}camera`, { flags: [...kCamera, '--host-resolver-rules=MAP map.example 127.0.0.1'] });
  await page.getByRole('button', { name: 'Start mapping' }).click();
  await page.getByText('only to pages that were opened over HTTPS').waitFor();
});

test('a wrong focal length is refused before anything begins', async (t) => {
  const server = await serve(t);
  const page = await openPage(t, `${server.url}camera`, { flags: kCamera, permissions: ['camera'], viewport: { width: 390, height: 780 } });
  await page.getByText('Camera settings').click();
  await page.getByLabel('Focal length').fill('3');
  await page.getByRole('button', { name: 'Start mapping' }).click();
  await page.getByText('must be a number of pixels').waitFor();
  await page.picture('camera_phone');
  assert.equal(server.sessions.size, 0);
});
