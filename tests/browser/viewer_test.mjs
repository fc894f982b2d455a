// The page of a session against a server that does what the test needs.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { atRest, objectOnScreen, openPage, until, viewState } from './support/browser.mjs';
import { ack, addMesh, objectUpdate, stripesPng } from './support/draco_scene.mjs';
import { MockServer, statistics } from './support/mock_server.mjs';
import { distDir } from './support/viewer_modules.mjs';

async function serve(t) {
  const server = new MockServer(distDir);
  await server.start();
  t.after(() => server.stop());
  return server;
}

const place = (n) => ({ x: (n % 3) * 0.5, y: Math.floor(n / 3) * 0.5, z: 0.1 });

/** `count` objects with final meshes and a camera path. */
async function fill(session, count) {
  session.setFile('frame.jpg', stripesPng(160), 'image/png');
  for (let n = 0; n < count; ++n) {
    session.emit({ object: objectUpdate(n + 1, { position: place(n), hasMesh: true, className: ['cup', 'book', 'bottle'][n % 3] }) });
    session.emit(await addMesh(session, n + 1, 2, { isFinal: true, nextView: { direction: { x: 0.6, y: -0.8, z: 0 }, gain: 0.3 } }));
  }
  for (let n = 1; n <= 40; ++n) session.emit({ frameAck: ack(n, { x: 0.03 * n, y: -0.8, z: 0.4 }) });
  session.emit({ statistics: statistics({ framesReceived: '40', framesProcessed: '40', objects: String(count), trainingSteps: '5000', trainingProgress: 1 }) });
}

const meshesShown = (count) => [`${count} meshes`, (n) => {
  const session = window.romap.session;
  return session?.scene && [...session.store.objects.keys()].filter((id) => session.scene.objects.mesh(id)?.hasMesh).length === n;
}, count];

test('a live run grows from empty to finished', async (t) => {
  const server = await serve(t);
  const session = server.add('live', { name: 'Kitchen table' });
  session.setFile('frame.jpg', stripesPng(160), 'image/png');
  const page = await openPage(t, `${server.url}#session/live`);
  await page.getByText('Waiting for the first image').first().waitFor();
  session.emit({ frameAck: ack(1, null, { state: 'TRACKING_STATE_INITIALIZING', stateReason: 'too little parallax: 2 px' }) });
  session.emit({ statistics: statistics({ framesReceived: '1', framesProcessed: '1' }) });
  await page.getByText('No objects yet').first().waitFor();
  for (let n = 2; n < 20; ++n) session.emit({ frameAck: ack(n, { x: 0.05 * n - 0.5, y: -0.8, z: 0.3 }) });
  session.points = Buffer.from(new Float32Array([0, 0, 0, 1, 1, 1]).buffer);
  session.emit({ object: objectUpdate(1, { state: 'OBJECT_STATE_PROVISIONAL' }) });
  await page.locator('[data-object="1"][data-state="provisional"]').waitFor();
  session.emit({ object: objectUpdate(1, { revision: '2', hasMesh: true }) });
  session.emit(await addMesh(session, 1, 3, { steps: 300, rings: 12, segments: 16 }));
  await until(page, ...meshesShown(1));
  session.emit(await addMesh(session, 1, 4, { steps: 900 }));
  await until(page, 'the newer mesh', () => window.romap.session.scene.objects.mesh('1').revision === 4);
  session.emit(await addMesh(session, 1, 5, { steps: 2000, isFinal: true }));
  session.emit({ diagnostic: { code: 'up_unknown', text: 'Nothing shows where up is.', severity: 'SEVERITY_WARNING', advice: 'Send gravity.', count: '3' } });
  await page.locator('.object-row .badge', { hasText: 'final' }).waitFor();
  await until(page, 'the texture', () => window.romap.session.scene.objects.mesh('1').hasTexture);
  await page.getByRole('tab', { name: /Session/ }).click();
  await page.getByText('Send gravity.').waitFor();
  session.finish();
  await page.locator('.link-chip', { hasText: 'complete' }).waitFor();
  await page.locator('.top-bar .chip', { hasText: 'finished' }).waitFor();
  await until(page, 'the points', () => window.romap.session.scene.points.count === 2);
  assert.equal((await viewState(page)).poses, 18);
  await page.picture('live_finished');
  assert.deepEqual(page.problems, []);
  assert.deepEqual(page.foreign, []);
});

