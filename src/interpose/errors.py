"""The one exception that bad input raises, so that callers and the command line tell it from a bug."""

from __future__ import annotations


class InputError(ValueError):
    """The input cannot be served. The message is one sentence that says what, where, and what to do.

    The command line prints it and exits with status 1; the library raises it. Anything else that escapes is a bug.
    """
