/**
 * The application's state: the document with its history, what is selected, the playhead, and what was generated.
 *
 * Panels read it and call its methods; every change of the document goes through `apply`, so that it can be undone.
 */

import { Answers } from "./answers.svelte";
import { Clipboard } from "./clipboard.svelte";
import * as commands from "./document/commands";
import type { Document, Gap, Key } from "./document/document";
import { firstFrame, gapAtFrame, gapOf, gapsOf, keyAtFrame, keyOf, lastFrame } from "./document/document";
import type { History } from "./document/history";
import { begin, change, redo, seal, undo } from "./document/history";
import type { GapState, Result } from "./engine/generator";
import { Generator } from "./engine/generator";
import { poseBetween, rowsBetween, sourceAt } from "./engine/motion";
import { Notices } from "./notices.svelte";
import type { GapSettings, MethodInfo } from "./protocol";
import { groundOf } from "./pose/place";
import type { Pose, Rig } from "./rig";
import { openRig } from "./server/api";
import type { State as ConnectionState } from "./server/connection";
import { Connection, Unanswered } from "./server/connection";
import type { LineView, Phase, Tool, View } from "./viewport/types";

/** How long after a change the whole of what it asks for is asked, where it is not sealed before. */
const SETTLE_MS = 120;

export type Selection = { readonly keys: readonly string[]; readonly gap: string | null };

export class Studio {
  /** The opened rig and the document on it; null until the first is there. */
  rig = $state.raw<Rig | null>(null);
  private history = $state.raw<History | null>(null);
  /** What was written to a file last, to know whether there is something new. */
  written = $state.raw<Document | null>(null);

  methods = $state.raw<readonly MethodInfo[]>([]);
  connection = $state<ConnectionState>("connecting");
  readonly notices = new Notices();
  readonly answers = new Answers(this);
  readonly clipboard = new Clipboard(this);

  /** The playhead in frames; whole unless playing. */
  time = $state(0);
  playing = $state(false);
  pace = $state(1);
  /** Playing goes round the selected gap, if there is one, or the whole. */
  looping = $state(true);

  selection = $state.raw<Selection>({ keys: [], gap: null });
  tool = $state<Tool>("select");
  joint = $state<number | null>(null);
  spread = $state<View["spread"]>("overlaid");
  show = $state<View["show"]>({ trails: true, contacts: true, ghosts: true, others: true });
  follow = $state(true);
  theme = $state<View["theme"]>("light");

  /** Counts what the generator told; whoever shows results reads it. */
  private revision = $state(0);
  private readonly socket: Connection;
  private readonly generator: Generator;
  private settling: ReturnType<typeof setTimeout> | undefined;

  constructor(url: string) {
    this.generator = new Generator(
      (question, arrays) => this.ask(question, arrays),
      () => this.sync(),
    );
    this.socket = new Connection(url, {
      state: (state, reason) => this.connected(state, reason),
      welcome: ({ methods }) => (this.methods = methods),
    });
  }

  // ---- the document

  get document(): Document | null {
    return this.history?.present.document ?? null;
  }

  get changed(): boolean {
    return this.document !== null && this.document !== this.written;
  }

  get undoLabel(): string | null {
    return this.history?.past.length ? this.history.present.label : null;
  }

  get redoLabel(): string | null {
    return this.history?.future[0]?.label ?? null;
  }

  /** Shows another document; its history begins here. */
  open(document: Document, rig: Rig, shown: ReadonlyMap<string, Float32Array> = new Map()): void {
    this.rig = rig;
    this.history = begin(document, "Open");
    this.written = document;
    this.selection = { keys: [], gap: null };
    this.answers.forget();
    this.tool = "select";
    this.joint = null;
    this.time = firstFrame(document);
    this.generator.reset(document, rig, shown);
    this.sync();
    void this.answers.loadLibrary(rig);
  }

  /** Changes the document. Changes with the same `merge` are one step of the history until `release`; meanwhile gaps are
   * generated live. */
  apply(next: Document, label: string, merge: string | null = null): void {
    if (!this.history || next === this.history.present.document) return;
    this.history = change(this.history, next, label, merge);
    this.keepSelection();
    clearTimeout(this.settling);
    this.settling = undefined;
    if (merge === null) this.sync();
    else {
      this.settling = setTimeout(() => {
        this.settling = undefined;
        this.sync();
      }, SETTLE_MS);
      this.sync();
    }
  }

  /** What was being dragged was let go. */
  release(): void {
    if (this.history) this.history = seal(this.history);
    clearTimeout(this.settling);
    this.settling = undefined;
    this.sync();
  }

  undo(): void {
    if (this.history) this.history = undo(seal(this.history));
    this.keepSelection();
    this.sync();
  }

  redo(): void {
    if (this.history) this.history = redo(this.history);
    this.keepSelection();
    this.sync();
  }

  rename(name: string): void {
    if (this.document) this.apply(commands.rename(this.document, name), "Rename");
  }

  // ---- selection and playhead

  get frame(): number {
    return Math.round(this.time);
  }

