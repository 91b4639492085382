"""Contact sheets: one row a transition, its poses from left to right in time.

Keys are in full colour, the start blue and the target orange; generated frames are pale and pass from one to the other.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFont

from interpose.errors import InputError
from interpose.io.files import write_whole
from interpose.motion import Motion
from interpose.render.cast import Cast, cast
from interpose.render.drawing import FAINT, INK, PAPER, START, TARGET, Camera, Colour, look, mix, picture

SHEET_WIDTH = 1800
MARGIN = 28
LABEL_WIDTH = 250
STRIP_HEIGHT = 300
BARS_HEIGHT = 66
RULE_COLOUR: Colour = (221, 217, 208)
PALE_COLOURS: tuple[Colour, Colour, Colour] = ((166, 200, 212), (234, 222, 198), (242, 178, 146))
"""Of generated frames: after the start, half-way, before the target."""


@dataclass(frozen=True)
class SheetRow:
    """One transition: its frames from the start key to the target key, a title, and short notes below it."""

    motion: Motion
    title: str
    notes: tuple[str, ...] = ()


def contact_sheet(
    path: str | PathLike[str], rows: Sequence[SheetRow], heading: str = "", subheading: str = "", poses: int = 11
) -> None:
    """Writes a PNG of all rows, at most ``poses`` poses a row, all characters at one scale.

    Poses stand at equal spaces; a small map on the left shows their true path, a pair of bars below which foot is on
    the ground. Raises InputError for no rows, a motion without frames, or an unwritable path.
    """
    save(path, compose(draw_rows(rows, poses), heading, subheading))


def draw_rows(rows: Sequence[SheetRow], poses: int = 11) -> list[Image.Image]:
    """A picture of each row, all characters at one scale. Raises as :func:`contact_sheet` does."""
    if not rows:
        raise InputError("a contact sheet needs at least one motion")
    casts = [cast(row.motion) for row in rows]
    scale = 0.80 * STRIP_HEIGHT / max(max(_extent(c)[0] for c in casts), 0.2)
    pictures = []
    for row, played in zip(rows, casts, strict=True):
        pictures.append(Image.new("RGB", (SHEET_WIDTH - 2 * MARGIN, STRIP_HEIGHT + BARS_HEIGHT), PAPER))
        _row(pictures[-1], row, played, scale, poses)
    return pictures


def compose(rows: Sequence[Image.Image], heading: str = "", subheading: str = "") -> Image.Image:
    """Pictures of rows, one below the other, under a heading."""
    top = MARGIN + (82 if subheading else 58 if heading else 0)
    step = rows[0].height + 18
    sheet = Image.new("RGB", (SHEET_WIDTH, top + len(rows) * step + MARGIN - 18), PAPER)
    draw = ImageDraw.Draw(sheet)
    if heading:
        text(draw, (MARGIN, MARGIN - 8), heading, 32, INK, bold=True)
        text(draw, (MARGIN, MARGIN + 32), subheading, 17, FAINT)
    for k, row in enumerate(rows):
        sheet.paste(row, (MARGIN, top + k * step))
        if k:
            draw.line((MARGIN, top + k * step - 9, SHEET_WIDTH - MARGIN, top + k * step - 9), fill=RULE_COLOUR)
    return sheet


def _row(sheet: Image.Image, row: SheetRow, played: Cast, scale: float, poses: int) -> None:
    last = len(row.motion) - 1
    strip = sheet.width - LABEL_WIDTH
    _, wide = _extent(played)
    count = int(np.clip(strip / (scale * max(0.62 * wide, 0.75)), 2, max(poses, 2)))
    frames = np.rint(np.linspace(0, last, min(count, last + 1))).astype(int).tolist()
    ground = np.insert(played.track, 1, 0.0, axis=1)
    camera = look(played.heading(), np.array([0.0, played.floor, 0.0]), (0.0, 0.84 * STRIP_HEIGHT), scale)
    aside = camera.project(played.positions)[..., 0] - camera.project(ground)[:, None, 0]
    left, right = 0.16 * scale - aside[0].min(), 0.16 * scale + aside[last].max()
    half = 0.5 * strip / len(frames)
    slots = np.linspace(max(left, half), strip - max(right, half), len(frames))
    actors = [
        played.actor(frame, _colour(frame, last), slot / scale * camera.right - ground[frame])
        for frame, slot in zip(frames, slots, strict=True)
    ]
    sheet.paste(picture(camera, actors, (strip, STRIP_HEIGHT), played.floor), (LABEL_WIDTH, 0))
    draw = ImageDraw.Draw(sheet)
    _bars(draw, played, frames, slots)
    text(draw, (0, 0), row.title, 25, INK, bold=True)
    for k, note in enumerate(row.notes):
        text(draw, (0, 36 + 22 * k), note, 16, FAINT)
    used = 36 + 22 * len(row.notes)
    _map(sheet, played, frames, camera, used + 14)


def _bars(draw: ImageDraw.ImageDraw, played: Cast, frames: list[int], slots: ndarray) -> None:
    """Frame numbers and times below the poses, and a bar for each foot, dark while it is on the ground."""
    x, y, last = LABEL_WIDTH, STRIP_HEIGHT, frames[-1]
    for frame, slot in zip(frames, slots.tolist(), strict=True):
        key = frame in (0, last)
        name = f"{frame}  ·  {frame / played.motion.rate:.2f} s" if len(frames) < 15 else f"{frame}"
        text(draw, (x + slot, y + 8), name, 14, _colour(frame, last) if key else FAINT, anchor="ma", bold=key)
    if played.down is None or len(frames) < 2:
        return
    step = (slots[-1] - slots[0]) / last
    for k, side in enumerate("LR"):
        top = y + 34 + 13 * k
        text(draw, (x + slots[0] - 0.5 * step - 9, top - 3), side, 12, FAINT, anchor="ra")
        draw.rectangle((x + slots[0] - 0.5 * step, top, x + slots[-1] + 0.5 * step, top + 7), fill=(236, 233, 225))
        for frame in np.flatnonzero(played.down[:, k]).tolist():
            left = x + slots[0] + (frame - 0.5) * step
            tone = _colour(frame, last, pale=0.25)
            draw.rectangle((left, top, left + step, top + 7), fill=mix(tone, INK, 0.0 if k == 0 else 0.18))


def _map(sheet: Image.Image, played: Cast, frames: list[int], camera: Camera, top: int) -> None:
    """The root's path from above, turned like the characters: dots at the drawn poses, ticks in their facings."""
    size, last = (LABEL_WIDTH - 40, STRIP_HEIGHT + 44 - top), frames[-1]
    if size[1] < 40:
        return
    k = 3
    ahead = np.cross(camera.right, [0.0, 1.0, 0.0])
    axes = np.stack([camera.right[[0, 2]], ahead[[0, 2]]], axis=1)
    path = played.track @ axes
    low, high = path.min(axis=0), path.max(axis=0)
    unit = k * float(min((size[0] - 44) / max(high[0] - low[0], 1.2), (size[1] - 52) / max(high[1] - low[1], 0.6)))
    unit = min(unit, k * 110.0)
    image = Image.new("RGB", (size[0] * k, size[1] * k), PAPER)
    draw = ImageDraw.Draw(image)
    centre = np.array([size[0] * k / 2, (size[1] - 22) * k / 2])
    at = centre + unit * (path - (low + high) / 2)
    for f in range(len(at) - 1):
        draw.line((*at[f], *at[f + 1]), fill=_colour(f, last, pale=0.3), width=2 * k)
    for frame in frames:
        p, key = at[frame], frame in (0, last)
        colour = _colour(frame, last, pale=0.45)
        r = (5.5 if key else 3.0) * k
        if played.facing is not None:
            nose = p + (played.facing[frame] @ axes) * (15.0 if key else 9.0) * k
            draw.line((*p, *nose), fill=colour, width=round((2.2 if key else 1.4) * k))
        draw.ellipse((*(p - r), *(p + r)), fill=colour)
    small = image.resize(size, Image.Resampling.BOX)
    metre = next((m for m in (50, 20, 10, 5, 2, 1, 0.5) if m * unit / k <= 0.45 * size[0]), 0.5)
    length = metre * unit / k
    draw = ImageDraw.Draw(small)
    y = size[1] - 8
    draw.line((1, y, 1 + length, y), fill=FAINT)
    draw.line((1, y - 3, 1, y + 3), fill=FAINT)
    draw.line((1 + length, y - 3, 1 + length, y + 3), fill=FAINT)
    text(draw, (length + 10, y), f"{metre:g} m, from above", 13, FAINT, anchor="lm")
    sheet.paste(small, (0, top))


