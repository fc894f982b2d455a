import { App, failed } from './ui/app';
import { startTheme } from './ui/theme';

const host = document.getElementById('app');
if (host) {
  try {
    startTheme();
    const app = new App(host);
    app.start();
    // For tests and for a look from the console of the browser.
    (window as unknown as { romap: App }).romap = app;
  } catch (error) {
    failed(host, error);
  }
}
