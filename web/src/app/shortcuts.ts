/** Keyboard shortcuts, in one list that the help also shows. */

import type { Studio } from "../studio.svelte";

export interface Shortcut {
  /** As `Mod+Shift+Z`: Mod is Ctrl, and Cmd on a Mac. Alternatives are separated by a space. */
  readonly keys: string;
  readonly does: string;
  readonly group: "Play" | "Keys" | "Gaps" | "View and tools" | "File";
  run(context: Context): void;
}

/** What shortcuts act on besides the studio. */
export interface Context {
  readonly studio: Studio;
  open(): void;
  save(): void;
  exportBvh(): void;
  frameAll(): void;
  help(): void;
}

const onGap = (act: (studio: Studio, gap: string) => void) => ({ studio }: Context) => {
  const gap = studio.selectedGap ?? studio.gapAt(studio.playback.frame);
  if (gap) act(studio, gap.id);
};

const step = (by: number) => ({ studio }: Context) => {
  studio.playback.pauseAt(studio.playback.frame + by);
};

export const SHORTCUTS: readonly Shortcut[] = [
  { keys: "Space", does: "Play or pause", group: "Play", run: ({ studio }) => studio.playback.toggle() },
  { keys: "ArrowLeft", does: "Previous frame", group: "Play", run: step(-1) },
  { keys: "ArrowRight", does: "Next frame", group: "Play", run: step(1) },
  { keys: "Shift+ArrowLeft", does: "Ten frames back", group: "Play", run: step(-10) },
  { keys: "Shift+ArrowRight", does: "Ten frames forward", group: "Play", run: step(10) },
  { keys: "ArrowUp", does: "Previous key", group: "Play", run: ({ studio }) => studio.playback.goToNeighbour(-1) },
  { keys: "ArrowDown", does: "Next key", group: "Play", run: ({ studio }) => studio.playback.goToNeighbour(1) },
  { keys: "Home", does: "First key", group: "Play", run: ({ studio }) => studio.playback.goTo(studio.document?.keys[0].frame ?? 0) },
  { keys: "End", does: "Last key", group: "Play", run: ({ studio }) => studio.playback.goTo(studio.document?.keys.at(-1)?.frame ?? 0) },

  { keys: "K", does: "Add a key with this pose", group: "Keys", run: ({ studio }) => studio.addKeyHere() },
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
  { keys: "N", does: "Reroll candidates", group: "Gaps", run: onGap((studio, gap) => studio.reroll(gap)) },
  { keys: "L", does: "Lock or unlock", group: "Gaps", run: onGap((studio, gap) => studio.toggleLock(gap)) },
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
  { keys: "W", does: "Move and turn the pose", group: "View and tools", run: ({ studio }) => (studio.tool = "place") },
  { keys: "D", does: "Draw a path", group: "View and tools", run: ({ studio }) => (studio.tool = "draw") },
  { keys: "F", does: "Frame everything", group: "View and tools", run: ({ frameAll }) => frameAll() },
  {
    keys: "Escape",
    does: "Deselect",
    group: "View and tools",
    run: ({ studio }) => {
      if (studio.tool === "select") studio.selection = { keys: [], gap: null };
      studio.tool = "select";
      studio.joint = null;
    },
  },
  { keys: "?", does: "Show this help", group: "View and tools", run: ({ help }) => help() },

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

/** The shortcut for a key press, or null. */
export function shortcutOf(pressed: Pressed): Shortcut | null {
  return SHORTCUTS.find(({ keys }) => keys.split(" ").some((each) => matches(each, pressed))) ?? null;
}

function matches(combination: string, pressed: Pressed): boolean {
  const parts = combination.split("+");
  const key = parts.at(-1) as string;
  if (pressed.altKey || parts.includes("Mod") !== (pressed.ctrlKey || pressed.metaKey)) return false;
  const name = pressed.key === " " ? "Space" : pressed.key;
  if (key === "?") return name === "?";
  return name.toLowerCase() === key.toLowerCase() && parts.includes("Shift") === pressed.shiftKey;
}

/** Whether the focused element handles this key itself. */
export function isTyping(target: EventTarget | null, pressed: Pressed): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.closest("dialog[open]")) return true;
  if (target.isContentEditable || target.matches("textarea, select")) return true;
  if (target instanceof HTMLInputElement) return !["checkbox", "radio", "button", "range"].includes(target.type) || pressed.key.startsWith("Arrow");
  return [" ", "Enter"].includes(pressed.key) && target.matches("button, a, summary, [role=button], [role=radio], [role=menuitem]");
}
