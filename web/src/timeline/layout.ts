/** Where frames are on the timeline: pixels, ticks, and what of many keys is worth drawing. */

export interface Scale {
  /** The frame at the left edge; a fraction while scrolling. */
  readonly origin: number;
  /** Pixels of a frame. */
  readonly zoom: number;
}

interface Tick {
  readonly frame: number;
  readonly major: boolean;
}

/** Empty pixels left and right of what is fitted. */
export const MARGIN = 36;
const CLOSEST = 40;
const LABEL_PX = 84;
const TICK_PX = 7;

export const toX = (scale: Scale, frame: number): number => (frame - scale.origin) * scale.zoom;
export const toFrame = (scale: Scale, x: number): number => scale.origin + x / scale.zoom;

/** Everything from `first` to `last`, with some room to pull the last key into. */
export function fitted(first: number, last: number, width: number): Scale {
  const room = Math.max(10, width - 2 * MARGIN);
  const length = Math.max(10, (last - first) * 1.04);
  const zoom = Math.min(CLOSEST, room / length);
  return { origin: first - MARGIN / zoom, zoom };
}

/** How far out can be zoomed: until everything takes half the width. */
function farthest(last: number, width: number): number {
  return Math.min(CLOSEST, Math.max(1, width) / (2 * Math.max(60, last)));
}

/** The scale within its limits: something of the motion stays in view. */
export function clamped(scale: Scale, last: number, width: number): Scale {
  const zoom = Math.max(farthest(last, width), Math.min(CLOSEST, scale.zoom));
  const margin = MARGIN / zoom;
  const shown = width / zoom;
  const most = Math.max(-margin, last + shown * 0.5 - shown + margin);
  return { zoom, origin: Math.max(-margin, Math.min(most, scale.origin)) };
}

/** Nearer or farther by a factor; what is at `x` stays there. */
export function zoomed(scale: Scale, factor: number, x: number, last: number, width: number): Scale {
  const zoom = Math.max(farthest(last, width), Math.min(CLOSEST, scale.zoom * factor));
  return clamped({ zoom, origin: toFrame(scale, x) - x / zoom }, last, width);
}

export function scrolled(scale: Scale, px: number, last: number, width: number): Scale {
  return clamped({ ...scale, origin: scale.origin + px / scale.zoom }, last, width);
}

/** The scale moved so that a frame is in view, if it is not. */
export function revealed(scale: Scale, frame: number, last: number, width: number): Scale {
  const x = toX(scale, frame);
  if (x >= 8 && x <= width - 8) return scale;
  const at = x < 8 ? MARGIN : width - MARGIN;
  return clamped({ ...scale, origin: frame - at / scale.zoom }, last, width);
}

/** Frames between ticks: parts of a second that are whole frames, then whole seconds and minutes. */
export function steps(rate: number): number[] {
  const second = Math.max(1, Math.round(rate));
  const parts = [1, 2, 5, 10, 15, 20, 30].filter((step) => step < second && second % step === 0);
  return [...parts, ...[1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600].map((seconds) => seconds * second)];
}

/** The ticks in view, from as fine as can be told apart; major ones have room for a label. */
export function ticks(scale: Scale, width: number, rate: number): Tick[] {
  const all = steps(rate);
  const major = all.find((step) => step * scale.zoom >= LABEL_PX) ?? all[all.length - 1];
  const minor = all.find((step) => step * scale.zoom >= TICK_PX && major % step === 0) ?? major;
  const made: Tick[] = [];
  const first = Math.max(0, Math.floor(scale.origin / minor));
  for (let i = first; i * minor <= toFrame(scale, width); i++) {
    made.push({ frame: i * minor, major: (i * minor) % major === 0 });
  }
  return made;
}

/** The index of the first of sorted frames that is at least `frame`. */
export function lowerBound(frames: readonly number[], frame: number): number {
  let low = 0;
  let high = frames.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (frames[middle] < frame) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Pixels that two diamonds are apart at least, and that a bar is wide at least, to be drawn. */
const DIAMOND_PX = 10;
const BAR_PX = 3;

export interface Shown {
  /** Indices of keys and of gaps (each of its left key). */
  readonly keys: number[];
  readonly gaps: number[];
  /** Whether keys were left out. */
  readonly dense: boolean;
}

/** What is in view of keys at sorted frames. Of keys that lie on one another only some are drawn; those of `always` are. */
export function shown(frames: readonly number[], scale: Scale, width: number, always: (index: number) => boolean): Shown {
  const from = Math.max(0, lowerBound(frames, toFrame(scale, -20)) - 1);
  const to = Math.min(frames.length, lowerBound(frames, toFrame(scale, width + 20)) + 1);
  const keys: number[] = [];
  const gaps: number[] = [];
  let before = -Infinity;
  let dense = false;
  for (let i = from; i < to; i++) {
    const x = toX(scale, frames[i]);
    const apart = x - before >= DIAMOND_PX;
    if (apart) before = x;
    else dense = true;
    if (apart || always(i)) keys.push(i);
  }
  for (let i = from; i < to && i < frames.length - 1; i++) {
    if ((frames[i + 1] - frames[i]) * scale.zoom >= BAR_PX) gaps.push(i);
  }
  return { keys, gaps, dense };
}

/** A second's decimals as many as needed to tell frames apart, without idle zeros. */
export function seconds(frames: number, rate: number, digits = 2): string {
  return `${Number((frames / rate).toFixed(digits))} s`;
}
