/** Every colour of the viewport and of the thumbnails, for light and for dark. */

export type Theme = "light" | "dark";

const light = {
  /** The far background above the horizon, at it, and the ground. */
  sky: "#f7f8fa",
  horizon: "#f1f3f6",
  ground: "#e6e9ee",
  grid: "#7d8798",
  shadow: "#1d2433",
  shadowStrength: 0.36,
  /** The character: its middle, and what its sides are tinted with. */
  body: "#dcdee3",
  left: "#4c7dff",
  right: "#f0833a",
  sideTint: 0.2,
  /** Lights: from above, from below, the lamp, from the eye, and from behind. */
  above: "#ffffff",
  below: "#b9c0cd",
  ambient: 1.75,
  lamp: 2.3,
  fill: 0.85,
  rim: 0.9,
  /** Chosen things, start and target, warnings. */
  accent: "#2f63e6",
  target: "#d9641a",
  warning: "#bd7300",
  /** Text and strokes without a colour of their own, and the background of labels. */
  ink: "#1b2130",
  faint: "#6b7486",
  paper: "#ffffff",
  /** Axes x, y, z of the gizmo. */
  axes: ["#d9485f", "#3d9a50", "#2f63e6"],
  ghost: "#8d97aa",
  /** The other candidates, in turn. */
  hues: ["#12969a", "#9a5be0", "#d24d8f", "#5f9a28", "#b3831b", "#3f79d8", "#c25738"],
};

export type Palette = Readonly<typeof light>;

const dark: Palette = {
  sky: "#15181e",
  horizon: "#191d24",
  ground: "#20252e",
  grid: "#8e9ab0",
  shadow: "#000000",
  shadowStrength: 0.68,
  body: "#b4bac6",
  left: "#5b8bff",
  right: "#ff9450",
  sideTint: 0.22,
  above: "#e8eeff",
  below: "#39414f",
  ambient: 1.1,
  lamp: 2.1,
  fill: 0.95,
  rim: 2.4,
  accent: "#7ba0ff",
  target: "#ff9a57",
  warning: "#ffb938",
  ink: "#eef1f7",
  faint: "#98a2b5",
  paper: "#262b35",
  axes: ["#ff7187", "#67cc7d", "#7ba0ff"],
  ghost: "#97a3ba",
  hues: ["#3fc9c4", "#bb8cff", "#ff7fbb", "#9ad45c", "#e6bb4d", "#6fa3ff", "#ff8a68"],
};

export const palettes: Readonly<Record<Theme, Palette>> = { light, dark };
