"""What is known of a generated transition and of the time that one should take."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SpeedOption:
    """A duration that the gallery suggests for a gap. fit: the share of all candidates, by weight, of that speed."""

    speed: str
    frames: int
    fit: float


@dataclass(frozen=True)
class SuggestedDuration:
    """How many frames a gap should take, and what fast, medium and slow would be."""

    frames: int
    alternatives: tuple[SpeedOption, ...]


@dataclass(frozen=True)
class Info:
    """Of one transition; the fields are those of `--json`.

    start, target: the keys, as frames of the clip or as they were named. method, model: that served. path: as
    requested. trajectory: where the root's path is from: matched, composed, drawn, straight, model where it is
    unconstrained, or None where it is interpolated. path_deviation_m: the root's mean distance from that path on the
    ground, None without one. fit: of a matched path, 0 to 1. foot_slide_cm_per_frame: of the delivered motion with its
    keys, per 30 Hz frame; None where the rig's feet are not known. seconds: wall time of the gap, all variants
    together. fallback: None, or what could not be served as requested, why, and what served instead. speed,
    style_strength, target_joints: as requested; where only some joints of the target were given the arrival errors are
    theirs. suggested: where no number of frames was given.
    """

    start: int | str
    target: int | str
    frames: int
    method: str
    model: str | None
    style: str | None
    path: str
    seed: int
    arrival_position_error_m: float
    arrival_rotation_error_deg: float
    foot_slide_cm_per_frame: float | None
    seconds: float
    fallback: str | None
    speed: str | None = None
    trajectory: str | None = None
    path_deviation_m: float | None = None
    fit: float | None = None
    suggested: SuggestedDuration | None = None
    style_strength: float = 1.0
    target_joints: str | None = None
