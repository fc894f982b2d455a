// Maps with the camera of this device: a live session that this page feeds.
import { ApiClient, ApiError } from '../api/client';
import { EventFeed } from '../api/feed';
import type { CameraModel, FrameAck, SessionInfo } from '../api/types';
import { coaching } from '../state/coaching';
import { MapStore } from '../state/map_store';
import { h, icon, replaceChildren, setText } from '../ui/dom';
import { plural } from '../ui/format';
import { askForToken } from '../ui/token_dialog';
import { toggleTheme } from '../ui/theme';
import { Capture, CameraError, listCameras } from './capture';
import { kGuessedFovDeg, makeCamera, sentSize } from './camera_model';
import { drawCuboids } from './picture_overlay';
import { Sender } from './sender';

export class CameraPage {
  readonly element: HTMLElement;
  readonly api = new ApiClient();
  readonly store = new MapStore();
  sender: Sender | null = null;
  private session: SessionInfo | null = null;
  private camera: CameraModel | null = null;
  private feed: EventFeed | null = null;
  private ack: FrameAck | null = null;
  private readonly video = h('video', { playsinline: true, muted: true, 'aria-label': 'Picture of the camera' });
  private readonly canvas = h('canvas', { 'aria-hidden': 'true' });
  private readonly capture = new Capture(this.video);
  private readonly message = h('div', { role: 'alert' });
  private readonly coachTitle = h('b', {});
  private readonly coachText = h('span', {});
  private readonly coach = h('div', { class: 'coach', role: 'status', 'aria-live': 'polite', hidden: true }, this.coachTitle, this.coachText);
  private readonly trouble = h('p', { class: 'trouble', role: 'status', hidden: true });
  private readonly figures = h('p', { class: 'figures' });
  private readonly name = h('input', { type: 'text', id: 'name', maxlength: 80, placeholder: 'e.g. kitchen table', autocomplete: 'off' });
  private readonly focal = h('input', { type: 'number', id: 'focal', min: 10, step: 'any', inputmode: 'decimal', placeholder: `guessed: ${kGuessedFovDeg}° field of view` });
  private readonly device = h('select', { id: 'device' });
  private readonly deviceField = h('div', { hidden: true }, h('label', { for: 'device' }, 'Camera'), this.device);
  private readonly startButton = h('button', { class: 'button primary big', onclick: () => void this.start() }, icon('camera'), 'Start mapping');
  private readonly form: HTMLElement;
  private readonly actions = h('div', { class: 'bar', hidden: true });
  private readonly finishButton = h('button', { class: 'button primary', onclick: () => void this.finish() }, icon('check'), 'Finish');

  constructor() {
    this.form = h('section', { class: 'start' },
      h('h1', {}, 'Map with this camera'),
      h('p', {}, 'The pictures go to this romap server, which tracks the camera and shows what it has mapped. ' +
        'Point the camera at a place with some detail, start, and move slowly sideways.'),
      this.message,
      h('label', { for: 'name' }, 'Name of the session'), this.name, this.deviceField,
      h('details', {}, h('summary', {}, 'Camera settings'),
        h('label', { for: 'focal' }, 'Focal length in pixels of the sent picture (its longer side has 640)'), this.focal,
        h('p', { class: 'hint' }, 'Browsers do not tell the focal length. With the true one, the map is more accurate.')),
      this.startButton,
      h('p', { class: 'hint' }, 'Objects appear when a detector adds masks to the pictures; without one, the map has the path of the camera and points.'));
    const viewer = h('a', { class: 'button', target: '_blank', rel: 'noopener' }, icon('eye'), 'Open in viewer');
    this.actions.append(this.figures, viewer, this.finishButton);
    this.element = h('div', { class: 'page' },
      h('header', { class: 'top-bar' },
        h('a', { class: 'brand', href: '/', 'aria-label': 'romap, all sessions' }, h('span', { class: 'mark', 'aria-hidden': 'true' }), 'romap'),
        h('span', { class: 'grow' }),
        h('button', { class: 'plain', 'aria-label': 'Switch between dark and light', onclick: toggleTheme }, icon('theme'))),
      h('main', { class: 'camera' }, this.video, this.canvas, this.coach, this.trouble, this.form, this.actions));
    window.addEventListener('pagehide', () => this.stop());
    this.viewerLink = viewer;
    void this.offerCameras();
  }

  private readonly viewerLink: HTMLAnchorElement;

  private async start(): Promise<void> {
    this.startButton.disabled = true;
    this.say('');
    try {
      const focalPx = this.focal.value === '' ? null : Number(this.focal.value);
      if (focalPx !== null && !(focalPx >= 10 && focalPx <= 100000)) throw new CameraError('The focal length must be a number of pixels, 10 or more; leave it empty if you do not know it.');
      await this.capture.start(this.device.value);
      await this.offerCameras();
      const { width, height } = this.capture.size;
      const size = sentSize(width, height);
      this.camera = makeCamera(size.widthPx, size.heightPx, focalPx);
      this.session = await this.create(this.camera);
      this.run(this.session, this.camera);
    } catch (error) {
      this.capture.stop();
      this.say(error instanceof CameraError || error instanceof ApiError ? error.message : `It did not start: ${String(error)}`);
    }
    this.startButton.disabled = false;
  }

