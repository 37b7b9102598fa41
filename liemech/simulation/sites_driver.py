"""The drivers of one system of many sites: what it carries along is a place in memory, and a step of
it is a loop over sites around the step of one.
"""

from __future__ import annotations

from typing import Any

from ..compiler.driver import accepted, attempt, itself, numbers, read, reason, write
from ..compiler.planes import each, load, save
from ..errors import NotFinite
from ..formulas import Record, record
from ..formulas.pytree import NUMBER, carried_layout, fitted, layout_of
from ..formulas.sites import total
from ..formulas.sums import total as added
from ..systems.terms_at_site import at_this_site
from .control import CLOCK, sample, stepped
from .driver import advance


@record
class Place(Record):
    """Where the memory of a method lies, of all sites: in the first of two copies, 0, or in the
    second, 1.
    """

    copy: int


@record
class Nothing(Record):
    """What a step shows of many sites: it went through or not."""


PLACE = carried_layout(Place(0))
ROW = layout_of((0.0, Nothing(), ()))


@record
class OverSites(Record):
    """The method of one site as that of all; `sites` are their numbers, `memory` is the layout of
    what the method carries along for one.
    """

    method: Any
    sites: Any
    memory: Any

    def step(self, system: Any, t: float, place: Place, h: float) -> Place:
        """A step of all sites, from one copy of the memory to the other."""
        there = 1 - place.copy
        each(
            self.sites,
            one_step,
            self.method,
            system,
            t,
            h,
            self.sites,
            place.copy,
            there,
            self.memory,
        )
        return Place(there)

    def observe(self, place: Place) -> Nothing:
        """Nothing: samples are taken when they are wanted."""
        return Nothing()


def one_step(
    method: Any, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Any
) -> None:
    """A step of one site."""
    new, shown = stepped(method, at_this_site(system), t, load(sites, here, memory), h, memory)
    require_finite(shown)
    save(sites, there, new, memory)


def require_finite(value: Any) -> None:
    """Raise NotFinite where the sum of the numbers of a value is not finite."""
    total = added([*numbers(value)])
    if not total - total == 0.0:
        raise NotFinite("the step overflowed or left the domain of a formula; a smaller h may help")


# ------------------------------------------------------------------ steps and samples


@record
class Share(Record):
    """What a formula of the system gives for one site: its share, such as that of the energy.

    parts : of the state, the arguments of the formula.
    """

    name: str
    parts: tuple[str, ...]

    def __call__(self, t: float, system: Any, state: Any) -> Any:
        return getattr(system, self.name)(*[getattr(state, part) for part in self.parts])


@record
class OfSite(Record):
    """A user's function of time and the state of one site."""

    function: Any

    def __call__(self, t: float, system: Any, state: Any) -> Any:
        return self.function(t, state)


@record
class Shown(Record):
    """What samples have: the state of every site, if it is `kept`, in this layout; and totals over all
    sites of quantities, in rows of another.
    """

    kept: bool
    state: Any
    quantities: tuple[Any, ...]
    totals: Any


def advance_sites(
    method: Any,
    system: Any,
    control: Any,
    memory: Any,
    shown: Any,
    turns: int,
    samples: int,
    sites: Any,
    seen: Any,
    totals: Any,
    goals: Any,
    states: Any,
    clocks: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: `samples` times so many `turns` of all sites and a sample.

    memory : the layout of what the method carries along for one site.  shown : `Shown`.
    sites : two copies of the memory of all sites.  seen, totals : samples of all sites, and of
    quantities, one behind the other.  goals, states, clocks, failures : as for `advance`; out : rows
    of time.
    """
    everyone = OverSites(method, sites, memory)
    for k in range(samples):
        advance(
            everyone, system, control, PLACE, ROW, 1, turns, goals, states, clocks, out, failures
        )
        t, here = read(clocks, 0, CLOCK).t, read(states, 0, PLACE).copy
        each(sites, one_sample, method, system, t, sites, here, memory, shown, seen, totals, k)


def one_sample(
    method: Any, system: Any, t: float, sites: Any, here: int, memory: Any, shown: Any, seen: Any,
    totals: Any, k: int,
) -> None:  # fmt: skip
    """The sample of one site."""
    state = sample(method, load(sites, here, memory))
    if shown.quantities:
        one = at_this_site(system)
        found = tuple([total(quantity(t, one, state)) for quantity in shown.quantities])
        write(totals, k, found, shown.totals)
    if shown.kept:
        save(seen, k, state, shown.state)


def totals_of_samples(
    system: Any, shown: Any, first: int, samples: int, seen: Any, totals: Any, times: Any
) -> None:
    """The driver: totals of quantities of samples that are there."""
    for k in range(first, first + samples):
        each(seen, one_total, system, read(times, k, NUMBER), shown, seen, totals, k)


def one_total(system: Any, t: float, shown: Any, seen: Any, totals: Any, k: int) -> None:
    """Those of one sample."""
    one, state = at_this_site(system), load(seen, k, shown.state)
    found = tuple([total(quantity(t, one, state)) for quantity in shown.quantities])
    write(totals, k, found, shown.totals)


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
    trial = attempt(
        each, sites, one_start, method, system, given, started, memory, h, starts, sites
    )
    if accepted(trial, itself):
        write(done, 0, 1.0, NUMBER)
    elif failures is not None:
        failures.append(reason(trial))


def one_start(
    method: Any,
    system: Any,
    given: Any,
    started: Any,
    memory: Any,
    h: float,
    starts: Any,
    sites: Any,
) -> None:
    """The start of one site."""
    carry = first_memory(method, system, given, started, h, starts)
    require_finite(sample(method, carry))
    save(sites, 0, fitted(carry, memory), memory)


def first_memory(method: Any, system: Any, given: Any, started: Any, h: float, starts: Any) -> Any:
    """What a method carries along for one site at the start."""
    return method.start(at_this_site(system), fitted(load(starts, 0, given), started), h)
