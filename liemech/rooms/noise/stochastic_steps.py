"""Steps under white noise: methods for equations without noise, whose velocity has a random part that is constant
along the step or comes field by field.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, undefined
from ...formulas import Record, Vec, constant, plain, record, sqrt, vec, where
from ...formulas.numbers.philox import normals, uniforms
from ...integrators.method import Method
from ...integrators.rkmk import RKMK
from ...systems.lie_poisson import BodyState
from .stochastic import NoisyState, Stochastic

INCREMENTS = "normal", "three-point", "two-point"
"""Distributions of the increment of a step over the root of its length: that of Gauss, +-sqrt(3) with
probability 1/6 each and else 0, +-1.  The last two are bounded and have the moments of the first up to the fifth and third.

Source: Kloeden and Platen, Numerical Solution of Stochastic Differential Equations (1992), 14.1 and 14.2.
"""


@record
class NoisyMemory(Record):
    """The memory of a noisy step."""

    memory: Any  # the memory of the method inside
    path: float  # the number of the path of the noise
    number: float  # the number of steps so far


@record
class NoisySteps(Method):
    """Steps of a method through the motion of a noisy system; abstract.

    1. A subclass writes `moved`, a step with given random numbers.
    2. It says its claims.
    """

    noisy: ClassVar[bool] = True
    strong_order: ClassVar[float] = 0.5
    weak_order: ClassVar[int]

    method: Method = RKMK(order=4)  # for the drift
    # "normal", or bounded ones, "three-point" and "two-point", for methods that solve an equation: its solution may not
    # exist for rare large increments
    increments: str = "normal"
    # the number of increments whose sum is that of a step: steps of h with fine=8 and steps of h/8 follow one path
    fine: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.increments not in INCREMENTS:
            raise InvalidInput(
                f"{type(self).__name__}: increments is one of {', '.join(map(repr, INCREMENTS))}; got {self.increments!r}"
            )
        if self.method.order < 2:  # type: ignore[attr-defined]
            raise InvalidInput(
                f"{type(self).__name__}: a method of order 1 takes the noise in another sense than Stratonovich's; take "
                f"one of order 2 or more, such as RKMK(order=4); got {self.method!r}"
            )
        if self.fine < 1:
            raise InvalidInput(f"{type(self).__name__}: fine is a number of increments, 1 at least; got {self.fine!r}")

    @property
    def order(self) -> Any:
        """The weak order, of errors of mean values."""
        return self.weak_order

    @property
    def symplectic(self) -> bool:  # type: ignore[override]
        """Whether every path is moved by Poisson maps."""
        return self.method.symplectic

    @property
    def adds(self) -> bool:  # type: ignore[override]
        """Whether a step of the method adds to the state."""
        return self.method.adds

    def require(self, system: Any) -> None:
        """A Stochastic system, along whose steps the method goes."""
        if not isinstance(system, Stochastic):
            raise IncompatibleSystem(
                f"{self!r} is for lm.Stochastic(system, fields); got {system!r}. Without noise, use {self.method!r}"
            )
        self.method.require(system.motion)

    def start(self, system: Stochastic, state: NoisyState, h: float) -> NoisyMemory:
        """The memory of the method, the path, and no step.  Raises InvalidInput backwards in time."""
        if h < 0.0:
            raise InvalidInput(f"{type(self).__name__}: noise goes forwards in time, h > 0")
        inner = self.method.start(system.motion, BodyState(state.mu, state.g), h)
        return NoisyMemory(inner, state.path, 0.0)

    def observe(self, memory: NoisyMemory) -> NoisyState:
        state: Any = self.method.observe(memory.memory)
        return NoisyState(state.mu, state.g, memory.path)

    def step(self, system: Stochastic, t: float, memory: NoisyMemory, h: float) -> NoisyMemory:
        """A step with the random numbers of its path and its number."""
        path, number = constant(plain(memory.path)), constant(plain(memory.number))
        z, coin = self.random(system, path, number)
        moved = self.moved(system, t, memory.memory, h, z, coin)
        return NoisyMemory(moved, memory.path, memory.number + 1.0)

    def random(self, system: Stochastic, path: float, number: float) -> tuple[Vec, float]:
        """Increments over the root of the step, one for each field, and another number, between 0 and 1: the
        mean of `fine` increments times the root of their number.
        """
        total, coin = self.increment(system, path, self.fine * number)
        for i in range(1, self.fine):
            total = total + self.increment(system, path, self.fine * number + i)[0]
        return total / sqrt(float(self.fine)), coin

    def increment(self, system: Stochastic, path: float, number: float) -> tuple[Vec, float]:
        """One increment for each field, of mean 0 and variance 1, and another number."""
        count, seed = len(system.fields), constant(system.seed)
        coin, _ = uniforms(seed, path, number, (count + 1) // 2)
        if self.increments == "normal":
            return vec(*normals(seed, path, number, count)), coin
        draws = [u for block in range((count + 1) // 2) for u in uniforms(seed, path, number, block)]
        if self.increments == "two-point":
            return vec(*[where(u < 0.5, -1.0, 1.0) for u in draws[:count]]), coin
        root, sixth = 3.0**0.5, 1.0 / 6.0
        three = [where(u < sixth, -root, where(u > 1.0 - sixth, root, 0.0)) for u in draws[:count]]
        return vec(*three), coin

    def moved(self, system: Stochastic, t: float, memory: Any, h: float, z: Vec, coin: float) -> Any:
        """The memory of the method after a step with these random numbers."""
        raise undefined(self, "moved")


@record
class WongZakai(NoisySteps):
    """One step of a method through the velocity xi + sum_i xi_i dW_i/h, constant noise along the step.

    Strong order 1/2, and 1 where the noise fields commute, one alone among them; weak order 1; for any method of order 2 and more.
    Casimirs are kept as the method keeps them.  Stratonovich's sense is that of the limit.

    method : for the drift: RKMK, commutator-free and Cayley steps, and for a drift without damping symplectic ones,
    ImplicitMidpoint, LiePoissonHamiltonJacobi, which move every path by a Poisson map.

    Raises IncompatibleSystem for a system that is not Stochastic.
    Source: Wong and Zakai, Ann. Math. Statist. 36 (1965); Malham and Wiese, SIAM J. Sci. Comput. 30 (2008); Milstein and
    Tretyakov, Stochastic Numerics for Mathematical Physics, 2nd ed. (2021), chapter 4.
    """

    title: ClassVar[str] = "Wong-Zakai, {0.method.name}"
    weak_order: ClassVar[int] = 1

    def moved(self, system: Stochastic, t: float, memory: Any, h: float, z: Vec, coin: float) -> Any:
        """One step of the method, with noise z/sqrt(h) constant along it."""
        return self.method.step(system.along(1.0, z / sqrt(h)), t, memory, h)


@record
class NinomiyaVictoir(NoisySteps):
    """Half a step of the drift, the noise fields one by one, in a random order of two, and half a step of the drift: weak order 2.

        exp(h V_0/2) exp(sqrt(h) z_1 V_1) ... exp(sqrt(h) z_m V_m) exp(h V_0/2),  or  m, ..., 1,  by the toss of a coin

    Strong order 1/2; Casimirs are kept as the method keeps them.

    method : for the flows of drift and fields, of order 4 or more, without memory: RKMK(order=4) by default.

    Raises IncompatibleSystem for a system that is not Stochastic, InvalidInput for another method and for two-point increments.
    Source: Ninomiya and Victoir, Weak approximation of stochastic differential equations and application to
    derivative pricing, Appl. Math. Finance 15 (2008).
    """

    title: ClassVar[str] = "Ninomiya-Victoir, {0.method.name}"
    weak_order: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        method: Any = self.method
        if type(method).start is not Method.start or method.order < 4:
            raise InvalidInput(
                f"NinomiyaVictoir: method must be of order 4 or more, without memory, such as RKMK(order=4); got {method!r}"
            )
        if self.increments == "two-point":
            raise InvalidInput("NinomiyaVictoir: increments is 'normal' or 'three-point', for order 2; got 'two-point'")

    def moved(self, system: Stochastic, t: float, memory: Any, h: float, z: Vec, coin: float) -> Any:
        """Half a drift, the flows of the fields in order or, by the coin, in reverse, half a drift."""
        m = len(system.fields)
        none = vec(*[0.0 for _ in range(m)])
        state = self.method.step(system.along(1.0, none), t, memory, 0.5 * h)
        for k in range(m):
            turn = [where(coin < 0.5, z[i] if i == k else 0.0, z[i] if i == m - 1 - k else 0.0) for i in range(m)]
            state = self.method.step(system.along(0.0, vec(*turn)), t, state, sqrt(h))
        return self.method.step(system.along(1.0, none), t + 0.5 * h, state, 0.5 * h)
