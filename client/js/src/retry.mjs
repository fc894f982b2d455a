// How a client tries again after the connection broke.

import {RomapError} from './errors.mjs';

/**
 * Delays double and vary at random, so that many clients do not return together.
 * @typedef {object} Retry
 * @property {number} [initialDelayMs] 100
 * @property {number} [maxDelayMs] 5000
 * @property {number} [jitter] 0.5: share of a delay by which it varies
 * @property {number} [maxDownMs] 600000: gives up after this time without progress
 */

/**
 * @param {Retry} [options]
 * @returns {Required<Retry>}
 */
export function withDefaults(options) {
  return {initialDelayMs: 100, maxDelayMs: 5000, jitter: 0.5, maxDownMs: 600_000, ...options};
}

export class Delays {
  #options;
  #nextMs = 0;

  /** @param {Required<Retry>} options */
  constructor(options) {
    this.#options = options;
    this.reset();
  }

  reset() {
    this.#nextMs = this.#options.initialDelayMs;
  }

  nextMs() {
    const {jitter, maxDelayMs} = this.#options;
    const delayMs = this.#nextMs * (1 + jitter * (2 * Math.random() - 1));
    this.#nextMs = Math.min(2 * this.#nextMs, maxDelayMs);
    return delayMs;
  }
}

/** @param {number} ms */
export function sleep(ms) {
  return new Promise((resolve) => setTimeout(resolve, ms));
}

/**
 * Calls `call`, which must be idempotent, until it succeeds, fails for another reason than a broken link, or the time of
 * `options` is over.
 * @template Result
 * @param {() => Promise<Result>} call
 * @param {Retry} [options]
 * @returns {Promise<Result>}
 */
export async function retryWhileUnavailable(call, options) {
  const retry = withDefaults(options);
  const delays = new Delays(retry);
  const deadline = Date.now() + retry.maxDownMs;
  for (;;) {
    try {
      return await call();
    } catch (error) {
      const leftMs = deadline - Date.now();
      if (!(error instanceof RomapError) || !error.mayPass || leftMs <= 0) throw error;
      await sleep(Math.min(delays.nextMs(), leftMs));
    }
  }
}

/** Promises that wait for a change of a state. */
export class Signal {
  /** @type {Set<() => void>} */
  #waiting = new Set();

  notify() {
    const waiting = [...this.#waiting];
    this.#waiting.clear();
    for (const resolve of waiting) resolve();
  }

  /**
   * Waits until `condition` holds; false: not within `timeoutMs`.
   * @param {() => boolean} condition
   * @param {number} [timeoutMs]
   */
  async until(condition, timeoutMs) {
    const deadline = timeoutMs === undefined ? Infinity : Date.now() + timeoutMs;
    while (!condition()) {
      const leftMs = deadline - Date.now();
      if (leftMs <= 0) return false;
      /** @type {NodeJS.Timeout | undefined} */
      let timer;
      await new Promise((/** @type {(value?: undefined) => void} */ resolve) => {
        this.#waiting.add(resolve);
        if (leftMs !== Infinity) {
          timer = setTimeout(() => {
            this.#waiting.delete(resolve);
            resolve();
          }, leftMs);
        }
      });
      clearTimeout(timer);
    }
    return true;
  }
}
