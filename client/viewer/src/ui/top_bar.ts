import { h, icon } from './dom';
import { showHelp } from './help';
import { toggleTheme } from './theme';

export function topBar(left: (Node | string)[], right: Node[], withHelp: boolean): HTMLElement {
  return h('header', { class: 'top-bar' },
    h('a', { class: 'brand', href: '#', 'aria-label': 'romap, all sessions' }, h('span', { class: 'mark', 'aria-hidden': 'true' }), 'romap'),
    ...left, h('span', { class: 'grow' }), ...right,
    h('button', { class: 'plain', title: 'Dark or light (T)', 'aria-label': 'Switch between dark and light', onclick: toggleTheme }, icon('theme')),
    withHelp ? h('button', { class: 'plain', title: 'Help (?)', 'aria-label': 'Help', onclick: showHelp }, icon('help')) : null);
}
