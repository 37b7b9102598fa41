"""Tableaus are data: order conditions, what breaks them, and the order that a scalar equation sees."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from scenes import slope

import liemech as lm
from liemech.tableaus import diagonally_implicit, explicit, pairs, trees
from liemech.tableaus.butcher import BY_ORDER, FAMILIES, PAIRS, TABLEAUS, pair
from liemech.tableaus.collocation import gauss, lobatto_iiia, lobatto_iiib, lobatto_iiic, radau_iia
from liemech.tableaus.pairs import DOP853, VERNER6, VERNER7
from liemech.tableaus.tableau import ButcherTableau
from liemech.tableaus.trees import order_of

value, kind, law = lm.errors.InvalidInput, lm.errors.InvalidType, lm.errors.LawViolation

HEUN3 = dict(name="Heun 3", A=((), (1 / 3,), (0, 2 / 3)), b=(1 / 4, 0, 3 / 4), c=(0, 1 / 3, 2 / 3))

HALF = ((0,), (1,), (0,), (0,))  # the straight line with the slope of the second stage

COLLOCATION = [made(s) for name, made in FAMILIES.items() for s in range(2 if name.startswith("Lobatto") else 1, 6)]
ALL = [*TABLEAUS.values(), *COLLOCATION]
DENSE = [t for t in ALL if t.interpolant]
DECIMALS = "Tsitouras 5(4)", "DOP853", "Verner 7(6)"  # printed as such
TABLES = [t for m in (explicit, pairs) for t in vars(m).values() if isinstance(t, ButcherTableau)]
WITH_FRACTIONS = [t for t in TABLES if t.name not in DECIMALS]


def named(t: Any) -> str:
    return t.name if isinstance(t, ButcherTableau) else str(t)


# the error of a single solution may vanish at some step by chance
STARTS = np.linspace(-1.5, 1.5, 12)


def f(t: float, y: np.ndarray) -> np.ndarray:
    """The right-hand side of a scalar equation that sees all order conditions."""
    return np.cos(t + y) + 0.5 * y


def slopes(m: ButcherTableau, t: float, y: np.ndarray, h: float) -> list[np.ndarray]:
    """The slopes of one step, those of the interpolant after those of the step; implicit ones by iteration."""
    k = [f(t, y)] * m.stages
    for _ in range(1 if m.explicit else 60):
        for i, (row, c) in enumerate(zip(m.A, m.c, strict=True)):
            k[i] = f(t + c * h, y + h * sum(a * s for a, s in zip(row, k)))
    for row, c in zip(m.A_extra, m.c_extra, strict=True):
        k.append(f(t + c * h, y + h * sum(a * s for a, s in zip(row, k, strict=True))))
    return k


@functools.cache
def solved(m: ButcherTableau, n: int, end: float = 1.0) -> np.ndarray:
    """y(end) from STARTS in n steps."""
    y, h = STARTS, end / n
    for i in range(n):
        y = y + h * sum(b * s for b, s in zip(m.b, slopes(m, i * h, y, h)))
    return y


def measured(found: list[tuple[float, np.ndarray]]) -> float:
    """The slope of the root mean square of errors over the step, above rounding."""
    h, error = zip(*[(h, e) for h, y in found if (e := math.sqrt(np.mean(y**2))) > 2e-14][-4:])
    return slope(h, error)


# ---------------------------------------------------------------- trees


def test_number_of_trees() -> None:
    """1, 1, 2, 4, 9, 20, 48, 115, 286, 719: OEIS A000081; HLW III.1, table 1.2."""
    assert [len(trees.trees(n)) for n in range(1, 11)] == [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]


def symmetry(tree: trees.Tree) -> int:
    """sigma(tree): the number of ways to renumber it."""
    return math.prod(math.factorial(m) * symmetry(branch) ** m for branch, m in Counter(tree).items())


@pytest.mark.parametrize("n", range(1, 10))
def test_densities_and_symmetries_count_the_increasing_labellings(n: int) -> None:
    """n! / (gamma sigma) labellings belong to a tree, and (n-1)! to all of them."""
    counts = [Fraction(math.factorial(n), trees.density(t) * symmetry(t)) for t in trees.trees(n)]
    assert all(c.denominator == 1 for c in counts)
    assert sum(counts) == math.factorial(n - 1)


def test_trees_in_brackets() -> None:
    assert [trees.text(t) for t in ((), ((),), ((), ()), (((),), ()))] == [".", "[.]", "[.,.]", "[.,[.]]"]
    assert [trees.density(t) for t in ((), ((),), ((), ()), ((), ((),)))] == [1, 2, 3, 8]


# ---------------------------------------------------------------- what is shipped


@pytest.mark.parametrize("t", ALL, ids=named)
def test_a_shipped_tableau_obeys_its_laws(t: ButcherTableau) -> None:
    t.check()
    assert t.source
    assert t == ButcherTableau(**{f.name: getattr(t, f.name) for f in dataclasses.fields(t)})
    assert all(
        type(x) is float
        for row in (*t.A, *t.A_extra, *t.interpolant, t.b, t.c, t.b_hat, t.b_low, t.c_extra)
        for x in row
    )


@pytest.mark.parametrize("t", ALL, ids=named)
def test_the_orders_are_sharp(t: ButcherTableau) -> None:
    assert t.measured_order() == t.order
    for weights, order in ((t.b_hat, t.embedded_order), (t.b_low, t.low_order)):
        assert not weights or order_of(t.A, weights) == order


@pytest.mark.parametrize("t", DENSE, ids=named)
def test_the_order_of_the_interpolant_is_sharp(t: ButcherTableau) -> None:
    with pytest.raises(law, match=f"the interpolant is not of order {t.interpolant_order + 1}"):
        dataclasses.replace(t, interpolant_order=t.interpolant_order + 1)


@pytest.mark.parametrize("t", DENSE, ids=named)
def test_the_interpolant_is_smooth_from_step_to_step(t: ButcherTableau) -> None:
    """b_i(0) = 0, b_i(1) = b_i, and the slopes at the ends are k_1 and f at the new state."""
    end = next(
        i
        for i, row in enumerate(t.A + t.A_extra)
        if row[: t.stages] == t.b[: len(row)] and sum(row) == pytest.approx(1)
    )
    for i, row in enumerate(t.interpolant):
        size = 1.0 + sum(map(abs, row))
        assert row[0] == pytest.approx(float(i == 0), abs=1e-15)
        assert sum(row) == pytest.approx(t.b[i] if i < t.stages else 0.0, abs=1e-15 * size)
        assert sum(k * p for k, p in enumerate(row, start=1)) == pytest.approx(float(i == end), abs=1e-14 * size)


@pytest.mark.parametrize("t", DENSE, ids=named)
def test_the_interpolant_follows_the_solution(t: ButcherTableau) -> None:
    """Its error within a step is of one order more than its own; the nodes of the extra stages count, too."""
    theta, found = 0.37, []
    for h in (1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.125, 0.09):
        weights = [sum(p * theta**k for k, p in enumerate(row, start=1)) for row in t.interpolant]
        y = STARTS + h * sum(w * s for w, s in zip(weights, slopes(t, 0.0, STARTS, h), strict=True))
        found.append((h, y - solved(BY_ORDER[8], 20, theta * h)))
    assert measured(found) == pytest.approx(t.interpolant_order + 1, abs=0.3)


def exact(t: ButcherTableau, weights: trees.Row, order: int) -> bool:
    """The order conditions in fractions, the simplest ones that round to the coefficients."""

    def fraction(x: float) -> Fraction:
        found = Fraction(x).limit_denominator(3 * 10**7)
        assert float(found) == x
        return found

    A, b = [list(map(fraction, row)) for row in t.A], list(map(fraction, weights))
    assert all(sum(row) == fraction(c) for row, c in zip(A, t.c, strict=True))
    known: dict[trees.Tree, list[Fraction]] = {}

    def phi(tree: trees.Tree) -> list[Fraction]:
        if tree not in known:
            parts, one = [phi(branch) for branch in tree], Fraction(1)
            known[tree] = [math.prod((sum(a * f for a, f in zip(row, p)) for p in parts), start=one) for row in A]
        return known[tree]

    conditions = [(tree, trees.density(tree)) for n in range(1, order + 1) for tree in trees.trees(n)]
    return all(sum(w * x for w, x in zip(b, phi(tree))) * density == 1 for tree, density in conditions)


@pytest.mark.parametrize("t", [*WITH_FRACTIONS, diagonally_implicit.SDIRK4], ids=named)
def test_fractions_are_the_printed_ones(t: ButcherTableau) -> None:
    """Their order conditions hold exactly: no digit is wrong."""
    assert exact(t, t.b, t.order)
    assert not exact(t, t.b, t.order + 1)
    assert not t.b_hat or exact(t, t.b_hat, t.embedded_order)


@pytest.mark.sample(2)
@pytest.mark.parametrize("t", [t for t in ALL if t.order <= 8], ids=named)
def test_order_on_a_nonlinear_equation(t: ButcherTableau) -> None:
    """The tableau by hand; the stage times count, too."""
    end = 2.0 if t.explicit else 0.6
    right = solved(BY_ORDER[8], 60, end)
    found = [(end / n, solved(t, n, end) - right) for n in (3, 4, 6, 8, 12, 16, 24, 32, 48)]
    assert measured(found) == pytest.approx(t.order, abs=0.5)


def test_there_is_a_method_for_every_order() -> None:
    assert list(BY_ORDER) == list(range(1, 9))
    assert [t.order for t in BY_ORDER.values()] == list(BY_ORDER)
    assert [t.bare.stages for t in BY_ORDER.values()] == [1, 2, 3, 4, 6, 8, 9, 12]
    assert [(t.order, t.explicit, t.embedded) for t in PAIRS.values()] == [(p, True, True) for p in PAIRS]
    assert [t.error_order for t in PAIRS.values()] == [2, 3, 4, 5, 6, 7, 8]


# ---------------------------------------------------------------- what they are


def test_explicit_and_diagonally_implicit() -> None:
    for t in TABLEAUS.values():
        assert t.explicit == all(len(row) == i for i, row in enumerate(t.A))
        assert t.explicit != t.diagonally_implicit
    assert [t.diagonally_implicit for t in (gauss(1), gauss(2), lobatto_iiia(2), lobatto_iiia(3))] == [
        True,
        False,
        True,
        False,
    ]


def test_first_same_as_last() -> None:
    ours = {t.name for t in ALL if t.fsal}
    assert ours >= {
        "Bogacki-Shampine 3(2)",
        "Dormand-Prince 5(4)",
        "Bogacki-Shampine 5(4)",
        "Tsitouras 5(4)",
        "Verner 6(5)",
    }
    assert len(ours) == 5 + 5  # and the trapezoidal rule, Lobatto IIIA 2 to 8
    assert all(abs(sum(t.A[-1]) - 1.0) < 1e-15 and t.A[-1] == t.b[: len(t.A[-1])] for t in ALL if t.fsal)


def test_which_are_symplectic_and_which_symmetric() -> None:
    """Hairer, Lubich, Wanner, table II.1.1, V.2 and VI.4."""
    symplectic = {f"Gauss {2 * s}" for s in range(1, 6)} | {"implicit midpoint"}
    lobatto = {f"Lobatto III{x} {p}" for x in "AB" for p in (2, 4, 6, 8)}
    assert {t.name for t in ALL if t.symplectic} == symplectic
    assert {t.name for t in ALL if t.symmetric} == symplectic | lobatto | {"trapezoidal"}


def test_symmetric_methods_undo_their_steps() -> None:
    """R(z) R(-z) = 1 for symmetric and for symplectic methods, and for no other one here."""
    z = 0.3 + 0.4j
    for t in ALL:
        reversible = abs(t.stability(z) * t.stability(-z) - 1.0) < 1e-14
        assert reversible == (t.symmetric or t.symplectic), t.name


def test_the_order_of_the_stages_does_not_matter() -> None:
    m, p = gauss(4), [2, 0, 3, 1]
    shuffled = ButcherTableau(
        "shuffled", 8, [[m.A[i][j] for j in p] for i in p], [m.b[i] for i in p], [m.c[i] for i in p]
    )
    assert shuffled.symmetric
    assert shuffled.symplectic
    assert shuffled.stage_order == 4


def test_stage_orders() -> None:
    for s in range(2, 6):
        found = [made(s).stage_order for made in (gauss, radau_iia, lobatto_iiia, lobatto_iiic)]
        assert found == [s, s, s, s - 1]
    assert [t.stage_order for t in (explicit.RK4, DOP853, diagonally_implicit.SDIRK4)] == [1, 1, 1]


def test_the_bare_step_is_the_same() -> None:
    for t in TABLEAUS.values():
        assert np.allclose(solved(t.bare, 5), solved(t, 5), rtol=0, atol=1e-15)
        assert t.bare.bare is t.bare
        assert not t.bare.embedded
    assert [t.bare.stages for t in (pairs.DORMAND_PRINCE5, pairs.DVERK6, VERNER6, VERNER7, pairs.ZONNEVELD4)] == [
        6,
        7,
        8,
        9,
        4,
    ]
    assert explicit.RK4.bare is explicit.RK4


# ---------------------------------------------------------------- Gauss, Radau, Lobatto


@pytest.mark.parametrize("s", [1, 2, 3, 7, 20])
def test_nodes_and_weights_of_gauss(s: int) -> None:
    x, w = np.polynomial.legendre.leggauss(s)
    assert np.allclose(gauss(s).c, (1 + x) / 2, rtol=0, atol=4e-16)
    assert np.allclose(gauss(s).b, w / 2, rtol=1e-13, atol=0)


@pytest.mark.parametrize("s", [3, 8])
def test_every_coefficient_is_the_exact_one_rounded(s: int) -> None:
    """C(s) and B(s) solved for A and b in 60 digits, at the zeros of Legendre's polynomial."""
    with mpmath.workdps(60):
        x = [mpmath.findroot(lambda x: mpmath.legendre(s, 2 * x - 1), guess) for guess in gauss(s).c]
        powers = mpmath.matrix([[node**k for node in x] for k in range(s)])
        integrals = [mpmath.matrix([end ** (k + 1) / (k + 1) for k in range(s)]) for end in [*x, mpmath.mpf(1)]]
        rows = [tuple(map(float, mpmath.lu_solve(powers, right))) for right in integrals]
    assert gauss(s).c == tuple(map(float, x))
    assert [*gauss(s).A, gauss(s).b] == rows


