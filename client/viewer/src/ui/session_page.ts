// One session: the 3D view, the panel, and the connection that keeps both up to date.
import { ApiError, sessionPath, type ApiClient } from '../api/client';
import { EventFeed, type FeedStatus } from '../api/feed';
import type { MapEvent, SessionInfo } from '../api/types';
import type { ViewMode } from '../scene/controls';
import { SessionScene } from '../scene/session_scene';
import { kDefaultSettings, type ViewSettings } from '../scene/view_settings';
import { MapStore } from '../state/map_store';
import { PathStore } from '../state/path_store';
import { download } from './download';
import { h, icon, setText } from './dom';
import { fileName } from './format';
import { showHelp } from './help';
import { bindKeys } from './keys';
import { LinkChip } from './link_chip';
import { notify } from './notices';
import { ObjectDetail } from './object_detail';
import { ObjectList } from './object_list';
import type { Page } from './page';
import { loadFrame, Poller, TrajectoryLoader } from './pollers';
import { kSessionStates, SessionPanel } from './session_panel';
import { Sheet } from './sheet';
import { StageOverlay } from './stage_overlay';
import { Tabs } from './tabs';
import { isDark, onTheme, reducedMotion, toggleTheme } from './theme';
import { confirmAction } from './token_dialog';
import { Toolbar } from './toolbar';
import { topBar } from './top_bar';
import { ViewPanel } from './view_panel';

const kNoWebGl = 'This browser has no WebGL 2, so the map cannot be drawn. The list beside it and the downloads work. ' +
  'Switch on hardware acceleration in the settings of the browser, or use a current version of Chrome, Edge, Firefox or Safari.';

export class SessionPage implements Page {
  readonly element: HTMLElement;
  readonly store = new MapStore();
  readonly path = new PathStore();
  scene: SessionScene | null = null;
  private info: SessionInfo | null = null;
  private settings: ViewSettings = { ...kDefaultSettings };
  private selected: string | null = null;
  private status: FeedStatus = { kind: 'connecting' };
  private updateIsQueued = false;
  private hasNewImage = false;  // the server has processed a frame since the last request
  private isStopped = false;
  private readonly host = h('div', { class: 'stage' });
  private readonly name = h('span', { class: 'session-name' });
  private readonly state = h('span', { class: 'chip' });
  private readonly chip = new LinkChip(() => this.feed.retryNow());
  private readonly overlay: StageOverlay;
  private readonly toolbar: Toolbar;
  private readonly list = new ObjectList((id) => this.select(id));
  private readonly detail: ObjectDetail;
  private readonly sessionPanel: SessionPanel;
  private readonly viewPanel: ViewPanel;
  private readonly tabs: Tabs;
  private readonly sheet: Sheet;
  private feed: EventFeed;
  private readonly trajectory: TrajectoryLoader;
  private readonly pollers: { info: Poller; frame: Poller; points: Poller; trajectory: Poller };
  private readonly ends: (() => void)[] = [];

  constructor(private readonly api: ApiClient, private readonly sessionId: string,
              private readonly askToken: (reason: string) => Promise<boolean>, private readonly canDraw: boolean) {
    this.detail = new ObjectDetail({
      close: () => this.select(null), zoom: (id) => this.scene?.zoomTo(id), download: (id) => this.downloadObject(id),
    });
    this.sessionPanel = new SessionPanel({
      download: () => void download(api, `${sessionPath(sessionId)}/map.glb`, `${fileName(this.info?.name ?? '')}_map.glb`),
      finish: () => void this.finish(), remove: () => void this.remove(),
    });
    this.viewPanel = new ViewPanel(() => this.settings, (settings) => this.applySettings(settings));
    this.detail.element.hidden = true;
    this.tabs = new Tabs([
      { id: 'objects', title: 'Objects', content: h('div', {}, this.list.element, this.detail.element) },
      { id: 'session', title: 'Session', content: this.sessionPanel.element },
      { id: 'view', title: 'View', content: this.viewPanel.element },
    ]);
    const panel = h('aside', { class: 'panel', 'aria-label': 'Map' });
    this.sheet = new Sheet(panel);
    this.tabs.onOpen = () => this.sheet.raise();
    panel.append(this.sheet.handle, this.tabs.bar, this.tabs.pages);
    this.toolbar = new Toolbar({
      mode: (mode) => this.setMode(mode), fit: () => this.scene?.fit(), measure: () => this.toggleMeasure(),
    });
    this.overlay = new StageOverlay(this.host);
    this.host.append(this.toolbar.element);
    this.element = h('div', { class: 'page session-page' },
      topBar([h('a', { class: 'plain back', href: '#', 'aria-label': 'All sessions' }, icon('back')), this.name, this.state],
        [this.chip.element], true),
      h('main', { class: 'split' }, this.host, panel));
    this.feed = this.makeFeed();
    this.trajectory = new TrajectoryLoader(api, sessionId);
    const isLive = (): boolean => this.status.kind !== 'ended' && this.status.kind !== 'gone';
    this.pollers = {
      info: new Poller(() => this.loadInfo(), () => (isLive() ? 5000 : null)),
      frame: new Poller((signal) => this.loadFrame(signal), () => (isLive() ? 500 : null)),
      points: new Poller((signal) => this.loadPoints(signal), () => (isLive() ? 4000 : null)),
      trajectory: new Poller(() => this.loadTrajectory(),
                             () => (isLive() ? Math.max(10000, 20000 * this.trajectory.lastSeconds) : null)),
    };
  }

