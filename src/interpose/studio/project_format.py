"""The project file, `.interpose`, and the settings of a gap, which requests also send; see `protocol`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from interpose.runtime.request import MAX_STYLE_STRENGTH

MOST_VARIANTS = 16
LONGEST_PATH = 2000
"""Most points of a path."""

Id = Annotated[str, Field(min_length=1, max_length=64)]
Label = Annotated[str, Field(min_length=1, max_length=120)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Frame = Annotated[int, Field(ge=0, le=1_000_000)]
Seed = Annotated[int, Field(ge=0, le=2**31 - 1)]
Speed = Literal["fast", "medium", "slow"]


class ProtocolModel(BaseModel):
    """Base of all types here: immutable, without unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PathChoice(ProtocolModel):
    """A path by name: the best one, matched from the gallery, straight, or unconstrained."""

    kind: Literal["auto", "gallery", "straight", "none"]


class PointPath(ProtocolModel):
    """A path through points.

    points: x, z on the ground in metres of the rig. times: seconds from the start key at each point. facing: yaw at
    each point, radians from +Z towards +X, unwrapped. drawn: drawn by hand, so that points are the control points of a
    curve.
    """

    kind: Literal["waypoints"]
    points: Annotated[list[tuple[Number, Number]], Field(min_length=1, max_length=LONGEST_PATH)]
    times: Annotated[list[Number], Field(max_length=LONGEST_PATH)] | None = None
    facing: Annotated[list[Number], Field(max_length=LONGEST_PATH)] | None = None
    drawn: bool = True


Path = Annotated[PathChoice | PointPath, Field(discriminator="kind")]


class Blend(ProtocolModel):
    """A second style and its share of the blend."""

    style: Label
    share: Annotated[float, Field(ge=0.0, le=1.0)]


class GapSettings(ProtocolModel):
    """The settings of a gap, as a project has them and as requests send them.

    method: a name of the registry of backends, or ``clip``, which keeps the source's own frames between the source
    frames of the two keys. model: None for the first one that serves the method. style_strength: 0 as good as no style,
    1 as trained, up to 3 exaggerated. path_control: weight of the path against the predicted one. own_gallery: use the
    model's gallery even if the studio was started with another one. target_joints: the joints of the target to meet, as
    in `between --target-joints`; None for the whole pose. speed: set if the duration was chosen by speed. chosen: which
    candidate is shown. locked: nothing changes it.
    """

    method: Label
    model: Label | None = None
    style: Label | None = None
    blend: Blend | None = None
    style_strength: Annotated[float, Field(ge=0.0, le=MAX_STYLE_STRENGTH)] = 1.0
    path: Path = PathChoice(kind="auto")
    path_control: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    own_gallery: bool = False
    target_joints: Annotated[str, Field(min_length=1, max_length=400)] | None = None
    variants: Annotated[int, Field(ge=1, le=MOST_VARIANTS)] = 4
    seed: Seed = 0
    speed: Speed | None = None
    chosen: Annotated[int, Field(ge=0, lt=MOST_VARIANTS)] = 0
    locked: bool = False


class SourceFile(ProtocolModel):
    """The BVH file of a project."""

    name: Label
    text: str


class ProjectKey(ProtocolModel):
    """A key. pose: its row, 32-bit floats in base64; None for the pose of the source frame. source: the frame of the
    source file, if the pose is unchanged. after: the gap that follows. motion: the frames shown there, in base64, where
    they are worth keeping."""

    id: Id
    frame: Frame
    pose: str | None
    source: Frame | None
    after: GapSettings
    motion: str | None = None


class Project(ProtocolModel):
    """A project file, `.interpose`: self-contained JSON."""

    format: Literal[1]
    name: Label
    source: SourceFile
    keys: Annotated[list[ProjectKey], Field(max_length=5000)]
