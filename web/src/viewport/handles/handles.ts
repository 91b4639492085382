/** Round handles of a size in pixels, always on top, that can be hovered and picked. */

import { Vector3 } from "three";
import { Dots, type Shape } from "../marks/dots";
import type { Pointer, Project } from "../picking/geometry";

export interface Handle {
  readonly id: number;
  readonly place: Vector3;
  readonly size: number;
  readonly colour: string;
  readonly shape?: Shape;
  readonly opacity?: number;
}

export class Handles {
  readonly dots: Dots;
  hovered: number | null = null;
  private held: readonly Handle[] = [];

  constructor(
    order: number,
    private readonly project: Project,
  ) {
    this.dots = new Dots(order, true);
  }

  set(handles: readonly Handle[], rim: string): void {
    this.held = handles;
    this.dots.rim(rim);
    this.dots.set(
      handles.map(({ id, place, size, colour, shape, opacity }) => {
        const hovered = id === this.hovered;
        return {
          x: place.x,
          y: place.y,
          z: place.z,
          size: size + (hovered ? 4 : 0),
          colour,
          rim: 2,
          shape,
          opacity: hovered ? 1 : opacity,
        };
      }),
    );
  }

  find(id: number): Handle | undefined {
    return this.held.find((handle) => handle.id === id);
  }

  /** The handle nearest to the pointer, if it is near. */
  at(pointer: Pointer): Handle | null {
    let best: { handle: Handle; far: number } | null = null;
    for (const handle of this.held) {
      const spot = this.project(handle.place);
      const far = Math.hypot(spot.x - pointer.x, spot.y - pointer.y);
      if (spot.visible && far < 0.5 * handle.size + 4 + pointer.slack && (!best || far < best.far))
        best = { handle, far };
    }
    return best?.handle ?? null;
  }

  dispose(): void {
    this.dots.dispose();
  }
}
