"""Partial targets: the whole pose that a transition leads to where only some joints of its target are given.

The model's completion network predicts the pose (`interpose.models.target_pose`); without one the start pose is carried
along. Inverse kinematics then makes the given parts exact, first on the 22 joints, in the end on the user's own rig.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import retarget, rotation
from interpose import skeleton as kinematics
from interpose.data.contacts import CONTACT_INDICES, REST_HEIGHTS
from interpose.data.root import pose_yaw
from interpose.errors import InputError
from interpose.features import RATE
from interpose.motion import Motion, from_global
from interpose.parts import Parts
from interpose.rotation import FORWARD, UP
from interpose.runtime import planner, poses
from interpose.runtime.gap_batch import draws
from interpose.runtime.ik.two_bone import two_bone_ik
from interpose.runtime.ik.whole_body import Ease, JointTargets, solve
from interpose.runtime.interpolate import aligned
from interpose.runtime.request import Request
from interpose.runtime.resampling import MODEL_RATE, recent
from interpose.skeleton import HUMANOID

TARGET_TEMPERATURE = 0.8
"""How far variants lie from the likeliest pose, as a share of the prior's deviation."""
SHORT = 1e-3
"""Metres: a larger miss is reported."""
PACE = 1.2
"""Metres a second of a character whose duration is not yet known."""
_SUPPLE = {"Hips": 0.1, "Spine": 0.15, "Spine1": 0.15, "Spine2": 0.15, "Neck": 0.3, "Shoulder": 0.2}
"""How easily joints turn beside the others, whose ease is 1."""
EASE = Ease(
    np.array([_SUPPLE.get(name.removeprefix("Left").removeprefix("Right"), 1.0) for name in HUMANOID.names]), 0.05
)
_LIMBS = [
    tuple(HUMANOID.index(side + bone) for bone in bones)
    for side in ("Left", "Right")
    for bones in (("Arm", "ForeArm", "Hand"), ("UpLeg", "Leg", "Foot"))
]
_FEET = [tuple(HUMANOID.index(side + bone) for bone in ("Foot", "Toe", "Leg", "UpLeg")) for side in ("Left", "Right")]
_FOOT = float(np.linalg.norm(HUMANOID.offsets[HUMANOID.index("LeftToe")]))
_SLACK = 0.02
"""Metres that an ankle may be under its resting height, as on toes that are bent when kneeling."""
_THICK = 0.03
"""Metres from the floor to the middle of a knee or a hand that lies on it."""
_SUNK = 0.005


@dataclass(frozen=True, eq=False)
class Ending:
    """A completed target on the user's rig, one frame; and what could not be had of it, or None."""

    pose: Motion
    note: str | None


def complete(
    start: Motion,
    target: Motion,
    parts: Parts,
    request: Request,
    mapping: retarget.Mapping | str,
    steps: int | None,
    count: int = 1,
) -> list[Ending]:
    """``count`` whole poses with the given ``parts`` of ``target``'s first frame, the likeliest first.

    ``start``: its last frame is the start key, those before it are context. steps: from start to target at 30 Hz, None
    where that is not known yet. Raises InputError where the rig is no
    humanoid, and where it has none of the given joints.
    """
    if isinstance(mapping, str):
        raise InputError(f"a target can be given in part on a humanoid only: {mapping}; give all of it")
    given = [joint for joint in parts.joints if mapping.joints[joint] is not None]
    if not given and not parts.ground:
        names = ", ".join(HUMANOID.names[joint] for joint in parts.joints)
        raise InputError(f"the rig has no joint that stands for {names}; give other target joints")
    parts = replace(parts, joints=tuple(given))
    begin, goal = aligned(start[-1], target[0])
    context = retarget.to_humanoid(recent(start, 2), mapping)
    goal22 = retarget.to_humanoid(goal, mapping)
    if request.abilities.partial_targets:
        found = _predicted(request, context, goal22, parts, steps, count)
        note = None
    else:
        found = [_carried(context[-1], goal22, parts)] * count
        model = request.model
        named = f"method '{request.method}'" if model is None or model.completes else f"the model '{model.name}'"
        note = f"{named} completes no partial targets; the rest of the target is as in the start pose"
    details = _details(begin, goal, parts, mapping)
    return [_ending(pose, stands, goal22, goal, parts, mapping, details, note) for pose, stands in found]