def test_closed_forms() -> None:
    """As printed in Hairer and Wanner, IV.5, and Hairer, Lubich, Wanner, II.1."""
    q, r, one = math.sqrt(3) / 6, math.sqrt(6), 1.0
    assert np.allclose(gauss(2).A, [[1 / 4, 1 / 4 - q], [1 / 4 + q, 1 / 4]], rtol=0, atol=1e-16)
    A = [
        [(88 - 7 * r) / 360, (296 - 169 * r) / 1800, (-2 + 3 * r) / 225],
        [(296 + 169 * r) / 1800, (88 + 7 * r) / 360, (-2 - 3 * r) / 225],
        [(16 - r) / 36, (16 + r) / 36, 1 / 9],
    ]
    assert np.allclose(radau_iia(3).A, A, rtol=0, atol=2e-16)
    assert lobatto_iiia(3).A == ((0, 0, 0), (5 / 24, 1 / 3, -1 / 24), (1 / 6, 2 / 3, 1 / 6))
    assert lobatto_iiib(3).A == ((1 / 6, -1 / 6, 0), (1 / 6, 1 / 3, 0), (1 / 6, 5 / 6, 0))
    assert lobatto_iiic(3).A == ((1 / 6, -1 / 3, 1 / 6), (1 / 6, 5 / 12, -1 / 12), (1 / 6, 2 / 3, 1 / 6))
    assert (radau_iia(1).A, radau_iia(1).b, radau_iia(1).c) == (((one,),), (one,), (one,))
    assert lobatto_iiia(2).A == diagonally_implicit.TRAPEZOIDAL.A


