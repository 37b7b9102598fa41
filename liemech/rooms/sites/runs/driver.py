"""The drivers of one system of many sites: what it carries along is a place in memory, and a step of
it is a loop over sites around the step of one.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ....compiler.driver import accepted, attempt, itself, numbers, read, reason, write
from ....compiler.sites.planes import each, load, save
from ....errors import NotFinite
from ....formulas import Record, Vec, record, vec, where
from ....formulas.classes.layouts import NUMBER, Layout, carried_layout, layout_of
from ....formulas.numbers.conversions import fitted
from ....formulas.sites import total
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
class OverSites(Record):
    """The method of one site as that of all; `sites` are their numbers, `memory` is the layout of
    what the method carries along for one, `told` are two numbers that are the same for all.
    """

    method: Any
    sites: Any
    memory: Any
    told: Any

    @property
    def shortens(self) -> bool:
        """Does that of one site?"""
        shortens: bool = self.method.shortens
        return shortens

    def _held(self, name: str, value: Any) -> Any:
        """As it is: what is told is written."""
        return value

    @property
    def error_order(self) -> int:
        """That of one site."""
        order: int = self.method.error_order
        return order

    def step(self, system: Any, t: float, place: Place, h: float) -> Place:
        """A step of all sites, from one copy of the memory to the other."""
        there = 1 - place.copy
        self.go(system, t, place.copy, there, h)
        return Place(there)

    def go(self, system: Any, t: float, here: int, there: int, h: float) -> None:
        """A step of all sites from one copy of the memory to another."""
        given = self.sites, here, there, self.memory
        if self.method.together:
            self.method.step_together(system, t, h, *given)
        else:
            each(self.sites, one_step, self.method, system, t, h, *given)

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
        given = t, h, rtol, atol, dense, self.sites, place.copy, there, self.memory, self.told
        each(self.sites, one_trial, self.method, system, *given)
        error, share = read(self.told, 0, PAIR)
        return TrialStep(Place(there), first, error, (), share)

    def first_velocity(self, system: Any, t: float, place: Place, rtol: float, atol: float) -> tuple[Vec, float, float]:
        """The velocities at the start, put beside the states, and their sizes."""
        given = t, rtol, atol, self.sites, place.copy, self.memory, self.told
        each(self.sites, one_velocity, self.method, system, *given)
        return vec(0.0), *read(self.told, 0, PAIR)

    def change_of_velocity(
        self, system: Any, t: float, place: Place, first: Vec, h: float, rtol: float, atol: float
    ) -> float:
        """The size of the change of the velocities in an Euler step."""
        given = t, h, rtol, atol, self.sites, place.copy, self.memory, self.told
        each(self.sites, one_change, self.method, system, *given)
        size: float = read(self.told, 0, PAIR)[0]
        return size


SOON = 1.25
"""Steps to the next sample from which on what is shown of a state is found: a sample inside of a step
begins with what is shown before it.
"""

SPARE, INSIDE, COPIES = 2, 4, 5
"""The first of two copies of the memory for what lies between the parts of a step that is cut; the one
for a place inside of a step; and how many there are then.
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
        there = 1 - place.copy
        self.cut(system, t, place.copy, there, h)
        return Place(there)

    def cut(self, system: Any, t: float, here: int, there: int, h: float) -> None:
        """The parts of a step, from one copy of the memory to another."""
        at, end, lasting, to_copy, going = t, t + h, h, SPARE, True
        while going:
            to = self.ending.next_end(system, at, end)
            begin, s = self.ending.kept_away(at, to, where(at == t and to == end, h, to - at))
            if self.ending.anew:
                self._begin_anew(system, here, lasting, s)
                lasting = s
            by_way = where(to == end, there, to_copy)
            self.go(during(system, begin, s, self.ending.beyond), begin, here, by_way, s)
            here, to_copy = by_way, 2 * SPARE + 1 - to_copy
            at, going = to, where(h > 0.0, to < end, to > end)
        if self.ending.anew:
            self._begin_anew(system, there, lasting, h)

    def _begin_anew(self, system: Any, here: int, lasting: float, h: float) -> None:
        """The memory of the method, of steps of length `lasting`, for those of length h."""
        if lasting != h:
            each(self.sites, one_anew, self.method, system, h, self.sites, here, self.memory)


