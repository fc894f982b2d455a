// The camera of the device, and its pictures as JPEG.

/** `text`: what happened and what to do. */
export class CameraError extends Error {}

const kTexts: Record<string, string> = {
  NotAllowedError: 'The camera was refused. Allow it for this page in the address bar or in the settings of the browser, then start again.',
  NotFoundError: 'This device has no camera. Open this page on a phone, or connect a camera, then start again.',
  NotReadableError: 'The camera cannot be read. Another program may be using it; close that, then start again.',
  OverconstrainedError: 'The camera does not deliver a usable picture. Choose another one.',
};

const kNotSecure = 'The browser gives the camera only to pages that were opened over HTTPS or on localhost. ' +
  'Open this page on the computer of the server, or start romap-server with --tls-cert and --tls-key and open it with https://.';

export class Capture {
  private stream: MediaStream | null = null;
  private readonly canvas = document.createElement('canvas');

  constructor(readonly video: HTMLVideoElement) {}

  /** Throws CameraError. `deviceId` "" is the camera at the back, if there is one. */
  async start(deviceId: string): Promise<void> {
    if (!window.isSecureContext || !navigator.mediaDevices?.getUserMedia) throw new CameraError(kNotSecure);
    try {
      this.stream = await navigator.mediaDevices.getUserMedia({
        audio: false,
        video: {
          width: { ideal: 1280 }, height: { ideal: 720 }, frameRate: { ideal: 30 },
          ...(deviceId ? { deviceId: { exact: deviceId } } : { facingMode: 'environment' }),
        },
      });
      this.video.srcObject = this.stream;
      await this.video.play();
    } catch (error) {
      this.stop();
      const name = error instanceof Error ? error.name : '';
      throw new CameraError(kTexts[name] ?? `The camera cannot be used: ${error instanceof Error ? error.message : String(error)}.`);
    }
  }

  get size(): { width: number; height: number } {
    return { width: this.video.videoWidth, height: this.video.videoHeight };
  }

  /** Called when the camera is taken away. */
  onEnded(callback: () => void): void {
    this.stream?.getVideoTracks()[0]?.addEventListener('ended', callback);
  }

  /** The present picture; null if the browser cannot encode it. */
  async jpeg(widthPx: number, heightPx: number, quality: number): Promise<Blob | null> {
    if (this.canvas.width !== widthPx || this.canvas.height !== heightPx) {
      this.canvas.width = widthPx;
      this.canvas.height = heightPx;
    }
    const context = this.canvas.getContext('2d');
    if (!context || this.video.readyState < 2) return null;
    context.drawImage(this.video, 0, 0, widthPx, heightPx);
    return new Promise((resolve) => this.canvas.toBlob(resolve, 'image/jpeg', quality));
  }

  stop(): void {
    for (const track of this.stream?.getTracks() ?? []) track.stop();
    this.stream = null;
    this.video.srcObject = null;
  }
}

export async function listCameras(): Promise<MediaDeviceInfo[]> {
  const devices = await navigator.mediaDevices?.enumerateDevices?.() ?? [];
  return devices.filter((d) => d.kind === 'videoinput' && d.deviceId !== '');
}
