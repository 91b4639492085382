/** Methods, styles and paths as the gap panel shows them. */

import type { Gap } from "../../document/document";
import { isAsInClip } from "../../document/document";
import type { Candidate } from "../../engine/generator";
import type { CandidateInfo, GapSettings, MethodInfo } from "../../protocol";
import type { Rig } from "../../rig";
import type { Segment } from "../controls/Segmented.svelte";

export type Method = GapSettings["method"];
export type PathChoice = "auto" | "straight" | "none" | "choose" | "draw";

const METHODS: readonly { value: Method; label: string; tip: string }[] = [
  { value: "dcmoe", label: "DC-MoE", tip: "Style, path and duration control. For gaps of half a second or more." },
  { value: "stitch", label: "Stitch", tip: "Stitches two motions, one from each key, with varied candidates. For short gaps." },
  { value: "interp", label: "Interpolate", tip: "Linear interpolation of the two poses, without a model." },
  { value: "clip", label: "Clip", tip: "The clip's own motion, unchanged." },
];

/** The methods for a gap. Those that this rig or this installation cannot serve are disabled, with the reason. */
export function methodSegments(gap: Gap, rig: Rig | null, methods: readonly MethodInfo[]): Segment<Method>[] {
  return METHODS.filter(({ value }) => value !== "clip" || isAsInClip(gap.left, gap.right)).map((method) => {
    const { value } = method;
    const learned = value === "dcmoe" || value === "stitch";
    const missing = learned && !methods.some((info) => info.method === value);
    const reason = learned && rig?.reason ? rig.reason : missing ? "No model for it is installed." : null;
    return { ...method, tip: reason ?? method.tip, disabled: reason !== null && gap.settings.method !== value, testid: `method-${value}` };
  });
}

/** The settings that change with the method; settings that it does not support are reset. */
export function withMethod(settings: GapSettings, method: Method, methods: readonly MethodInfo[]): Partial<GapSettings> {
  const info = methods.find((each) => each.method === method);
  const styles = info?.styles ?? [];
  const style = settings.style !== null && styles.includes(settings.style) ? settings.style : null;
  const blend = style !== null && settings.blend && styles.includes(settings.blend.style) ? settings.blend : null;
  const path = info?.paths ? settings.path : ({ kind: "auto" } as const);
  return method === "clip" ? { method } : { method, style, blend, path };
}

/** The settings that change with the style; a blend needs two different styles. */
export function withStyle(settings: GapSettings, style: string | null): Partial<GapSettings> {
  const blend = style !== null && settings.blend && settings.blend.style !== style ? settings.blend : null;
  return { style, blend };
}

export function pathChoice({ path }: GapSettings): PathChoice {
  if (path.kind !== "waypoints") return path.kind;
  return path.drawn ? "draw" : "choose";
}

/** Centimetres per frame from which on foot sliding is visible. */
export const SLIDES = 1;

/** A reason as a full sentence. */
export function sentence(text: string): string {
  const trimmed = text.trim().replace(/[.\s]+$/, "");
  return `${trimmed.charAt(0).toUpperCase()}${trimmed.slice(1)}.`;
}

const INSTEAD: Readonly<Record<CandidateInfo["method"], string>> = {
  dcmoe: "DC-MoE instead",
  stitch: "Stitched instead",
  interp: "Interpolated instead",
};

/** What could not be served, and what was used instead. */
export function fallbackText(info: CandidateInfo | null, request: Method): string | null {
  if (!info?.fallback) return null;
  return info.method === request ? sentence(info.fallback) : `${INSTEAD[info.method]}: ${sentence(info.fallback)}`;
}

/** The label of a candidate, for screen readers. */
export function candidateLabel({ info }: Candidate, rank: number, chosen: boolean): string {
  const parts = [`Candidate ${rank}`];
  if (info?.style) parts.push(info.style);
  if (info?.foot_slide !== null && info?.foot_slide !== undefined) parts.push(`foot slide ${info.foot_slide.toFixed(1)} cm per frame`);
  if (info?.fallback) parts.push(info.fallback);
  if (chosen) parts.push("chosen");
  return parts.join(", ");
}
