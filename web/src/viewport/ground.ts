/** What stands around the figure: a sky that runs into the ground, a fading grid, and the shadow on it. */

import * as THREE from "three";
import type { Palette } from "./palette";

const REACH = 60;

const dome = {
  vertex: `varying vec3 vWay;
    void main() {
      vWay = position;
      vec4 p = projectionMatrix * vec4( mat3( viewMatrix ) * position, 1.0 );
      gl_Position = p.xyww;
    }`,
  fragment: `uniform vec3 sky; uniform vec3 horizon; uniform vec3 ground;
    varying vec3 vWay;
    float noise( vec2 p ) { return fract( sin( dot( p, vec2( 12.9898, 78.233 ) ) ) * 43758.5453 ); }
    void main() {
      float y = normalize( vWay ).y;
      vec3 colour = mix( horizon, ground, smoothstep( 0.0, -0.32, y ) );
      colour = mix( colour, sky, smoothstep( -0.02, 0.4, y ) );
      gl_FragColor = vec4( colour, 1.0 );
      #include <colorspace_fragment>
      gl_FragColor.rgb += ( noise( gl_FragCoord.xy ) - 0.5 ) / 255.0;
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
    float lines( vec2 p, float wide ) {
      vec2 per = fwidth( p );
      vec2 near = abs( fract( p - 0.5 ) - 0.5 ) / per;
      vec2 line = 1.0 - smoothstep( wide - 0.5, wide + 0.5, near );
      line *= 1.0 - smoothstep( 0.12, 0.42, per );
      return max( line.x, line.y );
    }
    void main() {
      float away = length( vPlace.xz - focus.xz ) / reach;
      float fade = exp( -2.6 * away * away ) * ( 1.0 - smoothstep( 0.75, 1.0, away ) );
      float slant = abs( normalize( cameraPosition - vPlace ).y );
      fade *= smoothstep( 0.0, 0.16, slant );
      float fine = lines( vPlace.xz / unit * 5.0, 0.5 ) * 0.1 * exp( -14.0 * away * away );
      float metre = lines( vPlace.xz / unit, 0.6 ) * 0.27;
      float strong = lines( vPlace.xz / unit / 5.0, 0.8 ) * 0.24;
      float alpha = max( max( fine, metre ), metre + strong ) * fade;
      gl_FragColor = vec4( colour, alpha );
      #include <colorspace_fragment>
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
  private readonly lines = new THREE.ShaderMaterial({
    vertexShader: grid.vertex,
    fragmentShader: grid.fragment,
    uniforms: { colour: colour(), focus: { value: new THREE.Vector3() }, reach: { value: 12 }, unit: { value: 1 } },
    transparent: true,
    depthWrite: false,
    side: THREE.DoubleSide,
  });
  private readonly shade = new THREE.ShadowMaterial({ transparent: true, depthWrite: false });
  private readonly ball = new THREE.SphereGeometry(10, 24, 16);
  private readonly floor = new THREE.PlaneGeometry(2 * REACH, 2 * REACH).rotateX(-Math.PI / 2);
  private readonly plane = new THREE.Mesh(this.floor, this.lines);
  private readonly shadow = new THREE.Mesh(this.floor, this.shade);

  constructor() {
    const sky = new THREE.Mesh(this.ball, this.sky);
    sky.frustumCulled = false;
    sky.renderOrder = -10;
    this.plane.renderOrder = -8;
    this.shadow.renderOrder = -9;
    this.shadow.receiveShadow = true;
    this.group.add(sky, this.plane, this.shadow);
  }

  paint(palette: Palette): void {
    this.sky.uniforms.sky.value.set(palette.sky);
    this.sky.uniforms.horizon.value.set(palette.horizon);
    this.sky.uniforms.ground.value.set(palette.ground);
    this.lines.uniforms.colour.value.set(palette.grid);
    this.shade.color.set(palette.shadow);
    this.shade.opacity = palette.shadowStrength;
  }

  /** The grid fades around `focus`, farther where the camera is farther. */
  look(focus: THREE.Vector3, distance: number): void {
    this.lines.uniforms.focus.value.copy(focus);
    this.lines.uniforms.reach.value = Math.min(REACH, Math.max(7, 2.2 * distance));
    this.plane.position.set(Math.round(focus.x), 0, Math.round(focus.z));
    this.shadow.position.copy(this.plane.position);
  }

  dispose(): void {
    for (const held of [this.sky, this.lines, this.shade, this.ball, this.floor]) held.dispose();
  }
}

function colour(): { value: THREE.Color } {
  return { value: new THREE.Color() };
}
