"""The drivers of runs of many sites backwards: states of a block of steps, the way back through them,
and the derivatives by parameters of the terms, edge by edge.
"""

from __future__ import annotations

import math
from typing import Any

from ....compiler.driver import accepted, attempt, itself, read, reason, write
from ....compiler.sites.planes import at, each, load, save, some
from ....formulas import Record, derivative, gradient, record, vec
from ....formulas.classes.fields import OfEach
from ....formulas.classes.layouts import NUMBER, layout_of
from ....formulas.classes.records import records_in, with_records
from ....formulas.numbers.conversions import fitted
from ....formulas.sites import SiteArray, own
from ....formulas.vectors import Vec as SmallVec
from ....systems.canonical import CanonicalState
from ....systems.in_time.inputs import during
from ....systems.lie_poisson import BodyState
from ...sites.runs.driver import require_finite
from ...sites.terms.terms import at_time
from ...sites.terms.terms_at_site import at_this_site, in_shape
from ..steps_backwards import FieldTurn, Question, SiteMotion, StepPart

# ------------------------------------------------------------------ steps

PART, NOTHING = layout_of(StepPart(0.0, 0.0, 0.0)), layout_of(())


@record
class WayBack(Record):
    """How a run is gone through: the motions that steps are made of, and the system at one site; the layouts of the state
    of a site, of derivatives by it, of what is kept for the parameters, and of a direction of a site; is it kept?

    cut, beyond : do steps end where inputs jump, and the part of one by which stages lie outside of it?
    """

    motions: tuple[Any, ...]
    system: Any
    state: Any
    felt: Any
    momentum: Any
    element: Any
    along: Any
    kept: bool
    cut: bool = False
    beyond: Any = None

    def __repr__(self) -> str:
        return "the way back"


def seen(way: WayBack, part: StepPart, value: Any) -> Any:
    """A record, such as a system, as the piece of a step sees it, with inputs by their limits from inside."""
    return during(value, part.whole, part.length, way.beyond) if way.cut else value


def forward_parts(
    way: WayBack, count: int, parts: Any, states: Any, beside: Any, done: Any, failures: Any
) -> None:  # fmt: skip
    """The driver: the states after each of so many parts of steps, one behind the other; `done` is then
    how many there are.

    states : the first row is the one to begin from.  beside : what joints work with.
    """
    for n in range(count):
        trial = attempt(moved, way, read(parts, n, PART), states, beside, n)
        if not accepted(trial, itself):
            if failures is not None:
                failures.append(reason(trial))
            break
        write(done, 0, float(n + 1), NUMBER)


def moved(way: WayBack, part: StepPart, states: Any, beside: Any, n: int) -> None:
    """One part of a step of all sites."""
    for k, motion in enumerate(way.motions):
        for _ in range(int(part.kind == k)):
            if motion.together:
                motion.move(way.system, part, states, n, way.state, beside)
            elif isinstance(motion, FieldTurn):
                each(states, copied_site, states, n, way.state)
                begin, end = int(part.begin), int(part.end)
                some(states, begin, end, one_moved, way, motion, part, states, beside, n)
            else:
                each(states, one_moved, way, motion, part, states, beside, n)


def copied_site(states: Any, n: int, layout: Any) -> None:
    """A site that stays as it is."""
    save(states, n + 1, load(states, n, layout), layout)


def one_moved(way: WayBack, motion: SiteMotion, part: StepPart, states: Any, beside: Any, n: int) -> None:
    """One part of a step of one site."""
    system, motion = seen(way, part, at_this_site(way.system, beside, NOTHING)), seen(way, part, motion)
    new = motion.moved(system, part, load(states, n, way.state))
    require_finite(new)
    save(states, n + 1, fitted(new, way.state), way.state)


