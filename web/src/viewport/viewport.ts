/** The 3-D view: shows what `update` receives, and reports edits by events. */

import * as THREE from "three";
import type { Pose, Rig } from "../rig";
import { Body, bodyGeometry, paint, sortGhosts } from "./characters/body";
import { Candidates } from "./characters/candidates";
import { allPoints, bestSide, characterPoints } from "./scene/framing";
import { CharacterPicking } from "./picking/characters";
import { ContactMarks } from "./characters/contacts";
import { Ghosts } from "./characters/ghosts";
import { Labels } from "./scene/labels";
import { DrawnPathEditor } from "./paths/drawn-path";
import { bodyMaterial, shadowMaterial } from "./scene/materials";
import { palettes, type Palette } from "./scene/palette";
import { hitBones, type Pointer, type Project } from "./picking/geometry";
import { Placing } from "./handles/placing";
import { Pointing } from "./picking/pointing";
import { Reaching } from "./handles/reaching";
import { Rotating } from "./handles/rotating";
import { Stage } from "./scene/stage";
import { Trails } from "./characters/trails";
import type { Events, Phase, View } from "./types";
import { GalleryPaths } from "./paths/gallery-paths";

export class Viewport {
  private readonly stage: Stage;
  private readonly material = bodyMaterial();
  private readonly shadow = shadowMaterial();
  private readonly ghosts = new Ghosts();
  private readonly trails = new Trails();
  private readonly contacts = new ContactMarks();
  private readonly candidates = new Candidates();
  private readonly labels = new Labels();
  private readonly galleryPaths: GalleryPaths;
  private readonly drawnPath: DrawnPathEditor;
  private readonly rotating: Rotating;
  private readonly reaching: Reaching;
  private readonly placing: Placing;
  private readonly pointing: Pointing;
  private geometry: THREE.BufferGeometry | null = null;
  private body: Body | null = null;
  private view: View | null = null;
  /** The pose during a drag, and the pose of the character. */
  private edited: Pose | null = null;
  private shown: Pose | null = null;

