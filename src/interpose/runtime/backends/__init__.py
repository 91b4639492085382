"""The methods, one file each; `registry` lists them. See docs/architecture.md for how to add one."""
