"""The mannequin's surfaces, of a humanoid and of a skeleton with more legs."""

from __future__ import annotations

import numpy as np
import pytest
from strategies import spider

from interpose.mannequin import mannequin
from interpose.skeleton import HUMANOID, Skeleton


@pytest.mark.parametrize("skeleton", [HUMANOID, spider()], ids=["humanoid", "spider"])
def test_surfaces_are_closed_and_face_outwards(skeleton: Skeleton) -> None:
    shape = mannequin(skeleton)
    edges = np.concatenate([shape.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    there = {tuple(e) for e in edges.tolist()}
    assert len(there) == len(edges)
    assert all((b, a) in there for a, b in there)
    corner = shape.vertices[shape.triangles]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert np.all(np.einsum("tc,tc->t", flat, shape.normals[shape.triangles].mean(axis=1)) > 0)
    assert np.einsum("tc,tc->t", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() > 0
