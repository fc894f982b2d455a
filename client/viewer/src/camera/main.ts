import { startTheme } from '../ui/theme';
import { CameraPage } from './camera_page';

const host = document.getElementById('app');
if (host) {
  startTheme();
  const page = new CameraPage();
  host.replaceChildren(page.element);
  // For tests and for a look from the console of the browser.
  (window as unknown as { romapCamera: CameraPage }).romapCamera = page;
}
