"""Both chains of a batch of gaps, made in turn and stitched, in the training graph (Ren et al. 2024, section 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from interpose.features.stitch import schedule, seam, shares
from interpose.models.normal import Normal
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Latent, StitchingCVAE


@dataclass(frozen=True)
class ChainLayout:
    """How the chains are made: K, bi-directional aligning or not, both chains or the forward one alone."""

    buffer: int = 2
    aligned: bool = True
    both: bool = True


@dataclass(frozen=True)
class Chain:
    """The frames that a generator made, one after the other; ``frames`` says which of the gap they are."""

    frames: Int[Tensor, "time"]
    hips: Float[Tensor, "row time 3"]
    rotations: Float[Tensor, "row time 22 turn"]
    positions: Float[Tensor, "row time 22 3"]
    contacts: Float[Tensor, "row time 4"]
    """logits"""
    latents: list[Normal]
    """of each frame, where the model has latents a frame"""


@dataclass(frozen=True)
class Stitched:
    """Both chains and what they become: joint positions of all frames, keys included."""

    front: Chain
    back: Chain | None
    positions: Float[Tensor, "row frame 22 3"]

    def apart(self, frames: list[int]) -> Float[Tensor, "row time 22 3"]:
        """What the forward chain's positions differ by from the backward chain's, in frames that both have."""
        assert self.back is not None
        here = [int(torch.nonzero(self.front.frames == frame)) for frame in frames]
        there = [int(torch.nonzero(self.back.frames == frame)) for frame in frames]
        return self.front.positions[:, here] - self.back.positions[:, there]


def roll(
    model: StitchingCVAE,
    front: Body,
    back: Body,
    base: Float[Tensor, "row frame pose"],
    style: Float[Tensor, "row style"],
    latents: Float[Tensor, "row unit"] | Float[Tensor, "row move unit"],
    layout: ChainLayout,
) -> Stitched:
    """Makes the frames between two keys. ``base``: of all frames, keys included; the paper's form ignores its values.

    latents: z for the whole gap, or the noise of each move where the model has latents a frame.
    """
    steps = base.shape[1] - 1
    ends = seam(steps, layout.buffer, layout.both)
    middle, kept = ends.middle, ends.forward - ends.middle
    keys = front, back
    newest = [front, back]
    at = [0, steps]
    batch = len(base)
    memory = [model.front.begin(batch, base), model.back.begin(batch, base)]
    made: tuple[list, list] = ([], [])
    for number, move in enumerate(schedule(steps, layout.buffer, layout.aligned, layout.both)):
        side = int(move.backward)
        body = newest[side]
        other = keys[1 - side] if move.to_key else newest[1 - side]
        aim = Aim(
            other.hips,
            other.rotations,
            other.positions,
            base.new_full((batch, 1), float(move.left)),
            base[:, at[side]],
            base[:, move.made],
            base[:, move.aim],
        )
        # Gamma of equation 2: t frames up to the middle, then to the end of the buffer.
        gone = at[side] if not side else steps - at[side]
        share = gone / middle if gone < middle else gone / (middle + kept)
        value = latents if latents.ndim == 2 else latents[:, number]
        latent = Latent(value, base.new_full((batch, 1), min(1.0, share)), style)
        generator = model.back if side else model.front
        newest[side], memory[side], contacts, latent_of = generator(body, aim, memory[side], latent)
        made[side].append((move.made, newest[side], contacts, latent_of))
        at[side] = move.made
    chains = [_chain(each, base.device) if each else None for each in made]
    assert chains[0] is not None
    between = joined(chains[0].positions, None if chains[1] is None else chains[1].positions, steps, layout)
    positions = torch.cat([front.positions[:, None], between, back.positions[:, None]], dim=1)
    return Stitched(chains[0], chains[1], positions)


def _chain(made: list, device: torch.device) -> Chain:
    frames, bodies, contacts, latents = zip(*made, strict=True)
    return Chain(
        torch.tensor(frames, device=device),
        torch.stack([b.hips for b in bodies], dim=1),
        torch.stack([b.rotations for b in bodies], dim=1),
        torch.stack([b.positions for b in bodies], dim=1),
        torch.stack(contacts, dim=1),
        [one for one in latents if one is not None],
    )


def joined(
    front: Float[Tensor, "row time *channel"],
    back: Float[Tensor, "row time_ *channel"] | None,
    steps: int,
    layout: ChainLayout,
) -> Float[Tensor, "row frame *channel"]:
    """Both chains' values of the frames between the keys, blended where they overlap, each in the order in which it
    made them. The run time joins them alike (`interpose.runtime.backends.chains`), and smooths the seam."""
    count = steps - 1
    share = torch.as_tensor(shares(steps, layout.buffer, layout.both)[1:-1], dtype=front.dtype)
    weight = share.to(front.device).reshape(-1, *[1] * (front.ndim - 2))

    def placed(values: Tensor, first: int) -> Tensor:
        before = values.new_zeros(len(values), first, *values.shape[2:])
        after = values.new_zeros(len(values), count - first - values.shape[1], *values.shape[2:])
        return torch.cat([before, values, after], dim=1)

    made = (1.0 - weight) * placed(front, 0)
    return made if back is None else made + weight * placed(back.flip(1), count - back.shape[1])
