"""BVH files: :func:`read` and :func:`write`, :func:`parse` and :func:`serialize` for bytes, and :class:`BvhLayout`."""

from __future__ import annotations

from interpose.io.bvh_layout import CHANNELS as CHANNELS
from interpose.io.bvh_layout import BvhLayout as BvhLayout
from interpose.io.bvh_layout import default_layout as default_layout
from interpose.io.bvh_read import detect_unit as detect_unit
from interpose.io.bvh_read import parse as parse
from interpose.io.bvh_read import rate_of as rate_of
from interpose.io.bvh_read import read as read
from interpose.io.bvh_write import serialize as serialize
from interpose.io.bvh_write import write as write
