"""Starts of runs: what a plan checks of a start, and what it remembers of the layouts of those before."""

from __future__ import annotations

from typing import Any

from ...compiler import kernel
from ...errors import InvalidInput, InvalidType
from ...formulas.classes.layouts import known_layout, layout_of, restricted
from ...formulas.classes.records import names_of
from ...systems.system import State, member
from .. import arguments


def started(plan: Any, start: Any, t0: float) -> Any:
    """The start with the parts that the run needs; its bodies must be as many as the systems,
    and as the steps if they have steps of their own.
    """
    start = plan._inner._written_out(start)
    layout = known(plan, start)
    if layout is not None:
        return start if start.bodies else restricted(start, layout[0])
    inner, original = plan._inner, start
    start = arguments.started(inner, start, needed(plan, inner, start), t0, plan._bound)
    for name, each in plan.of_each.items():
        if start.bodies == len(each):
            continue
        if name in ("system", "method"):
            raise InvalidInput(
                f"integrate: there are {len(each)} {name}s for {start.bodies or 'a start of one'} bodies"
            )
        if start.bodies is None:
            raise InvalidType(f"integrate: {name} must be a number for a start of one body; got {plan._given[name]!r}")
        what = "steps" if name == "h" else "numbers"
        raise InvalidInput(f"integrate: {name} has {len(each)} {what} for {start.bodies} bodies")
    if (
        plan._bound is None
        and (plan._plain or not plan.of_each)
        and not getattr(inner, "rheonomic", False)
        and inner._knows(original)
    ):
        side = kernel.side_by_side(start.bodies)
        if start.bodies is None:
            plan._laid_out[layout_of(original)] = layout_of(start), side
        elif start is original:
            plan._laid_out[kind_of_many(original)] = layout_of(member(start, 0)), side
    return start


def known(plan: Any, start: Any) -> Any:
    """The key of the shape of a start, if one like it was checked before."""
    layout = known_layout(start)
    if layout is None and isinstance(start, State):
        layout = layout_of(start) if start.bodies is None else kind_of_many(start)
    key = None if layout is None else plan._laid_out.get(layout)
    return key if key is not None and plan._inner._knows(start) else None


def kind_of_many(start: Any) -> Any:
    """A key that is equal for starts of ensembles with the same layout."""
    kind: Any = type(start)
    parts = [getattr(start, name) for name in names_of(kind)]
    return kind, *[x if x is None else (x.shape, x.dtype.char) for x in parts]


def needed(plan: Any, system: Any, start: Any) -> Any:
    """The parts of the state that the run needs, if not all."""
    return plan.recorder.needed(plan._inner, system, start) if plan.recorder else plan.record
