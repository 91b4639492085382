"""The networks, one a file, in torch. Needs the extra ``interpose[train]``; the run time uses their exported forms."""
