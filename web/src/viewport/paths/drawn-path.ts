/** Editor of the drawn path: its curve with control points, and strokes for a new path. */

import * as THREE from "three";
import { changing } from "../handles/drag";
import { curve, distance, inserted, nearest, thinned, type Ground } from "../../pose/curve";
import { Decals, LIFT } from "../marks/decals";
import { Handles, type Handle } from "../handles/handles";
import type { Palette } from "../scene/palette";
import { onLevel, pixelsToPolyline, type Pointer, type Project } from "../picking/geometry";
import type { Drag, Hit, Layer } from "../picking/pointing";
import { Ribbons } from "../marks/ribbons";
import type { DrawnPathView, Phase } from "../types";

type Points = readonly Ground[];
export type Ends = Pick<DrawnPathView, "from" | "to">;

/** Tolerance of a curve fitted to a stroke, and the distance it keeps from both keys; shares of the rig's size. */
const TOLERANCE = 0.06;
const AT_END = 0.2;

export class DrawnPathEditor implements Layer {
  readonly group = new THREE.Group();
  private readonly curve = new Ribbons(27);
  private readonly marks = new Decals(28);
  private readonly handles: Handles;
  private path: DrawnPathView | null = null;
  private ends: Ends | null = null;
  private palette: Palette | null = null;
  private size = 1;
  private drawing = false;
  private stroke: Ground[] | null = null;
  private dragged: Points | null = null;
  private touched: number | null = null;

  constructor(
    private readonly project: Project,
    private readonly change: (points: Points, phase: Phase) => void,
  ) {
    this.handles = new Handles(804, project);
    this.group.add(this.curve.object, this.marks.object, this.handles.dots.object);
  }

  /** ends: of the gap, for drawing a first path. */
  update(path: DrawnPathView | null, ends: Ends | null, drawing: boolean, palette: Palette, size: number): void {
    if (path?.points.length !== this.path?.points.length) this.touched = null;
    this.path = path;
    this.ends = path ?? ends;
    this.drawing = drawing;
    this.palette = palette;
    this.size = size;
    this.build();
  }

  hit(at: Pointer): Hit | null {
    const handle = this.handles.at(at);
    if (handle) {
      const { id } = handle;
      return { id, cursor: "grab", click: () => (this.touched = id), grab: (from) => this.drag(id, from) };
    }
    if (this.path && pixelsToPolyline(this.spots(), at.x, at.y) < 8 + at.slack) {
      return { id: "path", cursor: "copy", grab: this.drawing ? () => this.draw(at) : undefined };
    }
    if (this.drawing && this.ends && onLevel(at.ray, 0, 60))
      return { id: "ground", cursor: "crosshair", grab: (from) => this.draw(from) };
    return null;
  }

  hover(id: Hit["id"] | null): void {
    this.handles.hovered = typeof id === "number" ? id : null;
    this.build();
  }

  double(at: Pointer): boolean {
    const met = onLevel(at.ray, 0, 60);
    if (!this.path || !met || this.handles.at(at) || pixelsToPolyline(this.spots(), at.x, at.y) > 10 + at.slack)
      return false;
    const { points, at: place } = inserted(this.path.from, this.path.points, this.path.to, [met.x, met.z]);
    this.report(points);
    this.touched = place;
    return true;
  }

  remove(): boolean {
    const index = this.handles.hovered ?? this.touched;
    if (!this.path || index === null || index >= this.path.points.length) return false;
    this.handles.hovered = null;
    this.touched = null;
    this.report(this.path.points.filter((_, i) => i !== index));
    return true;
  }

  private report(points: Points): void {
    this.change(points, "start");
    this.change(points, "end");
  }

  private points(): Points | null {
    const inner = this.dragged ?? this.path?.points;
    return inner && this.ends ? [this.ends.from, ...inner, this.ends.to] : null;
  }

  private spots(): ReturnType<Project>[] {
    const points = this.points();
    return points ? curve(points, 12).map(([x, z]) => this.project(new THREE.Vector3(x, LIFT, z))) : [];
  }

  private build(): void {
    const { palette, stroke, size } = this;
    if (!palette) return;
    const colour = palette.accent;
    const points = this.points();
    const drawn = stroke ?? (points ? curve(points, 24) : []);
    this.curve.set([{ points: drawn.map(([x, z]) => ({ x, y: LIFT + 0.005, z })), colour, width: 4, opacity: 0.95 }]);
    const held: Points = stroke ? [] : (this.dragged ?? this.path?.points ?? []);
    this.handles.set(
      held.map(([x, z], id): Handle => {
        return { id, place: new THREE.Vector3(x, LIFT, z), size: id === this.touched ? 15 : 13, colour };
      }),
      palette.paper,
    );
    const ends = drawn.length > 1 || this.drawing ? this.ends : null;
    const width = 0.13 * size;
    this.marks.set(
      ends
        ? [
            { x: ends.from[0], z: ends.from[1], width, mark: "disc", colour },
            { x: ends.to[0], z: ends.to[1], width, mark: "disc", colour: palette.target },
            { x: ends.to[0], z: ends.to[1], width: 2 * width, mark: "ring", colour: palette.target, opacity: 0.7 },
          ]
        : [],
    );
  }

  private drag(index: number, from: Pointer): Drag | null {
    const { path } = this;
    const start = onLevel(from.ray, 0, 60);
    if (!path || !start) return null;
    this.touched = index;
    const [x, z] = path.points[index];
    const changed = (points: Points, phase: Phase): void => {
      this.dragged = phase === "end" ? null : points;
      this.build();
      this.change(points, phase);
    };
    return changing(path.points, changed, (at) => {
      const met = onLevel(at.ray, 0, 60);
      return (
        met && path.points.map((point, i): Ground => (i === index ? [x + met.x - start.x, z + met.z - start.z] : point))
      );
    });
  }

  /** Draws a stroke by hand, which is connected to both keys. */
  private draw(from: Pointer): Drag | null {
    const { ends, path, size } = this;
    const start = onLevel(from.ray, 0, 60);
    if (!ends || !start) return null;
    const step = 0.015 * size;
    let stroke: Ground[] = [ends.from];
    const add = (point: Ground): void => {
      if (distance(point, stroke[stroke.length - 1]) > step) stroke = [...stroke, point];
    };
    add([start.x, start.z]);
    const changed = (points: Points, phase: Phase): void => {
      this.stroke = phase === "end" ? null : [...stroke, ends.to];
      this.build();
      this.change(points, phase);
    };
    return changing(path?.points ?? [], changed, (at) => {
      const met = onLevel(at.ray, 0, 60);
      if (met) add([met.x, met.z]);
      return met && controlPoints(stroke, ends, size);
    });
  }
}

/** The control points of a stroke between two ends. */
export function controlPoints(stroke: Points, { from, to }: Ends, size: number): Ground[] {
  const near = AT_END * size;
  let first = 0;
  while (first < stroke.length && distance(stroke[first], from) < near) first++;
  let last = stroke.length;
  while (last > first && distance(stroke[last - 1], to) < near) last--;
  const inner = stroke.slice(first, last);
  const points = thinned([from, ...inner, to], TOLERANCE * size).slice(1, -1);
  if (points.length > 0 || inner.length === 0) return points;
  return [nearest(inner, [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])]).place];
}
