/** The geometry of turning by rings: plain, without a picture. */

import { Quaternion, Vector3 } from "three";
import type { Spot } from "../picking/geometry";

/** Points of a circle about `centre`, in the plane across `axis`. */
export function circle(centre: Vector3, axis: Vector3, radius: number, count: number): Vector3[] {
  const u = new Vector3(Math.abs(axis.y) > 0.9 ? 1 : 0, Math.abs(axis.y) > 0.9 ? 0 : 1, 0).cross(axis).normalize();
  const v = axis.clone().cross(u);
  return Array.from({ length: count + 1 }, (_, i) => {
    const angle = (2 * Math.PI * i) / count;
    return centre
      .clone()
      .addScaledVector(u, radius * Math.cos(angle))
      .addScaledVector(v, radius * Math.sin(angle));
  });
}

/** The turn about a ring's axis between two spots of the pointer, by going round the ring's middle on the screen. */
export function roundTurn(middle: Spot, from: Spot, to: Spot, towardsCamera: boolean): number {
  const a = Math.atan2(middle.y - from.y, from.x - middle.x);
  const b = Math.atan2(middle.y - to.y, to.x - middle.x);
  const turn = wrapped(b - a);
  return towardsCamera ? turn : -turn;
}

/** The same of a ring that is seen from its edge: by how far the pointer goes along it. */
export function alongTurn(tangent: { x: number; y: number }, from: Spot, to: Spot, pixels: number): number {
  const long = Math.hypot(tangent.x, tangent.y) || 1;
  return ((to.x - from.x) * tangent.x + (to.y - from.y) * tangent.y) / long / Math.max(1, pixels);
}

export function wrapped(angle: number): number {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

/** A rotation turned in the world. */
export function turnedBy(rotation: Quaternion, axis: Vector3, angle: number): Quaternion {
  return new Quaternion().setFromAxisAngle(axis, angle).multiply(rotation);
}
