"""Which code runs a driver with loops over the sites of one system."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ....compiler import kernel
from ....compiler.sites.site_calls import SiteCalls
from ....formulas.sites import EIGHT
from ....simulation.compiled.execution import Execution, like

WORTH = 100
"""Steps of single sites that are worth native code: one takes plain Python some milliseconds."""

WAIT = 1.0
"""Seconds of plain Python after which native code is made for calls of few steps, as of a control loop."""

LONG = 50
"""Steps that an adaptive run is expected to take."""

MOST = 2**30
"""Steps of a call, at most."""


class SiteExecution(Execution):
    """How runs execute one driver: in native code as soon as there is much to do, because plain
    Python would take long to come to the end of a single step, or much was done in plain Python.

    most : sites that run side by side, at most.  idle : what nobody uses at present, by the number of sites and
    of workers.
    """

    def __init__(self, wanted: bool | None, progress: bool | None, *call: Any, most: int = EIGHT) -> None:
        native = wanted is not False and kernel.available() is None
        lanes = min(most, kernel.width()) if native else 1
        super().__init__(wanted, progress, *call, lanes=lanes)
        self.idle: dict[tuple[int, int], list[SiteCalls]] = {}

    def _code_for(self, work: int) -> kernel.Kernel | None:
        """The native code for so many steps of single sites; None for plain Python.  Raises NotCompilable."""
        native = self.native
        if native is None and self.asked is not False and kernel.available() is None:
            native = kernel.stored(*self.call, lanes=self.lanes)
            if native is None and work >= WORTH:
                demanded = like(self, wanted=True)
                demanded.compile()  # or the reason why not
                native = demanded.native
            self.native = native
            if self.history.seconds >= WAIT:  # a loop goes on in plain Python, with a warning, if it has to
                self.compile()
                native = self.native
        return native

    @contextmanager
    def on_sites(self, work: int, count: int, workers: int = 1) -> Iterator[SiteCalls | None]:
        """The native code for so many sites, lent to one user at a time, as its scratch memory is; None for
        plain Python.  Raises NotCompilable.

        work : steps of single sites.
        """
        native = self._code_for(work)
        if native is None:
            yield None
            return
        idle = self.idle.setdefault((count, workers), [])
        try:
            calls = idle.pop()  # one thread gets it, as `pop` is not interrupted
        except IndexError:
            calls = SiteCalls(native, count, workers)
        if calls.kernel is not native:
            calls = SiteCalls(native, count, workers)
        try:
            yield calls
        finally:
            idle.append(calls)

    def drive(
        self,
        sites: tuple[int, int, int],
        arguments: Any,
        shared: Any,
        arrays: Any = (),
        failures: Any = None,
        told: Callable[[SiteCalls], Any] = lambda calls: calls.notes,
    ) -> Any:
        """Run the driver: by native code, and `told` of its calls is returned, or by plain Python, and nothing.  Raises
        NotCompilable.

        sites : steps of single sites, the number of sites, and that of workers.  shared, arrays : those that all sites have
        in common.  failures : a list for what plain Python raised; None of drivers that do not ask for it.
        """
        asks = failures is not None
        with self.on_sites(*sites) as calls:
            if calls is not None:
                calls(*arguments, *map(kernel.Shared, shared), *arrays, *[None][:asks])
                return told(calls)
            with self.plain():
                self.call[0](*arguments, *[x.reshape(-1) for x in (*shared, *arrays)], *[failures][:asks])
            return None
