// The 3D view of one session: brings the layers together, and draws when one of them changes.
import { Box3, Raycaster, Vector2, Vector3 } from 'three';
import type { ApiClient } from '../api/client';
import type { SessionInfo } from '../api/types';
import { length } from '../ui/format';
import type { Changes, MapStore } from '../state/map_store';
import type { PathStore } from '../state/path_store';
import { CameraLayer } from './camera_layer';
import { kDark, kLight, type SceneColors } from './colors';
import { ViewControls } from './controls';
import { toVector3 } from './convert';
import { GroundGrid } from './ground_grid';
import { LabelLayer, type Label } from './labels';
import { MeasureTool } from './measure';
import { setColorMode, warmUp } from './mesh_material';
import { NextViewArrows, nextViewDirection } from './next_view_arrows';
import { ObjectLayer } from './object_layer';
import { PointsLayer } from './points_layer';
import { Stage } from './stage';
import { kDefaultSettings, type ViewSettings } from './view_settings';

const kClickPx = 5;

export class SessionScene {
  readonly stage: Stage;
  readonly controls: ViewControls;
  readonly objects: ObjectLayer;
  readonly points: PointsLayer;
  readonly camera: CameraLayer;
  readonly measure: MeasureTool;
  settings: ViewSettings = { ...kDefaultSettings };
  onSelect: (id: string | null) => void = () => undefined;
  onMeasured: () => void = () => undefined;
  private readonly labels: LabelLayer;
  private readonly arrows = new NextViewArrows();
  private readonly grid = new GroundGrid();
  private colors: SceneColors = kDark;
  private box = new Box3();
  private down: { x: number; y: number } | null = null;

  /** Throws if the browser has no WebGL. */
  constructor(host: HTMLElement, private readonly store: MapStore, private readonly path: PathStore, api: ApiClient,
              info: SessionInfo, reducedMotion: () => boolean) {
    this.stage = new Stage(host);
    this.controls = new ViewControls(this.stage, reducedMotion);
    this.objects = new ObjectLayer(this.stage, store, api, info.id);
    this.points = new PointsLayer(this.stage, api, info.id);
    this.camera = new CameraLayer(this.stage, info.camera ?? undefined);
    this.measure = new MeasureTool(this.stage);
    this.labels = new LabelLayer(this.stage);
    this.stage.scene.add(this.arrows.group, this.grid.group);
    this.stage.onFrame = (dt) => {
      const isMoving = this.controls.update(dt);
      this.objects.updateLevels();
      return isMoving;
    };
    this.stage.onResized = () => {
      if (!this.controls.hasMoved) this.controls.fit(this.box, false);
    };
    this.stage.onRendered = () => this.labels.place();
    const moved = this.stage.noteMotion.bind(this.stage);
    this.stage.noteMotion = () => {
      this.objects.noteViewChanged();
      moved();
    };
    this.stage.canvas.addEventListener('pointerdown', this.onDown);
    this.stage.canvas.addEventListener('pointerup', this.onUp);
    this.stage.canvas.addEventListener('dblclick', () => this.zoomTo(this.objects.selected));
    warmUp(this.stage.renderer, this.stage.camera, this.stage.scene);
    this.controls.fit(new Box3(new Vector3(-1, -1, 0), new Vector3(1, 1, 1)), false);
  }

  setTheme(isDark: boolean): void {
    this.colors = isDark ? kDark : kLight;
    this.objects.colors = this.colors;
    this.stage.setBackground(this.colors.background);
    this.points.setColor(this.colors.points);
    this.measure.setColor(this.colors.measure);
    this.refreshAll();
  }

  apply(settings: ViewSettings): void {
    this.settings = settings;
    setColorMode(settings.color);
    this.objects.showMeshes = settings.meshes;
    this.objects.showCuboids = settings.cuboids;
    this.objects.showProvisional = settings.provisional;
    this.objects.shownMap = settings.map;
    this.points.setVisible(settings.points);
    this.refreshAll();
  }

  applyChanges(changes: Changes): void {
    if (changes.objects.size > 0) {
      this.objects.refresh(changes.objects);
      this.refreshExtent();
      this.refreshMarks();
    }
    if (changes.hasNewFrame) this.refreshPath();
  }

  refreshPath(): void {
    const map = this.settings.map ?? this.store.shownMapId();
    const poses = this.path.poses.filter((p) => map === '0' || p.mapId === '0' || p.mapId === map);
    const newest = poses[poses.length - 1] ?? null;
    this.camera.group.visible = this.settings.path;
    this.camera.setPath(poses, this.colors);
    const ack = this.store.lastAck;
    this.camera.setPose(newest, !ack || ack.tWorldCamera !== null, this.colors);
    this.refreshImage();
    this.controls.follow(newest?.pose ?? null);
    if (this.box.isEmpty() && newest) this.refreshExtent();
  }

  refreshImage(): void {
    // Behind the camera of the session, the image would hide the objects.
    this.camera.setImageVisible(this.settings.image && this.controls.mode !== 'follow');
  }

  select(id: string | null): void {
    this.objects.select(id);
    this.refreshMarks();
  }

  zoomTo(id: string | null): void {
    const object = id ? this.store.objects.get(id) : undefined;
    if (!object) return this.fit();
    const box = this.objects.boxOf([object]);
    const hadMoved = this.controls.hasMoved;
    this.controls.hasMoved = true;
    this.controls.fit(box.expandByScalar(0.35 * box.getSize(new Vector3()).length()), hadMoved);
  }

