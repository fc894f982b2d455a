// Objects with Draco meshes as the server sends them: positions, normals, colors, texture coordinates, and a generic
// attribute with one byte of observation confidence per vertex.
import zlib from 'node:zlib';
import { fromViewer } from './viewer_modules.mjs';

const draco3d = fromViewer('draco3d');
let encoderModule = null;

/** A bumpy ball with 2 * rings * segments triangles. `seed` gives its shape and colors. */
function bumpyBall(rings, segments, radius, seed) {
  const count = (rings + 1) * (segments + 1);
  const mesh = { positions: new Float32Array(count * 3), normals: new Float32Array(count * 3), colors: new Uint8Array(count * 3),
                 uvs: new Float32Array(count * 2), confidence: new Uint8Array(count), indices: [] };
  const hue = [0.5 + 0.5 * Math.sin(seed), 0.5 + 0.5 * Math.sin(seed + 2.1), 0.5 + 0.5 * Math.sin(seed + 4.2)];
  for (let i = 0; i <= rings; ++i) {
    for (let j = 0; j <= segments; ++j) {
      const n = i * (segments + 1) + j;
      const theta = Math.PI * i / rings;
      const phi = 2 * Math.PI * j / segments;
      const d = [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)];
      const r = radius * (1 + 0.1 * Math.sin(5 * phi + seed) * Math.sin(4 * theta));
      mesh.positions.set(d.map((v) => v * r), 3 * n);
      mesh.normals.set(d, 3 * n);
      mesh.colors.set(hue.map((v) => Math.round(255 * (0.25 + 0.6 * v * (0.7 + 0.3 * Math.sin(6 * phi))))), 3 * n);
      mesh.uvs.set([j / segments, i / rings], 2 * n);
      mesh.confidence[n] = Math.round(255 * (0.5 + 0.5 * d[2]));
      if (i < rings && j < segments) {
        const [a, b, c, e] = [n, n + 1, n + segments + 1, n + segments + 2];
        mesh.indices.push(a, c, b, b, c, e);
      }
    }
  }
  return mesh;
}

async function encode(mesh, withUv) {
  encoderModule ??= await draco3d.createEncoderModule({});
  const draco = encoderModule;
  const encoder = new draco.Encoder();
  const builder = new draco.MeshBuilder();
  const object = new draco.Mesh();
  const count = mesh.positions.length / 3;
  builder.AddFacesToMesh(object, mesh.indices.length / 3, new Uint32Array(mesh.indices));
  builder.AddFloatAttributeToMesh(object, draco.POSITION, count, 3, mesh.positions);
  builder.AddFloatAttributeToMesh(object, draco.NORMAL, count, 3, mesh.normals);
  builder.AddUInt8Attribute(object, draco.COLOR, count, 3, mesh.colors);
  if (withUv) builder.AddFloatAttributeToMesh(object, draco.TEX_COORD, count, 2, mesh.uvs);
  builder.AddUInt8Attribute(object, draco.GENERIC, count, 1, mesh.confidence);
  encoder.SetEncodingMethod(draco.MESH_EDGEBREAKER_ENCODING);
  encoder.SetAttributeQuantization(draco.POSITION, 12);
  encoder.SetAttributeQuantization(draco.NORMAL, 8);
  encoder.SetAttributeQuantization(draco.TEX_COORD, 11);
  const array = new draco.DracoInt8Array();
  const length = encoder.EncodeMeshToDracoBuffer(object, array);
  if (length === 0) throw new Error('Draco could not encode the mesh');
  const bytes = Buffer.alloc(length);
  for (let n = 0; n < length; ++n) bytes[n] = array.GetValue(n) & 255;
  for (const item of [array, object, builder, encoder]) draco.destroy(item);
  return bytes;
}

