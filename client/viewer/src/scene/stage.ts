// The canvas: renderer, camera, and drawing on demand. Nothing is drawn while nothing changes.
import { Color, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from 'three';

const kMaxPixelRatio = 2;
const kSlowFrameMs = 45;
const kFastFrameMs = 18;
const kSettleMs = 250;

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(50, 1, 0.01, 1000);
  readonly renderer: WebGLRenderer;
  readonly isSoftware: boolean;
  renders = 0;
  /** Called before each drawing; returns true if another one is needed after it (an animation). */
  onFrame: (seconds: number) => boolean = () => false;
  onRendered: () => void = () => undefined;
  onResized: () => void = () => undefined;
  onContextLost: (isLost: boolean) => void = () => undefined;

  private isQueued = false;
  private lastTime = 0;
  private isMoving = false;
  private quality = 1;  // share of the pixel ratio while the view moves
  private settleTimer = 0;
  private readonly observer: ResizeObserver;

  /** Throws if the browser has no WebGL 2. */
  constructor(readonly host: HTMLElement) {
    this.isSoftware = /swiftshader|llvmpipe|software|basic render/i.test(probeWebGl2() ?? '');
    // Without a graphics card, smooth edges would cost half of the frames.
    this.renderer = new WebGLRenderer({ antialias: !this.isSoftware, powerPreference: 'high-performance' });
    // Asking for the result of a compilation would wait for the graphics process.
    this.renderer.debug.checkShaderErrors = false;
    this.camera.up.set(0, 0, 1);
    host.prepend(this.canvas);
    this.canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      this.onContextLost(true);
    });
    this.canvas.addEventListener('webglcontextrestored', () => {
      this.onContextLost(false);
      this.invalidate();
    });
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(host);
    this.resize();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  setBackground(color: string): void {
    this.scene.background = new Color(color);
    this.invalidate();
  }

  invalidate(): void {
    if (this.isQueued) return;
    this.isQueued = true;
    requestAnimationFrame((now) => this.frame(now));
  }

  /** The view moves: draw with fewer pixels if this machine is slow, and sharply again afterwards. */
  noteMotion(): void {
    this.isMoving = true;
    window.clearTimeout(this.settleTimer);
    this.settleTimer = window.setTimeout(() => {
      this.isMoving = false;
      if (this.quality < 1) this.applySize();
      this.invalidate();
    }, kSettleMs);
    this.invalidate();
  }

  /** Pixels per map unit at distance 1. */
  pxPerMu(): number {
    return this.host.clientHeight / (2 * Math.tan((this.camera.fov * Math.PI) / 360));
  }

  /** To pixels of the host; z > 1 or behind the camera: null. */
  project(point: Vector3): { x: number; y: number } | null {
    const p = point.clone().project(this.camera);
    if (p.z > 1 || p.z < -1) return null;
    return { x: ((p.x + 1) / 2) * this.host.clientWidth, y: ((1 - p.y) / 2) * this.host.clientHeight };
  }

  dispose(): void {
    this.observer.disconnect();
    window.clearTimeout(this.settleTimer);
    this.onFrame = () => false;
    this.isQueued = true;  // no further drawing
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.canvas.remove();
  }

  private frame(now: number): void {
    this.isQueued = false;
    const dt = this.lastTime === 0 ? 0.016 : Math.min(0.1, (now - this.lastTime) / 1000);
    if (this.isMoving) this.adapt(now - this.lastTime);
    this.lastTime = now;
    const needsMore = this.onFrame(dt);
    this.renderer.render(this.scene, this.camera);
    this.renders += 1;
    this.onRendered();
    if (needsMore) this.invalidate();
    else this.lastTime = 0;
  }

  private adapt(frameMs: number): void {
    if (this.lastTime === 0) return;
    const before = this.quality;
    if (frameMs > kSlowFrameMs) this.quality = Math.max(0.5, this.quality * 0.85);
    else if (frameMs < kFastFrameMs) this.quality = Math.min(1, this.quality * 1.05);
    if (this.quality !== before) this.applySize();
  }

  private resize(): void {
    this.applySize();
    this.onResized();
    this.invalidate();
  }

  private applySize(): void {
    const width = Math.max(1, this.host.clientWidth);
    const height = Math.max(1, this.host.clientHeight);
    const ratio = this.isSoftware ? 1 : Math.min(kMaxPixelRatio, window.devicePixelRatio || 1);
    this.renderer.setPixelRatio(this.isMoving ? ratio * this.quality : ratio);
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }
}

let probed: string | null | undefined;

/** The name of the renderer; null if the browser has no WebGL 2. */
export function probeWebGl2(): string | null {
  if (probed === undefined) probed = probe();
  return probed;
}

function probe(): string | null {
  try {
    const gl = document.createElement('canvas').getContext('webgl2');
    if (!gl) return null;
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    return info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : '';
  } catch {
    return null;
  }
}
