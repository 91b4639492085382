/** Round, square and diamond marks of a size in pixels: many in one draw call. */

import * as THREE from "three";
import { allocated, Marks } from "./marks";
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

const vertexShader = `attribute float size; attribute vec4 tint; attribute vec2 form; attribute float time;
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

const fragmentShader = `uniform vec3 rim; uniform float ratio;
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

export class Dots extends Marks<Dot> {
  constructor(order: number, onTop = false) {
    super(THREE.Points, { vertexShader, fragmentShader }, dotGeometry, order, onTop);
  }
}

export function dotGeometry(dots: readonly Dot[]): THREE.BufferGeometry {
  const { geometry, arrays } = allocated(dots.length, { position: 3, size: 1, tint: 4, form: 2, time: 1 });
  const { position, size, tint, form, time } = arrays;
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
  return geometry;
}
