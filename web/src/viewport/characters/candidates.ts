/** The other candidates of a gap as translucent characters, and the root paths of all candidates. */

import * as THREE from "three";
import { hipsOf, tracks } from "../../pose/kinematics";
import { groundOf } from "../../pose/place";
import { row, type Rig } from "../../rig";
import { GhostBody, type Body } from "./body";
import { LIFT } from "../marks/decals";
import type { Label } from "../scene/labels";
import type { Palette } from "../scene/palette";
import { Ribbons, type Ribbon } from "../marks/ribbons";
import type { CandidateView, View } from "../types";

/** Between neighbours that stand side by side, for a character whose hips are a metre high. */
const APART = 1.25;

export class Candidates {
  readonly group = new THREE.Group();
  /** The characters, with the place of each in the list of candidates. */
  characters: { readonly index: number; readonly character: GhostBody }[] = [];
  /** Each candidate's root path on the ground, as drawn. */
  tracks: THREE.Vector3[][] = [];
  hovered: number | null = null;
  private readonly ribbons = new Ribbons(21);
  /** What the root paths were made from. */
  private laid: readonly unknown[] = [];
  private poses: (Float32Array | null)[] = [];

  constructor() {
    this.group.add(this.ribbons.object);
  }

  update(view: View, geometry: THREE.BufferGeometry | null, palette: Palette): void {
    const { rig, candidates, spread, show } = view;
    const wanted =
      rig && geometry && show.others ? candidates.flatMap(({ chosen }, index) => (chosen ? [] : [index])) : [];
    for (const { character } of this.characters.splice(wanted.length)) character.dispose();
    this.characters = wanted.map((index, i) => {
      const character = this.characters[i]?.character ?? new GhostBody(rig!, geometry!);
      if (!this.characters[i]) this.group.add(character.body.group);
      return { index, character };
    });
    this.poses.length = wanted.length;
    const from = [rig, candidates, spread, palette];
    if (rig && !from.every((value, i) => value === this.laid[i])) this.lay(rig, candidates, spread, palette);
    this.laid = from;
    this.characters.forEach(({ index, character }, i) => {
      const { rows, frames } = candidates[index];
      const pose = row(rows, rig!.stride, Math.max(0, Math.min(frames - 1, Math.round(view.candidateFrame))));
      const had = this.poses[i];
      if (had?.buffer !== pose.buffer || had.byteOffset !== pose.byteOffset) character.body.pose(pose);
      this.poses[i] = pose;
      character.body.group.position.copy(shiftOf(rig!, candidates, spread, index));
    });
    this.look(candidates, spread, palette);
    this.ribbons.object.visible = candidates.length > 0 && rig !== null;
  }

  look(candidates: readonly CandidateView[], spread: View["spread"], palette: Palette): void {
    for (const { index, character } of this.characters) {
      const strong = index === this.hovered;
      const base = spread === "side by side" ? 0.72 : 0.3;
      character.look(hueOf(candidates, index, palette), strong ? Math.min(1, base + 0.25) : base, spread === "overlaid");
    }
  }

  /** Numbers over the characters, as the panel counts them; `own` is the character of the chosen one. */
  labels(view: View, own: Body | null, palette: Palette): Label[] {
    const beside = view.spread === "side by side" && this.characters.length > 0;
    const others = this.characters.filter(({ index }) => beside || index === this.hovered);
    const made = others.map(({ index, character }) => this.label(view.candidates, index, character.body, palette));
    const chosen = view.candidates.findIndex((candidate) => candidate.chosen);
    return beside && own && chosen >= 0 ? [...made, this.label(view.candidates, chosen, own, palette)] : made;
  }

  clear(): void {
    for (const { character } of this.characters.splice(0)) character.dispose();
    this.poses = [];
    this.laid = [];
    this.tracks = [];
    this.ribbons.set([]);
  }

  private label(candidates: readonly CandidateView[], index: number, body: Body, palette: Palette): Label {
    const { positions } = body.globals;
    let top = 0;
    for (let i = 1; i < positions.length; i += 3) top = Math.max(top, positions[i]);
    const head = body.rig.humanoid.Head;
    const place = (head === undefined ? body.middle : body.at(head)).setY(
      top + (head === undefined ? 0.05 : 0.17) * body.rig.size,
    );
    const strong = index === this.hovered || candidates[index].chosen;
    return { text: String(index + 1), place, colour: hueOf(candidates, index, palette), strong };
  }

  private lay(rig: Rig, candidates: readonly CandidateView[], spread: View["spread"], palette: Palette): void {
    this.tracks = candidates.map(({ rows, frames }, index) => {
      const shift = shiftOf(rig, candidates, spread, index);
      const places = tracks(rig, rows, rig.stride, [hipsOf(rig)], 0, frames);
      return Array.from({ length: frames }, (_, i) =>
        new THREE.Vector3().fromArray(places, 3 * i).add(shift).setY(LIFT),
      );
    });
    const ribbons = candidates.map(({ chosen }, index): Ribbon => ({
      points: this.tracks[index].map(({ x, z }) => ({ x, y: chosen ? LIFT + 0.004 : LIFT + 0.002, z })),
      colour: chosen ? palette.accent : hueOf(candidates, index, palette),
      width: chosen ? 4 : 2,
      opacity: chosen ? 0.95 : 0.6,
    }));
    this.ribbons.set(ribbons.sort((a, b) => a.width - b.width)); // the chosen one on top
  }
}

/** The colour of a candidate: the accent for the chosen one, and a hue for each other. */
export function hueOf(candidates: readonly CandidateView[], index: number, palette: Palette): string {
  return candidates[index].chosen ? palette.accent : palette.hues[index % palette.hues.length];
}

/** The offset of a candidate: side by side, candidates are spread across their path, with the chosen one in place. */
export function shiftOf(
  rig: Rig,
  candidates: readonly CandidateView[],
  spread: View["spread"],
  index: number,
): THREE.Vector3 {
  const chosen = Math.max(0, candidates.findIndex((candidate) => candidate.chosen));
  if (spread === "overlaid" || index === chosen) return new THREE.Vector3();
  const { rows, frames } = candidates[chosen];
  const [from, to] = [0, frames - 1].map((frame) => groundOf(rig, row(rows, rig.stride, frame)));
  const [x, z] = [to[0] - from[0], to[1] - from[1]];
  const long = Math.hypot(x, z);
  const across = long > 0.2 * rig.size ? new THREE.Vector3(-z / long, 0, x / long) : new THREE.Vector3(1, 0, 0);
  return across.multiplyScalar((index - chosen) * APART * rig.size);
}