def pade(j: int, k: int, z: complex) -> complex:
    """The quotient of polynomials of degrees j over k that is nearest to exp(z).  Hairer and
    Wanner, IV.3, theorem 3.11.
    """

    def polynomial(n: int, m: int, x: complex) -> complex:
        return sum(math.comb(n, i) * math.factorial(n + m - i) / math.factorial(n + m) * x**i for i in range(n + 1))

    return polynomial(j, k, z) / polynomial(k, j, -z)


@pytest.mark.parametrize("s", range(2, 7))
def test_stability_functions_are_pade_approximations(s: int) -> None:
    """Hairer and Wanner, IV.5, table 5.13."""
    degrees = [(gauss, s, s), (radau_iia, s - 1, s), (lobatto_iiic, s - 2, s)]
    degrees += [(lobatto_iiia, s - 1, s - 1), (lobatto_iiib, s - 1, s - 1)]
    for made, j, k in degrees:
        for z in (-1.0, 2j, -3 + 1j):
            assert made(s).stability(z) == pytest.approx(pade(j, k, z), rel=1e-12)


def test_stability_functions_of_explicit_methods_are_cut_exponentials() -> None:
    for t in (explicit.EULER, explicit.HEUN2, explicit.SSP3, explicit.KUTTA38):
        assert t.stability(0.7j) == pytest.approx(sum((0.7j) ** n / math.factorial(n) for n in range(t.order + 1)))


