"""The drivers of one system of many sites: what it carries along is a place in memory, and a step of
it is a loop over sites around the step of one.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ....compiler.driver import accepted, attempt, itself, numbers, read, reason, write
from ....compiler.sites.planes import at, each, load, save
from ....errors import NotFinite
from ....formulas import Record, Vec, record, vec, where
from ....formulas.classes.layouts import NUMBER, carried_layout, layout_of
from ....formulas.numbers.conversions import fitted
from ....formulas.sites import own, total
from ....formulas.sums import total as added
from ....integrators.rkmk import TrialStep
from ....simulation.compiled.control import CLOCK, GOAL, going, sample, stepped
from ....simulation.compiled.driver import advance, on_the_way
from ....systems.in_time.inputs import during
from ..terms.terms_at_site import at_this_site


@record
class Place(Record):
    """Where the memory of a method lies, of all sites: in the first of two copies, 0, or in the
    second, 1.
    """

    copy: int


@record
class Nothing(Record):
    """The outcome of a step of many sites: it went through or not."""


PLACE, BESIDE = carried_layout(Place(0)), carried_layout((Place(0), vec(0.0)))
"""The layouts of what fixed and adaptive steps carry along of all sites together: the velocities
lie beside the states.
"""

ROW = layout_of((0.0, Nothing(), ()))

PAIR = carried_layout((0.0, 0.0))
"""The layout of what a loop over sites tells."""


@record
class OfMethod(Record):
    """A form of a method that may have an error estimate; abstract."""

    method: Any

    @property
    def shortens(self) -> bool:
        """Are its steps as long as they turn out?"""
        return self.method.shortens

    @property
    def error_order(self) -> int:
        return self.method.error_order


@record
class OverSites(OfMethod):
    """The method of one site as that of all; `sites` are their numbers, `memory` is the layout of
    what the method carries along for one, `told` are two numbers that are the same for all.
    """

    sites: Any
    memory: Any
    told: Any

    def _held(self, name: str, value: Any) -> Any:
        """As it is: what is told is written."""
        return value

    def at_site(self, system: Any) -> Any:
        """The system as this site has it."""
        return at_this_site(system, self.sites, self.memory)

    def of_site(self, here: int) -> Any:
        """The memory of the method for this site, in one of its copies."""
        return load(self.sites, here, self.memory)

    def seen(self, here: int) -> Any:
        """The memory of the method for this site as a user numbers them."""
        if self.method.place_of_site is None:
            return load(self.sites, here, self.memory)
        return at(self.sites, own(self.method.place_of_site), here, self.memory)

    def step(self, system: Any, t: float, place: Place, h: float) -> Place:
        """A step of all sites, from one copy of the memory to the other if there are two."""
        there = 1 - place.copy if self.method.looked_into else place.copy
        self.go(system, t, place.copy, there, h)
        return Place(there)

    def go(self, system: Any, t: float, here: int, there: int, h: float) -> None:
        """A step of all sites from one copy of the memory to another."""
        if self.method.together:
            self.method.step_together(system, t, h, self.sites, here, there, self.memory)
        else:
            each(self.sites, one_step, self, system, t, h, here, there)

    def settle(self, system: Any, t: float, here: int) -> None:
        """Find what is shown of the state to which steps have led, if the method does not always do so."""
        if self.method.settles:
            self.method.settle(system, t, self.sites, here, self.memory)

    def observe(self, place: Place) -> Nothing:
        """Nothing: samples are taken when they are wanted."""
        return Nothing()

    def trial(
        self, system: Any, t: float, place: Place, first: Vec, h: float, rtol: float, atol: float, dense: bool
    ) -> TrialStep:
        """A step on probation of all sites, to the other copy of the memory.  Its error is the root
        mean square of those of the sites.
        """
        there = 1 - place.copy
        each(self.sites, one_trial, self, system, t, h, rtol, atol, dense, place.copy, there)
        error, share = read(self.told, 0, PAIR)
        return TrialStep(Place(there), first, error, (), share)

    def first_velocity(self, system: Any, t: float, place: Place, rtol: float, atol: float) -> tuple[Vec, float, float]:
        """The velocities at the start, put beside the states, and their sizes."""
        each(self.sites, one_velocity, self, system, t, rtol, atol, place.copy)
        return vec(0.0), *read(self.told, 0, PAIR)

    def change_of_velocity(
        self, system: Any, t: float, place: Place, first: Vec, h: float, rtol: float, atol: float
    ) -> float:
        """The size of the change of the velocities in an Euler step."""
        each(self.sites, one_change, self, system, t, h, rtol, atol, place.copy)
        return read(self.told, 0, PAIR)[0]


SOON = 1.25
"""Steps to the next sample from which on what is shown of a state is found: a sample inside of a step
begins with what is shown before it.
"""

SPARE, COPIES = 2, 4
"""The first of two copies of the memory for what lies between the parts of a step that is cut, and how many
there are then.
"""


@record
class OverSitesToJumps(OverSites):
    """The method of all sites, whose steps are cut where an input jumps.

    ending : `EndingAtJumps`, which knows where.  What lies between the parts of a step has copies of the
    memory of its own, so that the state before it stays.
    """

    ending: Any

    def step(self, system: Any, t: float, place: Place, h: float) -> Place:
        """A step of all sites from jump to jump, as that of one body in `EndingAtJumps`."""
        here, there = place.copy, 1 - place.copy
        at, lasting, to_copy, going = t, h, SPARE, True
        while going:
            at, begin, s, going = self.ending.next_part(system, t, h, at)
            if self.ending.anew:
                self._begin_anew(system, here, lasting, s)
                lasting = s
            by_way = where(going, to_copy, there)
            self.go(during(system, begin, s, self.ending.beyond), begin, here, by_way, s)
            here, to_copy = by_way, 2 * SPARE + 1 - to_copy
        if self.ending.anew:
            self._begin_anew(system, there, lasting, h)
        return Place(there)

    def _begin_anew(self, system: Any, here: int, lasting: float, h: float) -> None:
        """The memory of the method, of steps of length `lasting`, for those of length h."""
        if lasting != h:
            each(self.sites, one_anew, self, system, h, here)


def one_anew(sites: OverSites, system: Any, h: float, here: int) -> None:
    """One site begins anew, for steps of another length."""
    shown = sample(sites.method, sites.of_site(here))
    save(sites.sites, here, fitted(sites.method.start(sites.at_site(system), shown, h), sites.memory), sites.memory)


def one_step(sites: OverSites, system: Any, t: float, h: float, here: int, there: int) -> None:
    """A step of one site."""
    new, shown = stepped(sites.method, sites.at_site(system), t, sites.of_site(here), h, sites.memory)
    require_finite(shown)
    save(sites.sites, there, new, sites.memory)


def one_rate(sites: OverSites, system: Any, t: float, here: int) -> None:
    """The velocity of one site, which is to be finite."""
    at_site, state = sites.at_site(system), sample(sites.method, sites.of_site(here))
    require_finite(at_site.rate(t, at_site.essential_part(state)))


def require_finite(value: Any) -> None:
    """Raise NotFinite where the sum of the numbers of a value is not finite."""
    total = added([*numbers(value)])
    if not total - total == 0.0:
        raise NotFinite(OVERFLOW)


# ------------------------------------------------------------------ adaptive steps


@record
class Standing(Record):
    """Numbers that adaptive steps carry along for one site: its state, the velocity there, and the way of the
    last step.
    """

    state: Any
    velocity: Vec
    curve: tuple[Vec, ...]


@record
class Embedded(OfMethod):
    """A method with an error estimate as it carries along what adaptive steps need of one site.

    curves : is the way of a step kept?
    """

    curves: bool
    ending: ClassVar[None] = None
    settles: ClassVar[bool] = False
    together: ClassVar[bool] = False
    looked_into: ClassVar[bool] = True
    place_of_site: ClassVar[Any] = None

    def __repr__(self) -> str:
        return repr(self.method)

    def start(self, system: Any, state: Any, h: float) -> Standing:
        """A state, of which the velocity is still to be found."""
        at_rest = vec(*[0.0 for _ in range(system.group.dim)])
        return Standing(state, at_rest, (at_rest,) * (self.method.curve_terms if self.curves else 0))

    def observe(self, memory: Standing) -> Any:
        """The state in the memory of the method."""
        return memory.state

    def inside(self, system: Any, before: Standing, after: Standing, part: float) -> Any:
        """The state of one site inside of a step, after a part of it."""
        return on_the_way(self.method.retraction, at_this_site(system), before.state, after.curve, part)


def one_trial(
    sites: OverSites, system: Any, t: float, h: float, rtol: float, atol: float, dense: bool, here: int, there: int
) -> None:
    """A step on probation of one site."""
    old, method = sites.of_site(here), sites.method.method
    trial = method.trial(sites.at_site(system), t, old.state, old.velocity, h, rtol, atol, dense)
    new = Standing(trial.state, trial.velocity, trial.curve)
    require_finite(new)
    write(sites.told, 0, (trial.error, trial.share), PAIR)
    save(sites.sites, there, new, sites.memory)


def one_velocity(sites: OverSites, system: Any, t: float, rtol: float, atol: float, here: int) -> None:
    """The velocity of one site at the start."""
    old = sites.of_site(here)
    xi, speed, size = sites.method.method.first_velocity(sites.at_site(system), t, old.state, rtol, atol)
    require_finite(xi)
    write(sites.told, 0, (speed, size), PAIR)
    save(sites.sites, here, Standing(old.state, xi, old.curve), sites.memory)


def one_change(sites: OverSites, system: Any, t: float, h: float, rtol: float, atol: float, here: int) -> None:
    """The change of the velocity of one site in an Euler step."""
    old, at_site = sites.of_site(here), sites.at_site(system)
    arguments = t, old.state, old.velocity, h, rtol, atol
    write(sites.told, 0, (sites.method.method.change_of_velocity(at_site, *arguments), 0.0), PAIR)


def one_remake(sites: OverSites, system: Any, t: float, h: float, here: int) -> None:
    """The step of one site as on probation, without its error, which is that of all."""
    old, at_site = sites.of_site(here), sites.at_site(system)
    if h == 0.0:
        require_finite(at_site.rate(t, at_site.essential_part(old.state)))
    else:
        new = sites.method.method.step(at_site, t, old.state, h)
        require_finite((new, at_site.rate(t + h, at_site.essential_part(new))))


# ------------------------------------------------------------------ steps and samples


@record
class Share(Record):
    """The value of a formula of the system for one site: its share, such as that of the energy.

    parts : of the state, the arguments of the formula.
    """

    name: str
    parts: tuple[str, ...]

    def __call__(self, t: float, system: Any, state: Any) -> Any:
        arguments = [t if part == "t" else getattr(state, part) for part in self.parts]
        return getattr(system, self.name)(*arguments)


@record
class OfSite(Record):
    """A user's function of time and the state of one site."""

    function: Any

    def __call__(self, t: float, system: Any, state: Any) -> Any:
        return self.function(t, state)


