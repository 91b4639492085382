/**
 * What every gap shows, and asking for what it lacks.
 *
 * A gap's candidates follow from its *want*: what is asked of it, its two keys, and the motion that is known before and
 * after them (so that motion runs through a key without a stop). A gap whose want has not changed is left alone; motion
 * before it that changed by next to nothing counts as unchanged, so that an edit does not ripple through a whole clip.
 * Earlier results are kept for some time, so that undo shows them at once.
 */

import type { Document, Gap } from "../document/document";
import { gapOf, gapsOf, LONGEST_GAP } from "../document/document";
import type { CandidateInfo, Candidates, Dropped, GapSettings, Generate } from "../protocol";
import type { Pose, Rig } from "../rig";
import type { Answer, Question } from "../server/connection";
import type { Arrays } from "../wire";
import { alike, between, stretched } from "./poses";

export interface Candidate {
  /** The gap's frames as rows, without the keys. */
  readonly rows: Float32Array;
  readonly info: CandidateInfo | null;
}

export interface Result {
  readonly candidates: readonly Candidate[];
  /** Not all that was asked for: made while something was dragged, or read from a project file. */
  readonly partial: boolean;
  readonly seconds: number;
}

export type GapState = "clip" | "locked" | "empty" | "ready" | "waiting" | "working" | "failed";

interface Want {
  readonly signature: string;
  readonly before: Float32Array;
  readonly after: Float32Array;
}

interface Entry {
  want: Want | null;
  result: Result | null;
  /** What is being asked for, and whether for one live candidate alone. */
  asking: { want: Want; live: boolean } | null;
  failure: { want: Want; reason: string } | null;
  /** The rows last shown, stretched to a length, so that they are not made again for every picture. */
  fitted: { rows: Float32Array; count: number; made: Float32Array } | null;
}

export type Ask = (question: Question & { type: "generate" }, arrays: Arrays) => Promise<Answer<Candidates | Dropped>>;

/** Frames at 30 Hz that a model looks back (runtime/resampling.py, CONTEXT). */
const CONTEXT = 10;
const MODEL_RATE = 30;
/** Results of gaps as they were before, kept for undo. */
const REMEMBERED = 200;

export class Generator {
  private entries = new Map<string, Entry>();
  private remembered = new Map<string, { want: Want; result: Result }>();
  private signatures = new WeakMap<Gap, string>();
  private poseIds = new WeakMap<Pose, number>();
  private nextPose = 1;
  private document: Document | null = null;
  private rig: Rig | null = null;

  constructor(
    private readonly ask: Ask,
    /** Called after an answer changed anything here: what is shown, or a state. */
    private readonly changed: () => void,
  ) {}

  /** Forgets everything, as when another file was opened. `shown`: what gaps showed when the project was saved. */
  reset(document: Document, rig: Rig, shown: ReadonlyMap<string, Float32Array> = new Map()): void {
    this.entries.clear();
    this.remembered.clear();
    this.document = document;
    this.rig = rig;
    for (const gap of gapsOf(document)) {
      const rows = shown.get(gap.id);
      if (!rows || rows.length !== gap.frames * rig.stride || !isGenerated(gap)) continue;
      const result = { candidates: [{ rows, info: null }], partial: true, seconds: 0 };
      this.entries.set(gap.id, { ...this.entry(gap.id), want: this.want(gap), result });
    }
  }

  /** Looks at every gap and asks for what it lacks; while `live`, for one candidate, where something changed. */
  sync(document: Document, rig: Rig, live = false): void {
    this.document = document;
    this.rig = rig;
    let unsettled = false; // whether the motion that the next gap goes on from is still to come
    for (const gap of gapsOf(document)) {
      if (!isGenerated(gap)) {
        unsettled = false;
        continue;
      }
      const entry = this.entry(gap.id);
      if (live && entry.result && entry.want?.signature === this.signature(gap)) continue;
      const want = this.want(gap);
      if (this.has(entry, want)) continue;
      const before = this.remembered.get(want.signature);
      if (before && same(before.want, want)) {
        Object.assign(entry, { want: before.want, result: before.result, failure: null });
        continue;
      }
      if (!unsettled || live) this.request(gap, want, live);
      unsettled = true;
    }
  }

  /** Whether everything is shown as it was asked for, or is known to have failed. */
  get settled(): boolean {
    const gaps = this.document ? gapsOf(this.document) : [];
    return gaps.every((gap) => !["waiting", "working"].includes(this.state(gap)));
  }

  /** What has failed is tried again at the next `sync`, as after the connection came back. */
  retry(): void {
    for (const entry of this.entries.values()) entry.failure = null;
  }

  /** Makes a gap's candidates again, or those that a project file did not hold. */
  refresh(id: string): void {
    const gap = this.gap(id);
    if (!gap || !isGenerated(gap)) return;
    const entry = this.entry(id);
    entry.failure = null;
    this.request(gap, this.want(gap), false);
  }

