// Keys of the session page. They do nothing while a text is entered or a dialog is open.

export type KeyMap = Record<string, () => void>;

/** Returns what ends it. Keys are those of KeyboardEvent.key in lower case. */
export function bindKeys(map: KeyMap): () => void {
  const listener = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    if (document.querySelector('dialog[open]')) return;
    const target = event.target as HTMLElement;
    if (target.matches('input[type=text], input[type=password], input[type=search], input[type=number], textarea, select')) return;
    const action = map[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  };
  document.addEventListener('keydown', listener);
  return () => document.removeEventListener('keydown', listener);
}
