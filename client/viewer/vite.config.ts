import { defineConfig } from 'vite';

const server = process.env.ROMAP_SERVER ?? 'http://127.0.0.1:8080';

export default defineConfig({
  appType: 'mpa',
  build: {
    target: 'es2021',
    outDir: process.env.ROMAP_VIEWER_OUT ?? 'dist',
    emptyOutDir: true,
    // The content security policy of the server allows neither inline scripts nor data: URLs for the decoder.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
    chunkSizeWarningLimit: 1000,
    rollupOptions: { input: { index: 'index.html', camera: 'camera.html' } },
  },
  server: {
    // `npm run dev` serves the page and passes the API on to a running server. The Host header is replaced, because the
    // server accepts only its own.
    proxy: { '/api': { target: server, changeOrigin: true }, '/metrics': { target: server, changeOrigin: true } },
  },
});
