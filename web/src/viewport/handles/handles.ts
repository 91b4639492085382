/** Round handles of a size in pixels, always on top, that can be hovered and picked. */

import { Vector3 } from "three";
import { Dots, type Shape } from "../marks/dots";
import { closest, type Pointer, type Project } from "../picking/geometry";

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
      rim,
    );
  }

  find(id: number): Handle | undefined {
    return this.held.find((handle) => handle.id === id);
  }

  /** The handle nearest to the pointer, if it is near. */
  at(pointer: Pointer): Handle | null {
    const far = ({ place, size }: Handle): number => {
      const { x, y, visible } = this.project(place);
      const away = Math.hypot(x - pointer.x, y - pointer.y);
      return visible && away < 0.5 * size + 4 + pointer.slack ? away : Infinity;
    };
    const index = closest(this.held, far, Infinity);
    return index === null ? null : this.held[index];
  }
}
