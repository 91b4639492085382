/** Shortcuts as they are written on this machine's keyboard. */

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

/** `Mod+Shift+Z Mod+Y` as its combinations, each as the caps to press. */
export function caps(keys: string, mac = isMac()): string[][] {
  return keys.split(" ").map((each) =>
    each.split("+").map((cap) => (cap === "Mod" ? (mac ? "⌘" : "Ctrl") : cap === "Shift" && mac ? "⇧" : (SIGNS[cap] ?? cap))),
  );
}

/** A combination in one word, as for a tooltip. */
export function written(keys: string, mac = isMac()): string {
  return caps(keys, mac)[0].join(mac ? "" : "+");
}
