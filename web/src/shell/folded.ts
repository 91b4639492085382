/** Shortcuts by their groups; `1`, `2`, … that do the same with another number are one line, `1–8`. */

export interface Line {
  readonly keys: string;
  readonly does: string;
  readonly group: string;
}

export function folded(lines: readonly Line[]): Line[] {
  const made: Line[] = [];
  for (const line of lines) {
    const digit = /^\d$/.test(line.keys);
    const does = digit ? line.does.replace(/\s*\d+$/, "") : line.does;
    const before = made.at(-1);
    if (digit && before?.does === does) made[made.length - 1] = { ...before, keys: `${before.keys.split("–")[0]}–${line.keys}` };
    else made.push({ ...line, does });
  }
  return made;
}

export function grouped(lines: readonly Line[]): [string, Line[]][] {
  const groups = new Map<string, Line[]>();
  for (const line of folded(lines)) groups.set(line.group, [...(groups.get(line.group) ?? []), line]);
  return [...groups];
}
