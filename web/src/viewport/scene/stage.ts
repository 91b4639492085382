/** Renderer, camera, lights and ground; draws only when something changed. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Ground } from "./ground";
import type { Palette } from "./palette";

const WITHOUT_WEBGL =
  "This browser cannot draw in three dimensions, because WebGL is missing or switched off. " +
  "Switch on hardware acceleration in its settings, or open the studio in another browser.";
const SHADOW_REACH = 1.9;
/** Of the picture's edge around what is framed. */
const MARGIN = 1.16;

/** Pixels of the picture for a CSS pixel, where it is drawn without a graphics card. */
const PLAIN_RATIO = 0.7;

export class Stage {
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(32, 1, 0.05, 400);
  readonly orbit: OrbitControls;
  /** Called before each picture. */
  before: () => void = () => {};
  width = 1;
  height = 1;
  ratio = 1;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly plain: boolean;
  private readonly ground = new Ground();
  private readonly sky = new THREE.HemisphereLight();
  private readonly lamp = new THREE.DirectionalLight();
  private readonly fill = new THREE.DirectionalLight();
  private readonly rim = new THREE.DirectionalLight();
  /** Where what the camera goes along with is, and how far the camera is behind it. */
  private follows: THREE.Vector3 | null = null;
  private readonly behind = new THREE.Vector3();
  private readonly listening = new AbortController();
  private request = 0;
  private last = 0;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.plain = isPlain();
    try {
      const antialias = !this.plain;
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias, stencil: true, powerPreference: "high-performance" });
    } catch {
      throw new Error(WITHOUT_WEBGL);
    }
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.NeutralToneMapping;
    this.lamp.castShadow = true;
    this.lamp.shadow.mapSize.setScalar(this.plain ? 512 : 1024);
    this.lamp.shadow.bias = -0.0004;
    this.lamp.shadow.normalBias = 0.028;
    this.lamp.shadow.intensity = 0.7;
    this.lamp.shadow.radius = 3.2;
    const lights = [this.lamp, this.fill, this.rim].flatMap((light) => [light, light.target]);
    this.scene.add(this.ground.group, this.sky, ...lights);
    this.orbit = new OrbitControls(this.camera, canvas);
    this.orbit.enableDamping = false;
    this.orbit.maxPolarAngle = Math.PI / 2 + 0.1;
    this.orbit.minDistance = 0.5;
    this.orbit.maxDistance = 60;
    this.orbit.screenSpacePanning = true;
    this.orbit.mouseButtons = { LEFT: THREE.MOUSE.ROTATE, MIDDLE: THREE.MOUSE.PAN, RIGHT: THREE.MOUSE.PAN };
    this.orbit.addEventListener("change", () => this.draw());
    const { signal } = this.listening;
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault(), { signal });
    canvas.addEventListener("webglcontextrestored", () => this.draw(), { signal });
    this.camera.position.set(2.4, 1.7, 4.2);
    this.orbit.target.set(0, 0.9, 0);
    this.orbit.update();
    this.resize();
  }

  /** Asks for a picture. */
  draw(): void {
    if (this.request === 0) this.request = requestAnimationFrame(this.picture);
  }

  paint(palette: Palette): void {
    this.ground.paint(palette);
    this.sky.color.set(palette.above);
    this.sky.groundColor.set(palette.below);
    this.sky.intensity = palette.ambient;
    this.lamp.intensity = palette.lamp;
    this.fill.intensity = palette.fill;
    this.rim.intensity = palette.rim;
    this.draw();
  }

  resize(): void {
    if (this.request < 0) return;
    const { clientWidth, clientHeight } = this.canvas;
    this.width = Math.max(1, clientWidth);
    this.height = Math.max(1, clientHeight);
    const ratio = globalThis.devicePixelRatio || 1;
    this.ratio = this.plain ? PLAIN_RATIO : Math.min(2, ratio);
    this.renderer.setPixelRatio(this.ratio);
    this.renderer.setSize(this.width, this.height, false);
    this.camera.aspect = this.width / this.height;
    this.camera.updateProjectionMatrix();
    // Another size empties the canvas: it is drawn at once, so that it does not flash.
    if (this.last > 0) this.picture(performance.now());
    else this.draw();
  }

  /** The lamp and its shadow stand about `root`; `size` is about the height of a character's hips. */
  light(root: THREE.Vector3, size: number): void {
    const reach = SHADOW_REACH * size;
    this.lamp.target.position.set(root.x, 0.5 * size, root.z);
    this.lamp.position.copy(this.lamp.target.position).add(new THREE.Vector3(-1.3, 4.3, 3.0).multiplyScalar(size));
    this.ground.shade(root, 2.6 * size);
    const box = this.lamp.shadow.camera;
    box.left = box.bottom = -reach;
    box.right = box.top = reach;
    box.near = 0.5 * size;
    box.far = 9 * size;
    box.updateProjectionMatrix();
  }

  /** The camera follows `root` on the ground at its current distance; with null it stays. */
  follow(root: THREE.Vector3 | null): void {
    if (root && this.follows) {
      this.behind.add(root).sub(this.follows).setY(0);
      this.draw();
    } else this.behind.set(0, 0, 0);
    this.follows = root?.clone() ?? null;
  }

  /** Moves until all points are in view, looking from where the camera is, or along `from`. */
  frame(points: readonly THREE.Vector3[], from?: THREE.Vector3): void {
    const box = new THREE.Box3().setFromPoints([...points]);
    if (box.isEmpty()) return;
    const centre = box.getCenter(new THREE.Vector3());
    const back = (from ?? this.camera.position.clone().sub(this.orbit.target)).normalize();
    const right = new THREE.Vector3(0, 1, 0).cross(back).normalize();
    const up = back.clone().cross(right);
    const tall = Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2)) / MARGIN;
    const wide = tall * this.camera.aspect;
    let distance = 1;
    for (const point of points) {
      const p = point.clone().sub(centre);
      distance = Math.max(distance, p.dot(back) + Math.max(Math.abs(p.dot(right)) / wide, Math.abs(p.dot(up)) / tall));
    }
    this.behind.set(0, 0, 0);
    this.orbit.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(back, distance);
    this.orbit.update();
    this.draw();
  }

  /** Where a point of the world is on the canvas, in CSS pixels. */
  project(point: THREE.Vector3): { x: number; y: number; visible: boolean } {
    const p = point.clone().project(this.camera);
    return { x: (0.5 + 0.5 * p.x) * this.width, y: (0.5 - 0.5 * p.y) * this.height, visible: p.z > -1 && p.z < 1 };
  }

  dispose(): void {
    cancelAnimationFrame(this.request);
    this.request = -1;
    this.listening.abort();
    this.orbit.dispose();
    this.lamp.dispose();
    this.scene.traverse((object) => {
      const { geometry, material } = object as Partial<THREE.Mesh<THREE.BufferGeometry, THREE.Material>>;
      geometry?.dispose();
      material?.dispose();
    });
    this.renderer.dispose();
  }

  private readonly picture = (now: number): void => {
    cancelAnimationFrame(this.request);
    this.request = 0;
    const seconds = Math.min(0.1, Math.max(0.001, (now - this.last) / 1000));
    this.last = now;
    this.catchUp(seconds);
    this.before();
    this.ground.look(this.orbit.target, this.camera.position.distanceTo(this.orbit.target));
    this.lightView();
    this.renderer.render(this.scene, this.camera);
  };

  /** One light goes along with the camera, so that no side is dull, and one stands behind what it looks at. */
  private lightView(): void {
    const { target } = this.orbit;
    const back = this.camera.position.clone().sub(target).setY(0).normalize();
    const left = new THREE.Vector3(-back.z, 0, back.x);
    this.fill.target.position.copy(target);
    this.fill.position.copy(target).addScaledVector(back, 3).addScaledVector(left, 1.2).setY(target.y + 1.4);
    this.rim.target.position.copy(target);
    this.rim.position.copy(target).addScaledVector(back, -3).addScaledVector(left, -1.6).setY(target.y + 2.6);
  }

  private catchUp(seconds: number): void {
    if (this.behind.length() < 0.002) return;
    const step = this.behind.clone().multiplyScalar(1 - Math.exp(-7 * seconds));
    this.behind.sub(step);
    this.orbit.target.add(step);
    this.camera.position.add(step);
    this.camera.updateMatrixWorld();
    this.draw();
  }
}

/** Whether to draw plainly, because there is no graphics card; `?draw=plain` and `?draw=full` in the URL override it. */
function isPlain(): boolean {
  const request = new URLSearchParams(location.search).get("draw");
  if (request !== null) return request === "plain";
  const context = document.createElement("canvas").getContext("webgl2");
  const named = context?.getExtension("WEBGL_debug_renderer_info");
  const renderer: unknown = named ? context?.getParameter(named.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(String(renderer));
}
