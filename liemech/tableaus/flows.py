"""Flow tableaus: coefficients of methods that follow frozen velocities one after the other, with
their order conditions.

With K_j the velocities at the stages, a row (b_1, b_2, ...) stands for the flow
exp(h sum_j b_j K_j).  What flows do one after the other is a sum over words, products of such
velocities, whose letters are ordered trees.  A method is of order p if all words with up to p nodes
have the weights that the exact motion gives them.  On a commuting group these are Butcher's
conditions for the sums of the rows; on others there are more, because letters cannot change places.

Source: Owren, Order conditions for commutator-free Lie group methods, J. Phys. A 39 (2006);
Owren and Marthinsen, Runge-Kutta methods adapted to manifolds and based on rigid frames, BIT 39
(1999).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from functools import cached_property

from ..errors import InvalidType, LawViolation
from ..formulas import record
from .coefficients import CLOSE, Coefficients, numbers
from .trees import Row

Rows = tuple[Row, ...]
Word = tuple["Word", ...]  # of ordered trees; a tree is the word of its branches


@record
class FlowTableau(Coefficients):
    """The coefficients of an explicit method made of flows: for each stage, and at last for the
    step, rows of weights.

    flows : flows[i] leads to stage i and flows[-1] to the end of the step; of several rows the
    first is followed first.  flows[0] is (): stage 0 is the start.
    origins : the stage from which each of them sets out, so that flows are shared; by default stage
    0 for all.

    Building one checks it: shapes, and the order conditions of all words of ordered trees with up
    to `order` nodes.
    Raises InvalidType, or LawViolation with the condition that fails.

    Source: Celledoni, Marthinsen, Owren, Commutator-free Lie group methods, Future Gener. Comput.
    Syst. 19 (2003).
    """

    name: str
    order: int
    flows: tuple[Rows, ...]
    origins: tuple[int, ...] = ()
    source: str = ""

    def _tidy(self) -> None:
        try:
            flows = tuple(tuple(tuple(map(float, row)) for row in rows) for rows in self.flows)
            origins = tuple(map(int, self.origins)) or (0,) * len(flows)
        except (TypeError, ValueError):
            raise InvalidType(
                f"{self.name}: flows are sequences of rows of numbers, origins numbers; got {self.flows!r}"
            ) from None
        object.__setattr__(self, "flows", flows)
        object.__setattr__(self, "origins", origins)

    # ---------------------------------------------------------------- what follows

    @cached_property
    def c(self) -> Row:
        """The times of the stages in the step, and 1 for its end: what all weights on the way add up to."""
        return tuple(math.fsum(map(math.fsum, self.way(i))) for i in range(len(self.flows)))

    @cached_property
    def main(self) -> tuple[bool, ...]:
        """Whether the step passes through the stage on its way to the end."""
        return tuple(i in self._stops(self.stages) for i in range(len(self.flows)))

    @property
    def stages(self) -> int:
        """The number of velocities that a step evaluates."""
        return len(self.flows) - 1

    @property
    def exponentials(self) -> int:
        """The number of flows in a step."""
        return sum(map(len, self.flows))

    def way(self, i: int) -> Rows:
        """All rows from the start of the step to stage i."""
        return tuple(row for stop in self._stops(i) for row in self.flows[stop])

    def _stops(self, i: int) -> tuple[int, ...]:
        return (*self._stops(self.origins[i]), i) if i else (0,)

    # ---------------------------------------------------------------- the laws

    def check(self) -> None:
        """Raise LawViolation, naming the law, unless the shapes fit and the order is the one claimed."""
        flows, origins = self.flows, self.origins
        if len(flows) < 2 or flows[0] or len(origins) != len(flows):
            raise LawViolation(
                f"{self.name}: flows are () for the start, then rows for each stage and for the end; as many origins"
            )
        for i, (rows, origin) in enumerate(zip(flows, origins)):
            if not 0 <= origin < max(i, 1):
                raise LawViolation(
                    f"{self.name}: flows[{i}] cannot set out from stage {origin}; it comes after stages 0 to {i - 1}"
                )
            if any(len(row) > i or not any(row) for row in rows):
                raise LawViolation(
                    f"{self.name}: a row of flows[{i}] has at most {i} weights, not all zero; got {rows}"
                )
        weight, size = self._weights(float), self._weights(abs)
        for word in (word for n in range(1, self.order + 1) for word in words(n)):
            actual, exact = weight(word), exact_weight(word)
            if not abs(actual - exact) <= CLOSE * (size(word) + exact):
                fails = f"the word {text(word)} has the weight {actual:.16g}, not {exact:.16g}"
                raise LawViolation(f"{self.name} is not of order {self.order}: {fails}")

    def _weights(self, of: Callable[[float], float]) -> Callable[[Word], float]:
        """The weight that the end of the step gives to a word, if the coefficients are passed
        through a function.

        Of a product of flows each takes consecutive letters of the word, m of them with 1/m!, and a
        letter is a tree, whose branches are a word at the stage where the velocity was taken.
        """
        ways = [self.way(i) for i in range(len(self.flows))]

        @functools.cache
        def weight(rows: Rows, word: Word) -> float:
            if not rows:
                return float(not word)
            before, last = rows[:-1], rows[-1]
            total, taken = weight(before, word), 1.0
            for m in range(1, len(word) + 1):
                taken *= sum(of(b) * weight(ways[j], word[-m]) for j, b in enumerate(last) if b) / m
                total += taken * weight(before, word[:-m])
            return total

        return lambda word: weight(ways[-1], word)

    def __repr__(self) -> str:
        return f"FlowTableau({self.name}: order {self.order}, {self.stages} stages, {self.exponentials} flows)"


@functools.cache
def words(nodes: int) -> tuple[Word, ...]:
    """All words of ordered trees with this many nodes: 1, 2, 5, 14, 42 of them."""
    if nodes == 0:
        return ((),)
    return tuple((*word, tree) for n in range(1, nodes + 1) for word in words(nodes - n) for tree in words(n - 1))


def nodes_of(word: Word) -> int:
    """The number of nodes in the trees of a word."""
    return sum(1 + nodes_of(tree) for tree in word)


@functools.cache
def exact_weight(word: Word) -> float:
    """The weight of a word in the exact motion, which appends the last letter last: w(u
    tree) = w(u) w(tree) / nodes.
    """
    return exact_weight(word[:-1]) * exact_weight(word[-1]) / nodes_of(word) if word else 1.0


def text(word: Word) -> str:
    """A word in signs: `.` is a node without branches, `[. .]` one with two."""
    return " ".join(f"[{text(tree)}]" if tree else "." for tree in word)


# -------------------------------------------------------------------- the methods


def _crouch_grossman(name: str, order: int, weights: str, source: str) -> FlowTableau:
    """Every weight is a flow of its own.  weights : a line for each stage from the second on, and for the step."""
    rows = [(), *map(numbers, weights.strip().splitlines())]
    flows = tuple(tuple((0.0,) * j + (b,) for j, b in enumerate(row) if b) for row in rows)
    return FlowTableau.shipped(name, order, flows, (), source)


def _low_storage(name: str, order: int, keep: str, follow: str, source: str) -> FlowTableau:
    """Williamson's form: D_i = keep_i D_i-1 + k_i is what is remembered, and one flow follow_i D_i
    leads on from the last stage.
    """
    flows: list[Rows] = [()]
    remembered: Row = ()
    for a, b in zip(numbers(keep), numbers(follow)):
        remembered = (*(a * x for x in remembered), 1.0)
        flows.append((tuple(b * x for x in remembered),))
    return FlowTableau.shipped(name, order, tuple(flows), (0, *range(len(flows) - 1)), source)


LIE_EULER = FlowTableau.shipped("Lie-Euler", 1, ((), ((1,),)), (), "Euler 1768")
LIE_MIDPOINT = FlowTableau.shipped(
    "Lie-midpoint", 2, ((), ((1 / 2,),), ((0, 1),)), (), "Runge 1895; Crouch and Grossman (1993)"
)

CF3 = FlowTableau.shipped(
    "CF3", 3,
    ((), ((1 / 3,),), ((0, 2 / 3),), ((-1 / 12, 0, 3 / 4),)),
    (0, 0, 0, 1),
    "Celledoni, Marthinsen, Owren, Future Gener. Comput. Syst. 19 (2003)",
)  # fmt: skip
CF4 = FlowTableau.shipped(
    "CF4", 4,
    ((), ((1 / 2,),), ((0, 1 / 2),), ((-1 / 2, 0, 1),), ((1 / 4, 1 / 6, 1 / 6, -1 / 12), (-1 / 12, 1 / 6, 1 / 6, 1 / 4))),
    (0, 0, 0, 1, 0),
    "Celledoni, Marthinsen, Owren, Future Gener. Comput. Syst. 19 (2003)",
)  # fmt: skip

CG3 = _crouch_grossman(
    "CG3",
    3,
    """
    3/4
    119/216 17/108
    13/51 -2/3 24/17
    """,
    "Crouch and Grossman, J. Nonlinear Sci. 3 (1993); Hairer, Lubich, Wanner, IV.8.1",
)
CG4 = _crouch_grossman(
    "CG4",
    4,
    """
    0.8177227988124852
    0.3199876375476427 0.0659864263556022
    0.9214417194464946 0.4997857776773573 -1.0969984448371582
    0.3552358559023322 0.2390958372307326 1.3918565724203246 -1.1092979392113465
    0.1370831520630755 -0.0183698531564020 0.7397813985370780 -0.1907142565505889 0.3322195591068374
    """,
    "Jackiewicz, Marthinsen, Owren, Adv. Comput. Math. 13 (2000)",
)

LUSCHER3 = _low_storage(
    "Luscher 3",
    3,
    "0 -17/32 -32/27",
    "1/4 8/9 3/4",
    "Williamson, J. Comput. Phys. 35 (1980); Luscher, JHEP 08 (2010) 071, appendix C",
)
CARPENTER_KENNEDY4 = _low_storage(
    "Carpenter-Kennedy 4",
    4,
    """
    0
    -567301805773/1357537059087
    -2404267990393/2016746695238
    -3550918686646/2091501179385
    -1275806237668/842570457699
    """,
    """
    1432997174477/9575080441755
    5161836677717/13612068292357
    1720146321549/2090206949498
    3134564353537/4481467310338
    2277821191437/14882151754819
    """,
    "Carpenter and Kennedy, NASA TM-109112 (1994); on groups Bazavov, BIT 62 (2022)",
)
