/** Geometry of picking: distances of a pointer to polylines and bodies. */

import { Plane, Ray, Vector3 } from "three";
import { aboveHips, placeOf, type Globals } from "../../pose/kinematics";
import type { Rig } from "../../rig";

export interface Spot {
  readonly x: number;
  readonly y: number;
  readonly visible: boolean;
}

/** The pointer on the canvas: CSS pixels, and the ray into the world. */
export interface Pointer {
  readonly x: number;
  readonly y: number;
  readonly ray: Ray;
  readonly shift: boolean;
  /** Fingers are less exact: how many pixels farther away they may be. */
  readonly slack: number;
}

export type Project = (point: Vector3) => Spot;

/** Pixels from a point to a polyline; infinite if it is not visible. */
export function pixelsToPolyline(spots: readonly Spot[], x: number, y: number): number {
  let best = Infinity;
  for (let i = 0; i + 1 < spots.length; i++) {
    const [a, b] = [spots[i], spots[i + 1]];
    if (!a.visible || !b.visible) continue;
    const [dx, dy] = [b.x - a.x, b.y - a.y];
    const square = dx * dx + dy * dy;
    const share = square > 0 ? Math.min(1, Math.max(0, ((x - a.x) * dx + (y - a.y) * dy) / square)) : 0;
    best = Math.min(best, Math.hypot(x - a.x - share * dx, y - a.y - share * dy));
  }
  return best;
}

/** The index of the item with the least distance below a limit; null if there is none. */
export function closest<Item>(items: readonly Item[], far: (item: Item, index: number) => number, limit: number): number | null {
  let best: number | null = null;
  for (const [index, item] of items.entries()) {
    const distance = far(item, index);
    if (distance < limit) [best, limit] = [index, distance];
  }
  return best;
}

/** The bone that a ray hits, as if each were `radius` thick: how far away, and its upper joint; null where none. */
export function hitBones(
  rig: Pick<Rig, "parents" | "humanoid">,
  globals: Globals,
  shift: Vector3,
  ray: Ray,
  radius: number,
): { distance: number; joint: number; point: Vector3 } | null {
  const [onRay, onBone] = [new Vector3(), new Vector3()];
  let best: { distance: number; joint: number; point: Vector3 } | null = null;
  rig.parents.forEach((parent, joint) => {
    if (parent < 0 || aboveHips(rig, parent)) return;
    const [a, b] = [placeOf(globals, parent).add(shift), placeOf(globals, joint).add(shift)];
    if (ray.distanceSqToSegment(a, b, onRay, onBone) > radius * radius) return;
    const distance = onRay.distanceTo(ray.origin);
    if (best && best.distance <= distance) return;
    best = { distance, joint: parent, point: onBone.clone() };
  });
  return best;
}

/** Where a ray meets the horizontal plane at a height; null where it does not, or only far away. */
export function onLevel(ray: Ray, height: number, farthest = 200): Vector3 | null {
  const met = ray.intersectPlane(new Plane(new Vector3(0, 1, 0), -height), new Vector3());
  return met && met.distanceTo(ray.origin) < farthest ? met : null;
}

/** Where a ray meets the plane through a point that faces against `normal`. */
export function onPlane(ray: Ray, normal: Vector3, through: Vector3): Vector3 | null {
  return ray.intersectPlane(new Plane().setFromNormalAndCoplanarPoint(normal, through), new Vector3());
}
