"""Pictures for close inspection: the frames around a key one by one, and curves of the feet and the accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from PIL import Image, ImageDraw

from interpose.errors import InputError
from interpose.motion import Motion
from interpose.render.cast import Cast, cast
from interpose.render.drawing import FAINT, INK, PAPER, TARGET, Colour, look, picture
from interpose.render.sheet import MARGIN, RULE_COLOUR, save, text

CELL_WIDTH = 150
BODY_HEIGHT, FEET_HEIGHT = 300, 150
FRAME_COLOUR: Colour = (214, 203, 184)
SIDE_COLOURS: tuple[Colour, Colour] = ((31, 92, 122), (181, 130, 40))


def filmstrip(
    path: str | PathLike[str], motion: Motion, around: int, before: int = 5, after: int = 6, keys: Sequence[int] = ()
) -> None:
    """Writes a PNG of the frames ``around - before`` to ``around + after``: the character, and its feet below.

    All cells show the same place in the world, so that sliding feet show against the grid of 25 cm. ``keys`` are drawn
    in orange. Raises InputError where ``around`` is outside the motion or the path cannot be written.
    """
    played = cast(motion)
    count = len(motion)
    if not 0 <= around < count:
        raise InputError(f"frame {around} is outside a motion of {count} frames (0 to {count - 1})")
    frames = range(max(0, around - before), min(count, around + after + 1))
    sheet = Image.new(
        "RGB", (2 * MARGIN + CELL_WIDTH * len(frames), 2 * MARGIN + BODY_HEIGHT + FEET_HEIGHT + 24), PAPER
    )
    draw = ImageDraw.Draw(sheet)
    shown = played.positions[frames.start : frames.stop]
    at = np.array([*played.track[around], played.floor])[[0, 2, 1]]
    heading = played.heading()
    aside = np.abs((shown - at) @ heading)
    scale = float(
        min(0.82 * BODY_HEIGHT / (shown[..., 1].max() - played.floor + 0.15), 0.5 * CELL_WIDTH / (aside.max() + 0.1))
    )
    low = aside[shown[..., 1] < played.floor + 0.3]
    close = min(2.0 * scale, 0.5 * CELL_WIDTH / (float(low.max(initial=0.2)) + 0.15))
    for k, frame in enumerate(frames):
        actor = played.actor(frame, TARGET if frame in keys else FRAME_COLOUR)
        left = MARGIN + k * CELL_WIDTH
        whole = look(heading, at, (CELL_WIDTH / 2, 0.87 * BODY_HEIGHT), scale)
        feet = look(heading, at, (CELL_WIDTH / 2, 0.70 * FEET_HEIGHT), close)
        sheet.paste(picture(whole, [actor], (CELL_WIDTH, BODY_HEIGHT), played.floor, grid=0.25), (left, MARGIN))
        sheet.paste(
            picture(feet, [actor], (CELL_WIDTH, FEET_HEIGHT), played.floor, grid=0.25),
            (left, MARGIN + BODY_HEIGHT),
        )
        draw.line((left, MARGIN, left, MARGIN + BODY_HEIGHT + FEET_HEIGHT), fill=RULE_COLOUR)
        colour = TARGET if frame in keys else FAINT
        text(
            draw,
            (left + CELL_WIDTH / 2, MARGIN + BODY_HEIGHT + FEET_HEIGHT + 6),
            f"{frame}",
            15,
            colour,
            anchor="ma",
        )
    save(path, sheet)


def curves(path: str | PathLike[str], motion: Motion, keys: Sequence[int] = (), width: int = 1400) -> None:
    """Writes a PNG of each foot's height and speed and of the mean acceleration of all joints, frame by frame.

    A foot is the lower of its two joints; speeds are along the floor. Vertical lines mark ``keys``, where a pop shows
    as a peak of the acceleration. Raises InputError for fewer than three frames, unknown feet, or an unwritable path.
    """
    if len(motion) < 3:
        raise InputError(f"curves need at least three frames, the motion has {len(motion)}")
    played = cast(motion)
    if played.feet is None:
        raise InputError("the feet of this skeleton are not known, so their curves cannot be drawn")
    feet = played.positions[:, played.feet]  # (frame, side, joint, 3)
    lower = feet[..., 1].argmin(axis=2)
    speed = np.linalg.norm(np.gradient(feet[..., [0, 2]], axis=0), axis=-1) * motion.rate
    speed = np.take_along_axis(speed, lower[..., None], axis=2)[..., 0]
    bend = np.zeros(len(motion))
    bend[1:-1] = np.linalg.norm(np.diff(played.positions, n=2, axis=0), axis=-1).mean(axis=1) * motion.rate**2
    bend[[0, -1]] = bend[[1, -2]]
    plots = (
        ("foot height, cm", 100.0 * (feet[..., 1].min(axis=2) - played.floor)),
        ("foot speed, m/s", speed),
        ("mean acceleration of the joints, m/s^2", bend[:, None]),
    )
    tall = 210
    sheet = Image.new("RGB", (width, 2 * MARGIN + len(plots) * tall), PAPER)
    for k, (name, values) in enumerate(plots):
        _plot(
            sheet,
            name,
            values,
            played,
            keys,
            (MARGIN, MARGIN + k * tall),
            (width - 2 * MARGIN, tall - 34),
        )
    save(path, sheet)


def _plot(
    sheet: Image.Image,
    name: str,
    values: Float[ndarray, "frame curve"],
    played: Cast,
    keys: Sequence[int],
    corner: tuple[int, int],
    size: tuple[int, int],
) -> None:
    k = 3
    left, top = 44, 26
    wide, tall = size[0] - left, size[1] - top - 18
    high = float(max(values.max(), 1e-6))
    step = next(s * 10.0**e for e in range(-4, 6) for s in (1, 2, 5) if high / (s * 10.0**e) <= 4.5)
    high = step * max(1.0, np.ceil(high / step))
    image = Image.new("RGB", (size[0] * k, size[1] * k), PAPER)
    draw = ImageDraw.Draw(image)
    x = k * (left + wide * np.arange(len(values)) / (len(values) - 1))
    levels = np.arange(0.0, high + 0.5 * step, step)

    def y(value: ndarray) -> ndarray:
        return k * (top + tall * (1.0 - value / high))

    for level in y(levels).tolist():
        draw.line((k * left, level, size[0] * k, level), fill=RULE_COLOUR, width=2)
    for key in keys:
        draw.line((x[key], k * top, x[key], k * (top + tall)), fill=TARGET, width=4)
    for column, colour in zip(values.T, SIDE_COLOURS if values.shape[1] > 1 else (INK,), strict=True):
        draw.line(np.stack([x, y(column)], axis=1).reshape(-1).tolist(), fill=colour, width=6, joint="curve")
    small = image.resize(size, Image.Resampling.BOX)
    draw = ImageDraw.Draw(small)
    text(draw, (0, 0), name, 16, INK, bold=True)
    if values.shape[1] > 1:
        text(draw, (170, 1), "left", 15, SIDE_COLOURS[0])
        text(draw, (210, 1), "right", 15, SIDE_COLOURS[1])
    for level, at in zip(levels.tolist(), (y(levels) / k).tolist(), strict=True):
        text(draw, (left - 8, at), f"{level:g}", 13, FAINT, anchor="rm")
    every = next(s for s in (1, 2, 5, 10, 15, 30, 60, 150, 300, 600, 1500, 10**9) if len(values) / s <= 16)
    for frame in range(0, len(values), every):
        text(draw, (x[frame] / k, top + tall + 4), f"{frame}", 13, FAINT, anchor="ma")
    sheet.paste(small, corner)
