/** The four steps of the tour, and the placement of its card. */

export interface Step {
  readonly target: "viewport" | "timeline" | "gap" | "export";
  readonly title: string;
  readonly text: string;
}

export const STEPS: readonly Step[] = [
  {
    target: "viewport",
    title: "Motion between key poses",
    text: "Set a few key poses, and Interpose generates the motion between them, exact at each pose. Press Space to play; drag to look around.",
  },
  {
    target: "timeline",
    title: "Keys on the timeline",
    text: "Each diamond is a key pose, each bar the gap between two. Drag a diamond, and the gaps beside it are regenerated as you drag.",
  },
  {
    target: "gap",
    title: "Control the motion",
    text: "Click a bar to select its gap. Then choose a style, a speed, a path on the ground, and the best of several candidates.",
  },
  {
    target: "export",
    title: "Use your own clip",
    text: "Open the BVH file of any humanoid, or drop it on the window. Export as BVH on your own skeleton, or as GLB with a mannequin.",
  },
];

interface Size {
  readonly width: number;
  readonly height: number;
}
interface Box extends Size {
  readonly left: number;
  readonly top: number;
}

const AWAY = 16;

/** Next to the target, where there is room: below, left or above; otherwise in its corner. */
export function cardPlace(target: Box, card: Size, window: Size): { left: number; top: number } {
  const fit = (value: number, size: number, room: number) => Math.max(AWAY, Math.min(room - size - AWAY, value));
  const { left, top, width, height } = target;
  const middle = {
    left: fit(left + width / 2 - card.width / 2, card.width, window.width),
    top: fit(top + height / 2 - card.height / 2, card.height, window.height),
  };
  const corner = { left: left + 2 * AWAY, top: top + height - card.height - 2 * AWAY };
  if (top + height + AWAY + card.height + AWAY <= window.height) return { left: middle.left, top: top + height + AWAY };
  if (width < window.width / 2 && left - AWAY - card.width >= AWAY) return { left: left - AWAY - card.width, top: middle.top };
  if (top - AWAY - card.height >= AWAY) return { left: middle.left, top: top - AWAY - card.height };
  return corner;
}
