/** Draws thumbnails one after another, so that many of them do not block the page. */

import type { Rig } from "../../rig";
import { drawThumbnail } from "../../viewport/characters/thumbnails";

interface Picture {
  readonly canvas: HTMLCanvasElement;
  readonly rig: Rig;
  readonly rows: Float32Array;
  readonly frames: number;
  readonly theme: "light" | "dark";
}

const queue = new Set<Picture>();
let running = false;

/** Queues a picture; the returned function removes it again. */
export function drawn(picture: Picture): () => void {
  queue.add(picture);
  if (!running) setTimeout(run);
  running = true;
  return () => queue.delete(picture);
}

/** Draws for a few milliseconds; the rest follows later. */
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
