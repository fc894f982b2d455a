#!/usr/bin/env node
// Streams a recorded folder in the layout of client/README.md, e.g. one of `romap synth`, and prints the map.
//
//   romap synth --out desk && node stream_folder.mjs desk --server 127.0.0.1:50051 [--no-poses] [--wait SECONDS]
//       [--tls-ca FILE] [--token-file FILE]

import {existsSync, readFileSync} from 'node:fs';
import {basename, join, resolve} from 'node:path';
import {parseArgs} from 'node:util';
import {RomapError, connect, decodeMesh} from 'romap';

const MATCH_NS = 20_000_000n;

/** @param {string} path */
function readCamera(path) {
  const lines = readFileSync(path, 'utf8').split('\n').map((line) => line.split('#')[0]);
  const entries = lines.filter((line) => line.includes(':')).map((line) => line.split(/:(.*)/, 2));
  const values = Object.fromEntries(entries.map(([key, value]) => [key.trim(), value.trim()]));
  const [width, height, fx, fy, cx, cy] = ['width', 'height', 'fx', 'fy', 'cx', 'cy'].map((key) => Number(values[key]));
  const distortion = JSON.parse(values.distortion ?? '[]');
  return {width, height, fx, fy, cx, cy, distortion, lens: values.lens, readoutS: Number(values.readout_s ?? 0)};
}

/** Decimal seconds in nanoseconds, without rounding. @param {string} seconds */
function nanoseconds(seconds) {
  const [whole, fraction = ''] = seconds.split('.');
  return BigInt(whole) * 1_000_000_000n + BigInt(fraction.padEnd(9, '0').slice(0, 9));
}

/** The rows of a TUM list. @param {string} path */
function readList(path) {
  if (!existsSync(path)) return [];
  const lines = readFileSync(path, 'utf8').split('\n').filter((line) => line.trim() && !line.startsWith('#'));
  return lines.map((line) => {
    const [time, ...columns] = line.trim().split(/\s+/);
    return {time: nanoseconds(time), columns};
  });
}

/**
 * @param {ReturnType<typeof readList>} rows
 * @param {bigint} time
 */
function nearest(rows, time) {
  const distance = (/** @type {{time: bigint}} */ row) => (row.time < time ? time - row.time : row.time - time);
  const close = rows.filter((row) => distance(row) <= MATCH_NS);
  return close.reduce((best, row) => (!best || distance(row) < distance(best) ? row : best), close[0])?.columns;
}

/** The rows of detections.csv by time. @param {string} path */
function readInstances(path) {
  const instances = new Map();
  if (!existsSync(path)) return instances;
  for (const line of readFileSync(path, 'utf8').split('\n').slice(1).filter(Boolean)) {
    const [time, label, className, score] = line.split(',');
    const key = nanoseconds(time);
    const instance = {label: Number(label), className, score: Number(score)};
    instances.set(key, [...(instances.get(key) ?? []), instance]);
  }
  return instances;
}

/** @param {string[] | undefined} columns */
function poseOf(columns) {
  if (!columns) return undefined;
  const [x, y, z, ...rotation] = columns.map(Number);
  return {translation: [x, y, z], rotation};
}

async function main() {
  const {values: options, positionals} = parseArgs({
    allowPositionals: true,
    options: {
      server: {type: 'string', default: '127.0.0.1:50051'},
      'tls-ca': {type: 'string'},
      'token-file': {type: 'string'},
      wait: {type: 'string', default: '0'},
      'no-poses': {type: 'boolean', default: false},
    },
  });
  const [folder] = positionals;
  if (!folder) throw new RomapError('INVALID_ARGUMENT', 'pass the folder of a sequence');
  const [images, masks, poses] = ['rgb', 'mask', 'groundtruth'].map((name) => readList(join(folder, `${name}.txt`)));
  const instances = readInstances(join(folder, 'detections.csv'));
  const server = await connect(options.server, {
    tls: options['tls-ca'] ? {ca: options['tls-ca']} : undefined,
    tokenFile: options['token-file'],
    waitMs: 1000 * Number(options.wait),
  });
  const session = await server.session(readCamera(join(folder, 'camera.yaml')), {
    name: basename(resolve(folder)),
    poseUse: options['no-poses'] ? 'ignore' : 'given',
    onLink: (isUp, reason) => console.error(isUp ? 'the link is up again' : `link lost, retrying: ${reason}`),
  });
  try {
    for (const {time, columns} of images) {
      const mask = nearest(masks, time);
      await session.send({
        image: readFileSync(join(folder, columns[0])),
        timestampNs: time,
        masks: mask && {png: readFileSync(join(folder, mask[0])), instances: instances.get(time) ?? []},
        pose: options['no-poses'] ? undefined : poseOf(nearest(poses, time)),
      });
    }
    const map = await session.result();
    for (const {severity, text} of map.statistics.diagnostics) console.error(`${severity}: ${text}`);
    for (const {object, mesh} of map.objects) {
      const size = object.cuboid.halfExtents.map((half) => (2 * half).toFixed(3)).join(' x ');
      const triangles = mesh ? (await decodeMesh(mesh.draco)).triangles.length / 3 : 0;
      console.log(`${object.id} ${object.className}: ${size}, mesh with ${triangles} triangles`);
    }
  } finally {
    session.close();
    server.close();
  }
}

main().catch((error) => {
  console.error(`stream_folder: ${error instanceof RomapError ? error.message : error}`);
  process.exitCode = 1;
});