def test_l_stable_methods() -> None:
    for t in (radau_iia(3), lobatto_iiic(3), diagonally_implicit.SDIRK4, diagonally_implicit.IMPLICIT_EULER):
        assert t.stiffly_accurate or t.name == "Lobatto IIIC 4"
        assert abs(t.stability(-1e8)) < 1e-6
    for t in (gauss(2), radau_iia(3), lobatto_iiic(4), diagonally_implicit.SDIRK4, diagonally_implicit.CROUZEIX3):
        assert all(abs(t.stability(1j * y)) <= 1.0 + 1e-14 for y in np.linspace(0.0, 30.0, 200))


@pytest.mark.parametrize("s", range(2, 6))
def test_lobatto_a_and_b_are_a_symplectic_pair(s: int) -> None:
    A, B, b = (np.array(x) for x in (lobatto_iiia(s).A, lobatto_iiib(s).A, lobatto_iiia(s).b))
    assert np.allclose(b[:, None] * B + (b[:, None] * A).T, np.outer(b, b), rtol=0, atol=1e-16)


def test_high_orders_are_proved_by_simplifying_assumptions() -> None:
    for s in (6, 9):
        assert [made(s).measured_order() for made in (gauss, radau_iia, lobatto_iiic)] == [2 * s, 2 * s - 1, 2 * s - 2]
    with pytest.raises(law, match=r"order 13 as far as is known.* order 10 at least.* prove order 12"):
        dataclasses.replace(gauss(6), order=13)


