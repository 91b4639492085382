/** Distributes pointer events to layers and the orbit control. */

import { Raycaster, Vector2 } from "three";
import type { Pointer } from "./geometry";
import type { Stage } from "../scene/stage";

export interface Drag {
  move(at: Pointer): void;
  end(): void;
  /** Everything as it was before. */
  cancel(): void;
}

/** Something under the pointer. What can be grabbed keeps the orbit still; what can only be clicked does not. */
export interface Hit {
  readonly id: string | number;
  readonly cursor: string;
  click?(): void;
  grab?(at: Pointer): Drag | null;
}

/** A part of the scene that reacts to the pointer. The first layer with a hit gets the event. */
export interface Layer {
  hit(at: Pointer): Hit | null;
  hover?(id: Hit["id"] | null): void;
  double?(at: Pointer): boolean;
  /** Delete or Backspace; whether it had something to remove. */
  remove?(): boolean;
}

/** Pixels that a press may move and still be a click. */
const STILL = 3;

export class Pointing {
  private hovered: { layer: Layer; id: Hit["id"] } | null = null;
  private pressed: { pointer: number; from: Pointer; hit: Hit | null; moved: boolean } | null = null;
  private drag: Drag | null = null;
  private readonly caster = new Raycaster();

  constructor(
    private readonly stage: Stage,
    private readonly layers: readonly Layer[],
    /** A click on nothing. */
    private readonly missed: () => void,
  ) {
    const { canvas } = stage;
    if (canvas.tabIndex < 0) canvas.tabIndex = 0;
    canvas.addEventListener("pointerdown", this.down, { capture: true });
    canvas.addEventListener("pointermove", this.move);
    canvas.addEventListener("pointerup", this.up);
    canvas.addEventListener("pointercancel", this.lost);
    canvas.addEventListener("pointerleave", this.left);
    canvas.addEventListener("dblclick", this.double);
    canvas.addEventListener("keydown", this.key);
  }

  get dragging(): boolean {
    return this.drag !== null;
  }

  /** Clears hovering and cancels a drag, because the scene has changed. */
  reset(): void {
    this.cancel();
    this.over(null, null);
  }

  dispose(): void {
    const { canvas } = this.stage;
    canvas.removeEventListener("pointerdown", this.down, { capture: true });
    canvas.removeEventListener("pointermove", this.move);
    canvas.removeEventListener("pointerup", this.up);
    canvas.removeEventListener("pointercancel", this.lost);
    canvas.removeEventListener("pointerleave", this.left);
    canvas.removeEventListener("dblclick", this.double);
    canvas.removeEventListener("keydown", this.key);
  }

  private at(event: MouseEvent): Pointer {
    const { canvas, width, height, camera } = this.stage;
    const box = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    camera.updateMatrixWorld();
    this.caster.setFromCamera(new Vector2((2 * x) / width - 1, 1 - (2 * y) / height), camera);
    const touch = event instanceof PointerEvent && event.pointerType === "touch";
    return { x, y, ray: this.caster.ray.clone(), shift: event.shiftKey, slack: touch ? 12 : 0 };
  }

  private find(at: Pointer): { layer: Layer; hit: Hit } | null {
    for (const layer of this.layers) {
      const hit = layer.hit(at);
      if (hit) return { layer, hit };
    }
    return null;
  }

  private over(layer: Layer | null, hit: Hit | null): void {
    const { hovered } = this;
    if (hovered?.layer === layer && hovered?.id === hit?.id) return;
    if (hovered && hovered.layer !== layer) hovered.layer.hover?.(null);
    this.hovered = layer && hit ? { layer, id: hit.id } : null;
    layer?.hover?.(hit?.id ?? null);
    this.stage.canvas.style.cursor = hit?.cursor ?? "";
    this.stage.draw();
  }

  private readonly down = (event: PointerEvent): void => {
    this.stage.canvas.focus({ preventScroll: true });
    if (event.button !== 0 || !event.isPrimary) {
      this.cancel();
      return;
    }
    const from = this.at(event);
    const found = this.find(from);
    this.over(found?.layer ?? null, found?.hit ?? null);
    this.pressed = { pointer: event.pointerId, from, hit: found?.hit ?? null, moved: false };
    this.stage.orbit.enabled = !found?.hit.grab;
    if (found?.hit.grab) this.stage.canvas.setPointerCapture(event.pointerId);
  };

  private readonly move = (event: PointerEvent): void => {
    if (!event.isPrimary) return;
    const at = this.at(event);
    const { pressed } = this;
    if (!pressed) {
      if (event.buttons !== 0) return;
      const found = this.find(at);
      this.over(found?.layer ?? null, found?.hit ?? null);
      return;
    }
    if (!pressed.moved && Math.hypot(at.x - pressed.from.x, at.y - pressed.from.y) > STILL + 0.5 * at.slack) {
      pressed.moved = true;
      this.drag = pressed.hit?.grab?.(pressed.from) ?? null;
    }
    this.drag?.move(at);
    if (this.drag) this.stage.draw();
  };

  private readonly up = (event: PointerEvent): void => {
    const { pressed, drag } = this;
    if (pressed?.pointer !== event.pointerId) return;
    this.release();
    if (drag) drag.end();
    else if (!pressed.moved && pressed.hit) pressed.hit.click?.();
    else if (!pressed.moved) this.missed();
    const at = this.at(event);
    const found = event.pointerType === "touch" ? null : this.find(at);
    this.over(found?.layer ?? null, found?.hit ?? null);
    this.stage.draw();
  };

  private readonly lost = (event: PointerEvent): void => {
    if (this.pressed?.pointer === event.pointerId) this.cancel();
  };

  private readonly left = (): void => {
    if (!this.pressed) this.over(null, null);
  };

  private readonly double = (event: MouseEvent): void => {
    const at = this.at(event);
    if (this.layers.some((layer) => layer.double?.(at))) event.preventDefault();
    this.stage.draw();
  };

  private readonly key = (event: KeyboardEvent): void => {
    let taken = false;
    if (event.key === "Escape" && this.drag) {
      this.cancel();
      taken = true;
    } else if (event.key === "Delete" || event.key === "Backspace") {
      taken = this.layers.some((layer) => layer.remove?.());
    }
    if (!taken) return;
    event.preventDefault();
    event.stopPropagation();
    this.stage.draw();
  };

  private cancel(): void {
    const { drag } = this;
    this.release();
    drag?.cancel();
    this.stage.draw();
  }

  private release(): void {
    this.drag = null;
    this.pressed = null;
    this.stage.orbit.enabled = true;
  }
}
