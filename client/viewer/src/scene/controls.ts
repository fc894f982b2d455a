// How the view moves: around a point, freely through the map, or behind the camera of the session.
import { Box3, MathUtils, Quaternion, Vector3 } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Rigid } from '../api/types';
import type { Stage } from './stage';

export type ViewMode = 'orbit' | 'fly' | 'follow';

const kLookPerPx = 0.004;
const kFlyKeys: Record<string, [number, number, number]> = {  // right, forward, up
  KeyW: [0, 1, 0], ArrowUp: [0, 1, 0], KeyS: [0, -1, 0], ArrowDown: [0, -1, 0], KeyA: [-1, 0, 0],
  ArrowLeft: [-1, 0, 0], KeyD: [1, 0, 0], ArrowRight: [1, 0, 0], KeyE: [0, 0, 1], KeyQ: [0, 0, -1],
};
const kOrbitKeys: Record<string, [number, number]> = {  // azimuth, elevation in radians
  ArrowLeft: [0.09, 0], ArrowRight: [-0.09, 0], ArrowUp: [0, 0.06], ArrowDown: [0, -0.06],
};

interface Flight { toPosition: Vector3; toTarget: Vector3; fromPosition: Vector3; fromTarget: Vector3; t: number }

export class ViewControls {
  mode: ViewMode = 'orbit';
  /** The person has moved the view; it is not fitted by itself any more. */
  hasMoved = false;
  sceneSize = 1;  // map units; speed of flying and distance of following
  onMode: (mode: ViewMode) => void = () => undefined;
  private readonly orbit: OrbitControls;
  private readonly pressed = new Set<string>();
  private followed: Rigid | null = null;
  private flight: Flight | null = null;
  private drag: { id: number; x: number; y: number } | null = null;

  constructor(private readonly stage: Stage, private readonly reducedMotion: () => boolean) {
    this.orbit = new OrbitControls(stage.camera, stage.canvas);
    this.orbit.enableDamping = !reducedMotion();
    this.orbit.dampingFactor = 0.18;
    this.orbit.zoomToCursor = true;
    this.orbit.minPolarAngle = 0.02;
    this.orbit.maxPolarAngle = Math.PI - 0.02;
    this.orbit.addEventListener('change', () => stage.noteMotion());
    this.orbit.addEventListener('start', () => {
      this.hasMoved = true;
      this.flight = null;
    });
    stage.canvas.addEventListener('pointerdown', this.onPointerDown);
    stage.canvas.addEventListener('pointermove', this.onPointerMove);
    stage.canvas.addEventListener('pointerup', this.onPointerUp);
    stage.canvas.addEventListener('pointercancel', this.onPointerUp);
    stage.canvas.addEventListener('keydown', this.onKeyDown);
    stage.canvas.addEventListener('keyup', this.onKeyUp);
    stage.canvas.addEventListener('blur', this.onBlur);
  }

  get target(): Vector3 {
    return this.orbit.target;
  }

  setMode(mode: ViewMode): void {
    if (mode === this.mode) return;
    if (mode === 'orbit') this.orbit.target.copy(this.pointAhead());
    this.mode = mode;
    this.hasMoved = true;
    this.flight = null;
    this.pressed.clear();
    this.orbit.enabled = mode === 'orbit';
    this.onMode(mode);
    this.stage.noteMotion();
  }

  follow(pose: Rigid | null): void {
    this.followed = pose;
    if (this.mode === 'follow') this.stage.invalidate();
  }

  /** Shows the box from the present direction. */
  fit(box: Box3, animated: boolean): void {
    if (box.isEmpty()) return;
    const center = box.getCenter(new Vector3());
    const radius = Math.max(1e-3, box.getSize(new Vector3()).length() / 2);
    const fov = MathUtils.degToRad(this.stage.camera.fov);
    const narrow = Math.min(1, this.stage.camera.aspect);
    const distance = (radius / Math.sin(fov / 2) / narrow) * 0.92;
    const direction = this.stage.camera.position.clone().sub(this.orbit.target);
    if (!this.hasMoved || direction.lengthSq() < 1e-12) direction.set(-0.75, -1, 0.75);
    const position = center.clone().add(direction.normalize().multiplyScalar(distance));
    if (this.mode !== 'orbit') this.setMode('orbit');
    if (!animated || this.reducedMotion()) {
      this.flight = null;
      this.stage.camera.position.copy(position);
      this.orbit.target.copy(center);
    } else {
      this.flight = {
        toPosition: position, toTarget: center, fromPosition: this.stage.camera.position.clone(),
        fromTarget: this.orbit.target.clone(), t: 0,
      };
    }
    this.stage.noteMotion();
  }

  /** Moves the view by one step of time. Returns whether it is still moving. */
  update(dt: number): boolean {
    this.setClipping();
    if (this.flight) return this.stepFlight(dt);
    if (this.mode === 'orbit') return this.orbit.update();
    if (this.mode === 'fly') return this.stepFly(dt);
    return this.stepFollow(dt);
  }

  dispose(): void {
    this.orbit.dispose();
  }

  private setClipping(): void {
    const camera = this.stage.camera;
    const reach = camera.position.distanceTo(this.orbit.target) + this.sceneSize;
    const near = Math.max(reach * 1e-3, 1e-5);
    if (Math.abs(Math.log(camera.near / near)) < 0.2) return;
    camera.near = near;
    camera.far = reach * 60;
    camera.updateProjectionMatrix();
  }

