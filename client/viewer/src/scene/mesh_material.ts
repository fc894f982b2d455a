// One shader for all meshes: colors of the images, normals or observation confidence, with a light at the viewer.
// Colors stay in sRGB from the file to the screen, so that they are those of the images.
import {
  BufferGeometry, DoubleSide, Mesh, ShaderMaterial, Texture, type Camera, type Scene, type WebGLRenderer,
} from 'three';

export type ColorMode = 'rgb' | 'normal' | 'confidence';

const kModes: Record<ColorMode, number> = { rgb: 0, normal: 1, confidence: 2 };

const kVertex = /* glsl */ `
attribute vec4 color;
attribute float confidence;
varying vec3 vNormalView;
varying vec3 vNormalWorld;
varying vec3 vPositionView;
varying vec3 vColor;
varying vec2 vUv;
varying float vConfidence;
void main() {
  vec4 view = modelViewMatrix * vec4(position, 1.0);
  vPositionView = view.xyz;
#ifdef HAS_NORMAL
  vNormalWorld = mat3(modelMatrix) * normal;
  vNormalView = mat3(modelViewMatrix) * normal;
#endif
#ifdef HAS_COLOR
  vColor = color.rgb;
#else
  vColor = vec3(0.72);
#endif
  vUv = uv;
#ifdef HAS_CONFIDENCE
  vConfidence = confidence;
#endif
  gl_Position = projectionMatrix * view;
}`;

// The color scale is piecewise linear from dark red (not observed) over yellow to teal (observed well), and is told
// apart with the usual color deficiencies by its lightness.
const kFragment = /* glsl */ `
uniform int uMode;
uniform float uSelected;
uniform sampler2D uTexture;
varying vec3 vNormalView;
varying vec3 vNormalWorld;
varying vec3 vPositionView;
varying vec3 vColor;
varying vec2 vUv;
varying float vConfidence;
vec3 confidenceColor(float c) {
  vec3 low = vec3(0.45, 0.08, 0.20);
  vec3 middle = vec3(0.93, 0.55, 0.20);
  vec3 high = vec3(0.55, 0.90, 0.78);
  return c < 0.5 ? mix(low, middle, c * 2.0) : mix(middle, high, c * 2.0 - 1.0);
}
void main() {
#ifdef HAS_NORMAL
  vec3 n = normalize(vNormalView);
#else
  vec3 n = normalize(cross(dFdx(vPositionView), dFdy(vPositionView)));
#endif
  float facing = abs(dot(n, normalize(vPositionView)));
  vec3 base;
  float shade;
  if (uMode == 1) {
#ifdef HAS_NORMAL
    base = 0.5 + 0.5 * normalize(vNormalWorld);
#else
    base = 0.5 + 0.5 * n;
#endif
    shade = 0.85 + 0.15 * facing;
  } else if (uMode == 2) {
#ifdef HAS_CONFIDENCE
    base = confidenceColor(vConfidence);
#else
    base = vec3(0.5);
#endif
    shade = 0.55 + 0.45 * facing;
  } else {
#ifdef HAS_TEXTURE
    base = texture2D(uTexture, vUv).rgb;
#else
    base = vColor;
#endif
    shade = 0.72 + 0.28 * facing;
  }
  vec3 result = base * shade;
  result = mix(result, vec3(0.08, 0.72, 0.65), uSelected * 0.45 * (1.0 - facing));
  gl_FragColor = vec4(result, 1.0);
}`;

export interface MeshFeatures { hasNormal: boolean; hasColor: boolean; hasConfidence: boolean }

/** Shared by all materials, so that a change of the mode is one assignment. */
const sharedMode = { value: 0 };

export function setColorMode(mode: ColorMode): void {
  sharedMode.value = kModes[mode];
}

export function makeMeshMaterial(features: MeshFeatures, texture: Texture | null): ShaderMaterial {
  const defines: Record<string, string> = {};
  if (features.hasNormal) defines.HAS_NORMAL = '';
  if (features.hasColor) defines.HAS_COLOR = '';
  if (features.hasConfidence) defines.HAS_CONFIDENCE = '';
  if (texture) defines.HAS_TEXTURE = '';
  const material = new ShaderMaterial({
    vertexShader: kVertex, fragmentShader: kFragment, side: DoubleSide, defines,
    uniforms: { uMode: sharedMode, uSelected: { value: 0 }, uTexture: { value: texture } },
  });
  // ShaderMaterial copies the values of uniforms.
  material.uniforms.uMode = sharedMode;
  return material;
}

/** Begins to compile the shaders for the meshes of the server, so that the first mesh does not wait for them. */
export function warmUp(renderer: WebGLRenderer, camera: Camera, scene: Scene): void {
  const texture = new Texture();
  const features = { hasNormal: true, hasColor: true, hasConfidence: true };
  for (const map of [null, texture]) {
    const mesh = new Mesh(new BufferGeometry(), makeMeshMaterial(features, map));
    renderer.compile(mesh, camera, scene);
    // Not disposed of: the renderer would drop the compiled shader with its last material.
    kept.push(mesh.material);
  }
}

const kept: ShaderMaterial[] = [];