def over_sites(method: Any, sites: Any, memory: Any, told: Any, ending: Any) -> OverSites:
    """The method of one site as that of all.  ending : where its steps are cut; None: nowhere."""
    if ending is None:
        return OverSites(method, sites, memory, told)
    return OverSitesToJumps(method, sites, memory, told, ending)


def one_anew(method: Any, system: Any, h: float, sites: Any, here: int, memory: Any) -> None:
    """One site begins anew, for steps of another length."""
    shown = sample(method, load(sites, here, memory))
    save(sites, here, fitted(method.start(at_this_site(system), shown, h), memory), memory)


def one_step(method: Any, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Any) -> None:
    """A step of one site."""
    new, shown = stepped(method, at_this_site(system), t, load(sites, here, memory), h, memory)
    require_finite(shown)
    save(sites, there, new, memory)


def one_rate(method: Any, system: Any, t: float, sites: Any, here: int, memory: Any) -> None:
    """The velocity of one site, which is to be finite."""
    one, state = at_this_site(system), sample(method, load(sites, here, memory))
    require_finite(one.rate(t, one.essential_part(state)))


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
class Embedded(Record):
    """A method with an error estimate as it carries along what adaptive steps need of one site.

    curves : is the way of a step kept?
    """

    method: Any
    curves: bool
    ending: ClassVar[None] = None
    settles: ClassVar[bool] = False
    together: ClassVar[bool] = False

    @property
    def shortens(self) -> bool:
        """Are its steps as long as they turn out?"""
        shortens: bool = self.method.shortens
        return shortens

    def __repr__(self) -> str:
        return repr(self.method)

    @property
    def error_order(self) -> int:
        """That of the method."""
        order: int = self.method.error_order
        return order

    def start(self, system: Any, state: Any, h: float) -> Standing:
        """A state, of which the velocity is still to be found."""
        rest = vec(*[0.0 for _ in range(system.group.dim)])
        return Standing(state, rest, (rest,) * (self.method.curve_terms if self.curves else 0))

    def observe(self, memory: Standing) -> Any:
        """The state."""
        return memory.state

    def inside(self, system: Any, begun: float, at: float, end: float, before: Standing, after: Standing) -> Any:
        """The state inside of a step, on its way."""
        part = (at - begun) / (end - begun)
        return on_the_way(self.method.retraction, system, before.state, after.curve, part)


@record
class Whole(Record):
    """A method of fixed steps, which knows no way inside of one but to make a shorter step.

    ending : where steps are cut; None: nowhere.
    """

    method: Any
    ending: Any = None

    def __repr__(self) -> str:
        return repr(self.method)

    def inside(self, system: Any, begun: float, at: float, end: float, before: Any, after: Any) -> Any:
        """The state inside of a step."""
        method, h = self.method, at - begun
        memory = method.start(system, sample(method, before), h)
        return sample(method, method.step(system, begun, memory, h))


def one_trial(
    method: Embedded, system: Any, t: float, h: float, rtol: float, atol: float, dense: bool,
    sites: Any, here: int, there: int, memory: Layout, told: Any,
) -> None:  # fmt: skip
    """A step on probation of one site."""
    old = load(sites, here, memory)
    one = at_this_site(system)
    made = method.method.trial(one, t, old.state, old.velocity, h, rtol, atol, dense)
    new = Standing(made.state, made.velocity, made.curve)
    require_finite(new)
    write(told, 0, (made.error, made.share), PAIR)
    save(sites, there, new, memory)