  start(): void {
    document.title = 'Session – romap';
    this.overlay.message('Connecting to the session …');
    this.ends.push(onTheme(() => this.scene?.setTheme(isDark())), this.bindKeys());
    const online = (): void => this.feed.retryNow();
    window.addEventListener('online', online);
    this.ends.push(() => window.removeEventListener('online', online));
    void this.begin();
  }

  stop(): void {
    this.isStopped = true;
    this.feed.stop();
    this.trajectory.dispose();
    for (const poller of Object.values(this.pollers)) poller.stop();
    for (const end of this.ends) end();
    this.scene?.dispose();
    this.scene = null;
  }

  select(id: string | null): void {
    this.selected = id !== null && this.store.objects.has(id) ? id : null;
    this.scene?.select(this.selected);
    if (this.selected !== null) {
      this.tabs.open('objects');
      this.sheet.raise();
    }
    this.update();
  }

  // The camera model of the session is needed for the frustum; the events do not wait for it.
  private async begin(): Promise<void> {
    try {
      await this.loadInfo();
    } catch (error) {
      // The feed finds the same and shows it.
      if (this.isStopped) return;
      if (error instanceof ApiError && error.status === 401) return this.setStatus({ kind: 'unauthenticated', message: error.message });
    }
    if (this.isStopped) return;
    this.makeScene();
    this.feed.start();
    for (const poller of Object.values(this.pollers)) poller.poke();
  }

  private makeScene(): void {
    if (this.scene) return;
    if (!this.canDraw) {
      this.overlay.fault(kNoWebGl);
      this.toolbar.element.hidden = true;
      return;
    }
    try {
      const info = this.info ?? ({ id: this.sessionId, camera: null } as SessionInfo);
      const scene = new SessionScene(this.host, this.store, this.path, this.api, { ...info, id: this.sessionId }, reducedMotion);
      scene.stage.canvas.setAttribute('tabindex', '0');
      scene.stage.canvas.setAttribute('role', 'application');
      scene.stage.canvas.setAttribute('aria-label', 'Map in 3D. Arrow keys turn it, plus and minus zoom, J and K select objects.');
      scene.onSelect = (id) => this.select(id);
      scene.onMeasured = () => this.showMeasureHint();
      scene.objects.onMesh = () => this.queueUpdate();
      scene.controls.onMode = (mode) => {
        this.toolbar.update(mode, scene.measure.isActive);
        scene.refreshPath();
      };
      scene.stage.onContextLost = (isLost) => this.overlay.fault(
        isLost ? 'The browser took the graphics memory away. The map is drawn again when it gives it back; else reload the page.' : '');
      this.scene = scene;
      scene.setTheme(isDark());
      scene.apply(this.settings);
      this.toolbar.update('orbit', false);
    } catch {
      this.overlay.fault(kNoWebGl);
      this.toolbar.element.hidden = true;
    }
  }

  private makeFeed(): EventFeed {
    return new EventFeed(this.api, this.sessionId, {
      opened: (opened) => {
        this.store.open(opened);
        this.queueUpdate();
      },
      event: (event) => this.applyEvent(event),
      status: (status) => this.setStatus(status),
    });
  }

  private applyEvent(event: MapEvent): void {
    if (event.kind === 'frameAck') {
      this.path.addAck(event.ack);
      this.hasNewImage = true;
    }
    if (event.kind === 'diagnostic' && event.diagnostic.severity !== 'INFO') {
      notify(event.diagnostic.text, event.diagnostic.severity === 'ERROR' ? 'error' : 'info');
    }
    if (event.kind === 'statistics' && event.statistics.mapPoints > 0 && this.scene?.points.count === 0) {
      this.pollers.points.poke();
    }
    this.store.apply(event);
    this.queueUpdate();
  }

