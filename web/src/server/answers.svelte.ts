/** Answers of the server other than candidates: paths and durations for the selected gap, and poses on the rig. */

import { setPose } from "../document/commands";
import type { Gap, Key } from "../document/document";
import type { SuggestedDurations, GalleryPath } from "../protocol";
import type { Rig } from "../rig";
import type { Studio } from "../studio.svelte";
import type { Arrays } from "./messages";

export class Answers {
  /** Trajectories of the gallery for the selected gap; null if they were not requested. */
  paths = $state.raw<{ readonly found: readonly GalleryPath[]; readonly reason: string | null } | null>(null);
  /** Suggested durations of the selected gap. */
  suggested = $state.raw<SuggestedDurations | null>(null);
  library = $state.raw<{ readonly names: readonly string[]; readonly poses: Float32Array } | null>(null);

  constructor(private readonly studio: Studio) {}

  /** Discards the answers for the previously selected gap. */
  forget(): void {
    this.paths = null;
    this.suggested = null;
  }

  async findPaths(gap: Gap, count = 6): Promise<void> {
    const { studio } = this;
    const { settings, frames } = gap;
    const { rig, ends } = this.about(gap);
    try {
      const { header } = await studio.ask({ type: "paths", rig, settings, frames, count }, ends);
      if (studio.selection.gap === gap.id) this.paths = { found: header.paths, reason: header.reason };
    } catch (error) {
      studio.notices.warn(error);
    }
  }

  async suggest(gap: Gap): Promise<void> {
    const { studio } = this;
    const { settings } = gap;
    const { rig, ends } = this.about(gap);
    try {
      const { header } = await studio.ask({ type: "suggest", rig, settings }, ends);
      if (studio.selection.gap === gap.id) this.suggested = header;
    } catch {
      this.suggested = null; // there is no gallery, none of its trajectories fits, or the rig is not a humanoid
    }
  }

  async loadLibrary(rig: Rig): Promise<void> {
    this.library = null;
    try {
      const { header, arrays } = await this.studio.ask({ type: "library", rig: rig.id });
      if (this.studio.rig === rig) this.library = { names: header.names, poses: arrays.poses.values };
    } catch {
      this.library = null; // the rig is not a humanoid
    }
  }

  /** Mirrors the poses of some keys. */
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
    return { rig: id, ends: { start: end(this.studio.poseOf(gap.left)), target: end(gap.right.pose) } };
  }
}