def backward_parts(
    way: WayBack, count: int, parts: Any, states: Any, beside: Any, felt: Any, injected: Any, momenta: Any,
    elements: Any,
) -> None:  # fmt: skip
    """The driver: the derivative by the state after the last of so many parts becomes the one by the
    state before the first of them.

    injected : derivatives by states before parts, those of the last one first.  momenta, elements : where
    energies were asked.
    """
    met = 0
    for k in range(count):
        n = count - 1 - k
        part = read(parts, n, PART)
        for i, motion in enumerate(way.motions):
            for _ in range(int(part.kind == i)):
                if motion.together:
                    trial = attempt(motion.go_back, way.system, part, states, n, way.state, beside, felt, way.felt)
                    if not accepted(trial, itself):
                        each(felt, lost, way, felt)
                elif isinstance(motion, FieldTurn):
                    turned_back(way, motion, part, states, n, felt, elements, momenta)
                else:
                    each(states, one_back, way, motion, part, states, beside, n, felt, momenta, elements)
        for _ in range(int(part.injected)):
            each(states, one_injected, way, felt, injected, met)
            met = met + 1


backward_parts.goes_back = True  # type: ignore[attr-defined]


def one_back(
    way: WayBack, motion: SiteMotion, part: StepPart, states: Any, beside: Any, n: int, felt: Any, momenta: Any,
    elements: Any,
) -> None:  # fmt: skip
    """The way of one site back through one part."""
    before, after = load(states, n, way.state), load(states, n + 1, way.state)
    w = load(felt, 0, way.felt)
    system = seen(way, part, at_this_site(way.system, beside, NOTHING))
    back = motion.back(system, part, before, after, w)
    save(felt, 0, fitted(back.w, way.felt), way.felt)
    if way.kept:
        for j, asked in enumerate(back.momenta):
            save(momenta, int(part.momenta) + j, asked, way.momentum)
        for j, asked in enumerate(back.elements):
            save(elements, int(part.elements) + j, asked, way.element)


def lost(way: WayBack, felt: Any) -> None:
    """No derivative of a site, where a step that was made forwards is not made again."""
    w = load(felt, 0, way.felt)
    save(felt, 0, fitted(BodyState(math.nan * w.mu, w.g), way.felt), way.felt)


def turned_back(
    way: WayBack, turn: FieldTurn, part: StepPart, states: Any, n: int, felt: Any, alongs: Any, momenta: Any
) -> None:  # fmt: skip
    """The way back through a turn: first of the sites that turn, then of the others, or of all where
    each turns by itself.  alongs : zeros, before and after.
    """
    begin, end, arguments = int(part.begin), int(part.end), (way, turn, part, states, n, felt, alongs)
    some(states, begin, end, one_turned_back, *arguments, momenta)
    if turn.energy.coupled:
        some(states, 0, begin, one_other_back, *arguments, momenta)
        some(states, end, int(part.last), one_other_back, *arguments, momenta)
    else:
        some(states, begin, end, one_other_back, *arguments, momenta)
    some(states, begin, end, one_at_rest, alongs, way.along)


def one_turned_back(
    way: WayBack, turn: FieldTurn, part: StepPart, states: Any, n: int, felt: Any, alongs: Any, momenta: Any
) -> None:  # fmt: skip
    """The way of one site back through its own turn."""
    before, w = load(states, n, way.state), load(felt, 0, way.felt)
    turn = seen(way, part, turn)
    w, along = turn.of_turned(at_this_site(way.system), part, before, w)
    save(felt, 0, fitted(w, way.felt), way.felt)
    save(alongs, 0, along, way.along)
    if way.kept:
        save(momenta, int(part.momenta), Question(part.t, before.mu, along), way.momentum)


def one_other_back(
    way: WayBack, turn: FieldTurn, part: StepPart, states: Any, n: int, felt: Any, alongs: Any, momenta: Any
) -> None:  # fmt: skip
    """The way of one site back that others turn by."""
    before, w = load(states, n, way.state), load(felt, 0, way.felt)
    along = load(alongs, 0, way.along)
    turn = seen(way, part, turn)
    by_others = turn.of_others(part, before.mu, along)
    save(felt, 0, fitted(BodyState(w.mu + by_others, w.g), way.felt), way.felt)
    if way.kept:
        save(momenta, int(part.momenta), Question(part.t, before.mu, along), way.momentum)


