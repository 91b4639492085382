/** The tool that turns joints: a handle a joint, and rings about the axes of the one that is picked. */

import * as THREE from "three";
import { withTurn } from "../../pose/ik";
import { forward, placeOf, turnOf } from "../../pose/kinematics";
import type { Pose } from "../../rig";
import { Handles, type Handle } from "./handles";
import type { Label } from "../scene/labels";
import type { Palette } from "../scene/palette";
import { closest, pixelsToPolyline, type Pointer, type Project, type Spot } from "../picking/geometry";
import type { Drag, Hit, Layer } from "../picking/pointing";
import { changing, type ChangePose } from "./drag";
import { Ribbons, type Ribbon } from "../marks/ribbons";
import { PoseTool } from "./tool";
import { alongTurn, circle, roundTurn, turnedBy } from "./turning";

/** Pixels of a ring's radius, and the share by which the outer one, across the view, is larger. */
const RADIUS = 74;
const OUTER = 1.2;
const PIECES = 72;
/** A ring that is seen flatter than this is turned along its edge. */
const FLAT = 0.32;

interface Ring {
  readonly axis: THREE.Vector3;
  readonly colour: string;
  readonly points: THREE.Vector3[];
  /** How much each point looks at the camera: the far half is faint and is not picked. */
  readonly near: boolean[];
}

export class Rotating extends PoseTool implements Layer {
  /** The joint that is turned. */
  joint: number | null = null;
  private readonly handles: Handles;
  private readonly ribbons = new Ribbons(802, true);
  private readonly fill = new THREE.Mesh(
    new THREE.BufferGeometry(),
    new THREE.MeshBasicMaterial({
      transparent: true,
      opacity: 0.16,
      depthTest: false,
      depthWrite: false,
      side: THREE.DoubleSide,
      toneMapped: false,
    }),
  );
  private rings: Ring[] = [];
  private hovered: number | null = null;
  private turning: { ring: number; angle: number; arm: THREE.Vector3; axis: THREE.Vector3 } | null = null;

  constructor(
    private readonly camera: THREE.PerspectiveCamera,
    private readonly project: Project,
    private readonly pick: (joint: number | null) => void,
    private readonly change: ChangePose,
  ) {
    super();
    this.handles = new Handles(803, project);
    this.fill.renderOrder = 801;
    this.fill.frustumCulled = false;
    this.group.add(this.handles.dots.object, this.ribbons.object, this.fill);
  }

  /** Before each picture: the rings keep their size on the screen. */
  draw(height: number): void {
    const { on, joint } = this;
    this.ribbons.object.visible = on !== null && joint !== null;
    this.fill.visible = this.ribbons.object.visible && this.turning !== null;
    if (!on || joint === null) {
      this.rings = [];
      return;
    }
    const { palette } = on;
    const globals = forward(on.rig, on.pose);
    const centre = placeOf(globals, joint);
    const scale = this.pixel(centre, height);
    this.rings = this.turning ? this.rings : this.makeRings(centre, turnOf(globals, joint), RADIUS * scale, palette);
    this.ribbons.set(
      this.turning ? this.turnRibbons(centre, palette) : this.rings.map((ring, i) => this.ringRibbon(ring, i)),
    );
  }

  hit(at: Pointer): Hit | null {
    if (!this.on) return null;
    const far = ({ points, near }: Ring, ring: number): number => {
      const spots = points.map((point, i): Spot => ({ ...this.project(point), visible: near[i] }));
      return pixelsToPolyline(spots, at.x, at.y) + (ring === 3 ? 2 : 0);
    };
    const ring = closest(this.rings, far, 7 + at.slack);
    if (ring !== null) return { id: `ring ${ring}`, cursor: "grab", grab: (from) => this.grab(ring, from) };
    const handle = this.handles.at(at);
    if (!handle) return null;
    return { id: handle.id, cursor: "pointer", click: () => this.pick(handle.id) };
  }

  hover(id: Hit["id"] | null): void {
    this.hovered = typeof id === "string" ? Number(id.slice(5)) : null;
    this.handles.hovered = typeof id === "number" ? id : null;
    this.build();
  }

  labels(): Label[] {
    const { on, turning, joint, handles } = this;
    if (!on) return [];
    if (turning && joint !== null) {
      const place = turning.arm.clone().add(handles.find(joint)?.place ?? new THREE.Vector3());
      return [{ text: `${Math.round(THREE.MathUtils.radToDeg(turning.angle))}°`, place, strong: true }];
    }
    const named = handles.hovered;
    const handle = named === null ? undefined : handles.find(named);
    return handle ? [{ text: on.rig.joints[handle.id], place: handle.place.clone() }] : [];
  }

  protected build(): void {
    if (!this.on) return;
    const { rig, pose, palette } = this.on;
    const globals = forward(rig, pose);
    const parents = new Set(rig.parents);
    const dots = rig.parents.flatMap((_, joint): Handle[] => {
      const picked = joint === this.joint;
      const end = !parents.has(joint) && !Object.values(rig.humanoid).includes(joint);
      if (end && !picked) return [];
      const [size, colour, opacity] = picked ? [11, palette.accent, 1] : [8, palette.faint, 0.8];
      return [{ id: joint, place: placeOf(globals, joint), size, colour, opacity }];
    });
    this.handles.set(dots, palette.paper);
  }

