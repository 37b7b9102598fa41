"""Densities and deviations of noise, looked at where records are made."""

from __future__ import annotations

from typing import Any

from ..errors import InvalidInput


def check_noise(record: Any, least: float = 0.0, **lengths: int) -> None:
    """Refuse fields that are not so many finite numbers of at least this size.  Raises InvalidInput.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001),
    section 4.2.
    """
    for name, length in lengths.items():
        values = getattr(record, name)
        if len(values) != length or not all(least <= x < INFINITY and x > -INFINITY for x in values):
            kind = ", positive" if least > 0.0 else ", not negative" if not least else ""
            raise InvalidInput(
                f"{type(record).__name__}: {name} must be {length} finite numbers{kind}; got {[*values]}"
            )


INFINITY = float("inf")
TINY = 2.0**-1000
"""The least deviation of a measurement: of exact ones S may be singular."""
