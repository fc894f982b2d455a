// The objects of the shown map: cuboids, meshes with levels of detail, and what has to be loaded for them.
import { Box3, Group, Raycaster, Vector3, type BufferGeometry, type Texture } from 'three';
import type { ApiClient } from '../api/client';
import { corners, rayCuboid } from '../state/geometry';
import type { MapObject, MapStore } from '../state/map_store';
import { chooseLevels, type LodCandidate } from './lod';
import { kDark, type SceneColors } from './colors';
import { toVector3 } from './convert';
import { CuboidLines } from './cuboid_lines';
import { MeshSource, type MeshKey, type MeshSink } from './mesh_source';
import { ObjectMesh } from './object_mesh';
import type { Stage } from './stage';

export interface ObjectHit { id: string; point: Vector3; distance: number }

const kMaxTriangles = 3_000_000;  // of one version; beyond, a browser is likely to fail

export class ObjectLayer implements MeshSink {
  readonly group = new Group();
  selected: string | null = null;
  showMeshes = true;
  showCuboids = true;
  showProvisional = true;
  shownMap: string | null = null;  // null: that of the newest pose
  colors: SceneColors = kDark;
  /** A mesh arrived or failed. */
  onMesh: (id: string) => void = () => undefined;
  private readonly meshes = new Map<string, ObjectMesh>();
  private readonly cuboids = new CuboidLines();
  private readonly source: MeshSource;
  private levelsAreStale = true;

  constructor(private readonly stage: Stage, private readonly store: MapStore, api: ApiClient, sessionId: string) {
    this.source = new MeshSource(api, sessionId, this);
    this.group.add(this.cuboids.lines);
    stage.scene.add(this.group);
  }

  isShown(object: MapObject): boolean {
    const { mapId, state } = object.update;
    const map = this.shownMap ?? this.store.shownMapId();
    return (map === '0' || mapId === '0' || mapId === map) && (this.showProvisional || state !== 'PROVISIONAL');
  }

  visibleObjects(): MapObject[] {
    return [...this.store.objects.values()].filter((o) => this.isShown(o));
  }

  mesh(id: string): ObjectMesh | null {
    return this.meshes.get(id) ?? null;
  }

  /** Objects of `ids` changed; null: all, and what is shown. */
  refresh(ids: ReadonlySet<string> | null): void {
    for (const id of ids ?? new Set([...this.meshes.keys(), ...this.store.objects.keys()])) this.refreshObject(id);
    this.cuboids.lines.visible = this.showCuboids || this.selected !== null;
    this.cuboids.set(
      this.visibleObjects().map((o) => o.update)
        .filter((u) => this.showCuboids || u.id === this.selected), this.selected, this.colors);
    this.levelsAreStale = true;
    this.stage.invalidate();
  }

  select(id: string | null): void {
    if (this.selected) this.meshes.get(this.selected)?.setSelected(false);
    this.selected = id;
    if (id) this.meshes.get(id)?.setSelected(true);
    this.refresh(new Set());
  }

  noteViewChanged(): void {
    this.levelsAreStale = true;
  }

  /** Chooses levels of detail for the present view, and asks for those that are missing. */
  updateLevels(): void {
    if (!this.levelsAreStale) return;
    this.levelsAreStale = false;
    const candidates: LodCandidate[] = [];
    for (const object of this.visibleObjects()) {
      if (!object.mesh || !object.update.tWorldMesh) continue;
      candidates.push({
        id: object.update.id, distanceMu: this.distanceTo(object), triangleCount: object.mesh.triangleCount,
        levels: object.mesh.levels.map((l) => ({
          triangleCount: l.triangleCount, errorMu: l.errorMu * object.update.meshScale,
        })),
      });
    }
    const chosen = chooseLevels(candidates, {
      pxPerMuAtUnitDistance: this.stage.pxPerMu(), tolerancePx: 1,
      maxTriangles: this.stage.isSoftware ? 250_000 : 4_000_000,
    });
    this.source.clearWaiting();
    for (const candidate of candidates) {
      this.want(candidate.id, chosen.get(candidate.id) ?? -1, 1 / (1e-6 + candidate.distanceMu));
    }
  }

  get pending(): number {
    return this.source.pending;
  }

  get triangles(): number {
    let sum = 0;
    for (const mesh of this.meshes.values()) if (mesh.group.visible) sum += mesh.shownTriangles;
    return sum;
  }

