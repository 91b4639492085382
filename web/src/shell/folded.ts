/** Groups shortcuts, and folds `1`, `2`, … with the same action into one entry, `1–8`. */

export interface ShortcutInfo {
  readonly keys: string;
  readonly does: string;
  readonly group: string;
}

export function folded(shortcuts: readonly ShortcutInfo[]): ShortcutInfo[] {
  const made: ShortcutInfo[] = [];
  for (const shortcut of shortcuts) {
    const digit = /^\d$/.test(shortcut.keys);
    const does = digit ? shortcut.does.replace(/\s*\d+$/, "") : shortcut.does;
    const before = made.at(-1);
    if (digit && before?.does === does) made[made.length - 1] = { ...before, keys: `${before.keys.split("–")[0]}–${shortcut.keys}` };
    else made.push({ ...shortcut, does });
  }
  return made;
}

export function grouped(shortcuts: readonly ShortcutInfo[]): [string, ShortcutInfo[]][] {
  const groups = new Map<string, ShortcutInfo[]>();
  for (const shortcut of folded(shortcuts)) groups.set(shortcut.group, [...(groups.get(shortcut.group) ?? []), shortcut]);
  return [...groups];
}
