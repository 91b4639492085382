"""Model folders and the ONNX Runtime session that runs their step; see docs/model-format.md.

A folder holds `model.json` and its networks. For dcmoe that is `step.onnx`: one frame of the roll-out, features,
normalisation, network and geometry inside, tensors named as in `interpose.features.state_shapes` and `control_shapes`.
For stitch they are `plan.onnx`, `front.onnx` and `back.onnx`, with the tensors of `interpose.stitch_layout`.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import onnxruntime
from jaxtyping import Float
from numpy import ndarray

from interpose import stitch_layout
from interpose.errors import InputError
from interpose.features import CHANNELS, KEYS, control_shapes, state_shapes, target_shapes
from interpose.gallery import store
from interpose.gallery.store import Gallery
from interpose.runtime import style_blend

INSTALLED = Path(__file__).resolve().parent.parent / "assets" / "models"
DEFAULT = "default"
DEFAULTS = {"dcmoe": DEFAULT, "stitch": "stitch", "stitch+detail": "stitch"}
"""The installed model that serves a method where none is named."""
FORMAT = 1
"""Version of the folder's layout."""


@dataclass(frozen=True, eq=False)
class Session:
    """A model, ready to run. ``info`` is its `model.json`. Calls may come from several threads."""

    path: Path
    info: dict[str, Any]
    threads: int = 1
    refines: bool = False
    """whether a stitching model's detail transformer is used"""

    @property
    def name(self) -> str:
        return str(self.info["name"])

    @property
    def method(self) -> str:
        return str(self.info["method"])

    @property
    def styles(self) -> tuple[str, ...]:
        """The labels that it was trained with."""
        return tuple(self.info["styles"])

    @property
    def feeds_path_back(self) -> bool:
        """Whether the network expects its own predicted root as the path where none is given (the paper's form)."""
        return bool(self.info["absolute"])

    @property
    def follows_gallery(self) -> bool:
        """Whether a gap's path is matched from a gallery by default; a stitching model's latents bring their own."""
        return self.method != "stitch"

    @property
    def course(self) -> tuple[int, bool, bool]:
        """How a stitching model's chains are made: K, aligned or not, both or the forward one alone."""
        buffer, aligned, both = self.info["course"]
        return int(buffer), bool(aligned), bool(both)

    @property
    def plans(self) -> bool:
        """Whether a model of method dcmoe has a planner, along which it walks."""
        return self.method == "dcmoe" and "planner" in self.info

    def foresees(self, steps: int) -> bool:
        """Whether it has a planner for gaps of so many steps from start to target."""
        return self.plans and steps <= stitch_layout.LONGEST_PLAN

    @property
    def plan_latent(self) -> int:
        """The units of that planner's noise; 0 without one."""
        return int(self.info["planner"]["latent"]) if self.plans else 0

    @property
    def completes(self) -> bool:
        """Whether it has a network that completes targets given in part."""
        return "target" in self.info

    @property
    def target_latent(self) -> int:
        """The units of that network's noise."""
        return int(self.info["target"]["latent"])

    @property
    def shapes(self) -> dict[str, dict[str, tuple[int, ...]]]:
        """The inputs of each network, without the batch axis."""
        styles = len(self.styles)
        if self.method != "stitch":
            step = state_shapes() | control_shapes(styles)
            more = {"target": target_shapes(styles, self.target_latent)} if self.completes else {}
            if self.plans:
                more["plan"] = stitch_layout.plan_shapes(self.plan_latent, styles)
            return {"step": step} | ({"back": step} if "backward" in self.info else {}) | more
        return stitch_layout.network_shapes(self.info["network"], styles) | (
            {"detail": stitch_layout.DETAIL_SHAPES} if self.refines else {}
        )

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods that it serves."""
        return (self.method, f"{self.method}+detail") if "detail" in self.info else (self.method,)

    def serving(self, method: str) -> Session:
        """The same model as that method uses it; itself, with the networks that it has open, where that is as it is."""
        refines = method.endswith("+detail")
        return self if refines == self.refines else replace(self, refines=refines)

    @cached_property
    def networks(self) -> dict[str, onnxruntime.InferenceSession]:
        """The networks as ONNX Runtime sessions, made at first use; that which completes targets at its own first."""
        return {name: self._open(name, shapes) for name, shapes in self.shapes.items() if name != "target"}

    @cached_property
    def _completion(self) -> onnxruntime.InferenceSession:
        return self._open("target", self.shapes["target"])

    def _open(self, name: str, shapes: dict[str, tuple[int, ...]]) -> onnxruntime.InferenceSession:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = self.threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        file = self.path / f"{name}.onnx"
        try:
            made = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime raises types of its own for each way in which a file can be bad
            reason = str(error).splitlines()[0]
            raise InputError(f"{file} cannot be loaded ({reason}); export the model again") from None
        given = {(i.name, tuple(n if isinstance(n, int) else -1 for n in i.shape[1:])) for i in made.get_inputs()}
        if set(shapes.items()) != given:
            names = sorted({each for each, _ in given ^ set(shapes.items())})
            raise InputError(f"{file} takes {names} otherwise than this program; export it again")
        return made

    @cached_property
    def phase_bank(self) -> Float[ndarray, "sample 13 10 2"]:
        """Phase windows to start from where a variant is wanted; empty where the model has none."""
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
        """The trajectories that travel with the model, or None."""
        file = self.path / "gallery.npz"
        return store.load(file) if file.exists() else None

    @cached_property
    def outputs(self) -> dict[str, list[str]]:
        """Names of each network's outputs, in order."""
        return {name: _names(network) for name, network in self.networks.items()}

    def run(self, name: str, feed: dict[str, ndarray]) -> dict[str, ndarray]:
        """Runs a network: inputs by name, float32 with a batch axis; outputs by name."""
        if name == "target":
            network, names = self._completion, _names(self._completion)
        else:
            network, names = self.networks[name], self.outputs[name]
        return dict(zip(names, cast(list[ndarray], network.run(None, feed)), strict=True))

    def step(self, feed: dict[str, ndarray]) -> dict[str, ndarray]:
        """Runs one frame of dcmoe: state and control in; ``next_*`` and contacts out."""
        return self.run("step", feed)

    def style_weights(self, styles: list[str | None], strength: float = 1.0) -> Float[ndarray, "batch style"]:
        """A row of weights over (free, style 1, ...) for each label, which may blend styles (`blends`).

        strength: how far the weights go from free to the style, beyond it from 1 on; they sum to one at any. As the
        embedding is a linear map of them, this is guidance in its space. Raises InputError for an unknown label.
        """
        weights = np.zeros((len(styles), len(self.styles) + 1), dtype=np.float32)
        for row, style in enumerate(styles):
            if style is None:
                weights[row, 0] = 1.0
                continue
            style_blend.check(style, self.styles, self.name)
            weights[row, 0] = 1.0 - strength
            for name, share in style_blend.shares(style).items():
                weights[row, self.styles.index(name) + 1] = strength * share
        return weights