  /** Throws an Error with a message for the user if the browser has no WebGL. */
  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: Events,
  ) {
    const stage = (this.stage = new Stage(canvas));
    const project: Project = (point) => stage.project(point);
    const change = (pose: Pose, phase: Phase): void => this.change(pose, phase);
    this.galleryPaths = new GalleryPaths(project, (index) => events.pickPath(index));
    this.drawnPath = new DrawnPathEditor(project, (points, phase) => events.changeDrawnPath([...points], phase));
    this.rotating = new Rotating(stage.camera, project, (joint) => events.pickJoint(joint), change);
    this.reaching = new Reaching(stage.camera, project, change);
    this.placing = new Placing(change, (at) => this.touched(at));
    const [body, view, look] = [() => this.body, () => this.view, () => this.look()];
    const characters = new CharacterPicking(this.ghosts, this.candidates, body, view, project, events, look);
    const layers = [this.rotating, this.reaching, this.drawnPath, this.placing, characters, this.galleryPaths];
    this.pointing = new Pointing(stage, layers, () => this.missed());
    for (const part of [this.contacts, this.trails, this.ghosts, this.candidates, ...layers, this.labels]) {
      if ("group" in part) stage.scene.add(part.group);
    }
    stage.before = () => this.before();
  }

  update(view: View): void {
    const had = this.view;
    this.view = view;
    const { palette } = this;
    const rigged = had?.rig !== view.rig;
    const painted = had?.theme !== view.theme;
    if (rigged || had?.tool !== view.tool || had.editable !== view.editable) this.pointing.reset();
    if (painted) this.stage.paint(palette);
    if (rigged) this.rig(view.rig);
    if (this.geometry && view.rig && (rigged || painted)) paint(this.geometry, view.rig, palette);
    this.pose();
    if (rigged || painted || had?.ghosts !== view.ghosts)
      this.ghosts.update(view.rig, this.geometry, view.ghosts, palette);
    this.ghosts.hide(this.shown, view.show.ghosts);
    this.trails.group.visible = view.show.trails;
    if (view.show.trails) this.trails.update(view.rig, view.motion, view.frame, palette);
    this.contacts.group.visible = view.show.contacts;
    if (view.show.contacts) this.contacts.update(view.rig, view.motion, view.frame, palette);
    this.candidates.update(view, this.geometry, palette);
    this.galleryPaths.update(view.galleryPaths, palette, view.rig?.size ?? 1);
    this.drawnPath.update(view.drawnPath, view.ends, view.tool === "draw", palette, view.rig?.size ?? 1);
    this.tools();
    if (rigged && view.rig && view.pose) this.stage.frame(allPoints(view), bestSide(view.rig, view.pose));
    this.stage.draw();
  }

  /** After the canvas changed its size on the page. */
  resize(): void {
    this.stage.resize();
  }

  /** Moves the camera until all that is shown is in view. */
  frameAll(): void {
    if (this.view) this.stage.frame(allPoints(this.view));
  }

  /** Moves the camera to the character. */
  focus(): void {
    if (this.view) this.stage.frame(characterPoints(this.view));
  }

  /** Where a point of the world is on the canvas, in CSS pixels. */
  project(point: readonly [number, number, number]): { x: number; y: number; visible: boolean } {
    return this.stage.project(new THREE.Vector3(...point));
  }

  dispose(): void {
    this.pointing.dispose();
    this.rig(null);
    for (const part of [this.material, this.shadow, this.stage]) part.dispose();
  }

  private get palette(): Palette {
    return palettes[this.view?.theme ?? "light"];
  }

  private rig(rig: Rig | null): void {
    this.ghosts.dispose();
    this.candidates.clear();
    this.body?.dispose();
    this.geometry?.dispose();
    this.body = null;
    this.geometry = null;
    this.shown = null;
    this.edited = null;
    if (!rig) return;
    this.geometry = bodyGeometry(rig);
    this.body = new Body(rig, this.geometry);
    const mesh = this.body.add(this.material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.customDepthMaterial = this.shadow;
    this.stage.scene.add(this.body.group);
  }

  /** The character takes the pose that is dragged, or else that of the view. */
  private pose(): void {
    const { body, view } = this;
    if (!body || !view) return;
    const pose = this.edited ?? view.pose;
    body.group.visible = pose !== null;
    if (pose && pose !== this.shown) {
      body.pose(pose);
      this.stage.light(body.middle, body.rig.size);
    }
    this.shown = pose;
    this.stage.follow(view.follow && pose && !this.pointing.dragging ? body.middle : null);
  }

  private change(pose: Pose, phase: Phase): void {
    this.edited = phase === "end" ? null : pose;
    const { body } = this;
    if (body) {
      body.pose(pose);
      this.shown = pose;
      this.tools();
    }
    this.events.changePose(pose, phase);
    this.stage.draw();
  }

  /** Updates the tools; inactive ones get null. */
  private tools(): void {
    const { view, palette } = this;
    if (!view) return;
    const usable = view.editable && view.rig && this.shown ? view.rig : null;
    const pose = this.shown;
    this.rotating.joint = view.joint;
    this.rotating.update(view.tool === "rotate" ? usable : null, pose, palette);
    this.reaching.update(view.tool === "reach" ? usable : null, pose, palette);
    this.placing.update(view.tool === "place" ? usable : null, pose, palette);
  }

  private touched(at: Pointer): THREE.Vector3 | null {
    const { body } = this;
    if (!body?.group.visible) return null;
    const size = body.rig.size;
    return hitBones(body.rig, body.globals, body.group.position, at.ray, 0.09 * size)?.point ?? null;
  }

  private missed(): void {
    const { view } = this;
    if (view?.tool === "rotate" && view.joint !== null) this.events.pickJoint(null);
  }

  private look(): void {
    const { view, palette } = this;
    if (!view) return;
    this.ghosts.look(palette);
    this.candidates.look(view.candidates, view.spread, palette);
  }

  private before(): void {
    const { view, palette } = this;
    this.rotating.draw(this.stage.height);
    const ghosts = [...this.ghosts.bodies, ...this.candidates.characters].map(({ character }) => character);
    sortGhosts(ghosts, this.stage.camera);
    if (!view) return;
    const numbers = this.candidates.labels(view, view.pose ? this.body : null, palette);
    const named = [this.galleryPaths, this.rotating, this.reaching, this.placing].flatMap((part) => part.labels());
    this.labels.set([...numbers, ...named], palette, this.stage);
  }
}
