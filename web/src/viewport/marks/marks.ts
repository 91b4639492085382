/** Base of dots, ribbons and decals: one object with a shader, whose geometry is rebuilt on each change. */

import * as THREE from "three";

type Drawn = THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> | THREE.Points<THREE.BufferGeometry, THREE.ShaderMaterial>;
type Kind = new (geometry: THREE.BufferGeometry, material: THREE.ShaderMaterial) => Drawn;

export abstract class Marks<Mark> {
  readonly object: Drawn;

  protected constructor(
    kind: Kind,
    shaders: { readonly vertexShader: string; readonly fragmentShader: string },
    private readonly geometry: (marks: readonly Mark[]) => THREE.BufferGeometry,
    order: number,
    onTop = false,
  ) {
    const [screen, ratio, rim] = [{ value: new THREE.Vector2() }, { value: 1 }, { value: new THREE.Color() }];
    const material = new THREE.ShaderMaterial({
      ...shaders,
      uniforms: { screen, ratio, rim, now: { value: 0 }, span: { value: 0 } },
      transparent: true,
      depthWrite: false,
      depthTest: !onTop,
      side: THREE.DoubleSide,
    });
    this.object = new kind(new THREE.BufferGeometry(), material);
    this.object.frustumCulled = false;
    this.object.renderOrder = order;
    this.object.visible = false;
    this.object.onBeforeRender = (renderer) => {
      renderer.getSize(screen.value);
      ratio.value = renderer.getPixelRatio();
    };
  }

  /** `rim`: the colour of the rims of dots. */
  set(marks: readonly Mark[], rim?: string): void {
    this.object.geometry.dispose();
    this.object.geometry = this.geometry(marks);
    this.object.visible = this.object.geometry.getAttribute("position").count > 0;
    if (rim) this.object.material.uniforms.rim.value.set(rim);
  }

  /** Marks are fainter the farther their time is from `now`, and gone at `span`. */
  fade(now: number, span: number): void {
    this.object.material.uniforms.now.value = now;
    this.object.material.uniforms.span.value = span;
  }
}

/** A geometry of `count` vertices with attributes of so many floats each, and their arrays, to be filled. */
export function allocated<Name extends string>(
  count: number,
  sizes: Readonly<Record<Name, number>>,
): { geometry: THREE.BufferGeometry; arrays: Record<Name, Float32Array> } {
  const geometry = new THREE.BufferGeometry();
  const arrays = {} as Record<Name, Float32Array>;
  for (const name in sizes) {
    arrays[name] = new Float32Array(sizes[name] * count);
    geometry.setAttribute(name, new THREE.BufferAttribute(arrays[name], sizes[name]));
  }
  return { geometry, arrays };
}
