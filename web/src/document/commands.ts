/** Edits of a document, as pure functions from one document to the next. An impossible edit returns the document unchanged. */

import type { GapSettings } from "../protocol";
import type { Pose, Rig } from "../rig";
import { row } from "../rig";
import type { Document, Key } from "./document";
import { AS_IN_CLIP, DEFAULT_SETTINGS, gapAtFrame, isAsInClip, keyAtFrame, newId } from "./document";
import type { SourceFile } from "../protocol";

/** The document of a new clip: its first and last frame are keys, and the gap keeps the clip's frames. */
export function fromClip(source: SourceFile, rig: Rig): Document {
  const last = rig.frameCount - 1;
  const keys = (last > 0 ? [0, last] : [0]).map((frame) => keyOfClip(rig, frame, frame, AS_IN_CLIP));
  return { name: source.name.replace(/\.bvh$/i, ""), source, rate: rig.rate, stride: rig.stride, keys };
}

function keyOfClip(rig: Rig, source: number, frame: number, after: GapSettings): Key {
  return { id: newId(), frame, pose: row(rig.frames, rig.stride, source).slice(), source, after, kept: null };
}

/** Adds a key at a frame. Both halves of a split gap keep its settings, and its frames if it is locked. A key that is
 * already there gets the new pose. */
export function addKey(document: Document, frame: number, pose: Pose, source: number | null): Document {
  if (!Number.isInteger(frame) || frame < 0) return document;
  const there = keyAtFrame(document, frame);
  if (there) return setPose(document, there.id, pose, source);
  const gap = gapAtFrame(document, frame);
  const key: Key = { id: newId(), frame, pose: pose.slice(), source, after: DEFAULT_SETTINGS, kept: null };
  if (!gap) return settled(document, [...document.keys, key]);
  const { left } = gap;
  const before = frame - left.frame - 1;
  const cut = (from: number, to?: number) => left.kept?.slice(from * document.stride, to && to * document.stride) ?? null;
  const halves = [
    { ...left, kept: left.kept && cut(0, before) },
    { ...key, after: left.after, kept: cut(before + 1) },
  ];
  return settled(document, [...document.keys.filter((other) => other !== left), ...halves]);
}

/** Deletes keys. The gap before each then extends to the next key. At least one key stays. */
export function deleteKeys(document: Document, ids: readonly string[]): Document {
  const keys = document.keys.filter((key) => !ids.includes(key.id));
  if (keys.length === 0) return document;
  const gone = (key: Key) => ids.includes(document.keys[document.keys.indexOf(key) + 1]?.id);
  return settled(document, keys.map((key) => (gone(key) ? unlocked(key) : key)));
}

/** Moves keys together by some frames, as far as their neighbours and frame 0 allow. */
export function moveKeys(document: Document, ids: readonly string[], by: number): Document {
  const room = roomToMove(document, ids);
  const distance = Math.max(room.least, Math.min(room.most, Math.round(by)));
  if (distance === 0) return document;
  const keys = document.keys.map((key) => (ids.includes(key.id) ? { ...key, frame: key.frame + distance } : key));
  return settled(document, keys.map((key, i) => withLength(document, keys, key, i)));
}

/** How far keys can move together, in frames. */
function roomToMove(document: Document, ids: readonly string[]): { least: number; most: number } {
  let least = -Infinity;
  let most = Infinity;
  document.keys.forEach((key, i) => {
    if (!ids.includes(key.id)) return;
    const before = document.keys[i - 1];
    const behind = document.keys[i + 1];
    if (!before) least = Math.max(least, -key.frame);
    else if (!ids.includes(before.id)) least = Math.max(least, before.frame + 1 - key.frame);
    if (behind && !ids.includes(behind.id)) most = Math.min(most, behind.frame - 1 - key.frame);
  });
  return { least, most };
}

/** Sets the number of frames in the gap after a key; all later keys move along. */
export function setFrames(
  document: Document,
  id: string,
  frames: number,
  speed: GapSettings["speed"] = null,
): Document {
  const index = document.keys.findIndex((key) => key.id === id);
  if (index < 0 || index === document.keys.length - 1) return document;
  const by = Math.max(0, Math.round(frames)) - (document.keys[index + 1].frame - document.keys[index].frame - 1);
  if (by === 0 && document.keys[index].after.speed === speed) return document;
  const moved = document.keys.map((key, i) => (i > index ? { ...key, frame: key.frame + by } : key));
  const keys = moved.map((key, i) => {
    if (i !== index) return key;
    const timed = withLength(document, moved, key, i);
    return { ...timed, after: { ...timed.after, speed } };
  });
  return settled(document, keys);
}

