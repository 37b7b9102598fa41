"""Numbers as people read them."""

from __future__ import annotations

from typing import Any


def short(x: float) -> str:
    """Two digits, in few characters."""
    if x == 0.0 or 0.1 <= abs(x) < 1000.0:
        return f"{x:.2g}" if abs(x) < 100.0 else f"{x:.0f}"
    digits, exponent = f"{x:.1e}".split("e")
    return f"{digits}e{int(exponent)}"


def called(thing: Any) -> str:
    """The name of a system in a line: as it is written, or by its class alone where that is long."""
    text = repr(thing)
    return text if len(text) <= 110 else f"{text.partition('(')[0]}(...)"


def duration(seconds: float) -> str:
    """Three digits, with the unit that leaves least to write."""
    rounded = float(f"{seconds:.3g}")
    unit, size = next(((u, s) for u, s in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)) if rounded >= s), ("ns", 1e-9))
    return f"{rounded / size:.6g} {unit}"
