/* Made from src/interpose/studio/protocol.py by web/protocol.sh; do not edit. */

export type ClientMessage = Generate | Cancel | SuggestDuration | FindPaths | Mirror | Library;
export type ServerMessage =
  Welcome | Candidates | Dropped | Failed | SuggestedDurations | GalleryPaths | MirroredPose | LibraryPoses;

/**
 * Everything that the studio's server and its browser send to each other.
 */
export interface Protocol {
  ClientMessage: ClientMessage;
  ServerMessage: ServerMessage;
  Rig: Rig;
  Export: Export;
  Refusal: Refusal;
  Opened: Opened;
}
/**
 * Generates candidates for a gap. Answer: `candidates`. live: sent during a drag, for one candidate.
 */
export interface Generate {
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
  settings: GapSettings;
  type: "generate";
  gap: string;
  frames: number;
  live: boolean;
}
/**
 * The settings of a gap, as a project has them and as requests send them.
 *
 * method: a name of the registry of backends, or ``clip``, which keeps the source's own frames between the source
 * frames of the two keys. model: None for the first one that serves the method. style_strength: 0 as good as no style,
 * 1 as trained, up to 3 exaggerated. path_control: weight of the path against the predicted one. own_gallery: use the
 * model's gallery even if the studio was started with another one. target_joints: the joints of the target to meet, as
 * in `between --target-joints`; None for the whole pose. speed: set if the duration was chosen by speed. chosen: which
 * candidate is shown. locked: nothing changes it.
 */
export interface GapSettings {
  method: string;
  model: string | null;
  style: string | null;
  blend: Blend | null;
  style_strength: number;
  path: PathChoice | PointPath;
  path_control: number;
  own_gallery: boolean;
  target_joints: string | null;
  variants: number;
  seed: number;
  speed: ("fast" | "medium" | "slow") | null;
  chosen: number;
  locked: boolean;
}
/**
 * A second style and its share of the blend.
 */
export interface Blend {
  style: string;
  share: number;
}
/**
 * A path by name: the best one, matched from the gallery, straight, or unconstrained.
 */
export interface PathChoice {
  kind: "auto" | "gallery" | "straight" | "none";
}
/**
 * A path through points.
 *
 * points: x, z on the ground in metres of the rig. times: seconds from the start key at each point. facing: yaw at
 * each point, radians from +Z towards +X, unwrapped. drawn: drawn by hand, so that points are the control points of a
 * curve.
 */
export interface PointPath {
  kind: "waypoints";
  points: [number, number][];
  times: number[] | null;
  facing: number[] | null;
  drawn: boolean;
}
/**
 * Cancels the unanswered requests for a gap's candidates.
 */
