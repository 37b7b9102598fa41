"""Rods in motion: what is kept, orders, and the step that solves for all frames together."""

import numpy as np
import pytest
from scenes import slope

import liemech as lm
import liemech.rooms.sites.runs.plan as sites_plan
from liemech.compiler.numbers.square_blocks import put_block
from liemech.compiler.sites.planes import Planes, columns
from liemech.formulas import mat, vec
from liemech.formulas.classes.layouts import layout_of
from liemech.models import CosseratRod, RodSection
from liemech.rooms.sites.block_elimination import BLOCKS, factor, fill, substitute
from liemech.rooms.sites.galerkin_of_chain import order_along, work_of

SOFT = RodSection([1.0, 1.2, 0.8, 30.0, 30.0, 40.0], [0.1, 0.12, 0.2, 1.0, 1.0, 1.0])
IMPLICIT = lm.GalerkinVariational(order=2)


def bent(elements=4, seed=0, section=SOFT, **given):
    """A rod that is bent, sheared and stretched, and a start at which it moves."""
    rod = CosseratRod(section, 1.0, elements, **{"ends": ("free", "free")} | given)
    mu = 0.1 * np.random.default_rng(seed).normal(size=(rod.frames, 6))
    mu[~rod.free.reshape(-1, 6)] = 0.0
    return rod, rod.state(mu=mu, g=rod.shape([0.3, 0.5, 0.2, 0.02, 0.0, 1.02]))


@pytest.mark.slow
def test_a_free_rod_keeps_its_momenta():
    rod, start = bent()
    for method in (lm.KickDrift(), IMPLICIT):
        run = lm.integrate(rod, method, start, h=0.005, steps=60, every=4, compiled=False)
        momenta = rod.total_momentum(run.mu, run.g)
        assert np.abs(momenta - momenta[0]).max() < 1e-14
        energy = [rod.energy(mu, g) for mu, g in zip(run.mu[[0, 7, -1]], run.g[[0, 7, -1]])]
        assert np.ptp(energy) < 5e-3 * energy[0]


HANGING = dict(ends=("clamped", "free"), gravity=1.0)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "method",
    [
        IMPLICIT,
        *[
            pytest.param(method, marks=pytest.mark.slow)
            for method in (lm.Composition(IMPLICIT, order=4), lm.KickDrift(order=4))
        ],
    ],
    ids=repr,
)
def test_orders_in_time(method):
    rod, start = bent(**HANGING)
    end = lm.integrate(rod, lm.KickDrift(), start, h=0.5 / 2**16, steps=2**16, every=2**16).g[-1]
    steps = (40, 80, 160) if method.order == 2 else (20, 40, 80)
    errors = [np.abs(lm.integrate(rod, method, start, h=0.5 / n, steps=n, every=n).g[-1] - end).max() for n in steps]
    assert slope([0.5 / n for n in steps], errors) == pytest.approx(method.order, abs=0.3)


