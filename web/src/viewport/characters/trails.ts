/** Trails of hands, feet and root around the playhead, with a tick per frame. */

import * as THREE from "three";
import { hipsOf, tracks } from "../../pose/kinematics";
import type { Rig } from "../../rig";
import { Dots, type Dot } from "../marks/dots";
import type { Palette } from "../scene/palette";
import { Ribbons, type Ribbon } from "../marks/ribbons";
import type { View } from "../types";

/** Seconds before and after the playhead that are seen. */
const SPAN = 1.5;

type Motion = NonNullable<View["motion"]>;
type Paint = "left" | "right" | "ink";

/** Which joints leave a trail, and in which colour. */
export function trailed(rig: Rig): { joint: number; paint: Paint }[] {
  const found: { joint: number; paint: Paint }[] = [];
  const add = (name: string, paint: Paint): boolean => {
    const joint = rig.humanoid[name];
    if (joint !== undefined) found.push({ joint, paint });
    return joint !== undefined;
  };
  found.push({ joint: hipsOf(rig), paint: "ink" });
  for (const side of ["Left", "Right"] as const) {
    const paint = side === "Left" ? "left" : "right";
    add(`${side}Hand`, paint);
    if (!add(`${side}Toe`, paint)) add(`${side}Foot`, paint);
  }
  if (found.length > 1) return found;
  const parents = new Set(rig.parents);
  const ends = rig.parents.map((_, joint) => joint).filter((joint) => !parents.has(joint));
  return [...found, ...ends.slice(0, 6).map((joint) => ({ joint, paint: "ink" as const }))];
}

/** The frames of rows that are drawn for a playhead: whole blocks, so that they seldom change. */
export function drawnFrames(at: number, count: number, rate: number): [number, number] {
  const block = Math.max(1, Math.round(rate));
  const first = Math.floor((at - SPAN * rate) / block) * block;
  const last = Math.ceil((at + SPAN * rate) / block) * block + 1;
  return [Math.max(0, first), Math.min(count, last)];
}

export class Trails {
  readonly group = new THREE.Group();
  private readonly ribbons = new Ribbons(40);
  private readonly ticks = new Dots(41);
  private motion: Motion | null = null;
  private palette: Palette | null = null;
  private rig: Rig | null = null;
  private drawn: [number, number] = [0, 0];

  constructor() {
    this.group.add(this.ribbons.object, this.ticks.object);
  }

  update(rig: Rig | null, motion: Motion | null, frame: number, palette: Palette): void {
    const at = motion ? frame - motion.first : 0;
    if (rig && motion && motion.rows.length >= rig.stride) {
      const drawn = drawnFrames(at, motion.rows.length / rig.stride, rig.rate);
      const same = drawn[0] === this.drawn[0] && drawn[1] === this.drawn[1];
      if (!same || motion !== this.motion || palette !== this.palette || rig !== this.rig)
        this.build(rig, motion, drawn, palette);
      this.drawn = drawn;
      for (const part of [this.ribbons, this.ticks]) part.fade(at, SPAN * rig.rate);
    } else if (this.motion) {
      this.ribbons.set([]);
      this.ticks.set([]);
    }
    this.motion = motion;
    this.palette = palette;
    this.rig = rig;
  }

  private build(rig: Rig, motion: Motion, [first, last]: [number, number], palette: Palette): void {
    const joints = trailed(rig);
    const indices = joints.map(({ joint }) => joint);
    const places = tracks(rig, motion.rows, rig.stride, indices, first, last);
    const keys = new Set(motion.keys);
    const dots: Dot[] = [];
    const ribbons = joints.map(({ paint }, k): Ribbon => {
      const points = Array.from({ length: last - first }, (_, i) => {
        const at = 3 * (i * joints.length + k);
        return { x: places[at], y: places[at + 1], z: places[at + 2], time: first + i };
      });
      const root = paint === "ink";
      const colour = root ? palette.faint : palette[paint];
      for (const point of points) {
        const key = keys.has(motion.first + point.time);
        const look = key ? { colour: palette.ink, size: 7, opacity: 0.95, rim: 1.5 } : { colour, size: 3, opacity: 0.85 };
        dots.push({ ...point, ...look });
      }
      return { points, colour, width: root ? 1.5 : 2, opacity: root ? 0.55 : 0.7 };
    });
    this.ribbons.set(ribbons);
    this.ticks.set(dots, palette.paper);
  }
}