  private pixel(at: THREE.Vector3, height: number): number {
    const depth = -at.clone().applyMatrix4(this.camera.matrixWorldInverse).z;
    return (2 * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2)) * depth) / height;
  }

  private makeRings(centre: THREE.Vector3, turn: THREE.Quaternion, radius: number, palette: Palette): Ring[] {
    const view = this.camera.position.clone().sub(centre).normalize();
    const axes = [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 1, 0), new THREE.Vector3(0, 0, 1)];
    const own = axes.map((axis, i) => ({
      axis: axis.applyQuaternion(turn),
      colour: palette.axes[i],
      radius,
      far: -0.02,
    }));
    const all = [...own, { axis: view.clone(), colour: palette.faint, radius: OUTER * radius, far: -1 }];
    return all.map(({ axis, colour, radius: wide, far }) => {
      const points = circle(centre, axis, wide, PIECES);
      return { axis, colour, points, near: points.map((point) => point.clone().sub(centre).dot(view) > far * wide) };
    });
  }

  private ringRibbon({ points, colour, near }: Ring, i: number): Ribbon {
    const hovered = i === this.hovered;
    const width = hovered ? 4 : i === 3 ? 1.5 : 2.5;
    const opacity = hovered ? 1 : this.hovered === null ? 0.9 : 0.5;
    const faded = points.map(({ x, y, z }, k) => ({ x, y, z, opacity: near[k] ? 1 : 0.16 }));
    return { points: faded, colour, width, opacity };
  }

  /** While a ring is turned: it alone, and the sector it was turned by. */
  private turnRibbons(centre: THREE.Vector3, palette: Palette): Ribbon[] {
    const { ring, angle, arm, axis } = this.turning!;
    const { points, colour } = this.rings[ring];
    const steps = Math.max(2, Math.min(240, Math.ceil(Math.abs(angle) / 0.06)));
    const arc = Array.from({ length: steps + 1 }, (_, i) =>
      arm.clone().applyAxisAngle(axis, (angle * i) / steps).add(centre),
    );
    const flat = [centre, ...arc].flatMap((point) => point.toArray());
    this.fill.geometry.dispose();
    this.fill.geometry = new THREE.BufferGeometry();
    this.fill.geometry.setAttribute("position", new THREE.Float32BufferAttribute(flat, 3));
    this.fill.geometry.setIndex(Array.from({ length: steps }, (_, i) => [0, i + 1, i + 2]).flat());
    const tint = ring === 3 ? palette.accent : colour;
    this.fill.material.color.set(tint);
    return [
      { points, colour: tint, width: 2, opacity: 0.5 },
      { points: [arc[0], centre, arc[steps]], colour: tint, width: 1.5, opacity: 0.9 },
      { points: arc, colour: tint, width: 4.5 },
    ];
  }

  private grab(index: number, from: Pointer): Drag | null {
    const { on, joint } = this;
    const ring = this.rings[index];
    if (!on || joint === null || !ring) return null;
    const { rig, pose } = on;
    const globals = forward(rig, pose);
    const centre = placeOf(globals, joint);
    const start = turnOf(globals, joint);
    const axis = ring.axis.clone();
    const view = this.camera.position.clone().sub(centre).normalize();
    const spots = ring.points.map(this.project);
    const far = (spot: Spot, i: number): number => (ring.near[i] ? Math.hypot(spot.x - from.x, spot.y - from.y) : Infinity);
    const nearest = closest(spots, far, Infinity) ?? 0;
    const arm = ring.points[nearest].clone().sub(centre);
    const step = axis.clone().cross(arm).multiplyScalar(0.05).add(ring.points[nearest]);
    const [here, there] = [spots[nearest], this.project(step)];
    const tangent = { x: there.x - here.x, y: there.y - here.y };
    const pixels = Math.hypot(tangent.x, tangent.y) / 0.05;
    const middle = this.project(centre);
    const flat = Math.abs(axis.dot(view)) < FLAT;
    let last: Spot = { x: from.x, y: from.y, visible: true };
    this.turning = { ring: index, angle: 0, arm, axis };
    const make = (at: Pointer): Pose => {
      const now = { x: at.x, y: at.y, visible: true };
      const by = flat ? alongTurn(tangent, last, now, pixels) : roundTurn(middle, last, now, axis.dot(view) > 0);
      last = now;
      const raw = this.turning!.angle + by;
      this.turning = { ring: index, angle: raw, arm, axis };
      const angle = at.shift ? THREE.MathUtils.degToRad(15 * Math.round(THREE.MathUtils.radToDeg(raw) / 15)) : raw;
      return withTurn(rig, pose, globals, joint, turnedBy(start, axis, angle));
    };
    return changing(pose, this.change, make, () => (this.turning = null));
  }
}