  private setStatus(status: FeedStatus): void {
    const before = this.status.kind;
    this.status = status;
    this.chip.update(status);
    if (status.kind === 'live' && before === 'retrying') {
      for (const poller of Object.values(this.pollers)) poller.poke();
    }
    if (status.kind === 'ended') {
      this.pollers.info.poke();
      this.pollers.points.poke();
      this.pollers.trajectory.poke();
    }
    if (status.kind === 'gone') {
      this.overlay.fault('This session does not exist (any more). It was deleted, or the server stores no sessions and was ' +
        'restarted. What is shown is the last state that this page knows.', { text: 'All sessions', href: '#' });
    }
    if (status.kind === 'denied') this.overlay.fault(`Your token does not allow this: ${status.message}`, { text: 'All sessions', href: '#' });
    if (status.kind === 'unauthenticated') void this.renewToken(status.message);
    this.queueUpdate();
  }

  private async renewToken(message: string): Promise<void> {
    const reason = this.api.hasToken ? `The token is not accepted (any more): ${message}` : 'This server needs a token.';
    const isEntered = await this.askToken(reason);
    if (this.isStopped) return;
    if (!isEntered) {
      this.overlay.fault('The server shows this session only to people with a token.', {
        text: 'Enter token', action: () => void this.renewToken(message),
      });
      return;
    }
    this.overlay.fault('');
    this.feed.stop();
    this.feed = this.makeFeed();
    void this.begin();
  }

  private async loadInfo(): Promise<void> {
    const info = await this.api.session(this.sessionId);
    if (this.isStopped) return;
    // Without a client, the server may have no image, and browsers log every answer that is none.
    if (!this.info && info.streamOpen && info.statistics.framesProcessed > 0) this.hasNewImage = true;
    this.info = info;
    if (!this.store.statistics || this.status.kind !== 'live') this.store.applyStatistics(info.statistics);
    document.title = `${info.name || 'Session'} – romap`;
    this.queueUpdate();
  }

  private async loadFrame(signal: AbortSignal): Promise<void> {
    if (!this.hasNewImage) return;
    this.hasNewImage = false;
    const blob = await loadFrame(this.api, this.sessionId, signal);
    if (!blob || this.isStopped) return;
    this.overlay.setImage(blob);
    if (this.scene && this.settings.image && this.settings.path) {
      this.scene.camera.setImage(await createImageBitmap(blob));
      this.scene?.refreshImage();
    }
  }

  private async loadPoints(signal: AbortSignal): Promise<void> {
    if (this.settings.points) await this.scene?.points.load(signal);
  }

  private async loadTrajectory(): Promise<void> {
    const poses = await this.trajectory.load();
    if (!poses || this.isStopped) return;
    this.path.replace(poses);
    const newest = this.path.newest();
    if (newest) this.store.noteNewestMap(newest.mapId);
    this.scene?.refreshPath();
    this.queueUpdate();
  }

  private queueUpdate(): void {
    if (this.updateIsQueued || this.isStopped) return;
    this.updateIsQueued = true;
    // Not an animation frame: those pause while the page is hidden, and events do not.
    window.setTimeout(() => {
      this.updateIsQueued = false;
      if (!this.isStopped) this.update();
    }, 50);
  }

  private update(): void {
    const changes = this.store.takeChanges();
    this.scene?.applyChanges(changes);
    if (this.selected !== null && !this.store.objects.has(this.selected)) this.selected = null;
    const objects = this.scene ? this.scene.objects.visibleObjects() : [...this.store.objects.values()];
    const selected = this.selected === null ? undefined : this.store.objects.get(this.selected);
    const faultOf = (id: string): string => this.scene?.objects.mesh(id)?.fault ?? '';
    this.list.element.hidden = selected !== undefined;
    this.detail.element.hidden = selected === undefined;
    if (selected) this.detail.update(selected, this.scene?.objects.mesh(selected.update.id) ?? null);
    this.list.update(objects, this.selected, faultOf, this.emptyText());
    this.updateSession(objects.filter((o) => o.update.state !== 'PROVISIONAL').length);
  }

  private updateSession(confirmed: number): void {
    const statistics = this.store.statistics;
    const diagnostics = this.store.diagnostics();
    const problems = diagnostics.filter((d) => d.severity !== 'INFO');
    this.tabs.setBadge('objects', confirmed > 0 ? String(confirmed) : '');
    this.tabs.setBadge('session', problems.length > 0 ? String(problems.length) : '',
                       problems.some((d) => d.severity === 'ERROR') ? 'error' : 'warning');
    if (this.info) {
      const state = this.status.kind === 'ended' && this.info.state !== 'FAILED' ? 'FINISHED' : this.info.state;
      setText(this.name, this.info.name || 'Unnamed session');
      setText(this.state, kSessionStates[state]);
      this.state.dataset.state = state.toLowerCase();
      if (statistics) this.sessionPanel.update({ ...this.info, state }, statistics, this.store.lastAck, diagnostics);
    }
    this.viewPanel.updateMaps(this.store.mapIds(), this.store.shownMapId());
    this.overlay.update({
      ack: this.status.kind === 'live' ? this.store.lastAck : null, gridStep: this.scene?.gridStep ?? null,
      color: this.settings.color, progress: statistics && statistics.objectsTraining > 0 ? statistics.trainingProgress : null,
    });
    if (this.store.objects.size > 0 || this.path.poses.length > 0) this.overlay.message('');
    else if (this.status.kind === 'live') this.overlay.message(this.emptyText());
    else if (this.status.kind === 'ended') this.overlay.message('This session has no objects.');
  }

