// Asks for the token of the server. It is kept in memory, or until the tab is closed if the person wants that.
import type { ApiClient } from '../api/client';
import { h } from './dom';

let isOpen = false;

/** `reason`: why it is asked for. Resolves to whether a token was entered. */
export function askForToken(api: ApiClient, reason: string): Promise<boolean> {
  if (isOpen) return Promise.resolve(false);
  isOpen = true;
  return new Promise((resolve) => {
    const input = h('input', {
      type: 'password', id: 'token', autocomplete: 'off', spellcheck: 'false', required: true, 'aria-describedby': 'token-why',
    });
    const keep = h('input', { type: 'checkbox', id: 'keep-token' });
    const form = h('form', { method: 'dialog' },
      h('h2', { id: 'token-title' }, 'Access token'),
      h('p', { id: 'token-why' }, reason),
      h('label', { for: 'token' }, 'Token'), input,
      h('label', { class: 'check', for: 'keep-token' }, keep, 'Keep it until this tab is closed'),
      h('p', { class: 'hint' }, 'The operator of the server creates tokens with ', h('code', {}, 'romap-server token create'), '.'),
      h('div', { class: 'actions' },
        h('button', { type: 'button', class: 'button', onclick: () => dialog.close('') }, 'Cancel'),
        h('button', { type: 'submit', class: 'button primary', value: 'ok' }, 'Use token')));
    const dialog = h('dialog', { class: 'dialog', 'aria-labelledby': 'token-title' }, form);
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      if (input.value.trim() === '') return;
      api.setToken(input.value.trim(), keep.checked);
      dialog.close('ok');
    });
    dialog.addEventListener('close', () => {
      isOpen = false;
      dialog.remove();
      resolve(dialog.returnValue === 'ok');
    });
    document.body.append(dialog);
    dialog.showModal();
    input.focus();
  });
}

export function confirmAction(title: string, text: string, action: string, isDangerous: boolean): Promise<boolean> {
  return new Promise((resolve) => {
    const dialog = h('dialog', { class: 'dialog', 'aria-labelledby': 'confirm-title' },
      h('form', { method: 'dialog' },
        h('h2', { id: 'confirm-title' }, title), h('p', {}, text),
        h('div', { class: 'actions' },
          h('button', { class: 'button', value: '' }, 'Cancel'),
          h('button', { class: `button ${isDangerous ? 'danger' : 'primary'}`, value: 'ok' }, action))));
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(dialog.returnValue === 'ok');
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
