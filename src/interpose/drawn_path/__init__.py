"""Paths that the user drew: `path_file` reads and checks one, `curve` smooths it, `pacing` times it, `following` makes
the root's path of it."""
