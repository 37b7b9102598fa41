"""Splittings: kicks by a field and drifts without it, alternating, whose errors cancel order by
order.

A body in a field has the energy T + V, and the flows of both parts are known: V kicks, T drifts.  A
step is a product of exponentials of b_i B and a_i A, A for the drift and B for the kick: a sum over
words in two letters.  It is of order q if all words of length up to q have the weight that they
have in exp(A + B), 1/n! for n letters.

Where T is quadratic in the momentum, as kinetic energies are, and V depends on the configuration
alone, {V, {V, {V, T}}} = 0: three kicks take all momenta away.  Then [B, [B, [B, A]]] = 0, words
that this makes equal count together, and fewer kicks do.

Sources: McLachlan, SIAM J. Sci. Comput. 16 (1995); Blanes and Moan, J. Comput. Appl. Math. 142
(2002), sections 2 and 4.
"""

from __future__ import annotations

import functools
import itertools
import math
from functools import cached_property

import numpy as np

from ..errors import InvalidInput, LawViolation
from ..formulas import record
from .coefficients import CLOSE, Coefficients, head_and_rows
from .compositions import CompositionTableau
from .trees import Row

_TRIPLE = {"BBBA": 1.0, "BBAB": -3.0, "BABB": 3.0, "ABBB": -1.0}
"""[B, [B, [B, A]]] as a sum of words."""

MOST = 10
"""The highest order whose conditions are looked at."""


