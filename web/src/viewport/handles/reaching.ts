/** The tool that drags hands, feet, hips, neck and head, and turns elbows and knees about their limbs. */

import * as THREE from "three";
import { LIMBS, limbAt, limbOf, moveHips, reach, shifted, turnMiddle } from "../../pose/ik";
import { forward, hipsOf } from "../../pose/kinematics";
import { lean, trunkBelow } from "../../pose/lean";
import type { Pose, Rig } from "../../rig";
import { Handles, type Handle } from "./handles";
import type { Label } from "../scene/labels";
import type { Palette } from "../scene/palette";
import { onLevel, onPlane, type Pointer, type Project } from "../picking/geometry";
import type { Drag, Hit, Layer } from "../picking/pointing";
import { changing, type ChangePose } from "./drag";

export class Reaching implements Layer {
  readonly group = new THREE.Group();
  private readonly handles: Handles;
  private rig: Rig | null = null;
  private pose: Pose | null = null;
  private palette: Palette | null = null;

  constructor(
    private readonly camera: THREE.PerspectiveCamera,
    project: Project,
    private readonly change: ChangePose,
  ) {
    this.handles = new Handles(803, project);
    this.group.add(this.handles.dots.points);
    this.group.visible = false;
  }

  update(rig: Rig | null, pose: Pose | null, palette: Palette): void {
    this.rig = rig;
    this.pose = pose;
    this.palette = palette;
    this.group.visible = rig !== null && pose !== null;
    if (rig && pose) this.handles.set(dots(rig, pose, palette), palette.paper);
  }

  screen(ratio: number): void {
    this.handles.dots.screen(ratio);
  }

  hit(at: Pointer): Hit | null {
    const handle = this.group.visible ? this.handles.at(at) : null;
    return handle ? { id: handle.id, cursor: "grab", grab: (from) => this.grab(handle, from) } : null;
  }

  hover(id: Hit["id"] | null): void {
    this.handles.hovered = typeof id === "number" ? id : null;
    if (this.rig && this.pose && this.palette)
      this.handles.set(dots(this.rig, this.pose, this.palette), this.palette.paper);
  }

  labels(): Label[] {
    const { hovered } = this.handles;
    const handle = this.group.visible && hovered !== null ? this.handles.find(hovered) : undefined;
    return handle && this.rig ? [{ text: this.rig.joints[handle.id], place: handle.place.clone() }] : [];
  }

  dispose(): void {
    this.handles.dispose();
  }

  private grab(handle: Handle, from: Pointer): Drag | null {
    const { rig, pose } = this;
    if (!rig || !pose) return null;
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
      const goal = start
        .clone()
        .add(met)
        .sub(flat && level ? level : grabbed);
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
  const { positions } = forward(rig, pose);
  const place = (joint: number): THREE.Vector3 => new THREE.Vector3().fromArray(positions, 3 * joint);
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
