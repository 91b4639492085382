/** Characters of a rig: their shared geometry, and one character in a pose. */

import * as THREE from "three";
import { forward, hipsOf, newGlobals, placeOf, type Globals } from "../../pose/kinematics";
import type { Pose, Rig } from "../../rig";
import { depthMaterial, ghostMaterial, keepUnder } from "../scene/materials";
import type { Palette } from "../scene/palette";

/** The rig's mannequin as a geometry, with each vertex relative to the joint that carries it. */
export function bodyGeometry(rig: Rig): THREE.BufferGeometry {
  const { vertices, normals, carriers, triangles } = rig.character;
  const count = carriers.length;
  const joints = new Uint16Array(4 * count);
  const weights = new Float32Array(4 * count);
  carriers.forEach((joint, i) => {
    joints[4 * i] = joint;
    weights[4 * i] = 1;
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(vertices, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
  geometry.setAttribute("skinIndex", new THREE.BufferAttribute(joints, 4));
  geometry.setAttribute("skinWeight", new THREE.BufferAttribute(weights, 4));
  geometry.setIndex(new THREE.Uint32BufferAttribute(triangles, 1));
  return geometry;
}

/** Colours the sides of a character. */
export function paint(geometry: THREE.BufferGeometry, rig: Rig, palette: Palette): void {
  const middle = new THREE.Color(palette.body);
  const colours = [
    middle,
    middle.clone().lerp(new THREE.Color(palette.left), palette.sideTint),
    middle.clone().lerp(new THREE.Color(palette.right), palette.sideTint),
  ];
  const attribute = geometry.getAttribute("color") as THREE.BufferAttribute;
  const { triangles, sides } = rig.character;
  for (let i = 0; i < triangles.length; i++) {
    const colour = colours[sides[Math.floor(i / 3)]] ?? middle;
    attribute.setXYZ(triangles[i], colour.r, colour.g, colour.b);
  }
  attribute.needsUpdate = true;
}

/** One character. Its joints are posed directly and are not part of the scene graph. */
export class Body {
  readonly group = new THREE.Group();
  readonly globals: Globals;
  private readonly skeleton: THREE.Skeleton;
  private readonly bones: THREE.Bone[];
  private readonly rotation = new THREE.Quaternion();
  private readonly place = new THREE.Vector3();
  private readonly size = new THREE.Vector3(1, 1, 1);

  constructor(
    readonly rig: Rig,
    private readonly geometry: THREE.BufferGeometry,
  ) {
    this.globals = newGlobals(rig.parents.length);
    this.bones = rig.parents.map(() => new THREE.Bone());
    const inverses = rig.parents.map(() => new THREE.Matrix4());
    this.skeleton = new THREE.Skeleton(this.bones, inverses);
  }

  /** Adds a pass with a material; passes are drawn in the order of the calls. */
  add(material: THREE.Material): THREE.SkinnedMesh {
    const mesh = new THREE.SkinnedMesh(this.geometry, material);
    mesh.bindMode = THREE.DetachedBindMode;
    mesh.bind(this.skeleton, new THREE.Matrix4());
    mesh.frustumCulled = false;
    this.group.add(mesh);
    return mesh;
  }

  pose(pose: Pose): void {
    const { positions, rotations } = forward(this.rig, pose, this.globals);
    this.bones.forEach((bone, joint) => {
      this.rotation.fromArray(rotations, 4 * joint);
      this.place.fromArray(positions, 3 * joint);
      bone.matrixWorld.compose(this.place, this.rotation, this.size);
    });
  }

  /** The place of a joint in the world. */
  at(joint: number): THREE.Vector3 {
    return placeOf(this.globals, joint).add(this.group.position);
  }

  /** Where its hips are. */
  get middle(): THREE.Vector3 {
    return this.at(hipsOf(this.rig));
  }

  dispose(): void {
    this.group.removeFromParent();
    this.skeleton.dispose();
  }
}

/** A translucent character. */
export class GhostBody {
  readonly body: Body;
  private readonly depth = depthMaterial();
  private readonly surface = ghostMaterial();
  private readonly meshes: THREE.SkinnedMesh[];

  constructor(rig: Rig, geometry: THREE.BufferGeometry) {
    this.body = new Body(rig, geometry);
    this.meshes = [this.body.add(this.depth), this.body.add(this.surface)];
  }

  /** under: it never covers the character itself. */
  look(colour: string, opacity: number, under = false): void {
    this.surface.color.set(colour);
    keepUnder(this.surface, under);
    this.surface.opacity = opacity;
  }

  /** Ghosts are drawn one after the other, the farthest first. */
  order(place: number): void {
    this.meshes.forEach((mesh, pass) => (mesh.renderOrder = 100 + 2 * place + pass));
  }

  dispose(): void {
    this.body.dispose();
    this.depth.dispose();
    this.surface.dispose();
  }
}

/** Sorts ghosts by distance for drawing. */
export function sortGhosts(ghosts: readonly GhostBody[], camera: THREE.Camera): void {
  const far = ghosts.map((ghost) => ({ ghost, distance: ghost.body.middle.distanceToSquared(camera.position) }));
  far.sort((a, b) => b.distance - a.distance).forEach(({ ghost }, place) => ghost.order(place));
}
