/** Draws thumbnails of a motion: a few silhouettes along its path, seen from the side. */

import { aboveHips, forward, hipsOf } from "../../pose/kinematics";
import { headingOf } from "../../pose/place";
import { row, type Rig } from "../../rig";
import { palettes, type Palette, type Theme } from "../scene/palette";

const CHARACTERS = 6;
/** Of a character whose hips are a metre high: from one silhouette to the next at least, and around the characters. */
const APART = 0.34;
const AROUND = 0.16;

interface Stroke {
  /** Joints of the humanoid that it runs through, and its thickness at a hip height of one metre. */
  readonly through: readonly string[];
  readonly thick: number;
  readonly side: "left" | "right" | null;
}

const LIMB_STROKES: readonly Stroke[] = (["Left", "Right"] as const).flatMap((name) => {
  const side = name === "Left" ? "left" : "right";
  return [
    { through: ["UpLeg", "Leg"].map((part) => name + part), thick: 0.14, side },
    { through: ["Leg", "Foot"].map((part) => name + part), thick: 0.1, side },
    { through: ["Foot", "Toe"].map((part) => name + part), thick: 0.085, side },
    { through: ["Arm", "ForeArm"].map((part) => name + part), thick: 0.095, side },
    { through: ["ForeArm", "Hand"].map((part) => name + part), thick: 0.08, side },
  ];
});

const BODY_STROKES: readonly Stroke[] = [
  { through: ["Hips", "Spine", "Spine1", "Spine2", "Neck"], thick: 0.2, side: null },
  { through: ["Neck", "Head"], thick: 0.09, side: null },
];

/** A joint in the drawing: along the path, up, and towards the viewer. */
interface Spot {
  readonly x: number;
  readonly y: number;
  readonly near: number;
}

/** Draws `frames` rows on a canvas of the size that it has on the page. */
export function drawThumbnail(
  canvas: HTMLCanvasElement,
  rig: Rig,
  rows: Float32Array,
  frames: number,
  theme: Theme,
): void {
  const ratio = Math.max(1, globalThis.devicePixelRatio || 1);
  const [width, height] = [canvas.clientWidth || 120, canvas.clientHeight || 72];
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  if (!pen) return;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  if (frames < 1 || rows.length < rig.stride) return;
  const palette = palettes[theme];
  const characters = silhouettes(rig, rows, frames);
  const all = characters.flat();
  const pad = AROUND * rig.size;
  const left = Math.min(...all.map(({ x }) => x)) - pad;
  const right = Math.max(...all.map(({ x }) => x)) + pad;
  const top = Math.max(...all.map(({ y }) => y)) + 1.4 * pad;
  const bottom = Math.min(0, ...all.map(({ y }) => y)) - 0.5 * pad;
  const scale = Math.min((width - 4) / (right - left), (height - 4) / (top - bottom));
  const put = ({ x, y }: Spot): [number, number] => [
    0.5 * width + (x - 0.5 * (left + right)) * scale,
    height - 2 - (y - bottom) * scale,
  ];
  const floor = put({ x: 0, y: 0, near: 0 })[1];
  pen.fillStyle = palette.faint;
  pen.globalAlpha = 0.35;
  pen.fillRect(0, Math.round(floor * ratio) / ratio, width, 1 / ratio);
  characters.forEach((spots, i) => {
    const share = characters.length > 1 ? i / (characters.length - 1) : 1;
    character(pen, rig, spots, put, scale * rig.size, 0.26 + 0.74 * share ** 1.6, palette);
  });
  pen.globalAlpha = 1;
}

