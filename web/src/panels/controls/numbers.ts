/** Parses what is typed into number fields. */

/** The number, clamped to its limits, or null if it is not one. Accepts a decimal comma. */
export function clean(text: string, { min, max, digits }: { min: number; max: number; digits: number }): number | null {
  const trimmed = text.trim().replace(",", ".");
  const value = trimmed === "" ? NaN : Number(trimmed);
  if (!Number.isFinite(value)) return null;
  return Math.max(min, Math.min(max, Number(value.toFixed(digits))));
}

export const degrees = (radians: number): number => (radians * 180) / Math.PI;
export const radians = (degrees: number): number => (degrees * Math.PI) / 180;
