/** Converts documents to project files (`.interpose`, see protocol.py) and back. */

import type { Project, ProjectKey } from "../protocol";
import type { Rig } from "../rig";
import { row } from "../rig";
import type { Document, Key } from "./document";

/** `motion` returns the frames that a gap shows, which are stored so that the project opens as it was. */
export function toProject(document: Document, motion: (key: Key) => Float32Array | null): Project {
  return {
    format: 1,
    name: document.name,
    source: document.source,
    keys: document.keys.map((key): ProjectKey => {
      // The completed pose of a partial target is not stored, so such a gap is generated again.
      const isStored = key.after.method !== "clip" && key.after.target_joints === null;
      const shown = key.kept ?? (isStored ? motion(key) : null);
      return {
        id: key.id,
        frame: key.frame,
        pose: key.source === null ? encode(key.pose) : null,
        source: key.source,
        after: key.after,
        motion: shown && shown.length > 0 ? encode(shown) : null,
      };
    }),
  };
}

/** The document of a checked project, and the frames that its gaps showed, by their left keys. */
export function fromProject(project: Project, rig: Rig): { document: Document; shown: Map<string, Float32Array> } {
  const shown = new Map<string, Float32Array>();
  const keys = project.keys.map((key): Key => {
    const motion = key.motion === null ? null : decode(key.motion);
    if (motion && !key.after.locked) shown.set(key.id, motion);
    const pose = key.pose === null ? row(rig.frames, rig.stride, key.source ?? 0).slice() : decode(key.pose);
    return {
      id: key.id,
      frame: key.frame,
      pose,
      source: key.source,
      after: { ...key.after, locked: key.after.locked && motion !== null },
      kept: key.after.locked ? motion : null,
    };
  });
  const { name, source } = project;
  return { document: { name, source, rate: rig.rate, stride: rig.stride, keys }, shown };
}

export function encode(values: Float32Array): string {
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  let text = "";
  for (let at = 0; at < bytes.length; at += 0x8000) text += String.fromCharCode(...bytes.subarray(at, at + 0x8000));
  return btoa(text);
}

export function decode(text: string): Float32Array {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  if (bytes.length % 4 !== 0) throw new Error(`${bytes.length} bytes are not 32-bit floats`);
  return new Float32Array(bytes.buffer);
}