  pick(raycaster: Raycaster): ObjectHit | null {
    let best: ObjectHit | null = null;
    const { origin, direction } = raycaster.ray;
    for (const object of this.visibleObjects()) {
      const id = object.update.id;
      const mesh = this.meshes.get(id);
      if (mesh?.pickable && mesh.group.visible) {
        const hit = raycaster.intersectObject(mesh.pickable, false)[0];
        if (hit && (!best || hit.distance < best.distance)) best = { id, point: hit.point, distance: hit.distance };
      } else if (object.update.cuboid && this.showCuboids) {
        const distance = rayCuboid(origin, direction, object.update.cuboid);
        if (distance === null || (best && best.distance <= distance)) continue;
        best = { id, distance, point: origin.clone().addScaledVector(direction, distance) };
      }
    }
    return best;
  }

  boxOf(objects: readonly MapObject[]): Box3 {
    const box = new Box3();
    for (const { update } of objects) {
      if (update.cuboid) for (const corner of corners(update.cuboid)) box.expandByPoint(toVector3(corner));
    }
    return box;
  }

  loaded(key: MeshKey, geometry: BufferGeometry): void {
    const mesh = this.meshes.get(key.id);
    const object = this.store.objects.get(key.id);
    // A version of an older revision is still better than an even older one.
    if (!mesh || !object?.mesh || (key.revision < mesh.revision && key.revision !== object.mesh.revision)) {
      geometry.dispose();
      return;
    }
    mesh.addVersion(key.revision, key.level, geometry);
    this.changed(key.id);
  }

  failed(key: MeshKey, note: string): void {
    const mesh = this.meshes.get(key.id);
    if (!mesh || this.store.objects.get(key.id)?.mesh?.revision !== key.revision) return;
    mesh.fault = key.level === -2 ? `The texture of this object cannot be shown: ${note}.`
      : `The newest mesh of this object cannot be shown: ${note}. ` +
        (mesh.hasMesh ? 'An older or simpler one is shown.' : 'Its cuboid is shown.');
    mesh.faultRevision = key.revision;
    this.changed(key.id);
  }

  texture(key: MeshKey, texture: Texture): void {
    const mesh = this.meshes.get(key.id);
    if (!mesh) return texture.dispose();
    mesh.setTexture(key.revision, texture);
    this.changed(key.id);
  }

  dispose(): void {
    this.source.dispose();
    for (const mesh of this.meshes.values()) mesh.dispose();
    this.meshes.clear();
  }

  private changed(id: string): void {
    this.refreshObject(id);
    this.levelsAreStale = true;
    this.onMesh(id);
    this.stage.invalidate();
  }

  private refreshObject(id: string): void {
    const object = this.store.objects.get(id);
    let mesh = this.meshes.get(id);
    if (!object) {
      mesh?.dispose();
      this.meshes.delete(id);
      if (this.selected === id) this.selected = null;
      return;
    }
    if (!mesh) {
      mesh = new ObjectMesh(id);
      this.meshes.set(id, mesh);
      this.group.add(mesh.group);
    }
    mesh.place(object);
    mesh.group.visible = this.showMeshes && this.isShown(object) && object.update.tWorldMesh !== null;
    mesh.setSelected(id === this.selected);
  }

  private distanceTo(object: MapObject): number {
    const { cuboid, tWorldMesh } = object.update;
    const center = cuboid?.tWorldObject.translation ?? tWorldMesh?.translation;
    if (!center) return 0;
    const h = cuboid?.halfExtents;
    const radius = h ? Math.hypot(h.x, h.y, h.z) : 0;
    return Math.max(0, this.stage.camera.position.distanceTo(toVector3(center)) - radius);
  }

  private want(id: string, level: number, priority: number): void {
    const object = this.store.objects.get(id);
    const shown = this.meshes.get(id);
    const mesh = object?.mesh;
    if (!mesh || !shown) return;
    shown.setLevel(level);
    const isCurrent = shown.revision === mesh.revision;
    if (shown.faultRevision === mesh.revision) return;
    const count = level < 0 ? mesh.triangleCount : (mesh.levels[level]?.triangleCount ?? 0);
    if (count > kMaxTriangles) {
      this.failed({ id, revision: mesh.revision, level },
                  `it has ${(count / 1e6).toFixed(1)} million triangles, more than a browser can show`);
      return;
    }
    // The coarsest version first: it is there at once.
    const coarse = mesh.levels.length - 1;
    if (!isCurrent && coarse > level && coarse >= 0) {
      this.source.want({ id, revision: mesh.revision, level: coarse, bytes: mesh.levels[coarse]?.bytes ?? 0, priority: priority * 10 });
    }
    if (!isCurrent || !shown.hasLevel(level)) {
      const bytes = level < 0 ? mesh.bytes : (mesh.levels[level]?.bytes ?? 0);
      this.source.want({ id, revision: mesh.revision, level, bytes, priority });
    } else if (mesh.textureBytes > 0 && !shown.hasTexture) {
      this.source.want({ id, revision: mesh.revision, level: -2, bytes: mesh.textureBytes, priority: priority / 10 });
    }
  }
}
