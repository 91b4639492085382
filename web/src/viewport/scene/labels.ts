/** Short texts in the picture, of a size in pixels, always on top. */

import * as THREE from "three";
import type { Palette } from "./palette";
import type { Stage } from "./stage";

export interface Label {
  readonly text: string;
  readonly place: THREE.Vector3;
  /** Of a dot before the text. */
  readonly colour?: string;
  readonly strong?: boolean;
}

const FONT = '12px Inter, system-ui, "Segoe UI", sans-serif';
const HEIGHT = 22;

type Drawn = { readonly sprite: THREE.Sprite; readonly texture: THREE.CanvasTexture; readonly width: number };

export class Labels {
  readonly group = new THREE.Group();
  private drawn: Drawn[] = [];
  private drawnText = "";

  /** Texts that did not change are only moved. */
  set(labels: readonly Label[], palette: Palette, { ratio, height, camera }: Pick<Stage, "ratio" | "height" | "camera">): void {
    const text = JSON.stringify([labels.map(({ text, colour, strong }) => [text, colour, strong]), palette.paper, ratio]);
    if (text !== this.drawnText) {
      this.clear();
      this.drawn = labels.map((label) => this.make(label, palette, ratio));
      this.drawnText = text;
    }
    const pixel = (2 * Math.tan(THREE.MathUtils.degToRad(camera.fov / 2))) / height;
    this.drawn.forEach(({ sprite, width }, i) => {
      sprite.position.copy(labels[i].place);
      sprite.scale.set(width * pixel, HEIGHT * pixel, 1);
    });
  }

  private clear(): void {
    for (const { sprite, texture } of this.drawn.splice(0)) {
      sprite.removeFromParent();
      sprite.material.dispose();
      texture.dispose();
    }
    this.drawnText = "";
  }

  private make(label: Label, palette: Palette, ratio: number): Drawn {
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d")!;
    const font = label.strong ? `600 ${FONT}` : FONT;
    pen.font = font;
    const dot = label.colour ? 13 : 0;
    const width = Math.ceil(pen.measureText(label.text).width) + dot + 16;
    const sharp = Math.max(2, ratio);
    canvas.width = width * sharp;
    canvas.height = HEIGHT * sharp;
    pen.scale(sharp, sharp);
    pen.font = font;
    pen.fillStyle = palette.paper;
    pen.globalAlpha = 0.92;
    pen.beginPath();
    pen.roundRect(0.5, 0.5, width - 1, HEIGHT - 1, HEIGHT / 2);
    pen.fill();
    pen.globalAlpha = 0.16;
    pen.strokeStyle = palette.ink;
    pen.stroke();
    pen.globalAlpha = 1;
    if (label.colour) {
      pen.fillStyle = label.colour;
      pen.beginPath();
      pen.arc(12, HEIGHT / 2, 4, 0, 2 * Math.PI);
      pen.fill();
    }
    pen.fillStyle = palette.ink;
    pen.textBaseline = "middle";
    pen.fillText(label.text, 8 + dot, HEIGHT / 2 + 0.5);
    const texture = new THREE.CanvasTexture(canvas);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.generateMipmaps = false;
    texture.minFilter = THREE.LinearFilter;
    const material = new THREE.SpriteMaterial({
      map: texture,
      sizeAttenuation: false,
      depthTest: false,
      depthWrite: false,
      toneMapped: false,
    });
    const sprite = new THREE.Sprite(material);
    sprite.center.set(0.5, -0.35);
    sprite.renderOrder = 900;
    this.group.add(sprite);
    return { sprite, texture, width };
  }
}
