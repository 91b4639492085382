"""The command `interpose`. Each command imports what it needs when it runs, so that `--help` answers at once.

Exit status: 0 done; 1 the input cannot be served, with one line on standard error that says what, where and what to do;
2 wrong usage; 130 interrupted. A traceback means a bug.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from textwrap import wrap
from types import ModuleType

from interpose.errors import InputError

_DESCRIPTION = "Motion in-betweening: key poses in, finished motion out, exact at the keys, on your own rig."


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status. ``argv`` is without the program's name; None takes the process's."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    try:
        status = _run(arguments)
        sys.stdout.flush()
        return status
    except InputError as error:
        return _fail(str(error))
    except BrokenPipeError:
        _silence_stdout()
        return 141  # what a shell reports for a command whose reader has gone
    except OSError as error:
        _silence_stdout()
        name = f"{os.fsdecode(error.filename)}: " if isinstance(error.filename, str | bytes) else ""
        return _fail(f"{name}{error.strerror or error}")
    except MemoryError:
        return _fail("not enough memory for this input; use a shorter clip or fewer variants")
    except KeyboardInterrupt:
        return _fail("interrupted", 130)


def _run(arguments: list[str]) -> int:
    if arguments == ["--version"]:
        from importlib.metadata import version

        print(f"interpose {version('interpose')}")
        return 0
    if arguments in ([], ["--help"], ["-h"]):
        print(_overview())
        return 0
    import tyro

    prog, described = "interpose", _DESCRIPTION
    called = {name: getattr(module, name) for module, names in _groups() for name in names}
    if arguments[0] == "gallery":
        from interpose.cli import gallery

        described = (called["gallery"].__doc__ or "").partition("\n")[0]
        called = {name: getattr(gallery, name) for name in ("build", "query", "plot", "generate")}
        prog, arguments = "interpose gallery", arguments[1:]
    try:
        status = tyro.extras.subcommand_cli_from_dict(
            called,
            prog=prog,
            description=described,
            args=arguments or ["--help"],
            config=(tyro.conf.FlagCreatePairsOff,),
        )
    except SystemExit as stop:  # tyro leaves this way after --help (0) and after wrong usage (2)
        return stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 2
    return status or 0


def _groups() -> tuple[tuple[ModuleType, tuple[str, ...]], ...]:
    """The commands, by the module that holds their help."""
    from interpose.cli import make_motion, train_and_measure

    return (
        (make_motion, ("demo", "info", "fill", "between", "models", "studio", "gallery")),
        (train_and_measure, ("prepare", "labels", "train", "export", "evaluate")),
    )


def _overview() -> str:
    """The help of the program itself: its commands in two groups."""
    lines = ["usage: interpose COMMAND ...", "", _DESCRIPTION]
    for title, (module, names) in zip(("make motion", "train and measure"), _groups(), strict=True):
        lines += ["", f"{title}:"]
        for name in names:
            first, *more = wrap((getattr(module, name).__doc__ or "").partition("\n")[0], 84)
            lines += [f"  {name:<11} {first}", *(f"{'':<14}{line}" for line in more)]
    more = "`interpose COMMAND --help` shows the options of one; `interpose --version` prints the version."
    return "\n".join([*lines, "", more])


def _fail(message: str, status: int = 1) -> int:
    line = " ".join(message.split())
    with suppress(OSError):  # nobody listens; the status still tells
        print(f"interpose: {line}", file=sys.stderr, flush=True)
    return status


def _silence_stdout() -> None:
    """Point standard output at nothing, so that Python's flush at exit does not fail a second time."""
    with suppress(OSError, ValueError):  # a replaced standard output, in a test or a notebook, has no descriptor
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
