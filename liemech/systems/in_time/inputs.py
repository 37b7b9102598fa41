"""The inputs of a system: the tables in its fields, as a step sees them."""

from __future__ import annotations

import functools
from typing import Any

from ...formulas.classes.layouts import Layout, layout_of
from ...formulas.classes.records import records_in, with_records
from .tabulated import PiecewisePolynomial


def inputs(system: Any) -> list[PiecewisePolynomial]:
    """The tables in the fields of a system."""
    return records_in(system, PiecewisePolynomial)


def has_inputs(system: Any) -> bool:
    """Whether the system has tables; by its layout, which is cached."""
    return _has_table(layout_of(system))


@functools.lru_cache(256)
def _has_table(layout: Layout) -> bool:
    is_table = layout.kind == "record" and issubclass(layout.detail[0], PiecewisePolynomial)
    return is_table or any(map(_has_table, layout.parts))


def during(system: Any, t: Any, h: Any, beyond: Any = None) -> Any:
    """The system as a step from t to t + h sees it: every table by its limits from inside.

    beyond : the part of h by which stages of the method lie beyond the ends of the step, or None.
    """
    limited = [table.during(t, h, beyond) for table in inputs(system)]
    return with_records(system, PiecewisePolynomial, limited)
