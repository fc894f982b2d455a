import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Backoff } from 'viewer/api/backoff';
import { ApiClient, ApiError } from 'viewer/api/client';
import { EventFeed, type FeedStatus } from 'viewer/api/feed';
import { SseParser } from 'viewer/api/sse';

test('events are found in pieces of any length', () => {
  const text = ': keep-alive\n\nevent: opened\ndata: {"a":1}\n\nevent: map\r\ndata: one\r\ndata: two\r\n\r\ndata:x\n\nevent: cut';
  for (const length of [1, 3, 7, text.length]) {
    const parser = new SseParser();
    const events = [];
    for (let n = 0; n < text.length; n += length) events.push(...parser.push(text.slice(n, n + length)));
    assert.deepEqual(events, [{ event: 'opened', data: '{"a":1}' }, { event: 'map', data: 'one\ntwo' }, { event: 'message', data: 'x' }]);
  }
});

test('the back-off grows to its limit, has jitter, and can be reset', () => {
  const low = new Backoff(500, 4000, () => 0);
  assert.deepEqual([1, 2, 3, 4, 5].map(() => low.nextMs()), [250, 500, 1000, 2000, 2000]);
  const high = new Backoff(500, 4000, () => 1);
  assert.deepEqual([1, 2, 3, 4, 5].map(() => high.nextMs()), [500, 1000, 2000, 4000, 4000]);
  high.reset();
  assert.equal(high.nextMs(), 500);
});

type Answer = { status: number; body: string };

/** Runs a feed against these answers, one for each attempt, until it has a final status. */
async function run(answers: (Answer | 'refused')[]): Promise<{ statuses: FeedStatus[]; events: number }> {
  const statuses: FeedStatus[] = [];
  let events = 0;
  const original = globalThis.fetch;
  globalThis.fetch = (async () => {
    const answer = answers.shift() ?? 'refused';
    if (answer === 'refused') throw new TypeError('fetch failed');
    return new Response(answer.body, { status: answer.status });
  }) as typeof fetch;
  const api = new ApiClient();
  try {
    await new Promise<void>((resolve, reject) => {
      const limit = setTimeout(() => reject(new Error('no final status after 10 s')), 10000);
      const feed = new EventFeed(api, 's', {
        opened: () => undefined,
        event: () => (events += 1),
        status: (status) => {
          statuses.push(status);
          if (status.kind === 'retrying') setTimeout(() => feed.retryNow(), 1);
          if (!['connecting', 'live', 'retrying'].includes(status.kind)) {
            clearTimeout(limit);
            resolve();
          }
        },
      });
      feed.start();
    });
  } finally {
    globalThis.fetch = original;
  }
  return { statuses, events };
}

const opened = 'event: opened\ndata: {"sessionId":"s","objectIds":[]}\n\n';
const statistics = 'event: map\ndata: {"statistics":{}}\n\n';
const kinds = (statuses: FeedStatus[]): string[] => statuses.map((s) => s.kind);

test('a feed that ends with OK is complete', async () => {
  const { statuses, events } = await run([{ status: 200, body: `${opened}${statistics}event: end\ndata: {"code":"OK","message":""}\n\n` }]);
  assert.deepEqual(kinds(statuses), ['connecting', 'live', 'ended']);
  assert.equal(events, 1);
});

test('a feed connects again after a cut, a refused connection and a busy server', async () => {
  const { statuses } = await run([
    { status: 200, body: `${opened}event: map\ndata: {"statis` }, 'refused', { status: 503, body: '{"code":"UNAVAILABLE","message":"being restored"}' },
    { status: 200, body: `${opened}event: end\ndata: {"code":"OK"}\n\n` },
  ]);
  assert.deepEqual(kinds(statuses), ['connecting', 'live', 'retrying', 'retrying', 'retrying', 'live', 'ended']);
  assert.equal(statuses[4]?.kind === 'retrying' && statuses[4].message, 'being restored');
});

test('a deleted session, a revoked token and a missing right are final', async () => {
  const end = (code: string): Answer => ({ status: 200, body: `${opened}event: end\ndata: {"code":"${code}","message":"m"}\n\n` });
  assert.equal((await run([end('NOT_FOUND')])).statuses.pop()?.kind, 'gone');
  assert.equal((await run([{ status: 404, body: '{}' }])).statuses.pop()?.kind, 'gone');
  assert.equal((await run([end('UNAUTHENTICATED')])).statuses.pop()?.kind, 'unauthenticated');
  assert.equal((await run([{ status: 401, body: 'no json' }])).statuses.pop()?.kind, 'unauthenticated');
  assert.equal((await run([{ status: 403, body: '{"code":"PERMISSION_DENIED","message":"viewer role"}' }])).statuses.pop()?.kind, 'denied');
});

test('an event that is not JSON is skipped', async () => {
  const { events } = await run([{ status: 200, body: `${opened}event: map\ndata: {broken\n\n${statistics}event: end\ndata: {"code":"OK"}\n\n` }]);
  assert.equal(events, 1);
});

test('errors of the server keep their code and message, and requests carry the token', async () => {
  const original = globalThis.fetch;
  const seen: Headers[] = [];
  globalThis.fetch = (async (_: unknown, init: RequestInit) => {
    seen.push(new Headers(init.headers));
    return new Response('{"code":"FAILED_PRECONDITION","message":"session is finished"}', { status: 409 });
  }) as typeof fetch;
  try {
    const api = new ApiClient();
    api.setToken('secret', false);
    await assert.rejects(api.finish('a/b'), (error: ApiError) => error.status === 409 && error.code === 'FAILED_PRECONDITION' && error.message === 'session is finished');
  } finally {
    globalThis.fetch = original;
  }
  assert.equal(seen[0]?.get('Authorization'), 'Bearer secret');
  assert.equal(seen[0]?.get('X-Romap'), '1');
});
