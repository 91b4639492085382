/** Formats shortcuts for this machine's keyboard. */

const SIGNS: Readonly<Record<string, string>> = {
  ArrowLeft: "←",
  ArrowRight: "→",
  ArrowUp: "↑",
  ArrowDown: "↓",
  Delete: "Del",
  Escape: "Esc",
};

export function isMac(): boolean {
  return typeof navigator !== "undefined" && /Mac|iP(hone|ad)/.test(navigator.platform);
}

/** Splits `Mod+Shift+Z Mod+Y` into combinations of key caps. */
export function caps(keys: string, mac = isMac()): string[][] {
  return keys.split(" ").map((each) =>
    each.split("+").map((cap) => (cap === "Mod" ? (mac ? "⌘" : "Ctrl") : cap === "Shift" && mac ? "⇧" : (SIGNS[cap] ?? cap))),
  );
}

/** The first combination as text, as for a tooltip. */
export function written(keys: string, mac = isMac()): string {
  return caps(keys, mac)[0].join(mac ? "" : "+");
}