def one_velocity(
    method: Embedded, system: Any, t: float, rtol: float, atol: float, sites: Any, here: int,
    memory: Layout, told: Any,
) -> None:  # fmt: skip
    """The velocity of one site at the start."""
    old = load(sites, here, memory)
    xi, speed, size = method.method.first_velocity(at_this_site(system), t, old.state, rtol, atol)
    require_finite(xi)
    write(told, 0, (speed, size), PAIR)
    save(sites, here, Standing(old.state, xi, old.curve), memory)


def one_change(
    method: Embedded, system: Any, t: float, h: float, rtol: float, atol: float, sites: Any,
    here: int, memory: Layout, told: Any,
) -> None:  # fmt: skip
    """The change of the velocity of one site in an Euler step."""
    old, one = load(sites, here, memory), at_this_site(system)
    given = t, old.state, old.velocity, h, rtol, atol
    write(told, 0, (method.method.change_of_velocity(one, *given), 0.0), PAIR)


def one_remake(method: Embedded, system: Any, t: float, h: float, sites: Any, here: int, memory: Layout) -> None:
    """The step of one site as on probation, without its error, which is that of all."""
    old, one = load(sites, here, memory), at_this_site(system)
    if h == 0.0:
        require_finite(one.rate(t, one.essential_part(old.state)))
    else:
        new = method.method.step(one, t, old.state, h)
        require_finite((new, one.rate(t + h, one.essential_part(new))))


# ------------------------------------------------------------------ steps and samples


@record
class Share(Record):
    """The value of a formula of the system for one site: its share, such as that of the energy.

    parts : of the state, the arguments of the formula.
    """

    name: str
    parts: tuple[str, ...]

    def __call__(self, t: float, system: Any, state: Any) -> Any:
        given = [t if part == "t" else getattr(state, part) for part in self.parts]
        return getattr(system, self.name)(*given)


@record
class OfSite(Record):
    """A user's function of time and the state of one site."""

    function: Any

    def __call__(self, t: float, system: Any, state: Any) -> Any:
        return self.function(t, state)


@record
class Shown(Record):
    """The content of samples: the state of every site, if it is `kept`, in this layout; and totals over all
    sites of quantities, in rows of another.
    """

    kept: bool
    state: Any
    quantities: tuple[Any, ...]
    totals: Any


@record
class March(Record):
    """How far a march has come: samples that were written, when its last step began (a nan before the
    first one), and why it stands still: 0, `CROSSED` or `UNWATCHED`.
    """

    samples: float
    begun: float
    why: float


OVERFLOW = "the step overflowed or left the domain of a formula; a smaller h may help"

MARCH = layout_of(March(0.0, 0.0, 0.0))

CROSSED, UNWATCHED = 1.0, 2.0
"""In the last step an event changed its sign, or was zero where it began; or its formula failed."""


@record
class Sighted(Record):
    """The content of samples, and what is looked at after every step: `events` of the totals of their
    quantities, of which `values` is the layout, and `named` an example with a name for each.
    """

    shown: Shown
    events: tuple[Any, ...]
    values: Any
    named: Any

    def seen(self, t: float, look: Any) -> tuple[float, ...]:
        """The values of the events."""
        totals = type(self.named)(*read(look, 0, self.shown.totals))
        return tuple([event(t, totals) for event in self.events])