  private stepFlight(dt: number): boolean {
    const flight = this.flight;
    if (!flight) return false;
    flight.t = Math.min(1, flight.t + dt / 0.45);
    const s = flight.t * flight.t * (3 - 2 * flight.t);
    this.stage.camera.position.lerpVectors(flight.fromPosition, flight.toPosition, s);
    this.orbit.target.lerpVectors(flight.fromTarget, flight.toTarget, s);
    if (flight.t >= 1) this.flight = null;
    this.orbit.update();
    return true;
  }

  private pointAhead(): Vector3 {
    const camera = this.stage.camera;
    const forward = camera.getWorldDirection(new Vector3());
    const distance = Math.max(0.2 * this.sceneSize, Math.min(camera.position.distanceTo(this.orbit.target),
                                                             2 * this.sceneSize));
    return camera.position.clone().add(forward.multiplyScalar(distance));
  }

  private stepFly(dt: number): boolean {
    if (this.pressed.size === 0) return false;
    const camera = this.stage.camera;
    const forward = camera.getWorldDirection(new Vector3());
    const right = forward.clone().cross(camera.up).normalize();
    const step = new Vector3();
    for (const key of this.pressed) {
      const motion = kFlyKeys[key];
      if (motion) step.addScaledVector(right, motion[0]).addScaledVector(forward, motion[1]).addScaledVector(camera.up, motion[2]);
    }
    const speed = this.sceneSize * (this.pressed.has('ShiftLeft') || this.pressed.has('ShiftRight') ? 1.2 : 0.4);
    if (step.lengthSq() === 0) return false;
    camera.position.addScaledVector(step.normalize(), speed * dt);
    this.stage.noteMotion();
    return true;
  }

  private stepFollow(dt: number): boolean {
    if (!this.followed) return false;
    const camera = this.stage.camera;
    const { rotation, translation } = this.followed;
    const q = new Quaternion(rotation.x, rotation.y, rotation.z, rotation.w);
    const eye = new Vector3(translation.x, translation.y, translation.z);
    const forward = new Vector3(0, 0, 1).applyQuaternion(q);
    const back = 0.35 * this.sceneSize;
    const position = eye.clone().addScaledVector(forward, -back).addScaledVector(camera.up, 0.35 * back);
    const target = eye.clone().addScaledVector(forward, back);
    const share = this.reducedMotion() ? 1 : 1 - Math.exp(-6 * dt);
    camera.position.lerp(position, share);
    this.orbit.target.lerp(target, share);
    camera.lookAt(this.orbit.target);
    const rest = camera.position.distanceTo(position) + this.orbit.target.distanceTo(target);
    if (rest > 2e-3 * this.sceneSize) {
      this.stage.noteMotion();
      return true;
    }
    return false;
  }

  private readonly onPointerDown = (event: PointerEvent): void => {
    if (this.mode === 'fly' && event.isPrimary) this.drag = { id: event.pointerId, x: event.clientX, y: event.clientY };
    if (this.mode === 'follow' && event.pointerType !== 'mouse') return;
    if (this.mode === 'fly') this.stage.canvas.setPointerCapture(event.pointerId);
  };

  private readonly onPointerMove = (event: PointerEvent): void => {
    if (!this.drag || event.pointerId !== this.drag.id) return;
    const camera = this.stage.camera;
    const yaw = -(event.clientX - this.drag.x) * kLookPerPx;
    const pitch = -(event.clientY - this.drag.y) * kLookPerPx;
    this.drag = { id: event.pointerId, x: event.clientX, y: event.clientY };
    const forward = camera.getWorldDirection(new Vector3());
    const elevation = MathUtils.clamp(Math.asin(MathUtils.clamp(forward.z, -1, 1)) + pitch, -1.5, 1.5);
    const azimuth = Math.atan2(forward.y, forward.x) + yaw;
    forward.set(Math.cos(azimuth) * Math.cos(elevation), Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation));
    camera.lookAt(camera.position.clone().add(forward));
    this.stage.noteMotion();
  };

  private readonly onPointerUp = (event: PointerEvent): void => {
    if (event.pointerId === this.drag?.id) this.drag = null;
  };

  private readonly onKeyDown = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.mode === 'fly' && (kFlyKeys[event.code] || event.code.startsWith('Shift'))) {
      this.pressed.add(event.code);
      this.stage.noteMotion();
      event.preventDefault();
      return;
    }
    const turn = kOrbitKeys[event.code];
    if (this.mode === 'orbit' && turn) {
      this.turn(turn[0], turn[1]);
      event.preventDefault();
    }
  };

  /** Turns around the target; also zooms with `factor`. */
  turn(azimuth: number, elevation: number, factor = 1): void {
    const camera = this.stage.camera;
    const offset = camera.position.clone().sub(this.orbit.target);
    const r = offset.length() * factor;
    const angle = Math.atan2(offset.y, offset.x) + azimuth;
    const height = MathUtils.clamp(Math.asin(MathUtils.clamp(offset.z / offset.length(), -1, 1)) + elevation, -1.5, 1.5);
    offset.set(Math.cos(angle) * Math.cos(height), Math.sin(angle) * Math.cos(height), Math.sin(height));
    camera.position.copy(this.orbit.target).addScaledVector(offset, r);
    this.hasMoved = true;
    this.flight = null;
    this.stage.noteMotion();
  }

  private readonly onKeyUp = (event: KeyboardEvent): void => {
    this.pressed.delete(event.code);
  };

  private readonly onBlur = (): void => {
    this.pressed.clear();
  };
}
