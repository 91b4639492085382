/**
 * The application's state: the document with its history, the selection, the playhead, and the generated motion.
 *
 * Panels read it and call its methods. Every change of the document goes through `apply`, so that it can be undone.
 */

import { Answers } from "./server/answers.svelte";
import { Clipboard } from "./app/clipboard.svelte";
import { Playback } from "./app/playback.svelte";
import * as commands from "./document/commands";
import type { Document, Gap, Key } from "./document/document";
import { firstFrame, gapAtFrame, gapOf, gapsOf, keyAtFrame, keyOf } from "./document/document";
import type { History } from "./document/history";
import { begin, change, redo, seal, undo } from "./document/history";
import type { GapState, Result } from "./engine/generator";
import { Generator } from "./engine/generator";
import type { Shown } from "./engine/motion";
import { poseBetween, rowsBetween, sourceAt } from "./engine/motion";
import { infoOf } from "./document/methods";
import { Notices } from "./app/notices.svelte";
import type { GapSettings, Welcome } from "./protocol";
import type { Pose, Rig } from "./rig";
import { openRig } from "./server/api";
import type { State as ConnectionState } from "./server/connection";
import { Connection, Unanswered } from "./server/connection";
import type { Phase, Tool, View } from "./viewport/types";

/** Delay after a live change before all candidates are requested. */
const SETTLE_MS = 120;

type Selection = { readonly keys: readonly string[]; readonly gap: string | null };

export class Studio {
  /** The opened rig; null until the first file is open. */
  rig = $state.raw<Rig | null>(null);
  private history = $state.raw<History | null>(null);
  /** The document as last saved to a file. */
  written = $state.raw<Document | null>(null);

  /** The methods that the server offers, with their models. */
  welcome = $state.raw<Pick<Welcome, "methods" | "gallery" | "target_parts">>({ methods: [], gallery: null, target_parts: [] });
  connection = $state<ConnectionState>("connecting");
  readonly notices = new Notices();
  readonly answers = new Answers(this);
  readonly clipboard = new Clipboard(this);
  readonly playback = new Playback(this);

  selection = $state.raw<Selection>({ keys: [], gap: null });
  tool = $state<Tool>("select");
  joint = $state<number | null>(null);
  spread = $state<View["spread"]>("overlaid");
  show = $state<View["show"]>({ trails: true, contacts: true, ghosts: true, others: true });
  follow = $state(true);
  theme = $state<View["theme"]>("light");

  /** Counts changes of the generator, so that views of its results update. */
  private revision = $state(0);
  private readonly socket: Connection;
  private readonly generator: Generator;
  private settling: ReturnType<typeof setTimeout> | undefined;

