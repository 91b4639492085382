"""Model folders and the ONNX Runtime sessions of their networks; see docs/model-format.md."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import onnxruntime
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.features import CHANNELS, KEYS, control_shapes, state_shapes, target_shapes
from interpose.features import stitch as stitch_features
from interpose.features.plan import planner_shapes
from interpose.gallery import store
from interpose.gallery.store import Gallery
from interpose.runtime import style_blend

INSTALLED = Path(__file__).resolve().parent.parent / "assets" / "models"
DEFAULT_MODEL = "default"
FORMAT = 2
"""Version of the folder's layout."""


@dataclass(frozen=True, eq=False)
class Session:
    """A model, ready to run. ``info`` is its `model.json`. Calls may come from several threads."""

    path: Path
    info: dict[str, Any]
    _open: dict[str, onnxruntime.InferenceSession] = field(default_factory=dict, init=False, repr=False)

    @property
    def name(self) -> str:
        return str(self.info["name"])

    @property
    def method(self) -> str:
        """The method that it was trained for; `interpose.runtime.backends.methods_of` lists all that it serves."""
        return str(self.info["method"])

    @property
    def styles(self) -> tuple[str, ...]:
        """The labels that it was trained with."""
        return tuple(self.info["styles"])

    @property
    def feeds_path_back(self) -> bool:
        """Whether the step expects its own predicted root as the path where none is given (the paper's form)."""
        return bool(self.info.get("absolute", False))

    @property
    def chain_layout(self) -> tuple[int, bool, bool]:
        """How a stitching model's chains are made: K, aligned or not, both or the forward one alone."""
        layout = self.info["chains"]
        return int(layout["buffer"]), bool(layout["aligned"]), bool(layout["both"])

    @property
    def has_planner(self) -> bool:
        return "planner" in self.info

    @property
    def plan_latent(self) -> int:
        """The units of the planner's noise; 0 without one."""
        return int(self.info["planner"]["latent"]) if self.has_planner else 0

    @property
    def steps_backward(self) -> bool:
        """Whether it has a backward step too, so that both ends are stitched."""
        return "backward" in self.info

    @property
    def has_detail(self) -> bool:
        """Whether it has a transformer that refines stitched transitions."""
        return "detail" in self.info

    @property
    def completes(self) -> bool:
        """Whether it has a network that completes partial targets."""
        return "target" in self.info

    @property
    def target_latent(self) -> int:
        """The units of that network's noise."""
        return int(self.info["target"]["latent"])

    @cached_property
    def shapes(self) -> dict[str, dict[str, tuple[int, ...]]]:
        """The inputs of each network, without the batch axis."""
        styles = len(self.styles)
        if self.method == "stitch":
            out = stitch_features.network_shapes(self.info["network"], styles)
        elif self.method == "dcmoe":
            step = state_shapes() | control_shapes(styles)
            out = {"step": step} | ({"back": step} if self.steps_backward else {})
        else:
            out = {}
        if self.has_planner:
            out["plan"] = planner_shapes(self.plan_latent, styles)
        if self.completes:
            out["target"] = target_shapes(styles, self.target_latent)
        return out | ({"detail": stitch_features.DETAIL_SHAPES} if self.has_detail else {})

    def network(self, name: str) -> onnxruntime.InferenceSession:
        """A network as an ONNX Runtime session, opened at its first use. Raises InputError where its file does not
        load, or takes other inputs than :attr:`shapes`."""
        if name not in self._open:
            self._open[name] = self._load(name)
        return self._open[name]

    def _load(self, name: str) -> onnxruntime.InferenceSession:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        file = self.path / f"{name}.onnx"
        try:
            made = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime raises types of its own for each way in which a file can be bad
            reason = str(error).splitlines()[0]
            raise InputError(f"{file} cannot be loaded ({reason}); export the model again") from None
        given = {(i.name, tuple(n if isinstance(n, int) else -1 for n in i.shape[1:])) for i in made.get_inputs()}
        wanted = set(self.shapes[name].items())
        if wanted != given:
            names = sorted({each for each, _ in given ^ wanted})
            raise InputError(f"{file} has incompatible inputs ({', '.join(names)}); export the model again")
        return made

    def run(self, name: str, feed: dict[str, ndarray]) -> dict[str, ndarray]:
        """Runs a network: inputs by name, float32 with a batch axis; outputs by name."""
        network = self.network(name)
        names = [output.name for output in network.get_outputs()]
        return dict(zip(names, cast(list[ndarray], network.run(None, feed)), strict=True))

    def step(self, feed: dict[str, ndarray]) -> dict[str, ndarray]:
        """Runs one frame of dcmoe: state and control in; ``next_*`` and contacts out."""
        return self.run("step", feed)

    def style_weights(self, styles: Sequence[str | None], strength: float = 1.0) -> Float[ndarray, "batch style"]:
        """A row of weights over (free, style 1, ...) for each label, which may blend styles (`style_blend`).

        strength: how far the weights go from free to the style, beyond it from 1 on; they sum to one at any. As the
        embedding is a linear map of them, this is guidance in its space. Raises InputError for an unknown label.
        """
        weights = np.zeros((len(styles), len(self.styles) + 1), dtype=np.float32)
        for row, style in enumerate(styles):
            if style is None:
                weights[row, 0] = 1.0
                continue
            weights[row, 0] = 1.0 - strength
            for name, share in style_blend.known_shares(style, self.styles, self.name).items():
                weights[row, self.styles.index(name) + 1] = strength * share
        return weights

    @cached_property
    def phase_bank(self) -> Float[ndarray, "sample 13 10 2"]:
        """Phase windows to start variants from; empty where the model has none."""
        file = self.path / "phases.npy"
        if not file.exists():
            return np.zeros((0, KEYS, CHANNELS, 2))
        try:
            bank = np.load(file)
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{file} cannot be read ({error}); export the model again") from None
        if bank.shape[1:] != (KEYS, CHANNELS, 2):
            raise InputError(f"{file} has windows of {bank.shape[1:]}, not {(KEYS, CHANNELS, 2)}; export it again")
        return bank.astype(float)

    @cached_property
    def gallery(self) -> Gallery | None:
        """The trajectories that are bundled with the model, or None."""
        file = self.path / "gallery.npz"
        return store.load(file) if file.exists() else None


