"""All that the studio's server and its browser say to one another, in this one file.

The TypeScript types are made from it (`python -m interpose.studio.protocol` prints the JSON schema, and
`web/src/protocol.ts` is generated; a test holds the two together).

**Envelopes.** Every message of the websocket, and every body of HTTP that holds poses, is an envelope: four bytes with
the length of a JSON header (unsigned, little-endian), the header in UTF-8 padded with spaces to a multiple of four,
then the arrays that the header's `arrays` names, in that order, as little-endian 32-bit floats (`wire`).

**Poses.** A pose of a rig with J joints is one row of 3 + 4 J floats: the root's position in metres, then each joint's
rotation in its parent's frame as a quaternion (x, y, z, w). Where the rig is ``moved`` (its file animates the positions
of joints), 3 J more follow: each joint's place in its parent's frame.

**HTTP.** POST /api/rigs?name=NAME with the bytes of a BVH file answers :class:`Rig`. GET /api/opened answers
:class:`Opened`, what the command line named. GET /api/sample answers a :class:`Project`. POST /api/projects with a
project file answers the same as :class:`Project` once it is checked. POST /api/export with :class:`Export` answers the
bytes of the file. What cannot be served answers with a status of 400 or more and a :class:`Refusal`.

**Websocket** at /api/socket: the browser sends one of :data:`Asked`, the server one of :data:`Told`. An answer has the
``id`` of what it answers. A new `generate` for a gap takes the place of an older one that is not answered yet: that one
is told to be `dropped`.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter
from pydantic.json_schema import models_json_schema

LARGEST_UPLOAD = 64 * 1024 * 1024
"""Bytes of a file, a project or an export at most."""
LARGEST_MESSAGE = 4 * 1024 * 1024
"""Bytes of a message of the websocket at most."""
MOST_MESSAGES = 60
"""Messages a second that a connection may send for long; four times as many at once."""
MOST_VARIANTS = 16
MOST_FRAMES = 6000
"""Frames of a gap at most."""
MOST_POINTS = 2000
"""Points of a path at most."""
FORMAT = 1
"""Version of the project file."""

Id = Annotated[str, Field(min_length=1, max_length=64)]
Label = Annotated[str, Field(min_length=1, max_length=120)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Frame = Annotated[int, Field(ge=0, le=1_000_000)]
Seed = Annotated[int, Field(ge=0, le=2**31 - 1)]
Method = Literal["dcmoe", "stitch", "interp"]
Speed = Literal["fast", "medium", "slow"]
Shape = Annotated[list[Annotated[int, Field(ge=0, le=2**31 - 1)]], Field(max_length=4)]
Numbered = Annotated[int, Field(ge=0, le=2**53 - 1)]
"""What a question is called; a number that both sides hold exactly."""


class Part(BaseModel):
    """What all parts of the protocol have in common: nothing unknown, and it does not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Way(Part):
    """A path by its name: matched from the gallery, straight, or the network's own."""

    kind: Literal["auto", "straight", "none"]


class Line(Part):
    """A path by its points.

    points: x, z on the ground in metres of the rig. times: seconds from the start key at which each is passed. facing:
    yaw at each, radians from +Z towards +X, unwrapped. drawn: by hand, and then points are the curve's control points.
    """

    kind: Literal["line"]
    points: Annotated[list[tuple[Number, Number]], Field(min_length=1, max_length=MOST_POINTS)]
    times: Annotated[list[Number], Field(max_length=MOST_POINTS)] | None = None
    facing: Annotated[list[Number], Field(max_length=MOST_POINTS)] | None = None
    drawn: bool = True


Path = Annotated[Way | Line, Field(discriminator="kind")]


class Blend(Part):
    """A second style, and its share of the whole."""

    style: Label
    share: Annotated[float, Field(ge=0.0, le=1.0)]


class Ends(Part):
    """What every question about a gap has: the rig, and two arrays of poses.

    arrays: ``start`` (frame, row), known frames up to the start key, which comes last; ``target`` (frame, row), known
    frames from the target key on, which comes first.
    """

    id: Numbered
    rig: Id
    arrays: dict[str, Shape]
    style: Label | None = None
    blend: Blend | None = None


class Generate(Ends):
    """Candidates for a gap. Answer: `candidates`. live: while something is dragged; one candidate, soon."""

    type: Literal["generate"]
    gap: Id
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)]
    method: Method
    path: Path
    variants: Annotated[int, Field(ge=1, le=MOST_VARIANTS)]
    seed: Seed
    live: bool = False


