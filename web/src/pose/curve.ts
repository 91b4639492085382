/** Curves on the ground: x and z in metres. */

export type Ground = readonly [number, number];

const TINY = 1e-9;

/** A smooth curve through the points, `pieces` a stretch: a centripetal Catmull-Rom spline, which makes no loops of its own. */
export function curve(points: readonly Ground[], pieces = 16): Ground[] {
  const through = points.filter((point, i) => i === 0 || distance(point, points[i - 1]) > TINY);
  if (through.length < 2) return through.map(([x, z]) => [x, z] as const);
  const last = through.length - 1;
  const ends = [reflected(through[1], through[0]), ...through, reflected(through[last - 1], through[last])];
  const made: Ground[] = [];
  for (let i = 0; i < last; i++) {
    for (let piece = 0; piece < pieces; piece++) {
      made.push(piece === 0 ? through[i] : stretch(ends[i], ends[i + 1], ends[i + 2], ends[i + 3], piece / pieces));
    }
  }
  return [...made, through[last]];
}

/** The place of a polyline nearest to a point: its distance, the index of the point before it, and the place. */
export function nearest(points: readonly Ground[], point: Ground): { distance: number; after: number; place: Ground } {
  let best = { distance: points.length > 0 ? distance(points[0], point) : Infinity, after: 0, place: points[0] ?? point };
  for (let i = 0; i + 1 < points.length; i++) {
    const place = mixed(points[i], points[i + 1], shareAlong(points[i], points[i + 1], point));
    const far = distance(place, point);
    if (far < best.distance) best = { distance: far, after: i, place };
  }
  return best;
}

/** The control points with one more, on the curve through `from`, them and `to`, where it comes nearest to `point`. */
export function inserted(
  from: Ground,
  points: readonly Ground[],
  to: Ground,
  point: Ground,
): { points: Ground[]; at: number } {
  const pieces = 24;
  const all = [from, ...points, to];
  const place = nearest(curve(all, pieces), point);
  const distinct = all.flatMap((p, i) => (i === 0 || distance(p, all[i - 1]) > TINY ? [i] : []));
  const stretchOf = Math.min(Math.floor(place.after / pieces), Math.max(0, distinct.length - 2));
  const at = Math.min(points.length, Math.max(0, distinct[stretchOf] ?? 0));
  return { points: [...points.slice(0, at), place.place, ...points.slice(at)], at };
}

/** As few points of a stroke as keep all of it within `tolerance` (Douglas and Peucker); its ends stay. */
export function thinned(stroke: readonly Ground[], tolerance: number): Ground[] {
  if (stroke.length < 3) return [...stroke];
  const kept = new Set([0, stroke.length - 1]);
  const open: [number, number][] = [[0, stroke.length - 1]];
  for (let span = open.pop(); span; span = open.pop()) {
    const [first, last] = span;
    let [worst, far] = [-1, tolerance];
    for (let i = first + 1; i < last; i++) {
      const foot = mixed(stroke[first], stroke[last], shareAlong(stroke[first], stroke[last], stroke[i]));
      const away = distance(foot, stroke[i]);
      if (away > far) [worst, far] = [i, away];
    }
    if (worst < 0) continue;
    kept.add(worst);
    open.push([first, worst], [worst, last]);
  }
  return stroke.filter((_, i) => kept.has(i));
}

export function distance(a: Ground, b: Ground): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

function mixed(a: Ground, b: Ground, share: number): Ground {
  return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
}

function shareAlong(a: Ground, b: Ground, point: Ground): number {
  const [x, z] = [b[0] - a[0], b[1] - a[1]];
  const square = x * x + z * z;
  if (square < TINY * TINY) return 0;
  return Math.min(1, Math.max(0, ((point[0] - a[0]) * x + (point[1] - a[1]) * z) / square));
}

function reflected(point: Ground, about: Ground): Ground {
  return [2 * about[0] - point[0], 2 * about[1] - point[1]];
}

/** Between b and c, by Barry and Goldman's pyramid with knots a square root of a chord apart. */
function stretch(a: Ground, b: Ground, c: Ground, d: Ground, share: number): Ground {
  const knot = (p: Ground, q: Ground): number => Math.max(Math.sqrt(distance(p, q)), 1e-5);
  const t0 = 0;
  const t1 = t0 + knot(a, b);
  const t2 = t1 + knot(b, c);
  const t3 = t2 + knot(c, d);
  const t = t1 + share * (t2 - t1);
  const low = mixed(a, b, (t - t0) / (t1 - t0));
  const middle = mixed(b, c, (t - t1) / (t2 - t1));
  const high = mixed(c, d, (t - t2) / (t3 - t2));
  return mixed(mixed(low, middle, (t - t0) / (t2 - t0)), mixed(middle, high, (t - t1) / (t3 - t1)), share);
}
