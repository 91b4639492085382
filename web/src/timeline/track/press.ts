/** A press on the track: on a key, on a gap, on the playhead, or beside all of them. */

import type { Document } from "../../document/document";
import { keyOf } from "../../document/document";
import type { Studio } from "../../studio.svelte";
import { dragged, keysBetween } from "./drag";
import { follow, leaveField } from "../follow";
import { Snapper } from "./snap";
import type { TimelineView } from "../view.svelte";

let drags = 0;

export function press(event: PointerEvent, studio: Studio, view: TimelineView): void {
  if (event.button !== 0 || !studio.document) return;
  event.preventDefault();
  leaveField();
  const track = event.currentTarget as HTMLElement;
  const target = event.target as Element;
  const { left } = track.getBoundingClientRect();
  const key = target.closest("[data-key]")?.getAttribute("data-key");
  const gap = target.closest("[data-gap]")?.getAttribute("data-gap") ?? null;
  if (key) pressKey(event, studio, view, studio.document, key, left);
  else if (target.closest("[data-playhead]")) scrub(event, view, left);
  else select(event, studio, view, gap, left);
}

function pressKey(event: PointerEvent, studio: Studio, view: TimelineView, start: Document, id: string, left: number): void {
  const how = event.ctrlKey || event.metaKey ? "toggle" : event.shiftKey ? "range" : "only";
  view.item = { kind: "key", id };
  if (how !== "only") studio.selectKey(id, how);
  const ids = how === "only" && !studio.selection.keys.includes(id) ? [id] : studio.selection.keys;
  if (!ids.includes(id)) return; // it was just removed from the selection
  const anchor = keyOf(start, id);
  if (!anchor) return;
  const merge = `drag:${++drags}`;
  const playhead = studio.playback.frame;
  const carries = playhead === anchor.frame; // the playhead goes where the key goes
  const pressed = view.frame(event.clientX - left);
  let snapper: { ripple: boolean; of: Snapper } | null = null;

  const to = (by: number, ripple: boolean) => {
    studio.apply(dragged(start, ids, by, ripple), "Move key", merge);
    const now = studio.document && keyOf(studio.document, id);
    if (carries && now) studio.playback.goTo(now.frame);
  };
  const stop = () => {
    view.guide = null;
    view.dragging = false;
    studio.release();
  };

  follow(event, {
    move(next) {
      if (!view.dragging) {
        view.dragging = true;
        studio.playback.playing = false;
        if (studio.selection.keys !== ids) studio.selection = { keys: ids, gap: null };
      }
      const x = next.clientX - left;
      view.edge(x);
      const ripple = view.ripple !== next.altKey;
      const wanted = anchor.frame + view.frame(x) - pressed;
      if (snapper?.ripple !== ripple) snapper = { ripple, of: new Snapper(start, ids, id, carries ? -1 : playhead, ripple) };
      const point = view.snap ? snapper.of.near(wanted, view.scale.zoom) : null;
      to((point?.frame ?? Math.round(wanted)) - anchor.frame, ripple);
      const reached = studio.document && keyOf(studio.document, id)?.frame;
      view.guide = point && point.frame === reached ? point : null;
    },
    end(_, moved) {
      stop();
      if (!moved && how === "only") studio.selectKey(id);
    },
    cancel() {
      to(0, false);
      stop();
    },
  });
}

function scrub(event: PointerEvent, view: TimelineView, left: number): void {
  const stop = () => (view.dragging = false);
  view.dragging = true;
  follow(
    event,
    {
      move(next) {
        view.edge(next.clientX - left);
        view.scrub(next.clientX - left);
      },
      end: stop,
      cancel: stop,
    },
    0,
  );
}

/** A click selects the gap, or puts the playhead there; a drag selects the keys in a rectangle. */
function select(event: PointerEvent, studio: Studio, view: TimelineView, gap: string | null, left: number): void {
  const from = view.frame(event.clientX - left);
  const adds = event.shiftKey || event.ctrlKey || event.metaKey;
  const before = adds ? studio.selection.keys : [];
  const stop = () => {
    view.box = null;
    view.dragging = false;
  };
  follow(event, {
    move(next) {
      view.dragging = true;
      view.edge(next.clientX - left);
      const to = view.frame(next.clientX - left);
      view.box = { from, to };
      if (studio.document) {
        const found = keysBetween(studio.document, from, to);
        studio.selection = { keys: [...new Set([...before, ...found])], gap: null };
      }
    },
    end(_, moved) {
      stop();
      if (moved) return;
      if (gap) {
        view.item = { kind: "gap", id: gap };
        studio.selectGap(gap);
        const chosen = studio.selectedGap;
        const inside = chosen && studio.playback.frame >= chosen.left.frame && studio.playback.frame <= chosen.right.frame;
        if (!inside) studio.playback.goTo(from);
      } else {
        if (!adds) studio.selection = { keys: [], gap: null };
        view.scrub(event.clientX - left);
      }
    },
    cancel: stop,
  });
}
