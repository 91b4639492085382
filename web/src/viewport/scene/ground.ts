/** What stands around the character: a sky that runs into the ground, a fading grid, and the shadow on it. */

import * as THREE from "three";
import type { Palette } from "./palette";

const REACH = 60;

const dome = {
  vertex: `uniform vec3 sky; uniform vec3 horizon; uniform vec3 ground;
    varying vec3 vColour;
    void main() {
      float y = normalize( position ).y;
      vec3 low = mix( horizon, ground, smoothstep( 0.0, -0.32, y ) );
      vColour = mix( low, sky, smoothstep( -0.02, 0.4, y ) );
      vec4 p = projectionMatrix * vec4( mat3( viewMatrix ) * position, 1.0 );
      gl_Position = p.xyww;
    }`,
  fragment: `varying vec3 vColour;
    float noise( vec2 p ) { return fract( sin( dot( p, vec2( 12.9898, 78.233 ) ) ) * 43758.5453 ); }
    void main() {
      gl_FragColor = vec4( vColour + ( noise( gl_FragCoord.xy ) - 0.5 ) / 255.0, 1.0 );
    }`,
};

const grid = {
  vertex: `varying vec3 vPlace;
    void main() {
      vec4 p = modelMatrix * vec4( position, 1.0 );
      vPlace = p.xyz;
      gl_Position = projectionMatrix * viewMatrix * p;
    }`,
  fragment: `uniform vec3 colour; uniform vec3 focus; uniform float reach; uniform float unit;
    varying vec3 vPlace;
    float grid( vec2 p, float wide ) {
      vec2 per = fwidth( p );
      vec2 near = abs( fract( p - 0.5 ) - 0.5 ) / per;
      vec2 rule = 1.0 - smoothstep( wide - 0.5, wide + 0.5, near );
      rule *= 1.0 - smoothstep( 0.12, 0.42, per );
      return max( rule.x, rule.y );
    }
    void main() {
      float away = length( vPlace.xz - focus.xz ) / reach;
      float fade = exp( -2.6 * away * away ) * ( 1.0 - smoothstep( 0.75, 1.0, away ) );
      float slant = abs( normalize( cameraPosition - vPlace ).y );
      fade *= smoothstep( 0.0, 0.16, slant );
      if ( fade < 0.01 ) discard;
      float fine = grid( vPlace.xz / unit * 5.0, 0.5 ) * 0.1 * exp( -14.0 * away * away );
      float metre = grid( vPlace.xz / unit, 0.6 ) * 0.27;
      float strong = grid( vPlace.xz / unit / 5.0, 0.8 ) * 0.24;
      float alpha = max( max( fine, metre ), metre + strong ) * fade;
      gl_FragColor = vec4( colour, alpha );
    }`,
};

export class Ground {
  readonly group = new THREE.Group();
  private readonly sky = new THREE.ShaderMaterial({
    vertexShader: dome.vertex,
    fragmentShader: dome.fragment,
    uniforms: { sky: colour(), horizon: colour(), ground: colour() },
    side: THREE.BackSide,
    depthWrite: false,
    depthTest: false,
  });
  private readonly grid = new THREE.ShaderMaterial({
    vertexShader: grid.vertex,
    fragmentShader: grid.fragment,
    uniforms: { colour: colour(), focus: { value: new THREE.Vector3() }, reach: { value: 12 }, unit: { value: 1 } },
    transparent: true,
    depthWrite: false,
    side: THREE.DoubleSide,
  });
  private readonly dark = new THREE.ShadowMaterial({ transparent: true, depthWrite: false });
  private readonly floor = new THREE.PlaneGeometry(2, 2).rotateX(-Math.PI / 2);
  private readonly plane = new THREE.Mesh(this.floor, this.grid);
  private readonly shadow = new THREE.Mesh(this.floor, this.dark);

  constructor() {
    const sky = new THREE.Mesh(new THREE.SphereGeometry(10, 12, 48), this.sky);
    sky.frustumCulled = false;
    sky.renderOrder = -10;
    this.plane.renderOrder = -8;
    this.shadow.renderOrder = -9;
    this.shadow.receiveShadow = true;
    this.group.add(sky, this.plane, this.shadow);
  }

  paint(palette: Palette): void {
    // These shaders write colours as they are on the screen, which spares a conversion for each pixel.
    const { sky, horizon, ground } = this.sky.uniforms;
    for (const [to, from] of [
      [sky, palette.sky],
      [horizon, palette.horizon],
      [ground, palette.ground],
      [this.grid.uniforms.colour, palette.grid],
    ] as const) {
      to.value.set(from).convertLinearToSRGB();
    }
    this.dark.color.set(palette.shadow);
    this.dark.opacity = palette.shadowStrength;
  }

  /** The grid fades around `focus`, farther where the camera is farther. */
  look(focus: THREE.Vector3, distance: number): void {
    this.grid.uniforms.focus.value.copy(focus);
    this.grid.uniforms.reach.value = Math.min(REACH, Math.max(7, 2.2 * distance));
    this.plane.position.set(focus.x, 0, focus.z);
    this.plane.scale.setScalar(this.grid.uniforms.reach.value);
  }

  /** Only so much of the ground as can be in the shadow is looked up in its map. */
  shade(middle: THREE.Vector3, reach: number): void {
    this.shadow.position.set(middle.x, 0, middle.z);
    this.shadow.scale.setScalar(reach);
  }
}

function colour(): { value: THREE.Color } {
  return { value: new THREE.Color() };
}
