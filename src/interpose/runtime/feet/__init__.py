"""Foot locking on the 22-joint humanoid, after Kovar et al. 2002 (`Footskate Cleanup for Motion Capture Editing`).

`stances` decides when each foot stands, `footholds` where; `lock` runs them, moves feet smoothly in between and turns
the legs (`ik.two_bone`). `stream_lock` holds feet one frame at a time, for streams, which cannot look ahead.
"""
