"""One pose a call, for games: the target and the time left may change at any call.

Each call is one step of the roll-out (`rollout`). While target and time go on as they were, the interpolation base of
METHOD.md part E stays what it was, so that undisturbed calls give the very frames of the whole roll-out; where they
change, a new base begins at the present pose, which then leads to the new target in the new time.
"""

from __future__ import annotations

import numpy as np

from interpose import retarget
from interpose.errors import InputError
from interpose.motion import Motion, concatenate, sample
from interpose.runtime import rollout
from interpose.runtime.interpolate import check_gap
from interpose.runtime.interpolate import aligned
from interpose.runtime.resampling import MODEL_RATE
from interpose.runtime.session import Session
from interpose.skeleton import HUMANOID
