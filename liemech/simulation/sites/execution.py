"""Which code runs a driver with loops over the sites of one system."""

from __future__ import annotations

from typing import Any

from ...compiler import kernel
from ...compiler.site_calls import SiteCalls
from ...formulas.sites import EIGHT
from ..compiled.execution import Execution

WORTH = 100
"""Steps of single sites that are worth native code: one takes plain Python some milliseconds."""

LONG = 50
"""Steps that an adaptive run is expected to take."""


class SiteExecution(Execution):
    """How runs execute one driver: in native code as soon as there is much to do, because plain
    Python would take long to come to the end of a single step.

    most : sites that run side by side, at most.
    """

    def __init__(self, wanted: bool | None, progress: bool | None, *call: Any, most: int = EIGHT) -> None:
        native = wanted is not False and kernel.available() is None
        lanes = min(most, kernel.width()) if native else 1
        super().__init__(wanted, progress, *call, lanes=lanes)
        self.calls: dict[tuple[int, int], SiteCalls] = {}

    def ready_for(self, work: int) -> bool:
        """Is there native code, for so many steps of single sites?  Raises NotCompilable."""
        if self.native is None and self.asked is not False and kernel.available() is None:
            self.native = kernel.stored(*self.call, lanes=self.lanes)
            if self.native is None and work >= WORTH:
                self.wanted = True  # or the reason why not
                self.compile()
        return self.native is not None

    def on_sites(self, count: int, workers: int = 1) -> SiteCalls:
        """The native code for so many sites."""
        native: Any = self.native
        known = self.calls.get((count, workers))
        if known is None or known.kernel is not native:
            known = self.calls[count, workers] = SiteCalls(native, count, workers)
        return known
