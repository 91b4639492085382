"""Style labels, one or several blended: `Angry`, `Angry+Drunk` (half of each), `Angry:0.7+Drunk:0.3`."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from interpose.errors import InputError


def shares(label: str) -> dict[str, float]:
    """How much there is of each style in a label, in its order; they sum to one.

    Raises InputError for shares that are no numbers, negative, or zero in all, and for a style named twice.
    """
    given: dict[str, float] = {}
    for part in label.split("+"):
        name, colon, share = part.partition(":")
        name = name.strip()
        try:
            value = float(share) if colon else 1.0
        except ValueError:
            value = -1.0
        if not name or name in given or not 0.0 <= value < float("inf"):
            raise InputError(
                f"the style '{label}' cannot be read; give a name, or several once each with shares from 0 on, "
                f"such as 'Angry:0.7+Drunk:0.3'"
            )
        given[name] = value
    whole = sum(given.values())
    if not whole > 0.0:
        raise InputError(f"the shares of the style '{label}' are all zero; give one of them more")
    return {name: value / whole for name, value in given.items()}


def leading(label: str | None) -> str | None:
    """The style that a label has most of, the first of equals."""
    if label is None:
        return None
    given = shares(label)
    return max(given, key=given.__getitem__)


def known_shares(label: str, known: Sequence[str], model: str) -> dict[str, float]:
    """The shares of a label by the model's own spelling of its styles, which are found in any case.

    Raises InputError where it names a style that the model does not have, with the nearest one that it has.
    """
    out: dict[str, float] = {}
    by_lower = {name.lower(): name for name in known}
    for name, share in shares(label).items():
        spelled = name if name in known else by_lower.get(name.lower())
        if spelled is None:
            near = get_close_matches(name.lower(), by_lower, 1)
            hint = f"; did you mean '{by_lower[near[0]]}'?" if near else ";"
            raise InputError(f"the model '{model}' has no style '{name}'{hint} it has {', '.join(known) or 'none'}")
        out[spelled] = out.get(spelled, 0.0) + share
    return out


def spelled(label: str, known: Sequence[str], model: str) -> str:
    """The label in the model's own spelling. Raises InputError as :func:`known_shares`."""
    given = known_shares(label, known, model)
    if len(given) == 1:
        return next(iter(given))
    return "+".join(f"{name}:{share:.6g}" for name, share in given.items())
