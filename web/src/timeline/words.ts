/** Keys and gaps in words, for the bars, for tooltips and for screen readers. */

import type { Gap, Key } from "../document/document";
import type { GapState } from "../engine/generator";
import type { GapSettings } from "../protocol";
import { seconds } from "./layout";

export const METHOD_NAMES: Readonly<Record<GapSettings["method"], string>> = {
  dcmoe: "DC-MoE",
  stitch: "Stitch",
  interp: "Interpolate",
  clip: "Clip",
};

/** The style, a blend with its shares, or what there is instead. */
export function styleWords({ method, style, blend }: GapSettings): string {
  if (method === "clip") return "Clip";
  if (method === "interp") return "Interpolate";
  if (style === null) return "Free";
  if (!blend || blend.share === 0) return style;
  const share = Math.round(100 * blend.share);
  return `${style} ${100 - share} / ${blend.style} ${share}`;
}

/** What a bar says: its style, and its method where that is not said by it. */
export function barWords(settings: GapSettings): { style: string; method: string | null } {
  const named = settings.method === "dcmoe" || settings.method === "stitch";
  return { style: styleWords(settings), method: named ? METHOD_NAMES[settings.method] : null };
}

export function framesWords(frames: number): string {
  return frames === 1 ? "1 frame" : `${frames} frames`;
}

export function keyLabel(key: Key, rate: number): string {
  const own = key.source === null ? "" : ", the clip's own";
  return `Key at frame ${key.frame}, ${seconds(key.frame, rate)}${own}`;
}

const STATE_WORDS: Readonly<Record<GapState, string>> = {
  clip: "as in the clip",
  locked: "locked",
  empty: "no frames",
  ready: "ready",
  waiting: "waiting",
  working: "being made",
  failed: "failed",
};

export function gapLabel(gap: Gap, state: GapState, failure: string | null): string {
  const { style, method } = barWords(gap.settings);
  const what = method ? `${style}, ${gap.settings.method}` : style;
  const how = failure && state === "failed" ? `failed: ${failure}` : STATE_WORDS[state];
  return `Gap from ${gap.left.frame} to ${gap.right.frame}, ${what}, ${how}`;
}

/** What a gap's tooltip says: more than its bar has room for. */
export function gapTip(gap: Gap, state: GapState, failure: string | null, rate: number): string {
  if (state === "failed" && failure) return failure;
  const { style, method } = barWords(gap.settings);
  const length = `${framesWords(gap.frames)}, ${seconds(gap.frames + 1, rate)}`;
  const more = state === "ready" || state === "clip" ? "" : ` · ${STATE_WORDS[state]}`;
  return `${style}${method ? ` · ${method}` : ""} · ${length}${more}`;
}
