// Exponential back-off with jitter, so that many viewers do not return to a restarted server at the same moment.

export class Backoff {
  private attempt = 0;

  /** Delays are between half of and all of min(maxMs, firstMs * 2^attempt). */
  constructor(private readonly firstMs = 500, private readonly maxMs = 15000,
              private readonly random: () => number = Math.random) {}

  nextMs(): number {
    const full = Math.min(this.maxMs, this.firstMs * 2 ** Math.min(this.attempt, 20));
    this.attempt += 1;
    return full * (0.5 + 0.5 * this.random());
  }

  reset(): void {
    this.attempt = 0;
  }
}
