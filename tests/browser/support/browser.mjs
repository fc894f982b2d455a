// A headless Chromium for the tests, with what the page writes to its console, and screenshots.
import fs from 'node:fs';
import path from 'node:path';
import { after } from 'node:test';
import { fromViewer, viewerDir } from './viewer_modules.mjs';

const { chromium } = fromViewer('playwright-core');

export const kChromium = process.env.ROMAP_CHROMIUM ?? '/usr/bin/chromium';
const kFlags = ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'];
export const kSoftwareGl = ['--disable-gpu', '--enable-unsafe-swiftshader'];
const kWaitMs = 60000;  // the machine may do other things
const pictures = process.env.ROMAP_PICTURES_DIR ?? path.join(viewerDir, 'pictures');

// What the headless browser itself writes when a screenshot is taken.
const kNoise = /GPU stall due to ReadPixels/;

let shared = null;
after(async () => (await shared)?.close());

const launch = (flags) => chromium.launch({ executablePath: kChromium, args: [...kFlags, ...flags] });

/** The browser of all tests of a file, or one of its own with other `flags`, which is closed with the test. */
export async function openBrowser(t, flags) {
  if (!flags) return (shared ??= launch(kSoftwareGl));
  const browser = await launch(flags);
  t.after(() => browser.close());
  return browser;
}

/** `page.problems`: errors and warnings of the page; `page.picture(name)`: a screenshot in the build folder. */
export async function openPage(t, url, { browser, flags, ...context } = {}) {
  browser ??= await openBrowser(t, flags);
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: 'dark', ...context });
  t.after(() => page.context().close());
  page.setDefaultTimeout(kWaitMs);
  page.problems = [];
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type()) && !kNoise.test(message.text())) {
      page.problems.push(`${message.type()}: ${message.text()} ${message.location().url}`);
    }
  });
  page.on('pageerror', (error) => page.problems.push(`exception: ${error}`));
  page.foreign = [];
  page.on('request', (request) => {
    const { protocol, host } = new URL(request.url());
    if (protocol.startsWith('http') && host !== new URL(url).host) page.foreign.push(request.url());
  });
  page.picture = async (name) => {
    fs.mkdirSync(pictures, { recursive: true });
    await page.screenshot({ path: path.join(pictures, `${name}.png`) });
  };
  await page.goto(url);
  return page;
}

/** Waits until `done` (runs in the page) is true. */
export async function until(page, what, done, argument, timeout = kWaitMs) {
  try {
    return await page.waitForFunction(done, argument, { timeout, polling: 50 });
  } catch (error) {
    throw new Error(`waited ${timeout / 1000} s for ${what}: ${error.message.split('\n')[0]}`);
  }
}

/** Waits for the end of all transitions. */
export const atRest = (page) => page.evaluate(async () => {
  const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
  await frame();
  await frame();
  const finite = document.getAnimations().filter((animation) => Number.isFinite(animation.effect.getComputedTiming().endTime));
  await Promise.allSettled(finite.map((animation) => animation.finished));
});

/** Figures of the 3D view. Runs in the page. */
export const viewState = (page) => page.evaluate(() => {
  const { scene, store, path: track } = window.romap.session;
  return {
    objects: [...store.objects.values()].map((o) => ({
      id: o.update.id, meshRevision: o.mesh?.revision ?? null, shownRevision: scene?.objects.mesh(o.update.id)?.revision ?? null,
      triangles: scene?.objects.mesh(o.update.id)?.shownTriangles ?? 0, fault: scene?.objects.mesh(o.update.id)?.fault ?? '',
    })),
    poses: track.poses.length, points: scene?.points.count ?? 0, renders: scene?.stage.renders ?? 0, distance: scene?.measure.distance() ?? null,
  };
});

/** The center of an object in pixels of the window. */
export const objectOnScreen = (page, id) => page.evaluate((objectId) => {
  const { scene, store } = window.romap.session;
  const { x, y, z } = store.objects.get(objectId).update.cuboid.tWorldObject.translation;
  const point = scene.controls.target.clone().set(x, y, z);
  const at = scene.stage.project(point);
  const rect = scene.stage.canvas.getBoundingClientRect();
  const place = { x: at.x + rect.left, y: at.y + rect.top };
  const top = document.elementFromPoint(place.x, place.y);
  if (top !== scene.stage.canvas) throw new Error(`object ${objectId} is behind ${top?.className}`);
  return place;
}, id);