test('a viewer that joins in the middle gets everything, and draws only when something changes', async (t) => {
  const server = await serve(t);
  await fill(server.add('middle', { name: 'Middle' }), 6);
  const page = await openPage(t, `${server.url}#session/middle`);
  await until(page, ...meshesShown(6));
  await until(page, 'the trajectory', () => window.romap.session.path.poses.length === 40);
  await until(page, 'an idle view', async () => {
    const stage = window.romap.session.scene.stage;
    const before = stage.renders;
    await new Promise((resolve) => setTimeout(resolve, 600));
    return stage.renders === before;
  });
  await page.picture('middle_dark');
  await page.keyboard.press('t');
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), 'light');
  await page.picture('middle_light');
  assert.deepEqual(page.problems, []);
});

test('sessions are listed, and each shows its own map', async (t) => {
  const server = await serve(t);
  await fill(server.add('one', { name: 'First' }), 2);
  await fill(server.add('two', { name: 'Second', state: 'SESSION_STATE_FINISHED' }), 3);
  const page = await openPage(t, server.url);
  await page.locator('.card').nth(1).waitFor();
  await page.picture('sessions');
  await page.locator('[data-session="one"]').click();
  await until(page, ...meshesShown(2));
  await page.getByLabel('All sessions', { exact: true }).click();
  await page.locator('[data-session="two"]').click();
  await until(page, ...meshesShown(3));
  assert.equal(await page.title(), 'Second – romap');
  assert.deepEqual(page.problems, []);
});

test('an object is picked in the view and with keys, and its panel shows its figures', async (t) => {
  const server = await serve(t);
  await fill(server.add('pick'), 6);
  const page = await openPage(t, `${server.url}#session/pick`);
  await until(page, ...meshesShown(6));
  await page.getByLabel('Hide or show the image').click();  // it may hide the object
  const at = await objectOnScreen(page, '5');
  await page.mouse.click(at.x, at.y);
  await page.getByRole('heading', { name: 'book #5' }).waitFor();
  await page.getByText('2,000 steps').or(page.getByText('1,000 steps')).first().waitFor();
  await page.getByText('Look here next:').waitFor();
  assert.ok(await page.locator('svg.chart').isVisible());
  await page.picture('object');
  await page.keyboard.press('Escape');
  await page.locator('.object-row').first().waitFor();
  await page.keyboard.press('j');
  await page.getByRole('heading', { name: 'book #2' }).waitFor();
  await page.keyboard.press('?');
  await page.getByRole('heading', { name: 'Controls' }).waitFor();
  await page.picture('help');
  assert.deepEqual(page.problems, []);
});

test('the distance of two picked points is measured in map units', async (t) => {
  const server = await serve(t);
  await fill(server.add('measure'), 3);
  const page = await openPage(t, `${server.url}#session/measure`);
  await until(page, ...meshesShown(3));
  await page.getByLabel('Hide or show the image').click();
  await page.keyboard.press('m');
  for (const id of ['1', '3']) {
    const at = await objectOnScreen(page, id);
    await page.mouse.click(at.x, at.y);
  }
  await page.locator('.label.measure.on').waitFor();
  const { distance } = await viewState(page);
  // The centers are 1 apart; the points lie on the balls of radius 0.1 toward the viewer.
  assert.ok(Math.abs(distance - 1) < 0.12, String(distance));
  await page.picture('measure');
  assert.deepEqual(page.problems, []);
});

