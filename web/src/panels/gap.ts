/** What the gap's panel has to know of methods, styles and paths. */

import type { Gap } from "../document/document";
import { isAsInClip } from "../document/document";
import type { Candidate } from "../engine/generator";
import type { CandidateInfo, GapSettings, MethodInfo } from "../protocol";
import type { Rig } from "../rig";
import type { Segment } from "./Segmented.svelte";

export type Method = GapSettings["method"];
export type PathChoice = "auto" | "straight" | "none" | "choose" | "draw";

const METHODS: readonly { value: Method; label: string; tip: string }[] = [
  { value: "dcmoe", label: "DC-MoE", tip: "Moves in a style, along a path, in the time you give. For gaps from half a second up." },
  { value: "stitch", label: "Stitch", tip: "Joins two poses from both ends, with varied candidates. For short gaps." },
  { value: "interp", label: "Interpolate", tip: "Blends the two poses evenly, without a model. Exact and plain." },
  { value: "clip", label: "Clip", tip: "The clip's own motion, untouched." },
];

/** The methods that can be chosen for a gap; those that this rig or this installation cannot serve say why. */
export function methodSegments(gap: Gap, rig: Rig | null, methods: readonly MethodInfo[]): Segment<Method>[] {
  return METHODS.filter(({ value }) => value !== "clip" || isAsInClip(gap.left, gap.right)).map((method) => {
    const { value } = method;
    const learned = value === "dcmoe" || value === "stitch";
    const missing = learned && !methods.some((info) => info.method === value);
    const reason = learned && rig?.reason ? rig.reason : missing ? "No model for it is installed." : null;
    return { ...method, tip: reason ?? method.tip, disabled: reason !== null && gap.settings.method !== value, testid: `method-${value}` };
  });
}

/** The settings that choosing a method changes: a style that it does not know, and a path that it does not follow, go. */
export function withMethod(settings: GapSettings, method: Method, methods: readonly MethodInfo[]): Partial<GapSettings> {
  const info = methods.find((each) => each.method === method);
  const styles = info?.styles ?? [];
  const style = settings.style !== null && styles.includes(settings.style) ? settings.style : null;
  const blend = style !== null && settings.blend && styles.includes(settings.blend.style) ? settings.blend : null;
  const path = info?.paths ? settings.path : ({ kind: "auto" } as const);
  return method === "clip" ? { method } : { method, style, blend, path };
}

/** The settings that choosing a style changes: a blend needs two styles that are not the same. */
export function withStyle(settings: GapSettings, style: string | null): Partial<GapSettings> {
  const blend = style !== null && settings.blend && settings.blend.style !== style ? settings.blend : null;
  return { style, blend };
}

export function pathChoice({ path }: GapSettings): PathChoice {
  if (path.kind !== "line") return path.kind;
  return path.drawn ? "draw" : "choose";
}

/** Centimetres a frame above which feet are seen to slide. */
export const SLIDES = 1;

/** A reason as a sentence of its own. */
export function sentence(text: string): string {
  const trimmed = text.trim().replace(/[.\s]+$/, "");
  return `${trimmed.charAt(0).toUpperCase()}${trimmed.slice(1)}.`;
}

const INSTEAD: Readonly<Record<CandidateInfo["method"], string>> = {
  dcmoe: "DC-MoE instead",
  stitch: "Stitched instead",
  interp: "Interpolated instead",
};

/** What could not be served as asked, and what served instead. */
export function fallbackWords(info: CandidateInfo | null, asked: Method): string | null {
  if (!info?.fallback) return null;
  return info.method === asked ? sentence(info.fallback) : `${INSTEAD[info.method]}: ${sentence(info.fallback)}`;
}

/** A candidate in words, for screen readers. */
export function candidateLabel({ info }: Candidate, rank: number, chosen: boolean): string {
  const words = [`Candidate ${rank}`];
  if (info?.style) words.push(info.style);
  if (info?.foot_slide !== null && info?.foot_slide !== undefined) words.push(`foot slide ${info.foot_slide.toFixed(1)} cm a frame`);
  if (info?.fallback) words.push(info.fallback);
  if (chosen) words.push("chosen");
  return words.join(", ");
}
