// Figures, training progress and diagnostics of the session.
import type { Diagnostic, FrameAck, SessionInfo, Statistics } from '../api/types';
import { coaching } from '../state/coaching';
import { bytes, count, percent, plural } from './format';
import { h, icon, replaceChildren } from './dom';

export interface SessionActions { download(): void; finish(): void; remove(): void }

export const kSessionStates: Record<SessionInfo['state'], string> = {
  OPEN: 'open', FINISHING: 'finishing', FINISHED: 'finished', FAILED: 'failed', RESTORING: 'being restored', UNKNOWN: 'unknown',
};

export class SessionPanel {
  readonly element = h('div', { class: 'session-panel' });
  private readonly body = h('div', {});
  private readonly finish: HTMLButtonElement;
  private key = '';

  constructor(actions: SessionActions) {
    this.finish = h('button', { class: 'button', onclick: () => actions.finish() }, icon('check'), 'Finish input');
    this.element.append(this.body, h('h3', {}, 'Map'), h('div', { class: 'row wrap' },
      h('button', { class: 'button download-map', onclick: () => actions.download() }, icon('download'), 'Whole map as GLB'),
      this.finish,
      h('button', { class: 'button danger', onclick: () => actions.remove() }, icon('trash'), 'Delete')));
  }

  update(info: SessionInfo, statistics: Statistics, ack: FrameAck | null, diagnostics: readonly Diagnostic[]): void {
    const key = JSON.stringify([info.state, statistics, ack?.state, ack?.stateReason, diagnostics]);
    if (key === this.key) return;
    this.key = key;
    this.finish.hidden = info.state !== 'OPEN';
    const progress = statistics.trainingProgress;
    replaceChildren(this.body,
      h('h3', {}, 'Training'),
      h('progress', { class: 'wide', max: 1, value: progress, 'aria-label': `Training ${percent(progress)}` }),
      h('p', { class: 'under' }, `${percent(progress)} · ${count(statistics.trainingSteps)} steps` +
        (statistics.objectsTraining > 0 ? ` · ${plural(statistics.objectsTraining, 'object')} in training` : '')),
      h('h3', {}, 'Notes about this session'),
      diagnostics.length === 0 ? h('p', { class: 'empty' }, 'Nothing to report.')
        : h('ul', { class: 'diagnostics' }, diagnostics.map(diagnosticItem)),
      h('h3', {}, 'Figures'),
      h('dl', { class: 'facts' }, this.rows(info, statistics, ack).flatMap(
        ([name, value]) => [h('dt', {}, name), h('dd', {}, value)])));
  }

  private rows(info: SessionInfo, s: Statistics, ack: FrameAck | null): [string, string][] {
    const rows: [string, string][] = [
      ['State', kSessionStates[info.state]],
      ['Frames', `${count(s.framesProcessed)} of ${count(s.framesReceived)} processed`],
    ];
    if (s.framesDropped > 0) rows.push(['Dropped', plural(s.framesDropped, 'frame')]);
    if (s.framesRejected > 0) rows.push(['Rejected', plural(s.framesRejected, 'frame')]);
    rows.push(['Keyframes', count(s.keyframes)], ['Map points', count(s.mapPoints)], ['Objects', count(s.objects)]);
    if (ack) {
      const advice = coaching(ack.state, ack.stateReason);
      rows.push(['Camera', ack.stateReason ? `${advice.title.toLowerCase()}: ${ack.stateReason}` : advice.title.toLowerCase()]);
    }
    if (s.residentBytes > 0) rows.push(['Memory of the server', bytes(s.residentBytes)]);
    if (info.storedBytes > 0) rows.push(['Stored', bytes(info.storedBytes)]);
    return rows;
  }
}

const kSeverity = { INFO: 'Note', WARNING: 'Warning', ERROR: 'Error' };

function diagnosticItem(d: Diagnostic): HTMLElement {
  return h('li', { class: 'diagnostic', 'data-severity': d.severity.toLowerCase() },
    h('b', {}, `${kSeverity[d.severity]} · ${d.code}`), h('p', {}, d.text),
    d.advice ? h('p', { class: 'advice' }, d.advice) : null,
    d.count > 0 ? h('p', { class: 'hint' }, `Concerns ${plural(d.count, 'frame or part', 'frames or parts')}` +
      (d.firstFrameId !== '0' ? `, the first is frame ${d.firstFrameId}` : '') + '.') : null);
}
