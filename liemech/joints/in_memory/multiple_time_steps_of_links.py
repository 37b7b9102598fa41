"""Multiple time steps of any number of bodies and joints: kicks by slow potentials seldom, steps of
RATTLE with all other forces often.

A kick by a slow force f is followed by the impulses that keep the momentum tangent to the constraint,

    mu+ = mu + (h/2) f(g) - G* lam,   G J^-1 mu+ = 0,

and is symplectic on the constraint, as RATTLE is.

Source: Leimkuhler and Reich, Simulating Hamiltonian Dynamics (2004), sections 7.4 and 10.2.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.sites.planes import columns, each
from ...errors import NoConvergence
from ...formulas import plain, record
from ...formulas.classes.layouts import Layout
from ...formulas.classes.records import with_fields
from ...rooms.sites.steps_together import copied
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .elimination import impulses_off
from .links import READY, LinkMemory, StepsOfLinks
from .on_all_bodies import pulled_together
from .rattle_of_links import RattleOfLinks, joints_here, on_the_constraint


@record
class MultipleTimeStepsOfLinks(StepsOfLinks):
    """MultipleTimeSteps of many bodies and joints.

    fast : LieRATTLE, without the slow forces.  ratio : so many of its steps are in one.
    """

    fast: RattleOfLinks
    ratio: float

    symmetric: ClassVar[bool] = True

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        return self.fast.start(system, state, h)

    def step_together(
        self, system: Any, t: float, h: float, sites: Any, source: int, target: int, memory: Layout
    ) -> None:
        """Half a kick, turn 1, the fast steps, turn 2, and half a kick, turn 3, of which the force is
        that of the next step; at the start of a run, in turn 0, it is still to be found.
        """
        places = columns(sites, copies=(memory, memory), work=system.work)
        copies, work = places.copies, places.work.fields
        each(sites, copied, copies.nth(source), copies.nth(target))
        memories, fast, s = copies.nth(target).fields, without_potentials(system), h / self.ratio
        turn = 1 if work.ready.at(0) == READY else 0
        while turn < 4:
            if turn == 0:
                each(sites, joints_here, system.at_time(t), memories.state, work, work.equations.fields)
            if turn == 0 or turn == 3:
                if system.pulls_all:
                    pulled_together(system, memories.state, work)
                each(sites, slow_force, system, memories.state, work)
            if turn == 1 or turn == 3:
                each(sites, slowly_kicked, 0.5 * h, memories.state, work)
                if not impulses_off(system, sites, work, work.equations.heads(system.most)):
                    raise NoConvergence("the conditions of joints depend on each other")
                each(sites, on_the_constraint, system, memories.state, memories.state, work)
            if turn == 2:
                for i in range(int(self.ratio)):
                    begin = t + (1.0 * i) * s
                    self.fast.substep(fast, begin, s, sites, places, 0, target, target)
            turn = turn + 1


def without_potentials(system: Any) -> Any:
    """The bodies and joints without potentials of bodies."""
    loads = system.on_all
    if loads is not None:
        loads = None if loads.load is None else with_fields(loads, potential=None)
    return with_fields(system, on_all=loads, pulled=False)


def slow_force(system: Any, state: Any, work: Any) -> None:
    """The force of potentials on a body, kept until the next step."""
    body, force = state.load(), 0.0 * work.field.load()
    if system.pulls_all:
        force = work.field.load()
    if len(system.fields) > 0:
        force = force + system.on_body(work, lambda it: it.pull(plain(body.g)))
    work.field.save(force)


def slowly_kicked(h: float, state: Any, work: Any) -> None:
    """The state after a kick by the slow force, and its velocity."""
    body = state.load()
    mu = body.mu + h * work.field.load()
    state.save(BodyState(mu, body.g))
    work.velocity.save(times(work.inverse.load(), plain(mu)))
