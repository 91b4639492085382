/** Labels of keys and gaps, for bars, tooltips and screen readers. */

import type { Gap, Key } from "../document/document";
import type { GapState } from "../engine/generator";
import type { GapSettings } from "../protocol";
import { seconds } from "./layout";

const METHOD_NAMES: Readonly<Record<string, string>> = {
  dcmoe: "DC-MoE",
  stitch: "Stitch",
  "stitch+detail": "Stitch + detail",
  plan: "Planner only",
  interp: "Interpolate",
  clip: "Clip",
};

/** The name of a method, as shown. */
export const methodName = (method: string): string => METHOD_NAMES[method] ?? method;

/** The style, the blend with its shares, or the method. */
export function styleText({ method, style, blend }: GapSettings): string {
  if (method === "clip" || method === "interp") return methodName(method);
  if (style === null) return "No style";
  if (!blend || blend.share === 0) return style;
  const share = Math.round(100 * blend.share);
  return `${style} ${100 - share} / ${blend.style} ${share}`;
}

/** The label of a bar: its style, and its method unless the style already names it. */
export function barText(settings: GapSettings): { style: string; method: string | null } {
  const named = settings.method !== "clip" && settings.method !== "interp";
  return { style: styleText(settings), method: named ? methodName(settings.method) : null };
}

export function framesText(frames: number): string {
  return frames === 1 ? "1 frame" : `${frames} frames`;
}

export function keyLabel(key: Key, rate: number): string {
  const own = key.source === null ? "" : ", from the clip";
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
