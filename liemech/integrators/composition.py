"""Composition: methods of high order made of the substeps of a simple one."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidInput, require
from ..formulas import record
from ..systems.system import State
from ..tableaus.compositions import KAHAN_LI6, KAHAN_LI8, SUZUKI4, CompositionTableau, suzuki
from .memory import Memory, Remembering
from .method import Method
from .orders import set_tableau


@record
class Composition(Remembering):
    """Substeps of a symmetric method, some of them backwards, whose errors cancel: order 4, 6 or 8
    from order 2.

        Phi_(gamma_s h) o ... o Phi_(gamma_1 h),   gamma_1 + ... + gamma_s = 1,   gamma_s+1-i = gamma_i

    base : a symmetric method, such as CovariantVariational(Cayley()).
    order : of the composition chosen: 4 (Suzuki, 5 substeps), 6 (Kahan-Li, 9) or 8 (Kahan-Li, 17);
    on a base of a higher order p only p + 2 (Suzuki); or give a `tableau`, such as TRIPLE_JUMP4 of
    `liemech.tableaus.compositions`.  What every step of the base keeps, the composition keeps:
    spatial momentum, Casimirs, the Poisson bracket.  The largest substep is `tableau.reach` times
    h, and the base must be able to solve it.

    Raises InvalidInput if the base is not symmetric.
    Source: Hairer, Lubich, Wanner, II.4 and V.3; McLachlan, SIAM J. Sci. Comput. 16 (1995).
    """

    title: ClassVar[str] = "{0.tableau.name} of {0.base.name}"

    base: Method
    order: int = 4
    tableau: CompositionTableau = None  # type: ignore[assignment]  # None: the one of this order

    choices: ClassVar[dict[int, CompositionTableau]] = {t.order: t for t in (SUZUKI4, KAHAN_LI6, KAHAN_LI8)}
    symmetric: ClassVar[bool] = True

    def __post_init__(self) -> None:
        base: Any = self.base
        require("Composition: base", base, Method, "a method such as CovariantVariational(Cayley())")
        if not base.symmetric:
            raise InvalidInput(
                f"Composition: {base!r} is not symmetric, and its substeps cannot cancel errors of "
                "odd powers of h; CovariantVariational(Cayley()) and "
                "CovariantVariational(Exponential()) are symmetric"
            )
        if base.order == float("inf"):
            raise InvalidInput(
                f"Composition: {base!r} is exact; there is no error for substeps to cancel. Use it as it is"
            )
        p = base.order
        choices = self.choices if p == 2 else {p + 2: suzuki(p)}
        advice = f" for a base of order {p}, or give a tableau"
        tableau = set_tableau(self, CompositionTableau, choices, advice)
        if tableau.base_order > p:
            raise InvalidInput(
                f"Composition: {tableau.name} is for a base of order {tableau.base_order}; {base!r} is of order {p}"
            )
        object.__setattr__(self, "order", max(tableau.order, p))

    @property
    def symplectic(self) -> bool:  # type: ignore[override]
        """A composition is symplectic if its base is."""
        return self.base.symplectic

    @property
    def of_momenta(self) -> bool:  # type: ignore[override]
        """Whether the base is symplectic for momenta alone."""
        return self.base.of_momenta

    @property
    def fictive(self) -> bool:  # type: ignore[override]
        """A composition steps in a fictive time if its base does."""
        return self.base.fictive

    def require(self, system: Any) -> None:
        self.base.require(system)

    def step_warning(self, system: Any, start: State, h: float) -> str | None:
        return self.base.step_warning(system, start, self.tableau.reach * h)

    def at_node(self, system: Any, state: State, h: float) -> tuple[Any, ...]:
        """The pasts of the substeps in the base: each begins with the state alone."""
        base = self.base
        starts = [base.start(system, state, share * h) for share in self.tableau.gamma]
        return tuple([base.past(start) for start in starts])

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """The substeps in turn; each has a past of its own, since steps of the same length extrapolate
        best from their like.
        """
        state, pasts = memory.state, []  # type: Any, list[Any]
        for share, node, past in zip(self.tableau.gamma, self.tableau.nodes, memory.node):
            after = self.base.step(system, t + node * h, self.base.resume(system, state, past, share * h), share * h)
            state, pasts = self.base.observe(after), [*pasts, self.base.past(after)]
        return Memory(state, tuple(pasts), ())

    def __repr__(self) -> str:
        base = self.tableau.base_order
        is_default = self.tableau == (self.choices.get(self.order) if base == 2 else suzuki(base))
        return f"Composition({self.base!r}, {f'order={self.order}' if is_default else f'tableau={self.tableau!r}'})"
