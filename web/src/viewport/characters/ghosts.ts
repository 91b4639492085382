/** Translucent characters of key poses. */

import * as THREE from "three";
import type { Pose, Rig } from "../../rig";
import { GhostBody } from "./body";
import type { Palette } from "../scene/palette";
import type { Ghost } from "../types";

export class Ghosts {
  readonly group = new THREE.Group();
  bodies: { readonly ghost: Ghost; readonly character: GhostBody }[] = [];
  hovered: string | null = null;

  /** Characters are reused for ghosts at the same index on the same rig. */
  update(rig: Rig | null, geometry: THREE.BufferGeometry | null, ghosts: readonly Ghost[], palette: Palette): void {
    const wanted = rig && geometry ? ghosts : [];
    for (const { character } of this.bodies.splice(wanted.length)) character.dispose();
    this.bodies = wanted.map((ghost, i) => {
      const had = this.bodies[i];
      const character = had?.character ?? new GhostBody(rig!, geometry!);
      if (!had) this.group.add(character.body.group);
      if (had?.ghost.pose !== ghost.pose) character.body.pose(ghost.pose);
      return { ghost, character };
    });
    this.look(palette);
  }

  look(palette: Palette): void {
    for (const { ghost, character } of this.bodies) {
      const hovered = ghost.key === this.hovered;
      const colour = ghost.selected || hovered ? palette.accent : palette.ghost;
      character.look(colour, ghost.selected ? 0.42 : hovered ? 0.38 : 0.27);
    }
  }

  /** Hides a ghost whose pose the character has. */
  hide(pose: Pose | null, shown: boolean): void {
    this.group.visible = shown;
    for (const { ghost, character } of this.bodies) character.body.group.visible = pose === null || !same(ghost.pose, pose);
  }

  dispose(): void {
    for (const { character } of this.bodies.splice(0)) character.dispose();
  }
}

function same(a: Pose, b: Pose): boolean {
  return a === b || (a.length === b.length && a.every((value, i) => Math.abs(value - b[i]) < 1e-4));
}
