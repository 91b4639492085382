"""One readable script a model, and the loop that they share. Needs the extra ``interpose[train]``."""
