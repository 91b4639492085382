/**
 * Holds the motion of every gap, and requests what is missing.
 *
 * A gap's candidates depend on its *inputs*: its settings, its two keys, and the known motion before and after them (so
 * that motion continues through a key without a stop). A gap is generated again only if its inputs change. Small changes
 * of the motion before it are ignored, so that an edit does not ripple through a whole clip. Earlier results are kept for
 * a while, so that undo shows them at once.
 */

import type { Document, Gap, Key } from "../document/document";
import { gapOf, gapsOf, LONGEST_GAP } from "../document/document";
import type { CandidateInfo, Candidates, Dropped, GapSettings } from "../protocol";
import type { Pose, Rig } from "../rig";
import { row } from "../rig";
import type { Answer, Query } from "../server/connection";
import type { Arrays } from "../server/messages";
import { alike, between, stretched } from "./poses";

export interface Candidate {
  /** The gap's frames as rows, without the keys. */
  readonly rows: Float32Array;
  readonly info: CandidateInfo | null;
  /** The completed pose of the right key, if only some joints of it were given. */
  readonly target: Pose | null;
}

export interface Result {
  readonly candidates: readonly Candidate[];
  /** Incomplete: generated live during a drag, or read from a project file. */
  readonly partial: boolean;
  readonly seconds: number;
}

export type GapState = "clip" | "locked" | "empty" | "ready" | "waiting" | "working" | "failed";

interface Inputs {
  readonly signature: string;
  readonly before: Float32Array;
  readonly after: Float32Array;
}

interface Entry {
  inputs: Inputs | null;
  result: Result | null;
  /** The request in progress. live: for one candidate, during a drag. */
  asking: { inputs: Inputs; live: boolean } | null;
  failure: { inputs: Inputs; reason: string } | null;
  /** The rows last shown, stretched to a length; a cache. */
  fitted: { rows: Float32Array; count: number; made: Float32Array } | null;
}

export type Ask = (query: Query & { type: "generate" }, arrays: Arrays) => Promise<Answer<Candidates | Dropped>>;

/** Context frames of a model at 30 Hz (CONTEXT in runtime/resampling.py). */
const CONTEXT = 10;
const MODEL_RATE = 30;
/** Number of earlier results kept for undo. */
const REMEMBERED = 200;

export class Generator {
  private entries = new Map<string, Entry>();
  private remembered = new Map<string, { inputs: Inputs; result: Result }>();
  private signatures = new WeakMap<Gap, string>();
  private poseIds = new WeakMap<Pose, number>();
  private nextPose = 1;
  private document: Document | null = null;
  private rig: Rig | null = null;

  constructor(
    private readonly ask: Ask,
    /** Called when an answer has changed the shown motion or a state. */
    private readonly changed: () => void,
  ) {}

  /** Starts over with another document. `shown`: the frames that gaps showed when the project was saved. */
  reset(document: Document, rig: Rig, shown: ReadonlyMap<string, Float32Array> = new Map()): void {
    this.entries.clear();
    this.remembered.clear();
    this.document = document;
    this.rig = rig;
    for (const gap of gapsOf(document)) {
      const rows = shown.get(gap.id);
      if (!rows || rows.length !== gap.frames * rig.stride || !isGenerated(gap)) continue;
      const result = { candidates: [{ rows, info: null, target: null }], partial: true, seconds: 0 };
      this.entries.set(gap.id, { ...this.entry(gap.id), inputs: this.inputs(gap), result });
    }
  }

  /** Requests what each gap is missing; if `live`, one candidate for each changed gap. */
  sync(document: Document, rig: Rig, live = false): void {
    this.document = document;
    this.rig = rig;
    let unsettled = false; // whether the motion before the next gap is not generated yet
    for (const gap of gapsOf(document)) {
      if (!isGenerated(gap)) {
        unsettled = false;
        continue;
      }
      const entry = this.entry(gap.id);
      if (live && entry.result && entry.inputs?.signature === this.signature(gap)) continue;
      const inputs = this.inputs(gap);
      if (this.has(entry, inputs)) continue;
      const before = this.remembered.get(inputs.signature);
      if (before && same(before.inputs, inputs)) {
        Object.assign(entry, { inputs: before.inputs, result: before.result, failure: null });
        continue;
      }
      if (!unsettled || live) this.request(gap, inputs, live);
      unsettled = true;
    }
  }

