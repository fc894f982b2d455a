// Cameras, images, masks and depth in their form on the wire.

import {invalid} from './errors.mjs';
import {transformToProto, vectorToProto} from './geometry.mjs';

/**
 * Pinhole camera with lens distortion, in pixels; pixel centers are at integer coordinates.
 * @typedef {object} Camera
 * @property {number} width
 * @property {number} height
 * @property {number} fx
 * @property {number} fy
 * @property {number} cx
 * @property {number} cy
 * @property {number[]} [distortion] k1 k2 p1 p2 k3, or k1 k2 k3 k4 of a fisheye lens, as in OpenCV
 * @property {'radial-tangential' | 'fisheye'} [lens] 'radial-tangential'
 * @property {number} [readoutS] of a rolling shutter: the time from the first to the last row
 */

/**
 * Pixels without padding, of the size of the camera.
 * @typedef {object} RawImage
 * @property {Uint8Array} data
 * @property {'rgb8' | 'bgr8' | 'gray8'} format
 */

/**
 * What a label of a mask means, in its frame only.
 * @typedef {object} Instance
 * @property {number} label 1..65534
 * @property {string} [className] 'object'
 * @property {number} [score] of the detector, 0..1
 * @property {number} [trackId] of the detector's tracker, if it has one
 */

/**
 * Either labels (width * height integers, row-major; 0 = no instance, 65535 = unknown) or a PNG file with one channel.
 * @typedef {object} Masks
 * @property {ArrayLike<number>} [labels]
 * @property {Uint8Array} [png]
 * @property {Instance[]} [instances] labels without one get the class 'object'
 */

/**
 * z depth: integers in units of `scale`, or floating-point numbers in the unit of the poses, 0 or NaN = unknown; or a
 * PNG file with 16 bits.
 * @typedef {object} Depth
 * @property {Uint16Array | Float32Array | Float64Array} [data]
 * @property {Uint8Array} [png]
 * @property {number} [scale] units of the poses per unit of depth; 0.001
 */

/**
 * @typedef {object} FrameInput
 * @property {Uint8Array | RawImage} image the bytes of a JPEG or PNG file, or pixels
 * @property {bigint | number} timestampNs capture time, any epoch, strictly increasing
 * @property {Masks} [masks] absent: no detector ran on this frame, or its masks follow with sendMasks()
 * @property {import('./geometry.mjs').Pose} [pose] camera to world; camera x right, y down, z forward
 * @property {Depth} [depth]
 * @property {ArrayLike<number>} [gravity] direction of gravity (down) in the camera frame
 * @property {number} [frameId] strictly increasing; absent: the next one
 */

const LENSES = {'radial-tangential': 'LENS_MODEL_RADIAL_TANGENTIAL', fisheye: 'LENS_MODEL_FISHEYE'};
const FORMATS = {
  rgb8: {encoding: 'IMAGE_ENCODING_RAW_RGB8', channels: 3},
  bgr8: {encoding: 'IMAGE_ENCODING_RAW_BGR8', channels: 3},
  gray8: {encoding: 'IMAGE_ENCODING_RAW_GRAY8', channels: 1},
};

/** @param {Camera} camera */
export function cameraToProto(camera) {
  const lens = LENSES[camera.lens ?? 'radial-tangential'];
  if (!lens) throw invalid(`camera.lens: must be one of ${Object.keys(LENSES).join(', ')}; is ${camera.lens}`);
  return {
    widthPx: camera.width,
    heightPx: camera.height,
    fxPx: camera.fx,
    fyPx: camera.fy,
    cxPx: camera.cx,
    cyPx: camera.cy,
    distortion: camera.distortion ?? [],
    lens,
    readoutS: camera.readoutS ?? 0,
  };
}

/**
 * @param {any} proto
 * @returns {Camera}
 */
export function cameraFromProto(proto) {
  return {
    width: proto.widthPx,
    height: proto.heightPx,
    fx: proto.fxPx,
    fy: proto.fyPx,
    cx: proto.cxPx,
    cy: proto.cyPx,
    distortion: proto.distortion,
    lens: proto.lens === 'LENS_MODEL_FISHEYE' ? 'fisheye' : 'radial-tangential',
    readoutS: proto.readoutS,
  };
}

/**
 * Run lengths of labels in row-major order: label, length, label, length, ...
 * @param {ArrayLike<number>} labels
 * @returns {number[]}
 */
