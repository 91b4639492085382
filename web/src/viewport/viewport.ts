/** The picture of the motion: told by `update` what to show, it tells by events what was done in it. */

import * as THREE from "three";
import { forward } from "../pose/kinematics";
import type { Pose, Rig } from "../rig";
import { Body, bodyGeometry, paint, sortGhosts } from "./body";
import { Ghosts } from "./ghosts";
import { bodyMaterial } from "./materials";
import { palettes, type Palette } from "./palette";
import { Stage } from "./stage";
import { Trails } from "./trails";
import type { Events, View } from "./types";

export class Viewport {
  private readonly stage: Stage;
  private readonly material = bodyMaterial();
  private readonly ghosts = new Ghosts();
  private readonly trails = new Trails();
  private geometry: THREE.BufferGeometry | null = null;
  private body: Body | null = null;
  private view: View | null = null;

  /** Throws an Error with a sentence for the user where the browser has no WebGL. */
  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: Events,
  ) {
    this.stage = new Stage(canvas);
    this.stage.scene.add(this.trails.group, this.ghosts.group);
    this.stage.before = () => this.before();
    void this.events;
  }

  update(view: View): void {
    const had = this.view;
    this.view = view;
    const palette = this.palette;
    const painted = had?.theme !== view.theme;
    if (painted) this.stage.paint(palette);
    const rigged = had?.rig !== view.rig;
    if (rigged) this.change(view.rig);
    if (this.geometry && view.rig && (rigged || painted)) paint(this.geometry, view.rig, palette);
    if (this.body && view.pose && (rigged || had?.pose !== view.pose)) this.pose(view.pose);
    if (this.body) this.body.group.visible = view.pose !== null;
    if (rigged || painted || had?.ghosts !== view.ghosts) this.ghosts.update(view.rig, this.geometry, view.ghosts, palette);
    this.ghosts.group.visible = view.show.ghosts;
    this.trails.group.visible = view.show.trails;
    if (view.show.trails) this.trails.update(view.rig, view.motion, view.frame, palette);
    this.stage.follow(view.follow && this.body && view.pose ? this.body.at(0) : null);
    if (rigged && view.pose) this.frameAll();
    this.stage.draw();
  }

  /** After the canvas changed its size on the page. */
  resize(): void {
    this.stage.resize();
  }

  /** Looks at all that is shown. */
  frameAll(): void {
    this.stage.frame(this.bounds(true));
  }

  /** Looks at the figure. */
  focus(): void {
    this.stage.frame(this.bounds(false));
  }

  /** Where a point of the world is on the canvas, in CSS pixels. */
  project(point: readonly [number, number, number]): { x: number; y: number; visible: boolean } {
    return this.stage.project(new THREE.Vector3(...point));
  }

  dispose(): void {
    this.change(null);
    this.ghosts.dispose();
    this.trails.dispose();
    this.material.dispose();
    this.stage.dispose();
  }

  private get palette(): Palette {
    return palettes[this.view?.theme ?? "light"];
  }

  private change(rig: Rig | null): void {
    this.ghosts.dispose();
    this.body?.dispose();
    this.geometry?.dispose();
    this.body = null;
    this.geometry = null;
    if (!rig) return;
    this.geometry = bodyGeometry(rig);
    this.body = new Body(rig, this.geometry);
    const mesh = this.body.add(this.material);
    mesh.castShadow = mesh.receiveShadow = true;
    this.stage.scene.add(this.body.group);
  }

  private pose(pose: Pose): void {
    if (!this.body) return;
    this.body.pose(pose);
    this.stage.light(this.body.at(0), this.body.rig.size);
  }

  private bounds(all: boolean): THREE.Box3 {
    const box = new THREE.Box3();
    const { view } = this;
    if (!view?.rig) return box;
    const poses = [view.pose, ...(all ? view.ghosts.map((ghost) => ghost.pose) : [])];
    const point = new THREE.Vector3();
    for (const pose of poses) {
      if (!pose) continue;
      const { positions } = forward(view.rig, pose);
      for (let i = 0; i < positions.length; i += 3) box.expandByPoint(point.fromArray(positions, i));
    }
    return box.expandByScalar(0.12 * view.rig.size);
  }

  private before(): void {
    const { width, height, ratio, camera } = this.stage;
    this.trails.screen(width, height, ratio);
    sortGhosts(this.ghosts.bodies.map(({ figure }) => figure), camera);
  }
}