def text(
    draw: ImageDraw.ImageDraw,
    at: tuple[float | int, float | int],
    label: str,
    size: int,
    colour: Colour,
    anchor: str = "la",
    bold: bool = False,
) -> None:
    """Text in Pillow's own font. Bold is the same text twice, a fraction of a pixel apart."""
    font = ImageFont.load_default(size)
    for shift in (0.0, 0.6) if bold else (0.0,):
        draw.text((at[0] + shift, at[1]), label, fill=colour, font=font, anchor=anchor)


def save(path: str | PathLike[str], image: Image.Image) -> None:
    """Writes a PNG, whole or not at all."""
    data = io.BytesIO()
    image.save(data, format="PNG")
    write_whole(path, data.getvalue())


def _colour(frame: int, last: int, pale: float = 0.0) -> Colour:
    """The colour of a frame, from the start's to the target's, paler where it is neither.

    ``pale`` above 0 darkens generated frames towards the keys' colours, for thin marks on paper.
    """
    part = frame / last if last else 0.0
    full = mix(START, (120, 70, 110), 2.0 * part) if part < 0.5 else mix((120, 70, 110), TARGET, 2.0 * part - 1.0)
    if frame in (0, last):
        return full
    k = min(int(2.0 * part), 1)
    return mix(mix(PALE_COLOURS[k], PALE_COLOURS[k + 1], 2.0 * part - k), full, pale)


def _extent(played: Cast) -> tuple[float, float]:
    """The height of the motion above its floor, and the width of a pose on screen, metres."""
    camera = look(played.heading(), np.zeros(3), (0.0, 0.0), 1.0)
    across = camera.project(played.positions)[..., 0]
    high = float(played.positions[..., 1].max()) - played.floor
    return 1.08 * high + 0.10, float(np.percentile(across.max(axis=1) - across.min(axis=1), 90))
