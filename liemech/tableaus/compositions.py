"""Compositions: substeps of a symmetric method, forwards and backwards, that cancel its errors
order by order.

A symmetric method of even order p is the flow of h Y_1 + h^(p+1) Y_p+1 + h^(p+3) Y_p+3 + ..., with
vector fields Y_k that do not commute.  Substeps gamma_i h, one after the other, are a product of
exponentials of gamma_i Y_1 + gamma_i^(p+1) Y_p+1 + ...: a sum over words in the letters Y_k.  The
composition is of order q if all words of degree up to q have the weight that they have in exp(Y_1):
1/n! for n times Y_1, zero for all others.

Sources: [HLW] Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., V.3; McLachlan,
SIAM J. Sci. Comput. 16 (1995).
"""

from __future__ import annotations

import math
import operator
from functools import cached_property
from typing import Any

from ..errors import InvalidInput, InvalidType, LawViolation
from ..formulas import record
from .coefficients import CLOSE, Coefficients, head_and_rows
from .trees import Row

Word = tuple[int, ...]  # the degrees of its letters


@record
class CompositionTableau(Coefficients):
    """The coefficients of a symmetric composition, Phi_(gamma_s h) o ... o Phi_(gamma_1 h) with
    gamma_s+1-i = gamma_i.

    order : of the composition.  gamma : the s substeps, as shares of the step.  base_order : the
    even order of the base Phi.

    Building one checks it: that it is symmetric, and the order conditions of all words up to the
    order claimed, to rounding.
    Raises InvalidInput, InvalidType, or LawViolation with the condition that fails.

    Source: Hairer, Lubich, Wanner, V.3.2; Yoshida, Phys. Lett. A 150 (1990).
    """

    name: str
    order: int
    gamma: Row
    base_order: int = 2
    source: str = ""

    @classmethod
    def of(cls, gamma: Any, base_order: int = 2, name: str = "own composition") -> CompositionTableau:
        """The composition with these substeps, of the order that they have."""
        tableau = cls.shipped(name, 1, gamma, base_order)
        order = 1
        while order < MOST and not tableau._failing(order + 1):
            order += 1
        return cls(name, order, tableau.gamma, base_order)

    def _tidy(self) -> None:
        self._rows("gamma")

    # ---------------------------------------------------------------- what follows

    @property
    def stages(self) -> int:
        """The number of substeps of a step."""
        return len(self.gamma)

    @cached_property
    def nodes(self) -> Row:
        """The times at which the substeps begin, as shares of the step: the sums of the gammas before them."""
        return tuple(math.fsum(self.gamma[:i]) for i in range(self.stages))

    @property
    def reach(self) -> float:
        """The largest |gamma_i|: what the step of the base must allow."""
        return max(map(abs, self.gamma))

    def __repr__(self) -> str:
        over = "" if self.base_order == 2 else f" over a base of order {self.base_order}"
        return f"CompositionTableau({self.name}: order {self.order}{over}, {self.stages} substeps)"

    # ---------------------------------------------------------------- the laws

    def check(self) -> None:
        """Raise an error, naming the law, unless the coefficients are symmetric and of the order claimed."""
        name, gamma, base = self.name, self.gamma, self.base_order
        if type(base) is not int or base < 2 or base % 2:
            raise InvalidInput(f"{name}: symmetric methods have even orders; got base_order = {base!r}")
        if not gamma or not all(map(math.isfinite, gamma)):
            raise InvalidInput(f"{name}: gamma is one finite number for each substep; got {gamma}")
        for i, (x, y) in enumerate(zip(gamma, gamma[::-1])):
            if x != y:
                raise LawViolation(
                    f"{name} is not symmetric: gamma_{i + 1} = {x!r} and gamma_{self.stages - i} = {y!r}"
                )
        self._reaches(MOST)

    def _failing(self, degree: int) -> str:
        """The first condition of this degree that does not hold, in words; empty if all do."""
        weights, sizes = self._found
        for word in _words(degree, self._letters):
            exact = exact_weight(word)
            if not abs(weights[word] - exact) <= CLOSE * (sizes[word] + abs(exact)):
                return f"the word {' '.join(f'Y_{k}' for k in word)} has the weight {weights[word]:.17g} and needs {exact:.17g}"
        return ""

    @cached_property
    def _letters(self) -> Word:
        return (1, *range(self.base_order + 1, MOST + 1, 2))

    @cached_property
    def _found(self) -> tuple[dict[Word, float], dict[Word, float]]:
        """The weights, and how large they would be without cancellation."""
        return self._weights(self.gamma), self._weights(tuple(map(abs, self.gamma)))

    def _weights(self, gamma: Row) -> dict[Word, float]:
        """The weights of the words: of a product the sums over the places where a word can be cut in two."""
        words = [word for degree in range(MOST + 1) for word in _words(degree, self._letters)]
        total = {word: 0.0 if word else 1.0 for word in words}
        for x in gamma:
            of_step = {word: x ** sum(word) / math.factorial(len(word)) for word in words}
            total = {w: math.fsum(total[w[:k]] * of_step[w[k:]] for k in range(len(w) + 1)) for w in words}
        return total