  /** Whether every gap is generated, or has failed. */
  get settled(): boolean {
    const gaps = this.document ? gapsOf(this.document) : [];
    return gaps.every((gap) => !["waiting", "working"].includes(this.state(gap)));
  }

  /** Failed gaps are requested again at the next `sync`, for example after reconnecting. */
  retry(): void {
    for (const entry of this.entries.values()) entry.failure = null;
  }

  /** Generates a gap's candidates again, or those that a project file did not contain. */
  refresh(id: string): void {
    const gap = this.gap(id);
    if (!gap || !isGenerated(gap)) return;
    const entry = this.entry(id);
    entry.failure = null;
    this.request(gap, this.inputs(gap), false);
  }

  state(gap: Gap): GapState {
    if (gap.settings.method === "clip") return "clip";
    if (gap.settings.locked && gap.left.kept) return "locked";
    if (gap.frames < 1) return "empty";
    const entry = this.entry(gap.id);
    if (entry.asking && !(entry.asking.live && entry.result)) return "working";
    const inputs = entry.inputs;
    if (entry.failure) return "failed";
    if (inputs && entry.result && inputs.signature === this.signature(gap)) return "ready";
    return "waiting";
  }

  failure(id: string): string | null {
    return this.entries.get(id)?.failure?.reason ?? null;
  }

  /** The result of a gap; it may be of earlier inputs while a request is in progress. */
  result(id: string): Result | null {
    return this.entries.get(id)?.result ?? null;
  }

  /** The gap's frames as shown: generated, locked, the clip's own, or interpolated until a result arrives. */
  rows(gap: Gap): Float32Array {
    const { rig } = this;
    const { stride } = this.document!;
    if (!rig || gap.frames < 1) return new Float32Array(0);
    if (gap.settings.method === "clip") {
      const first = (gap.left.source ?? 0) + 1;
      return rig.frames.subarray(first * stride, (first + gap.frames) * stride);
    }
    if (gap.settings.locked && gap.left.kept) return gap.left.kept;
    const entry = this.entry(gap.id);
    const { left, right, frames, settings } = gap;
    if (!entry.result) return between(this.pose(left), right.pose, frames, rig.joints.length);
    const { candidates } = entry.result;
    const { rows } = candidates[Math.min(settings.chosen, candidates.length - 1)];
    if (rows.length === frames * stride) return rows;
    if (entry.fitted?.rows !== rows || entry.fitted.count !== frames) {
      entry.fitted = { rows, count: frames, made: stretched(rows, stride, frames, rig.joints.length) };
    }
    return entry.fitted.made;
  }

  /** The pose of a key as shown: completed, if only some joints of it were given to the gap before it. */
  pose(key: Key): Pose {
    const index = this.document?.keys.indexOf(key) ?? -1;
    const gap = index > 0 ? this.gap(this.document!.keys[index - 1].id) : null;
    if (!gap || !isGenerated(gap) || this.targetJoints(gap) === null) return key.pose;
    const candidates = this.entries.get(gap.id)?.result?.candidates;
    return candidates?.[Math.min(gap.settings.chosen, candidates.length - 1)].target ?? key.pose;
  }

  /** The joints of the target to meet; all of them (null) if the motion after it is fixed. */
  private targetJoints(gap: Gap): string | null {
    const later = this.gap(gap.right.id);
    return later && later.frames > 0 && !isGenerated(later) ? null : gap.settings.target_joints;
  }

  /** Whether nothing has to be requested: the result is up to date, or these inputs have failed before. A result from a
   * project file counts as complete until the user asks for the other candidates. */
  private has(entry: Entry, inputs: Inputs): boolean {
    if (entry.failure && same(entry.failure.inputs, inputs)) return true;
    if (!entry.result || !entry.inputs || !same(entry.inputs, inputs)) return false;
    return !entry.result.partial || entry.result.candidates[0].info === null;
  }

