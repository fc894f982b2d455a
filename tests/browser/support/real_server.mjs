// romap-server and romap as processes, with little training.
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

const kLittleTraining = ['nerf.first_budget_steps=40', 'nerf.full_budget_steps=40', 'nerf.refine_steps_per_view=1', 'mesh.resolution=32',
                         'mesh.min_side_nodes=32'].flatMap((setting) => ['--set', setting]);
const kTimeoutMs = 60000;

export const serverProgram = process.env.ROMAP_SERVER ?? '';
export const clientProgram = process.env.ROMAP_CLIENT ?? '';

export function temporaryFolder(t) {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'romap-browser-'));
  t.after(() => fs.rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/** Ends when the program does; throws with its output unless it succeeds. */
export function runClient(args) {
  const child = spawn(clientProgram, args, { stdio: ['ignore', 'pipe', 'pipe'] });
  let output = '';
  child.stdout.on('data', (d) => (output += d));
  child.stderr.on('data', (d) => (output += d));
  return new Promise((resolve, reject) => {
    const limit = setTimeout(() => child.kill('SIGKILL'), 2 * kTimeoutMs);
    child.on('close', (code) => {
      clearTimeout(limit);
      if (code === 0) resolve(output);
      else reject(new Error(`romap ${args.join(' ')} ended with ${code}:\n${output}`));
    });
  });
}

/** The same ports after `kill` and `start`. */
export class RealServer {
  constructor(t, dataDir, args = []) {
    this.dataDir = dataDir;
    this.args = args;
    this.grpc = '127.0.0.1:0';
    this.http = '127.0.0.1:0';
    t.after(() => this.kill());
  }

  get url() {
    return `http://${this.http}/`;
  }

  async start() {
    const child = spawn(serverProgram, ['--listen', this.grpc, '--http', this.http, '--data-dir', this.dataDir, ...kLittleTraining, ...this.args],
                        { stdio: ['ignore', 'pipe', 'pipe'] });
    this.child = child;
    let output = '';
    await new Promise((resolve, reject) => {
      const limit = setTimeout(() => reject(new Error(`romap-server does not listen after ${kTimeoutMs / 1000} s:\n${output}`)), kTimeoutMs);
      const read = (data) => {
        output += data;
        const grpc = /romap-server listening on (\S+)/.exec(output);
        const http = /romap-server page at http:\/\/([^/\s]+)/.exec(output);
        if (!grpc || !http) return;
        [this.grpc, this.http] = [grpc[1], http[1]];
        clearTimeout(limit);
        resolve();
      };
      child.stdout.on('data', read);
      child.stderr.on('data', read);
      child.on('close', (code) => reject(new Error(`romap-server ended with ${code}:\n${output}`)));
    });
  }

  async kill() {
    const { child } = this;
    this.child = null;
    if (!child || child.exitCode !== null) return;
    const closed = new Promise((resolve) => child.on('close', resolve));
    child.kill('SIGKILL');
    await closed;
  }

  async api(name, init) {
    const response = await fetch(`${this.url}api/v1/${name}`, init);
    if (!response.ok) throw new Error(`${name}: status ${response.status}`);
    return response.json();
  }
}
