"""Training data: what a source folder holds, how it becomes a database, and what is computed for each frame."""