@record
class SplittingTableau(Coefficients):
    """The coefficients of a splitting: kick b_0 h, drift a_1 h, kick b_1 h, ..., drift a_s h, kick
    b_s h.

    order : of the splitting.  kicks : b_0, ..., b_s, where b_0 = b_s = 0 stands for a step that
    begins and ends with a drift.
    drifts : a_1, ..., a_s.  quadratic : is the order that of kinetic energies, quadratic in the
    momentum, only?
    symmetric : are the coefficients the same backwards?

    Building one checks it: the symmetry, and the order conditions of all words up to the order
    claimed, to rounding.
    Raises InvalidInput, InvalidType, or LawViolation with the condition that fails.

    Source: Blanes and Moan, J. Comput. Appl. Math. 142 (2002).
    """

    name: str
    order: int
    kicks: Row
    drifts: Row
    quadratic: bool = False
    source: str = ""
    symmetric: bool = True

    def _tidy(self) -> None:
        self._rows("kicks", "drifts")

    # ---------------------------------------------------------------- what follows

    @classmethod
    def of(cls, composition: CompositionTableau) -> SplittingTableau:
        """A composition of Strang's splitting, whose neighbouring half kicks join; of its order for
        every T + V.

        Raises InvalidInput if the composition is for a base of another order.
        """
        if composition.base_order != 2:
            raise InvalidInput(
                f"SplittingTableau.of: Strang's splitting is of order 2; {composition.name} is for "
                f"order {composition.base_order}"
            )
        halves = 0.0, *composition.gamma, 0.0
        kicks = [0.5 * (a + b) for a, b in itertools.pairwise(halves)]
        name, source = f"{composition.name} of Strang", composition.source
        return cls.shipped(name, composition.order, kicks, composition.gamma, False, source)

    @property
    def exchanged(self) -> SplittingTableau:
        """This splitting with kicks and drifts exchanged: a step that began with a kick begins
        with a drift.

        Raises InvalidInput if the order is that of quadratic kinetic energies only.
        """
        if self.quadratic:
            raise InvalidInput(
                f"{self.name}: kicks and drifts cannot be exchanged, its order is that of quadratic T only"
            )
        first, last = self.kicks[0] == 0.0, self.kicks[-1] == 0.0
        kicks = *((0.0,) * (not first)), *self.drifts, *((0.0,) * (not last))
        drifts = self.kicks[first : len(self.kicks) - last]
        name = f"{self.name}, exchanged"
        return self.shipped(name, self.order, kicks, drifts, False, self.source, self.symmetric)

    @property
    def carries_force(self) -> bool:
        """Whether a step begins as the one before ended, with a kick, so that one force serves for both kicks."""
        return self.kicks[0] != 0.0 and self.kicks[-1] != 0.0

    @property
    def stages(self) -> int:
        """The number of forces that a step evaluates."""
        return sum(b != 0.0 for b in self.kicks) - self.carries_force

    @cached_property
    def nodes(self) -> Row:
        """The times of the kicks, as shares of the step: the sums of the drifts before them."""
        return tuple(math.fsum(self.drifts[:i]) for i in range(len(self.kicks)))

    @property
    def reach(self) -> float:
        """The largest |a_i|: what the step of the free motion must allow."""
        return max(map(abs, self.drifts))

    def sequence(self, parts: int) -> tuple[tuple[int, float], ...]:
        """A step for an energy of any number of parts: which part moves in turn, and for which
        share of the step.

        With Phi_h = exp(h A_1) ... exp(h A_n), last part first, and its adjoint, the splitting of
        two parts is the composition
        ... Phi*_(c_2 h) Phi_(c_1 h) with c_1 = b_0, c_2 = a_1 - c_1, c_3 = b_1 - c_2, ..., whose order is that of the splitting
        whatever Phi is.  For two parts it is the splitting itself.  Raises InvalidInput for more
        than two if the order is that of quadratic kinetic energies only.

        Source: McLachlan, SIAM J. Sci. Comput. 16 (1995), section 2; Hairer, Lubich, Wanner,
        III.3.4.
        """
        if self.quadratic and parts > 2:
            raise InvalidInput(f"{self.name}: it is for two parts, the order is that of quadratic T only; got {parts}")
        turns = [turn for pair in zip(((1, b) for b in self.kicks), ((0, a) for a in self.drifts)) for turn in pair]
        if parts == 2:
            return tuple([(part, c) for part, c in (*turns, (1, self.kicks[-1])) if c != 0.0])
        sequence: list[tuple[int, float]] = []
        share = 0.0
        for last_first, coefficient in turns:
            share = coefficient - share
            for part in range(parts - 1, -1, -1) if last_first else range(parts):
                if len(sequence) > 0 and sequence[-1][0] == part:
                    sequence[-1] = part, sequence[-1][1] + share
                else:
                    sequence.append((part, share))
        return tuple([(part, c) for part, c in sequence if c != 0.0])

    def __repr__(self) -> str:
        return f"SplittingTableau({self.name}: order {self.order}, {self.stages} kicks)"

    # ---------------------------------------------------------------- the laws

    def check(self) -> None:
        """Raise an error, naming the law, unless the coefficients are symmetric and of the order claimed."""
        name = self.name
        if len(self.kicks) != len(self.drifts) + 1 or not all(map(math.isfinite, (*self.kicks, *self.drifts))):
            raise InvalidInput(
                f"{name}: kicks are one more finite number than drifts; got {self.kicks} and {self.drifts}"
            )
        for field, row in (("kicks", self.kicks), ("drifts", self.drifts)):
            if self.symmetric and row != row[::-1]:
                raise LawViolation(f"{name} is not symmetric: {field} are {row}, not the same backwards")
        self._reaches(MOST)

    def _failing(self, length: int) -> str:
        """The worst condition of words of this length, in words; empty if all hold."""
        words = _words(length)
        weights, sizes = (np.array([w[word] for word in words]) for w in self._found)
        residuals = weights - 1.0 / math.factorial(length)
        if self.quadratic:
            for direction in _indifferent(length):
                residuals = residuals - (direction @ residuals) * direction
        worst = int(np.argmax(np.abs(residuals)))
        if abs(residuals[worst]) <= CLOSE * (sizes.max() + 1.0 / math.factorial(length)):
            return ""
        return f"the word {words[worst]} has a weight that is off by {residuals[worst]:.2g}"

    @cached_property
    def _found(self) -> tuple[dict[str, float], dict[str, float]]:
        """The weights of the words, and how large they would be without cancellation."""
        factors = [("B", self.kicks[0])]
        for a, b in zip(self.drifts, self.kicks[1:]):
            factors += [("A", a), ("B", b)]
        return _weights(factors, self.order + 1), _weights([(letter, abs(c)) for letter, c in factors], self.order + 1)


