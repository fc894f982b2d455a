// The mesh of one object: the versions that are loaded, and the one that is shown.
import { Group, Matrix4, Mesh, Sphere, type BufferGeometry, type ShaderMaterial, type Texture } from 'three';
import type { MapObject } from '../state/map_store';
import { toMatrix } from './convert';
import { makeMeshMaterial } from './mesh_material';

export class ObjectMesh {
  readonly group = new Group();
  /** Of the loaded versions; -1 while there is none. */
  revision = -1;
  fault = '';
  faultRevision = -1;  // the revision that `fault` is about
  observedShare: number | null = null;  // mean confidence of the vertices, 0..1
  private readonly versions = new Map<number, Mesh<BufferGeometry, ShaderMaterial>>();
  private texture: Texture | null = null;
  private shown: Mesh<BufferGeometry, ShaderMaterial> | null = null;
  private wantedLevel = -1;
  private isSelected = false;

  constructor(readonly id: string) {
    this.group.matrixAutoUpdate = false;
  }

  get hasMesh(): boolean {
    return this.shown !== null;
  }

  get hasTexture(): boolean {
    return this.texture !== null;
  }

  hasLevel(level: number): boolean {
    return this.versions.has(level);
  }

  get shownTriangles(): number {
    return this.shown?.visible ? (this.shown.geometry.index?.count ?? 0) / 3 : 0;
  }

  get pickable(): Mesh | null {
    return this.shown;
  }

  /** In the world; null while there is no mesh. */
  boundingSphere(): Sphere | null {
    const sphere = this.shown?.geometry.boundingSphere;
    return sphere ? sphere.clone().applyMatrix4(this.group.matrix) : null;
  }

  place(object: MapObject): void {
    const { tWorldMesh, meshScale } = object.update;
    if (tWorldMesh) {
      this.group.matrix.copy(toMatrix(tWorldMesh, meshScale));
      this.group.matrixWorldNeedsUpdate = true;
    }
  }

  get matrix(): Matrix4 {
    return this.group.matrix;
  }

  /** The first version of a newer revision replaces all of the older one. */
  addVersion(revision: number, level: number, geometry: BufferGeometry): void {
    if (revision !== this.revision) this.clear();
    this.revision = revision;
    this.fault = '';
    this.versions.get(level)?.geometry.dispose();
    const material = makeMeshMaterial({
      hasNormal: geometry.hasAttribute('normal'), hasColor: geometry.hasAttribute('color'),
      hasConfidence: geometry.hasAttribute('confidence'),
    }, geometry.hasAttribute('uv') ? this.texture : null);
    const mesh = new Mesh(geometry, material);
    mesh.userData.id = this.id;
    this.versions.set(level, mesh);
    if (level === -1 || this.observedShare === null) this.observedShare = meanConfidence(geometry);
    this.show();
  }

  setTexture(revision: number, texture: Texture): void {
    if (revision !== this.revision) {
      texture.dispose();
      return;
    }
    this.texture?.dispose();
    this.texture = texture;
    for (const mesh of this.versions.values()) {
      if (!mesh.geometry.hasAttribute('uv')) continue;
      mesh.material.uniforms.uTexture!.value = texture;
      mesh.material.defines.HAS_TEXTURE = '';
      mesh.material.needsUpdate = true;
    }
  }

  setLevel(level: number): void {
    if (level === this.wantedLevel) return;
    this.wantedLevel = level;
    this.show();
  }

  setSelected(isSelected: boolean): void {
    this.isSelected = isSelected;
    if (this.shown) this.shown.material.uniforms.uSelected!.value = isSelected ? 1 : 0;
  }

  dispose(): void {
    this.clear();
    this.group.removeFromParent();
  }

  // The wanted version, or the nearest that is loaded.
  private show(): void {
    let best: number | null = null;
    for (const level of this.versions.keys()) {
      if (best === null || Math.abs(level - this.wantedLevel) < Math.abs(best - this.wantedLevel)) best = level;
    }
    const mesh = best === null ? null : (this.versions.get(best) ?? null);
    if (mesh === this.shown) return;
    if (this.shown) this.group.remove(this.shown);
    this.shown = mesh;
    if (mesh) this.group.add(mesh);
    this.setSelected(this.isSelected);
  }

  private clear(): void {
    for (const mesh of this.versions.values()) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    this.versions.clear();
    if (this.shown) this.group.remove(this.shown);
    this.shown = null;
    if (this.texture) {
      (this.texture.image as ImageBitmap | null)?.close?.();
      this.texture.dispose();
    }
    this.texture = null;
    this.observedShare = null;
  }
}

// From at most a few thousand vertices, evenly spread.
function meanConfidence(geometry: BufferGeometry): number | null {
  if (!geometry.hasAttribute('confidence')) return null;
  const bytes = geometry.getAttribute('confidence').array;
  const stride = Math.max(1, Math.floor(bytes.length / 4096));
  let sum = 0;
  let count = 0;
  for (let n = 0; n < bytes.length; n += stride, ++count) sum += bytes[n] ?? 0;
  return count === 0 ? null : sum / count / 255;
}