/** A PNG with colored stripes, size x size. */
export function stripesPng(size) {
  const rows = Buffer.alloc(size * (1 + 3 * size));
  for (let y = 0; y < size; ++y) {
    for (let x = 0; x < size; ++x) {
      const on = ((x >> 4) + (y >> 4)) % 2;
      rows.set(on ? [230, 120, 40] : [40, 90, 200], y * (1 + 3 * size) + 1 + 3 * x);
    }
  }
  const chunk = (type, data) => {
    const all = Buffer.concat([Buffer.from(type), data]);
    const length = Buffer.alloc(4);
    length.writeUInt32BE(data.length);
    const crc = Buffer.alloc(4);
    crc.writeUInt32BE(crc32(all));
    return Buffer.concat([length, all, crc]);
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(size, 0);
  header.writeUInt32BE(size, 4);
  header.set([8, 2, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]), chunk('IHDR', header), chunk('IDAT', zlib.deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
}

function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let n = 0; n < 8; ++n) crc = (crc >>> 1) ^ (0xedb88320 & -(crc & 1));
  }
  return ~crc >>> 0;
}

const identity = { x: 0, y: 0, z: 0, w: 1 };

export function objectUpdate(id, values = {}) {
  const { position = { x: 0, y: 0, z: 0 }, half = { x: 0.1, y: 0.1, z: 0.1 }, hasMesh = false, ...rest } = values;
  const pose = { rotation: identity, translation: position };
  return { id: String(id), revision: '1', state: 'OBJECT_STATE_CONFIRMED', className: 'cup', classScore: 0.9,
           cuboid: { tWorldObject: pose, halfExtents: half, confidence: 0.8 }, observations: '12', mapId: '1',
           ...(hasMesh ? { tWorldMesh: pose, meshScale: 1 } : {}), ...rest };
}

export function ack(frameId, position, values = {}) {
  // The camera looks along +y of the world, with z up.
  const tWorldCamera = position && { rotation: { x: -Math.SQRT1_2, y: 0, z: 0, w: Math.SQRT1_2 }, translation: position };
  return { frameId: String(frameId), accepted: true, error: '', state: 'TRACKING_STATE_TRACKING', isKeyframe: false,
           latencyS: 0.02, stateReason: '', mapId: position ? '1' : '0', duplicate: false, ...(tWorldCamera ? { tWorldCamera } : {}), ...values };
}

/** Puts a mesh (with levels and a texture if it is final) into the session, and returns the event that announces it. */
export async function addMesh(session, id, revision, options = {}) {
  const { rings = 24, segments = 32, radius = 0.1, seed = Number(id), isFinal = false, steps = 1000, nextView = null } = options;
  const base = `objects/${id}/mesh/${revision}`;
  const draco = await encode(bumpyBall(rings, segments, radius, seed), isFinal);
  session.setFile(base, draco);
  const levels = [];
  const sizes = [];
  for (let n = 0; isFinal && n < 3; ++n) {
    const factor = 2 ** (n + 1);
    const [r, s] = [Math.max(4, Math.round(rings / factor)), Math.max(6, Math.round(segments / factor))];
    const bytes = await encode(bumpyBall(r, s, radius, seed), true);
    session.setFile(`${base}/levels/${n}`, bytes);
    levels.push({ draco: '', triangleCount: 2 * r * s, errorMu: radius * 0.5 * (Math.PI / s) ** 2 });
    sizes.push(bytes.length);
  }
  const texture = isFinal ? stripesPng(128) : Buffer.alloc(0);
  if (isFinal) session.setFile(`${base}/texture`, texture, 'image/png');
  return {
    mesh: { id: String(id), revision: String(revision), steps: String(steps), trainSeconds: steps / 900, isFinal,
            vertexCount: (rings + 1) * (segments + 1), triangleCount: 2 * rings * segments, draco: '', texture: '',
            textureMediaType: isFinal ? 'image/png' : '', levels, ...(nextView ? { nextView } : {}) },
    bytes: { draco: draco.length, texture: texture.length, levels: sizes },
  };
}
