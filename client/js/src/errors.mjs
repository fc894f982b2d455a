// The error of this package, and what it says about the connection.

import grpc from '@grpc/grpc-js';

const BROKEN_LINK = ['UNAVAILABLE', 'DEADLINE_EXCEEDED', 'CANCELLED', 'UNKNOWN'];

/** An error of the server, the connection or the input: `code` is the name of a gRPC status, e.g. "NOT_FOUND". */
export class RomapError extends Error {
  /**
   * @param {string} code
   * @param {string} message
   */
  constructor(code, message) {
    const line = message.split(/\s+/).join(' ').trim();
    super(`${code}: ${line}`);
    this.name = 'RomapError';
    this.code = code;
    /** Without the code. */
    this.reason = line;
  }

  /** Whether it may come from the connection, or from a server that stops or starts, so that the same call may succeed
   * later. */
  get mayPass() {
    return BROKEN_LINK.includes(this.code);
  }
}

/** @param {string} message */
export function invalid(message) {
  return new RomapError('INVALID_ARGUMENT', message);
}

/**
 * @param {any} failure a ServiceError of a call
 * @returns {RomapError}
 */
export function fromRpc(failure) {
  if (failure instanceof RomapError) return failure;
  const code = grpc.status[failure.code];
  return new RomapError(code ?? 'UNKNOWN', failure.details || failure.message || 'no reason was given');
}