  private request(gap: Gap, inputs: Inputs, live: boolean): void {
    const entry = this.entry(gap.id);
    if (gap.frames > LONGEST_GAP) {
      const reason = `the gap has ${gap.frames} frames, and ${LONGEST_GAP} are the most; set a key in between`;
      entry.failure = { inputs, reason };
      return;
    }
    if (entry.asking?.live) return; // it arrives soon, and the next sync requests the rest
    if (entry.asking && same(entry.asking.inputs, inputs)) return;
    const { stride } = this.document!;
    const asking = { inputs, live };
    entry.asking = asking;
    const { settings } = gap;
    const ends = {
      start: { shape: [inputs.before.length / stride, stride], values: inputs.before },
      target: { shape: [inputs.after.length / stride, stride], values: inputs.after },
    };
    const query: Query & { type: "generate" } = {
      type: "generate",
      gap: gap.id,
      rig: this.rig!.id,
      frames: gap.frames,
      settings: { ...settings, target_joints: this.targetJoints(gap) },
      live,
    };
    this.ask(query, ends)
      .then(({ header, arrays }) => {
        if (header.type === "dropped") return;
        const size = gap.frames * stride;
        const all = arrays.frames.values;
        const candidates = header.infos.map((info, i) => ({
          rows: all.slice(i * size, (i + 1) * size),
          info,
          target: arrays.targets ? row(arrays.targets.values, stride, i).slice() : null,
        }));
        const result = { candidates, partial: live, seconds: header.seconds };
        if (!live) this.remember(inputs, result);
        if (entry.asking !== asking) return; // a newer request is in progress
        Object.assign(entry, { inputs, result, failure: null });
      })
      .catch((error: Error) => {
        if (entry.asking === asking) entry.failure = { inputs, reason: error.message };
      })
      .finally(() => {
        if (entry.asking === asking) entry.asking = null;
        this.changed();
      });
  }

  private remember(inputs: Inputs, result: Result): void {
    this.remembered.delete(inputs.signature);
    this.remembered.set(inputs.signature, { inputs, result });
    if (this.remembered.size > REMEMBERED) this.remembered.delete(this.remembered.keys().next().value as string);
  }

  private inputs(gap: Gap): Inputs {
    const { stride, keys } = this.document!;
    const reach = Math.ceil(((CONTEXT - 1) * this.rig!.rate) / MODEL_RATE) + 1;
    const earlier = keys[gap.index - 1] && this.gap(keys[gap.index - 1].id);
    const later = this.gap(gap.right.id);
    const known = earlier ? this.rows(earlier) : new Float32Array(0);
    const ahead = later && !isGenerated(later) ? this.rows(later) : new Float32Array(0);
    const before = known.subarray(Math.max(0, known.length - (reach - 1) * stride));
    const after = ahead.subarray(0, (reach - 1) * stride);
    return {
      signature: this.signature(gap),
      before: joined(before, this.pose(gap.left)),
      after: joined(gap.right.pose, after),
    };
  }

  /** A gap's inputs, except the motion before it, as a string. */
  private signature(gap: Gap): string {
    return `${this.poseId(this.pose(gap.left))} ${this.ownSignature(gap)}`;
  }

  private ownSignature(gap: Gap): string {
    let signature = this.signatures.get(gap);
    if (signature === undefined) {
      const { chosen: _chosen, locked: _locked, speed: _speed, target_joints: _joints, ...settings } =
        gap.settings satisfies GapSettings;
      // The clip's own motion after a gap is one of its inputs; a locked gap after it was generated from it.
      const later = this.gap(gap.right.id);
      const runsInto = later?.settings.method === "clip" ? later.left.source : null;
      const target = [this.poseId(gap.right.pose), this.targetJoints(gap)];
      signature = JSON.stringify([settings, gap.frames, ...target, runsInto]);
      this.signatures.set(gap, signature);
    }
    return signature;
  }

  private poseId(pose: Pose): number {
    const id = this.poseIds.get(pose) ?? this.nextPose++;
    this.poseIds.set(pose, id);
    return id;
  }

  private gap(id: string): Gap | null {
    return gapOf(this.document!, id);
  }

  private entry(id: string): Entry {
    let entry = this.entries.get(id);
    if (!entry) {
      entry = { inputs: null, result: null, asking: null, failure: null, fitted: null };
      this.entries.set(id, entry);
    }
    return entry;
  }
}

/** Whether the frames of a gap are generated, neither locked nor the clip's own. */
function isGenerated(gap: Gap): boolean {
  return gap.frames > 0 && gap.settings.method !== "clip" && !(gap.settings.locked && gap.left.kept !== null);
}

function same(a: Inputs, b: Inputs): boolean {
  return a.signature === b.signature && alike(a.before, b.before);
}

function joined(a: Float32Array, b: Float32Array): Float32Array {
  const made = new Float32Array(a.length + b.length);
  made.set(a);
  made.set(b, a.length);
  return made;
}
