/** Where feet stand and slide: now under them, and as prints along the motion around the playhead. */

import * as THREE from "three";
import { AIR, contacts, footGroups, SLIDES, STANDS, type Contacts } from "../../pose/contacts";
import type { Rig } from "../../rig";
import { Decals, LIFT, type Decal } from "../marks/decals";
import type { Palette } from "../scene/palette";
import { drawnFrames } from "./trails";
import type { View } from "../types";

/** Seconds before and after the playhead whose prints are seen. */
const SPAN = 1.5;
/** A slide shorter than this many seconds leaves no print. */
const SHORT = 0.15;

type Motion = NonNullable<View["motion"]>;

export class ContactMarks {
  readonly group = new THREE.Group();
  private readonly under = new Decals(12);
  private readonly prints = new Decals(11);
  /** What is drawn, and what it was made from. */
  private held: { from: readonly unknown[]; rig: Rig; found: Contacts; groups: number[][] } | null = null;

  constructor() {
    this.group.add(this.under.object, this.prints.object);
  }

  update(rig: Rig | null, motion: Motion | null, frame: number, palette: Palette): void {
    if (!rig || !motion || rig.feet.length === 0 || motion.rows.length < rig.stride) {
      if (this.held) this.clear();
      return;
    }
    const at = frame - motion.first;
    const [first, last] = drawnFrames(at, motion.rows.length / rig.stride, rig.rate);
    const { held } = this;
    const from = [rig, motion, palette, first, last];
    if (!held?.from.every((value, i) => value === from[i])) {
      const found = contacts(rig, motion.rows, first, last);
      const groups = footGroups(rig);
      this.held = { from, rig, found, groups };
      this.prints.set(groups.flatMap((group) => prints(rig, found, group, first, palette)));
    }
    this.prints.fade(at, SPAN * rig.rate);
    this.now(Math.round(at) - first, palette);
  }

  private clear(): void {
    this.held = null;
    this.under.set([]);
    this.prints.set([]);
  }

  private now(frame: number, palette: Palette): void {
    const { rig, found, groups } = this.held!;
    if (frame < 0 || frame >= found.frames) return this.under.set([]);
    this.under.set(
      groups.flatMap((group): Decal[] => {
        const slides = group.some((foot) => stateOf(found, frame, foot) === SLIDES);
        const down = group.filter((foot) => stateOf(found, frame, foot) !== AIR);
        if (down.length === 0) return [];
        const sole = soleOf(rig, found, frame, group, down.length < group.length ? down : group);
        const colour = slides ? palette.warning : palette.accent;
        const base = { ...sole, colour, y: LIFT + 0.002 };
        const [width, length] = [2.9 * sole.width, sole.length + 1.9 * sole.width];
        const wide = 0.4 * rig.size;
        return [
          { ...base, mark: "glow", width, length, opacity: slides ? 0.85 : 0.62 },
          { ...base, mark: "ring", width: wide, length: wide, opacity: slides ? 0.75 : 0.3, y: LIFT + 0.003 },
        ];
      }),
    );
  }
}

function stateOf(found: Contacts, frame: number, foot: number): number {
  return found.states[frame * found.feet + foot];
}

/** The sole of a foot from some of its joints in a frame. */
function soleOf(
  rig: Rig,
  found: Contacts,
  frame: number,
  group: readonly number[],
  used: readonly number[],
): { x: number; z: number; angle: number; width: number; length: number } {
  const at = (foot: number): [number, number] => {
    const i = 3 * (frame * found.feet + foot);
    return [found.places[i], found.places[i + 2]];
  };
  const [heel, toe] = [at(group[0]), at(group[group.length - 1])];
  const [dx, dz] = [toe[0] - heel[0], toe[1] - heel[1]];
  const long = Math.hypot(dx, dz);
  const angle = long > 1e-4 ? Math.atan2(dx, dz) : 0;
  const width = 0.105 * rig.size;
  const [from, to] = [at(used[0]), at(used[used.length - 1])];
  const back = used.includes(group[0]) ? 0.062 * rig.size : 0.03 * rig.size;
  const front = used.includes(group[group.length - 1]) ? 0.075 * rig.size : 0.05 * rig.size;
  const shift = 0.5 * (front - back);
  return {
    x: 0.5 * (from[0] + to[0]) + shift * Math.sin(angle),
    z: 0.5 * (from[1] + to[1]) + shift * Math.cos(angle),
    angle,
    width,
    length: Math.hypot(to[0] - from[0], to[1] - from[1]) + back + front,
  };
}

/** One print where a foot stands for some time, and one where it slides. */
function prints(rig: Rig, found: Contacts, group: readonly number[], first: number, palette: Palette): Decal[] {
  const made: Decal[] = [];
  const state = (frame: number): number => {
    const states = group.map((foot) => stateOf(found, frame, foot));
    return states.includes(SLIDES) ? SLIDES : states.includes(STANDS) ? STANDS : AIR;
  };
  for (let frame = 0; frame < found.frames;) {
    const now = state(frame);
    let end = frame + 1;
    while (end < found.frames && state(end) === now) end++;
    const short = now === SLIDES && end - frame < SHORT * rig.rate;
    if (now !== AIR && !short) {
      const middle = Math.floor((frame + end - 1) / 2);
      const colour = now === SLIDES ? palette.warning : palette.faint;
      made.push({
        ...soleOf(rig, found, middle, group, group),
        mark: "sole",
        colour,
        opacity: now === SLIDES ? 0.65 : 0.4,
        time: first + middle,
      });
    }
    frame = end;
  }
  return made;
}