test('objects and the map are downloaded with the token in the header', async (t) => {
  const server = await serve(t);
  const session = server.add('load', { name: 'My map' });
  await fill(session, 1);
  session.setFile('objects/1.glb', 'glTF-object', 'model/gltf-binary');
  session.setFile('map.glb', 'glTF-map', 'model/gltf-binary');
  server.token = 'secret';
  const page = await openPage(t, `${server.url}#session/load`);
  await page.getByLabel('Token', { exact: true }).fill('wrong');
  await page.getByRole('button', { name: 'Use token' }).click();
  await page.getByText('not accepted').waitFor();
  await page.getByLabel('Token', { exact: true }).fill('secret');
  await page.getByRole('button', { name: 'Use token' }).click();
  await page.locator('[data-object="1"]').click();
  const [object] = await Promise.all([page.waitForEvent('download'), page.locator('button.download').click()]);
  assert.equal(object.suggestedFilename(), 'cup_1.glb');
  await page.getByRole('tab', { name: /Session/ }).click();
  const [map] = await Promise.all([page.waitForEvent('download'), page.locator('button.download-map').click()]);
  assert.equal(map.suggestedFilename(), 'My_map_map.glb');
  assert.ok(server.requests.every((r) => !r.includes('secret')));
  assert.equal(await page.evaluate(() => JSON.stringify({ ...localStorage, ...sessionStorage })), '{}');
});

test('a kept token lasts until the tab is closed, and a revoked one is asked for again', async (t) => {
  const server = await serve(t);
  await fill(server.add('keep'), 1);
  server.token = 'first';
  const page = await openPage(t, server.url);
  await page.getByLabel('Token', { exact: true }).fill('first');
  await page.getByLabel('Keep it').check();
  await page.getByRole('button', { name: 'Use token' }).click();
  await page.locator('[data-session="keep"]').click();
  await page.locator('[data-object="1"]').waitFor();
  await page.reload();
  await page.locator('[data-object="1"]').waitFor();
  server.token = 'second';
  server.sessions.get('keep').finish('UNAUTHENTICATED', 'the token was revoked');
  server.sessions.get('keep').end = null;
  await page.getByText('the token was revoked').waitFor();
  await page.picture('token');
  await page.getByLabel('Token', { exact: true }).fill('second');
  await page.getByRole('button', { name: 'Use token' }).click();
  await page.locator('.link-chip', { hasText: 'live' }).waitFor();
});