CASES = {
    "free": {},
    "loads": dict(
        ends=("clamped", "free"), gravity=1.0, damping=0.3, tip_force=[0.1, 0.2, 0.1],
        tip_moment=[0.1, 0.2, 0.3], following=[0.1, 0.0, 0.2, 0.3, 0.1, 0.2],
    ),
    "hinged": dict(ends=("hinged", "clamped"), gravity=1.0),
    "closed": dict(closed=True),
    "adjoint": dict(retraction=lm.CayleyAdjoint()),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_all_frames_together_make_the_step_of_the_method(case, monkeypatch):
    """Newton's method along the chain solves the equations that fixed points solve, frame by frame."""
    rod, start = bent(3, **CASES[case])
    together = lm.integrate(rod, IMPLICIT, start, h=0.01, steps=3, compiled=False)
    monkeypatch.setattr(sites_plan, "chained_method", lambda plan: None)
    again = CosseratRod(SOFT, 1.0, 3, **{"ends": ("free", "free")} | CASES[case])
    alone = lm.Plan(again, IMPLICIT, h=0.01, compiled=False).run(start, steps=3)
    np.testing.assert_allclose(together.g, alone.g, atol=1e-14)
    np.testing.assert_allclose(together.mu, alone.mu, atol=1e-14)


@pytest.mark.slow
@pytest.mark.compiled
def test_native_steps_have_the_bits_of_plain_ones():
    rod, start = bent(3, **HANGING)
    for method in (IMPLICIT, lm.KickDrift()):
        runs = [lm.integrate(rod, method, start, h=0.01, steps=4, compiled=native) for native in (False, True)]
        assert [run.compiled for run in runs] == [False, True]
        assert np.array_equal(runs[0].g, runs[1].g) and np.array_equal(runs[0].mu, runs[1].mu)


@pytest.mark.slow
@pytest.mark.compiled
def test_a_stiff_rod_makes_long_steps_and_comes_back():
    """50 GPa: waves of stretch cross an element in 0.6 us; steps are a hundred times as long."""
    steel = RodSection.round(0.005, young=50e9, density=5000.0)
    rod = CosseratRod(steel, 1.0, 50, ends=("clamped", "free"), gravity=9.81)
    crossing = rod.length / rod.elements * np.sqrt(steel.inertia[5] / steel.stiffness[5])
    there = lm.integrate(rod, IMPLICIT, rod.at_rest(), h=100.0 * crossing, steps=500, every=50)
    energy = there.energy
    deepest = rod.energy(np.zeros((51, 6)), rod.equilibrium(stages=1)) - energy[0]
    assert np.ptp(energy) < 1e-4 * abs(deepest)
    back = lm.integrate(rod, IMPLICIT, there.last, h=-100.0 * crossing, steps=500, every=500)
    assert np.abs(back.g[-1] - there.g[0]).max() < 1e-9


def test_a_rod_at_rest_stays():
    rod = CosseratRod(SOFT, 1.0, 2)
    run = lm.integrate(rod, IMPLICIT, rod.at_rest(), h=0.1, steps=3)
    assert np.abs(run.g[-1] - run.g[0]).max() < 1e-15


@pytest.mark.slow
def test_a_rod_held_by_its_load_stays():
    rod = CosseratRod(SOFT, 1.0, 4, tip_force=[0.3, 0.0, 0.0], tip_moment=[0.2, 0.1, 0.1])
    g = rod.equilibrium()
    run = lm.integrate(rod, IMPLICIT, rod.at_rest(g), h=0.1, steps=3)
    assert np.abs(run.g[-1] - g).max() < 1e-12


@pytest.mark.slow
def test_hinged_and_clamped_ends_stay_where_they_are():
    rod, start = bent(3, ends=("hinged", "clamped"), gravity=1.0)
    for method in (IMPLICIT, lm.KickDrift()):
        end = lm.integrate(rod, method, start, h=0.02, steps=5, compiled=False).g[-1]
        assert np.array_equal(end[0, :3, 3], start.g[0, :3, 3])
        assert np.abs(end[0, :3, :3] - start.g[0, :3, :3]).max() > 1e-3
        assert np.array_equal(end[-1], start.g[-1])


@lm.record
class Spring(lm.Term):
    stiffness: float

    def energy(self, a, b):
        d = a.g[:3, 3] - b.g[:3, 3]
        return 0.25 * self.stiffness * (lm.dot(d, d) - 1.0) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("graph", [lm.neighbours.ring(3), lm.neighbours.chain(3)], ids=repr)
def test_terms_of_users_along_a_chain_are_solved_for_together(graph, monkeypatch):
    bodies = lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(lm.KineticEnergy([0.1, 0.2, 0.3, 1, 1, 1])))
    system = lm.MechanicalSystem(bodies, lm.Terms(Spring(lm.each(np.arange(1.0, len(graph.edges) + 1))).over(graph)))
    start = system.state(mu=0.1 * np.ones((3, 6)), g=lm.SE3().random(2, 3))
    plan = lm.Plan(system, IMPLICIT, h=0.02, compiled=False)
    assert plan._sites.chain is not None
    together = plan.run(start, steps=1)
    monkeypatch.setattr(sites_plan, "chained_method", lambda plan: None)
    alone = lm.Plan(system, IMPLICIT, h=0.02, compiled=False).run(start, steps=1)
    np.testing.assert_allclose(together.g, alone.g, atol=1e-13)