  constructor(url: string) {
    this.generator = new Generator(
      (query, arrays) => this.ask(query, arrays),
      () => this.sync(),
    );
    this.socket = new Connection(url, {
      state: (state, reason) => this.connected(state, reason),
      welcome: (welcome) => (this.welcome = welcome),
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

  /** Opens a document, with a new history. */
  open(document: Document, rig: Rig, shown: ReadonlyMap<string, Float32Array> = new Map()): void {
    this.rig = rig;
    this.history = begin(document, "Open");
    this.written = document;
    this.selection = { keys: [], gap: null };
    this.answers.forget();
    this.tool = "select";
    this.joint = null;
    this.playback.time = firstFrame(document);
    this.generator.reset(document, rig, shown);
    this.sync();
    void this.answers.loadLibrary(rig);
  }

  /** Changes the document. Changes with the same `merge` are one step of the history until `release`; until then, gaps are
   * generated live. */
  apply(next: Document, label: string, merge: string | null = null): void {
    if (!this.history || next === this.history.present.document) return;
    this.history = change(this.history, next, label, merge);
    this.keepSelection();
    clearTimeout(this.settling);
    this.settling = undefined;
    if (merge !== null) {
      this.settling = setTimeout(() => {
        this.settling = undefined;
        this.sync();
      }, SETTLE_MS);
    }
    this.sync();
  }

  /** Ends a drag. */
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
    return this.document && keyAtFrame(this.document, this.playback.frame);
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
    if (how === "only") this.playback.goTo(key.frame);
  }

  selectGap(id: string | null): void {
    if (this.selection.gap === id && this.selection.keys.length === 0) return;
    this.selection = { keys: [], gap: id };
    this.answers.forget();
    const gap = this.selectedGap;
    if (!gap || gap.settings.method === "clip") return;
    const result = this.generator.result(gap.id);
    if (result?.partial && !gap.settings.locked) this.retry(gap.id);
    if (infoOf(gap.settings, this.welcome.methods)?.paths) void this.answers.suggest(gap);
  }

  // ---- keys

  /** Adds a key with the current pose at the playhead. */
  addKeyHere(): void {
    const { document, pose } = this;
    if (!document || !pose || this.keyHere) return;
    this.putKey(commands.addKey(document, this.playback.frame, pose, sourceAt(document, this.playback.frame)), this.playback.frame, "Add key");
  }

  /** Makes a pose the key at a frame. */
  putPose(pose: Pose, frame: number, label: string, source: number | null = null): void {
    if (this.document) this.putKey(commands.addKey(this.document, frame, pose, source), frame, label);
  }

  /** The selected keys, or the one at the playhead. */
  get chosenKeys(): readonly string[] {
    return this.selection.keys.length ? this.selection.keys : this.keyHere ? [this.keyHere.id] : [];
  }

  deleteSelected(): void {
    const keys = this.chosenKeys;
    if (!this.document || keys.length === 0) return;
    if (keys.length >= this.document.keys.length) this.notices.show("Keep at least one key.");
    else this.apply(commands.deleteKeys(this.document, keys), keys.length > 1 ? "Delete keys" : "Delete key");
  }

  moveKeys(ids: readonly string[], by: number, merge: string): void {
    if (this.document) this.apply(commands.moveKeys(this.document, ids, by), "Move key", merge);
  }

  /** Changes the pose at the playhead by a gizmo; adds a key if there is none. */
  changePose(pose: Pose, phase: Phase): void {
    const { document } = this;
    if (!document) return;
    this.playback.playing = false;
    const key = this.keyHere;
    const next = key
      ? commands.setPose(document, key.id, pose)
      : commands.addKey(document, this.playback.frame, pose, null);
    this.apply(next, "Change pose", `pose:${this.playback.frame}`);
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
    else if (this.state(gap) === "ready") this.apply(commands.lockGap(this.document, id, this.rows(gap), this.poseOf(gap.right)), "Lock");
  }

  /** Generates other candidates, with the next seed. */
  reroll(id: string): void {
    const gap = this.document && gapOf(this.document, id);
    if (gap) this.setGap(id, { seed: (gap.settings.seed + 1) % 2 ** 31 }, "Reroll candidates");
  }

  retry(id: string): void {
    this.generator.refresh(id);
    this.revision++;
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

  /** The pose of a key as shown; completed, if only some joints of it were given. */
  poseOf(key: Key): Pose {
    void this.revision;
    return this.generator.pose(key);
  }

  /** What is shown, for `engine/motion`. */
  readonly shown: Shown = { rows: (gap) => this.rows(gap), pose: (key) => this.poseOf(key) };

  /** Whether every gap is generated, or has failed. */
  get settled(): boolean {
    void this.revision;
    return this.generator.settled;
  }

  /** The pose at the playhead. */
  get pose(): Pose | null {
    const { document, rig } = this;
    return document && rig && poseBetween(document, this.shown, this.playback.time, rig.joints.length);
  }

  rowsBetween(first: number, last: number): Float32Array {
    return rowsBetween(this.document as Document, this.shown, first, last);
  }

  gapAt(frame: number): Gap | null {
    return this.document && gapAtFrame(this.document, frame);
  }

  /** Sends a query to the server. */
  readonly ask: Connection["ask"] = (query, arrays) => this.withRig(() => this.socket.ask(query, arrays));

  /** Calls the server; if it no longer knows the rig, sends that and calls again. */
  async withRig<T>(call: () => Promise<T>): Promise<T> {
    try {
      return await call();
    } catch (error) {
      const source = this.document?.source;
      if (!(error instanceof Unanswered && error.again && source)) throw error;
      await openRig(source.name, source.text);
      return call();
    }
  }

  close(): void {
    clearTimeout(this.settling);
    this.socket.close();
  }

  /** Applies a change that adds a key at a frame, and selects that key. */
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
    if (state === "lost" && was === "open") this.notices.show(`${reason}. Reconnecting …`, "warning");
    if (state !== "open") return;
    this.generator?.retry();
    this.sync();
  }
}