  get selectedGap(): Gap | null {
    return this.document && gapOf(this.document, this.selection.gap);
  }

  get selectedKeys(): readonly Key[] {
    return this.document?.keys.filter((key) => this.selection.keys.includes(key.id)) ?? [];
  }

  /** The one selected key, or null. */
  get selectedKey(): Key | null {
    return this.selectedKeys.length === 1 ? this.selectedKeys[0] : null;
  }

  /** The key at the playhead. */
  get keyHere(): Key | null {
    return this.document && keyAtFrame(this.document, this.frame);
  }

  selectKey(id: string, how: "only" | "toggle" | "range" = "only"): void {
    const { document } = this;
    const key = document && keyOf(document, id);
    if (!key) return;
    let keys = [id];
    if (how === "toggle") {
      const had = this.selection.keys;
      keys = had.includes(id) ? had.filter((each) => each !== id) : [...had, id];
    } else if (how === "range" && this.selectedKeys.length > 0) {
      const frames = [...this.selectedKeys, key].map((each) => each.frame);
      keys = document.keys
        .filter((each) => each.frame >= Math.min(...frames) && each.frame <= Math.max(...frames))
        .map((each) => each.id);
    }
    this.selection = { keys, gap: null };
    if (how === "only") this.goTo(key.frame);
  }

  selectGap(id: string | null): void {
    if (this.selection.gap === id && this.selection.keys.length === 0) return;
    this.selection = { keys: [], gap: id };
    this.answers.forget();
    const gap = this.selectedGap;
    if (!gap || gap.settings.method === "clip") return;
    const result = this.generator.result(gap.id);
    if (result?.partial && !gap.settings.locked) this.retry(gap.id);
    if (gap.settings.method !== "interp") void this.answers.suggest(gap);
  }

  goTo(frame: number): void {
    this.time = Math.max(0, Math.round(frame));
  }

  /** Lets the playhead run on by some seconds of wall time. */
  tick(seconds: number): void {
    const { document } = this;
    if (!this.playing || !document) return;
    const gap = this.looping ? this.selectedGap : null;
    const first = gap ? gap.left.frame : firstFrame(document);
    const last = gap ? gap.right.frame : lastFrame(document);
    let time = this.time + seconds * document.rate * this.pace;
    if (time > last || time < first) {
      if (!this.looping && time > last) {
        this.playing = false;
        time = last;
      } else time = last > first ? first + ((((time - first) % (last - first)) + (last - first)) % (last - first)) : first;
    }
    this.time = time;
  }

  togglePlaying(): void {
    if (!this.document) return;
    this.playing = !this.playing;
    if (!this.playing) this.goTo(this.time);
    else if (!this.looping && this.time >= lastFrame(this.document)) this.time = firstFrame(this.document);
  }

  goToNeighbour(direction: -1 | 1): void {
    const keys = this.document?.keys ?? [];
    const next = direction > 0 ? keys.find((key) => key.frame > this.frame) : keys.findLast((key) => key.frame < this.frame);
    if (next) this.goTo(next.frame);
  }

  // ---- keys

  /** A key of the pose at the playhead, as it is. */
  addKeyHere(): void {
    const { document, pose } = this;
    if (!document || !pose || this.keyHere) return;
    this.putKey(commands.addKey(document, this.frame, pose, sourceAt(document, this.frame)), this.frame, "Add key");
  }

  /** A given pose as the key at a frame. */
  putPose(pose: Pose, frame: number, label: string, source: number | null = null): void {
    if (this.document) this.putKey(commands.addKey(this.document, frame, pose, source), frame, label);
  }

  /** The selected keys, or else the one at the playhead. */
  get chosenKeys(): readonly string[] {
    return this.selection.keys.length ? this.selection.keys : this.keyHere ? [this.keyHere.id] : [];
  }

  deleteSelected(): void {
    const keys = this.chosenKeys;
    if (!this.document || keys.length === 0) return;
    if (keys.length >= this.document.keys.length) this.notices.say("One key at least has to stay.");
    else this.apply(commands.deleteKeys(this.document, keys), keys.length > 1 ? "Delete keys" : "Delete key");
  }

  moveKeys(ids: readonly string[], by: number, merge: string): void {
    if (this.document) this.apply(commands.moveKeys(this.document, ids, by), "Move key", merge);
  }

  /** The pose at the playhead as a gizmo changes it; where there is no key, this makes one. */
  changePose(pose: Pose, phase: Phase): void {
    const { document } = this;
    if (!document) return;
    this.playing = false;
    const key = this.keyHere;
    const next = key
      ? commands.setPose(document, key.id, pose)
      : commands.addKey(document, this.frame, pose, null);
    this.apply(next, "Change pose", `pose:${this.frame}`);
    if (phase === "end") this.release();
  }

  // ---- gaps

  gaps(): readonly Gap[] {
    return this.document ? gapsOf(this.document) : [];
  }

  setGap(id: string, changes: Partial<GapSettings>, label: string, merge: string | null = null): void {
    if (this.document) this.apply(commands.setGap(this.document, id, changes), label, merge);
  }

