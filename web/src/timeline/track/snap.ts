/** Snapping of a dragged key to the playhead, to other gaps' lengths and to whole seconds. */

import type { Document } from "../../document/document";
import { lowerBound } from "../layout";

export interface SnapPoint {
  readonly frame: number;
  readonly why: string;
}

/** Snapping distance in pixels. */
const REACH_PX = 6;
/** Minimum width of a second in pixels for snapping to seconds. */
const SECOND_PX = 40;

export class Snapper {
  private readonly points: readonly SnapPoint[];
  private readonly frames: readonly number[];

  /** For the key `anchor` of those that move. `ripple`: later keys move along. */
  constructor(
    private readonly document: Document,
    ids: readonly string[],
    anchor: string,
    playhead: number,
    ripple: boolean,
  ) {
    const { keys } = document;
    const moves = new Set(ids);
    const index = keys.findIndex((key) => key.id === anchor);
    const points: SnapPoint[] = [{ frame: playhead, why: "playhead" }];
    const left = keys[index - 1];
    const right = keys[index + 1];
    const lengths = new Set<number>();
    for (let i = 0; i + 1 < keys.length; i++) {
      if (i !== index - 1 && i !== index) lengths.add(keys[i + 1].frame - keys[i].frame);
    }
    for (const length of lengths) {
      const why = `as long as another gap: ${length - 1} frames`;
      if (left && !moves.has(left.id)) points.push({ frame: left.frame + length, why });
      if (right && !moves.has(right.id) && !ripple) points.push({ frame: right.frame - length, why });
    }
    this.points = points.sort((a, b) => a.frame - b.frame);
    this.frames = this.points.map((point) => point.frame);
  }

  /** The point that a frame snaps to, or null. */
  near(frame: number, zoom: number): SnapPoint | null {
    const reach = REACH_PX / zoom;
    let best: SnapPoint | null = null;
    const look = (point: SnapPoint) => {
      const away = Math.abs(point.frame - frame);
      if (away <= reach && (!best || away < Math.abs(best.frame - frame))) best = point;
    };
    for (let i = lowerBound(this.frames, frame - reach); i < this.frames.length && this.frames[i] <= frame + reach; i++) {
      look(this.points[i]);
    }
    if (!best && this.document.rate * zoom >= SECOND_PX) {
      const second = Math.round(frame / this.document.rate);
      const at = Math.round(second * this.document.rate);
      look({ frame: at, why: `${second} s` });
    }
    return best;
  }
}
