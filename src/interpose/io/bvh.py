"""BVH (Biovision hierarchy) files, as `interpose.io.registry` lists them."""

from __future__ import annotations

from interpose.io.bvh_read import parse as parse
from interpose.io.bvh_read import recognises as recognises
from interpose.io.bvh_write import serialize as serialize