def _words(length: int) -> list[str]:
    return ["".join(letters) for letters in itertools.product("AB", repeat=length)]


def _weights(factors: list[tuple[str, float]], longest: int) -> dict[str, float]:
    """The weights of the words of a product of exponentials: what a last factor makes of them is a
    run of its letter at the end.
    """
    total = {word: float(not word) for length in range(longest + 1) for word in _words(length)}
    for letter, c in factors:
        total = {
            word: math.fsum(
                total[word[: len(word) - k]] * c**k / math.factorial(k)
                for k in range(len(word) - len(word.rstrip(letter)) + 1)
            )
            for word in total
        }
    return total


def _indifferent(length: int) -> np.ndarray:
    """Orthonormal sums of words that vanish with [B, [B, [B, A]]]: what stands before and behind it does not matter."""
    number, rows = {word: i for i, word in enumerate(_words(length))}, []
    for k in range(length - 3):
        for before in _words(k):
            for behind in _words(length - 4 - k):
                rows.append(np.zeros(len(number)))
                for word, weight in _TRIPLE.items():
                    rows[-1][number[before + word + behind]] += weight
    if not rows:
        return np.empty((0, len(number)))
    _, sizes, directions = np.linalg.svd(np.array(rows), full_matrices=False)
    return directions[sizes > 1e-10 * sizes[0]]


def _printed(text: str, quadratic: bool = False) -> SplittingTableau:
    """A splitting of this library: its head, its kicks and its drifts."""
    name, (order,), source, rows = head_and_rows(text)
    symmetric = all(row == row[::-1] for _, row in rows)
    return SplittingTableau.shipped(name, order, **dict(rows), quadratic=quadratic, source=source, symmetric=symmetric)


_of_quadratic = functools.partial(_printed, quadratic=True)


SYMPLECTIC_EULER = _printed("""
    symplectic Euler, order 1: HLW I.1.2
     kicks | 1.0 0.0
    drifts | 1.0
""")
STRANG = _printed("""
    Strang, order 2: Strang, SIAM J. Numer. Anal. 5 (1968); HLW II.5
     kicks | 0.5 0.5
    drifts | 1.0
""")

# ---------------------------------------------------------------- for every T + V

RUTH3 = _printed("""
    Ruth 3, order 3: Ruth, IEEE Trans. Nucl. Sci. 30 (1983); HLW II.5
     kicks | 7/24 3/4 -1/24 0.0
    drifts | 2/3 -2/3 1.0
""")

BLANES_MOAN4_GENERAL = _printed("""
    Blanes-Moan 4, general, order 4: Blanes and Moan 2002, table 2, S 6
     kicks | 0.0792036964311957 0.353172906049774 -0.0420650803577195 *
    drifts | 0.209515106613362 -0.143851773179818 * *
""")

BLANES_MOAN6_GENERAL = _printed("""
    Blanes-Moan 6, general, order 6: Blanes and Moan 2002, table 2, S 10
     kicks | 0.0502627644003922 0.413514300428344 0.0450798897943977 -0.188054853819569 0.54196067845078 *
    drifts | 0.148816447901042 -0.132385865767784 0.067307604692185 0.432666402578175 * *
""")

# ---------------------------------------------------------------- for T quadratic in the momentum

BLANES_MOAN4 = _of_quadratic("""
    Blanes-Moan 4, order 4: Blanes and Moan 2002, table 3, SRKN b 6
     kicks | 0.0829844064174052 0.396309801498368 -0.0390563049223486 *
    drifts | 0.245298957184271 0.604872665711080 * *
""")

