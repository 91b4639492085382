/** Polylines of a width in pixels, with a colour, an opacity and a time at each point: many in one draw call. */

import * as THREE from "three";
import { allocated, Marks } from "./marks";

interface RibbonPoint {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly opacity?: number;
  readonly time?: number;
}

export interface Ribbon {
  readonly points: readonly RibbonPoint[];
  readonly colour: string;
  readonly width: number;
  readonly opacity?: number;
}

/** Around `now`, opacity falls from one to nothing over `span`; no span: it stays. Both in the unit of the points' times. */
export const FADE = `uniform float now; uniform float span;
  float fade( float time ) {
    if ( span <= 0.0 ) return 1.0;
    float away = abs( time - now ) / span;
    return pow( max( 0.0, 1.0 - away ), 1.35 );
  }`;

const vertexShader = `attribute vec3 before; attribute vec3 after; attribute float side; attribute float width;
  attribute vec4 tint; attribute float time;
  uniform vec2 screen;
  varying vec4 vTint; varying float vAcross; varying float vHalf;
  ${FADE}
  const float NEAR = -0.06;
  vec3 seen( vec3 p, vec3 other ) {
    return p.z > NEAR && other.z < NEAR ? mix( other, p, ( NEAR - other.z ) / ( p.z - other.z ) ) : p;
  }
  vec2 pixels( vec4 clip ) { return clip.xy / clip.w * screen * 0.5; }
  void main() {
    vec3 here = ( modelViewMatrix * vec4( position, 1.0 ) ).xyz;
    vec3 a = ( modelViewMatrix * vec4( before, 1.0 ) ).xyz;
    vec3 b = ( modelViewMatrix * vec4( after, 1.0 ) ).xyz;
    vec3 p = seen( seen( here, b ), a );
    a = seen( a, p );
    b = seen( b, p );
    vec4 clip = projectionMatrix * vec4( p, 1.0 );
    vec2 middle = pixels( clip );
    vec2 come = middle - pixels( projectionMatrix * vec4( a, 1.0 ) );
    vec2 go = pixels( projectionMatrix * vec4( b, 1.0 ) ) - middle;
    float comes = length( come ); float goes = length( go );
    come = comes > 1e-3 ? come / comes : goes > 1e-3 ? go / goes : vec2( 1.0, 0.0 );
    go = goes > 1e-3 ? go / goes : come;
    vec2 along = come + go;
    along = length( along ) > 1e-3 ? normalize( along ) : go;
    float miter = 1.0 / max( 0.4, dot( along, go ) );
    vec2 across = vec2( -along.y, along.x );
    vHalf = 0.5 * width;
    vAcross = side * ( vHalf + 1.0 );
    clip.xy += across * vAcross * miter / screen * 2.0 * clip.w;
    vTint = vec4( tint.rgb, tint.a * fade( time ) );
    gl_Position = clip;
  }`;

const fragmentShader = `varying vec4 vTint; varying float vAcross; varying float vHalf;
  void main() {
    float alpha = vTint.a * clamp( vHalf + 0.5 - abs( vAcross ), 0.0, 1.0 );
    if ( alpha < 0.004 ) discard;
    gl_FragColor = vec4( vTint.rgb, alpha );
    #include <colorspace_fragment>
  }`;

export class Ribbons extends Marks<Ribbon> {
  constructor(order: number, onTop = false) {
    super(THREE.Mesh, { vertexShader, fragmentShader }, ribbonGeometry, order, onTop);
  }
}

/** Two vertices a point, one on either side; the shader moves them apart. */
export function ribbonGeometry(ribbons: readonly Ribbon[]): THREE.BufferGeometry {
  const drawn = ribbons.filter((ribbon) => ribbon.points.length > 1);
  const count = 2 * drawn.reduce((sum, ribbon) => sum + ribbon.points.length, 0);
  const sizes = { position: 3, before: 3, after: 3, side: 1, width: 1, tint: 4, time: 1 };
  const { geometry, arrays } = allocated(count, sizes);
  const { position, before, after, side, width, tint, time } = arrays;
  const index: number[] = [];
  let at = 0;
  for (const { points, colour, width: wide, opacity = 1 } of drawn) {
    const { r, g, b } = new THREE.Color(colour);
    points.forEach((point, i) => {
      const last = points[Math.max(0, i - 1)];
      const next = points[Math.min(points.length - 1, i + 1)];
      for (const s of [-1, 1]) {
        position.set([point.x, point.y, point.z], 3 * at);
        before.set([last.x, last.y, last.z], 3 * at);
        after.set([next.x, next.y, next.z], 3 * at);
        side[at] = s;
        width[at] = wide;
        tint.set([r, g, b, opacity * (point.opacity ?? 1)], 4 * at);
        time[at] = point.time ?? 0;
        at++;
      }
      if (i + 1 < points.length) index.push(at - 2, at - 1, at, at, at - 1, at + 1);
    });
  }
  geometry.setIndex(index);
  return geometry;
}