def test_families_refuse_stages_that_they_do_not_have() -> None:
    for made, wrong in (
        (gauss, 0),
        (gauss, 21),
        (radau_iia, 2.0),
        (lobatto_iiia, 1),
        (lobatto_iiib, True),
        (lobatto_iiic, "3"),
    ):
        with pytest.raises(value, match=r"has from . to 20 stages; got"):
            made(wrong)


# ---------------------------------------------------------------- what breaks the laws


@pytest.mark.parametrize("t", BY_ORDER.values(), ids=named)
def test_no_tableau_is_of_a_higher_order_than_it_says(t: ButcherTableau) -> None:
    words = rf"not of order {t.order + 1}: .* tree \[.*\] fails, .* instead of 1/\d+; the order is {t.order}"
    with pytest.raises(law, match=words):
        dataclasses.replace(t, order=t.order + 1)


@pytest.mark.parametrize("t", BY_ORDER.values(), ids=named)
def test_every_changed_coefficient_is_found(t: ButcherTableau) -> None:
    """A change of 1e-9 in a weight, or in two entries of a row so that its sum remains."""
    change = 1e-9
    for i in range(t.stages):
        b = list(t.b)
        b[i] += change
        with pytest.raises(law, match=f"not of order {t.order}"):
            dataclasses.replace(t, b=b)
        for j in range(i):
            rows, c = [list(row) for row in t.A], list(t.c)
            rows[i][j] += change
            with pytest.raises(law, match=f"row {i + 1} of A sums to"):
                dataclasses.replace(t, A=rows)
            c[i] += change
            if t.order > 2:
                with pytest.raises(law, match="not of order"):
                    dataclasses.replace(t, A=rows, c=c)


