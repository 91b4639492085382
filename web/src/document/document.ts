/** The document: keys in time, and the settings of the gap after each. Immutable. */

import type { GapSettings, SourceFile } from "../protocol";
import type { Pose } from "../rig";

export interface Key {
  readonly id: string;
  readonly frame: number;
  readonly pose: Pose;
  /** The source frame that the pose was taken from; null once it is edited. */
  readonly source: number | null;
  /** The gap from this key to the next one. */
  readonly after: GapSettings;
  /** The frames of a locked gap, as rows. */
  readonly kept: Float32Array | null;
}

export interface Document {
  readonly name: string;
  readonly source: SourceFile;
  readonly rate: number;
  /** Number of floats of a pose. */
  readonly stride: number;
  /** At least one, sorted by frame, no two at the same frame. */
  readonly keys: readonly Key[];
}

/** A gap, identified by its left key. */
export interface Gap {
  readonly id: string;
  readonly index: number;
  readonly left: Key;
  readonly right: Key;
  /** Frames between the two keys. */
  readonly frames: number;
  readonly settings: GapSettings;
}

export const DEFAULT_SETTINGS: GapSettings = {
  method: "dcmoe",
  model: null,
  style: null,
  blend: null,
  style_strength: 1,
  path: { kind: "auto" },
  path_control: 1,
  own_gallery: false,
  target_joints: null,
  variants: 4,
  seed: 1,
  speed: null,
  chosen: 0,
  locked: false,
};

export const AS_IN_CLIP: GapSettings = { ...DEFAULT_SETTINGS, method: "clip" };

/** The longest gap that can be requested (MOST_FRAMES in protocol.py). */
export const LONGEST_GAP = 6000;

export function newId(): string {
  return crypto.randomUUID().slice(0, 12);
}

/** Built once per document, which never changes. */
const known = new WeakMap<Document, { readonly gaps: readonly Gap[]; readonly byId: ReadonlyMap<string, Gap> }>();

function indexOf(document: Document) {
  let index = known.get(document);
  if (!index) {
    const gaps = document.keys.slice(0, -1).map((left, i): Gap => {
      const right = document.keys[i + 1];
      return { id: left.id, index: i, left, right, frames: right.frame - left.frame - 1, settings: left.after };
    });
    index = { gaps, byId: new Map(gaps.map((gap) => [gap.id, gap])) };
    known.set(document, index);
  }
  return index;
}

/** All gaps in order; the same objects for the same document. */
export function gapsOf(document: Document): readonly Gap[] {
  return indexOf(document).gaps;
}

/** The gap after the key `id`, or null if there is none. */
export function gapOf(document: Document, id: string | null): Gap | null {
  return indexOf(document).byId.get(id ?? "") ?? null;
}

/** The gap that contains a frame, its left key included; null outside. */
export function gapAtFrame(document: Document, frame: number): Gap | null {
  const index = document.keys.findLastIndex((key) => key.frame <= frame);
  return gapsOf(document)[index] ?? null;
}

export function keyOf(document: Document, id: string | null): Key | null {
  return document.keys.find((key) => key.id === id) ?? null;
}

export function keyAtFrame(document: Document, frame: number): Key | null {
  return document.keys.find((key) => key.frame === frame) ?? null;
}

export function firstFrame(document: Document): number {
  return document.keys[0].frame;
}

export function lastFrame(document: Document): number {
  return document.keys[document.keys.length - 1].frame;
}

/** Whether both keys of a gap are source frames at the same distance as in the source, so that it can keep the clip's frames. */
export function isAsInClip(left: Key, right: Key): boolean {
  return left.source !== null && right.source !== null && right.source - left.source === right.frame - left.frame;
}
