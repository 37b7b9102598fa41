"""Numbers made of two: which kinds there are, and how one is put together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .compensated import Compensated
from .complex_numbers import Complex
from .double_double import DoubleDouble
from .dual import Dual

PAIRS = (Complex, Dual, Compensated, DoubleDouble)
"""Numbers made of two."""


def paired(form: tuple[Any, ...], parts: Iterable[Any]) -> Any:
    """The number of this form made of two parts."""
    cls, *options = form
    return cls(*parts, *options)
