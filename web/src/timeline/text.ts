/** Labels of keys and gaps, for bars, tooltips and screen readers. */

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

/** The style, the blend with its shares, or the method. */
export function styleText({ method, style, blend }: GapSettings): string {
  if (method === "clip") return "Clip";
  if (method === "interp") return "Interpolate";
  if (style === null) return "No style";
  if (!blend || blend.share === 0) return style;
  const share = Math.round(100 * blend.share);
  return `${style} ${100 - share} / ${blend.style} ${share}`;
}

/** The label of a bar: its style, and its method unless the style already names it. */
export function barText(settings: GapSettings): { style: string; method: string | null } {
  const named = settings.method === "dcmoe" || settings.method === "stitch";
  return { style: styleText(settings), method: named ? METHOD_NAMES[settings.method] : null };
}

export function framesText(frames: number): string {
  return frames === 1 ? "1 frame" : `${frames} frames`;
}

export function keyLabel(key: Key, rate: number): string {
  const own = key.source === null ? "" : ", the clip's own";
  return `Key at frame ${key.frame}, ${seconds(key.frame, rate)}${own}`;
}

const STATE_TEXT: Readonly<Record<GapState, string>> = {
  clip: "the clip's motion",
  locked: "locked",
  empty: "no frames",
  ready: "ready",
  waiting: "waiting",
  working: "generating",
  failed: "failed",
};

export function gapLabel(gap: Gap, state: GapState, failure: string | null): string {
  const { style, method } = barText(gap.settings);
  const what = method ? `${style}, ${gap.settings.method}` : style;
  const how = failure && state === "failed" ? `failed: ${failure}` : STATE_TEXT[state];
  return `Gap from ${gap.left.frame} to ${gap.right.frame}, ${what}, ${how}`;
}

/** The tooltip of a gap, with more detail than its bar. */
export function gapTip(gap: Gap, state: GapState, failure: string | null, rate: number): string {
  if (state === "failed" && failure) return failure;
  const { style, method } = barText(gap.settings);
  const length = `${framesText(gap.frames)}, ${seconds(gap.frames + 1, rate)}`;
  const more = state === "ready" || state === "clip" ? "" : ` · ${STATE_TEXT[state]}`;
  return `${style}${method ? ` · ${method}` : ""} · ${length}${more}`;
}
