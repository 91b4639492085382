/* Made from src/interpose/studio/protocol.py by web/protocol.sh; do not edit. */

export type Asked = Generate | Cancel | Suggest | Paths | Mirror | Library;
export type Told = Welcome | Candidates | Dropped | Failed | Suggested | Ways | Posed | LibraryPoses;

/**
 * Everything that travels between the studio's server and its browser.
 */
export interface Protocol {
  asked: Asked;
  told: Told;
  rig: Rig;
  export: Export;
  refusal: Refusal;
  opened: Opened;
}
/**
 * Candidates for a gap. Answer: `candidates`. live: while something is dragged; one candidate, soon.
 */
export interface Generate {
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
  style: string | null;
  blend: Blend | null;
  type: "generate";
  gap: string;
  frames: number;
  method: "dcmoe" | "stitch" | "interp";
  path: Way | Line;
  variants: number;
  seed: number;
  live: boolean;
}
/**
 * A second style, and its share of the whole.
 */
export interface Blend {
  style: string;
  share: number;
}
/**
 * A path by its name: matched from the gallery, straight, or the network's own.
 */
export interface Way {
  kind: "auto" | "straight" | "none";
}
/**
 * A path by its points.
 *
 * points: x, z on the ground in metres of the rig. times: seconds from the start key at which each is passed. facing:
 * yaw at each, radians from +Z towards +X, unwrapped. drawn: by hand, and then points are the curve's control points.
 */
export interface Line {
  kind: "line";
  points: [number, number][];
  times: number[] | null;
  facing: number[] | null;
  drawn: boolean;
}
/**
 * The gap's candidates are no longer wanted.
 */
