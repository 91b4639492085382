/** Materials of figures. */

import * as THREE from "three";

/** Where a ghost stands in the figure, the figure is seen. */
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 4 };

/** Matte, with its colour from the vertices. */
export function bodyMaterial(): THREE.MeshStandardMaterial {
  return new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.82, metalness: 0 });
}

/** Writes depth alone, so that only a translucent figure's outer surface shows. */
export function depthMaterial(): THREE.MeshBasicMaterial {
  return new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true, ...BEHIND });
}

/** Translucent, and denser where the surface turns away: the silhouette reads, what lies behind it stays seen. */
export function ghostMaterial(): THREE.MeshLambertMaterial {
  const material = new THREE.MeshLambertMaterial({ transparent: true, depthWrite: false, ...BEHIND });
  material.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace(
      "#include <opaque_fragment>",
      `float facing = abs( dot( normalize( vViewPosition ), normal ) );
      diffuseColor.a = min( 1.0, diffuseColor.a * ( 0.62 + 1.25 * pow( 1.0 - facing, 2.0 ) ) );
      #include <opaque_fragment>`,
    );
  };
  return material;
}
