// What the page says and does when something goes wrong.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { openPage, until, viewState } from './support/browser.mjs';
import { ack, addMesh, objectUpdate, stripesPng } from './support/draco_scene.mjs';
import { MockServer } from './support/mock_server.mjs';
import { distDir } from './support/viewer_modules.mjs';

async function serve(t) {
  const server = new MockServer(distDir);
  await server.start();
  t.after(() => server.stop());
  return server;
}

function add(server, id) {
  const session = server.add(id, { name: id });
  session.setFile('frame.jpg', stripesPng(64), 'image/png');
  session.emit({ frameAck: ack(1, { x: 0, y: -1, z: 0.3 }) });
  return session;
}

const meshIsShown = [`the mesh`, () => window.romap.session?.scene?.objects.mesh('1')?.hasMesh];

test('the page survives a restart of the server by itself', async (t) => {
  const server = await serve(t);
  const session = add(server, 'restart');
  session.emit({ object: objectUpdate(1, { hasMesh: true }) });
  session.emit({ object: objectUpdate(2, { position: { x: 1, y: 0, z: 0 }, className: 'gone' }) });
  session.emit(await addMesh(session, 1, 5));
  const page = await openPage(t, `${server.url}#session/restart`);
  await until(page, ...meshIsShown);
  await server.stop();
  await page.locator('.link-chip', { hasText: 'link lost, retrying' }).waitFor();
  await page.picture('link_lost');
  assert.equal((await viewState(page)).objects.length, 2);  // the map stays
  // The restored session has one object less and begins with a lower revision.
  session.emit({ removed: { id: '2', revision: '3', reason: 'not found again' } });
  session.emit({ object: objectUpdate(1, { revision: '3', hasMesh: true, className: 'restored' }) });
  session.emit(await addMesh(session, 1, 4));
  await server.start();
  await page.locator('.link-chip', { hasText: 'live' }).waitFor();
  await page.getByText('restored #1').waitFor();
  await until(page, 'the mesh of the restored session', () => window.romap.session.scene.objects.mesh('1').revision === 4);
  assert.equal((await viewState(page)).objects.length, 1);
});

test('the page connects again at once when it is asked to', async (t) => {
  const server = await serve(t);
  add(server, 'again');
  const page = await openPage(t, `${server.url}#session/again`);
  await page.locator('.link-chip', { hasText: 'live' }).waitFor();
  await server.stop();
  await page.locator('.link-chip', { hasText: 'retrying' }).waitFor();
  await server.start();
  await page.getByRole('button', { name: 'Retry now' }).click().catch(() => undefined);  // it may be back already
  await page.locator('.link-chip', { hasText: 'live' }).waitFor();
});

test('a session that is deleted under the page says so', async (t) => {
  const server = await serve(t);
  const session = add(server, 'deleted');
  session.emit({ object: objectUpdate(1) });
  const page = await openPage(t, `${server.url}#session/deleted`);
  await page.locator('[data-object="1"]').waitFor();
  await page.getByRole('tab', { name: /Session/ }).click();
  await page.evaluate(() => fetch('/api/v1/sessions/deleted', { method: 'DELETE', headers: { 'X-Romap': '1' } }));
  await page.getByText('This session does not exist (any more)').waitFor();
  await page.picture('deleted');
  await page.getByRole('alert').getByRole('link', { name: 'All sessions' }).click();
  await page.getByText('No sessions yet').waitFor();
});

test('a session can be deleted from the page after a question', async (t) => {
  const server = await serve(t);
  add(server, 'delete');
  const page = await openPage(t, `${server.url}#session/delete`);
  await page.getByRole('tab', { name: /Session/ }).click();
  await page.getByRole('button', { name: 'Delete', exact: true }).click();
  await page.getByRole('button', { name: 'Delete session' }).click();
  await page.getByText('No sessions yet').waitFor();
  assert.equal(server.sessions.size, 0);
});

