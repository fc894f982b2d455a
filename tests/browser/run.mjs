// Runs test files in the test runner of Node. Exit status 77 (a visible skip) if the browser or the page is missing.
import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import { distDir, viewerDir } from './support/viewer_modules.mjs';

function skip(text) {
  console.log(`SKIPPED: ${text}`);
  process.exit(77);
}

const chromium = process.env.ROMAP_CHROMIUM ?? '/usr/bin/chromium';
if (!fs.existsSync(chromium)) skip(`${chromium} is not installed; see deploy/setup.sh tests`);
if (!fs.existsSync(path.join(viewerDir, 'node_modules/playwright-core'))) skip(`${viewerDir} has no packages`);
if (!fs.existsSync(path.join(distDir, 'index.html'))) skip(`the page was not built in ${distDir}`);
const server = process.env.ROMAP_SERVER;
if (process.argv.some((argument) => argument.endsWith('server_test.mjs'))) {
  if (!server) skip('ROMAP_SERVER and ROMAP_CLIENT do not name the programs');
  if (!spawnSync(server, ['--help'], { encoding: 'utf8' }).stdout.includes('--http')) skip(`${server} serves no page`);
}
process.exitCode = spawnSync(process.execPath, ['--test', ...process.argv.slice(2)], { stdio: 'inherit' }).status ?? 1;
