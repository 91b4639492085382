/** Round, square and diamond marks of a size in pixels: many in one draw call. */

import * as THREE from "three";
import { Marks } from "./marks";
import { FADE } from "./ribbons";

export type Shape = "disc" | "diamond" | "square";

export interface Dot {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly size: number;
  readonly colour: string;
  readonly opacity?: number;
  /** Pixels of a rim in the rim's colour. */
  readonly rim?: number;
  readonly shape?: Shape;
  readonly time?: number;
}

const SHAPES: readonly Shape[] = ["disc", "diamond", "square"];

const vertex = `attribute float size; attribute vec4 tint; attribute vec2 form; attribute float time;
  uniform float ratio;
  varying vec4 vTint; varying float vSize; varying vec2 vForm;
  ${FADE}
  void main() {
    vTint = vec4( tint.rgb, tint.a * fade( time ) );
    vSize = size + 2.0;
    vForm = form;
    gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
    gl_PointSize = vTint.a < 0.004 ? 0.0 : vSize * ratio;
  }`;

const fragment = `uniform vec3 rim; uniform float ratio;
  varying vec4 vTint; varying float vSize; varying vec2 vForm;
  void main() {
    vec2 p = ( gl_PointCoord - 0.5 ) * vSize;
    float far = length( p );
    if ( vForm.y > 1.5 ) { vec2 q = abs( p ) - vec2( 0.5 * vSize - 3.0 ); far = length( max( q, 0.0 ) ) + min( max( q.x, q.y ), 0.0 ) + 0.5 * vSize - 1.0; }
    else if ( vForm.y > 0.5 ) far = ( abs( p.x ) + abs( p.y ) ) * 0.92;
    float edge = 0.5 * vSize - 1.0 - far;
    float soft = 0.5 / ratio;
    float alpha = vTint.a * smoothstep( -soft, soft, edge );
    if ( alpha < 0.004 ) discard;
    float inside = vForm.x > 0.0 ? smoothstep( -soft, soft, edge - vForm.x ) : 1.0;
    gl_FragColor = vec4( mix( rim, vTint.rgb, inside ), alpha );
    #include <colorspace_fragment>
  }`;

export class Dots extends Marks<Dot, THREE.Points<THREE.BufferGeometry, THREE.ShaderMaterial>> {
  constructor(order: number, onTop = false) {
    const material = new THREE.ShaderMaterial({
      vertexShader: vertex,
      fragmentShader: fragment,
      uniforms: { ratio: { value: 1 }, rim: { value: new THREE.Color() }, now: { value: 0 }, span: { value: 0 } },
      transparent: true,
      depthWrite: false,
    });
    super(new THREE.Points(new THREE.BufferGeometry(), material), order, onTop);
  }

  get points(): THREE.Points {
    return this.object;
  }

  rim(colour: string): void {
    this.material.uniforms.rim.value.set(colour);
  }

  screen(ratio: number): void {
    this.material.uniforms.ratio.value = ratio;
  }

  protected geometry(marks: readonly Dot[]): THREE.BufferGeometry {
    return dotGeometry(marks);
  }
}

export function dotGeometry(dots: readonly Dot[]): THREE.BufferGeometry {
  const count = dots.length;
  const position = new Float32Array(3 * count);
  const size = new Float32Array(count);
  const tint = new Float32Array(4 * count);
  const form = new Float32Array(2 * count);
  const time = new Float32Array(count);
  const colours = new Map<string, THREE.Color>();
  dots.forEach((dot, i) => {
    const colour = colours.get(dot.colour) ?? new THREE.Color(dot.colour);
    colours.set(dot.colour, colour);
    position.set([dot.x, dot.y, dot.z], 3 * i);
    size[i] = dot.size;
    tint.set([colour.r, colour.g, colour.b, dot.opacity ?? 1], 4 * i);
    form.set([dot.rim ?? 0, SHAPES.indexOf(dot.shape ?? "disc")], 2 * i);
    time[i] = dot.time ?? 0;
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("size", new THREE.BufferAttribute(size, 1));
  geometry.setAttribute("tint", new THREE.BufferAttribute(tint, 4));
  geometry.setAttribute("form", new THREE.BufferAttribute(form, 2));
  geometry.setAttribute("time", new THREE.BufferAttribute(time, 1));
  return geometry;
}
