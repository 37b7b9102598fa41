"""Loops over sites: the same bits in plain Python and in native code of any number of lanes, for methods as they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hand_made import Everyone, Field, Springs, ring, run, spins, turned

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.sites.planes import Planes
from liemech.compiler.sites.site_calls import SiteCalls, needs
from liemech.errors import InvalidInput, NotCompilable
from liemech.formulas.sites import (
    FAR,
    SiteArray,
    SiteTable,
    chains_of_partners,
    each_site,
    interleaved_sum,
    meet,
    one_site,
    own,
    padded,
    present_site,
    total,
)

N = 13
B = [0.0, 0.0, 0.1]
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


def field(n: int = N, fixed: bool = True) -> Any:
    return lm.LiePoissonSystem(lm.SO3(), Field(ring(n, fixed), B))


def coupled(n: int = N) -> Any:
    body = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy([1.0, 1.5, 2.0]))
    return lm.MechanicalSystem(body, Springs(ring(n), 0.7))


@pytest.mark.slow
@native
@pytest.mark.parametrize(
    "method",
    [lm.RKMK(order=4), lm.RKMK(tableau=lm.tableaus.gauss(1)), lm.Isospectral(order=2), lm.KickDrift()],
    ids=repr,
)
def test_bits_of_all_lanes(method: Any) -> None:
    """Of momenta, of equations of all sites that sweeps solve, and of bodies."""
    system, elements = (coupled(), turned(N)) if isinstance(method, lm.KickDrift) else (field(), None)
    plain = run(method, system, spins(N), elements, 0.05, 2, 0)
    for lanes in (1, 8, 16):
        assert np.array_equal(run(method, system, spins(N), elements, 0.05, 2, lanes), plain), lanes


@pytest.mark.slow
@native
def test_order_of_sweeps() -> None:
    ends = [run(lm.RKMK(tableau=lm.tableaus.gauss(2)), field(), spins(N), None, 0.4 / n, n, 8)[-1] for n in (1, 2, 8)]
    ratio = np.abs(ends[0] - ends[2]).max() / np.abs(ends[1] - ends[2]).max()
    assert 13.0 < ratio < 20.0


@pytest.mark.slow
@native
@pytest.mark.parametrize("n", [1, 2, 7, 33])
def test_any_number_of_sites(n: int) -> None:
    for system in (field(n), field(n, False), lm.LiePoissonSystem(lm.SO3(), Everyone(B))):
        plain = run(lm.RKMK(order=4), system, spins(n), None, 0.01, 2, 0)
        for lanes in (1, 8):
            assert np.array_equal(run(lm.RKMK(), system, spins(n), None, 0.01, 2, lanes), plain)


@pytest.mark.parametrize("count", [1, 2, 8, 9, 21])
def test_sites_meet_all_others_once(count: int) -> None:
    met = {i: [x for chains in chains_of_partners(i, count) for chain in chains for x in chain] for i in range(count)}
    for i, them in met.items():
        assert sorted(j for j, _ in them) == [j for j in range(count) if j != i]
        for j, first in them:
            if i // 8 != j // 8:  # one of the two is the first, and both say the same
                assert first == (i < j) and (i, not first) in met[j]


@pytest.mark.slow
@native
@pytest.mark.parametrize("n", [1, 8, 9, 16, 33])
def test_pairs_taken_once_have_the_bits_of_those_taken_from_both_ends(n: int) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Everyone(B))
    plain = run(lm.RKMK(order=2), system, spins(n), None, 0.01, 2, 0)
    for lanes in (1, 8, 16):
        assert np.array_equal(run(lm.RKMK(order=2), system, spins(n), None, 0.01, 2, lanes), plain)


@lm.record
class Lopsided(Everyone):
    """What it does to a pair depends on who asks."""

    def gradient(self, mu: Any) -> Any:
        return meet(mu).pairs(lambda a, b: (lm.cross(mu, b), lm.cross(mu, a)), -self.B)


@native
def test_a_formula_of_pairs_that_asks_for_one_site_is_refused() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Lopsided(B))
    with pytest.raises(NotCompilable, match="numbers of one site alone"):
        run(lm.RKMK(order=2), system, spins(9), None, 0.01, 2, 8)


@native
def test_one_kernel_for_every_number() -> None:
    for n in (20, 40, 1000):
        run(lm.RKMK(order=4), field(n, False), spins(n), None, 0.05, 1, 8)
    before = len(kernel.alive())
    near = SiteTable.of(np.random.default_rng(0).integers(0, 77, (5, 77)), fixed=False)
    other = lm.LiePoissonSystem(lm.SO3(), Field(near, [0.1, 0.0, 0.0]))
    run(lm.RKMK(order=4), other, spins(77), None, 0.05, 1, 8)
    assert len(kernel.alive()) == before


@native
def test_rows_of_scratch_memory() -> None:
    system, none = field(), np.empty(0)
    from liemech.formulas.classes.layouts import carried_layout, layout_of
    from liemech.rooms.sites.runs.driver import PLACE, Procedure, Shown, advance_sites
    from liemech.simulation.runs.equal import Equal
    from liemech.systems.lie_poisson import BodyState

    memory = carried_layout(BodyState(lm.vec(0.0, 0.0, 0.0)))
    planes, shared = Planes.of_rows(1, 1), kernel.Shared(none)
    shown = Shown(True, False, memory, (), layout_of(()))
    procedure = Procedure(lm.RKMK(), Equal(), memory, PLACE, shown, False, None)
    arguments = procedure, system, 1, planes, planes, *[shared] * 3, *[none] * 4, None
    made = kernel.kernel(advance_sites, *arguments, lanes=kernel.width())
    assert needs(made) == (15, False, False)  # twice what is published, and three velocities
    assert SiteCalls(made, 100).scratch.shape == (15, padded(100))


# ------------------------------------------------------------------ the words in plain Python


def test_words() -> None:
    table = SiteTable.of(np.array([[1, 2, 0], [2, 0, 1]]))
    mass, place = SiteArray.of([1.0, 2.0, 4.0]), SiteArray.of(np.arange(6.0).reshape(3, 2))
    edges = SiteArray.of(np.arange(12.0).reshape(2, 3, 2), edges=True)
    found: list[Any] = [None] * 3

    def formula() -> None:
        others, i = meet(lm.vec(own(mass), 1.0)), present_site()
        found[i] = (
            others.of(table, 0)[0], others.at(2)[0], total(own(mass)), own(place), own(edges, 1),
            own(table, 1), others.pairs(lambda a, b: (b, a), lm.vec(0.0, 0.0)),
        )  # fmt: skip

    each_site(3, formula)
    assert found[1] == (4.0, 4.0, 7.0, lm.vec(2.0, 3.0), lm.vec(8.0, 9.0), 0, lm.vec(5.0, 2.0))
    assert total(3.0) == 3.0
    with pytest.raises(InvalidInput, match="there is no site here"):
        meet(1.0)


def test_one_site_is_as_in_all() -> None:
    table, visited = ring(30), []
    found = np.zeros(30)

    def formula() -> float:
        visited.append(present_site())
        x = 1.0 + present_site()
        for _ in range(3):
            others = meet(x)
            x = 2.0 * others.of(table, 0) - 0.5 * others.of(table, 1) + x
        return x

    def all_of_them() -> None:
        found[present_site()] = formula()

    each_site(30, all_of_them)
    visited.clear()
    assert one_site(30, 11, formula) == found[11]
    assert {*visited} == {*range(8, 15)}  # those three edges away, no others


def test_sites_ask_alike() -> None:
    def formula() -> None:
        if present_site() == 2:
            total(1.0)
        else:
            meet(1.0)

    with pytest.raises(InvalidInput, match="site 0 asks for meet where site 2 asks for total"):
        each_site(4, formula)


SCATTERED = np.array([(np.arange(77) + 1) % 77, np.arange(77) ^ 3, np.random.default_rng(4).permutation(77)]).clip(
    0, 76
)
"""Neighbours that follow each other, that lie among sixteen, and that lie anywhere."""


def test_reach_of_neighbours() -> None:
    """Of every eight entries it says where they are: told by the entries one by one."""
    table = SiteTable.of(SCATTERED)
    eights = table.numbers.reshape(-1, 8).tolist()
    reach = table.reach.array.view(np.int32).tolist()
    assert len(reach) == len(eights)
    kinds = set()
    for found, eight in zip(reach, eights, strict=True):
        follow = eight == [*range(eight[0], eight[0] + 8)]
        near = max(eight) - min(eight) < 16
        assert (found >= 0) == follow and (found == FAR) == (not follow and not near)
        if found >= 0:
            assert found == eight[0]
        elif found != FAR:
            assert 0 <= ~found <= min(eight) and max(eight) <= ~found + 15 < table.places
        kinds.add((found >= 0, found == FAR))
    assert len(kinds) == 3
    assert not SiteTable.of(np.zeros((0, 5), int)).reach.array.size


@pytest.mark.slow
@native
def test_bits_of_neighbours_anywhere() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Field(SiteTable.of(SCATTERED), B))
    plain = run(lm.RKMK(order=2), system, spins(77), None, 0.05, 2, 0)
    for lanes in (1, 8, 16):
        found = run(lm.RKMK(order=2), system, spins(77), None, 0.05, 2, lanes)
        assert np.array_equal(found, plain), lanes


def test_sums_of_sixteen() -> None:
    x = np.random.default_rng(0).normal(size=100)
    parts = [sum(x[k::16].tolist(), 0.0) for k in range(16)]
    while len(parts) > 1:
        half = len(parts) // 2
        parts = [a + b for a, b in zip(parts[:half], parts[half:], strict=True)]
    assert interleaved_sum(x.tolist()) == parts[0]


@pytest.mark.parametrize("entries", [[[0.0, 1.0]], [[-1, 0]], [0, 1], np.zeros((2, 0), int)])
def test_tables_are_checked(entries: Any) -> None:
    with pytest.raises(InvalidInput, match="SiteTable"):
        SiteTable.of(entries)
