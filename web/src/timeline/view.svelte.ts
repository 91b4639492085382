/** The state of the timeline: its scale, dragging options, and the current drag. */

import { firstFrame, lastFrame } from "../document/document";
import type { Studio } from "../studio.svelte";
import type { Scale } from "./layout";
import { fitted, revealed, scrolled, toFrame, toX, zoomed } from "./layout";

/** What has the keyboard's focus: a key, or the gap after it. */
export type Item = { readonly kind: "key" | "gap"; readonly id: string };

/** Pixels from an edge within which dragging scrolls. */
const EDGE_PX = 24;

export class TimelineView {
  width = $state(1000);
  scale = $state.raw<Scale>({ origin: -5, zoom: 5 });
  snap = $state(true);
  /** Later keys move along with a dragged one. */
  ripple = $state(false);
  /** Where the dragged key has snapped. */
  guide = $state.raw<{ readonly frame: number; readonly why: string } | null>(null);
  /** Frames of the rectangle that selects. */
  box = $state.raw<{ readonly from: number; readonly to: number } | null>(null);
  dragging = $state(false);
  item = $state.raw<Item | null>(null);
  /** Whether the view keeps fitting everything, because the user has not zoomed or scrolled. */
  fits = $state(true);

  constructor(private readonly studio: Studio) {}

  get last(): number {
    const { document } = this.studio;
    return document ? lastFrame(document) : 0;
  }

  x(frame: number): number {
    return toX(this.scale, frame);
  }

  frame(x: number): number {
    return toFrame(this.scale, x);
  }

  fit(): void {
    const { document } = this.studio;
    if (!document) return;
    this.scale = fitted(firstFrame(document), lastFrame(document), this.width);
    this.fits = true;
  }

  zoom(factor: number, x = this.x(this.studio.playback.time)): void {
    const inside = x >= 0 && x <= this.width ? x : this.width / 2;
    this.scale = zoomed(this.scale, factor, inside, this.last, this.width);
    this.fits = false;
  }

  scroll(px: number): void {
    const next = scrolled(this.scale, px, this.last, this.width);
    if (next.origin !== this.scale.origin) this.fits = false;
    this.scale = next;
  }

  reveal(frame: number): void {
    this.scale = revealed(this.scale, frame, this.last, this.width);
  }

  /** Scrolls while something is dragged at or over an edge. */
  edge(x: number): void {
    if (x < EDGE_PX) this.scroll(Math.max(-30, x - EDGE_PX));
    else if (x > this.width - EDGE_PX) this.scroll(Math.min(30, x - this.width + EDGE_PX));
  }

  /** Moves the playhead to the pointer, also beyond the last key. */
  scrub(x: number): void {
    this.studio.playback.playing = false;
    this.studio.playback.goTo(this.frame(x));
  }
}
