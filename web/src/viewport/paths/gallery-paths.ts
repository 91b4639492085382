/** Trajectories of the gallery on the ground, to pick one. */

import * as THREE from "three";
import { curve } from "../../pose/curve";
import { Decals, LIFT, type Decal } from "../marks/decals";
import type { Label } from "../scene/labels";
import type { Palette } from "../scene/palette";
import { closest, pixelsToPolyline, type Pointer, type Project } from "../picking/geometry";
import type { Hit, Layer } from "../picking/pointing";
import { Ribbons, type Ribbon } from "../marks/ribbons";
import type { GalleryPathView } from "../types";

/** Fewer points than this are connected by a curve. */
const FEW = 80;

export class GalleryPaths implements Layer {
  readonly group = new THREE.Group();
  private readonly ribbons = new Ribbons(24);
  private readonly heads = new Decals(25);
  private paths: readonly GalleryPathView[] = [];
  private places: THREE.Vector3[][] = [];
  private palette: Palette | null = null;
  private size = 1;
  private hovered: number | null = null;

  constructor(
    private readonly project: Project,
    private readonly pick: (index: number) => void,
  ) {
    this.group.add(this.ribbons.object, this.heads.object);
  }

  update(paths: readonly GalleryPathView[], palette: Palette, size: number): void {
    if (paths === this.paths && palette === this.palette && size === this.size) return;
    this.palette = palette;
    this.size = size;
    if (paths !== this.paths) {
      this.paths = paths;
      this.hovered = null;
      this.places = paths.map(({ points }) =>
        (points.length > FEW ? points : curve(points, points.length > 12 ? 4 : 16)).map(
          ([x, z]) => new THREE.Vector3(x, LIFT, z),
        ),
      );
    }
    this.build();
  }

  hit(at: Pointer): Hit | null {
    const far = (places: THREE.Vector3[]): number => pixelsToPolyline(places.map(this.project), at.x, at.y);
    const index = closest(this.places, far, 9 + at.slack);
    return index === null ? null : { id: index, cursor: "pointer", click: () => this.pick(index) };
  }

  hover(id: Hit["id"] | null): void {
    this.hovered = typeof id === "number" ? id : null;
    if (this.palette) this.build();
  }

  labels(): Label[] {
    return this.paths.flatMap((path, i) => {
      const places = this.places[i];
      const strong = i === this.hovered;
      if (places.length === 0 || !(strong || (path.chosen && this.hovered === null))) return [];
      const place = places[Math.floor(0.62 * (places.length - 1))].clone();
      return [{ text: path.label, place, colour: this.colour(i), strong }];
    });
  }

  private colour(i: number): string {
    const palette = this.palette!;
    return this.paths[i].chosen ? palette.accent : palette.hues[i % palette.hues.length];
  }

  private build(): void {
    const strength = (i: number): number => (i === this.hovered ? 2 : this.paths[i].chosen ? 1 : 0);
    const order = this.paths.map((_, i) => i).sort((a, b) => strength(a) - strength(b));
    const seen = order.filter((i) => this.places[i].length > 1);
    this.ribbons.set(
      seen.map((i): Ribbon => {
        const strong = strength(i) > 0;
        const points = this.places[i].map(({ x, z }) => ({ x, y: LIFT + (strong ? 0.003 : 0.001), z }));
        const opacity = strong ? 1 : this.hovered === null ? 0.7 : 0.4;
        return { points, colour: this.colour(i), width: strong ? 5 : 3, opacity };
      }),
    );
    this.heads.set(
      seen.map((i): Decal => {
        const places = this.places[i];
        const last = places.length - 1;
        const { x, z } = places[last];
        const near = places[Math.max(0, last - Math.ceil(places.length / 16))];
        const angle = Math.atan2(x - near.x, z - near.z);
        const strong = strength(i) > 0;
        const width = (strong ? 0.19 : 0.15) * this.size;
        const [colour, opacity] = [this.colour(i), strong ? 1 : 0.8];
        return { x, z, y: LIFT + 0.004, angle, width, length: 1.4 * width, mark: "arrow", colour, opacity };
      }),
    );
  }
}