  state(gap: Gap): GapState {
    if (gap.settings.method === "clip") return "clip";
    if (gap.settings.locked && gap.left.kept) return "locked";
    if (gap.frames < 1) return "empty";
    const entry = this.entry(gap.id);
    if (entry.asking && !(entry.asking.live && entry.result)) return "working";
    const want = entry.want;
    if (entry.failure) return "failed";
    if (want && entry.result && want.signature === this.signature(gap)) return "ready";
    return "waiting";
  }

  failure(id: string): string | null {
    return this.entries.get(id)?.failure?.reason ?? null;
  }

  /** What was made for a gap; it may be of an earlier want while a new one is being served. */
  result(id: string): Result | null {
    return this.entries.get(id)?.result ?? null;
  }

  /** The gap's frames as they are shown: generated, kept, the clip's own, or a straight blend until there is more. */
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
    if (!entry.result) return between(left.pose, right.pose, frames, rig.joints.length);
    const { candidates } = entry.result;
    const { rows } = candidates[Math.min(settings.chosen, candidates.length - 1)];
    if (rows.length === frames * stride) return rows;
    if (entry.fitted?.rows !== rows || entry.fitted.count !== frames) {
      entry.fitted = { rows, count: frames, made: stretched(rows, stride, frames, rig.joints.length) };
    }
    return entry.fitted.made;
  }

  /** Whether nothing has to be asked: what is shown is what is wanted, or that has failed before. What a project file
   * held counts as whole until somebody asks for the other candidates. */
  private has(entry: Entry, want: Want): boolean {
    if (entry.failure && same(entry.failure.want, want)) return true;
    if (!entry.result || !entry.want || !same(entry.want, want)) return false;
    return !entry.result.partial || entry.result.candidates[0].info === null;
  }

  private request(gap: Gap, want: Want, live: boolean): void {
    const entry = this.entry(gap.id);
    if (gap.frames > LONGEST_GAP) {
      const reason = `the gap has ${gap.frames} frames, and ${LONGEST_GAP} are the most; set a key in between`;
      entry.failure = { want, reason };
      return;
    }
    if (entry.asking?.live) return; // it comes soon; then the next sync asks for the newest, or for the whole
    if (entry.asking && same(entry.asking.want, want)) return;
    const { stride } = this.document!;
    const asking = { want, live };
    entry.asking = asking;
    const { settings } = gap;
    const ends = {
      start: { shape: [want.before.length / stride, stride], values: want.before },
      target: { shape: [want.after.length / stride, stride], values: want.after },
    };
    const question: Question & { type: "generate" } = {
      type: "generate",
      gap: gap.id,
      rig: this.rig!.id,
      frames: gap.frames,
      method: settings.method as Generate["method"],
      style: settings.style,
      blend: settings.blend,
      path: settings.path,
      variants: live ? 1 : settings.variants,
      seed: settings.seed,
      live,
    };
    this.ask(question, ends)
      .then(({ header, arrays }) => {
        if (header.type === "dropped") return;
        const size = gap.frames * stride;
        const all = arrays.frames.values;
        const candidates = header.infos.map((info, i) => ({ rows: all.slice(i * size, (i + 1) * size), info }));
        const result = { candidates, partial: live, seconds: header.seconds };
        if (!live) this.remember(want, result);
        if (entry.asking !== asking) return; // a newer one is on its way
        Object.assign(entry, { want, result, failure: null });
      })
      .catch((error: Error) => {
        if (entry.asking === asking) entry.failure = { want, reason: error.message };
      })
      .finally(() => {
        if (entry.asking === asking) entry.asking = null;
        this.changed();
      });
  }

  private remember(want: Want, result: Result): void {
    this.remembered.delete(want.signature);
    this.remembered.set(want.signature, { want, result });
    if (this.remembered.size > REMEMBERED) this.remembered.delete(this.remembered.keys().next().value as string);
  }

  private want(gap: Gap): Want {
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
      before: joined(before, gap.left.pose),
      after: joined(gap.right.pose, after),
    };
  }

  /** All that a gap's candidates follow from but the motion before it, as one word. */
  private signature(gap: Gap): string {
    let signature = this.signatures.get(gap);
    if (signature === undefined) {
      const { chosen: _chosen, locked: _locked, speed: _speed, ...asked } = gap.settings satisfies GapSettings;
      // Where the clip's own motion follows, the gap is made to run into it; what is locked after it followed it anyway.
      const later = this.gap(gap.right.id);
      const runsInto = later?.settings.method === "clip" ? later.left.source : null;
      const poses = [this.poseId(gap.left.pose), this.poseId(gap.right.pose)];
      signature = JSON.stringify([asked, gap.frames, ...poses, runsInto]);
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
      entry = { want: null, result: null, asking: null, failure: null, fitted: null };
      this.entries.set(id, entry);
    }
    return entry;
  }
}

/** Whether a gap shows what is made for it, rather than what is known. */
function isGenerated(gap: Gap): boolean {
  return gap.frames > 0 && gap.settings.method !== "clip" && !(gap.settings.locked && gap.left.kept !== null);
}

function same(a: Want, b: Want): boolean {
  return a.signature === b.signature && alike(a.before, b.before);
}

function joined(a: Float32Array, b: Float32Array): Float32Array {
  const made = new Float32Array(a.length + b.length);
  made.set(a);
  made.set(b, a.length);
  return made;
}
