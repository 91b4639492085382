/** Figures that can be clicked: ghosts of keys, other candidates, and, to turn its joints, the figure itself. */

import type { Body } from "./body";
import type { Candidates } from "./candidates";
import type { Ghosts } from "./ghosts";
import { hitBones, pixelsToLine, type Pointer, type Project } from "./pick";
import type { Hit, Layer } from "./pointing";
import type { Events, View } from "./types";

/** How thick a body is to the pointer, for one whose hips are a metre high. */
const THICK = 0.085;

export class Figures implements Layer {
  constructor(
    private readonly ghosts: Ghosts,
    private readonly candidates: Candidates,
    private readonly body: () => Body | null,
    private readonly view: () => View | null,
    private readonly project: Project,
    private readonly events: Pick<Events, "pickKey" | "pickCandidate" | "pickJoint">,
    private readonly changed: () => void,
  ) {}

  hit(at: Pointer): Hit | null {
    const view = this.view();
    if (!view?.rig) return null;
    const radius = THICK * view.rig.size;
    const touch = (body: Body): ReturnType<typeof hitBones> =>
      hitBones(body.rig, body.globals, body.group.position, at.ray, radius);
    const found: { distance: number; hit: Hit | null }[] = [];
    const own = this.body();
    const onBody = own?.group.visible ? touch(own) : null;
    if (onBody) {
      const turns = view.tool === "rotate" && view.editable;
      const hit = turns
        ? { id: `joint ${onBody.joint}`, cursor: "pointer", click: () => this.events.pickJoint(onBody.joint) }
        : null;
      found.push({ distance: onBody.distance, hit });
    }
    if (view.show.ghosts) {
      for (const { ghost, figure } of this.ghosts.bodies) {
        const met = figure.body.group.visible ? touch(figure.body) : null;
        const hit = { id: `key ${ghost.key}`, cursor: "pointer", click: () => this.events.pickKey(ghost.key) };
        if (met) found.push({ distance: met.distance, hit });
      }
    }
    for (const { index, figure } of this.candidates.figures) {
      const met = touch(figure.body);
      if (met) found.push({ distance: met.distance, hit: this.candidateHit(index) });
    }
    if (found.length > 0) return found.reduce((a, b) => (b.distance < a.distance ? b : a)).hit;
    return this.wayHit(at, view);
  }

  hover(id: Hit["id"] | null): void {
    const [kind, name] =
      typeof id === "string" ? [id.slice(0, id.indexOf(" ")), id.slice(id.indexOf(" ") + 1)] : ["", ""];
    this.ghosts.hovered = kind === "key" ? name : null;
    this.candidates.hovered = kind === "candidate" ? Number(name) : null;
    this.changed();
  }

  private candidateHit(index: number): Hit {
    return { id: `candidate ${index}`, cursor: "pointer", click: () => this.events.pickCandidate(index) };
  }

  private wayHit(at: Pointer, view: View): Hit | null {
    let best: { index: number; far: number } | null = null;
    for (const { index } of this.candidates.figures) {
      if (view.candidates[index]?.chosen) continue;
      const far = pixelsToLine(this.candidates.ways[index]?.map(this.project) ?? [], at.x, at.y);
      if (far < 6 + at.slack && (!best || far < best.far)) best = { index, far };
    }
    return best && this.candidateHit((best as { index: number }).index);
  }
}
