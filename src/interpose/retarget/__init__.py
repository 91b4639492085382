"""Between a user's humanoid skeleton and the 22 joints inside the models, both ways."""

from interpose.retarget.mapping import Mapping, describe, map_skeleton
from interpose.retarget.transfer import from_humanoid, to_humanoid

__all__ = ["Mapping", "describe", "from_humanoid", "map_skeleton", "to_humanoid"]
