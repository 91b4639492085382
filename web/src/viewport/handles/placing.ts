/** The tool that moves the whole pose on the ground and turns it: a disc under the hips, and a ring about it. */

import * as THREE from "three";
import { groundOf, headingOf, moveOnGround, turnAboutHips } from "../../pose/place";
import type { Pose } from "../../rig";
import { Decals, LIFT, type Decal } from "../marks/decals";
import type { Label } from "../scene/labels";
import { onLevel, type Pointer } from "../picking/geometry";
import type { Drag, Hit, Layer } from "../picking/pointing";
import { changing, type ChangePose } from "./drag";
import { Ribbons, type Ribbon } from "../marks/ribbons";
import { PoseTool } from "./tool";
import { wrapped } from "./turning";

/** Of a character whose hips are a metre high. */
const RADIUS = 0.52;
const BAND = 0.11;

type Part = "move" | "turn";

export class Placing extends PoseTool implements Layer {
  private readonly marks = new Decals(30);
  private readonly ribbons = new Ribbons(31);
  private hovered: Part | null = null;
  private turned: { from: number; by: number } | null = null;

  constructor(
    private readonly change: ChangePose,
    /** Where a pointer meets the character itself, which can be dragged, too. */
    private readonly body: (at: Pointer) => THREE.Vector3 | null,
  ) {
    super();
    this.group.add(this.marks.object, this.ribbons.object);
  }

  hit(at: Pointer): Hit | null {
    if (!this.on) return null;
    const { rig, pose } = this.on;
    const held = this.body(at);
    if (held) return { id: "move", cursor: "move", grab: (from) => this.move(from, held.y) };
    const met = onLevel(at.ray, 0);
    if (!met) return null;
    const [x, z] = groundOf(rig, pose);
    const far = Math.hypot(met.x - x, met.z - z) / rig.size;
    if (Math.abs(far - RADIUS) < BAND) return { id: "turn", cursor: "grab", grab: (from) => this.turn(from) };
    return far < RADIUS ? { id: "move", cursor: "move", grab: (from) => this.move(from, 0) } : null;
  }

  hover(id: Hit["id"] | null): void {
    this.hovered = id === "move" || id === "turn" ? id : null;
    this.build();
  }

  labels(): Label[] {
    const { on, turned } = this;
    if (!on || !turned) return [];
    const { rig, pose } = on;
    const [x, z] = groundOf(rig, pose);
    const angle = turned.from + turned.by;
    const far = 1.35 * RADIUS * rig.size;
    const place = new THREE.Vector3(x + far * Math.sin(angle), 0, z + far * Math.cos(angle));
    return [{ text: `${Math.round(THREE.MathUtils.radToDeg(turned.by))}°`, place, strong: true }];
  }

  protected build(): void {
    const { on, hovered, turned } = this;
    if (!on) return;
    const { rig, pose, palette } = on;
    const [x, z] = groundOf(rig, pose);
    const angle = headingOf(rig, pose);
    const radius = RADIUS * rig.size;
    const colour = palette.accent;
    const marks: Decal[] = [
      { x, z, width: 1.9 * radius, mark: "disc", colour, opacity: hovered === "move" ? 0.2 : 0.09 },
    ];
    const at = (turn: number, far: number): { x: number; y: number; z: number } => ({
      x: x + far * Math.sin(turn),
      y: LIFT + 0.004,
      z: z + far * Math.cos(turn),
    });
    const arrow = 0.17 * rig.size;
    marks.push({
      ...at(angle, radius + 0.85 * arrow),
      angle,
      width: arrow,
      length: 1.35 * arrow,
      mark: "arrow",
      colour,
      opacity: hovered === "turn" ? 1 : 0.9,
    });
    for (let side = 0; side < 4; side++) {
      const turn = (side * Math.PI) / 2;
      marks.push({
        ...at(turn, 0.7 * radius),
        angle: turn,
        width: 0.55 * arrow,
        length: 0.6 * arrow,
        mark: "arrow",
        colour,
        opacity: hovered === "move" ? 0.85 : 0.4,
      });
    }
    this.marks.set(marks);
    const ring = Array.from({ length: 97 }, (_, i) => at((2 * Math.PI * i) / 96, radius));
    const ribbons: Ribbon[] = [{ points: ring, colour, width: hovered === "turn" ? 5 : 3, opacity: 0.9 }];
    if (turned) {
      const steps = Math.max(2, Math.ceil(Math.abs(turned.by) / 0.06));
      const arc = Array.from({ length: steps + 1 }, (_, i) => at(turned.from + (turned.by * i) / steps, radius));
      ribbons.push(
        { points: [arc[0], at(0, 0), arc[steps]], colour, width: 1.5, opacity: 0.8 },
        { points: arc, colour, width: 7 },
      );
    }
    this.ribbons.set(ribbons);
  }

  private move(from: Pointer, level: number): Drag | null {
    const start = onLevel(from.ray, level);
    if (!this.on || !start) return null;
    const { rig, pose } = this.on;
    return changing(pose, this.change, (at) => {
      const met = onLevel(at.ray, level, 60);
      return met && moveOnGround(rig, pose, met.x - start.x, met.z - start.z);
    });
  }

  private turn(from: Pointer): Drag | null {
    if (!this.on) return null;
    const { rig, pose } = this.on;
    const [x, z] = groundOf(rig, pose);
    const angleAt = (pointer: Pointer): number | null => {
      const met = onLevel(pointer.ray, 0);
      return met && Math.atan2(met.x - x, met.z - z);
    };
    let last = angleAt(from);
    let raw = 0;
    const heading = headingOf(rig, pose);
    const make = (at: Pointer): Pose | null => {
      const now = angleAt(at);
      if (now === null || last === null) return null;
      raw += wrapped(now - last);
      last = now;
      const step = THREE.MathUtils.degToRad(15);
      const by = at.shift ? step * Math.round(raw / step) : raw;
      this.turned = { from: heading, by };
      return turnAboutHips(rig, pose, by);
    };
    return changing(pose, this.change, make, () => {
      this.turned = null;
      this.build();
    });
  }
}
