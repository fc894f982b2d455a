// The page with the real programs: romap-server serves it, romap sends a rendered video.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import { test } from 'node:test';
import { openPage, until, viewState } from './support/browser.mjs';
import { RealServer, runClient, temporaryFolder } from './support/real_server.mjs';

const kSlow = 120000;  // the machine may do other things

async function start(t) {
  const folder = temporaryFolder(t);
  const server = new RealServer(t, path.join(folder, 'data'));
  await server.start();
  const sequence = path.join(folder, 'sequence');
  await runClient(['synth', '--out', sequence, '--objects', '2', '--frames', '50', '--width', '320', '--height', '240']);
  return { folder, server, sequence };
}

const run = ({ folder, server, sequence }, name, ...more) =>
  runClient(['run', sequence, '--server', server.grpc, '--out', path.join(folder, name), '--keep-session', ...more]);

const allMeshesShown = () => {
  const session = window.romap.session;
  const objects = [...(session?.store.objects.values() ?? [])].filter((o) => o.update.state === 'CONFIRMED');
  return objects.length >= 2 && objects.every((o) => o.mesh && session.scene.objects.mesh(o.update.id)?.revision === o.mesh.revision);
};

test('a run is seen from its first frame to its last mesh, and the map can be downloaded', async (t) => {
  const real = await start(t);
  const page = await openPage(t, real.server.url);
  await page.getByText('No sessions yet').waitFor();
  const running = run(real, 'first');
  await page.locator('.card').click({ timeout: kSlow });
  await until(page, 'a pose', () => window.romap.session?.path.poses.length > 0, undefined, kSlow);
  await until(page, 'an object', () => window.romap.session.store.objects.size > 0, undefined, kSlow);
  await running;
  await page.locator('.link-chip', { hasText: 'complete' }).waitFor({ timeout: kSlow });
  await until(page, 'the meshes', allMeshesShown, undefined, kSlow);
  await until(page, 'the whole trajectory', () => window.romap.session.path.poses.length === 50, undefined, kSlow);
  assert.deepEqual((await viewState(page)).objects.map((o) => o.fault).filter((f) => f !== ''), []);
  await page.picture('real_run');
  await page.getByRole('tab', { name: /Session/ }).click();
  const [map] = await Promise.all([page.waitForEvent('download'), page.locator('button.download-map').click()]);
  assert.equal(fs.readFileSync(await map.path()).subarray(0, 4).toString(), 'glTF');
  await page.getByRole('tab', { name: /Objects/ }).click();
  await page.locator('.object-row').first().click();
  const [object] = await Promise.all([page.waitForEvent('download'), page.locator('button.download').click()]);
  assert.equal(fs.readFileSync(await object.path()).subarray(0, 4).toString(), 'glTF');
  // The server may replace a mesh between its announcement and the request; the browser logs the 404.
  assert.deepEqual(page.problems.filter((p) => !/404 .*\/mesh\/\d+/.test(p)), []);
  assert.deepEqual(page.foreign, []);

  // A second session, seen by a viewer that comes when both are finished.
  await run(real, 'second');
  const late = await openPage(t, real.server.url);
  await late.locator('.card').nth(1).waitFor();
  await late.locator('.card').first().click();
  await until(late, 'the meshes of the second session', allMeshesShown, undefined, kSlow);
  assert.deepEqual(late.problems, []);
});

test('the page comes back after the server was killed', async (t) => {
  const real = await start(t);
  await run(real, 'open', '--leave-open');
  const page = await openPage(t, real.server.url);
  await page.locator('.card').click();
  await until(page, 'the meshes', allMeshesShown, undefined, kSlow);
  await until(page, 'the points', () => window.romap.session.scene.points.count > 0, undefined, kSlow);
  await real.server.kill();
  await page.locator('.link-chip', { hasText: 'link lost, retrying' }).waitFor();
  await real.server.start();
  await page.locator('.link-chip', { hasText: 'live' }).waitFor({ timeout: kSlow });
  await until(page, 'the meshes', allMeshesShown, undefined, kSlow);
});

test('the camera page makes a live session that the viewer finds finished', async (t) => {
  const folder = temporaryFolder(t);
  const server = new RealServer(t, path.join(folder, 'data'));
  await server.start();
  const page = await openPage(t, `${server.url}camera`, {
    flags: ['--disable-gpu', '--enable-unsafe-swiftshader', '--use-fake-device-for-media-stream', '--use-fake-ui-for-media-stream'], permissions: ['camera'],
  });
  await page.getByLabel('Name of the session').fill('From a browser');
  await page.getByRole('button', { name: 'Start mapping' }).click();
  await until(page, '5 pictures', () => window.romapCamera.sender?.sent >= 5, undefined, kSlow);
  const { sessions } = await server.api('sessions');
  assert.equal(sessions[0].name, 'From a browser');
  assert.equal(sessions[0].mode, 'FRAME_MODE_LIVE');
  assert.ok(Number(sessions[0].statistics.framesReceived) >= 5);
  assert.equal(Number(sessions[0].statistics.framesRejected), 0);
  await page.picture('real_camera');
  await page.getByRole('button', { name: 'Finish' }).click();
  await page.getByText('The camera is off').waitFor();
  await page.goto(server.url + (await page.getByRole('link', { name: 'Open in viewer' }).getAttribute('href')).slice(1));
  await page.locator('.link-chip', { hasText: 'complete' }).waitFor({ timeout: kSlow });
  assert.deepEqual(page.problems, []);
});
