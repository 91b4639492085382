/** What the server was asked beside candidates: ways and durations for the selected gap, and poses on the opened rig. */

import { setPose } from "./document/commands";
import type { Gap, Key } from "./document/document";
import type { Suggested, WayInfo } from "./protocol";
import type { Rig } from "./rig";
import type { Studio } from "./studio.svelte";
import type { Arrays } from "./wire";

export class Answers {
  /** Ways of the gallery for the selected gap, to pick from; null where nobody asked. */
  ways = $state.raw<{ readonly found: readonly WayInfo[]; readonly reason: string | null } | null>(null);
  /** How long the selected gap should take. */
  suggested = $state.raw<Suggested | null>(null);
  library = $state.raw<{ readonly names: readonly string[]; readonly poses: Float32Array } | null>(null);

  constructor(private readonly studio: Studio) {}

  /** Another gap was selected: what was told of the one before is no use any more. */
  forget(): void {
    this.ways = null;
    this.suggested = null;
  }

  async findWays(gap: Gap, count = 6): Promise<void> {
    const { studio } = this;
    const { style, blend, seed } = gap.settings;
    const { rig, ends } = this.about(gap);
    try {
      const asked = { type: "paths", rig, style, blend, frames: gap.frames, count, seed } as const;
      const { header } = await studio.ask(asked, ends);
      if (studio.selection.gap === gap.id) this.ways = { found: header.ways, reason: header.reason };
    } catch (error) {
      studio.notices.warn(error);
    }
  }

  async suggest(gap: Gap): Promise<void> {
    const { studio } = this;
    const { style, blend } = gap.settings;
    const { rig, ends } = this.about(gap);
    try {
      const { header } = await studio.ask({ type: "suggest", rig, style, blend }, ends);
      if (studio.selection.gap === gap.id) this.suggested = header;
    } catch {
      this.suggested = null; // no gallery reaches so far, or the rig is no humanoid: there is nothing to offer
    }
  }

  async loadLibrary(rig: Rig): Promise<void> {
    this.library = null;
    try {
      const { header, arrays } = await this.studio.ask({ type: "library", rig: rig.id });
      if (this.studio.rig === rig) this.library = { names: header.names, poses: arrays.poses.values };
    } catch {
      this.library = null; // the rig is no humanoid
    }
  }

  /** Gives some keys their mirror images for poses. */
  async mirror(keys: readonly Key[]): Promise<void> {
    const { studio } = this;
    const { rig } = studio;
    if (!rig || keys.length === 0) return;
    try {
      const ask = ({ pose }: Key) =>
        studio.ask({ type: "mirror", rig: rig.id }, { pose: { shape: [1, rig.stride], values: pose } });
      const made = await Promise.all(keys.map(ask));
      if (!studio.document) return;
      const pose = (i: number) => made[i].arrays.pose.values;
      const next = keys.reduce((document, { id }, i) => setPose(document, id, pose(i)), studio.document);
      studio.apply(next, keys.length > 1 ? "Mirror poses" : "Mirror pose");
    } catch (error) {
      studio.notices.warn(error);
    }
  }

  private about(gap: Gap): { rig: string; ends: Arrays } {
    const { id, stride } = this.studio.rig as Rig;
    const end = (values: Float32Array) => ({ shape: [1, stride], values });
    return { rig: id, ends: { start: end(gap.left.pose), target: end(gap.right.pose) } };
  }
}