def test_too_long_a_step_names_the_site():
    rod, _ = bent(4)
    mu = np.zeros((5, 6))
    mu[3, :3] = 5.0
    start = rod.state(mu=mu, g=rod.shape())
    with pytest.raises(lm.errors.NoConvergence, match=r"site \d, step 1 of 2") as caught:
        lm.integrate(rod, IMPLICIT, start, h=5.0, steps=2)
    assert caught.value.site in range(5)
    assert len(caught.value.trajectory) == 1


@pytest.mark.slow
def test_a_run_goes_on_where_it_stood():
    rod, start = bent(3)
    whole = lm.integrate(rod, IMPLICIT, start, h=0.02, steps=4, compiled=False)
    half = lm.integrate(rod, IMPLICIT, start, h=0.02, steps=2, compiled=False)
    rest = lm.Plan(rod, IMPLICIT, h=0.02, compiled=False).resume(half, steps=2)
    assert np.array_equal(rest.g[-1], whole.g[-1])


@pytest.mark.parametrize("ring", [False, True], ids=["chain", "ring"])
@pytest.mark.parametrize("count", [3, 6])
def test_elimination_along_a_chain_and_a_ring_is_that_of_the_whole_matrix(count, ring):
    n, layout, rng = 3, work_of(3), np.random.default_rng(count)
    order = order_along(count, ring)
    work = columns(Planes.of_rows(layout.width + order.rows(n, count), count), work=layout).work.fields
    whole, right = np.zeros((count, n, count, n)), rng.normal(size=(count, n))
    for k in range(count):
        work.residual.put(k, vec(*right[k].tolist()))
        for slot, other in enumerate((k, k + 1, k - 1)):
            if ring or 0 <= other < count:
                block = rng.normal(size=(n, n)) + (4.0 * np.eye(n) if other == k else 0.0)
                put_block(work.blocks, BLOCKS * k + slot, mat(*[vec(*row) for row in block.tolist()]))
                whole[k, :, other % count] = block
    fill(order, work)
    factor(order, 1.0, work)
    substitute(order, work)
    exact = np.linalg.solve(whole.reshape(n * count, n * count), right.ravel())
    found = [work.solution.at(k) for k in range(count)]
    np.testing.assert_allclose(np.ravel(found), exact, rtol=1e-10, atol=1e-12)


def test_code_is_one_for_chains_of_all_lengths():
    assert layout_of(order_along(4, False)) == layout_of(order_along(60, False))
    assert layout_of(lm.joints.chain(4).linked.links) == layout_of(lm.joints.chain(60).linked.links)


def test_between_the_steps_of_a_run_with_events():
    """`run.at` gives what `t_eval` does: frames that were written out for events were taken for frames by site."""
    section = RodSection([1.0, 1.0, 1.0, 2.0, 2.0, 2.0], [0.3, 0.3, 0.5, 1.0, 1.0, 1.0])
    rod = CosseratRod(section, 0.5, 4, gravity=1.0)
    plan = lm.Plan(rod, lm.KickDrift(), h=0.05, compiled=False, events=lambda t, state: t - 0.07)
    start = rod.at_rest()
    between = plan.run(start, steps=2, t_eval=[0.06])
    assert np.array_equal(plan.run(start, steps=2).at(0.06).g.ravel(), between.g.ravel())


def test_the_strains_of_a_rod_are_recorded():
    """Of a bent rod without force, which rests as it is made; a run site by site knew no method of a rod."""
    bend = np.array([[0.2, 0.3, 0.1, 0.02, 0.0, 1.02], [0.1, -0.4, 0.0, 0.0, 0.01, 1.0]])
    rod = CosseratRod(SOFT, 1.0, 2, rest=bend)
    for method in (lm.KickDrift(), lm.RKMK(order=1)):
        run = lm.integrate(rod, method, rod.at_rest(), h=0.01, steps=1, record=["strains", "stresses"], compiled=False)
        np.testing.assert_allclose(run.strains, [bend, bend], rtol=1e-14, atol=1e-14)
        assert np.abs(run.stresses).max() < 1e-12
