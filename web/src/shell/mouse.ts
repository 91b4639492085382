/** Mouse actions on the timeline, for the help. */
export const MOUSE: readonly { does: string; how: string }[] = [
  { does: "Scrub", how: "drag the ruler or the playhead" },
  { does: "Move keys", how: "drag a diamond" },
  { does: "Move later keys too", how: "Alt + drag a diamond" },
  { does: "Add a key", how: "double click a gap" },
  { does: "Select several keys", how: "Ctrl or Shift + click, or drag" },
  { does: "Zoom and scroll", how: "Ctrl + wheel, wheel" },
  { does: "Show commands", how: "right click" },
];
