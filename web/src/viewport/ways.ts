/** Ways on the ground to pick one from. */

import * as THREE from "three";
import { curve } from "../pose/curve";
import { Decals, LIFT } from "./decals";
import type { Label } from "./labels";
import type { Palette } from "./palette";
import { pixelsToLine, type Pointer, type Project } from "./pick";
import type { Hit, Layer } from "./pointing";
import { Ribbons, type RibbonLine } from "./ribbons";
import type { WayView } from "./types";

/** Few points are joined by a curve; many are one. */
const FEW = 80;

export class Ways implements Layer {
  readonly group = new THREE.Group();
  private readonly lines = new Ribbons(24);
  private readonly heads = new Decals(25);
  private ways: readonly WayView[] = [];
  private places: THREE.Vector3[][] = [];
  private palette: Palette | null = null;
  private size = 1;
  private hovered: number | null = null;

  constructor(
    private readonly project: Project,
    private readonly pick: (index: number) => void,
  ) {
    this.group.add(this.lines.mesh, this.heads.mesh);
  }

  update(ways: readonly WayView[], palette: Palette, size: number): void {
    if (ways === this.ways && palette === this.palette && size === this.size) return;
    this.palette = palette;
    this.size = size;
    if (ways !== this.ways) {
      this.ways = ways;
      this.hovered = null;
      this.places = ways.map(({ points }) =>
        (points.length > FEW ? points : curve(points, points.length > 12 ? 4 : 16)).map(
          ([x, z]) => new THREE.Vector3(x, LIFT, z),
        ),
      );
    }
    this.build();
  }

  hit(at: Pointer): Hit | null {
    let best: { index: number; far: number } | null = null;
    this.places.forEach((places, index) => {
      const far = pixelsToLine(places.map(this.project), at.x, at.y);
      if (far < 9 + at.slack && (!best || far < best.far)) best = { index, far };
    });
    if (!best) return null;
    const { index } = best as { index: number };
    return { id: index, cursor: "pointer", click: () => this.pick(index) };
  }

  hover(id: Hit["id"] | null): void {
    this.hovered = typeof id === "number" ? id : null;
    if (this.palette) this.build();
  }

  labels(): Label[] {
    return this.ways.flatMap((way, i) => {
      const places = this.places[i];
      if (places.length === 0 || !way.label || (i !== this.hovered && !(way.chosen && this.hovered === null)))
        return [];
      return [
        {
          text: way.label,
          place: places[Math.floor(0.62 * (places.length - 1))].clone(),
          colour: this.colour(i),
          strong: i === this.hovered,
        },
      ];
    });
  }

  screen(width: number, height: number): void {
    this.lines.screen(width, height);
  }

  dispose(): void {
    this.lines.dispose();
    this.heads.dispose();
  }

  private colour(i: number): string {
    const palette = this.palette!;
    return this.ways[i].chosen ? palette.accent : palette.hues[i % palette.hues.length];
  }

  private build(): void {
    const strength = (i: number): number => (i === this.hovered ? 2 : this.ways[i].chosen ? 1 : 0);
    const order = this.ways.map((_, i) => i).sort((a, b) => strength(a) - strength(b));
    const seen = order.filter((i) => this.places[i].length > 1);
    this.lines.set(
      seen.map((i): RibbonLine => {
        const strong = strength(i) > 0;
        const points = this.places[i].map(({ x, z }) => ({ x, y: LIFT + (strong ? 0.003 : 0.001), z }));
        return {
          points,
          colour: this.colour(i),
          width: strong ? 5 : 3,
          opacity: strong ? 1 : this.hovered === null ? 0.7 : 0.4,
        };
      }),
    );
    this.heads.set(
      seen.map((i) => {
        const places = this.places[i];
        const [end, near] = [
          places[places.length - 1],
          places[Math.max(0, places.length - 1 - Math.ceil(places.length / 16))],
        ];
        const angle = Math.atan2(end.x - near.x, end.z - near.z);
        const wide = (strength(i) > 0 ? 0.19 : 0.15) * this.size;
        return {
          x: end.x,
          z: end.z,
          y: LIFT + 0.004,
          angle,
          width: wide,
          length: 1.4 * wide,
          mark: "arrow",
          colour: this.colour(i),
          opacity: strength(i) > 0 ? 1 : 0.8,
        };
      }),
    );
  }
}
