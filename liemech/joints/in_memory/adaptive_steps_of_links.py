"""Adaptive steps of any number of bodies and joints, by the error estimate of an RKMK method: that of all bodies
together.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.driver import numbers, write
from ...compiler.sites.planes import columns, each
from ...formulas import plain, record, sqrt, vec, where
from ...formulas.sums import total as added
from ...formulas.tables import Table, entry, of_whole, whole
from ...integrators.method import mean_squares
from ...integrators.rkmk import RKMK
from ...rooms.sites.runs.driver import PAIR, Embedded, OverSites, Standing, require_finite
from ...rooms.sites.steps_together import copied, summed_over
from ...simulation.compiled.control import first_guess, second_guess
from ...simulation.compiled.driver import on_the_way
from ...systems.lie_poisson import BodyState
from .stages_of_links import FREE, StagesOfLinks, displacement, multipliers, rate_here, slope_here

OVERFLOWED = -3.0
"""In the place of the joint at which a step has failed: numbers of a body are not finite."""

START, EULER = -2, -1
"""In the place of the number of a stage: the start of the step, and the end of an Euler step."""

STEP_GIVEN, STEP_OPEN = 3.0, 4.0
"""Of `ready`: the velocity at the start is still to be found; and so is the first step."""


@record
class AdaptiveStepsOfLinks(Embedded):
    """An RKMK method with an error estimate, as it carries along what adaptive steps need of one body.

    steps : its stages, behind them those that only the way between both ends needs.  order : where the velocity is
    asked for, one after the other: the first two in the first trial alone, then in stages and, by the number of all,
    at the end.  turns : how many these are.  last : the one that is at the end.
    """

    steps: StagesOfLinks
    order: Table
    turns: float
    last: int

    together: ClassVar[bool] = True

    @classmethod
    def of_method(cls, method: RKMK, curves: bool) -> AdaptiveStepsOfLinks:
        """The method of one body as that of many.  curves : is the way of a step kept?"""
        tableau = method.tableau
        rows, nodes = [*tableau.A], [*tableau.c]
        if curves and tableau.interpolant:
            rows, nodes = [*rows, *tableau.A_extra], [*nodes, *tableau.c_extra]
        steps = StagesOfLinks.of_flows(method, [[row] for row in (*rows, tableau.b)], nodes)
        stages, count = tableau.stages, len(nodes)
        last = stages - 1 if tableau.fsal else count
        order = [START, EULER, *range(1, stages), *([] if tableau.fsal else [last]), *range(stages, count)]
        return cls(method, curves, steps, of_whole(order), float(len(order)), last)

    @property
    def room(self) -> int:
        """The number of rows that slopes of a body take."""
        return self.steps.room

    def start(self, system: Any, state: Any, h: float) -> Standing:
        """A state, of which velocity and force are still to be found."""
        zeros = vec(*[0.0] * 12)
        return Standing(state, zeros, (zeros,) * (self.method.curve_terms if self.curves else 0))

    def inside(self, system: Any, before: Standing, after: Standing, part: float) -> BodyState:
        """The state of a body inside of a step, after a part of it."""
        state: BodyState = on_the_way(self.method.retraction, FREE, before.state, after.curve, part)
        return state

    def trial_together(
        self, sites: OverSites, system: Any, t: float, h: float, rtol: float, atol: float, source: int, target: int
    ) -> None:
        """A step on probation of all bodies; told are its error, the root mean square of those of all bodies, and which
        part of h it is.  The first trial finds the velocity at the start, which is the first slope of every step, and
        is as long as the first step is to be, unless that is given.
        """
        steps, places = self.steps, self.places(sites, system)
        copies, slopes, work = places.copies, places.slopes, places.work.fields
        old, new, ready = copies.nth(source).fields, copies.nth(target).fields, work.ready.at(0)
        share, speed, guess, unit = 1.0, 0.0, 0.0, 0.0
        for turn in range(0 if ready > 0.0 else 2, int(self.turns)):
            i, length = whole(self.order, turn), share * h
            if turn == 2:
                each(sites.sites, copied, old.velocity, slopes.nth(0))
            if i < 0:
                each(sites.sites, displaced_body, self, guess, old, new.state)
            else:
                steps.reach(length, i, sites.sites, copies, source, target, slopes)
            late = guess if i < 0 else entry(steps.nodes, i) * length
            multipliers(system, t + late, sites.sites, new.state, work)
            if i < 0:
                each(sites.sites, velocity_of_body, rtol, atol, i == START, old, work)
                first, second = means(system, work)
                if i == START:
                    speed, (guess, unit) = sqrt(first), first_guess(t, t + h, sqrt(first), sqrt(second))
                    work.ready.put(0, 0.0)
                elif ready == STEP_OPEN:
                    longest = second_guess(t, t + h, speed, guess, unit, sqrt(first), self.error_order)
                    share = min(longest / h, 1.0)
            if i == self.last:
                each(sites.sites, rated, new.velocity, work)
            if 0 <= i < steps.stages:
                each(sites.sites, slope_here, steps, length, i, slopes, work)
        h = share * h
        if steps.stages > self.method.tableau.stages:
            steps.reach(h, steps.stages, sites.sites, copies, source, target, slopes)
        each(sites.sites, tried_body, self, h, rtol, atol, old, new, slopes, work)
        write(sites.told, 0, (self.method.error_by(means(system, work)), share), PAIR)

    def velocities_together(
        self, sites: OverSites, system: Any, t: float, rtol: float, atol: float, source: int
    ) -> None:
        """Leave the velocities at the start to the first trial, so that code has the multipliers once."""
        self.places(sites, system).work.fields.ready.put(0, STEP_GIVEN)
        write(sites.told, 0, (0.0, 0.0), PAIR)

    def change_together(
        self, sites: OverSites, system: Any, t: float, h: float, rtol: float, atol: float, source: int
    ) -> None:
        """Leave the first step to the first trial, too: of no change it is the whole way."""
        self.places(sites, system).work.fields.ready.put(0, STEP_OPEN)
        write(sites.told, 0, (0.0, 0.0), PAIR)

    def places(self, sites: OverSites, system: Any) -> Any:
        """Columns of memory by name: the copies of numbers carried along, slopes, and numbers that a step works with."""
        memory = sites.memory
        return columns(sites.sites, copies=(memory, memory), slopes=self.steps.slopes, work=system.work)


def means(system: Any, work: Any) -> tuple[float, float]:
    """The means of two squares of all bodies.  Raises NotFinite, and says so in memory, where a number of a body is
    not finite.
    """
    squares = work.change_square, work.value_square, work.scale
    first, second, whole = [summed_over(column, system.bodies) for column in squares]
    work.failed_joint.put(0, where(whole - whole == 0.0, 0.0, OVERFLOWED))
    require_finite(vec(whole))
    return first / system.bodies, second / system.bodies


# ------------------------------------------------------------------ formulas of one body


def rated(velocity: Any, work: Any) -> None:
    """The velocity of a body."""
    velocity.save(rate_here(work))


def displaced_body(method: Any, h: float, start: Any, new: Any) -> None:
    """A body after an Euler step."""
    new.save(FREE.displaced(method.method.retraction, start.state.load(), h * start.velocity.load()))


def velocity_of_body(rtol: float, atol: float, start: bool, old: Any, work: Any) -> None:
    """The velocity of a body at the start, or its change; the mean squares of what that changes, and of what is there."""
    rate, velocity, state = rate_here(work), old.velocity.load(), old.state.load()
    change = vec(*[where(start, a, a - b) for a, b in zip(rate, velocity)])
    changed, sizes = FREE.variation(BodyState(plain(state.mu), plain(state.g)), change)
    squares = mean_squares(changed, sizes, rtol, atol)
    old.velocity.save(vec(*[where(start, a, b) for a, b in zip(rate, velocity)]))
    work.change_square.save(squares[0])
    work.value_square.save(squares[1])
    work.scale.save(added([*numbers(rate)]))


def tried_body(method: Any, h: float, rtol: float, atol: float, old: Any, new: Any, slopes: Any, work: Any) -> None:
    """The mean squares of the error of a body, and the coefficients of its way."""
    rkmk, begin, end, velocity = method.method, old.state.load(), new.state.load(), new.velocity.load()
    rates = [slopes.nth(j).load() for j in range(method.steps.stages)]
    squares = rkmk.squares(FREE, begin, end, rates, h, rtol, atol)
    work.change_square.save(squares[0])
    work.value_square.save(squares[-1])
    work.scale.save(added([*numbers(end), *numbers(velocity)]))
    if method.curves:
        omega = displacement(method.steps, h, method.steps.stages, slopes)
        new.curve.save(rkmk.curve(FREE, rates, rates[0], omega, velocity, h))