export interface Cancel {
  type: "cancel";
  gap: string;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * Asks how long a gap should be. Answer: `suggested`.
 */
export interface SuggestDuration {
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
  settings: GapSettings;
  type: "suggest";
}
/**
 * Asks for trajectories of the gallery that fit a gap of so many frames. Answer: `gallery-paths`.
 */
export interface FindPaths {
  id: number;
  rig: string;
  arrays: {
    [k: string]: number[];
  };
  settings: GapSettings;
  type: "paths";
  frames: number;
  count: number;
}
/**
 * Swaps left and right of a pose about its own facing. arrays: ``pose`` (1, row). Answer: `mirrored`.
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
 * Asks for the bundled poses on a rig. Answer: `library`.
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
 *
 * methods: each method with each model that serves it, the default ones first. gallery: the name of the gallery that
 * the studio was started with. target_parts: names for a gap's ``target_joints``.
 */
export interface Welcome {
  type: "welcome";
  version: string;
  methods: MethodInfo[];
  gallery: string | null;
  target_parts: string[];
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A method with a model that serves it, and what the two can do (`interpose.runtime.backends.backend.Abilities`).
 *
 * summary: one phrase. model: None if it needs none. styles: of the model. paths: whether the root can follow a path.
 * gallery: whether the model has its own. partial_targets: whether a network completes targets given in part.
 * variants: whether candidates differ. longest_seconds: of a gap. any_rig: also serves rigs that are not humanoid.
 */
export interface MethodInfo {
  method: string;
  summary: string;
  model: string | null;
  licence: string | null;
  styles: string[];
  paths: boolean;
  gallery: boolean;
  partial_targets: boolean;
  variants: boolean;
  longest_seconds: number | null;
  any_rig: boolean;
}
/**
 * The answer to `generate`, best first. seconds: time that the server took.
 *
 * arrays: ``frames`` (candidate, frame, row), without the keys. If only some joints of the target were given, also
 * ``targets`` (candidate, row), the complete poses that the candidates lead to.
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
 * What is known about one candidate.
 *
 * method, model: that generated it. style: of this variant. trajectory: the source of its path (matched, composed,
 * drawn, straight, model), or None. foot_slide: cm per frame, None if the rig's feet are unknown. fallback: what could
 * not be served, and what was used instead.
 */
export interface CandidateInfo {
  method: string;
  model: string | null;
  style: string | null;
  trajectory: string | null;
  foot_slide: number | null;
  fit: number | null;
  path_deviation: number | null;
  fallback: string | null;
}
/**
 * The answer to a `generate` that a newer one, or `cancel`, replaced.
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
 * The request failed, for a reason given in one sentence. again: whether the rig has to be sent again.
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
export interface SuggestedDurations {
  type: "suggested";
  id: number;
  frames: number;
  alternatives: DurationOption[];
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A duration for a gap. fit: the share of the gallery's trajectories with that speed.
 */
export interface DurationOption {
  speed: "fast" | "medium" | "slow";
  frames: number;
  fit: number;
}
/**
 * The answer to `paths`, the most likely first; empty, with the reason, if there is none.
 */
export interface GalleryPaths {
  type: "gallery-paths";
  id: number;
  paths: GalleryPath[];
  reason: string | null;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A trajectory of the gallery. path: ready to be a gap's path. frames: its original duration at the rig's rate.
 * fit: 0 to 1. composed: of several windows.
 */
export interface GalleryPath {
  path: PointPath;
  frames: number;
  style: string | null;
  fit: number;
  composed: boolean;
}
/**
 * The answer to `mirror`. arrays: ``pose`` (1, row).
 */
export interface MirroredPose {
  type: "mirrored";
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
 * An opened BVH file: its skeleton, mannequin and frames.
 *
 * id: a hash of the file's contents. humanoid: the rig's joint for each of the 22 joints that it has. reason: None, or
 * why it is not a humanoid, so that only interpolation serves it. size: roughly the height of the hips in metres.
 *
 * arrays: ``offsets`` (joint, 3), each joint's position relative to its parent. ``frames`` (frame, row). The
 * mannequin's ``vertices`` and ``normals`` (vertex, 3), relative to the joint in ``carriers`` (vertex,); ``triangles``
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
  feet: FootJoint[];
  size: number;
  arrays: {
    [k: string]: number[];
  };
}
/**
 * A joint of a foot. height: above the floor when the foot is flat on it, in metres of the rig.
 */
export interface FootJoint {
  joint: number;
  height: number;
}
/**
 * A whole motion to write. rows: pairs (frame, frame of the rig's file) that are copied digit for digit.
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
 * Why an HTTP request was refused, in one sentence. again: whether the rig has to be sent again.
 */
export interface Refusal {
  reason: string;
  again: boolean;
}
/**
 * What the command line opened: a BVH file, a project, or neither.
 */
export interface Opened {
  source: SourceFile | null;
  project: Project | null;
}
/**
 * The BVH file of a project.
 */
export interface SourceFile {
  name: string;
  text: string;
}
/**
 * A project file, `.interpose`: self-contained JSON.
 */
export interface Project {
  format: 1;
  name: string;
  source: SourceFile;
  keys: ProjectKey[];
}
/**
 * A key. pose: its row, 32-bit floats in base64; None for the pose of the source frame. source: the frame of the
 * source file, if the pose is unchanged. after: the gap that follows. motion: the frames shown there, in base64, where
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
