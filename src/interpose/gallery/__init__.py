"""The trajectory gallery: how people really get from one place to another, and how to find it again.

Chu and Yang 2024 (DC-MoE), section 4 and appendix 9.1. `tracks` holds what is searched, `windows` says what an atomic
trajectory is, `index` finds them fast and `scan` slowly, `matching` is Algorithm 1, `paths` makes one continuous path
of what was found, `weighing` says how well it fits, `proposals` chooses, `speeds` says how long a way takes, `store`
keeps it all on disk, `plots` draws it. `drawn` follows a user's own line: `drawfile` reads it, `curve` makes it smooth,
`pacing` times it.
"""