export interface Cancel {
  type: "cancel";
  gap: string;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * How long should the gap take? Answer: `suggested`.
 */
export interface Suggest {
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
  style: string | null;
  blend: Blend | null;
  type: "suggest";
}
/**
 * Which ways does the gallery know? frames: of the gap. Answer: `ways`.
 */
export interface Paths {
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
  style: string | null;
  blend: Blend | null;
  type: "paths";
  frames: number;
  count: number;
  seed: number;
}
/**
 * A pose with left and right exchanged about its own facing. arrays: ``pose`` (1, row). Answer: `posed`.
 */
export interface Mirror {
  type: "mirror";
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * The poses that ship, on a rig. Answer: `library`.
 */
export interface Library {
  type: "library";
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * The first message of every connection.
 */
export interface Welcome {
  type: "welcome";
  version: string;
  methods: MethodInfo[];
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A method that can be asked for. styles: of its model, none for interpolation. paths: whether it follows them.
 */
export interface MethodInfo {
  method: "dcmoe" | "stitch" | "interp";
  model: string | null;
  licence: string | null;
  styles: string[];
  paths: boolean;
}
/**
 * The answer to `generate`, best first. arrays: ``frames`` (candidate, frame, row), without the keys. seconds: of
 * the server's work.
 */
export interface Candidates {
  type: "candidates";
  id: number;
  gap: string;
  live: boolean;
  infos: CandidateInfo[];
  seconds: number;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * What is told of one candidate.
 *
 * style: of this variant. trajectory: where its path is from (matched, composed, drawn, straight, model), or None.
 * foot_slide: cm a frame, None where the rig's feet are not known. fallback: what could not be served as asked, and
 * what served instead.
 */
export interface CandidateInfo {
  method: "dcmoe" | "stitch" | "interp";
  style: string | null;
  trajectory: string | null;
  foot_slide: number | null;
  fit: number | null;
  path_deviation: number | null;
  fallback: string | null;
}
/**
 * A `generate` that was not answered because a newer one, or `cancel`, came.
 */
export interface Dropped {
  type: "dropped";
  id: number;
  gap: string;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * What could not be served, and why, in one sentence. again: whether the rig has to be sent again.
 */
export interface Failed {
  type: "failed";
  id: number;
  gap: string | null;
  reason: string;
  again: boolean;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * The answer to `suggest`.
 */
export interface Suggested {
  type: "suggested";
  id: number;
  frames: number;
  alternatives: Alternative[];
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A duration. fit: the share of the gallery's trajectories with that speed.
 */
export interface Alternative {
  speed: "fast" | "medium" | "slow";
  frames: number;
  fit: number;
}
/**
 * The answer to `paths`, the likeliest first; none, with the reason, where none leads there.
 */
export interface Ways {
  type: "ways";
  id: number;
  ways: WayInfo[];
  reason: string | null;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A trajectory of the gallery. line: ready to be a gap's path. frames: what it took when it was walked, in the
 * rig's rate. fit: 0 to 1. composed: of several windows.
 */
export interface WayInfo {
  line: Line;
  frames: number;
  style: string | null;
  fit: number;
  composed: boolean;
}
/**
 * The answer to `mirror`. arrays: ``pose`` (1, row).
 */
export interface Posed {
  type: "posed";
  id: number;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * The answer to `library`. arrays: ``poses`` (pose, row), hips above the origin, facing +Z.
 */
export interface LibraryPoses {
  type: "library";
  id: number;
  names: string[];
  arrays: {
    [k: string]: number[];
  };
}
/**
 * An opened BVH file: its skeleton, its figure and its frames.
 *
 * id: of the file's contents; the same bytes have the same. humanoid: for each of the 22 joints that it has, its own
 * joint. reason: None, or why it is no humanoid, so that only interpolation serves it. size: metres, about the height
 * of its hips. notes: what was odd about the file.
 *
 * arrays: ``offsets`` (joint, 3), each joint's place in its parent's frame. ``frames`` (frame, row). The figure's
 * ``vertices`` and ``normals`` (vertex, 3), in the frame of the joint ``carriers`` (vertex,); ``triangles``
 * (triangle, 3); ``sides`` (triangle,), 0 middle, 1 left, 2 right.
 */
export interface Rig {
  id: string;
  name: string;
  rate: number;
  joints: string[];
  parents: number[];
  moved: boolean;
  profile: string | null;
  reason: string | null;
  humanoid: {
    [k: string]: number;
  };
  feet: Foot[];
  size: number;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A joint of a foot. height: above the floor when the foot is flat on it, metres of the rig.
 */
export interface Foot {
  joint: number;
  height: number;
}
/**
 * A whole motion to be written. rows: (frame, frame of the rig's file) that come out digit for digit.
 *
 * arrays: ``frames`` (frame, row).
 */
export interface Export {
  rig: string;
  format: "bvh" | "glb";
  rows: [number, number][];
  arrays: {
    [k: string]: number[];
  };
}
/**
 * Why a request of HTTP was refused, in one sentence. again: whether the rig has to be sent again.
 */
export interface Refusal {
  reason: string;
  again: boolean;
}
/**
 * What the command line named: a BVH file, a project, or neither.
 */
export interface Opened {
  source: Source | null;
  project: Project | null;
}
/**
 * The BVH file that a project is about, whole.
 */
export interface Source {
  name: string;
  text: string;
}
/**
 * A project file, `.interpose`: JSON, with all that it needs in it.
 */
export interface Project {
  format: 1;
  name: string;
  source: Source;
  keys: ProjectKey[];
}
/**
 * A key. pose: its row, 32-bit floats in base64; None for the pose of the source's frame. source: the frame of the
 * source's file that it is, unchanged. after: the gap that follows. motion: the frames shown there, in base64, where
 * they are worth keeping.
 */
export interface ProjectKey {
  id: string;
  frame: number;
  pose: string | null;
  source: number | null;
  after: GapSettings;
  motion: string | null;
}
/**
 * What is asked of the gap after a key.
 *
 * method: ``clip`` keeps the source's own frames, which lie between the two keys' source frames. speed: how
 * the duration was chosen, None by frames. chosen: which candidate shows. locked: it stays as it is.
 */
export interface GapSettings {
  method: "clip" | ("dcmoe" | "stitch" | "interp");
  style: string | null;
  blend: Blend | null;
  path: Way | Line;
  variants: number;
  seed: number;
  speed: ("fast" | "medium" | "slow") | null;
  chosen: number;
  locked: boolean;
}
