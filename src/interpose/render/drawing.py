"""Characters on a floor, drawn with NumPy and Pillow: an orthographic camera, a depth buffer, soft shadows.

Everything is drawn at three times the final size. Lengths are metres, Y up; pixels run down.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFilter
from scipy.ndimage import gaussian_filter, minimum_filter

from interpose.mannequin import RIGHT, Mannequin
from interpose.rotation import UP

SUPERSAMPLING = 3
LIGHT = np.array([-0.42, 0.80, 0.43])
"""The direction towards the light in camera axes (right, up, towards the viewer)."""

Colour = tuple[int, int, int]
PAPER: Colour = (247, 245, 240)
FLOOR: Colour = (233, 229, 220)
INK: Colour = (38, 43, 51)
FAINT: Colour = (138, 139, 140)
START: Colour = (31, 92, 122)
TARGET: Colour = (217, 84, 44)


@dataclass(frozen=True)
class Camera:
    """An orthographic view: ``right``, ``up``, ``toward`` (the viewer) are unit vectors; ``scale`` is pixels a metre.

    The world point ``centre`` appears at the pixel ``origin``.
    """

    right: Float[ndarray, "3"]
    up: Float[ndarray, "3"]
    toward: Float[ndarray, "3"]
    centre: Float[ndarray, "3"]
    origin: tuple[float, float]
    scale: float

    def project(self, points: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3"]:
        """Pixel x, pixel y (down) and depth in metres (larger is nearer)."""
        p = points - self.centre
        across, high = self.scale * (p @ self.right), self.scale * (p @ self.up)
        return np.stack([self.origin[0] + across, self.origin[1] - high, p @ self.toward], axis=-1)

    @property
    def light(self) -> Float[ndarray, "3"]:
        """The direction towards the light in the world."""
        across = np.array([self.toward[0], 0.0, self.toward[2]])
        across = across / np.linalg.norm(across)
        direction = LIGHT[0] * self.right + LIGHT[1] * UP + LIGHT[2] * across
        return direction / np.linalg.norm(direction)


def look(
    heading: Float[ndarray, "3"],
    centre: Float[ndarray, "3"],
    origin: tuple[float, float],
    scale: float,
    elevation: float = 0.26,
) -> Camera:
    """The camera that sees ``heading`` (a horizontal direction) as screen right, from ``elevation`` radians above."""
    right = heading / np.linalg.norm(heading)
    level = np.cross(right, UP)
    toward = np.cos(elevation) * level + np.sin(elevation) * UP
    return Camera(right, np.cross(toward, right), toward, centre, origin, scale)


@dataclass(frozen=True)
class Actor:
    """A character in one pose: global positions and rotations, and a colour. ``coarse``: the mesh that casts its
    shadow."""

    mannequin: Mannequin
    coarse: Mannequin
    positions: Float[ndarray, "joint 3"]
    rotations: Float[ndarray, "joint 4"]
    colour: Colour


def mix(a: Colour, b: Colour, part: float) -> Colour:
    """A blend from ``a`` to ``b`` by ``part``, in linear light, so that two hues do not turn grey."""
    x, y = (np.array(c, dtype=float) ** 2.2 for c in (a, b))
    r, g, b_ = np.rint(((1.0 - part) * x + part * y) ** (1 / 2.2)).astype(int).tolist()
    return r, g, b_


def draw_floor(image: Image.Image) -> None:
    """A floor that fades into the paper."""
    width, tall = image.size
    fade = Image.new("L", image.size, 0)
    ImageDraw.Draw(fade).ellipse((width * 0.05, tall * 0.64, width * 0.95, tall * 0.93), fill=255)
    image.paste(FLOOR, (0, 0), fade.filter(ImageFilter.GaussianBlur(tall * 0.08)))


def draw_shadows(image: Image.Image, camera: Camera, actors: Sequence[Actor], height: float) -> None:
    """Shadows on the floor y = ``height``: the meshes projected along the light and blurred, darker close to the floor.

    Parts below the floor cast none.
    """
    soft, close = Image.new("L", image.size, 0), Image.new("L", image.size, 0)
    light = camera.light
    for actor in actors:
        vertices, _ = actor.coarse.posed(actor.positions, actor.rotations)
        above = np.maximum(vertices[:, 1] - height, 0.0)
        for mask, direction, reach, shade in ((soft, light / light[1], np.inf, 150), (close, UP, 0.09, 200)):
            fallen = camera.project(vertices - above[:, None] * direction).astype(np.float32)
            triangles = actor.coarse.triangles[(above[actor.coarse.triangles] < reach).all(axis=1)]
            triangles = triangles[_signed_area(fallen[triangles]) < 0.0]
            draw = ImageDraw.Draw(mask)
            for corners in fallen[triangles][..., :2].reshape(-1, 6).tolist():
                draw.polygon(corners, fill=shade)
    blur = camera.scale * 0.035
    soft = soft.filter(ImageFilter.GaussianBlur(blur))
    close = close.filter(ImageFilter.GaussianBlur(0.45 * blur))
    image.paste((120, 112, 104), (0, 0), soft.point([round(0.62 * v) for v in range(256)]))
    image.paste((72, 66, 62), (0, 0), close.point([round(0.55 * v) for v in range(256)]))


def draw_actors(image: Image.Image, camera: Camera, actors: Sequence[Actor]) -> None:
    """All characters with hidden surfaces removed.

    Triangles are rasterised into a depth buffer that also keeps each pixel's normal and colour; light, contours and
    ambient occlusion are then computed once a pixel.
    """
    k = SUPERSAMPLING
    camera = replace(camera, origin=(camera.origin[0] * k, camera.origin[1] * k), scale=camera.scale * k)
    width, tall = image.size[0] * k, image.size[1] * k
    depth = np.full(width * tall, -np.inf, dtype=np.float32)
    normal = np.zeros((width * tall, 3), dtype=np.float32)
    colour = np.zeros((width * tall, 3), dtype=np.float32)
    for actor in actors:
        vertices, normals = actor.mannequin.posed(actor.positions, actor.rotations)
        seen, normals = camera.project(vertices).astype(np.float32), normals.astype(np.float32)
        front = _signed_area(seen[actor.mannequin.triangles]) < 0.0
        triangles = actor.mannequin.triangles[front]
        tones = np.array(actor.colour) * np.where(actor.mannequin.sides[front] == RIGHT, 0.86, 1.0)[:, None]
        for pixel, which, weights in _rasterise(seen[triangles][..., :2], width, tall):
            corner = triangles[which]
            near = np.einsum("fc,fc->f", weights, seen[corner, 2])
            np.maximum.at(depth, pixel, near)
            wins = near == depth[pixel]
            pixel, corner, weights = pixel[wins], corner[wins], weights[wins]
            normal[pixel] = sum(weights[:, c, None] * normals[corner[:, c]] for c in range(3))
            colour[pixel] = tones[which[wins]]
    covered = depth > -np.inf
    view, inside = depth.reshape(tall, width), covered.reshape(tall, width)
    dark = (_contours(view, inside) * _occlusion(view, inside, camera))[inside]
    colour[covered] = np.clip(_shade(normal[covered], colour[covered], camera) * dark[:, None], 0.0, 255.0)
    bodies = colour.reshape(tall // k, k, width // k, k, 3).mean(axis=(1, 3))
    share = inside.reshape(tall // k, k, width // k, k, 1).mean(axis=(1, 3), dtype=np.float32)
    image.paste(Image.fromarray(np.rint(bodies + (1.0 - share) * np.asarray(image)).astype(np.uint8)))


def picture(camera: Camera, actors: Sequence[Actor], size: tuple[int, int], height: float) -> Image.Image:
    """A finished picture of ``size`` pixels: a floor at y = ``height``, shadows, characters."""
    image = Image.new("RGB", size, PAPER)
    draw_floor(image)
    draw_shadows(image, camera, actors, height)
    draw_actors(image, camera, actors)
    return image


def _rasterise(
    corners: Float32[ndarray, "triangle 3 2"], width: int, tall: int
) -> Iterator[tuple[Int[ndarray, "fragment"], Int[ndarray, "fragment"], Float32[ndarray, "fragment 3"]]]:
    """Fragments of screen triangles: flat pixel index, triangle, barycentric weights.

    Triangles are processed in groups of about equal bounding boxes.
    """
    low = np.floor(corners.min(axis=1) - 0.5).astype(int)
    size = (np.ceil(corners.max(axis=1) - 0.5).astype(int) - low).max(axis=1) + 1
    inside = (low[:, 0] + size > 0) & (low[:, 1] + size > 0) & (low[:, 0] < width) & (low[:, 1] < tall)
    classes = np.ceil(np.log2(np.maximum(size, 2)) * 2.0).astype(int)
    for level in np.unique(classes[inside]):
        group = np.flatnonzero(inside & (classes == level))
        side = int(size[group].max())
        step = np.arange(side)
        for part in np.array_split(group, int(np.ceil(len(group) * side * side / 2_000_000))):
            x = low[part, 0, None, None] + step[None, None, :]
            y = low[part, 1, None, None] + step[None, :, None]
            a, b, c = (corners[part, k, :, None, None] for k in range(3))
            px, py = (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32)
            area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
            wb = ((px - a[:, 0]) * (c[:, 1] - a[:, 1]) - (py - a[:, 1]) * (c[:, 0] - a[:, 0])) / area
            wc = ((b[:, 0] - a[:, 0]) * (py - a[:, 1]) - (b[:, 1] - a[:, 1]) * (px - a[:, 0])) / area
            shown = (x >= 0) & (x < width) & (y >= 0) & (y < tall)
            hit = np.flatnonzero((wb >= 0) & (wc >= 0) & (wb + wc <= 1) & shown)
            which = part[hit // (side * side)]
            second, third = wb.ravel()[hit], wc.ravel()[hit]
            pixel = (low[which, 1] + hit // side % side) * width + low[which, 0] + hit % side
            yield pixel, which, np.stack([1.0 - second - third, second, third], axis=1)


def _shade(
    normal: Float32[ndarray, "pixel 3"], colour: Float32[ndarray, "pixel 3"], camera: Camera
) -> Float32[ndarray, "pixel 3"]:
    """Wrapped diffuse light, a sky, a soft highlight, and a rim at grazing angles."""
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-6)
    half = camera.light + camera.toward
    light, half, toward = (v.astype(np.float32) for v in (camera.light, half / np.linalg.norm(half), camera.toward))
    wrapped = (0.5 + 0.5 * (normal @ light)) ** 1.5
    sky = 0.5 + 0.5 * normal[:, 1]
    gloss = 0.14 * np.maximum(normal @ half, 0.0) ** 22
    rim = 0.16 * (1.0 - np.clip(normal @ toward, 0.0, 1.0)) ** 3 * sky
    lit = colour * (0.46 + 0.18 * sky + 0.48 * wrapped)[:, None]
    cool = (1.0 - wrapped)[:, None] * np.array([-5.0, 0.0, 8.0], dtype=np.float32)
    return lit + cool + (255.0 * (gloss + rim))[:, None]


def _contours(depth: Float32[ndarray, "row column"], inside: Bool[ndarray, "row column"]) -> ndarray:
    """Darkens the pixels where the surface ends or recedes by more than a few centimetres."""
    filled = np.where(inside, depth, -1e3)
    lowest = minimum_filter(filled, size=SUPERSAMPLING, mode="constant", cval=-1e3)
    return 1.0 - 0.45 * np.clip((filled - lowest - 0.03) / 0.05, 0.0, 1.0)


def _occlusion(depth: Float32[ndarray, "row column"], inside: Bool[ndarray, "row column"], camera: Camera) -> ndarray:
    """Darkens what lies behind its surroundings: unsharp masking of the depth buffer (Luft, Colditz, Deussen 2006)."""
    k = SUPERSAMPLING
    coarse, weight = np.where(inside, depth, 0.0)[::k, ::k], inside[::k, ::k].astype(np.float32)
    out = np.ones_like(weight)
    for radius, strength in ((0.018, 0.5), (0.06, 0.5)):
        sigma = radius * camera.scale / k
        around = gaussian_filter(coarse, sigma) / np.maximum(gaussian_filter(weight, sigma), 1e-3)
        out *= 1.0 - strength * np.clip((around - coarse) / 0.10, 0.0, 0.6)
    return np.repeat(np.repeat(out, k, axis=0), k, axis=1)[: depth.shape[0], : depth.shape[1]]


def _signed_area(p: Float32[ndarray, "triangle 3 3"]) -> Float32[ndarray, "triangle"]:
    """Twice the signed area on screen; negative faces the viewer, since pixels run down."""
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