@record
class Shown(Record):
    """The content of samples: of every site, if it is `kept`, the state, or if they are `whole` all that its method
    carries along, in this layout; and totals over all sites of quantities, in rows of another.
    """

    kept: bool
    whole: bool
    layout: Any
    quantities: tuple[Any, ...]
    totals: Any


@record
class March(Record):
    """How far a march has come: samples that were written, and when its last step began, a nan before the first one."""

    samples: float
    begun: float


OVERFLOW = "the step overflowed or left the domain of a formula; a smaller h may help"

MARCH = layout_of(March(0.0, 0.0))

ESTIMATE, SHARE, WRITTEN, STEP_BEGIN, MET = range(5)
"""The places of the numbers of a march: what a loop over sites tells, the error of a step and its share; a `March`; and
whether an event may have a zero in its last step.
"""

ENDS = 2
"""Rows of totals before those of samples, where events are asked: of the states in both copies of the memory."""


@record
class Procedure(Record):
    """The procedure of the driver of steps: the method of one site, the control of all, and samples.

    method : of one site.  control : of the steps.  memory, place : the layouts of what the method carries along for one
    site, and of what the control does.  shown : the content of samples.  all_steps : are there samples of all steps,
    or at given times?  ending : where steps are cut; None: nowhere.  events : functions of time and totals whose changes of
    sign end a march, `named` an example of totals with their names, `counted` the content of these.
    """

    method: Any
    control: Any
    memory: Any
    place: Any
    shown: Shown
    all_steps: bool
    ending: Any
    events: tuple[Any, ...] = ()
    named: Any = None
    counted: Any = None

    def over(self, sites: Any, told: Any) -> OverSites:
        """The method of one site as that of all."""
        if self.ending is None:
            return OverSites(self.method, sites, self.memory, told)
        return OverSitesToJumps(self.method, sites, self.memory, told, self.ending)

    def values(self, t: float, totals: Any) -> tuple[float, ...]:
        """The values of the events at a time and at totals."""
        return tuple([event(t, type(self.named)(*totals)) for event in self.events])


