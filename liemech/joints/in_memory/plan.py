"""Which runs of linkages go by loops over bodies and joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiler.sites.planes import Planes
from ...errors import InvalidInput
from ...formulas import mat, vec
from ...formulas.classes.layouts import carried_layout
from ...formulas.classes.records import with_fields
from ...formulas.tables import Table
from ...rooms.sites.runs.plan import SitesOfPlan
from ...simulation.compiled.execution import like
from ...systems.lie_poisson import BodyState
from .links import REST6, with_derivatives
from .multipliers_backwards import felt_by_numbers, with_way_back
from .rattle_backwards import RattleOnTheWayBack
from .rattle_of_links import RattleOfLinks
from .runs import LinksRun, linked_method

AT_REST = BodyState(REST6, mat(*[vec(*[0.0] * 4)] * 4))


class LinksOfPlan(SitesOfPlan):
    """The runs of one plan by loops over bodies and joints."""

    @classmethod
    def of(cls, plan: Any) -> LinksOfPlan | None:
        """The runs of a plan; None if they are written out for all bodies.  Raises InvalidInput for numbers of two
        doubles.
        """
        if linked_method(plan) is None:
            return None
        if not plan.adaptive and plan._steps.precision == "double-double":
            raise InvalidInput(
                f"integrate: precision='double-double' is not for the {int(plan._one.site_form.bodies)} bodies of this "
                "linkage: more than two step by loops over bodies and joints, in numbers of one double; leave "
                "precision out"
            )
        return cls(plan, plan._one.site_form)

    @property
    def method(self) -> Any:
        """The method of fixed steps, as that of all bodies and joints."""
        return linked_method(self.plan)

    def missing(self, t_eval: Any, checkpoint: Any, members: bool) -> str | None:
        """As of many sites, and adaptive steps of each member."""
        if members and self.plan.adaptive:
            return "adaptive step of each member"
        return super().missing(t_eval, checkpoint, members)

    def with_derivatives(self, level: float) -> LinksOfPlan:
        """The runs of the plan whose numbers carry a derivative of this level."""
        return self._of_system("derivatives", lambda: with_derivatives(self.site, level))

    def room_beside(self, count: int) -> Planes:
        form = self.plan._one.linked
        before = self.rows_of_copies
        rows = before + len(form.fixed) + form.working_rows + self.site.work.width - form.links.work.width
        planes = Planes.of_rows(rows, count)
        planes.array[before : before + len(form.fixed), :count] = form.fixed
        return planes

    def has_tangents(self, start: Any) -> bool:
        """Do numbers that carry derivatives go through the steps: fixed ones of one linkage by the reduced equation, or by
        LieRATTLE without loads, where no joint is in a given motion or has a rotor, and no formula acts on all bodies?
        """
        site = self.site
        if self.plan.adaptive or start.bodies is not None or site.rheonomic or site.geared or site.on_all is not None:
            return False
        method = self.method
        return not method.together or (isinstance(method, RattleOfLinks) and method.ending is None and not site.loaded)

    def has_way_back(self, start: Any) -> bool:
        return self.has_tangents(start)

    def parts_together(self) -> Any:
        method = self.method
        if not method.together:
            return None
        shares = np.reshape(method.shares.array, (-1, 2))
        step = with_fields(method, shares=Table(np.array([1.0, 0.0])), substeps=1.0, stages=1)
        motion = RattleOnTheWayBack(step, carried_layout(step.start(self.site, AT_REST, 1.0)))
        return (motion,), [(0, node, share) for share, node in shares.tolist()]

    def on_the_way_back(self, varied: bool) -> LinksOfPlan:
        return self._of_system(f"way back {varied}", lambda: with_way_back(self.site, varied))

    def _of_system(self, name: str, made: Any) -> LinksOfPlan:
        """The runs of the plan with the system in another form, which is made once."""
        if name not in self.known:
            plan = like(self.plan)
            self.known[name] = plan._sites = LinksOfPlan(plan, made())
        of_form: LinksOfPlan = self.known[name]
        return of_form

    def numbers_of(self, system: Any) -> np.ndarray:
        numbers: np.ndarray = system.linked.fixed
        return numbers

    def felt_by_numbers(self, planes: Planes) -> np.ndarray:
        work = Planes(planes.array[self.rows_of_copies :], planes.count)
        return felt_by_numbers(self.site, work, self.plan._one.linked.fixed)

    @property
    def rows_of_copies(self) -> int:
        """The rows of two copies of what a method carries along, on the way back."""
        parts = self.parts_together()
        return 2 * parts[0][0].memory.width if parts else 0

    def count_of(self, start: Any) -> int:
        return int(self.site.bodies)

    @property
    def kind(self) -> Any:
        return LinksRun