@pytest.mark.parametrize(
    "words, change",
    [
        ("row 3 of A sums to 0.6, but c_3 is 0.5", dict(A=((), (0.5,), (0.1, 0.5), (0, 0, 1)))),
        ("row 1 of A sums to 0, but c_1 is 0.1", dict(c=(0.1, 0.5, 0.5, 1))),
        (
            r"of order 4: .* tree \[\.\] fails, 0.58333333333333. instead of 1/2; .* is 1",
            dict(b=(1 / 6, 1 / 6, 1 / 3, 1 / 3)),
        ),
        (r"not of order 3 with b_hat: .* tree \[\.\] fails", dict(b_hat=(1, 0, 0, 0), embedded_order=3)),
        (r"not of order 2: .* tree \[\.\] theta\^1 .* 0.5 instead of 0", dict(interpolant=HALF, interpolant_order=2)),
        (r"misses the end of the step: b_1\(1\) is 0, not 0.1666", dict(interpolant=HALF, interpolant_order=1)),
        (r"row 1 of A_extra sums to 1, but c_extra_1 is 0.5", dict(A_extra=((1, 0, 0, 0),), c_extra=(0.5,))),
    ],
)
def test_laws(words: str, change: dict[str, Any]) -> None:
    with pytest.raises(law, match=words):
        dataclasses.replace(explicit.RK4, **change)