export function labelRuns(labels) {
  const runs = [];
  for (let start = 0, end = 0; start < labels.length; start = end) {
    const label = labels[start];
    if (!Number.isInteger(label) || label < 0 || label > 65535) {
      throw invalid(`masks: labels must be integers in 0..65535; pixel ${start} has ${label}`);
    }
    while (end < labels.length && labels[end] === label) ++end;
    runs.push(label, end - start);
  }
  return runs;
}

/**
 * The labels of `size` pixels.
 * @param {ArrayLike<number>} runs
 * @param {number} size
 */
export function labelsFromRuns(runs, size) {
  const labels = new Uint16Array(size);
  let at = 0;
  for (let i = 0; i + 1 < runs.length; i += 2) {
    labels.fill(runs[i], at, at + runs[i + 1]);
    at += runs[i + 1];
  }
  if (at !== size) throw invalid(`runs: have ${at} pixels; must be ${size}`);
  return labels;
}

/**
 * @param {ArrayLike<unknown>} data
 * @param {Camera} camera
 * @param {number} channels
 * @param {string} name
 */
function checkSize(data, camera, channels, name) {
  const expected = camera.width * camera.height * channels;
  if (data.length === expected) return;
  const size = channels === 1 ? `${camera.width}x${camera.height}` : `${camera.width}x${camera.height}x${channels}`;
  throw invalid(`${name}: has ${data.length} values; the camera needs ${size} = ${expected}`);
}

/**
 * @param {Uint8Array} bytes
 * @param {number[]} magic
 */
const startsWith = (bytes, magic) => magic.every((byte, index) => bytes[index] === byte);

/**
 * @param {Uint8Array | RawImage} image
 * @param {Camera} camera
 */
export function imageToProto(image, camera) {
  if (image instanceof Uint8Array) {
    if (startsWith(image, [0x89, 0x50, 0x4e, 0x47])) return {encoding: 'IMAGE_ENCODING_PNG', data: image};
    if (startsWith(image, [0xff, 0xd8, 0xff])) return {encoding: 'IMAGE_ENCODING_JPEG', data: image};
    throw invalid('image: the bytes are neither a JPEG nor a PNG file; pass pixels as {data, format}');
  }
  const format = FORMATS[image?.format];
  if (!format) throw invalid(`image.format: must be one of ${Object.keys(FORMATS).join(', ')}; is ${image?.format}`);
  checkSize(image.data, camera, format.channels, 'image');
  return {encoding: format.encoding, data: image.data, widthPx: camera.width, heightPx: camera.height};
}

/**
 * @param {Masks} masks
 * @param {Camera} camera
 */
export function masksToProto(masks, camera) {
  const instances = (masks.instances ?? []).map(({label, className, score, trackId}) => ({
    label,
    className: className ?? 'object',
    ...(score === undefined ? {} : {score}),
    ...(trackId === undefined ? {} : {trackId: String(trackId)}),
  }));
  if (masks.png) return {labelPng: masks.png, instances};
  if (!masks.labels) throw invalid('masks: must have labels or png');
  checkSize(masks.labels, camera, 1, 'masks');
  return {labelRuns: {labelLengthPairs: labelRuns(masks.labels)}, instances};
}

/**
 * @param {Depth} depth
 * @param {Camera} camera
 */
export function depthToProto(depth, camera) {
  const scaleMu = depth.scale ?? 0.001;
  if (depth.png) return {encoding: 'DEPTH_ENCODING_PNG16', data: depth.png, scaleMu};
  if (!depth.data) throw invalid('depth: must have data or png');
  checkSize(depth.data, camera, 1, 'depth');
  const data = Buffer.alloc(2 * depth.data.length);
  const isInteger = depth.data instanceof Uint16Array;
  depth.data.forEach((value, index) => {
    const unit = isInteger ? value : Math.round(value / scaleMu);
    // 65535 means that the depth is unknown to many cameras, so it is not used for floating-point numbers.
    data.writeUInt16LE(isInteger || (unit >= 1 && unit < 65535) ? unit : 0, 2 * index);
  });
  return {encoding: 'DEPTH_ENCODING_RAW_UINT16', data, scaleMu};
}

/**
 * A Frame without an id.
 * @param {FrameInput} input
 * @param {Camera} camera
 */
export function frameToProto(input, camera) {
  return {
    timestampNs: String(input.timestampNs),
    image: imageToProto(input.image, camera),
    ...(input.masks ? {masks: masksToProto(input.masks, camera)} : {}),
    ...(input.pose ? {tWorldCamera: transformToProto(input.pose, 'pose')} : {}),
    ...(input.depth ? {depth: depthToProto(input.depth, camera)} : {}),
    ...(input.gravity ? {gravityCamera: vectorToProto(input.gravity, 'gravity')} : {}),
  };
}
