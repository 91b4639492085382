/** Materials of characters. */

import * as THREE from "three";

/** Where a ghost stands in the character, the character is seen. */
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 4 };

/** Where the character is seen, in the stencil. */
const CHARACTER = 1;

type Shader = THREE.WebGLProgramParametersWithUniforms;

/** Every vertex of a character hangs on one joint, so one matrix moves it, not a blend of four. */
function oneJoint(shader: Shader): void {
  shader.vertexShader = shader.vertexShader
    .replace("#include <skinbase_vertex>", "mat4 carrier = getBoneMatrix( skinIndex.x );")
    .replace("#include <skinnormal_vertex>", "objectNormal = mat3( carrier ) * objectNormal;")
    .replace("#include <skinning_vertex>", "transformed = ( carrier * vec4( transformed, 1.0 ) ).xyz;");
}

function withOneJoint<Kind extends THREE.Material>(
  material: Kind,
  name: string,
  more: (shader: Shader) => void = () => {},
): Kind {
  material.onBeforeCompile = (shader) => {
    oneJoint(shader);
    more(shader);
  };
  material.customProgramCacheKey = () => name;
  return material;
}

/** Matte, with its colour from the vertices. */
export function bodyMaterial(): THREE.MeshStandardMaterial {
  const stencil = { stencilWrite: true, stencilRef: CHARACTER, stencilZPass: THREE.ReplaceStencilOp };
  return withOneJoint(
    new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.82, metalness: 0, ...stencil }),
    "body",
  );
}

/** For the lamp's shadow of a character. */
export function shadowMaterial(): THREE.MeshDepthMaterial {
  return withOneJoint(new THREE.MeshDepthMaterial(), "shadow");
}

/** Writes depth alone, so that only a translucent character's outer surface shows. */
export function depthMaterial(): THREE.MeshBasicMaterial {
  return withOneJoint(new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true, ...BEHIND }), "depth");
}

/** Translucent, and denser where the surface turns away: the silhouette reads, what lies behind it stays seen. */
export function ghostMaterial(): THREE.MeshBasicMaterial {
  const material = new THREE.MeshBasicMaterial({ transparent: true, depthWrite: false, toneMapped: false, ...BEHIND });
  return withOneJoint(material, "ghost", (shader) => {
    shader.vertexShader = `varying vec2 vTurned;\n${shader.vertexShader}`.replace(
      "#include <project_vertex>",
      `#include <project_vertex>
      vec3 outward = normalize( transformedNormal );
      vTurned = vec2( dot( normalize( -mvPosition.xyz ), outward ), dot( viewMatrix[ 1 ].xyz, outward ) );`,
    );
    shader.fragmentShader = `varying vec2 vTurned;\n${shader.fragmentShader}`.replace(
      "#include <opaque_fragment>",
      `float aside = 1.0 - abs( vTurned.x );
      outgoingLight *= 0.86 + 0.24 * vTurned.y;
      diffuseColor.a = min( 1.0, diffuseColor.a * ( 0.66 + 1.1 * aside * aside ) );
      #include <opaque_fragment>`,
    );
  });
}

/** Lets nothing of a translucent character cover the character itself, or lets it again. */
export function keepUnder(material: THREE.Material, under: boolean): void {
  material.stencilWrite = under;
  material.stencilRef = CHARACTER;
  material.stencilFunc = THREE.NotEqualStencilFunc;
}