/** Replaces the pose of a key. */
export function setPose(document: Document, id: string, pose: Pose, source: number | null = null): Document {
  const index = document.keys.findIndex((key) => key.id === id);
  if (index < 0) return document;
  const keys = document.keys.map((key, i) =>
    i === index ? { ...unlocked(key), pose: pose.slice(), source } : i === index - 1 ? unlocked(key) : key,
  );
  return settled(document, keys);
}

/** Changes the settings of the gap after a key. Unless the change is a choice of candidate, the best one is shown again. */
export function setGap(document: Document, id: string, changes: Partial<GapSettings>): Document {
  const fresh = "chosen" in changes || "locked" in changes ? {} : { chosen: 0 };
  const keys = document.keys.map((key) => {
    if (key.id !== id) return key;
    const after = { ...key.after, ...fresh, ...changes };
    return { ...key, after, kept: after.locked ? key.kept : null };
  });
  return settled(document, keys);
}

/** Locks the gap after a key, with `rows` as its frames. `target`: the pose of its right key, if it was completed. */
export function lockGap(document: Document, id: string, rows: Float32Array, target: Pose | null = null): Document {
  const right = document.keys[document.keys.findIndex((key) => key.id === id) + 1];
  const reached = right && target && right.pose !== target ? setPose(document, right.id, target) : document;
  const keys = reached.keys.map((key) =>
    key.id === id ? { ...key, after: { ...key.after, locked: true }, kept: rows.slice() } : key,
  );
  return { ...reached, keys };
}

/** Copied poses, their distances in frames, and the settings of their gaps. */
export interface Copied {
  readonly stride: number;
  readonly keys: readonly { pose: Pose; source: number | null; offset: number; after: GapSettings }[];
}

export function copyKeys(document: Document, ids: readonly string[]): Copied {
  const keys = document.keys.filter((key) => ids.includes(key.id));
  const first = keys[0]?.frame ?? 0;
  return {
    stride: document.stride,
    keys: keys.map(({ pose, source, frame, after }) => ({
      pose,
      source,
      offset: frame - first,
      after: { ...after, locked: false },
    })),
  };
}

/** Pastes copied keys, starting at a frame. Keys that are already there get the copied pose. */
export function pasteKeys(document: Document, copied: Copied, frame: number): Document {
  if (copied.stride !== document.stride) return document;
  return copied.keys.reduce((made, { pose, source, offset, after }) => {
    const next = addKey(made, frame + offset, pose, source);
    const added = keyAtFrame(next, frame + offset);
    const isNew = added !== null && keyAtFrame(made, frame + offset) === null;
    return isNew && added ? setGap(next, added.id, after) : next;
  }, document);
}

export function rename(document: Document, name: string): Document {
  const trimmed = name.trim().slice(0, 120);
  return trimmed ? { ...document, name: trimmed } : document;
}

function unlocked(key: Key): Key {
  return key.after.locked || key.kept ? { ...key, after: { ...key.after, locked: false }, kept: null } : key;
}

/** A key whose gap may have changed its length. If it did, the gap is unlocked, its speed is unset, and the times of its
 * path are scaled. */
function withLength(document: Document, keys: readonly Key[], key: Key, index: number): Key {
  const was = document.keys[index + 1]?.frame - document.keys[index].frame;
  const is = keys[index + 1]?.frame - key.frame;
  if (was === is || Number.isNaN(is)) return key;
  const free = unlocked(key);
  const { path } = free.after;
  const paced =
    path.kind === "waypoints" && path.times ? { ...path, times: path.times.map((time) => (time * is) / was) } : path;
  return { ...free, after: { ...free.after, path: paced, speed: null } };
}

/** Sorts the keys. Gaps that can no longer keep the clip's frames get the default method. */
function settled(document: Document, keys: readonly Key[]): Document {
  const ordered = [...keys].sort((a, b) => a.frame - b.frame);
  return {
    ...document,
    keys: ordered.map((key, i) => {
      const next = ordered[i + 1];
      const lost = next !== undefined && key.after.method === "clip" && !isAsInClip(key, next);
      return lost ? { ...key, after: { ...key.after, method: DEFAULT_SETTINGS.method } } : key;
    }),
  };
}
