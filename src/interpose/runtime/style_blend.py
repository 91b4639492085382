"""Style labels, one or several blended: `Angry`, `Angry+Drunk` (half of each), `Angry:0.7+Drunk:0.3`."""

from __future__ import annotations

from collections.abc import Sequence

from interpose.errors import InputError


def shares(label: str) -> dict[str, float]:
    """How much there is of each style in a label; they sum to one, the first is named first.

    Raises InputError for shares that are no numbers, negative, or nothing in all, and for a style named twice.
    """
    told: dict[str, float] = {}
    for part in label.split("+"):
        name, colon, share = part.partition(":")
        name = name.strip()
        try:
            value = float(share) if colon else 1.0
        except ValueError:
            value = -1.0
        if not name or name in told or not 0.0 <= value < float("inf"):
            raise InputError(
                f"the style '{label}' cannot be read; give a name, or several once each with shares from 0 on, "
                f"such as 'Angry:0.7+Drunk:0.3'"
            )
        told[name] = value
    whole = sum(told.values())
    if not whole > 0.0:
        raise InputError(f"the shares of the style '{label}' are all zero; give one of them more")
    return {name: value / whole for name, value in told.items()}


def leading(label: str | None) -> str | None:
    """The style that a label has most of, the first of equals."""
    if label is None:
        return None
    told = shares(label)
    return max(told, key=told.__getitem__)


def check(label: str, known: Sequence[str], model: str) -> None:
    """Raises InputError where a label names a style that the model does not have."""
    for name in shares(label):
        if name not in known:
            raise InputError(f"the model '{model}' has no style '{name}'; it has {', '.join(known) or 'none'}")
