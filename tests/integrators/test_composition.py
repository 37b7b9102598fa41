"""Compositions: coefficients that obey their laws, the orders they bring, and what they keep of their base."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import pytest
from scenes import (
    CAYLEY,
    EXP,
    RKMK4,
    Driven,
    asymmetric_body,
    errors_at,
    named,
    rotation,
    same_bits,
    seed_body,
    slope,
    slow,
)

import liemech as lm
from liemech.integrators.composition import Composition
from liemech.integrators.free_body.midpoint import Isospectral, SphericalMidpoint
from liemech.integrators.free_body.splitting import ThreeRotations
from liemech.integrators.magnus import Magnus
from liemech.tableaus.compositions import (
    COMPOSITIONS,
    KAHAN_LI6,
    KAHAN_LI8,
    SUZUKI4,
    SUZUKI_UMENO8,
    TRIPLE_JUMP4,
    YOSHIDA6,
    CompositionTableau,
    suzuki,
    triple_jump,
)

TABLEAUS = pytest.mark.parametrize("tableau", COMPOSITIONS.values(), ids=lambda t: t.name)
BY_ORDER = [Composition(EXP, order=p) for p in (4, 6, 8)]
# ---------------------------------------------------------------- the coefficients


@TABLEAUS
def test_a_composition_has_the_order_it_claims_and_no_more(tableau: CompositionTableau) -> None:
    tableau.check()
    assert CompositionTableau.of(tableau.gamma).order == tableau.order
    with pytest.raises(lm.errors.LawViolation, match=f"of order {tableau.order}, not {tableau.order + 1}"):
        CompositionTableau(tableau.name, tableau.order + 1, tableau.gamma)


@TABLEAUS
def test_sums_of_odd_powers_vanish(tableau: CompositionTableau) -> None:
    """Conditions that a method of commuting errors would have: sum gamma = 1, sum gamma^k = 0 for
    k = 3, 5, ... < order.
    """
    for k in range(1, tableau.order, 2):
        powers = [x**k for x in tableau.gamma]
        assert abs(math.fsum(powers) - (k == 1)) <= 4e-15 * sum(map(abs, powers))
    assert tableau.gamma == tableau.gamma[::-1]
    assert tableau.nodes[0] == 0.0
    assert tableau.nodes[-1] + tableau.gamma[-1] == pytest.approx(1.0, abs=1e-15)


def test_stages_and_reach_as_in_the_books() -> None:
    found = [(t.order, t.stages, round(t.reach, 2)) for t in COMPOSITIONS.values()]
    assert found == [(4, 3, 1.70), (4, 5, 0.66), (6, 7, 1.32), (6, 9, 0.80), (8, 15, 0.80), (8, 17, 0.61)]


@pytest.mark.parametrize("tableau", [YOSHIDA6, KAHAN_LI8], ids=lambda t: t.name)
def test_a_wrong_digit_is_noticed(tableau: CompositionTableau) -> None:
    half = tableau.stages // 2
    gamma = list(tableau.gamma)
    gamma[1] += 1e-13
    gamma[-2] += 1e-13
    with pytest.raises(lm.errors.LawViolation, match="is of order 0"):
        CompositionTableau("spoilt", tableau.order, gamma)
    gamma[half] -= 2e-13  # the sum is right again, the cubes are not
    with pytest.raises(lm.errors.LawViolation, match=r"is of order 2, not \d: the word Y_3"):
        CompositionTableau("spoilt", tableau.order, gamma)


def test_power_sums_alone_are_not_enough() -> None:
    """A symmetric composition with sums 1, 0, 0 of gamma, gamma^3, gamma^5 and the wrong commutators is of order 4."""
    gamma = np.array(YOSHIDA6.gamma[:4]) * (1.0, 1.0, 1.0, 1.01)
    twice = np.array([2.0, 2.0, 2.0, 1.0])  # half of it is mirrored
    for _ in range(20):  # Newton's method, with the middle one held
        sums = [(twice * gamma**k).sum() - (k == 1) for k in (1, 3, 5)]
        gamma[:3] -= np.linalg.solve([2.0 * k * gamma[:3] ** (k - 1) for k in (1, 3, 5)], sums)
    assert np.abs(sums).max() < 1e-14
    assert CompositionTableau.of((*gamma, *gamma[2::-1])).order == 4


def test_laws_are_named() -> None:
    with pytest.raises(lm.errors.LawViolation, match=r"not symmetric: gamma_1 = 0\.25 and gamma_2 = 0\.75"):
        CompositionTableau("lame", 1, (0.25, 0.75))
    for wrong, message in (
        ({"base_order": 3}, "even orders"),
        ({"order": 0}, "order is a whole number"),
        ({"order": 12}, "order is a whole number"),
        ({"gamma": ()}, "one finite number for each"),
        ({"gamma": (math.nan,)}, "one finite number for each"),
    ):
        with pytest.raises(lm.errors.InvalidInput, match=message):
            CompositionTableau(**{"name": "wrong", "order": 2, "gamma": (1.0,), **wrong})
    with pytest.raises(lm.errors.InvalidType, match="sequence of numbers"):
        CompositionTableau("wrong", 2, "ab")


def test_one_substep_and_two_halves_are_of_the_order_of_the_base() -> None:
    assert CompositionTableau.of((1.0,)).order == 2
    assert CompositionTableau.of((0.5, 0.5)).order == 2
    assert CompositionTableau.of((0.5, 0.5), base_order=4).order == 4


@pytest.mark.parametrize("family", [triple_jump, suzuki])
@pytest.mark.parametrize("base", [2, 4, 6, 8])
def test_families_gain_two_orders(family: object, base: int) -> None:
    tableau = family(base)  # type: ignore[operator]
    tableau.check()
    assert tableau.order == base + 2


# ---------------------------------------------------------------- the order of the method


STEPS = {
    TRIPLE_JUMP4: (160, 320),
    SUZUKI4: (80, 160),
    YOSHIDA6: (80, 160),
    KAHAN_LI6: (40, 80),
    SUZUKI_UMENO8: (20, 40),
}
BASES = EXP, SphericalMidpoint(), ThreeRotations()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("base", "tableau", "counts"),
    [
        case if i % 3 == j else slow(*case)  # every tableau with one base; all with all are slow
        for i, (tableau, counts) in enumerate(STEPS.items())
        for j, base in enumerate(BASES)
        for case in [(base, tableau, counts)]
    ],
    ids=lambda x: getattr(x, "name", ""),
)
def test_orders_of_the_other_tableaus_and_bases(
    base: lm.Method, tableau: CompositionTableau, counts: tuple[int, int]
) -> None:
    body, start = asymmetric_body()
    method = Composition(base, tableau=tableau)
    for error in errors_at(body, method, start, 10.0, counts):
        assert math.log2(error[0] / error[1]) == pytest.approx(tableau.order, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("base", [Isospectral(4), Composition(EXP, order=4)], ids=named)
def test_a_base_of_order_four_gives_order_six(base: lm.Method) -> None:
    body, start = asymmetric_body()
    method = Composition(base, order=6)
    assert method.tableau == suzuki(4)
    assert method.order == 6
    error, _ = errors_at(body, method, start, 20.0, (20, 40))
    assert math.log2(error[0] / error[1]) == pytest.approx(6.0, abs=0.25)


@pytest.mark.parametrize("order", [4, 6])
def test_substeps_know_the_time(order: int) -> None:
    """Another kind of system, another kind of state: Magnus' method of order 2, against that of
    order 6 with small steps.
    """
    system = Driven(lm.SO3())
    start = system.state(rotation(np.random.default_rng(3)))
    exact = lm.integrate(system, Magnus(6), start, h=8e-3, steps=250, t0=0.3).g[-1]
    errors, counts = [], (20, 40, 80)
    for n in counts:
        run = lm.integrate(system, Composition(Magnus(2), order=order), start, h=2.0 / n, steps=n, t0=0.3)
        errors.append(np.abs(run.g[-1] - exact).max())
    assert slope([1 / n for n in counts], errors) == pytest.approx(order, abs=0.2)


# ---------------------------------------------------------------- what a composition is


@pytest.mark.parametrize("base", [EXP, CAYLEY, ThreeRotations()], ids=named)
def test_a_composition_of_one_is_the_base(base: lm.Method) -> None:
    body, start = asymmetric_body()
    runs = [
        lm.integrate(body, m, start, h=0.2, steps=50)
        for m in (base, Composition(base, tableau=CompositionTableau("one", 2, (1.0,))))
    ]
    assert same_bits(runs[0].mu, runs[1].mu)
    assert same_bits(runs[0].g, runs[1].g)


@pytest.mark.parametrize("base", [EXP, CAYLEY, ThreeRotations()], ids=named)
def test_a_step_is_its_substeps(base: lm.Method) -> None:
    """Substeps run one by one, each from a new start: whatever the base remembers is a matter of speed only."""
    body, start = asymmetric_body()
    run = lm.integrate(body, Composition(base, order=6), start, h=0.3, steps=5)
    state = start
    for _ in range(5):
        for share in KAHAN_LI6.gamma:
            state = lm.integrate(body, base, state, h=0.3 * share, steps=1).last
    assert np.abs(run.mu[-1] - np.array(state.mu)).max() < 2e-14
    assert np.abs(run.g[-1] - np.array(state.g)).max() < 2e-14


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [Composition(CAYLEY, order=4), Composition(EXP, order=6)], ids=named)
def test_momentum_is_kept_over_ten_thousand_steps(method: Composition) -> None:
    body, start = seed_body()
    run = lm.integrate(body, method, start, h=0.1, steps=10_000, every=10)
    space = np.einsum("nij,nj->ni", run.g, run.mu)
    assert np.abs(np.linalg.norm(run.mu, axis=1) - 1.0).max() < 1e-13
    assert np.abs(space - space[0]).max() < 1e-13
    energy = np.abs(run.energy - run.energy[0])
    assert energy[500:].max() <= 1.1 * energy[:500].max()


# ---------------------------------------------------------------- claims and refusals


def test_claims_come_from_the_base() -> None:
    assert Composition(CAYLEY).symplectic
    assert Composition(CAYLEY).symmetric
    assert not Composition(Magnus(2)).symplectic
    assert [m.tableau for m in BY_ORDER] == [SUZUKI4, KAHAN_LI6, KAHAN_LI8]
    assert Composition(CAYLEY).name == "Suzuki 4 of Algorithm 1 (Cayley)"
    assert repr(Composition(CAYLEY, order=6)) == f"Composition({CAYLEY!r}, order=6)"
    assert "Yoshida 6" in repr(Composition(CAYLEY, tableau=YOSHIDA6))


def test_refusals() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"RKMK\(order=4\) is not symmetric"):
        Composition(RKMK4)
    with pytest.raises(
        lm.errors.InvalidInput, match=r"order is one of \[4, 6, 8\] for a base of order 2, or give a tableau; got 5"
    ):
        Composition(CAYLEY, order=5)
    with pytest.raises(
        lm.errors.InvalidInput, match=r"order is one of \[6\] for a base of order 4, or give a tableau; got 8"
    ):
        Composition(Isospectral(4), order=8)
    with pytest.raises(lm.errors.InvalidInput, match="for a base of order 4"):
        Composition(CAYLEY, tableau=suzuki(4))
    with pytest.raises(lm.errors.InvalidType, match="must be a CompositionTableau"):
        Composition(CAYLEY, tableau=(1.0,))  # type: ignore[arg-type]
    with pytest.raises(lm.errors.InvalidType, match="base must be a method"):
        Composition(lm.Cayley())  # type: ignore[arg-type]


def test_systems_are_those_of_the_base() -> None:
    body, _ = asymmetric_body()
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs a linear equation"):
        Composition(Magnus(2)).require(body)


def test_a_substep_that_cannot_be_made_ends_the_run() -> None:
    body, start = seed_body()
    with pytest.raises(lm.errors.IntegrationFailure, match=r"too large for this motion|too large; try"):
        lm.integrate(body, Composition(EXP, order=4), start, h=40.0, steps=3)


@lm.record
class Twice(lm.Method):
    """A method of somebody who never heard of compositions: memory, and no word about its past."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    def start(self, system: lm.System, state: lm.BodyState, h: float) -> tuple[lm.BodyState, float]:
        return state, h

    def observe(self, memory: tuple[lm.BodyState, float]) -> lm.BodyState:
        return memory[0]

    def step(
        self, system: lm.System, t: float, memory: tuple[lm.BodyState, float], h: float
    ) -> tuple[lm.BodyState, float]:
        return ThreeRotations().step(system, t, memory[0], memory[1]), memory[1]


def test_a_base_with_a_memory_of_its_own_is_started_anew() -> None:
    body, start = asymmetric_body()
    runs = [
        lm.integrate(body, Composition(base, order=4), start, h=0.2, steps=20) for base in (Twice(), ThreeRotations())
    ]
    assert same_bits(runs[0].mu, runs[1].mu)