/** The joints of some frames as drawn: along the path, or side by side if the motion stays in place. */
export function silhouettes(rig: Rig, rows: Float32Array, frames: number): Spot[][] {
  const count = Math.min(CHARACTERS, frames);
  const chosen = Array.from({ length: count }, (_, i) =>
    count > 1 ? Math.round((i * (frames - 1)) / (count - 1)) : frames - 1,
  );
  const poses = chosen.map((frame) => row(rows, rig.stride, frame));
  const placed = poses.map((pose) => forward(rig, pose).positions);
  const [x0, z0] = [placed[0][3 * hipsOf(rig)], placed[0][3 * hipsOf(rig) + 2]];
  const last = placed[placed.length - 1];
  const [dx, dz] = [last[3 * hipsOf(rig)] - x0, last[3 * hipsOf(rig) + 2] - z0];
  const long = Math.hypot(dx, dz);
  const least = APART * rig.size * (count - 1);
  const heading = long > 0.3 * rig.size ? Math.atan2(dx, dz) : headingOf(rig, poses[0]);
  const [ax, az] = [Math.sin(heading), Math.cos(heading)];
  const body = rig.parents.map((_, joint) => (aboveHips(rig, joint) ? hipsOf(rig) : joint));
  return placed.map((positions, i) => {
    const extra = long < least && count > 1 ? ((least - long) * i) / (count - 1) : 0;
    return body.map((joint): Spot => {
      const [x, z] = [positions[3 * joint] - x0, positions[3 * joint + 2] - z0];
      return { x: x * ax + z * az + extra, y: positions[3 * joint + 1], near: z * ax - x * az };
    });
  });
}

function character(
  pen: CanvasRenderingContext2D,
  rig: Rig,
  spots: readonly Spot[],
  put: (spot: Spot) => [number, number],
  scale: number,
  strength: number,
  palette: Palette,
): void {
  pen.lineCap = pen.lineJoin = "round";
  for (const { spots: through, thick, side } of strokesOf(rig, spots)) {
    const tint = side === null ? palette.faint : mixed(palette.faint, palette[side], 0.55);
    // An opaque stroke first keeps what lies behind from showing through, then the colour by its strength.
    pen.strokeStyle = mixed(palette.paper, tint, strength);
    pen.globalAlpha = 1;
    pen.lineWidth = Math.max(1.2, thick * scale);
    pen.beginPath();
    through.forEach((spot, i) => (i === 0 ? pen.moveTo(...put(spot)) : pen.lineTo(...put(spot))));
    pen.stroke();
  }
  const head = rig.humanoid.Head;
  if (head === undefined) return;
  const neck = rig.humanoid.Neck ?? rig.parents[head];
  const [from, to] = [spots[neck] ?? spots[head], spots[head]];
  const long = Math.hypot(to.x - from.x, to.y - from.y) || 1;
  const up = (0.09 * rig.size) / long;
  const [x, y] = put({ x: to.x + (to.x - from.x) * up, y: to.y + (to.y - from.y) * up, near: 0 });
  pen.fillStyle = mixed(palette.paper, palette.faint, strength);
  pen.beginPath();
  pen.ellipse(x, y, 0.085 * scale, 0.105 * scale, 0, 0, 2 * Math.PI);
  pen.fill();
}

/** What is farther away comes first. A rig that is not a humanoid is drawn bone by bone. */
function strokesOf(rig: Rig, spots: readonly Spot[]): { spots: Spot[]; thick: number; side: Stroke["side"] }[] {
  const made = [...LIMB_STROKES, ...BODY_STROKES].flatMap(({ through, thick, side }) => {
    const found = through.map((name) => spots[rig.humanoid[name] ?? -1]).filter((spot) => spot !== undefined);
    return found.length > 1 ? [{ spots: found, thick, side }] : [];
  });
  const bones = rig.parents.flatMap((parent, joint) =>
    parent < 0 ? [] : [{ spots: [spots[parent], spots[joint]], thick: 0.07, side: null }],
  );
  const depth = (stroke: { spots: Spot[] }): number =>
    stroke.spots.reduce((sum, { near }) => sum + near, 0) / stroke.spots.length;
  return (made.length > 4 ? made : bones).sort((a, b) => depth(a) - depth(b));
}

/** Between two colours that are written as #rrggbb. */
export function mixed(a: string, b: string, share: number): string {
  const part = (colour: string, i: number): number => Number.parseInt(colour.slice(1 + 2 * i, 3 + 2 * i), 16);
  const mix = [0, 1, 2].map((i) => Math.round(part(a, i) + share * (part(b, i) - part(a, i))));
  return `#${mix.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}
