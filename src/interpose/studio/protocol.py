"""Everything that the studio's server and its browser send to each other.

The types of project files are in `project_format`. The TypeScript types in `web/src/protocol.ts` come from both
by `web/protocol.sh`; a test fails when the two differ.

**Envelopes.** Every websocket message, and every HTTP body that holds poses, is an envelope: four bytes with the length
of a JSON header (unsigned, little-endian), the header in UTF-8, padded with spaces to a multiple of four, then the
arrays named in the header's `arrays`, in that order, as little-endian 32-bit floats (see `messages`).

**Poses.** A pose of a rig with J joints is a row of 3 + 4 J floats: the root position in metres, then each joint's
rotation relative to its parent as a quaternion (x, y, z, w). If the rig is ``moved`` (its file animates joint
positions), 3 J more follow: each joint's position relative to its parent.

**HTTP.** POST /api/rigs?name=NAME takes the bytes of a BVH file and returns a :class:`Rig`. GET /api/opened returns
:class:`Opened`, the file given on the command line. GET /api/sample returns a :class:`Project`. POST /api/projects
checks a project file and returns it as a :class:`Project`. POST /api/export takes an :class:`Export` and returns the
bytes of the file. Errors have a status of 400 or more and a :class:`Refusal` as their body.

**Websocket** at /api/socket: the browser sends :data:`ClientMessage`, the server :data:`ServerMessage`. An answer has
the ``id`` of its request. A new `generate` for a gap replaces an older one that is still unanswered; the older one is
answered with `dropped`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from interpose.studio.project_format import Frame, GapSettings, Id, PointPath, Project, ProtocolModel, SourceFile, Speed

LARGEST_UPLOAD = 64 * 1024 * 1024
"""Largest file, project or export in bytes."""
LARGEST_MESSAGE = 4 * 1024 * 1024
"""Largest websocket message in bytes."""
MOST_MESSAGES = 60
"""Messages per second that a connection may send; bursts may have four times as many."""
MOST_FRAMES = 6000
"""Most frames of a gap."""
Shape = Annotated[list[Annotated[int, Field(ge=0, le=2**31 - 1)]], Field(max_length=4)]
RequestId = Annotated[int, Field(ge=0, le=2**53 - 1)]
"""The browser's number of a request; JavaScript holds integers up to 2**53 exactly."""


class GapMessage(ProtocolModel):
    """Base of the requests about a gap.

    arrays: ``start`` (frame, row), the known frames up to and including the start key; ``target`` (frame, row), the
    known frames from the target key on.
    """

    id: RequestId
    rig: Id
    arrays: dict[str, Shape]
    settings: GapSettings


class Generate(GapMessage):
    """Generates candidates for a gap. Answer: `candidates`. live: sent during a drag, for one candidate."""

    type: Literal["generate"]
    gap: Id
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)]
    live: bool = False


class Cancel(ProtocolModel):
    """Cancels the unanswered requests for a gap's candidates."""

    type: Literal["cancel"]
    gap: Id
    arrays: dict[str, Shape] = Field(default_factory=dict)


class SuggestDuration(GapMessage):
    """Asks how long a gap should be. Answer: `suggested`."""

    type: Literal["suggest"]


class FindPaths(GapMessage):
    """Asks for trajectories of the gallery that fit a gap of so many frames. Answer: `gallery-paths`."""

    type: Literal["paths"]
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)]
    count: Annotated[int, Field(ge=1, le=12)]


class Mirror(ProtocolModel):
    """Swaps left and right of a pose about its own facing. arrays: ``pose`` (1, row). Answer: `mirrored`."""

    type: Literal["mirror"]
    id: RequestId
    rig: Id
    arrays: dict[str, Shape]


class Library(ProtocolModel):
    """Asks for the bundled poses on a rig. Answer: `library`."""

    type: Literal["library"]
    id: RequestId
    rig: Id
    arrays: dict[str, Shape] = Field(default_factory=dict)


ClientMessage = Annotated[
    Generate | Cancel | SuggestDuration | FindPaths | Mirror | Library, Field(discriminator="type")
]


class MethodInfo(ProtocolModel):
    """A method with a model that serves it, and what the two can do (`interpose.runtime.backends.backend.Abilities`).

    summary: one phrase. model: None if it needs none. styles: of the model. paths: whether the root can follow a path.
    gallery: whether the model has its own. partial_targets: whether a network completes targets given in part.
    variants: whether candidates differ. longest_seconds: of a gap. any_rig: also serves rigs that are not humanoid.
    """

    method: str
    summary: str
    model: str | None
    licence: str | None
    styles: list[str]
    paths: bool
    gallery: bool
    partial_targets: bool
    variants: bool
    longest_seconds: float | None
    any_rig: bool


class Welcome(ProtocolModel):
    """The first message of every connection.

    methods: each method with each model that serves it, the default ones first. gallery: the name of the gallery that
    the studio was started with. target_parts: names for a gap's ``target_joints``.
    """

    type: Literal["welcome"]
    version: str
    methods: list[MethodInfo]
    gallery: str | None
    target_parts: list[str]
    arrays: dict[str, Shape] = Field(default_factory=dict)


