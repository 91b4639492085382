/** Translucent figures of key poses. */

import * as THREE from "three";
import type { Pose, Rig } from "../rig";
import { GhostBody } from "./body";
import type { Palette } from "./palette";
import type { Ghost } from "./types";

export class Ghosts {
  readonly group = new THREE.Group();
  bodies: { readonly ghost: Ghost; readonly figure: GhostBody }[] = [];
  hovered: string | null = null;

  /** Figures are kept where a ghost of the same place in the list is on the same rig. */
  update(rig: Rig | null, geometry: THREE.BufferGeometry | null, ghosts: readonly Ghost[], palette: Palette): void {
    const wanted = rig && geometry ? ghosts : [];
    for (const { figure } of this.bodies.splice(wanted.length)) figure.dispose();
    this.bodies = wanted.map((ghost, i) => {
      const had = this.bodies[i];
      const figure = had?.figure ?? new GhostBody(rig!, geometry!);
      if (!had) this.group.add(figure.body.group);
      if (had?.ghost.pose !== ghost.pose) figure.body.pose(ghost.pose);
      return { ghost, figure };
    });
    this.look(palette);
  }

  look(palette: Palette): void {
    for (const { ghost, figure } of this.bodies) {
      const hovered = ghost.key === this.hovered;
      figure.look(
        ghost.selected || hovered ? palette.accent : palette.ghost,
        ghost.selected ? 0.42 : hovered ? 0.38 : 0.27,
      );
    }
  }

  /** A ghost is not seen in the figure that has its very pose. */
  hide(pose: Pose | null, shown: boolean): void {
    this.group.visible = shown;
    for (const { ghost, figure } of this.bodies) figure.body.group.visible = pose === null || !same(ghost.pose, pose);
  }

  dispose(): void {
    for (const { figure } of this.bodies.splice(0)) figure.dispose();
  }
}

function same(a: Pose, b: Pose): boolean {
  return a === b || (a.length === b.length && a.every((value, i) => Math.abs(value - b[i]) < 1e-4));
}
