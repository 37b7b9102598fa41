"""Multiple time steps of any number of bodies and joints: kicks by slow potentials seldom, steps of
RATTLE with all other forces often.

A kick by a slow force f is followed by the impulses that keep the momentum tangent to the constraint,

    mu+ = mu + (h/2) f(g) - G* lam,   G J^-1 mu+ = 0,

and is symplectic on the constraint, as RATTLE is.

Source: Leimkuhler and Reich, Simulating Hamiltonian Dynamics (2004), sections 7.4 and 10.2.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.sites.planes import at, below, each, load, save
from ...formulas import Record, plain, record
from ...formulas.classes.layouts import Layout
from ...formulas.classes.records import with_fields
from ...formulas.numbers.conversions import fitted
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .rattle_of_links import (
    NUMBER,
    SIX,
    LinkMemory,
    RattleOfLinks,
    copied,
    found_off_the_constraint,
    joints_here,
    pull_on,
    pulled_together,
)


@record
class MultipleTimeStepsOfLinks(Record):
    """MultipleTimeSteps of many bodies and joints.

    fast : LieRATTLE, without the slow forces.  ratio : so many of its steps are in one.
    """

    fast: RattleOfLinks
    ratio: float
    name: str = ""

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = False
    symmetric: ClassVar[bool] = True
    room: ClassVar[int] = 0

    def __repr__(self) -> str:
        return self.name

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """A state, with pasts that are still to come."""
        return self.fast.start(system, state, h)

    def observe(self, memory: LinkMemory) -> Any:
        """The state."""
        return memory.state

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """Half a kick, turn 1, the fast steps, turn 2, and half a kick, turn 3, of which the force is
        that of the next step; at the start of a run, in turn 0, it is still to be found.
        """
        state, width = memory.parts[0], memory.width
        work, s = below(sites, 2 * width), h / self.ratio
        each(sites, copied, sites, here, there, memory)
        place, pasts = below(sites, there * width), below(sites, there * width + state.width)
        fast = without_potentials(system)
        turn = 1 if at(below(work, system.rows.note), 0, 2, NUMBER) == 1.0 else 0
        while turn < 4:
            if turn == 0:
                each(sites, joints_here, system.at_time(t), place, work, state)
            if turn == 0 or turn == 3:
                self.slow_force(system, sites, place, work, state)
            if turn == 1 or turn == 3:
                self.kick(system, 0.5 * h, sites, place, work, state)
            if turn == 2:
                for i in range(int(self.ratio)):
                    begun = t + (1.0 * i) * s
                    self.fast.substep(fast, begun, s, sites, there * width, there * width, pasts, 0, work, state)
            turn = turn + 1

    def slow_force(self, system: Any, sites: Any, place: Any, work: Any, state: Layout) -> None:
        """The force of the potentials, kept until the next step."""
        if system.on_all is not None and system.on_all.potential is not None:
            pulled_together(system, place, work, state)
        each(sites, slow_force_here, system, place, work, state)

    def kick(self, system: Any, h: float, sites: Any, place: Any, work: Any, state: Layout) -> None:
        """A kick by the slow force, and impulses that take away what leads off the constraint."""
        each(sites, slowly_kicked, system, h, place, work, state)
        found_off_the_constraint(system, sites, work)
        each(sites, without_excess, system, place, work, state)


def without_potentials(system: Any) -> Any:
    """The bodies and joints without potentials of bodies."""
    rest = system.on_all
    if rest is not None:
        rest = None if rest.load is None else with_fields(rest, potential=None)
    return with_fields(system, on_all=rest, pulled=False)


def slow_force_here(system: Any, place: Any, work: Any, state: Layout) -> None:
    """The force of potentials on a body."""
    field, one = below(work, system.rows.field), load(place, 0, state)
    force = 0.0 * load(field, 0, SIX)
    if system.on_all is not None and system.on_all.potential is not None:
        force = load(field, 0, SIX)
    if len(system.fields) > 0:
        force = force + system.on_body(work, lambda it: it.pull(plain(one.g)))
    save(field, 0, force, SIX)


def slowly_kicked(system: Any, h: float, place: Any, work: Any, state: Layout) -> None:
    """The state after a kick by the slow force, and its velocity."""
    rows, one = system.rows, load(place, 0, state)
    mu = one.mu + h * load(below(work, rows.field), 0, SIX)
    save(place, 0, fitted(BodyState(mu, one.g), state), state)
    save(below(work, rows.velocity), 0, times(system.inverse(work), plain(mu)), SIX)


def without_excess(system: Any, place: Any, work: Any, state: Layout) -> None:
    """The momentum without what leads off the constraint."""
    one = load(place, 0, state)
    save(place, 0, fitted(BodyState(one.mu - pull_on(system, work), one.g), state), state)