def advance_sites(
    method: Any,
    system: Any,
    control: Any,
    memory: Any,
    place: Any,
    sighted: Any,
    ending: Any,
    turns: int,
    sites: Any,
    seen: Any,
    totals: Any,
    look: Any,
    values: Any,
    goals: Any,
    states: Any,
    clocks: Any,
    out: Any,
    times: Any,
    told: Any,
    march: Any,
    failures: Any,
) -> None:
    """The driver: so many turns of all sites, and a sample where a step ends at the next of the
    times, which have a nan behind them.  It stands still where a step goes beyond the next time, and
    where an event changes its sign.

    memory : the layout of what the method carries along for one site.  place : that of what the
    control carries along.  ending : where steps are cut, or None.  sites : copies of the memory of all
    sites.  seen, totals : samples of all sites, and of quantities, one behind the other.  look :
    quantities after a step; values : of the events, before and after it.  goals, states, clocks, out,
    failures : as for `advance`.  told : as `OverSites` has it.
    """
    everyone = over_sites(method, sites, memory, told, ending)
    goal, before = read(goals, 0, GOAL), read(march, 0, MARCH)
    n, k, begun, why = 0, 0, before.begun, before.why
    moved = begun != begun
    begun = read(clocks, 0, CLOCK).t if moved else begun
    while n <= turns:
        clock, here = read(clocks, 0, CLOCK), read(states, 0, PLACE).copy
        t = clock.t
        if sighted.events and moved:
            given = method, system, t, sites, here, memory, sighted.shown, look
            trial = attempt(watched, sighted, sites, *given)
            if not accepted(trial, finite):
                why = UNWATCHED
                if failures is not None:
                    failures.append(reason(trial))
            else:
                for a, b in zip(read(values, 0, sighted.values), trial):
                    if min(a, b) <= 0.0 and max(a, b) >= 0.0:
                        why = CROSSED
                write(values, 0 if why == 0.0 else 1, trial, sighted.values)
        moved = False
        due = (read(times, k, NUMBER) - t) * (t - begun) < 0.0
        last = n == turns or due or why != 0.0 or not going(clock, goal)
        if last or abs(read(times, k, NUMBER) - t) < SOON * abs(clock.h):
            everyone.settle(system, t, here)
        while why == 0.0 and read(times, k, NUMBER) == t:
            each(sites, one_sample, method, system, t, sites, here, memory, sighted.shown, seen, totals, k)  # fmt: skip
            k = k + 1
        if last:
            break
        advance(everyone, system, control, place, ROW, 1, 1, goals, states, clocks, out, failures)
        n, moved = n + 1, read(clocks, 0, CLOCK).t != t
        begun = t if moved else begun
    write(march, 0, March(float(k), begun, why), MARCH)


def finite(value: Any) -> tuple[()]:
    """Nothing of the values of events needs to be finite."""
    return ()


def watched(sighted: Any, sites: Any, method: Any, system: Any, t: float, *given: Any) -> tuple[float, ...]:
    """The values of the events after a step."""
    each(sites, one_look, method, system, t, *given)
    return sighted.seen(t, given[-1])


def one_look(
    method: Any, system: Any, t: float, sites: Any, here: int, memory: Any, shown: Any, look: Any
) -> None:  # fmt: skip
    """The state of one site at the end of a step."""
    looked_at(system, t, sample(method, load(sites, here, memory)), shown, look, 0)


def looked_at(system: Any, t: float, state: Any, shown: Any, totals: Any, k: int) -> None:
    """Row number k of the totals of what is shown of one site."""
    one = at_this_site(system)
    found = tuple([total(quantity(t, one, state)) for quantity in shown.quantities])
    write(totals, k, found, shown.totals)


def look_inside(
    way: Any,
    system: Any,
    memory: Any,
    sighted: Any,
    begun: float,
    at: float,
    end: float,
    sites: Any,
    seen: Any,
    totals: Any,
    values: Any,
    states: Any,
    done: Any,
    failures: Any,
) -> None:
    """The driver: a sample inside of the last step, and in `values` what events are there; `done` is
    then 1.

    way : gives the state inside.
    """
    here = read(states, 0, PLACE).copy
    given = begun, at, end, sites, here, memory, sighted.shown, seen, totals
    trial = attempt(watched_inside, at, way, system, sighted, values, sites, *given)
    if accepted(trial, itself):
        write(done, 0, 1.0, NUMBER)
    elif failures is not None:
        failures.append(reason(trial))


