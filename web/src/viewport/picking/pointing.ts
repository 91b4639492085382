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

type Found = { readonly layer: Layer; readonly hit: Hit };

/** Pixels that a press may move and still be a click. */
const STILL = 3;

export class Pointing {
  private hovered: Found | null = null;
  private pressed: { pointer: number; from: Pointer; hit: Hit | null; moved: boolean } | null = null;
  private drag: Drag | null = null;
  private readonly caster = new Raycaster();
  private readonly listening = new AbortController();

  constructor(
    private readonly stage: Stage,
    private readonly layers: readonly Layer[],
    /** A click on nothing. */
    private readonly missed: () => void,
  ) {
    const { canvas } = stage;
    if (canvas.tabIndex < 0) canvas.tabIndex = 0;
    const { signal } = this.listening;
    canvas.addEventListener("pointerdown", (event) => this.down(event), { capture: true, signal });
    canvas.addEventListener("pointermove", (event) => this.move(event), { signal });
    canvas.addEventListener("pointerup", (event) => this.up(event), { signal });
    canvas.addEventListener("pointercancel", ({ pointerId }) => this.pressed?.pointer === pointerId && this.cancel(), { signal });
    canvas.addEventListener("pointerleave", () => this.pressed || this.over(null), { signal });
    canvas.addEventListener("dblclick", (event) => this.double(event), { signal });
    canvas.addEventListener("keydown", (event) => this.key(event), { signal });
  }

  get dragging(): boolean {
    return this.drag !== null;
  }

  /** Clears hovering and cancels a drag, because the scene has changed. */
  reset(): void {
    this.cancel();
    this.over(null);
  }

  dispose(): void {
    this.listening.abort();
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

  private find(at: Pointer): Found | null {
    for (const layer of this.layers) {
      const hit = layer.hit(at);
      if (hit) return { layer, hit };
    }
    return null;
  }

  private over(found: Found | null): void {
    const { hovered } = this;
    if (hovered?.layer === found?.layer && hovered?.hit.id === found?.hit.id) return;
    if (hovered && hovered.layer !== found?.layer) hovered.layer.hover?.(null);
    this.hovered = found;
    found?.layer.hover?.(found.hit.id);
    this.stage.canvas.style.cursor = found?.hit.cursor ?? "";
    this.stage.draw();
  }

  private down(event: PointerEvent): void {
    this.stage.canvas.focus({ preventScroll: true });
    if (event.button !== 0 || !event.isPrimary) {
      this.cancel();
      return;
    }
    const from = this.at(event);
    const found = this.find(from);
    this.over(found);
    this.pressed = { pointer: event.pointerId, from, hit: found?.hit ?? null, moved: false };
    this.stage.orbit.enabled = !found?.hit.grab;
    if (found?.hit.grab) this.stage.canvas.setPointerCapture(event.pointerId);
  }

  private move(event: PointerEvent): void {
    if (!event.isPrimary) return;
    const at = this.at(event);
    const { pressed } = this;
    if (!pressed) {
      if (event.buttons !== 0) return;
      return this.over(this.find(at));
    }
    if (!pressed.moved && Math.hypot(at.x - pressed.from.x, at.y - pressed.from.y) > STILL + 0.5 * at.slack) {
      pressed.moved = true;
      this.drag = pressed.hit?.grab?.(pressed.from) ?? null;
    }
    this.drag?.move(at);
    if (this.drag) this.stage.draw();
  }

  private up(event: PointerEvent): void {
    const { pressed, drag } = this;
    if (pressed?.pointer !== event.pointerId) return;
    this.release();
    if (drag) drag.end();
    else if (!pressed.moved && pressed.hit) pressed.hit.click?.();
    else if (!pressed.moved) this.missed();
    this.over(event.pointerType === "touch" ? null : this.find(this.at(event)));
    this.stage.draw();
  }

  private double(event: MouseEvent): void {
    const at = this.at(event);
    if (this.layers.some((layer) => layer.double?.(at))) event.preventDefault();
    this.stage.draw();
  }

  private key(event: KeyboardEvent): void {
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
  }

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
