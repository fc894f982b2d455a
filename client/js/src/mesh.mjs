// Meshes as typed arrays.

// @ts-expect-error The package has no types.
import draco3d from 'draco3d';
import {RomapError, invalid} from './errors.mjs';
import {rotate, transform} from './geometry.mjs';

/**
 * A triangle mesh. Arrays that it does not have are null.
 * @typedef {object} Mesh
 * @property {Float32Array} vertices x, y, z, x, y, z, ...
 * @property {Uint32Array} triangles three indices each, counter-clockwise viewed from outside
 * @property {Float32Array | null} normals as vertices, unit length
 * @property {Uint8Array | null} colors r, g, b of each vertex, sRGB
 * @property {Float32Array | null} uv u, v of each vertex: u to the right, v down, as in glTF
 * @property {Uint8Array | null} confidence how well the views observed each vertex, 0..255
 */

/** @type {Promise<any> | null} */
let decoderModule = null;

/**
 * @param {any} draco
 * @param {any} decoder
 * @param {any} mesh
 * @param {number} kind
 * @param {number} components
 * @param {Float32ArrayConstructor | Uint8ArrayConstructor} Type
 * @returns {any} null: the mesh does not have it
 */
function readAttribute(draco, decoder, mesh, kind, components, Type) {
  const id = decoder.GetAttributeId(mesh, kind);
  if (id < 0) return null;
  const attribute = decoder.GetAttribute(mesh, id);
  if (attribute.num_components() !== components) {
    throw invalid(`Draco mesh: attribute ${kind} has ${attribute.num_components()} components; must be ${components}`);
  }
  const bytes = mesh.num_points() * components * Type.BYTES_PER_ELEMENT;
  const type = Type === Float32Array ? draco.DT_FLOAT32 : draco.DT_UINT8;
  const pointer = draco._malloc(bytes);
  try {
    if (!decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, type, bytes, pointer)) {
      throw invalid(`Draco mesh: attribute ${kind} has another type`);
    }
    return new Type(draco.HEAPU8.slice(pointer, pointer + bytes).buffer);
  } finally {
    draco._free(pointer);
  }
}

/**
 * @param {any} draco
 * @param {any} decoder
 * @param {any} mesh
 */
function readTriangles(draco, decoder, mesh) {
  const bytes = mesh.num_faces() * 3 * Uint32Array.BYTES_PER_ELEMENT;
  const pointer = draco._malloc(bytes);
  try {
    decoder.GetTrianglesUInt32Array(mesh, bytes, pointer);
    return new Uint32Array(draco.HEAPU8.slice(pointer, pointer + bytes).buffer);
  } finally {
    draco._free(pointer);
  }
}

/**
 * Decodes MeshUpdate.draco. INVALID_ARGUMENT: not a mesh of romap.
 * @param {Uint8Array} data
 * @returns {Promise<Mesh>}
 */
export async function decodeMesh(data) {
  decoderModule ??= draco3d.createDecoderModule({});
  const draco = await decoderModule;
  const decoder = new draco.Decoder();
  const buffer = new draco.DecoderBuffer();
  const mesh = new draco.Mesh();
  try {
    buffer.Init(new Int8Array(data.buffer, data.byteOffset, data.byteLength), data.byteLength);
    if (decoder.GetEncodedGeometryType(buffer) !== draco.TRIANGULAR_MESH) {
      throw invalid(`not a Draco mesh: ${data.byteLength} bytes`);
    }
    const status = decoder.DecodeBufferToMesh(buffer, mesh);
    if (!status.ok()) throw invalid(`Draco decoder: ${status.error_msg()}`);
    const read = readAttribute.bind(null, draco, decoder, mesh);
    return {
      vertices: read(draco.POSITION, 3, Float32Array) ?? new Float32Array(),
      triangles: readTriangles(draco, decoder, mesh),
      normals: read(draco.NORMAL, 3, Float32Array),
      colors: read(draco.COLOR, 3, Uint8Array),
      uv: read(draco.TEX_COORD, 2, Float32Array),
      confidence: read(draco.GENERIC, 1, Uint8Array),
    };
  } catch (error) {
    if (error instanceof RomapError) throw error;
    decoderModule = null; // an abort, e.g. for lack of memory, leaves the module unusable
    throw invalid(`Draco decoder: ${error}`);
  } finally {
    for (const each of [mesh, buffer, decoder]) draco.destroy(each);
  }
}

/**
 * The mesh of an object in the world, with vertices in double precision; null: it has none yet.
 * @param {import('./events.mjs').MapObject} object
 * @returns {Promise<Omit<Mesh, 'vertices'> & {vertices: Float64Array} | null>}
 */
export async function worldMesh({object, mesh}) {
  const pose = object.meshPose;
  if (!mesh || !pose) return null;
  const decoded = await decodeMesh(mesh.draco);
  const vertices = new Float64Array(decoded.vertices.length);
  const normals = decoded.normals && new Float32Array(decoded.normals.length);
  for (let i = 0; i < vertices.length; i += 3) {
    const scaled = decoded.vertices.subarray(i, i + 3).map((value) => object.meshScale * value);
    vertices.set(transform(pose, scaled), i);
    normals?.set(rotate(pose.rotation, /** @type {Float32Array} */ (decoded.normals).subarray(i, i + 3)), i);
  }
  return {...decoded, vertices, normals};
}