  /** Shows everything. */
  fit(): void {
    this.refreshExtent();
    this.controls.fit(this.box, true);
  }

  startMeasuring(isActive: boolean): void {
    this.measure.setActive(isActive);
    this.stage.canvas.classList.toggle('crosshair', isActive);
    this.refreshMarks();
  }

  /** The object at a place of the canvas (CSS pixels), and the point on it. */
  pickAt(x: number, y: number): { id: string | null; point: Vector3 } | null {
    const raycaster = new Raycaster();
    const { clientWidth, clientHeight } = this.stage.host;
    raycaster.setFromCamera(new Vector2((x / clientWidth) * 2 - 1, 1 - (y / clientHeight) * 2), this.stage.camera);
    const hit = this.objects.pick(raycaster);
    if (hit || !this.measure.isActive || !this.settings.points) return hit;
    raycaster.params.Points.threshold = 0.01 * this.controls.sceneSize;
    const point = raycaster.intersectObject(this.points.points, false)[0];
    return point ? { id: null, point: point.point } : null;
  }

  dispose(): void {
    this.objects.dispose();
    this.points.dispose();
    this.camera.dispose();
    this.controls.dispose();
    this.labels.host.remove();
    this.stage.dispose();
  }

  private refreshAll(): void {
    this.objects.refresh(null);
    this.refreshPath();
    this.refreshExtent();
    this.refreshMarks();
  }

  /** Labels, arrows and the measured distance. */
  private refreshMarks(): void {
    const visible = this.objects.visibleObjects();
    const selected = this.objects.selected;
    const withArrow = visible.filter((o) => this.settings.arrows || o.update.id === selected);
    const tails = this.arrows.set(withArrow, this.colors.arrow);
    const labels: Label[] = [];
    for (const { update } of visible) {
      const isSelected = update.id === selected;
      if (!update.cuboid || (!this.settings.labels && !isSelected)) continue;
      const { translation } = update.cuboid.tWorldObject;
      labels.push({
        key: update.id, text: update.className, priority: isSelected ? 2 : update.state === 'PROVISIONAL' ? 0 : 1,
        point: toVector3(translation).add(new Vector3(0, 0, update.cuboid.halfExtents.z)),
        className: isSelected ? 'selected' : update.state.toLowerCase(),
      });
    }
    for (const object of withArrow) {
      const tail = tails.get(object.update.id);
      if (!tail || !nextViewDirection(object)) continue;
      labels.push({ key: `view-${object.update.id}`, text: 'look here next', point: tail, className: 'arrow', priority: 1 });
    }
    const distance = this.measure.distance();
    const middle = this.measure.middle();
    if (distance !== null && middle) {
      labels.push({ key: 'measure', text: `${length(distance)} map units`, point: middle, className: 'measure', priority: 3 });
    }
    this.labels.set(labels);
    this.stage.invalidate();
  }

  // The extent of the shown map; follows the map until the person moves the view.
  private refreshExtent(): void {
    const visible = this.objects.visibleObjects();
    const confirmed = visible.filter((o) => o.update.state !== 'PROVISIONAL');
    const box = this.objects.boxOf(confirmed.length > 0 ? confirmed : visible);
    const objectsBox = box.clone();
    if (this.settings.path) {
      const stride = Math.max(1, Math.floor(this.path.poses.length / 200));
      for (let n = 0; n < this.path.poses.length; n += stride) {
        box.expandByPoint(toVector3(this.path.poses[n]!.pose.translation));
      }
    }
    if (box.isEmpty()) return;
    // A long path would make the objects small: only what is near them decides on the view.
    if (!objectsBox.isEmpty()) {
      box.intersect(objectsBox.clone().expandByScalar(0.15 * objectsBox.getSize(new Vector3()).length()));
    }
    const size = Math.max(1e-6, box.getSize(new Vector3()).length());
    const grew = this.box.isEmpty() || !this.box.clone().expandByScalar(0.05 * size).containsBox(box);
    this.box = box;
    this.controls.sceneSize = size;
    this.camera.setDepth(0.08 * size);
    this.grid.group.visible = this.settings.grid;
    this.grid.set(objectsBox.isEmpty() ? box : objectsBox, confirmed.flatMap(({ update }) => (update.cuboid
      ? [update.cuboid.tWorldObject.translation.z - update.cuboid.halfExtents.z] : [])), this.colors.grid);
    if (!this.controls.hasMoved && grew) this.controls.fit(box, false);
  }

  get gridStep(): number | null {
    return this.box.isEmpty() || !this.settings.grid ? null : this.grid.step;
  }

  private readonly onDown = (event: PointerEvent): void => {
    this.down = event.isPrimary && event.button === 0 ? { x: event.clientX, y: event.clientY } : null;
  };

  private readonly onUp = (event: PointerEvent): void => {
    const down = this.down;
    this.down = null;
    if (!down || Math.hypot(event.clientX - down.x, event.clientY - down.y) > kClickPx) return;
    const rect = this.stage.canvas.getBoundingClientRect();
    const hit = this.pickAt(event.clientX - rect.left, event.clientY - rect.top);
    if (this.measure.isActive) {
      if (hit) this.measure.addPoint(hit.point);
      this.refreshMarks();
      this.onMeasured();
      return;
    }
    this.onSelect(hit?.id ?? null);
  };
}