def watched_inside(at: float, way: Any, system: Any, sighted: Any, values: Any, sites: Any, *given: Any) -> None:
    """The state inside of a step of all sites, and the values of events."""
    if way.ending is None:
        each(sites, one_inside, way, system, *given)
    else:
        begun, _, _, _, here, memory, *more = given
        everyone = OverSitesToJumps(way.method, sites, memory, None, way.ending)
        everyone.cut(system, begun, 1 - here, INSIDE, at - begun)
        each(sites, one_there, way.method, system, at, sites, memory, *more)
    if sighted.events:
        write(values, 0, sighted.seen(at, given[-1]), sighted.values)


def one_inside(
    way: Any, system: Any, begun: float, at: float, end: float, sites: Any, here: int, memory: Any,
    shown: Any, seen: Any, totals: Any,
) -> None:  # fmt: skip
    """The state of one site inside of a step."""
    before, after = load(sites, 1 - here, memory), load(sites, here, memory)
    state = way.inside(at_this_site(system), begun, at, end, before, after)
    require_finite(state)
    one_shown(system, at, state, shown, seen, totals, 0)


def one_there(
    method: Any, system: Any, t: float, sites: Any, memory: Any, shown: Any, seen: Any, totals: Any
) -> None:  # fmt: skip
    """The sample of one site inside of a step that was cut."""
    state = sample(method, load(sites, INSIDE, memory))
    require_finite(state)
    one_shown(system, t, state, shown, seen, totals, 0)


def one_sample(
    method: Any, system: Any, t: float, sites: Any, here: int, memory: Any, shown: Any, seen: Any,
    totals: Any, k: int,
) -> None:  # fmt: skip
    """The sample of one site."""
    one_shown(system, t, sample(method, load(sites, here, memory)), shown, seen, totals, k)


def one_shown(system: Any, t: float, state: Any, shown: Any, seen: Any, totals: Any, k: int) -> None:
    """The kept part of the state of one site."""
    if shown.quantities:
        looked_at(system, t, state, shown, totals, k)
    if shown.kept:
        save(seen, k, state, shown.state)


def totals_of_samples(system: Any, shown: Any, first: int, samples: int, seen: Any, totals: Any, times: Any) -> None:
    """The driver: totals of quantities of samples that are there."""
    for k in range(first, first + samples):
        each(seen, one_total, system, read(times, k, NUMBER), shown, seen, totals, k)


def one_total(system: Any, t: float, shown: Any, seen: Any, totals: Any, k: int) -> None:
    """Those of one sample."""
    looked_at(system, t, load(seen, k, shown.state), shown, totals, k)


# ------------------------------------------------------------------ the start


def begin_sites(
    method: Any,
    system: Any,
    given: Any,
    started: Any,
    memory: Any,
    h: float,
    starts: Any,
    sites: Any,
    done: Any,
    failures: Any,
) -> None:
    """The driver before the first step: from starts, given in one layout and to be used in another,
    what the method carries along for every site; `done` is then 1.
    """
    trial = attempt(each, sites, one_start, method, system, given, started, memory, h, starts, sites)
    if accepted(trial, itself):
        write(done, 0, 1.0, NUMBER)
    elif failures is not None:
        failures.append(reason(trial))


def one_start(
    method: Any, system: Any, given: Any, started: Any, memory: Any, h: float, starts: Any, sites: Any
) -> None:
    """The start of one site."""
    carry = first_memory(method, system, given, started, h, starts)
    require_finite(sample(method, carry))
    save(sites, 0, fitted(carry, memory), memory)


def first_memory(method: Any, system: Any, given: Any, started: Any, h: float, starts: Any) -> Any:
    """The memory of a method for one site at the start."""
    return method.start(at_this_site(system), fitted(load(starts, 0, given), started), h)
