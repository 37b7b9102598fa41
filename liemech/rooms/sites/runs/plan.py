"""Which runs go by sites: those of systems whose energies are sums over graphs, with fixed steps of a
method of one site.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, ClassVar

from ....compiler.sites.planes import Planes
from ....errors import IncompatibleSystem, IntegrationFailure, InvalidInput, NotCompilable, warn
from ....formulas.classes.layouts import layout_of
from ....integrators.ending_at_jumps import AT_ENDS, uncut
from ....integrators.method import steps_as
from ....simulation import arguments
from ....simulation.between.events import name_of
from ....simulation.result import of_members
from ....simulation.runs.carry import SiteCarry
from ....simulation.runs.starts import needed
from ....simulation.trajectory import Trajectory
from ....systems.many.site_state import StateOfSites
from ....systems.system import State
from ...hamilton_jacobi.lie_poisson_first_kind import FirstKindHamiltonJacobi
from ...hamilton_jacobi.lie_poisson_hj import LiePoissonHamiltonJacobi
from ..colouring import PlacesByColour
from ..spin_splittings import TermSplitting, terms_of
from .between import SitesBetween
from .chains import ChainRun, chained_method
from .events import TOTAL
from .lists import Lists, with_lists
from .states import as_users_see, by_site, first_of
from .totals import constants, energy, of_sites

LARGE = 300
"""Numbers of momenta beyond which a system is not written out."""

SIDE_BY_SIDE = 4
"""Members of an ensemble, which are stepped in lanes where they are written out, are so up to so many
times as many numbers as a single system.
"""

OF_SITES = "site", "total"
"""Names that the second argument of a function of a user's may have, which say of what it is: of one
site, or of totals over all sites.  Any other is the state of all sites.
"""


def second(function: Any) -> str:
    """The name of the argument of a function of time that comes behind it."""
    try:
        names = [*inspect.signature(function).parameters]
    except (TypeError, ValueError):
        return ""
    return names[1] if len(names) > 1 else ""


class SitesOfPlan:
    """The runs by sites of one plan."""

    of_samples: ClassVar[Any] = staticmethod(of_sites)
    energy: ClassVar[Any] = staticmethod(energy)
    constants: ClassVar[Any] = staticmethod(constants)
    between: ClassVar[Any] = SitesBetween

    def __init__(self, plan: Any, site: Any) -> None:
        self.plan, self.site = plan, site
        self.known: dict[Any, Any] = {}
        self.chain = chained_method(plan)
        self.fitting: set[int] = set()  # numbers of sites that its tables are known to fit

    @classmethod
    def of(cls, plan: Any) -> SitesOfPlan | None:
        """The runs of a plan whose system has a site form; None if they are of bodies written out."""
        site = plan._one.site_form
        return cls(plan, with_lists(plan._one, site))

    def shape_of(
        self, first: State, starts: Planes, inside: bool, all_steps: bool = False, level: float | None = None
    ) -> Any:
        """The shape of runs from starts whose first site is like this one.  inside : is what lies inside of steps asked
        for?  all_steps : are all of them looked at?  level : of the derivative that its numbers carry along.
        """
        from .shape import SiteShape

        key = layout_of(first), inside, all_steps
        if key not in self.known:
            self.known[key] = SiteShape(self.plan, self.site, first, starts, inside, all_steps, level)
        return self.known[key]

    def started(self, plan: Any, start: Any, t0: float = 0.0) -> Any:
        """The start with the parts that a run of this plan needs."""
        arranged = arguments.known(plan._one, start, t0, plan._bound)
        start = by_site(plan._one, arranged)
        if plan.recorder is None and plan.record is None:
            return start
        first = first_of(start)
        points = not {*start.parts} <= {*arranged.parts}  # which are bodies to the steps
        if self.site.jointed and (plan.recorder or points):  # functions of all bodies
            return start
        arrays = arguments.with_parts(self.site, first, needed(plan, self.site, first)).arrays
        return type(start)(*(x if n in arrays else None for n, x in start.parts.items()))

    def as_one(self, start: Any) -> Any:
        """The start as methods look at it, in a row if it is of a linkage or small enough to be written out."""
        small = isinstance(start, StateOfSites) and start.width <= LARGE * (start.bodies or 1)
        system = self.plan._one
        return system._written_out(as_users_see(system, start)) if small or self.site.jointed else start

    # ---------------------------------------------------------------- which runs

    @functools.cached_property
    def listed(self) -> bool:
        """Are there lists of the sites that are near each other, for every run anew?"""
        return Lists.of(self.plan._one, self.site) is not None

    @functools.cached_property
    def as_one_body(self) -> bool:
        """Does the method accept all sites as one body?"""
        try:
            self.plan.method.require(self.plan._one)
        except IncompatibleSystem:
            return False
        return True

    @property
    def quantities(self) -> dict[str, Any]:
        """Functions of the state that are recorded, by name."""
        recorder = self.plan.recorder
        return {} if recorder is None else recorder.quantities

    @functools.cached_property
    def functions(self) -> list[tuple[str, str, Callable[..., Any]]]:
        """Names of the user's functions, of what they are, and the functions themselves."""
        functions = [*self.quantities.items(), *((name_of(event), event) for event in self.plan.events)]
        return [(name, second(x), x) for name, x in functions if not isinstance(x, str)]

    @functools.cached_property
    def summed(self) -> dict[str, Any]:
        """Recorded sums over all sites, by name: the energy, and functions of one site."""
        return {name: x for name, x in self.quantities.items() if name not in self.of_all}

    @functools.cached_property
    def of_all(self) -> dict[str, str | Callable[..., Any]]:
        """Recorded functions of the state of all sites together, and methods of the system but its energy, by name; those
        of linkages are found at the end.
        """
        if self.site.jointed:
            return {}
        of_sites = {name for name, of, _ in self.functions if of in OF_SITES}
        return {name: x for name, x in self.quantities.items() if name not in of_sites and x != "energy"}

    @functools.cached_property
    def of_totals(self) -> bool:
        """Are steps looked at for events of totals alone?"""
        plan = self.plan
        whole = plan.adaptive and plan.options.dense
        of_totals = [second(event) == TOTAL for event in plan.events]
        return bool(of_totals) and all(of_totals) and not whole

    @functools.cached_property
    def of_sites(self) -> str | None:
        """A function of one site or of totals, for which a run of any size goes by sites."""
        if self.site.jointed:
            return None
        return next((name for name, of, _ in self.functions if of in OF_SITES), None)

    def _require_places(self) -> None:
        """Raise InvalidInput for a function of a site among events, and of totals where there are none."""
        for name, of, function in self.functions:
            event = any(function is x for x in self.plan.events)
            if of == "site" and event:
                raise InvalidInput(
                    f"integrate: the event {name}(t, site) is of one site, and events are of totals over all "
                    "that record= names, or of the state: events=[lambda t, total: total.spin[2]]"
                )
            if of == "total" and not (event and self.quantities):
                raise InvalidInput(
                    f"integrate: {name}(t, total) is an event of totals over all sites, which record= "
                    'names: record=[("spin", lambda t, site: site.mu)]'
                )

    def missing(self, t_eval: Any, checkpoint: Any, members: bool) -> str | None:
        """The first thing asked for that runs by sites do not have; None if they have all."""
        plan, steps = self.plan, self.plan._steps
        if not self.site.jointed:
            self._require_places()
        if plan.fictive:
            return "steps in fictive time"
        if plan.of_each:
            return f"{next(iter(plan.of_each))} of each member"
        if members and checkpoint is not None:
            return "checkpoint of members"
        if plan.jumps:
            return "jumps of the state"
        if plan.adaptive:
            return None
        method = uncut(steps.way_of(0))
        if method.noisy and (plan.events or t_eval is not None):
            return f"events and t_eval of {method!r}, {AT_ENDS}"
        if isinstance(method, FirstKindHamiltonJacobi) and self.site.hamiltonian.coupled:
            return f"{method!r} for sites one by one"
        return None

    def count_of(self, start: Any) -> int:
        """The number of sites of a start that move; of a linkage that of bodies, behind which there may be places."""
        return int(start.sites)

    def room_beside(self, count: int) -> Planes:
        """Memory for what steps of so many sites work with beside their states, of linkages the numbers that do not
        change among it.
        """
        return Planes.of_rows(1, count)

    def parts_together(self) -> Any:
        """Of steps of all bodies together what `parts_of` gives of those of one site; None of others."""
        return None

    def has_way_back(self, start: Any) -> bool:
        """Is there a way back through its steps?"""
        return True

    def on_the_way_back(self, varied: bool) -> SitesOfPlan:
        """The runs with room for what is felt on the way back.  varied : by numbers that do not change too?"""
        return self

    def knows(self, start: Any) -> bool:
        """Is it a state of many sites, or one that has them in a row?"""
        if isinstance(start, StateOfSites) or not isinstance(start, State):
            return isinstance(start, StateOfSites)
        arrays = start.arrays
        return self.plan._one.by_site(arrays) is not arrays

    def takes(self, start: Any) -> bool:
        """Does a run from here go by sites?"""
        if isinstance(start, SiteCarry):
            return True
        if not self.knows(start):
            return False
        if self.site.jointed or self.chain is not None:
            return True
        numbers = by_site(self.plan._one, start).width // (start.bodies or 1)
        most = self.plan._one.small * (1 if start.bodies is None else SIDE_BY_SIDE)
        if isinstance(self.plan.method, LiePoissonHamiltonJacobi):
            most //= 2  # written out it has the derivatives of all numbers by all others
        return numbers > most or self.of_sites is not None or not self.as_one_body

    def trajectory(
        self, start: Any, steps: int | None, t_end: Any, t0: float, checkpoint: Any, t_eval: Any = None
    ) -> Trajectory | None:
        """The run; None if the system is to be written out instead.  Raises IncompatibleSystem for
        one that is too large for that.
        """
        if not self.takes(start):
            return None
        fresh, jointed = not isinstance(start, SiteCarry), self.site.jointed
        state = by_site(self.plan._one, start if fresh else start.state)
        written_out = fresh and self.as_one_body and (jointed or state.width <= LARGE * (state.bodies or 1))
        whole = not jointed and any(of not in OF_SITES for _, of, _ in self.functions)
        if written_out and whole and self.of_sites is None:
            return None
        why: Any = self.missing(t_eval, checkpoint, state.bodies is not None)
        if why is None and state.bodies is not None:
            return self._members(state, steps, t_end, t0, t_eval)
        if why is None:
            try:
                run = self.kind(self.plan, self.site, start, t0, steps, t_end, t_eval, checkpoint)
                return run.trajectory()
            except NotCompilable as error:
                if jointed and self.plan._steps.compiled:
                    raise
                why = f"{self.plan.method!r} for sites one by one ({error})"
        if self.of_sites is not None:
            raise IncompatibleSystem(
                f"integrate: {self.of_sites} is of one site or of totals, and a run by sites has no {why}"
            )
        if written_out:
            return None
        raise self.too_many(why, state)

    def too_many(self, why: str, start: Any) -> IncompatibleSystem:
        """The error of what runs by sites do not have."""
        return IncompatibleSystem(
            f"integrate: a run site by site has no {why}; a system of up to {LARGE} numbers is written out as one body, "
            f"which takes everything, and this one has {start.sites} sites"
        )

    def by_hand(self, carry: SiteCarry) -> Any:
        """A run that goes on as it is told, without samples."""
        return self.kind(self.plan, self.site, carry, carry.t0, 0, None, None, None)

    @property
    def method(self) -> Any:
        """The method of fixed steps, as that of all sites or of one."""
        return self.chain or self.plan._steps.way_of(0)

    @functools.cached_property
    def kind(self) -> Any:
        """The class of the runs."""
        from .run import SiteRun
        from .turns import TurnsRun

        if self.chain is not None:
            return ChainRun
        return SiteRun if self.places is None else TurnsRun

    @functools.cached_property
    def places(self) -> PlacesByColour | None:
        """The places in memory of sites that turn by colours; None for other methods."""
        splitting: Any = None if self.plan.adaptive else uncut(self.plan._steps.way_of(0))
        if not steps_as(splitting, TermSplitting):
            return None
        motions: Any = splitting._motions(terms_of(self.plan._one))
        return motions.places

    @staticmethod
    def member(start: Any, i: int) -> Any:
        """One member of an ensemble."""
        return type(start)(*(None if x is None else x[i] for x in start.parts.values()))

    def _members(self, start: Any, steps: Any, t_end: Any, t0: float, t_eval: Any) -> Trajectory | None:
        """The runs of the members of an ensemble, one after the other.  One that fails stays where it
        came to.
        """
        runs: list[Any] = []
        stopped: dict[int, Any] = {}
        for i in range(start.bodies):
            try:
                start_of_member = self.member(start, i)
                runs.append(self.trajectory(start_of_member, steps, t_end, t0, None, t_eval))
            except IntegrationFailure as error:
                stopped[i] = error
                run = getattr(error, "trajectory", None)
                if run is None:  # it has not begun
                    error.add_note(f"[integrate: member {i}]")
                    raise
                runs.append(run)
            if runs[-1] is None:
                return None
        if stopped:
            first = min(stopped)
            warn(
                f"integrate: {len(stopped)} of {len(runs)} members stopped early, the first is member "
                f"{first} after {runs[first].steps} steps. {stopped[first]}",
                RuntimeWarning,
            )
        return of_members(runs, stopped)
