/** Context menus of keys, gaps and the empty timeline. */

import type { Gap } from "../../document/document";
import { isAsInClip } from "../../document/document";
import { infoOf } from "../../document/methods";
import { generate } from "../../panels/gap/gap";
import { written } from "../../shell/keys";
import type { MenuEntry } from "../../shell/Menu.svelte";
import type { Studio } from "../../studio.svelte";
import type { TimelineView } from "../view.svelte";

export function keyMenu(studio: Studio): MenuEntry[] {
  const keys = studio.selectedKeys;
  const several = keys.length > 1;
  const single = studio.selectedKey;
  return [
    { label: several ? `Copy ${keys.length} keys` : "Copy", icon: "copy", keys: written("Mod+C"), run: () => studio.clipboard.copy() },
    {
      label: "Paste at the playhead",
      icon: "paste",
      keys: written("Mod+V"),
      disabled: !studio.clipboard.canPaste,
      run: () => studio.clipboard.paste(),
    },
    { label: "Duplicate", icon: "duplicate", keys: written("Mod+D"), run: () => studio.clipboard.duplicate() },
    {
      label: "Mirror the pose",
      icon: "mirror",
      keys: "M",
      disabled: !single,
      run: () => void studio.answers.mirror(single ? [single] : []),
    },
    null,
    {
      label: several ? `Delete ${keys.length} keys` : "Delete",
      icon: "trash",
      keys: written("Delete"),
      danger: true,
      disabled: keys.length >= (studio.document?.keys.length ?? 0),
      run: () => studio.deleteSelected(),
    },
  ];
}

export function gapMenu(studio: Studio, gap: Gap, frame: number): MenuEntry[] {
  const { id, settings, left, right } = gap;
  const isClip = settings.method === "clip";
  const state = studio.state(gap);
  const entries: MenuEntry[] = [
    { label: `Add a key at ${frame}`, icon: "key", disabled: frame <= left.frame || frame >= right.frame, run: () => addKey(studio, frame) },
    { label: `Paste at ${frame}`, icon: "paste", disabled: !studio.clipboard.canPaste, run: () => paste(studio, frame) },
    null,
  ];
  if (isClip) {
    entries.push({
      label: "Generate in-between",
      icon: "sparkle",
      run: () => generate(studio, gap),
    });
  } else {
    entries.push(
      {
        label: "Reroll candidates",
        icon: "dice",
        keys: "N",
        disabled: settings.locked || !infoOf(settings, studio.welcome.methods)?.variants,
        run: () => studio.reroll(id),
      },
      {
        label: settings.locked ? "Unlock" : "Lock",
        icon: settings.locked ? "unlock" : "lock",
        keys: "L",
        disabled: !settings.locked && state !== "ready",
        run: () => studio.toggleLock(id),
      },
    );
    if (state === "failed") entries.push({ label: "Try again", icon: "loop", run: () => studio.retry(id) });
    if (isAsInClip(left, right)) {
      entries.push({ label: "Keep the clip's motion", icon: "undo", disabled: settings.locked, run: () => studio.setGap(id, { method: "clip" }, "Keep the clip's motion") });
    }
  }
  entries.push(null, {
    label: "Select both keys",
    icon: "select",
    run: () => (studio.selection = { keys: [left.id, right.id], gap: null }),
  });
  return entries;
}

export function emptyMenu(studio: Studio, view: TimelineView, frame: number): MenuEntry[] {
  return [
    { label: `Add a key at ${frame}`, icon: "key", run: () => addKey(studio, frame) },
    { label: `Paste at ${frame}`, icon: "paste", disabled: !studio.clipboard.canPaste, run: () => paste(studio, frame) },
    null,
    {
      label: "Select all keys",
      icon: "select",
      keys: written("Mod+A"),
      run: () => (studio.selection = { keys: studio.document?.keys.map((key) => key.id) ?? [], gap: null }),
    },
    { label: "Show everything", icon: "fit", run: () => view.fit() },
  ];
}

function addKey(studio: Studio, frame: number): void {
  studio.playback.pauseAt(frame);
  studio.addKeyHere();
}

function paste(studio: Studio, frame: number): void {
  studio.playback.goTo(frame);
  studio.clipboard.paste();
}
