/** Follows a pointer from its press to its release, wherever it goes. */

export interface Following {
  /** dx: pixels since the press. */
  move(event: PointerEvent, dx: number): void;
  end?(event: PointerEvent, moved: boolean): void;
  /** Escape, or the system took the pointer away. */
  cancel?(): void;
}

/** Pixels that a press may wander and still be a click. */
const STILL_PX = 3;

export function follow(event: PointerEvent, { move, end, cancel }: Following, still = STILL_PX): void {
  const target = event.currentTarget as HTMLElement;
  const { pointerId, clientX, clientY } = event;
  let moved = still === 0;
  target.setPointerCapture(pointerId);

  const onMove = (next: PointerEvent) => {
    if (next.pointerId !== pointerId) return;
    moved ||= Math.hypot(next.clientX - clientX, next.clientY - clientY) > still;
    if (moved) move(next, next.clientX - clientX);
  };
  const onUp = (next: PointerEvent) => {
    if (next.pointerId !== pointerId) return;
    stop();
    end?.(next, moved);
  };
  const onCancel = () => {
    stop();
    cancel?.();
  };
  const onKey = (next: KeyboardEvent) => {
    if (next.key !== "Escape") return;
    next.preventDefault();
    next.stopPropagation();
    onCancel();
  };
  const listening = new AbortController();
  const { signal } = listening;
  const stop = () => {
    listening.abort();
    if (target.hasPointerCapture(pointerId)) target.releasePointerCapture(pointerId);
  };
  target.addEventListener("pointermove", onMove, { signal });
  target.addEventListener("pointerup", onUp, { signal });
  target.addEventListener("pointercancel", onCancel, { signal });
  window.addEventListener("keydown", onKey, { capture: true, signal });
}

/** A press takes the focus from a field, so that the keyboard is the application's again. */
export function leaveField(): void {
  if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
}