def advance_sites(
    procedure: Procedure, system: Any, turns: int, sites: Any, seen: Any, totals: Any, times: Any, march: Any,
    goals: Any, states: Any, clocks: Any, out: Any, failures: Any,
) -> None:  # fmt: skip
    """The driver: so many turns of all sites, and a sample where a step ends at the next of the times, which have a nan
    behind them, while it stands still where a step goes beyond the next time, or an event changes its sign; or a sample
    of every step, behind that of where the first one begins, and their times.

    sites : copies of the memory of all sites.  seen, totals : samples of all sites, and of quantities, one behind the
    other.  march : (5,), from `ESTIMATE` to `MET`.  goals, states, clocks, out,
    failures : as for `advance`.
    """
    everyone, shown = procedure.over(sites, march), procedure.shown
    goal, step_begin = read(goals, 0, GOAL), read(march, 1, MARCH).begun
    soon = SOON if everyone.method.looked_into else 0.5
    n, k = 0, 0
    moved = step_begin != step_begin
    if procedure.all_steps and not moved:
        k = 1
    step_begin = read(clocks, 0, CLOCK).t if moved else step_begin
    unknown = tuple([float("nan") for _ in procedure.events])
    before = unknown
    while n <= turns:
        clock, here = read(clocks, 0, CLOCK), read(states, 0, PLACE).copy
        t = clock.t
        if procedure.events and (moved or n == 0):
            everyone.settle(system, t, here)
            each(seen, one_sample, everyone, system, t, here, procedure.counted, seen, totals, here)
            trial, values = attempt(procedure.values, t, read(totals, here, shown.totals)), unknown
            if accepted(trial, itself):
                values = trial
            for old, new in zip(before, values):
                if n > 0 and not old * new > 0.0:  # or an event fails, or is nan
                    write(march, MET, 1.0, NUMBER)
            before = values
        last = n == turns or not going(clock, goal)
        if procedure.events:
            last = last or read(march, MET, NUMBER) == 1.0
        if procedure.all_steps:
            if moved:
                everyone.settle(system, t, here)
                each(seen, one_sample, everyone, system, t, here, shown, seen, totals, k)
                write(times, k, t, NUMBER)
                k = k + 1
        else:
            last = last or (read(times, k, NUMBER) - t) * (t - step_begin) < 0.0
            if not procedure.events and (last or abs(read(times, k, NUMBER) - t) < soon * abs(clock.h)):
                everyone.settle(system, t, here)
            while read(times, k, NUMBER) == t:
                each(seen, one_sample, everyone, system, t, here, shown, seen, totals, k)
                if procedure.events:  # the totals are known
                    write(totals, ENDS + k, read(totals, here, shown.totals), shown.totals)
                k = k + 1
        if last:
            break
        advance(everyone, system, procedure.control, procedure.place, ROW, 1, 1, goals, states, clocks, out, failures)
        n, moved = n + 1, read(clocks, 0, CLOCK).t != t
        step_begin = t if moved else step_begin
    write(march, 1, March(float(k), step_begin), MARCH)


