// Builds elements without a framework and without inline styles, which the content security policy forbids.

type Child = Node | string | null | false;
type Props = Record<string, string | boolean | number | null | EventListener | ((event: never) => void)>;

/** `on...` are listeners; true is an attribute without value; false and null leave it out. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K, props: Props = {}, ...children: (Child | Child[])[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  apply(element, props);
  element.append(...children.flat().filter((c): c is Node | string => c !== null && c !== false));
  return element;
}

export function svg(tag: string, props: Props = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  apply(element, props);
  element.append(...children.filter((c): c is Node | string => c !== null && c !== false));
  return element;
}

function apply(element: Element, props: Props): void {
  for (const [name, value] of Object.entries(props)) {
    if (typeof value === 'function') element.addEventListener(name.slice(2).toLowerCase(), value as EventListener);
    else if (value === true) element.setAttribute(name, '');
    else if (value !== false && value !== null) element.setAttribute(name, String(value));
  }
}

const kIcons: Record<string, string> = {
  orbit: 'M12 4a8 8 0 1 0 8 8M12 4l3-2.500M12 4l3 2.500M12 10.500a1.500 1.500 0 1 1 0 3 1.500 1.500 0 0 1 0-3',
  fly: 'M3 12 21 4l-6 17-3.500-7zM11.500 14 21 4',
  follow: 'M3 7h11v10H3zM14 10.500l7-3.500v10l-7-3.500',
  fit: 'M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5M9 9h6v6H9z',
  measure: 'M3 17 17 3l4 4L7 21zM7 13l2 2M10 10l3 3M13 7l2 2',
  help: 'M9 9.500a3 3 0 1 1 4.500 2.600c-1 .6-1.500 1.200-1.500 2.400M12 17.800v.2M12 3a9 9 0 1 1 0 18 9 9 0 0 1 0-18',
  theme: 'M12 3a9 9 0 1 1 0 18zM12 3a9 9 0 0 0 0 18',
  download: 'M12 4v11M7.500 11 12 15.500 16.500 11M4 20h16',
  back: 'M15 5l-7 7 7 7',
  close: 'M6 6l12 12M18 6 6 18',
  camera: 'M4 8h3l2-3h6l2 3h3v11H4zM12 10a3.500 3.500 0 1 1 0 7 3.500 3.500 0 0 1 0-7',
  next: 'M9 5l7 7-7 7',
  target: 'M12 7a5 5 0 1 1 0 10 5 5 0 0 1 0-10M12 2v5M12 17v5M2 12h5M17 12h5',
  check: 'M5 12.500l5 5L20 7',
  eye: 'M2 12s4-7 10-7 10 7 10 7-4 7-10 7S2 12 2 12M12 9a3 3 0 1 1 0 6 3 3 0 0 1 0-6',
  trash: 'M5 7h14M10 4h4M7 7l1 13h8l1-13M10 11v5M14 11v5',
};

export function icon(name: keyof typeof kIcons & string): SVGElement {
  return svg('svg', { viewBox: '0 0 24 24', class: 'icon', 'aria-hidden': 'true' }, svg('path', { d: kIcons[name] ?? '' }));
}

export function replaceChildren(parent: Element, ...children: (Child | Child[])[]): void {
  parent.replaceChildren(...children.flat().filter((c): c is Node | string => c !== null && c !== false));
}

/** Sets the text only if it differs, so that nothing is laid out again for nothing. */
export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

export function setAttribute(element: Element, name: string, value: string): void {
  if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}
