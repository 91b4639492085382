/** The four steps of the tour, and where its card stands. */

export interface Step {
  readonly target: "viewport" | "timeline" | "gap" | "export";
  readonly title: string;
  readonly text: string;
}

export const STEPS: readonly Step[] = [
  {
    target: "viewport",
    title: "Motion between key poses",
    text: "You set a few poses; Interpose makes the motion between them and meets each one exactly. Space plays and pauses. Drag to look around.",
  },
  {
    target: "timeline",
    title: "Time is yours to move",
    text: "Each diamond is a key pose, each bar the motion between two. Drag a diamond, and both gaps beside it are made anew while you drag.",
  },
  {
    target: "gap",
    title: "Say how it should move",
    text: "Click a bar on the timeline, and its gap shows here: choose its style, its speed, its path on the ground, and the candidate that you like best.",
  },
  {
    target: "export",
    title: "Bring your own clip",
    text: "Open a BVH of any humanoid, or drop it on the window. Export gives it back on your own skeleton, or as GLB with the figure.",
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

/** Beside the target where there is room: below, left, above; else in its own corner. */
export function cardPlace(target: Box | null, card: Size, window: Size): { left: number; top: number } {
  const fit = (value: number, size: number, room: number) => Math.max(AWAY, Math.min(room - size - AWAY, value));
  if (!target) return { left: (window.width - card.width) / 2, top: (window.height - card.height) / 2 };
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