def missed(pose: Motion, target: Motion, parts: Parts, mapping: retarget.Mapping) -> tuple[float, float]:
    """The largest distance, metres, and the largest angle, degrees, of the given parts between two poses on a rig.

    Of the ground they are those of the hips' place on it and of their facing.
    """
    joints = [joint for joint in (mapping.joints[each] for each in parts.joints) if joint is not None]
    distance = np.linalg.norm(pose.global_positions() - target.global_positions(), axis=-1)[0, joints]
    turned, wanted = pose.global_rotations()[0], target.global_rotations()[0]
    angle = (
        rotation.angle(rotation.multiply(rotation.inverse(turned[joints]), wanted[joints])) if joints else np.zeros(0)
    )
    far, off = float(distance.max(initial=0.0)), float(angle.max(initial=0.0))
    if parts.ground:
        hips = mapping.hips
        step = (pose.global_positions() - target.global_positions())[0, hips, [0, 2]]
        facing = _facing(turned[hips], mapping) - _facing(wanted[hips], mapping)
        far, off = max(far, float(np.linalg.norm(step))), max(off, abs(float(rotation.wrapped(facing))))
    return far, float(np.degrees(off))


def _facing(hips: Float[ndarray, "4"], mapping: retarget.Mapping) -> float:
    """The yaw of a rig's hips."""
    return float(pose_yaw(rotation.multiply(hips, rotation.inverse(mapping.rest_global[0]))))


Stands = Float[ndarray, "4"]
"""The probability that each foot joint stands on the ground."""


def _predicted(
    request: Request, context: Motion, goal: Motion, parts: Parts, steps: int | None, count: int
) -> list[tuple[Motion, Stands]]:
    """The network's poses, in ``count`` variants."""
    model = request.model
    assert model is not None
    known = poses.pose_of(context.root_positions, context.local_rotations)
    aim = poses.pose_of(goal.root_positions, goal.local_rotations)
    velocity = np.zeros((1, len(HUMANOID), 3))
    if len(context) > 1:
        velocity = (known.positions[-1:] - known.positions[-2:-1]) * RATE
    if steps is None:
        at = aim.positions[0, list(parts.joints) or [0]].mean(axis=0)
        away = float(np.linalg.norm((at - known.hips[-1])[[0, 2]]))
        steps = int(np.clip(away / PACE * RATE, 15.0, 90.0))
    noise = planner.noise(draws(request.seed, count), (model.target_latent,), TARGET_TEMPERATURE)
    one = {
        "start_hips": known.hips[-1:],
        "start_rotations": known.rotations[-1:],
        "start_velocities": velocity,
        "velocity_known": np.full((1, 1), float(len(context) > 1)),
        "target_hips": aim.hips,
        "target_rotations": aim.rotations,
        "joints": parts.known[None].astype(float),
        "ground": np.full((1, 1), float(parts.ground)),
        "frames": np.full((1, 1), float(steps)),
        "style": model.style_weights([request.style], request.style_strength),
    }
    feed = {name: np.repeat(value, count, axis=0) for name, value in one.items()} | {"noise": noise}
    out = model.run("target", {name: value.astype(np.float32) for name, value in feed.items()})
    world = rotation.from_6d(out["rotations"].astype(float))
    made = from_global(HUMANOID, out["hips"].astype(float), world, MODEL_RATE)
    return [(made[row], out["contacts"][row].astype(float)) for row in range(count)]


