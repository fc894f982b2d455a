// Bundles the tests (TypeScript) with the bundler of client/viewer and runs them with the test runner of Node.
import { spawnSync } from 'node:child_process';
import { createRequire } from 'node:module';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));
const viewerDir = process.env.ROMAP_VIEWER_DIR ?? path.resolve(here, '../../../../client/viewer');
let esbuild;
try {
  esbuild = createRequire(path.join(viewerDir, 'package.json'))('esbuild');
} catch {
  console.log(`SKIPPED: ${viewerDir} has no packages; run "npm ci" there`);
  process.exit(77);
}
const out = fs.mkdtempSync(path.join(os.tmpdir(), 'romap-viewer-unit-'));
try {
  esbuild.buildSync({
    entryPoints: fs.readdirSync(here).filter((f) => f.endsWith('.test.ts')).map((f) => path.join(here, f)),
    bundle: true, platform: 'node', format: 'esm', outdir: out, outExtension: { '.js': '.mjs' }, logLevel: 'warning',
    alias: { 'viewer': path.join(viewerDir, 'src') }, target: 'node18', sourcemap: 'inline',
  });
  const files = fs.readdirSync(out).map((f) => path.join(out, f));
  process.exitCode = spawnSync(process.execPath, ['--test', ...files], { stdio: 'inherit' }).status ?? 1;
} finally {
  fs.rmSync(out, { recursive: true, force: true });
}
