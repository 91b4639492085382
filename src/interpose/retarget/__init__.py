"""Any humanoid skeleton to the 22 joints inside the models, and back."""

from interpose.retarget.mapping import Mapping, map_skeleton
from interpose.retarget.transfer import from_humanoid, to_humanoid

__all__ = ["Mapping", "from_humanoid", "map_skeleton", "to_humanoid"]
