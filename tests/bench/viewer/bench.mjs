// Measures the page in a headless Chromium with software rendering: size, first paint, frames per second with many
// objects while the view turns, and the longest task of the main thread while their meshes arrive.
//
//   node tests/bench/viewer/bench.mjs [OBJECTS]     after "npm ci && npm run build" in client/viewer
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import zlib from 'node:zlib';
import { ack, addMesh, objectUpdate } from '../../browser/support/draco_scene.mjs';
import { MockServer } from '../../browser/support/mock_server.mjs';
import { distDir, fromViewer } from '../../browser/support/viewer_modules.mjs';

const { chromium } = fromViewer('playwright-core');
const kChromium = process.env.ROMAP_CHROMIUM ?? '/usr/bin/chromium';
const count = Number(process.argv[2] ?? 100);
const kSide = 64;  // 8192 triangles, about as many as a final mesh of the server
const kSeconds = 8;

function bundleSize() {
  let raw = 0;
  let zipped = 0;
  for (const name of fs.readdirSync(distDir, { recursive: true })) {
    const file = path.join(distDir, name);
    if (!fs.statSync(file).isFile()) continue;
    const bytes = fs.readFileSync(file);
    raw += bytes.length;
    zipped += zlib.gzipSync(bytes, { level: 9 }).length;
  }
  return { raw, zipped };
}

async function fill(session) {
  const side = Math.ceil(Math.sqrt(count));
  for (let n = 0; n < count; ++n) {
    const position = { x: (n % side) * 0.4, y: Math.floor(n / side) * 0.4, z: 0.1 };
    session.emit({ object: objectUpdate(n + 1, { position, hasMesh: true, className: `object ${n}` }) });
    session.emit(await addMesh(session, n + 1, 2, { isFinal: true, rings: kSide, segments: kSide }));
  }
  for (let n = 1; n <= 500; ++n) session.emit({ frameAck: ack(n, { x: 0.008 * n, y: -1, z: 0.6 }) });
}

/** Processor time of the tasks of the page's main thread, milliseconds: independent of what else the machine does. */
function mainThreadTasks(file) {
  const { traceEvents } = JSON.parse(fs.readFileSync(file, 'utf8'));
  const threads = new Set(traceEvents.filter((e) => e.name === 'thread_name' && e.args.name === 'CrRendererMain').map((e) => `${e.pid}/${e.tid}`));
  return traceEvents.filter((e) => e.ph === 'X' && e.tdur > 0 && threads.has(`${e.pid}/${e.tid}`) && /RunTask/.test(e.name)).map((e) => e.tdur / 1000);
}

const server = new MockServer(distDir);
await server.start();
await fill(server.add('bench', { name: 'bench', streamOpen: false }));
const browser = await chromium.launch({
  executablePath: kChromium, args: ['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader', '--disable-quic', '--no-first-run', '--disable-background-networking'],
});
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  await page.addInitScript(() => {
    window.longTasks = [];
    new PerformanceObserver((list) => window.longTasks.push(...list.getEntries().map((e) => e.duration))).observe({ type: 'longtask', buffered: true });
  });
  const firstPaint = () => page.evaluate(() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN);
  await page.goto(server.url);
  await page.locator('.card').waitFor();
  const listPaint_ms = await firstPaint();
  await page.goto('about:blank');
  const trace = path.join(os.tmpdir(), `romap-viewer-trace-${process.pid}.json`);
  await browser.startTracing(page, { path: trace, categories: ['toplevel', 'devtools.timeline'] });
  await page.goto(`${server.url}#session/bench`);
  await page.waitForFunction((n) => {
    const scene = window.romap?.session?.scene;
    return scene && window.romap.session.store.objects.size === n && scene.objects.pending === 0 &&
      [...window.romap.session.store.objects.keys()].every((id) => scene.objects.mesh(id)?.hasMesh);
  }, count, { timeout: 300000, polling: 200 });
  const loaded = await page.evaluate(() => ({ ms: performance.now(), tasks: window.longTasks, triangles: window.romap.session.scene.objects.triangles }));
  const sessionPaint_ms = await firstPaint();
  await browser.stopTracing();
  const cpuTasks = mainThreadTasks(trace);
  fs.rmSync(trace);
  const turn = await page.evaluate((seconds) => new Promise((resolve) => {
    const { scene } = window.romap.session;
    const start = performance.now();
    const before = scene.stage.renders;
    window.longTasks.length = 0;
    const step = () => {
      const t = (performance.now() - start) / 1000;
      if (t > seconds) {
        return resolve({ fps: (scene.stage.renders - before) / t, tasks: window.longTasks, calls: scene.stage.renderer.info.render.calls });
      }
      scene.controls.turn(0.02, 0);
      requestAnimationFrame(step);
    };
    step();
  }), kSeconds);
  const { raw, zipped } = bundleSize();
  const longest = (tasks) => (tasks.length === 0 ? 'below 50 ms' : `${Math.max(...tasks).toFixed(0)} ms (${tasks.length} of 50 ms or more)`);
  console.log(`machine                       ${os.cpus().length} x ${os.cpus()[0]?.model}, load ${os.loadavg()[0].toFixed(1)}`);
  console.log(`all files of the page         ${(zipped / 1e3).toFixed(0)} kB gzipped, ${(raw / 1e3).toFixed(0)} kB`);
  console.log(`first paint, list             ${listPaint_ms.toFixed(0)} ms`);
  console.log(`first paint, session          ${sessionPaint_ms.toFixed(0)} ms`);
  console.log(`${count} objects on the screen    ${(loaded.ms / 1000).toFixed(1)} s after the start, ${loaded.triangles} triangles drawn of ${count * 2 * kSide * kSide}`);
  console.log(`longest task, meshes arrive   ${longest(loaded.tasks)}`);
  console.log(`  in processor time           ${Math.max(...cpuTasks).toFixed(0)} ms (${cpuTasks.filter((ms) => ms >= 50).length} of 50 ms or more, of ${cpuTasks.length} tasks)`);
  console.log(`frames while the view turns   ${turn.fps.toFixed(1)} per second, ${turn.calls} drawing calls`);
  console.log(`longest task, view turns      ${longest(turn.tasks)}`);
} finally {
  await browser.close();
  await server.stop();
}