test('damaged, cut and huge meshes leave the cuboid and a note', async (t) => {
  const server = await serve(t);
  const session = add(server, 'damaged');
  const names = ['garbage', 'cut', 'flipped', 'empty', 'huge', 'many'];
  for (const [n, className] of names.entries()) {
    const id = n + 1;
    session.emit({ object: objectUpdate(id, { hasMesh: true, className, position: { x: 0.4 * n, y: 0, z: 0 } }) });
    const event = await addMesh(session, id, 2);
    const file = session.files.get(`objects/${id}/mesh/2`);
    if (className === 'garbage') file.bytes = Buffer.from('this is not a mesh');
    if (className === 'cut') file.bytes = file.bytes.subarray(0, file.bytes.length >> 1);
    if (className === 'flipped') file.bytes = Buffer.concat([file.bytes.subarray(0, 11), Buffer.alloc(file.bytes.length - 11, 0xff)]);
    if (className === 'empty') file.bytes = Buffer.alloc(0);
    if (className === 'huge') event.bytes.draco = 500e6;
    if (className === 'many') event.mesh.triangleCount = 40e6;
    session.emit(event);
  }
  session.emit({ object: objectUpdate(9, { hasMesh: true, className: 'good', position: { x: 0, y: 0.5, z: 0 } }) });
  session.emit(await addMesh(session, 9, 2));
  const page = await openPage(t, `${server.url}#session/damaged`);
  await until(page, 'the notes', (count) => document.querySelectorAll('.badge[data-kind="error"]').length === count, names.length);
  await until(page, 'the good mesh', () => window.romap.session.scene.objects.mesh('9').hasMesh);
  const state = await viewState(page);
  for (const object of state.objects.filter((o) => o.id !== '9')) assert.match(object.fault, /cannot be shown.*Its cuboid is shown/);
  await page.locator('[data-object="1"]').click();
  await page.getByText('not a Draco mesh').waitFor();
  await page.picture('damaged');
  // A good mesh of a newer revision heals the object.
  session.emit(await addMesh(session, 1, 3));
  await until(page, ...meshIsShown);
  assert.equal((await viewState(page)).objects.find((o) => o.id === '1').fault, '');
});

test('a slow link shows the map step by step', async (t) => {
  const server = await serve(t);
  const session = add(server, 'slow');
  session.emit({ object: objectUpdate(1, { hasMesh: true }) });
  session.emit(await addMesh(session, 1, 2, { isFinal: true, rings: 64, segments: 96 }));
  const page = await openPage(t, 'about:blank');
  const devtools = await page.context().newCDPSession(page);
  await devtools.send('Network.enable');
  await devtools.send('Network.emulateNetworkConditions', { offline: false, latency: 150, downloadThroughput: 60e3, uploadThroughput: 30e3 });
  await page.goto(`${server.url}#session/slow`);
  await until(page, 'the object', () => window.romap?.session?.store.objects.size === 1, undefined, 60000);
  await until(page, 'the coarse mesh', () => window.romap.session.scene.objects.mesh('1')?.hasLevel(2), undefined, 60000);
  assert.equal((await viewState(page)).objects[0].fault, '');
});

test('a list without a server says what is wrong and comes back', async (t) => {
  const server = await serve(t);
  add(server, 'back');
  const page = await openPage(t, server.url);
  await page.locator('.card').waitFor();
  await server.stop();
  await page.getByText('The server cannot be reached').waitFor();
  await server.start();
  await until(page, 'the list', () => !document.body.textContent.includes('cannot be reached'));
});

test('a lost graphics memory is announced and repaired', async (t) => {
  const server = await serve(t);
  const session = add(server, 'context');
  session.emit({ object: objectUpdate(1, { hasMesh: true }) });
  session.emit(await addMesh(session, 1, 2));
  const page = await openPage(t, `${server.url}#session/context`);
  await until(page, ...meshIsShown);
  await page.evaluate(() => {
    window.lost = window.romap.session.scene.stage.renderer.getContext().getExtension('WEBGL_lose_context');
    window.lost.loseContext();
  });
  await page.getByText('took the graphics memory away').waitFor();
  await page.evaluate(() => window.lost.restoreContext());
  await page.getByText('took the graphics memory away').waitFor({ state: 'hidden' });
});
