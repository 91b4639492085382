/** The keyboard: which keys do what, in one list that the help shows, too. */

import type { Studio } from "../studio.svelte";

export interface Shortcut {
  /** As `Mod+Shift+Z`: Mod is Ctrl, and Cmd on a Mac. Several for the same thing are parted by a space. */
  readonly keys: string;
  readonly does: string;
  readonly group: "Play" | "Keys" | "Gaps" | "View and tools" | "File";
  run(context: Context): void;
}

/** What shortcuts act on beside the studio. */
export interface Context {
  readonly studio: Studio;
  open(): void;
  save(): void;
  exportBvh(): void;
  frameAll(): void;
  help(): void;
}

const onGap = (act: (studio: Studio, gap: string) => void) => ({ studio }: Context) => {
  const gap = studio.selectedGap ?? studio.gapAt(studio.frame);
  if (gap) act(studio, gap.id);
};

const step = (by: number) => ({ studio }: Context) => {
  studio.playing = false;
  studio.goTo(studio.frame + by);
};

export const SHORTCUTS: readonly Shortcut[] = [
  { keys: "Space", does: "Play and pause", group: "Play", run: ({ studio }) => studio.togglePlaying() },
  { keys: "ArrowLeft", does: "One frame back", group: "Play", run: step(-1) },
  { keys: "ArrowRight", does: "One frame on", group: "Play", run: step(1) },
  { keys: "Shift+ArrowLeft", does: "Ten frames back", group: "Play", run: step(-10) },
  { keys: "Shift+ArrowRight", does: "Ten frames on", group: "Play", run: step(10) },
  { keys: "ArrowUp", does: "Previous key", group: "Play", run: ({ studio }) => studio.goToNeighbour(-1) },
  { keys: "ArrowDown", does: "Next key", group: "Play", run: ({ studio }) => studio.goToNeighbour(1) },
  { keys: "Home", does: "First key", group: "Play", run: ({ studio }) => studio.goTo(studio.document?.keys[0].frame ?? 0) },
  { keys: "End", does: "Last key", group: "Play", run: ({ studio }) => studio.goTo(studio.document?.keys.at(-1)?.frame ?? 0) },

  { keys: "K", does: "Add a key of this pose", group: "Keys", run: ({ studio }) => studio.addKeyHere() },
  { keys: "Delete Backspace", does: "Delete the selected keys", group: "Keys", run: ({ studio }) => studio.deleteSelected() },
  { keys: "Mod+C", does: "Copy keys", group: "Keys", run: ({ studio }) => studio.clipboard.copy() },
  { keys: "Mod+V", does: "Paste at the playhead", group: "Keys", run: ({ studio }) => studio.clipboard.paste() },
  { keys: "Mod+D", does: "Duplicate keys", group: "Keys", run: ({ studio }) => studio.clipboard.duplicate() },
  {
    keys: "M",
    does: "Mirror the pose",
    group: "Keys",
    run: ({ studio }) => {
      const chosen = studio.chosenKeys;
      void studio.answers.mirror(studio.document?.keys.filter(({ id }) => chosen.includes(id)) ?? []);
    },
  },
  {
    keys: "Mod+A",
    does: "Select all keys",
    group: "Keys",
    run: ({ studio }) => (studio.selection = { keys: studio.document?.keys.map((key) => key.id) ?? [], gap: null }),
  },

  { keys: "G", does: "Select the gap here", group: "Gaps", run: onGap((studio, gap) => studio.selectGap(gap)) },
  { keys: "N", does: "Other candidates", group: "Gaps", run: onGap((studio, gap) => studio.reroll(gap)) },
  { keys: "L", does: "Lock and unlock", group: "Gaps", run: onGap((studio, gap) => studio.toggleLock(gap)) },
  ...[1, 2, 3, 4, 5, 6, 7, 8].map(
    (n): Shortcut => ({
      keys: `${n}`,
      does: `Choose candidate ${n}`,
      group: "Gaps",
      run: onGap((studio, gap) => {
        if (n <= (studio.result(gap)?.candidates.length ?? 0)) studio.choose(gap, n - 1);
      }),
    }),
  ),

  { keys: "V", does: "Select", group: "View and tools", run: ({ studio }) => (studio.tool = "select") },
  { keys: "R", does: "Rotate joints", group: "View and tools", run: ({ studio }) => (studio.tool = "rotate") },
  { keys: "E", does: "Reach with hands and feet", group: "View and tools", run: ({ studio }) => (studio.tool = "reach") },
  { keys: "W", does: "Move and turn the whole pose", group: "View and tools", run: ({ studio }) => (studio.tool = "place") },
  { keys: "D", does: "Draw a path", group: "View and tools", run: ({ studio }) => (studio.tool = "draw") },
  { keys: "F", does: "Frame everything", group: "View and tools", run: ({ frameAll }) => frameAll() },
  {
    keys: "Escape",
    does: "Select nothing",
    group: "View and tools",
    run: ({ studio }) => {
      if (studio.tool === "select") studio.selection = { keys: [], gap: null };
      studio.tool = "select";
      studio.joint = null;
    },
  },
  { keys: "?", does: "This help", group: "View and tools", run: ({ help }) => help() },

  { keys: "Mod+Z", does: "Undo", group: "File", run: ({ studio }) => studio.undo() },
  { keys: "Mod+Shift+Z Mod+Y", does: "Redo", group: "File", run: ({ studio }) => studio.redo() },
  { keys: "Mod+O", does: "Open", group: "File", run: ({ open }) => open() },
  { keys: "Mod+S", does: "Save the project", group: "File", run: ({ save }) => save() },
  { keys: "Mod+E", does: "Export BVH", group: "File", run: ({ exportBvh }) => exportBvh() },
];

export interface Pressed {
  readonly key: string;
  readonly ctrlKey: boolean;
  readonly metaKey: boolean;
  readonly shiftKey: boolean;
  readonly altKey: boolean;
}

/** The shortcut that a key press asks for, or null. */
export function shortcutOf(pressed: Pressed): Shortcut | null {
  return SHORTCUTS.find(({ keys }) => keys.split(" ").some((each) => matches(each, pressed))) ?? null;
}

function matches(combination: string, pressed: Pressed): boolean {
  const parts = combination.split("+");
  const key = parts.at(-1) as string;
  if (pressed.altKey || parts.includes("Mod") !== (pressed.ctrlKey || pressed.metaKey)) return false;
  const said = pressed.key === " " ? "Space" : pressed.key;
  if (key === "?") return said === "?";
  return said.toLowerCase() === key.toLowerCase() && parts.includes("Shift") === pressed.shiftKey;
}

/** Whether what has the focus needs the keys itself. */
export function isTyping(target: EventTarget | null, pressed: Pressed): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.closest("dialog[open]")) return true;
  if (target.isContentEditable || target.matches("textarea, select")) return true;
  if (target instanceof HTMLInputElement) return !["checkbox", "radio", "button", "range"].includes(target.type) || pressed.key.startsWith("Arrow");
  return [" ", "Enter"].includes(pressed.key) && target.matches("button, a, summary, [role=button], [role=radio], [role=menuitem]");
}