def one_sample(
    sites: OverSites, system: Any, t: float, here: int, shown: Shown, seen: Any, totals: Any, k: int
) -> None:
    """Write what sample number k has of one site: its state, and its part of totals."""
    carry = sites.seen(here)
    state = sample(sites.method, carry)
    looked_at(system, t, state, shown, totals, k)
    if shown.kept:
        save(seen, k, carry if shown.whole else state, shown.layout)


def looked_at(system: Any, t: float, state: Any, shown: Shown, totals: Any, k: int) -> None:
    """Row number k of the totals of what is shown of one site."""
    if shown.quantities:
        at_site = at_this_site(system)
        values = tuple([total(quantity(t, at_site, state)) for quantity in shown.quantities])
        write(totals, k, values, shown.totals)


@record
class Moment(Record):
    """A time in a step, the part of the step up to it, and the copy of the memory, of two, that has the end of the step."""

    t: float
    part: float
    copy: float


def look_inside(
    procedure: Procedure, system: Any, moment: Moment, sites: Any, seen: Any, totals: Any, done: Any, failures: Any
) -> None:
    """The driver: a sample inside of the last step by an error estimate, on its way; `done` is then 1."""
    trial = attempt(each, sites, one_inside, procedure, system, moment, sites, seen, totals)
    if accepted(trial, itself):
        write(done, 0, 1.0, NUMBER)
    elif failures is not None:
        failures.append(reason(trial))


