/** Soft marks that lie on the ground: many in one draw call. */

import * as THREE from "three";
import { allocated, Marks } from "./marks";
import { FADE } from "./ribbons";

/** glow: soft towards its edge. sole: the print of a foot. arrow: points along. disc: filled. ring: its rim alone. */
export type Mark = "glow" | "sole" | "arrow" | "disc" | "ring";

export interface Decal {
  readonly x: number;
  readonly z: number;
  readonly y?: number;
  /** Radians from +Z towards +X. */
  readonly angle?: number;
  /** Metres across and along. */
  readonly width: number;
  readonly length?: number;
  readonly mark: Mark;
  readonly colour: string;
  readonly opacity?: number;
  readonly time?: number;
}

const MARKS: readonly Mark[] = ["glow", "sole", "arrow", "disc", "ring"];
/** Above the ground, so that nothing flickers where marks lie on it. */
export const LIFT = 0.004;

const vertexShader = `attribute vec2 corner; attribute vec4 tint; attribute float mark; attribute float time;
  varying vec4 vTint; varying vec2 vCorner; varying float vMark;
  ${FADE}
  void main() {
    vTint = vec4( tint.rgb, tint.a * fade( time ) );
    vCorner = corner;
    vMark = mark;
    gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
  }`;

const fragmentShader = `varying vec4 vTint; varying vec2 vCorner; varying float vMark;
  float edge( float d ) { float w = max( fwidth( d ), 1e-4 ); return 1.0 - smoothstep( -w, w, d ); }
  float oval( vec2 p, vec2 c, vec2 r ) { vec2 q = ( p - c ) / r; return ( length( q ) - 1.0 ) * min( r.x, r.y ); }
  float join( float a, float b, float k ) {
    float h = clamp( 0.5 + 0.5 * ( b - a ) / k, 0.0, 1.0 );
    return mix( b, a, h ) - k * h * ( 1.0 - h );
  }
  void main() {
    vec2 p = vCorner;
    float alpha;
    if ( vMark < 0.5 ) { float r = length( p ); alpha = pow( max( 0.0, 1.0 - r ), 1.5 ); }
    else if ( vMark < 1.5 ) {
      float front = oval( p, vec2( 0.0, 0.38 ), vec2( 0.78, 0.6 ) );
      float heel = oval( p, vec2( 0.0, -0.52 ), vec2( 0.62, 0.46 ) );
      alpha = edge( join( front, heel, 0.7 ) + 0.05 );
    }
    else if ( vMark < 2.5 ) {
      float d = max( abs( p.x ) * 0.9 + p.y * 0.45 - 0.42, -p.y - 0.72 + 0.34 * ( 1.0 - abs( p.x ) ) );
      alpha = edge( d );
    }
    else if ( vMark < 3.5 ) alpha = edge( length( p ) - 0.97 );
    else alpha = edge( abs( length( p ) - 0.9 ) - 0.07 );
    alpha *= vTint.a;
    if ( alpha < 0.004 ) discard;
    gl_FragColor = vec4( vTint.rgb, alpha );
    #include <colorspace_fragment>
  }`;

const CORNERS: readonly (readonly [number, number])[] = [
  [-1, -1],
  [1, -1],
  [-1, 1],
  [1, 1],
];

export class Decals extends Marks<Decal> {
  constructor(order: number) {
    super(THREE.Mesh, { vertexShader, fragmentShader }, decalGeometry, order);
  }
}

export function decalGeometry(decals: readonly Decal[]): THREE.BufferGeometry {
  const sizes = { position: 3, corner: 2, tint: 4, mark: 1, time: 1 };
  const { geometry, arrays } = allocated(4 * decals.length, sizes);
  const { position, corner, tint, mark, time } = arrays;
  const index: number[] = [];
  decals.forEach((decal, i) => {
    const { r, g, b } = new THREE.Color(decal.colour);
    const [sin, cos] = [Math.sin(decal.angle ?? 0), Math.cos(decal.angle ?? 0)];
    CORNERS.forEach(([u, v], k) => {
      const at = 4 * i + k;
      const [across, along] = [0.5 * u * decal.width, 0.5 * v * (decal.length ?? decal.width)];
      const [x, z] = [decal.x + across * cos + along * sin, decal.z - across * sin + along * cos];
      position.set([x, decal.y ?? LIFT, z], 3 * at);
      corner.set([u, v], 2 * at);
      tint.set([r, g, b, decal.opacity ?? 1], 4 * at);
      mark[at] = MARKS.indexOf(decal.mark);
      time[at] = decal.time ?? 0;
    });
    index.push(4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3);
  });
  geometry.setIndex(index);
  return geometry;
}
