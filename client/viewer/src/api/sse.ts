// Parser for text/event-stream (HTML standard, section 9.2.6), without `id` and `retry`, which the server does not use.

export interface SseEvent { event: string; data: string }

/** Feed it the decoded text in pieces of any length. */
export class SseParser {
  private rest = '';
  private event = '';
  private data: string[] = [];

  push(piece: string): SseEvent[] {
    const events: SseEvent[] = [];
    const lines = (this.rest + piece).split('\n');
    this.rest = lines.pop() ?? '';
    for (const raw of lines) {
      const line = raw.endsWith('\r') ? raw.slice(0, -1) : raw;
      if (line === '') {
        if (this.data.length > 0) events.push({ event: this.event || 'message', data: this.data.join('\n') });
        this.event = '';
        this.data = [];
        continue;
      }
      const colon = line.indexOf(':');
      const field = colon < 0 ? line : line.slice(0, colon);
      let value = colon < 0 ? '' : line.slice(colon + 1);
      if (value.startsWith(' ')) value = value.slice(1);
      if (field === 'event') this.event = value;
      if (field === 'data') this.data.push(value);
    }
    return events;
  }
}
