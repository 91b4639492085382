/** Picking of ghosts, of other candidates, and of the joints of the character itself. */

import type { Body } from "../characters/body";
import type { Candidates } from "../characters/candidates";
import type { Ghosts } from "../characters/ghosts";
import { closest, hitBones, pixelsToPolyline, type Pointer, type Project } from "./geometry";
import type { Hit, Layer } from "./pointing";
import type { Events, View } from "../types";

/** How thick a body is to the pointer, for one whose hips are a metre high. */
const THICK = 0.085;

export class CharacterPicking implements Layer {
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
      for (const { ghost, character } of this.ghosts.bodies) {
        const met = character.body.group.visible ? touch(character.body) : null;
        const hit = { id: `key ${ghost.key}`, cursor: "pointer", click: () => this.events.pickKey(ghost.key) };
        if (met) found.push({ distance: met.distance, hit });
      }
    }
    for (const { index, character } of this.candidates.characters) {
      const met = touch(character.body);
      if (met) found.push({ distance: met.distance, hit: this.candidateHit(index) });
    }
    if (found.length > 0) return found.reduce((a, b) => (b.distance < a.distance ? b : a)).hit;
    return this.trackHit(at);
  }

  hover(id: Hit["id"] | null): void {
    const [, kind, name] = /^(\w+) (.+)$/s.exec(String(id)) ?? [];
    this.ghosts.hovered = kind === "key" ? name : null;
    this.candidates.hovered = kind === "candidate" ? Number(name) : null;
    this.changed();
  }

  private candidateHit(index: number): Hit {
    return { id: `candidate ${index}`, cursor: "pointer", click: () => this.events.pickCandidate(index) };
  }

  private trackHit(at: Pointer): Hit | null {
    const { characters, tracks } = this.candidates;
    const far = ({ index }: { index: number }): number =>
      pixelsToPolyline(tracks[index]?.map(this.project) ?? [], at.x, at.y);
    const nearest = closest(characters, far, 6 + at.slack);
    return nearest === null ? null : this.candidateHit(characters[nearest].index);
  }
}