class Cancel(Part):
    """The gap's candidates are no longer wanted."""

    type: Literal["cancel"]
    gap: Id
    arrays: dict[str, Shape] = {}


class Suggest(Ends):
    """How long should the gap take? Answer: `suggested`."""

    type: Literal["suggest"]


class Paths(Ends):
    """Which ways does the gallery know? frames: of the gap. Answer: `ways`."""

    type: Literal["paths"]
    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)]
    count: Annotated[int, Field(ge=1, le=12)]
    seed: Seed


class Mirror(Part):
    """A pose with left and right exchanged about its own facing. arrays: ``pose`` (1, row). Answer: `posed`."""

    type: Literal["mirror"]
    id: Numbered
    rig: Id
    arrays: dict[str, Shape]


class Library(Part):
    """The poses that ship, on a rig. Answer: `library`."""

    type: Literal["library"]
    id: Numbered
    rig: Id
    arrays: dict[str, Shape] = {}


Asked = Annotated[Generate | Cancel | Suggest | Paths | Mirror | Library, Field(discriminator="type")]


class MethodInfo(Part):
    """A method that can be asked for. styles: of its model, none for interpolation. paths: whether it follows them."""

    method: Method
    model: str | None
    licence: str | None
    styles: list[str]
    paths: bool


class Welcome(Part):
    """The first message of every connection."""

    type: Literal["welcome"]
    version: str
    methods: list[MethodInfo]
    arrays: dict[str, Shape] = {}


class CandidateInfo(Part):
    """What is told of one candidate.

    style: of this variant. trajectory: where its path is from (matched, composed, drawn, straight, model), or None.
    foot_slide: cm a frame, None where the rig's feet are not known. fallback: what could not be served as asked, and
    what served instead.
    """

    method: Method
    style: str | None
    trajectory: str | None
    foot_slide: float | None
    fit: float | None
    path_deviation: float | None
    fallback: str | None


class Candidates(Part):
    """The answer to `generate`, best first. arrays: ``frames`` (candidate, frame, row), without the keys. seconds: of
    the server's work."""

    type: Literal["candidates"]
    id: Numbered
    gap: Id
    live: bool
    infos: list[CandidateInfo]
    seconds: float
    arrays: dict[str, Shape]


class Dropped(Part):
    """A `generate` that was not answered because a newer one, or `cancel`, came."""

    type: Literal["dropped"]
    id: Numbered
    gap: Id
    arrays: dict[str, Shape] = {}


class Failed(Part):
    """What could not be served, and why, in one sentence. again: whether the rig has to be sent again."""

    type: Literal["failed"]
    id: Numbered
    gap: Id | None
    reason: str
    again: bool = False
    arrays: dict[str, Shape] = {}


class Alternative(Part):
    """A duration. fit: the share of the gallery's trajectories with that speed."""

    speed: Speed
    frames: int
    fit: float


class Suggested(Part):
    """The answer to `suggest`."""

    type: Literal["suggested"]
    id: Numbered
    frames: int
    alternatives: list[Alternative]
    arrays: dict[str, Shape] = {}


class WayInfo(Part):
    """A trajectory of the gallery. line: ready to be a gap's path. frames: what it took when it was walked, in the
    rig's rate. fit: 0 to 1. composed: of several windows."""

    line: Line
    frames: int
    style: str | None
    fit: float
    composed: bool


class Ways(Part):
    """The answer to `paths`, the likeliest first; none, with the reason, where none leads there."""

    type: Literal["ways"]
    id: Numbered
    ways: list[WayInfo]
    reason: str | None
    arrays: dict[str, Shape] = {}


class Posed(Part):
    """The answer to `mirror`. arrays: ``pose`` (1, row)."""

    type: Literal["posed"]
    id: Numbered
    arrays: dict[str, Shape]


class LibraryPoses(Part):
    """The answer to `library`. arrays: ``poses`` (pose, row), hips above the origin, facing +Z."""

    type: Literal["library"]
    id: Numbered
    names: list[str]
    arrays: dict[str, Shape]


Told = Annotated[
    Welcome | Candidates | Dropped | Failed | Suggested | Ways | Posed | LibraryPoses, Field(discriminator="type")
]


class Foot(Part):
    """A joint of a foot. height: above the floor when the foot is flat on it, metres of the rig."""

    joint: int
    height: float


