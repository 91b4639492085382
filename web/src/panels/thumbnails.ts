/** Draws thumbnails one after another, a picture's time apart, so that many of them never hold up the rest. */

import type { Rig } from "../rig";

interface Picture {
  readonly canvas: HTMLCanvasElement;
  readonly rig: Rig;
  readonly rows: Float32Array;
  readonly frames: number;
  readonly theme: "light" | "dark";
  readonly width: number;
  readonly height: number;
}

type Draw = (canvas: HTMLCanvasElement, rig: Rig, rows: Float32Array, frames: number, theme: "light" | "dark") => void;

const modules = import.meta.glob<{ drawThumbnail: Draw }>("../viewport/thumbnails.ts");
let draw: Promise<Draw | null> | null = null;
const queue = new Set<Picture>();
let running = false;

/** Puts a picture in line; the answer takes it out again. */
export function drawn(picture: Picture): () => void {
  queue.add(picture);
  void run();
  return () => queue.delete(picture);
}

async function run(): Promise<void> {
  if (running) return;
  running = true;
  draw ??= Object.values(modules)[0]?.().then((module) => module.drawThumbnail) ?? Promise.resolve(null);
  const drawThumbnail = await draw;
  for (const picture of queue) {
    queue.delete(picture);
    const { canvas, rig, rows, frames, theme, width, height } = picture;
    const ratio = Math.min(2, devicePixelRatio || 1);
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    drawThumbnail?.(canvas, rig, rows, frames, theme);
    await new Promise((resolve) => setTimeout(resolve, 0));
  }
  running = false;
}
