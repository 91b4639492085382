/** Methods and models, and the settings that they support. */

import type { GapSettings, MethodInfo } from "../protocol";

type Chosen = Pick<GapSettings, "method" | "model">;

/** The method of a gap with its model, or with the default model if it names none; null if it is not installed. */
export function infoOf({ method, model }: Chosen, methods: readonly MethodInfo[]): MethodInfo | null {
  const served = methods.filter((info) => info.method === method);
  return (model === null ? served[0] : served.find((info) => info.model === model)) ?? null;
}

/** The settings that change with the method and model; settings that these do not support are reset. */
export function withMethod(settings: GapSettings, chosen: Chosen, methods: readonly MethodInfo[]): Partial<GapSettings> {
  if (chosen.method === "clip") return chosen;
  const info = infoOf(chosen, methods);
  const knows = (style: string | undefined) => style !== undefined && (info?.styles.includes(style) ?? false);
  const style = knows(settings.style ?? undefined) ? settings.style : null;
  return {
    ...chosen,
    style,
    blend: style !== null && knows(settings.blend?.style) ? settings.blend : null,
    style_strength: info?.styles.length ? settings.style_strength : 1,
    path: info?.paths ? settings.path : { kind: "auto" },
    path_control: info?.paths ? settings.path_control : 1,
    target_joints: info?.model ? settings.target_joints : null,
  };
}

/** The settings that change with the style; a blend needs two different styles. */
export function withStyle(settings: GapSettings, style: string | null): Partial<GapSettings> {
  const blend = style !== null && settings.blend && settings.blend.style !== style ? settings.blend : null;
  return { style, blend, style_strength: style === null ? 1 : settings.style_strength };
}
