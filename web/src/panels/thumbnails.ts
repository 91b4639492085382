/** Draws thumbnails one after another, so that many of them never hold up the rest. */

import type { Rig } from "../rig";
import { drawThumbnail } from "../viewport/thumbnails";

interface Picture {
  readonly canvas: HTMLCanvasElement;
  readonly rig: Rig;
  readonly rows: Float32Array;
  readonly frames: number;
  readonly theme: "light" | "dark";
}

const queue = new Set<Picture>();
let running = false;

/** Puts a picture in line; the answer takes it out again. */
export function drawn(picture: Picture): () => void {
  queue.add(picture);
  if (!running) setTimeout(run);
  running = true;
  return () => queue.delete(picture);
}

/** As many as take a few milliseconds, and the others later. */
function run(): void {
  const began = performance.now();
  for (const picture of queue) {
    queue.delete(picture);
    const { canvas, rig, rows, frames, theme } = picture;
    drawThumbnail(canvas, rig, rows, frames, theme);
    if (performance.now() - began > 6) break;
  }
  running = queue.size > 0;
  if (running) requestAnimationFrame(run);
}
