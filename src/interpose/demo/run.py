"""`interpose demo`: the default model on the demo's own key poses, two keys, a time and a style for each scene."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from interpose import io, retarget
from interpose.demo import poses
from interpose.errors import InputError
from interpose.motion import Motion, concatenate
from interpose.render import SheetRow, compose, draw_rows, save
from interpose.runtime.model import Model, load_model
from interpose.runtime.request import Info

OVERVIEW = "contact-sheet.png"


@dataclass(frozen=True)
class Scene:
    """name: of its files. start, target: the keys, one frame each. frames: how many to make between them.

    asked: the request in a few words.
    """

    name: str
    style: str
    start: Motion
    target: Motion
    frames: int
    asked: str


@dataclass(frozen=True)
class Made:
    """A scene of the demo, what is told of its transition, and its files (.bvh, .glb, .png)."""

    scene: Scene
    info: Info
    files: tuple[Path, Path, Path]


def demo(out: str | PathLike[str], model: Model | None = None) -> list[Made]:
    """Fills every scene with ``model`` (None: the default one) and writes a BVH, a GLB and a PNG of each into ``out``.

    ``out`` is made where it does not exist; `contact-sheet.png` there shows all scenes.
    Raises InputError where there is no model or ``out`` cannot be written.
    """
    model = load_model() if model is None else model
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: no folder can be made there ({error.strerror}); choose another") from None
    asked = scenes()
    mapping = retarget.map_skeleton(asked[0].start)
    made, rows = [], []
    for scene in asked:
        candidate = model.inbetween(scene.start, scene.target, scene.frames, style=scene.style, mapping=mapping)[0]
        whole = concatenate(scene.start, candidate.motion, scene.target)
        bvh_file, glb_file, png_file = (folder / f"{scene.name}{suffix}" for suffix in (".bvh", ".glb", ".png"))
        io.write(bvh_file, whole)
        io.write(glb_file, whole, name=scene.name)
        info, seconds = candidate.info, (scene.frames + 1) / scene.start.rate
        made.append(Made(scene, info, (bvh_file, glb_file, png_file)))
        speed = f"made in {1000 * info.seconds:.0f} ms"
        notes = scene.asked, f"{scene.frames} frames, {seconds:.1f} s", speed, f"foot slide {_slide(info)}"
        rows.append(SheetRow(whole, scene.style, notes))
    pictures = draw_rows(rows)
    for each, picture in zip(made, pictures, strict=True):
        save(each.files[2], compose([picture]))
    subheading = "Two keys each, the start in blue and the target in orange; everything between them is generated."
    save(folder / OVERVIEW, compose(pictures, "interpose demo", subheading))
    return made


def scenes() -> list[Scene]:
    """Three styles, each with two requests.

    The first is the same for all: two seconds between two frames of a plain walk. The second goes from standing into
    a pose of that style in four seconds, with a turn on the way.
    """
    walk = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 2.3))
    stand = poses.pose(poses.STAND)
    turns = {
        "Aeroplane": poses.pose(poses.AEROPLANE, (2.6, 2.6), 90.0),
        "Chicken": poses.pose(poses.CHICKEN, (-2.2, 2.4), -90.0),
        "KarateChop": poses.pose(poses.KARATE, (1.2, 2.4), 50.0),
    }
    made = []
    for style, target in turns.items():
        low = style.lower()
        made.append(Scene(f"{low}-walk", style, *walk, 59, "a plain walk"))
        made.append(Scene(f"{low}-turn", style, stand, target, 119, "from standing, with a turn"))
    return made


def show(out: str | PathLike[str], model: Model | None = None) -> int:
    """Runs :func:`demo` and prints its table and what to try next; the command's exit status."""
    console = Console()
    with Console(stderr=True).status("filling the scenes and drawing them"):
        made = demo(out, model)
    console.print(table(made))
    console.print(f"All of them in one picture: {escape(str(Path(out) / OVERVIEW))}", soft_wrap=True)
    console.print("The .bvh and .glb files open in Blender and other 3-D programs.\n")
    console.print("Next, with a clip of your own:")
    for line in (
        "interpose info your.bvh",
        "interpose fill your.bvh --keys 0,45,90 --style Angry -o filled.bvh",
        "interpose between a.bvh:0 a.bvh:-1 --frames 60 --variants 4 -o made.bvh",
        "interpose models",
    ):
        console.print(f"  [bold]{escape(line)}[/bold]", highlight=False, soft_wrap=True)
    return 0


def table(made: list[Made]) -> Table:
    """One row a scene; narrow enough for a window of 80 columns."""
    title = f"{len(made)} transitions, each as .bvh, .glb and .png"
    found = Table(box=SIMPLE_HEAD, title=title, title_justify="left", pad_edge=False)
    found.add_column("name", no_wrap=True)
    for name in ("frames", "seconds", "made in", "arrival error", "foot slide"):
        found.add_column(name, justify="right", no_wrap=True)
    for each in made:
        info = each.info
        found.add_row(
            each.scene.name,
            str(info.frames),
            f"{(info.frames + 1) / each.scene.start.rate:.1f}",
            f"{1000 * info.seconds:.0f} ms",
            f"{1000 * info.arrival_position_error_m:.1f} mm",
            _slide(info),
        )
    fallbacks = [m.info.fallback for m in made if m.info.fallback is not None]
    if fallbacks:
        found.caption = f"{len(fallbacks)} made by interpolation: {escape(fallbacks[0])}"
    return found


def _slide(info: Info) -> str:
    return "unknown" if info.foot_slide_cm_per_frame is None else f"{info.foot_slide_cm_per_frame:.2f} cm/frame"