def one_inside(procedure: Procedure, system: Any, moment: Moment, sites: Any, seen: Any, totals: Any) -> None:
    """The state of one site inside of a step."""
    method, shown = procedure.method, procedure.shown
    here = int(moment.copy)
    before, after = load(sites, 1 - here, procedure.memory), load(sites, here, procedure.memory)
    state = method.inside(system, before, after, moment.part)
    require_finite(state)
    looked_at(system, moment.t, state, shown, totals, 0)
    save(seen, 0, state, shown.layout)


def totals_of_samples(system: Any, shown: Any, first: int, samples: int, seen: Any, totals: Any, times: Any) -> None:
    """The driver: totals of quantities of samples that are there."""
    for k in range(first, first + samples):
        each(seen, one_total, system, read(times, k, NUMBER), shown, seen, totals, k)


def one_total(system: Any, t: float, shown: Any, seen: Any, totals: Any, k: int) -> None:
    """Write what one site adds to the totals of sample number k."""
    looked_at(system, t, load(seen, k, shown.layout), shown, totals, k)


# ------------------------------------------------------------------ the start


@record
class Beginner(Record):
    """How every site begins: the method, the layouts of a start as it comes and as it is to be used, and that of what the
    method carries along.
    """

    method: Any
    given: Any
    started: Any
    memory: Any


def begin_sites(beginner: Beginner, system: Any, h: float, starts: Any, sites: Any, done: Any, failures: Any) -> None:
    """The driver before the first step: from starts what the method carries along for every site; `done` is then 1."""
    trial = attempt(each, sites, one_start, beginner, system, h, starts, sites)
    if accepted(trial, itself):
        write(done, 0, 1.0, NUMBER)
    elif failures is not None:
        failures.append(reason(trial))


def one_start(beginner: Beginner, system: Any, h: float, starts: Any, sites: Any) -> None:
    """Write what the method carries along for one site at the start."""
    carry = first_memory(beginner, system, h, starts)
    require_finite(sample(beginner.method, carry))
    save(sites, 0, fitted(carry, beginner.memory), beginner.memory)


def first_memory(beginner: Beginner, system: Any, h: float, starts: Any) -> Any:
    """The memory of a method for one site at the start."""
    start = fitted(load(starts, 0, beginner.given), beginner.started)
    return beginner.method.start(at_this_site(system), start, h)
