import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vitest/config";

const STUDIO = "http://127.0.0.1:8360";

export default defineConfig({
  plugins: [svelte()],
  build: { outDir: "dist", emptyOutDir: true, target: "es2022", chunkSizeWarningLimit: 1200 },
  // `npm run dev` beside `interpose studio --no-browser`
  server: { host: "127.0.0.1", proxy: { "/api": { target: STUDIO, ws: true, changeOrigin: true, headers: { origin: STUDIO } } } },
  test: { include: ["tests/**/*.test.ts"], environment: "node" },
});