MOST = 10
"""The highest order whose conditions are known here."""


def exact_weight(word: Word) -> float:
    """The weight of a word in exp(Y_1)."""
    return 0.0 if any(letter > 1 for letter in word) else 1.0 / math.factorial(len(word))


def _words(degree: int, letters: Word) -> list[Word]:
    """All words whose letters have degrees that add up to this one."""
    if degree == 0:
        return [()]
    return [(letter, *tail) for letter in letters if letter <= degree for tail in _words(degree - letter, letters)]


# ---------------------------------------------------------------- from any even order to the next


LAST = 30
"""Orders beyond it are lost in rounding."""


def _order(tableau: str, given: Any) -> int:
    """The order of a base as a whole number."""
    try:
        order = operator.index(given)
    except TypeError:
        order = True
    if isinstance(order, bool):
        raise InvalidType(f"{tableau}: base_order must be a whole number; got {given!r}")
    if not 1 <= order <= LAST:
        raise InvalidInput(f"{tableau}: base_order must be from 1 to {LAST}; got {given}")
    return order


def triple_jump(base_order: int = 2) -> CompositionTableau:
    """Three substeps, 1/(2 - 2^(1/(p+1))) on both sides and a long way back between them: two
    orders more than the base, p + 2.

    Source: Yoshida, Phys. Lett. A 150 (1990); Creutz and Gocksch, Phys. Rev. Lett. 63 (1989); HLW
    II.4, (4.4).
    """
    base_order = _order("triple_jump", base_order)
    side = 1.0 / (2.0 - 2.0 ** (1.0 / (base_order + 1)))
    gamma = side, 1.0 - 2.0 * side, side
    name, source = f"triple jump {base_order + 2}", "Yoshida 1990; HLW II.4"
    return CompositionTableau.shipped(name, base_order + 2, gamma, base_order, source)


def suzuki(base_order: int = 2) -> CompositionTableau:
    """Five substeps, four of 1/(4 - 4^(1/(p+1))) and a short way back in the middle: two orders
    more than the base, p + 2.

    Source: Suzuki, Phys. Lett. A 146 (1990); HLW II.4, (4.5).
    """
    base_order = _order("suzuki", base_order)
    side = 1.0 / (4.0 - 4.0 ** (1.0 / (base_order + 1)))
    gamma = side, side, 1.0 - 4.0 * side, side, side
    name, source = f"Suzuki {base_order + 2}", "Suzuki 1990; HLW II.4"
    return CompositionTableau.shipped(name, base_order + 2, gamma, base_order, source)


# ---------------------------------------------------------------- from order 2 at once


def _printed(text: str) -> CompositionTableau:
    """A composition of this library: its head, and its substeps up to the middle one."""
    name, (order,), source, [(_, half)] = head_and_rows(text)
    return CompositionTableau.shipped(name, order, (*half, *half[-2::-1]), source=source)


TRIPLE_JUMP4, SUZUKI4 = triple_jump(), suzuki()

YOSHIDA6 = _printed("""
    Yoshida 6, order 6: Yoshida 1990, solution A; HLW V.3.2, (3.9)
    gamma | 0.78451361047755726381949763 0.23557321335935813368479318 -1.17767998417887100694641568
            1.31518632068391121888424973
""")

KAHAN_LI6 = _printed("""
    Kahan-Li 6, order 6: Kahan and Li, Math. Comp. 66 (1997); HLW V.3.2, (3.11)
    gamma | 0.39216144400731413927925056 0.33259913678935943859974864 -0.70624617255763935980996482
            0.08221359629355080023149045 0.79854399093482996339895035
""")

SUZUKI_UMENO8 = _printed("""
    Suzuki-Umeno 8, order 8: Suzuki and Umeno 1993; McLachlan 1995; HLW V.3.2, (3.12)
    gamma | 0.74167036435061295344822780 -0.40910082580003159399730010 0.19075471029623837995387626
            -0.57386247111608226665638773 0.29906418130365592384446354 0.33462491824529818378495798
            0.31529309239676659663205666 -0.79688793935291635401978884
""")

KAHAN_LI8 = _printed("""
    Kahan-Li 8, order 8: Kahan and Li, Math. Comp. 66 (1997); HLW V.3.2, (3.13)
    gamma | 0.13020248308889008087881763 0.56116298177510838456196441 -0.38947496264484728640807860
            0.15884190655515560089621075 -0.39590389413323757733623154 0.18453964097831570709183254
            0.25837438768632204729397911 0.29501172360931029887096624 -0.60550853383003451169892108
""")

COMPOSITIONS = {t.name: t for t in (TRIPLE_JUMP4, SUZUKI4, YOSHIDA6, KAHAN_LI6, SUZUKI_UMENO8, KAHAN_LI8)}
"""All compositions of a symmetric method of order 2, by name."""
