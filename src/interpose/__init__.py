"""Interpose: motion in-betweening. Key poses in, finished motion out, exact at the keys, on your own rig.

>>> import interpose as ip
>>> clip = ip.read("walk.bvh")
>>> candidates = ip.load_model().inbetween(clip[0], clip[60], frames=59, variants=4, seed=1)
>>> ip.write("out.bvh", candidates[0].motion)
"""

from interpose.errors import InputError as InputError
from interpose.motion import Motion as Motion
from interpose.skeleton import Skeleton as Skeleton
