"""Foot locking on the 22-joint humanoid, after Kovar et al. 2002 (`Footskate Cleanup for Motion Capture Editing`).

`lock` runs in this order: `stances` decides when each foot stands, `footholds` where, `swing` how it moves in between,
`ik.two_bone` turns the legs. `stream_lock` holds feet one frame at a time, for streams, which cannot look ahead.
"""