def _names(network: onnxruntime.InferenceSession) -> list[str]:
    return [output.name for output in network.get_outputs()]


def installed() -> list[Path]:
    """The folders of the models that came with the package, the default one first."""
    found = sorted(p.parent for p in INSTALLED.glob("*/model.json"))
    return sorted(found, key=lambda p: p.name != DEFAULT)


def load(name: str | os.PathLike[str] | None = None, threads: int = 1, method: str = "dcmoe") -> Session:
    """The default model of a method, an installed one by name, or one from a folder. Raises InputError where there is
    none."""
    path = _folder(DEFAULTS.get(method, DEFAULT) if name is None else name)
    file = path / "model.json"
    try:
        info = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(info, dict):
            raise ValueError("no object in it")
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be read ({error}); give a folder made by 'interpose export'") from None
    needed = ("format", "name", "method", "styles", "licence")
    needed += ("network", "course") if info.get("method") == "stitch" else ("absolute",)
    missing = [k for k in needed if k not in info]
    if missing:
        raise InputError(f"{file} lacks {', '.join(missing)}; export the model again")
    if info["format"] != FORMAT:
        raise InputError(f"{file} has format {info['format']}, this program needs {FORMAT}; export the model again")
    return Session(path, info, threads)


def _folder(name: str | os.PathLike[str]) -> Path:
    by_name = {p.name: p for p in installed()}
    if str(name) in by_name:
        return by_name[str(name)]
    path = Path(name)
    if (path / "model.json").exists():
        return path
    raise InputError(f"no model '{name}': installed are {', '.join(by_name) or 'none'}, and it is no model folder")