  setFrames(id: string, frames: number, speed: GapSettings["speed"] = null, merge: string | null = null): void {
    if (this.document) this.apply(commands.setFrames(this.document, id, frames, speed), "Change duration", merge);
  }

  choose(id: string, candidate: number): void {
    this.setGap(id, { chosen: candidate }, "Choose a candidate");
  }

  toggleLock(id: string): void {
    const gap = this.document && gapOf(this.document, id);
    if (!gap || !this.document) return;
    if (gap.settings.locked) this.setGap(id, { locked: false }, "Unlock");
    else if (this.state(gap) === "ready") this.apply(commands.lockGap(this.document, id, this.rows(gap)), "Lock");
  }

  /** Other candidates: the next seed. */
  reroll(id: string): void {
    const gap = this.document && gapOf(this.document, id);
    if (gap) this.setGap(id, { seed: (gap.settings.seed + 1) % 2 ** 31 }, "Other candidates");
  }

  retry(id: string): void {
    this.generator.refresh(id);
    this.revision++;
  }

  pickWay(index: number): void {
    const gap = this.selectedGap;
    const way = this.answers.ways?.found[index];
    if (gap && way) this.setGap(gap.id, { path: way.line }, "Choose a path");
  }

  /** The drawn path's control points of the selected gap. */
  changeLine(points: readonly (readonly [number, number])[], phase: Phase): void {
    const gap = this.selectedGap;
    if (!gap) return;
    const line: GapSettings["path"] =
      points.length === 0
        ? { kind: "auto" }
        : { kind: "line", points: points.map(([x, z]) => [x, z]), times: null, facing: null, drawn: true };
    this.setGap(gap.id, { path: line }, "Draw a path", `line:${gap.id}`);
    if (phase === "end") this.release();
  }

  /** Where on the ground the selected gap begins and ends. */
  get ends(): { readonly from: [number, number]; readonly to: [number, number] } | null {
    const gap = this.selectedGap;
    const { rig } = this;
    return gap && rig && { from: groundOf(rig, gap.left.pose), to: groundOf(rig, gap.right.pose) };
  }

  get line(): LineView | null {
    const gap = this.selectedGap;
    const path = gap?.settings.path;
    if (!gap || path?.kind !== "line" || !path.drawn) return null;
    return { ...(this.ends as { from: [number, number]; to: [number, number] }), points: path.points };
  }

  // ---- what was generated

  state(gap: Gap): GapState {
    void this.revision;
    return this.generator.state(gap);
  }

  failure(id: string): string | null {
    void this.revision;
    return this.generator.failure(id);
  }

  result(id: string): Result | null {
    void this.revision;
    return this.generator.result(id);
  }

  rows(gap: Gap): Float32Array {
    void this.revision;
    return this.generator.rows(gap);
  }

  /** Whether every gap shows what was asked for, or is known to have failed. */
  get settled(): boolean {
    void this.revision;
    return this.generator.settled;
  }

  /** The pose at the playhead. */
  get pose(): Pose | null {
    const { document, rig } = this;
    return document && rig && poseBetween(document, (gap) => this.rows(gap), this.time, rig.joints.length);
  }

  rowsBetween(first: number, last: number): Float32Array {
    return rowsBetween(this.document as Document, (gap) => this.rows(gap), first, last);
  }

  gapAt(frame: number): Gap | null {
    return this.document && gapAtFrame(this.document, frame);
  }

  /** Asks the server; where it does not know the rig any more, that is sent again first. */
  readonly ask: Connection["ask"] = async (question, arrays = {}) => {
    try {
      return await this.socket.ask(question, arrays);
    } catch (error) {
      const source = this.document?.source;
      if (!(error instanceof Unanswered && error.again && source)) throw error;
      await openRig(source.name, source.text);
      return this.socket.ask(question, arrays);
    }
  };

  close(): void {
    clearTimeout(this.settling);
    this.socket.close();
  }

  /** Shows a document whose key at a frame is new, and selects that key. */
  putKey(next: Document, frame: number, label: string): void {
    this.apply(next, label);
    const key = keyAtFrame(next, frame);
    if (key) this.selectKey(key.id);
  }

  private sync(): void {
    if (!this.document || !this.rig) return;
    this.generator.sync(this.document, this.rig, this.settling !== undefined);
    this.revision++;
  }

  private keepSelection(): void {
    const { keys, gap } = this.selection;
    const known = (id: string) => this.document !== null && keyOf(this.document, id) !== null;
    const kept = keys.filter(known);
    const keptGap = gap && this.document && gapOf(this.document, gap) ? gap : null;
    if (kept.length !== keys.length || keptGap !== gap) this.selection = { keys: kept, gap: keptGap };
  }

  private connected(state: ConnectionState, reason: string): void {
    const was = this.connection;
    this.connection = state;
    if (state === "lost" && was === "open") this.notices.say(`${reason}. Trying again …`, "warning");
    if (state !== "open") return;
    this.generator?.retry();
    this.sync();
  }
}