@pytest.mark.parametrize(
    "error, words, change",
    [
        (value, "A has 3 rows, b 4 weights and c 4 nodes", dict(A=explicit.RK4.A[:3])),
        (value, "A has 4 rows, b 4 weights and c 3 nodes", dict(c=(0, 0.5, 1))),
        (value, "A has 0 rows, b 0 weights and c 0 nodes", dict(A=(), b=(), c=())),
        (
            value,
            r"rows of A have \[0, 1, 3, 3\] entries; .* 4 each, or 0, ..., 3",
            dict(A=((), (0.5,), (0, 0.5, 0), (0, 0, 1))),
        ),
        (value, "b has finite entries; entry 2 is nan", dict(b=(0, math.nan, 0, 0))),
        (value, "row 2 of A has finite entries; entry 1 is inf", dict(A=((), (math.inf,), (0, 0.5), (0, 0, 1)))),
        (kind, "row 2 of A has numbers as entries; entry 1 is '1/2'", dict(A=((), ("1/2",), (0, 0.5), (0, 0, 1)))),
        (kind, "b has numbers as entries; entry 1 is 1j", dict(b=(1j, 0, 0, 0))),
        (kind, r"b has numbers as entries; entry 1 is \[1, 2\]", dict(b=([1, 2], 0, 0, 0))),
        (kind, "b is a sequence; got '1'", dict(b="1")),
        (kind, "A is a sequence; got 3", dict(A=3)),
        (kind, "row 1 of A is a sequence; got 0.5", dict(A=(0.5, 0.5, 0.5, 0.5))),
        (kind, "name is a string; got 4", dict(name=4)),
        (value, "order is the order of b, a whole number from 1 on; got 4.0", dict(order=4.0)),
        (value, "order is the order of b, a whole number from 1 on; got True", dict(order=True)),
        (value, "order is the order of b, a whole number from 1 on; got 0", dict(order=0)),
        (value, "embedded_order is the order of b_hat, .* got 0", dict(b_hat=(1, 0, 0, 0))),
        (value, "embedded_order is 3, but b_hat is missing", dict(embedded_order=3)),
        (value, "b_hat has 2 weights, A 4 stages", dict(b_hat=(1, 0), embedded_order=1)),
        (
            value,
            "interpolant needs 4 rows of one length; they have .1, 1.",
            dict(interpolant=((1,), (0,)), interpolant_order=1),
        ),
        (
            value,
            "interpolant needs 4 rows of one length",
            dict(interpolant=((1,), (0,), (0,), (0, 1)), interpolant_order=1),
        ),
        (value, r"rows of A_extra need 4, 5, ... entries; they have \[2\]", dict(A_extra=((1, 0),), c_extra=(1,))),
        (value, "A_extra has 1 rows and c_extra 0 nodes", dict(A_extra=((1, 0, 0, 0),))),
    ],
)
def test_wrong_calls(error: type[Exception], words: str, change: dict[str, Any]) -> None:
    with pytest.raises(error, match=words):
        dataclasses.replace(explicit.RK4, **change)


# ---------------------------------------------------------------- a tableau of one's own


def test_a_tableau_of_ones_own() -> None:
    """Integers, fractions, lists and arrays become numbers; its method is told from the built-in one by its repr."""
    third = Fraction(1, 3)
    ours = [
        ButcherTableau(order=3, **HEUN3),  # type: ignore[arg-type]
        ButcherTableau("Heun 3", 3, [[], [1 / 3], [0, 2 / 3]], np.array([1 / 4, 0, 3 / 4]), [0, 1 / 3, 2 / 3]),
        ButcherTableau(
            "Heun 3", 3, np.array([[0, 0, 0], [1 / 3, 0, 0], [0, 2 / 3, 0]]), [1 / 4, 0, 3 / 4], [0, 1 / 3, 2 / 3]
        ),
        ButcherTableau.of([[], [third], [0, 2 * third]], [Fraction(1, 4), 0, Fraction(3, 4)], name="Heun 3"),
    ]
    assert all(t == ours[0] and hash(t) == hash(ours[0]) for t in ours)
    assert (ours[3].order, ours[3].stages, ours[3].explicit) == (3, 3, True)
    method = lm.RKMK(tableau=ours[1])
    assert (method.order, method.truncation) == (3, 1)
    assert "Heun 3" in repr(method)
    assert repr(lm.RKMK(order=3)) == "RKMK(order=3)"


def test_order_is_found_or_checked() -> None:
    assert ButcherTableau.of([[0.5]], [1]).order == 2
    assert ButcherTableau.of([[], [0.5]], [0.5, 0.5]).order == 1
    with pytest.raises(law, match=r"not of order 3: .* the order is 2"):
        ButcherTableau.of([[], [0.5]], [0, 1], order=3)
    with pytest.raises(value, match="order of b, a whole number from 1 on; got 0"):
        ButcherTableau.of([[], [0.5]], [0, 0.9])
    with pytest.raises(kind, match="own tableau: A is a sequence; got 3"):
        ButcherTableau.of(3, [1])
    assert order_of(np.array(gauss(2).A), np.array(gauss(2).b), gauss(2).c) == 4