def _carried(start: Motion, goal: Motion, parts: Parts) -> tuple[Motion, Stands]:
    """The start pose where the given part is, and what stands in it: turned with the hips, where those are given."""
    pose, stands = start, (start.global_positions()[0, CONTACT_INDICES, 1] < REST_HEIGHTS + _SLACK).astype(float)
    if 0 in parts.joints or parts.ground:
        pose = _facing_as(pose, goal)
        move = goal.root_positions[0] - pose.root_positions[0]
    else:
        joints = list(parts.joints)
        move = (goal.global_positions() - pose.global_positions())[0, joints].mean(axis=0)
    return replace(pose, root_positions=pose.root_positions + move * [1.0, 0.0, 1.0]), stands


def _facing_as(pose: Motion, goal: Motion) -> Motion:
    """A pose turned about its hips to face as ``goal`` does, both on the 22 joints."""
    turn = float(pose_yaw(goal.local_rotations[0, 0]) - pose_yaw(pose.local_rotations[0, 0]))
    local = pose.local_rotations.copy()
    local[:, 0] = rotation.multiply(rotation.from_rotation_vector(turn * UP), local[:, 0])
    return replace(pose, local_rotations=local)


def _ending(
    pose: Motion,
    stands: Stands,
    goal22: Motion,
    goal: Motion,
    parts: Parts,
    mapping: retarget.Mapping,
    details: Motion,
    note: str | None,
) -> Ending:
    """The pose with the given parts where they are given: on the 22 joints, then on the rig."""
    if parts.ground and 0 not in parts.joints:
        pose = _facing_as(pose, goal22)
    wanted = _wanted(pose, goal22, parts, {joint: joint for joint in range(len(HUMANOID))})
    feet = _standing(pose, stands, parts)
    reached, _ = _solved(_bent(pose, wanted, feet), wanted, feet, EASE)
    for _ in range(2):
        sunk = _sunk(reached, parts)
        if not sunk:
            break
        feet = sunk | feet
        reached, _ = _solved(reached, wanted, feet, EASE)
    made = replace(retarget.from_humanoid(replace(reached, rate=details.rate), mapping, details), layout=goal.layout)
    joints = {ours: joint for ours, joint in enumerate(mapping.joints) if joint is not None}
    at = made.global_positions()[0]
    kept = {joints[ours]: at[joints[ours]] + 0.0 * place for ours, place in feet.items() if ours in joints}
    ease = np.zeros(len(mapping.skeleton))
    ease[list(joints.values())] = EASE.joints[list(joints)]
    ease = Ease(ease, EASE.root / mapping.scale**2)
    made, miss = _solved(made, _wanted(made, goal, parts, joints), kept, ease)
    if miss > SHORT:
        short = f"the target's given part cannot be reached by {miss * 100:.1f} cm; give less of it, or a nearer one"
        note = short if note is None else f"{note}; {short}"
    return Ending(made, note)


def _wanted(pose: Motion, goal: Motion, parts: Parts, joints: dict[int, int]) -> JointTargets:
    """The given parts of ``goal``; ``joints``: what stands for each of the 22 in both. Hips of which only the ground is
    given keep their height and their turn, which faces the right direction already."""
    at, turned = goal.global_positions()[0], goal.global_rotations()[0]
    wanted = JointTargets(
        {joints[ours]: at[joints[ours]] for ours in parts.joints},
        {joints[ours]: turned[joints[ours]] for ours in parts.joints},
    )
    hips = joints[0]
    if parts.ground and hips not in wanted.positions:
        wanted.positions[hips] = np.where([True, False, True], at[hips], np.nan)
        wanted.rotations[hips] = pose.global_rotations()[0, hips]
    return wanted


def _solved(
    pose: Motion, wanted: JointTargets, feet: dict[int, Float[ndarray, "3"]], ease: Ease
) -> tuple[Motion, float]:
    """The pose that meets what is wanted, with its feet where they stand if that can be; and what it misses."""
    both = replace(wanted, positions=feet | wanted.positions)
    made, miss = solve(pose, both, ease)
    return (made, miss) if miss < SHORT / 10.0 or not feet else solve(made, wanted, ease)


