// Training steps over training time, as a small chart.
import type { StepSample } from '../state/map_store';
import { count, seconds } from './format';
import { svg } from './dom';

const kWidth = 280;
const kHeight = 84;
const kBottom = 16;
const kTop = 14;

export function stepsChart(history: readonly StepSample[]): SVGElement {
  const last = history[history.length - 1] ?? { trainSeconds: 0, steps: 0 };
  const maxX = Math.max(1e-6, ...history.map((s) => s.trainSeconds));
  const maxY = Math.max(1, ...history.map((s) => s.steps));
  const x = (s: StepSample): string => (2 + (s.trainSeconds / maxX) * (kWidth - 8)).toFixed(1);
  const y = (s: StepSample): string => (kHeight - kBottom - (s.steps / maxY) * (kHeight - kBottom - kTop)).toFixed(1);
  const line = [{ trainSeconds: 0, steps: 0 }, ...history].map((s, n) => `${n === 0 ? 'M' : 'L'}${x(s)} ${y(s)}`).join('');
  return svg('svg', {
    viewBox: `0 0 ${kWidth} ${kHeight}`, class: 'chart', role: 'img',
    'aria-label': `${count(last.steps)} training steps in ${seconds(last.trainSeconds)}, ${history.length} meshes`,
  },
  svg('line', { x1: 0, x2: kWidth, y1: kHeight - kBottom, y2: kHeight - kBottom, class: 'axis' }),
  svg('path', { d: `${line}L${x(last)} ${kHeight - kBottom}L2 ${kHeight - kBottom}Z`, class: 'area' }),
  svg('path', { d: line, class: 'line' }),
  ...history.slice(-40).map((s) => svg('circle', { cx: x(s), cy: y(s), r: 2.2, class: 'dot' })),
  svg('text', { x: 2, y: 9, class: 'tick' }, `${count(maxY)} steps`),
  svg('text', { x: kWidth - 4, y: kHeight - 4, class: 'tick end' }, seconds(maxX)),
  svg('text', { x: 2, y: kHeight - 4, class: 'tick' }, '0'));
}