# ---------------------------------------------------------------- names and looks


def test_everything_has_a_name_in_one_place() -> None:
    shipped = [getattr(lm.tableaus, name) for name in lm.tableaus.__all__]
    assert {t for t in shipped if isinstance(t, ButcherTableau)} == set(TABLEAUS.values())
    assert set(lm.tableaus.__all__) <= set(dir(lm.tableaus))
    with pytest.raises(AttributeError, match=r"module .liemech.tableaus. has no attribute 'RK5'"):
        lm.tableaus.RK5  # noqa: B018


def test_by_name() -> None:
    assert lm.tableaus.named("classical") is explicit.RK4
    assert lm.tableaus.named("dormand-prince 5(4)") is lm.tableaus.named("Dormand Prince 5") is pairs.DORMAND_PRINCE5
    assert lm.tableaus.named("Gauss 6") is gauss(3)
    assert (lm.tableaus.named("radau iia 5"), lm.tableaus.named("Lobatto IIIC 4")) == (radau_iia(3), lobatto_iiic(3))
    assert all(lm.tableaus.named(name) is t for name, t in TABLEAUS.items())
    assert pair(8) is DOP853
    for error, words, name in (
        (value, "no tableau is called 'Dormand'; near are Dormand-Prince 5", "Dormand"),
        (value, "no tableau is called 'zzz'; there are Euler, midpoint, .* Gauss <order>", "zzz"),
        (value, "Gauss methods are of even order; got 'Gauss 5'", "Gauss 5"),
        (value, "Radau IIA methods are of odd order; got 'Radau IIA 4'", "Radau IIA 4"),
        (value, "Gauss has from 1 to 20 stages; got 50", "Gauss 100"),
        (kind, "a tableau is called by its name, .* got 5", 5),
    ):
        with pytest.raises(error, match=words):
            lm.tableaus.named(name)  # type: ignore[arg-type]
    for order in (9, 5.0, "5", True):
        with pytest.raises(value, match=r"no pair of order .*; there are pairs of the orders 2, 3, 4, 5, 6, 7, 8"):
            pair(order)  # type: ignore[arg-type]


def test_a_tableau_is_printed_as_in_books() -> None:
    assert str(pairs.BOGACKI_SHAMPINE3).splitlines() == [
        "ButcherTableau(Bogacki-Shampine 3(2): order 3(2), 4 stages)",
        "  0 |",
        "1/2 |  1/2",
        "3/4 |    0  3/4",
        "  1 |  2/9  1/3  4/9",
        "----+--------------------",
        "    |  2/9  1/3  4/9    0",
        "    | 7/24  1/4  1/3  1/8",
    ]
    assert "0.211325 | " in str(gauss(2))
    assert repr(explicit.EULER) == "ButcherTableau(Euler: order 1, 1 stage)"


def test_what_is_worked_out_later_belongs_to_no_comparison() -> None:
    fresh = dataclasses.replace(explicit.RK4)
    assert explicit.RK4.stage_order == 1
    assert fresh == explicit.RK4
    assert hash(fresh) == hash(explicit.RK4)


def test_the_table_in_the_documentation_is_complete() -> None:
    """One row for each: name, order, stages, whether and how its error is estimated, the order in between."""
    page = Path(__file__).parent.parent.parent / "docs" / "tableaus.md"
    lines = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    found = {row[0]: row[1:5] for row in ([cell.strip() for cell in line.split("|")[1:]] for line in lines)}
    for t in TABLEAUS.values():
        estimate = f"{t.embedded_order}, {t.low_order}" if t.b_low else str(t.embedded_order or "")
        assert found[t.name] == [str(t.order), str(t.stages), estimate, str(t.interpolant_order or "")], t.name
