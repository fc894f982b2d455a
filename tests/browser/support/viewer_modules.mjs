// Packages of client/viewer for the tests, which lie outside of its folder.
import { createRequire } from 'node:module';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));

/** Where package.json and node_modules are: the build passes it; by hand, it is the source folder. */
export const viewerDir = process.env.ROMAP_VIEWER_DIR ?? path.resolve(here, '../../../client/viewer');
export const distDir = process.env.ROMAP_VIEWER_DIST_DIR ?? path.join(viewerDir, 'dist');
export const fromViewer = createRequire(path.join(viewerDir, 'package.json'));
