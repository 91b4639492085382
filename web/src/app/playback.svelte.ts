/** The playhead, and playing. */

import type { Document, Gap } from "../document/document";
import { firstFrame, lastFrame } from "../document/document";

export class Playback {
  /** The playhead in frames; whole unless playing. */
  time = $state(0);
  playing = $state(false);
  pace = $state(1);
  /** Whether playing loops over the selected gap, or over everything if none is selected. */
  looping = $state(true);

  constructor(private readonly shown: { readonly document: Document | null; readonly selectedGap: Gap | null }) {}

  get frame(): number {
    return Math.round(this.time);
  }

  goTo(frame: number): void {
    this.time = Math.max(0, Math.round(frame));
  }

  /** Stops playing and goes to a frame. */
  pauseAt(frame: number): void {
    this.playing = false;
    if (this.frame !== frame) this.goTo(frame);
  }

  goToNeighbour(direction: -1 | 1): void {
    const keys = this.shown.document?.keys ?? [];
    const next = direction > 0 ? keys.find((key) => key.frame > this.frame) : keys.findLast((key) => key.frame < this.frame);
    if (next) this.goTo(next.frame);
  }

  toggle(): void {
    const { document } = this.shown;
    if (!document) return;
    this.playing = !this.playing;
    if (!this.playing) this.goTo(this.time);
    else if (!this.looping && this.time >= lastFrame(document)) this.time = firstFrame(document);
  }

  /** Advances the playhead by some seconds of wall time. */
  tick(seconds: number): void {
    const { document } = this.shown;
    if (!this.playing || !document) return;
    const gap = this.looping ? this.shown.selectedGap : null;
    const first = gap ? gap.left.frame : firstFrame(document);
    const last = gap ? gap.right.frame : lastFrame(document);
    let time = this.time + seconds * document.rate * this.pace;
    if (time > last || time < first) {
      if (!this.looping && time > last) {
        this.playing = false;
        time = last;
      } else time = last > first ? first + ((((time - first) % (last - first)) + (last - first)) % (last - first)) : first;
    }
    this.time = time;
  }
}