test('colors show images, normals and how well the surface was observed', async (t) => {
  const server = await serve(t);
  const session = server.add('colors');
  await fill(session, 1);
  const page = await openPage(t, `${server.url}#session/colors`);
  await until(page, 'the texture', () => window.romap.session?.scene?.objects.mesh('1')?.hasTexture);
  await page.keyboard.press('l');
  await page.keyboard.press('b');
  // Mean colors of the drawn object near its top and its bottom; the confidence of the ball is its height.
  const colors = () => page.evaluate(() => {
    const { scene, store } = window.romap.session;
    const { stage } = scene;
    stage.renderer.render(stage.scene, stage.camera);
    const gl = stage.renderer.getContext();
    const ratio = stage.renderer.getPixelRatio();
    const { x, y, z } = store.objects.get('1').update.cuboid.tWorldObject.translation;
    return [0.075, -0.075].map((dz) => {
      const at = stage.project(scene.controls.target.clone().set(x, y, z + dz));
      const pixel = new Uint8Array(4);
      gl.readPixels(Math.round(at.x * ratio), Math.round((stage.host.clientHeight - at.y) * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      return [...pixel.slice(0, 3)];
    });
  });
  await page.evaluate(() => window.romap.session.select('1'));
  await page.keyboard.press('z');
  await until(page, 'the end of the motion', () => window.romap.session.scene.stage.host.clientWidth > 0 && !window.romap.session.scene.controls.flight);
  await page.evaluate(() => window.romap.session.select(null));
  await page.keyboard.press('3');
  const [top, bottom] = await colors();
  assert.ok(top[1] > 140 && top[2] > 110, `well observed: ${top}`);
  assert.ok(bottom[0] > 1.6 * bottom[1] && bottom[2] < 110, `badly observed: ${bottom}`);
  await page.picture('confidence');
  await page.keyboard.press('2');
  const [normalTop, normalBottom] = await colors();
  assert.ok(normalTop[2] > normalBottom[2] + 60, `${normalTop} ${normalBottom}`);
  await page.picture('normals');
  assert.deepEqual(page.problems, []);
});

test('a phone shows the panel as a sheet with three heights', async (t) => {
  const server = await serve(t);
  await fill(server.add('phone', { name: 'On a phone' }), 4);
  const page = await openPage(t, `${server.url}#session/phone`, { viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true });
  await until(page, ...meshesShown(4));
  const heights = [];
  for (let n = 0; n < 3; ++n) {
    await atRest(page);
    heights.push((await page.locator('.panel').boundingBox()).height);
    await page.picture(`phone_${n}`);
    await page.locator('.panel .handle').click();
  }
  assert.deepEqual([...heights].sort((a, b) => a - b), [heights[2], heights[0], heights[1]]);
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
  assert.deepEqual(page.problems, []);
});

test('a page without WebGL says so, and its lists work', async (t) => {
  const server = await serve(t);
  await fill(server.add('flat'), 2);
  const page = await openPage(t, `${server.url}#session/flat`, { flags: ['--disable-gpu', '--disable-3d-apis'] });
  await page.getByText('This browser has no WebGL 2').waitFor();
  await page.locator('[data-object="2"]').click();
  await page.getByRole('heading', { name: 'book #2' }).waitFor();
  await page.picture('no_webgl');
});

test('the pages have names and roles for screen readers, and all controls take the focus', async (t) => {
  const server = await serve(t);
  await fill(server.add('keys'), 2);
  const page = await openPage(t, `${server.url}#session/keys`);
  await until(page, ...meshesShown(2));
  const seen = new Set();
  for (let n = 0; n < 30; ++n) {
    await page.keyboard.press('Tab');
    const focused = await page.evaluate(() => {
      const e = document.activeElement;
      if (e === document.body) return { name: '' };
      const style = getComputedStyle(e);
      return { name: e.getAttribute('aria-label') ?? e.textContent.trim(), outline: style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) > 0 };
    });
    if (focused.name === '' || seen.has(focused.name)) continue;
    seen.add(focused.name);
    assert.ok(focused.outline, `no visible focus: ${focused.name}`);
  }
  for (const name of ['Orbit around a point', 'Measure a distance', 'All sessions', 'Help']) assert.ok(seen.has(name), name);
  assert.ok([...seen].some((n) => n.startsWith('Map in 3D')));
  const before = await page.evaluate(() => window.romap.session.scene.stage.camera.position.toArray());
  await page.locator('canvas').focus();
  await page.keyboard.press('ArrowLeft');
  assert.notDeepEqual(await page.evaluate(() => window.romap.session.scene.stage.camera.position.toArray()), before);
});

test('two maps of a session are shown one at a time', async (t) => {
  const server = await serve(t);
  const session = server.add('maps');
  session.setFile('frame.jpg', stripesPng(160), 'image/png');
  session.emit({ object: objectUpdate(1, { mapId: '1', className: 'cup' }) });
  session.emit({ object: objectUpdate(2, { mapId: '2', className: 'book' }) });
  session.emit({ frameAck: ack(1, { x: 0, y: -1, z: 0 }, { mapId: '2' }) });
  const page = await openPage(t, `${server.url}#session/maps`);
  await page.locator('[data-object="2"]').waitFor();
  await until(page, 'one object', () => document.querySelectorAll('[data-object]').length === 1);
  await page.getByRole('tab', { name: /View/ }).click();
  await page.getByLabel('Map of this session').selectOption('1');
  await page.getByRole('tab', { name: /Objects/ }).click();
  await page.locator('[data-object="1"]').waitFor();
  assert.deepEqual(page.problems, []);
});

test('an address that is not valid shows the list', async (t) => {
  const server = await serve(t);
  const page = await openPage(t, `${server.url}#session/%E0%A4%A`);
  await page.getByText('No sessions yet').waitFor();
  assert.deepEqual(page.problems, []);
});
