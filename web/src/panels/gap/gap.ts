/** Methods, styles and paths as the gap panel shows them. */

import type { Gap } from "../../document/document";
import { isAsInClip } from "../../document/document";
import { infoOf, withMethod } from "../../document/methods";
import type { Candidate } from "../../engine/generator";
import type { CandidateInfo, GapSettings, MethodInfo } from "../../protocol";
import type { Rig } from "../../rig";
import type { Studio } from "../../studio.svelte";
import { methodName } from "../../timeline/text";

export type PathChoice = "auto" | "gallery" | "straight" | "none" | "draw";

interface MethodOption {
  readonly value: string;
  readonly label: string;
  /** What it is for, or why it cannot be chosen. */
  readonly tip: string;
  readonly disabled: boolean;
}

/** The methods for a gap. Those that this rig, this installation or this gap rule out are disabled, with the reason. */
export function methodOptions(gap: Gap, rig: Rig | null, methods: readonly MethodInfo[]): MethodOption[] {
  const { method } = gap.settings;
  const names = [...new Set([...methods.map((info) => info.method), ...(method === "clip" ? [] : [method])])];
  const options = names.map((value): MethodOption => {
    const info = infoOf({ method: value, model: null }, methods);
    const seconds = (gap.frames + 1) / (rig?.rate ?? 30);
    const longest = info?.longest_seconds ?? Infinity;
    let reason: string | null = null;
    if (!info) reason = "not installed";
    else if (rig?.reason && !info.any_rig) reason = "needs a humanoid rig";
    else if (seconds > longest + 0.05) reason = `for gaps of up to ${longest} s`;
    const tip = reason ?? info?.summary ?? "";
    const disabled = reason !== null && method !== value;
    return { value, label: `${methodName(value)}${disabled ? ` (${tip})` : ""}`, tip, disabled };
  });
  const clip = { value: "clip", label: methodName("clip"), tip: "the clip's own motion, unchanged", disabled: false };
  return isAsInClip(gap.left, gap.right) ? [...options, clip] : options;
}

/** Regenerates a gap that keeps the clip's frames, with the first method that can serve it. */
export function generate(studio: Studio, gap: Gap): void {
  const { methods } = studio.welcome;
  const method = methodOptions(gap, studio.rig, methods).find(({ disabled }) => !disabled)?.value ?? "interp";
  studio.setGap(gap.id, withMethod(gap.settings, { method, model: null }, methods), "Generate in-between");
}

export function pathChoice({ path }: GapSettings): PathChoice {
  if (path.kind !== "waypoints") return path.kind;
  return path.drawn ? "draw" : "gallery";
}

/** Centimetres per frame from which on foot sliding is visible. */
export const SLIDES = 1;

/** A reason as a full sentence. */
export function sentence(text: string): string {
  const trimmed = text.trim().replace(/[.\s]+$/, "");
  return `${trimmed.charAt(0).toUpperCase()}${trimmed.slice(1)}.`;
}

/** What could not be served, and what was used instead. */
export function fallbackText(info: CandidateInfo | null, requested: string): string | null {
  if (!info?.fallback) return null;
  return info.method === requested ? sentence(info.fallback) : `${methodName(info.method)} instead: ${sentence(info.fallback)}`;
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
