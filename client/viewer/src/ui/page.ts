/** What the app shows at a time. */
export interface Page {
  readonly element: HTMLElement;
  start(): void;
  stop(): void;
}