def one_at_rest(alongs: Any, layout: Any) -> None:
    """Set the direction of a site to zero."""
    save(alongs, 0, vec(*[0.0 for _ in range(layout.width)]), layout)


def one_injected(way: WayBack, felt: Any, injected: Any, k: int) -> None:
    """Add the derivative of a function of the state between two steps, at one site."""
    save(felt, 0, added(load(felt, 0, way.felt), load(injected, k, way.felt)), way.felt)


def added(w: Any, more: Any) -> Any:
    """The sum of derivatives by a state."""
    if isinstance(w, CanonicalState):
        return CanonicalState(w.q + more.q, w.p + more.p)
    return BodyState(w.mu + more.mu, None if w.g is None else w.g + more.g)


# ------------------------------------------------------------------ parameters


@record
class VariedParameter(Record, OfEach):
    """A parameter by which is differentiated: its values at all edges."""

    array: SiteArray
    shape: tuple[int, ...]


@record
class EdgesAsked(Record):
    """A term as its edges have it.

    group : of one site.  site : one of which nothing is known.  own : of every end the parameters of
    sites.  ends : of every edge the sites.  in_momenta : is it a function of momenta?
    """

    term: Any
    group: Any
    site: Any
    own: tuple[tuple[Any, ...], ...]
    ends: Any
    in_momenta: bool

    def __repr__(self) -> str:
        return f"derivatives by parameters of {type(self.term).__name__}"

    def energy(self, term: Any, found: list[Question], e: float) -> float:
        """That of an edge whose ends have moved by e along what was asked."""
        sites: list[Any] = []
        for asked, own_values in zip(found, self.own):
            if self.in_momenta:
                mu, g = asked.place + e * asked.along, None
            else:
                mu, g = None, self.group.compose_exp(asked.place, e * asked.along)
            sites = [*sites, type(self.site)(mu, g, None, *own_values)]
        return term.energy(*sites)


def edges_back(edges: EdgesAsked, asked: Any, total: Any, count: int, used: Any, sums: Any) -> None:
    """The driver: to the sum of every edge d/dp D_along E of all that was asked, so many times."""
    each(sums, one_edge, edges, asked, total, count, used, sums)


def one_edge(edges: EdgesAsked, asked: Any, total: Any, count: int, used: Any, sums: Any) -> None:
    """Add the derivatives at one edge to its sum."""
    edge = at_this_site(edges)
    varied = records_in(edge, VariedParameter)
    numbers = vec(*[x for parameter in varied for x in numbers_of(parameter)])
    slopes = load(sums, 0, total)
    for k in range(count):
        ends = [at(used, own(edges.ends, i), k, asked) for i in range(len(edge.own))]
        slopes = slopes + by_parameters(edge, varied, ends, numbers)
    save(sums, 0, slopes, total)


def by_parameters(edges: EdgesAsked, varied: list[VariedParameter], ends: list[Question], p: Any) -> Any:
    """d/dp D_along E of an edge."""
    return gradient(lambda x: sensed(edges, varied, ends, x), p)


def sensed(edges: EdgesAsked, varied: list[VariedParameter], ends: list[Question], p: Any) -> float:
    """D_along E of an edge with these parameters."""
    values: list[Any] = []
    begin = 0
    for parameter in varied:
        width, shape = len(numbers_of(parameter)), parameter.shape
        values = [*values, in_shape(p[begin : begin + width] if shape else p[begin], shape)]
        begin = begin + width
    moved = with_records(edges, VariedParameter, values)
    term = at_time(moved.term, ends[0].t)
    return derivative(lambda e: moved.energy(term, ends, e), 0.0)


def numbers_of(parameter: VariedParameter) -> list[Any]:
    """The numbers of a parameter at an edge."""
    value = own(parameter.array)
    return [*value] if isinstance(value, SmallVec) else [value]