def _bent(pose: Motion, wanted: JointTargets, feet: dict[int, Float[ndarray, "3"]]) -> Motion:
    """The pose with arms and legs whose ends are wanted within their reach bent, in their planes, to be there."""
    goals = feet | wanted.positions
    world = pose.global_rotations()[0]
    at = pose.global_positions()[0]
    facing = rotation.rotate(rotation.twist(world[0], UP), FORWARD)
    for upper, lower, end in _LIMBS:
        if end not in goals or upper in wanted.rotations or lower in wanted.rotations:
            continue
        length = np.linalg.norm(at[lower] - at[upper]) + np.linalg.norm(at[end] - at[lower])
        if np.linalg.norm(goals[end] - at[upper]) < 0.98 * length:
            ahead = facing if HUMANOID.names[end].endswith("Foot") else -facing
            turns = two_bone_ik(at[upper], at[lower], at[end], goals[end], ahead)
            for joint, turn in zip((upper, lower), turns, strict=True):
                world[joint] = rotation.multiply(turn, world[joint])
    local = kinematics.local_rotations(world, HUMANOID.parents)
    return replace(pose, local_rotations=local[None])


def _standing(pose: Motion, stands: Stands, parts: Parts) -> dict[int, Float[ndarray, "3"]]:
    """Where the ankles and toes of free legs are to be on the 22 joints: on the floor where they stand, and not under
    it. A foot that hangs in the air is not spoken of."""
    at, out = pose.global_positions()[0], {}
    for side, (ankle, toe, *above) in enumerate(_FEET):
        if {ankle, toe, *above} & {*parts.joints}:
            continue
        down = stands[2 * side : 2 * side + 2] > 0.5
        lowest = REST_HEIGHTS[:2] - [_SLACK, 0.0]
        heights = np.array([at[ankle, 1], at[toe, 1]])
        if down.all():
            along = (at[toe] - at[ankle]) * [1.0, 0.0, 1.0]
            fall = REST_HEIGHTS[1] - REST_HEIGHTS[0]
            along *= np.sqrt(_FOOT**2 - fall**2) / max(float(np.linalg.norm(along)), 1e-6)
            out[ankle] = at[ankle] * [1.0, 0.0, 1.0] + REST_HEIGHTS[0] * UP
            out[toe] = out[ankle] + along + fall * UP
        elif down.any() or (heights < lowest).any():
            rise = (REST_HEIGHTS[:2] - heights)[down] if down.any() else lowest - heights
            rise = max(float(rise.max()), float((lowest - heights).max()))
            out[ankle], out[toe] = at[ankle] + rise * UP, at[toe] + rise * UP
    return out


def _sunk(pose: Motion, parts: Parts) -> dict[int, Float[ndarray, "3"]]:
    """How high the free joints of a pose on the 22 are to be, wherever, that lie under the floor."""
    heights = pose.global_positions()[0, :, 1]
    level = np.full(len(HUMANOID), _THICK)
    level[[*CONTACT_INDICES]] = REST_HEIGHTS - np.tile([_SLACK, 0.0], 2)
    return {
        joint: np.array([np.nan, level[joint], np.nan])
        for joint in np.flatnonzero(heights < level - _SUNK).tolist()
        if joint not in parts.joints
    }


def _details(start: Motion, goal: Motion, parts: Parts, mapping: retarget.Mapping) -> Motion:
    """What the 22 joints do not carry (fingers, twists): the target's below its given joints, the start's elsewhere."""
    ours = {joint: each for each, joint in enumerate(mapping.joints) if joint is not None}
    theirs: list[int] = []
    owner: list[int] = []
    for joint, parent in enumerate(mapping.skeleton.parents):
        owner.append(ours.get(joint, -1 if parent < 0 else owner[parent]))
        if owner[joint] in parts.joints:
            theirs.append(joint)
    local = start.local_rotations.copy()
    local[:, theirs] = goal.local_rotations[:, theirs]
    moved = None
    if start.translations is not None and goal.translations is not None:
        moved = start.translations.copy()
        moved[:, theirs] = goal.translations[:, theirs]
    return replace(start, local_rotations=local, translations=moved)
