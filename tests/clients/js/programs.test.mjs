// The program of client/js/README.md and the example.

import assert from 'node:assert/strict';
import {execFile} from 'node:child_process';
import {copyFileSync, readFileSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {test} from 'node:test';
import {promisify} from 'node:util';
import {LIMIT_MS, RomapServer, SEQUENCE, SOURCE_DIR} from './servers.mjs';

const PROGRAMS = join(process.env.ROMAP_JS_DIR, '../program');

test('the program of the README and the example', async (t) => {
  const page = readFileSync(join(SOURCE_DIR, 'client/js/README.md'), 'utf8');
  const [, program] = /```js\n([\s\S]*?)```/.exec(page);
  assert.ok(program.split('\n').length <= 24);
  writeFileSync(join(PROGRAMS, 'program.mjs'), program);
  copyFileSync(join(SOURCE_DIR, 'client/js/examples/stream_folder.mjs'), join(PROGRAMS, 'stream_folder.mjs'));
  const {address} = await RomapServer.start(t, '--ephemeral');
  const node = async (...command) =>
    (await promisify(execFile)(process.execPath, command, {cwd: PROGRAMS, timeout: LIMIT_MS})).stdout.trim().split('\n');
  assert.equal((await node('program.mjs', address, SEQUENCE)).length, 2);
  const printed = await node('stream_folder.mjs', SEQUENCE, '--server', address);
  assert.match(printed[0], /^1 \w+: [\d.]+ x [\d.]+ x [\d.]+, mesh with \d+ triangles$/);
});