class CandidateInfo(ProtocolModel):
    """What is known about one candidate.

    method, model: that generated it. style: of this variant. trajectory: the source of its path (matched, composed,
    drawn, straight, model), or None. foot_slide: cm per frame, None if the rig's feet are unknown. fallback: what could
    not be served, and what was used instead.
    """

    method: str
    model: str | None
    style: str | None
    trajectory: str | None
    foot_slide: float | None
    fit: float | None
    path_deviation: float | None
    fallback: str | None


class Candidates(ProtocolModel):
    """The answer to `generate`, best first. seconds: time that the server took.

    arrays: ``frames`` (candidate, frame, row), without the keys. If only some joints of the target were given, also
    ``targets`` (candidate, row), the complete poses that the candidates lead to.
    """

    type: Literal["candidates"]
    id: RequestId
    gap: Id
    live: bool
    infos: list[CandidateInfo]
    seconds: float
    arrays: dict[str, Shape]


class Dropped(ProtocolModel):
    """The answer to a `generate` that a newer one, or `cancel`, replaced."""

    type: Literal["dropped"]
    id: RequestId
    gap: Id
    arrays: dict[str, Shape] = Field(default_factory=dict)


class Failed(ProtocolModel):
    """The request failed, for a reason given in one sentence. again: whether the rig has to be sent again."""

    type: Literal["failed"]
    id: RequestId
    gap: Id | None
    reason: str
    again: bool = False
    arrays: dict[str, Shape] = Field(default_factory=dict)


class DurationOption(ProtocolModel):
    """A duration for a gap. fit: the share of the gallery's trajectories with that speed."""

    speed: Speed
    frames: int
    fit: float


class SuggestedDurations(ProtocolModel):
    """The answer to `suggest`."""

    type: Literal["suggested"]
    id: RequestId
    frames: int
    alternatives: list[DurationOption]
    arrays: dict[str, Shape] = Field(default_factory=dict)


class GalleryPath(ProtocolModel):
    """A trajectory of the gallery. path: ready to be a gap's path. frames: its original duration at the rig's rate.
    fit: 0 to 1. composed: of several windows."""

    path: PointPath
    frames: int
    style: str | None
    fit: float
    composed: bool


class GalleryPaths(ProtocolModel):
    """The answer to `paths`, the most likely first; empty, with the reason, if there is none."""

    type: Literal["gallery-paths"]
    id: RequestId
    paths: list[GalleryPath]
    reason: str | None
    arrays: dict[str, Shape] = Field(default_factory=dict)


class MirroredPose(ProtocolModel):
    """The answer to `mirror`. arrays: ``pose`` (1, row)."""

    type: Literal["mirrored"]
    id: RequestId
    arrays: dict[str, Shape]


class LibraryPoses(ProtocolModel):
    """The answer to `library`. arrays: ``poses`` (pose, row), hips above the origin, facing +Z."""

    type: Literal["library"]
    id: RequestId
    names: list[str]
    arrays: dict[str, Shape]


ServerMessage = Annotated[
    Welcome | Candidates | Dropped | Failed | SuggestedDurations | GalleryPaths | MirroredPose | LibraryPoses,
    Field(discriminator="type"),
]


class FootJoint(ProtocolModel):
    """A joint of a foot. height: above the floor when the foot is flat on it, in metres of the rig."""

    joint: int
    height: float


class Rig(ProtocolModel):
    """An opened BVH file: its skeleton, mannequin and frames.

    id: a hash of the file's contents. humanoid: the rig's joint for each of the 22 joints that it has. reason: None, or
    why it is not a humanoid, so that only interpolation serves it. size: roughly the height of the hips in metres.

    arrays: ``offsets`` (joint, 3), each joint's position relative to its parent. ``frames`` (frame, row). The
    mannequin's ``vertices`` and ``normals`` (vertex, 3), relative to the joint in ``carriers`` (vertex,); ``triangles``
    (triangle, 3); ``sides`` (triangle,), 0 middle, 1 left, 2 right.
    """

    id: Id
    name: str
    rate: float
    joints: list[str]
    parents: list[int]
    moved: bool
    profile: str | None
    reason: str | None
    humanoid: dict[str, int]
    feet: list[FootJoint]
    size: float
    arrays: dict[str, Shape]


class Export(ProtocolModel):
    """A whole motion to write. rows: pairs (frame, frame of the rig's file) that are copied digit for digit.

    arrays: ``frames`` (frame, row).
    """

    rig: Id
    format: Literal["bvh", "glb"]
    rows: list[tuple[Frame, Frame]]
    arrays: dict[str, Shape]


class Refusal(ProtocolModel):
    """Why an HTTP request was refused, in one sentence. again: whether the rig has to be sent again."""

    reason: str
    again: bool = False


class Opened(ProtocolModel):
    """What the command line opened: a BVH file, a project, or neither."""

    source: SourceFile | None
    project: Project | None


CLIENT_MESSAGE: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)
SERVER_MESSAGE: TypeAdapter[ServerMessage] = TypeAdapter(ServerMessage)
