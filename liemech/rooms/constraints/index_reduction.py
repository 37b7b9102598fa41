"""Index reduction: the equation without constraints that the multipliers give, by a method for any
equation; to compare with.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, InvalidType, require
from ...formulas import plain, record
from ...integrators.composition import Composition
from ...integrators.method import Method, Wrapping
from ...systems.canonical import CanonicalState
from .constrained import ConstrainedSystem
from .on_constraints import OnConstraints


@record
class IndexReduction(Wrapping):
    """A constrained system by a method that knows nothing of constraints, with the multipliers put
    into the equation:

        q' = H_p,   p' = -H_q - G^T lambda(q, p),   lambda = (G H_pp G^T)^-1 (d/dq(G H_p) H_p - G H_pp H_q)

    g(q) and G H_p are constants of this equation, which methods do not keep: steps leave M, and
    beside M the equation is not Hamiltonian, so the energy drifts too.
    method : for any equation, such as RKMK(order=4) or Taylor(order=10).
    project : put q onto g(q) = 0, and p into the tangent space, after each step.  Then both hold,
    but the energy drifts still.

    It has the order of the method; neither symmetric nor symplectic.  Raises InvalidInput for a
    method that keeps constraints.
    Source: Hairer, Lubich, Wanner, VII.1.1, VII.1.2 and IV.4 (standard projection); the slides,
    (1.6) and (1.9).
    """

    project: bool = False

    symmetric: ClassVar[bool] = False
    symplectic: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require("IndexReduction: method", self.method, Method, "a method such as RKMK(order=4)")
        if isinstance(self.method, IndexReduction):
            raise InvalidInput(f"IndexReduction: {self.method!r} reduces the index already")
        if isinstance(self.method.base if isinstance(self.method, Composition) else self.method, OnConstraints):
            raise InvalidInput(
                f"IndexReduction: {self.method!r} keeps the constraints; use it as it is, or give "
                "a method for any equation, such as RKMK(order=4)"
            )
        if type(self.project) is not bool:
            raise InvalidType(f"IndexReduction: project must be True or False; got {self.project!r}")

    @property
    def name(self) -> str:
        return f"{self.method.name}, reduced{' and projected' if self.project else ''}"

    def require(self, system: Any) -> None:
        """A constrained system, and a method that accepts it as an equation."""
        if not isinstance(system, ConstrainedSystem):
            raise IncompatibleSystem(
                f"{self!r} needs a ConstrainedSystem; got {system!r}, which {self.method!r} may take as it is"
            )
        self.method.require(system)

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """A step of the method and, if asked for, the way back onto the constraints."""
        memory = self.method.step(system, t, memory, h)
        if not self.project:
            return memory
        state: Any = self.method.observe(memory)
        drifted = plain(state)
        q = system.across(drifted.q, drifted.p, drifted.q)
        p = system.tangent(q, drifted.p)
        moved = CanonicalState(state.q + (q - drifted.q), state.p + (p - drifted.p))
        return self.method.resume(system, moved, self.method.past(memory), h)
