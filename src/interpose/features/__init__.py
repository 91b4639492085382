"""The named layout of what goes into DC-MoE and what comes out, shared by training, export and run time.

Nothing here computes: a :class:`Layout` is names and widths, and both sides read and write by name, with the total
width checked. Sizes are those of DC-MoE (Chu and Yang 2024, section 3.1); blocks that the paper lacks are marked.
"""

from __future__ import annotations

from dataclasses import dataclass

from interpose.data.contacts import CONTACT_JOINTS
from interpose.skeleton import HUMANOID, MODEL_RATE

RATE = MODEL_RATE
JOINTS = len(HUMANOID)
POSE = 3 + JOINTS * 6
"""Numbers of a pose: the hips' position, then the joints' global rotations as 6-D."""
RESIDUAL_HIPS_SCALE = 0.02
RESIDUAL_ROTATION_SCALE = 0.08
"""One unit of what a network adds to its base: metres for the hips, 6-D for the joints."""
CHANNELS = 10
"""Phase channels (section 3.1.2)."""
KEYS = 13
"""Keys of the time window of 2 s: 6 past, the present, 6 future (section 3.1.1)."""
SIDE_KEYS = 6
KEY_STEP = 5
"""Frames between neighbouring keys: 1/6 s."""
HISTORY = SIDE_KEYS * KEY_STEP + 1
"""Frames of past that the window needs, the present one included."""
LONGEST_ARRIVAL = 91
"""Longest time to arrival seen in training, in frames (3 s); longer ones are shown to the network as this."""


@dataclass(frozen=True)
class Layout:
    """Named blocks of a flat vector, in order. ``blocks`` maps a name to its width."""

    blocks: tuple[tuple[str, int], ...]

    @property
    def width(self) -> int:
        """Length of the whole vector."""
        return sum(width for _, width in self.blocks)

    def slices(self) -> dict[str, slice]:
        """Where each block lies."""
        out, start = {}, 0
        for name, width in self.blocks:
            out[name] = slice(start, start + width)
            start += width
        return out

    def sizes(self) -> list[int]:
        """The widths in order, for a split."""
        return [width for _, width in self.blocks]


EXPERT_INPUT = Layout(
    (
        ("position", JOINTS * 3),  # X^C: joint positions, rotations, velocities in the current root's frame
        ("rotation", JOINTS * 6),
        ("velocity", JOINTS * 3),
        ("target_position", JOINTS * 3),  # X^T in the current root's frame
        ("target_rotation", JOINTS * 6),
        ("trajectory", KEYS * 6),  # X^R: position, facing, velocity on the ground
        ("speed_needed", JOINTS * 3),  # ours: (target - current) / seconds left
        ("base_step", POSE),  # ours: where the interpolation base leads, less the current pose
        ("time", 2),  # ours: seconds left and 1 / frames left
        ("known", 2),  # ours: flags, velocity known and path given
    )
)
GATE_INPUT = Layout((("phase", KEYS * CHANNELS * 2), ("style", 256), ("time_to_arrival", 128)))


def output_layout(absolute: bool) -> Layout:
    """What the network predicts for the next frame: the paper's absolute pose, or a residual on the base."""
    pose = (("position", JOINTS * 3),) if absolute else (("hips", 3),)
    future = SIDE_KEYS + 1
    return Layout(
        (
            *pose,
            ("rotation", JOINTS * 6),
            ("velocity", JOINTS * 3),
            ("contact", future * len(CONTACT_JOINTS)),
            ("trajectory", future * 6),
            ("phase", future * CHANNELS * 3),  # (p_sin, p_cos, frequency in Hz)
        )
    )


def state_shapes() -> dict[str, tuple[int, ...]]:
    """The tensors that a roll-out carries from frame to frame, without the batch axis; world frame, metres, seconds.

    hips: position. rotations: ``q_world_joint`` as 6-D. positions, velocities: of the joints. velocity_known: 0 where
    the start is a lone pose. track: x, z and facing (x, z) of the root for the last frames, newest last, one more than
    the window needs so that the oldest key has a velocity. phase_past, phase_future: points of the phase manifold.
    """
    return {
        "hips": (3,),
        "rotations": (JOINTS, 6),
        "positions": (JOINTS, 3),
        "velocities": (JOINTS, 3),
        "velocity_known": (1,),
        "track": (HISTORY + 1, 4),
        "phase_past": (HISTORY, CHANNELS, 2),
        "phase_future": (SIDE_KEYS, CHANNELS, 2),
    }


def control_shapes(styles: int) -> dict[str, tuple[int, ...]]:
    """What steers one step, without the batch axis; world frame, metres, seconds.

    base, base_next: the interpolation from start to target at the present frame and at the next (hips, then 6-D).
    frames_left: to the target. style: weights over (free, style 1, ...). path: root position, facing and velocity at
    the 6 future keys. path_known: 0 where no path is given.
    """
    return {
        "target_hips": (3,),
        "target_rotations": (JOINTS, 6),
        "target_positions": (JOINTS, 3),
        "base": (POSE,),
        "base_next": (POSE,),
        "frames_left": (1,),
        "style": (styles + 1,),
        "path": (SIDE_KEYS, 6),
        "path_known": (1,),
    }


def target_shapes(styles: int, latent: int) -> dict[str, tuple[int, ...]]:
    """What the completion of a target takes, without the batch axis; world frame, metres, seconds.

    target_hips, target_rotations: of any pose with the given parts; the rest of it is not looked at. joints: 1 for
    those given. ground: 1 where the hips' place on the ground and their facing are. frames: from start to target.
    noise: nil for the likeliest pose.
    """
    return {
        "start_hips": (3,),
        "start_rotations": (JOINTS, 6),
        "start_velocities": (JOINTS, 3),
        "velocity_known": (1,),
        "target_hips": (3,),
        "target_rotations": (JOINTS, 6),
        "joints": (JOINTS,),
        "ground": (1,),
        "frames": (1,),
        "style": (styles + 1,),
        "noise": (latent,),
    }