  private emptyText(): string {
    if (this.status.kind === 'connecting') return 'Connecting to the session …';
    if (this.status.kind === 'ended') return 'This session has no objects. Its notes are under “Session”.';
    if ((this.store.statistics?.framesReceived ?? 0) === 0) return 'Waiting for the first image of the client.';
    return 'No objects yet. They appear when masks show them from a few places.';
  }

  private setMode(mode: ViewMode): void {
    this.scene?.controls.setMode(mode);
    this.scene?.stage.canvas.focus();
    if (mode === 'fly') notify('Fly: W A S D move, Q and E down and up, Shift faster; drag to look around.');
    if (mode === 'follow' && this.path.poses.length === 0) notify('The camera has no pose yet; the view follows as soon as it has one.');
  }

  private toggleMeasure(): void {
    if (!this.scene) return;
    this.scene.startMeasuring(!this.scene.measure.isActive);
    this.toolbar.update(this.scene.controls.mode, this.scene.measure.isActive);
    this.showMeasureHint();
  }

  private showMeasureHint(): void {
    const measure = this.scene?.measure;
    this.overlay.hint(!measure?.isActive ? '' : measure.points.length === 0 ? 'Pick the first point' :
      measure.points.length === 1 ? 'Pick the second point' : 'Pick a point to measure again, Esc to end');
  }

  private applySettings(settings: ViewSettings): void {
    const wantsPoints = settings.points && !this.settings.points;
    this.settings = settings;
    this.scene?.apply(settings);
    this.viewPanel.update();
    if (wantsPoints) this.pollers.points.poke();
    this.update();
  }

  private toggle(name: Exclude<keyof ViewSettings, 'color' | 'map'>): void {
    this.applySettings({ ...this.settings, [name]: !this.settings[name] });
  }

  private step(by: number): void {
    const ids = ObjectList.sorted(this.scene?.objects.visibleObjects() ?? [...this.store.objects.values()]).map((o) => o.update.id);
    if (ids.length === 0) return;
    const n = this.selected === null ? (by > 0 ? -1 : 0) : ids.indexOf(this.selected);
    this.select(ids[(n + by + ids.length) % ids.length] ?? null);
  }

  private bindKeys(): () => void {
    const turn = (factor: number) => () => this.scene?.controls.turn(0, 0, factor);
    const color = (mode: ViewSettings['color']) => () => this.applySettings({ ...this.settings, color: mode });
    return bindKeys({
      '?': showHelp, o: () => this.setMode('orbit'), f: () => this.setMode('fly'),
      c: () => this.setMode('follow'), r: () => this.scene?.fit(), z: () => this.scene?.zoomTo(this.selected),
      j: () => this.step(1), k: () => this.step(-1), m: () => this.toggleMeasure(), 1: color('rgb'),
      2: color('normal'), 3: color('confidence'), b: () => this.toggle('cuboids'), l: () => this.toggle('labels'),
      p: () => this.toggle('points'), g: () => this.toggle('grid'), n: () => this.toggle('arrows'), t: toggleTheme,
      '+': turn(0.85), '=': turn(0.85), '-': turn(1 / 0.85),
      escape: () => (this.scene?.measure.isActive ? this.toggleMeasure() : this.select(null)),
    });
  }

  private downloadObject(id: string): void {
    const name = this.store.objects.get(id)?.update.className ?? 'object';
    void download(this.api, `${sessionPath(this.sessionId)}/objects/${id}.glb`, `${fileName(name)}_${id}.glb`);
  }

  private async finish(): Promise<void> {
    if (!await confirmAction('Finish the input?', 'The session accepts no more images; its objects are trained to the end.', 'Finish input', false)) return;
    await this.command(async () => {
      this.info = await this.api.finish(this.sessionId);
    });
  }

  private async remove(): Promise<void> {
    if (!await confirmAction('Delete this session?', 'Its map and what is stored of it are deleted. This cannot be undone.', 'Delete session', true)) return;
    await this.command(async () => {
      await this.api.remove(this.sessionId);
      location.hash = '';
    });
  }

  private async command(work: () => Promise<void>): Promise<void> {
    try {
      await work();
    } catch (error) {
      notify(error instanceof ApiError ? error.message : 'The server did not answer.', 'error');
    }
    this.queueUpdate();
  }
}