BLANES_MOAN6 = _of_quadratic("""
    Blanes-Moan 6, order 6: Blanes and Moan 2002, table 3, SRKN a 14
     kicks | 0 0.09171915262446165 0.183983170005006 -0.05653436583288827 0.004914688774712854 0.143761127168358
             0.328567693746804 * *
    drifts | 0.0378593198406116 0.102635633102435 -0.0258678882665587 0.314241403071447 -0.130144459517415
             0.106417700369543 -0.00879424312851058 *
""")

BLANES_MOAN6_SHORT = _of_quadratic("""
    Blanes-Moan 6, short, order 6: Blanes and Moan 2002, table 3, SRKN b 11
     kicks | 0.0414649985182624 0.198128671918067 -0.0400061921041533 0.0752539843015807 -0.0115113874206879 * *
    drifts | 0.123229775946271 0.290553797799558 -0.127049212625417 -0.246331761062075 0.357208872795928 *
""")

BLANES_CASAS_ESCORIHUELA8 = _of_quadratic("""
    Blanes-Casas-Escorihuela 8, order 8: Blanes, Casas and Escorihuela-Tomas, Appl. Numer. Math. 182 (2022)
     kicks | 0 0.129478606560536730662493794395 0.222257260092671143423043559581 -0.0577514893325147204757023246320
             -0.0578312262103924910221345032763 0.103087297437175356747933252265 -0.140819612554090768205554103887
             0.0234462603492826276699713718626 0.134854517356684096617882205068 0.0287973821073779306345172160211 *
    drifts | 0.0505805 0.149999 -0.0551795510771615573511026950361 0.423755898835337951482264998051
             -0.213495353584659048059672194633 -0.0680769774574032619111630736274 0.227917056974013435948887201671
             -0.235373619381058906524740047732 0.387413869179878047816794031058 * *
""")

# ---------------------------------------------------------------- for A + e B with a small e,
# errors e h^n + e^2 h^m + ...

SABA82 = _printed("""
    SABA (8, 2), order 2: McLachlan, BIT 35 (1995); Laskar and Robutel, Celest. Mech. Dyn. Astron. 80 (2001)
     kicks | 0 0.1739274225687269286865319746109997036177 * *
    drifts | 0.06943184420297371238802675555359524745214 0.2605776340045981552106403648947824089476 *
""")

ABA104 = _printed("""
    ABA (10, 4), order 4: Blanes et al., Appl. Numer. Math. 68 (2013)
     kicks | 0 0.1188819173681970199453503950853885936957 0.2410504605515015657441667865901651105675
             -0.2732866667053238060543113981664559460630 *
    drifts | 0.04706710064597250612947887637243678556564 0.1847569354170881069247376193702560968574
             0.2827060056798362053243616565541452479160 * *
""")

ABA864 = _printed("""
    ABA (8, 6, 4), order 4: Blanes et al., Appl. Numer. Math. 68 (2013)
     kicks | 0 0.183083687472197221961703757166430291072 0.310782859898574869507522291054262796375
             -0.0265646185119588006972121379164987592663 *
    drifts | 0.0711334264982231177779387300061549964174 0.241153427956640098736487795326289649618
             0.521411761772814789212136078067994229991 * *
""")

ABA1064 = _printed("""
    ABA (10, 6, 4), order 4: Blanes et al., Appl. Numer. Math. 68 (2013); Farres et al., Celest. Mech. Dyn.
    Astron. 116 (2013)
     kicks | 0 0.09585888083707521061077150377145884776921 0.2044461531429987806805077839164344779763
             0.2170703479789911017143385924306336714532 * *
    drifts | 0.03809449742241219545697532230863756534060 0.1452987161169137492940200726606637497442
             0.2076276957255412507162056113249882065158 0.4359097036515261592231548624010651844006 *
""")

SPLITTINGS = {
    t.name: t
    for t in (
        *(STRANG, BLANES_MOAN4, BLANES_MOAN6, BLANES_MOAN6_SHORT, BLANES_CASAS_ESCORIHUELA8),
        *(SYMPLECTIC_EULER, RUTH3, BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL),
        *(SABA82, ABA104, ABA864, ABA1064),
    )
}
"""All splittings, by name."""