  private async create(camera: CameraModel): Promise<SessionInfo> {
    const request = {
      name: this.name.value.trim() || `Camera, ${new Date().toLocaleString()}`, camera, mode: 'FRAME_MODE_LIVE', poseUse: 'POSE_USE_IGNORE',
    };
    for (;;) {
      try {
        return await this.api.create(request);
      } catch (error) {
        if (!(error instanceof ApiError) || error.status !== 401) throw error;
        const reason = this.api.hasToken ? `The token was not accepted: ${error.message}` : 'This server needs a token.';
        if (!await askForToken(this.api, reason)) throw new ApiError(401, 'UNAUTHENTICATED', 'Without a token the server creates no session.');
      }
    }
  }

  private run(session: SessionInfo, camera: CameraModel): void {
    this.form.hidden = true;
    this.actions.hidden = false;
    this.coach.hidden = false;
    this.viewerLink.href = `/#session/${encodeURIComponent(session.id)}`;
    this.showCoaching();
    const sender = new Sender(this.api, session.id, {
      picture: (quality) => this.picture(camera, quality), ack: (ack) => this.applyAck(ack, camera),
      trouble: (text) => this.setTrouble(text), ended: (error) => this.ended(error),
    });
    this.sender = sender;
    this.feed = new EventFeed(this.api, session.id, {
      opened: (opened) => this.store.open(opened), event: (event) => this.store.apply(event), status: () => undefined,
    }, false);
    this.capture.onEnded(() => this.setTrouble('The camera was taken away. Finish, or reload the page to start again.'));
    this.feed.start();
    sender.start();
  }

  private async picture(camera: CameraModel, quality: number): Promise<Blob | null> {
    const { width, height } = this.capture.size;
    const size = sentSize(width, height);
    // The session has one camera model: a turned phone has another.
    if (size.widthPx !== camera.widthPx || size.heightPx !== camera.heightPx) {
      this.setTrouble('The phone was turned. Turn it back, or finish and start again.');
      return null;
    }
    return this.capture.jpeg(camera.widthPx, camera.heightPx, quality);
  }

  private applyAck(ack: FrameAck, camera: CameraModel): void {
    if (!ack.accepted) this.setTrouble(`A picture was not accepted: ${ack.error || 'no reason was given'}`);
    else this.ack = ack;
    drawCuboids(this.canvas, [...this.store.objects.values()], this.ack, camera);
    this.showCoaching();
    const rate = this.sender?.rate;
    const objects = [...this.store.objects.values()].filter((o) => o.update.state === 'CONFIRMED').length;
    setText(this.figures, [plural(this.sender?.sent ?? 0, 'picture'), `round trip ${Math.round(rate?.roundTripMs ?? 0)} ms`,
                           objects > 0 ? plural(objects, 'object') : ''].filter((t) => t !== '').join(' · '));
  }

  private showCoaching(): void {
    const advice = coaching(this.ack?.state ?? 'UNKNOWN', this.ack?.stateReason ?? '');
    this.coach.dataset.level = advice.level;
    setText(this.coachTitle, advice.title);
    setText(this.coachText, advice.text);
  }

  private setTrouble(text: string): void {
    setText(this.trouble, text);
    this.trouble.hidden = text === '';
  }

  private ended(error: ApiError): void {
    this.stop();
    if (error.status === 401) {
      this.setTrouble('The token is not accepted any more. Reload the page and enter a valid one.');
    } else if (error.status === 404) {
      this.setTrouble('The session does not exist any more; it was deleted. Reload the page to begin another.');
    } else {
      this.setTrouble(`The server takes no more pictures: ${error.message}`);
    }
    this.showDone('Stopped');
  }

  private async finish(): Promise<void> {
    if (!this.session) return;
    this.finishButton.disabled = true;
    this.stop();
    try {
      await this.api.finish(this.session.id);
      this.setTrouble('');
      this.showDone('Finished');
    } catch (error) {
      this.finishButton.disabled = false;
      this.setTrouble(`It was not finished: ${error instanceof Error ? error.message : String(error)} Press Finish again.`);
    }
  }

  private showDone(title: string): void {
    this.finishButton.hidden = true;
    this.coach.dataset.level = 'good';
    setText(this.coachTitle, title);
    setText(this.coachText, 'The camera is off. Open the map in the viewer, or reload the page to begin another one.');
    this.canvas.getContext('2d')?.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  private stop(): void {
    this.sender?.stop();
    this.feed?.stop();
    this.capture.stop();
  }

  private say(text: string): void {
    replaceChildren(this.message, text === '' ? null : h('p', { class: 'callout error' }, text));
  }

  // Names of cameras are known only after one was allowed.
  private async offerCameras(): Promise<void> {
    const cameras = await listCameras().catch(() => []);
    this.deviceField.hidden = cameras.length < 2;
    const before = this.device.value;
    replaceChildren(this.device, h('option', { value: '' }, 'The one at the back, if there is one'),
      cameras.map((c, n) => h('option', { value: c.deviceId }, c.label || `Camera ${n + 1}`)));
    if ([...this.device.options].some((o) => o.value === before)) this.device.value = before;
  }
}
