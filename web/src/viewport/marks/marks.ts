/** Base of dots, ribbons and decals: one object with a shader, whose geometry is rebuilt on each change. */

import * as THREE from "three";

type Shaded = THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> | THREE.Points<THREE.BufferGeometry, THREE.ShaderMaterial>;

export abstract class Marks<Mark, Drawn extends Shaded> {
  protected constructor(
    protected readonly object: Drawn,
    order: number,
    onTop = false,
  ) {
    object.frustumCulled = false;
    object.renderOrder = order;
    object.visible = false;
    object.material.depthTest = !onTop;
  }

  get material(): THREE.ShaderMaterial {
    return this.object.material;
  }

  set(marks: readonly Mark[]): void {
    this.object.geometry.dispose();
    this.object.geometry = this.geometry(marks);
    this.object.visible = this.object.geometry.getAttribute("position").count > 0;
  }

  /** Marks are fainter the farther their time is from `now`, and gone at `span`. */
  fade(now: number, span: number): void {
    this.material.uniforms.now.value = now;
    this.material.uniforms.span.value = span;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.object.geometry.dispose();
    this.material.dispose();
  }

  protected abstract geometry(marks: readonly Mark[]): THREE.BufferGeometry;
}