class Rig(Part):
    """An opened BVH file: its skeleton, its figure and its frames.

    id: of the file's contents; the same bytes have the same. humanoid: for each of the 22 joints that it has, its own
    joint. reason: None, or why it is no humanoid, so that only interpolation serves it. size: metres, about the height
    of its hips. notes: what was odd about the file.

    arrays: ``offsets`` (joint, 3), each joint's place in its parent's frame. ``frames`` (frame, row). The figure's
    ``vertices`` and ``normals`` (vertex, 3), in the frame of the joint ``carriers`` (vertex,); ``triangles``
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
    feet: list[Foot]
    size: float
    arrays: dict[str, Shape]


class Export(Part):
    """A whole motion to be written. rows: (frame, frame of the rig's file) that come out digit for digit.

    arrays: ``frames`` (frame, row).
    """

    rig: Id
    format: Literal["bvh", "glb"]
    rows: list[tuple[Frame, Frame]]
    arrays: dict[str, Shape]


class Refusal(Part):
    """Why a request of HTTP was refused, in one sentence. again: whether the rig has to be sent again."""

    reason: str
    again: bool = False


class Source(Part):
    """The BVH file that a project is about, whole."""

    name: Label
    text: str


class GapSettings(Part):
    """What is asked of the gap after a key.

    method: ``clip`` keeps the source's own frames, which lie between the two keys' source frames. speed: how
    the duration was chosen, None by frames. chosen: which candidate shows. locked: it stays as it is.
    """

    method: Literal["clip"] | Method
    style: Label | None = None
    blend: Blend | None = None
    path: Path = Way(kind="auto")
    variants: Annotated[int, Field(ge=1, le=MOST_VARIANTS)] = 4
    seed: Seed = 0
    speed: Speed | None = None
    chosen: Annotated[int, Field(ge=0, lt=MOST_VARIANTS)] = 0
    locked: bool = False


class ProjectKey(Part):
    """A key. pose: its row, 32-bit floats in base64; None for the pose of the source's frame. source: the frame of the
    source's file that it is, unchanged. after: the gap that follows. motion: the frames shown there, in base64, where
    they are worth keeping."""

    id: Id
    frame: Frame
    pose: str | None
    source: Frame | None
    after: GapSettings
    motion: str | None = None


class Project(Part):
    """A project file, `.interpose`: JSON, with all that it needs in it."""

    format: Literal[1]
    name: Label
    source: Source
    keys: Annotated[list[ProjectKey], Field(max_length=5000)]


class Opened(Part):
    """What the command line named: a BVH file, a project, or neither."""

    source: Source | None
    project: Project | None


ASKED: TypeAdapter[Asked] = TypeAdapter(Asked)
TOLD: TypeAdapter[Told] = TypeAdapter(Told)


def schema() -> dict[str, Any]:
    """The JSON schema of everything above, for the TypeScript types; fields that have a default count as given."""
    asked = (Generate, Cancel, Suggest, Paths, Mirror, Library)
    told = (Welcome, Candidates, Dropped, Failed, Suggested, Ways, Posed, LibraryPoses)
    alone = (Rig, Export, Refusal, Opened)
    _, made = models_json_schema(
        [(model, "serialization") for model in (*asked, *told, *alone)], ref_template="#/$defs/{model}"
    )
    definitions = _plain(made["$defs"])
    definitions["Asked"] = {"anyOf": [{"$ref": f"#/$defs/{model.__name__}"} for model in asked]}
    definitions["Told"] = {"anyOf": [{"$ref": f"#/$defs/{model.__name__}"} for model in told]}
    roots = ("Asked", "Told", *(model.__name__ for model in alone))
    return {
        "title": "Protocol",
        "description": "Everything that travels between the studio's server and its browser.",
        "type": "object",
        "properties": {name.lower(): {"$ref": f"#/$defs/{name}"} for name in roots},
        "required": [name.lower() for name in roots],
        "$defs": definitions,
    }


def _plain(held: Any) -> Any:
    """A schema in the words that json2ts knows: tuples as lists of items, no titles, no lengths of lists."""
    if isinstance(held, list):
        return [_plain(each) for each in held]
    if not isinstance(held, dict):
        return held
    tuple_ = held.get("prefixItems")
    dropped = {"prefixItems", *(() if tuple_ else ("minItems", "maxItems"))}
    if not isinstance(held.get("title"), dict):
        dropped.add("title")
    plain = {key: _plain(value) for key, value in held.items() if key not in dropped}
    if isinstance(held.get("properties"), dict):
        plain["required"] = list(held["properties"])
    return plain | ({"items": _plain(tuple_)} if tuple_ else {})


if __name__ == "__main__":
    print(json.dumps(schema(), indent=1))
