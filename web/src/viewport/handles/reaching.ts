/** The tool that drags hands, feet, hips, neck and head, and turns elbows and knees about their limbs. */

import * as THREE from "three";
import { LIMBS, limbAt, limbOf, moveHips, reach, shifted, turnMiddle } from "../../pose/ik";
import { forward, hipsOf, placeOf } from "../../pose/kinematics";
import { lean, trunkBelow } from "../../pose/lean";
import type { Pose, Rig } from "../../rig";
import { Handles, type Handle } from "./handles";
import type { Label } from "../scene/labels";
import type { Palette } from "../scene/palette";
import { onLevel, onPlane, type Pointer, type Project } from "../picking/geometry";
import type { Drag, Hit, Layer } from "../picking/pointing";
import { PoseTool } from "./tool";
import { changing, type ChangePose } from "./drag";

export class Reaching extends PoseTool implements Layer {
  private readonly handles: Handles;

  constructor(
    private readonly camera: THREE.PerspectiveCamera,
    project: Project,
    private readonly change: ChangePose,
  ) {
    super();
    this.handles = new Handles(803, project);
    this.group.add(this.handles.dots.object);
  }

  hit(at: Pointer): Hit | null {
    const handle = this.on ? this.handles.at(at) : null;
    return handle ? { id: handle.id, cursor: "grab", grab: (from) => this.grab(handle, from) } : null;
  }

  hover(id: Hit["id"] | null): void {
    this.handles.hovered = typeof id === "number" ? id : null;
    this.build();
  }

  labels(): Label[] {
    const { hovered } = this.handles;
    const handle = hovered === null ? undefined : this.handles.find(hovered);
    return handle && this.on ? [{ text: this.on.rig.joints[handle.id], place: handle.place.clone() }] : [];
  }

  protected build(): void {
    if (this.on) this.handles.set(dots(this.on.rig, this.on.pose, this.on.palette), this.on.palette.paper);
  }

  private grab(handle: Handle, from: Pointer): Drag | null {
    if (!this.on) return null;
    const { rig, pose } = this.on;
    const start = handle.place.clone();
    const view = this.camera.getWorldDirection(new THREE.Vector3()).negate();
    const grabbed = onPlane(from.ray, view, start);
    if (!grabbed) return null;
    const level = onLevel(from.ray, start.y);
    const found = limbAt(rig, handle.id);
    const make = (at: Pointer): Pose | null => {
      // With Shift, what is dragged stays at its height.
      const flat = at.shift && level ? onLevel(at.ray, start.y, 60) : null;
      const met = flat ?? onPlane(at.ray, view, start);
      if (!met) return null;
      const goal = start.clone().add(met).sub(flat && level ? level : grabbed);
      if (at.shift) goal.y = start.y;
      const place = goal.toArray();
      if (found?.part === "end") return reach(rig, pose, found.limb, place);
      if (found) return turnMiddle(rig, pose, found.limb, place);
      if (handle.id !== hipsOf(rig)) return lean(rig, pose, handle.id, place);
      return rig.humanoid.Hips === undefined
        ? shifted(rig, pose, goal.sub(start).toArray())
        : moveHips(rig, pose, place);
    };
    return changing(pose, this.change, make);
  }
}

function dots(rig: Rig, pose: Pose, palette: Palette): Handle[] {
  const globals = forward(rig, pose);
  const place = (joint: number): THREE.Vector3 => placeOf(globals, joint);
  const hips = hipsOf(rig);
  const made: Handle[] = [{ id: hips, place: place(hips), size: 15, colour: palette.ink, shape: "square" }];
  for (const joint of [rig.humanoid.Neck, rig.humanoid.Head]) {
    if (joint !== undefined && trunkBelow(rig, joint).length > 0)
      made.push({ id: joint, place: place(joint), size: 12, colour: palette.ink });
  }
  for (const name of LIMBS) {
    const limb = limbOf(rig, name);
    if (!limb) continue;
    const colour = name.startsWith("Left") ? palette.left : palette.right;
    made.push({ id: limb.mid, place: place(limb.mid), size: 11, colour, shape: "diamond", opacity: 0.9 });
    made.push({ id: limb.end, place: place(limb.end), size: 14, colour });
  }
  return made;
}
