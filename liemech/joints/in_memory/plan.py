"""Which runs of linkages go by loops over bodies and joints."""

from __future__ import annotations

from typing import Any

from ...errors import InvalidInput
from ...rooms.sites.runs.plan import SitesOfPlan
from .runs import LinksRun, linked_method


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

    @property
    def kind(self) -> Any:
        return LinksRun
