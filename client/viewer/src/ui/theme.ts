// Dark or light: as the system says, or as the person chose.

type Choice = 'auto' | 'dark' | 'light';
const kKey = 'romap-theme';
const system = window.matchMedia('(prefers-color-scheme: light)');
const motion = window.matchMedia('(prefers-reduced-motion: reduce)');
const listeners = new Set<() => void>();

function stored(): Choice {
  try {
    const value = localStorage.getItem(kKey);
    return value === 'dark' || value === 'light' ? value : 'auto';
  } catch {
    return 'auto';
  }
}

let choice = stored();

export const isDark = (): boolean => (choice === 'auto' ? !system.matches : choice === 'dark');
export const reducedMotion = (): boolean => motion.matches;

function apply(): void {
  document.documentElement.dataset.theme = isDark() ? 'dark' : 'light';
  for (const listener of listeners) listener();
}

export function startTheme(): void {
  system.addEventListener('change', apply);
  apply();
}

/** Returns what ends the subscription. */
export function onTheme(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function toggleTheme(): void {
  choice = isDark() ? 'light' : 'dark';
  if ((choice === 'light') === system.matches) choice = 'auto';
  try {
    if (choice === 'auto') localStorage.removeItem(kKey);
    else localStorage.setItem(kKey, choice);
  } catch {
    // Without storage the choice lasts until the page is left.
  }
  apply();
}