def installed() -> list[Path]:
    """The folders of the models that came with the package, the default one first."""
    found = sorted(p.parent for p in INSTALLED.glob("*/model.json"))
    return sorted(found, key=lambda p: p.name != DEFAULT_MODEL)


def load(name: str | os.PathLike[str] | None = None) -> Session:
    """The default model, an installed one by its name, or one from a folder. Raises InputError where there is none."""
    path = _folder(DEFAULT_MODEL if name is None else name)
    file = path / "model.json"
    try:
        info = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(info, dict):
            raise ValueError("no object in it")
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be read ({error}); give a folder made by 'interpose export'") from None
    needed = ("format", "name", "method", "styles", "licence")
    needed += ("network", "chains") if info.get("method") == "stitch" else ()
    missing = [k for k in needed if k not in info]
    if missing:
        raise InputError(f"{file} lacks {', '.join(missing)}; export the model again")
    if info["format"] != FORMAT:
        raise InputError(f"{file} has format {info['format']}, this program needs {FORMAT}; export the model again")
    return Session(path, info)


def _folder(name: str | os.PathLike[str]) -> Path:
    by_name = {p.name: p for p in installed()}
    if str(name) in by_name:
        return by_name[str(name)]
    path = Path(name)
    if (path / "model.json").exists():
        return path
    known = f"installed models: {', '.join(by_name) or 'none'}"
    if path.is_dir():
        raise InputError(f"{name} exists but is not a model folder; {known}")
    raise InputError(f"no model '{name}'; {known}")
