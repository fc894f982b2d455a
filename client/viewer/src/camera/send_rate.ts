// How often and how well images are sent: slower and smaller while round trips are long.

const kMinGapMs = 66;
const kMaxGapMs = 2000;
const kBestQuality = 0.85;
const kWorstQuality = 0.45;
const kSlowMs = 350;
const kFastMs = 180;

export class SendRate {
  quality = kBestQuality;
  private meanMs = 0;

  /** The mean round trip, milliseconds; 0 before the first one. */
  get roundTripMs(): number {
    return this.meanMs;
  }

  noteRoundTrip(ms: number): void {
    this.meanMs = this.meanMs === 0 ? ms : 0.7 * this.meanMs + 0.3 * ms;
    if (this.meanMs > kSlowMs) this.quality = Math.max(kWorstQuality, this.quality - 0.05);
    else if (this.meanMs < kFastMs) this.quality = Math.min(kBestQuality, this.quality + 0.02);
  }

  noteLost(): void {
    this.quality = Math.max(kWorstQuality, this.quality - 0.1);
  }

  /** Between the beginnings of two requests. Leaves the link a part of the time, because others use it, too. */
  gapMs(): number {
    return Math.min(kMaxGapMs, Math.max(kMinGapMs, 1.25 * this.meanMs));
  }
}
