"""Fields on a group in cells: closed forms, orders in time and in space, currents, and what is refused."""

import contextlib
import warnings

import numpy as np
import pytest

import liemech as lm
from liemech.checks.forms_of_sites import FormsOfSites
from liemech.checks.method_claims import MethodTrial
from liemech.errors import InvalidInput, InvalidType
from liemech.rooms.fields.cell import Cell
from liemech.rooms.fields.in_cells import FieldInCells
from liemech.rooms.sites.terms.terms import Site

CAYLEY = lm.Cayley()
LIE = lm.LieVerlet(CAYLEY)
CHIRAL = lm.FieldDensity(lm.KineticEnergy([1.0] * 3), lm.KineticEnergy([1.0] * 3))
INERTIA, STIFFNESS = [0.02, 0.03, 0.05, 1.0, 1.0, 1.0], [0.6, 0.5, 0.4, 8.0, 8.0, 20.0]
STRAIGHT = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
BEAM = lm.FieldDensity(lm.KineticEnergy(INERTIA), lm.StrainEnergy(STIFFNESS, STRAIGHT))
ONE = lm.KineticEnergy([1.0])
STRING = lm.FieldDensity(ONE, ONE)
LINE = lm.VectorSpace(1)


@lm.record
class Weight(lm.Potential):
    """1 - cos u: with it a string is the sine-Gordon field."""

    def energy(self, u):
        return 1.0 - lm.formulas.cos(u[0])


@lm.record
class Push(lm.Force):
    """A constant force."""

    size: float

    def covector(self, t, xi, g):
        return lm.vec(self.size)


def string(cells, length=1.0, **options):
    return lm.Field(LINE, STRING, length, cells, **options)


def turning(cells, in_space=False):
    """A chiral field that is closed to a ring, and a start; of a column that is periodic in time."""
    field = lm.Field(lm.SO3(), CHIRAL, 2.0 * np.pi, cells, closed=True, retraction=CAYLEY)
    field = field.column(2.0 * np.pi, cells, closed=True) if in_space else field
    s = field.arc
    x = 0.6 * np.stack([np.sin(s), 0.7 * np.cos(s), 0.5 * np.sin(2.0 * s + 0.3)], axis=-1)
    mu = 0.5 * np.stack([np.cos(s), np.sin(s) + 0.2, np.cos(2.0 * s)], axis=-1)
    return field, field.state(mu=field.parts[:, None] * mu, g=np.asarray(CAYLEY.tau(lm.SO3(), x)))


def flying(cells):
    """A free beam that turns and flies, with a bump of velocity that is flat at its ends."""
    beam = lm.Field(lm.SE3(), BEAM, 1.0, cells, retraction=CAYLEY)
    g, s = beam.shape(), beam.arc
    twist = np.tile([0.3, 0.2, 0.4, 0.1, -0.2, 0.3], (cells + 1, 1))
    rigid = np.asarray(lm.SE3().Ad(np.asarray(lm.SE3().inverse(g)), twist))
    bump = (4.0 * s * (1.0 - s))[:, None] ** 4 * [0.8, 0.5, 1.0, 0.3, 0.4, 0.1]
    return beam, beam.state(xi=rigid + bump, g=g)


# ---------------------------------------------------------------- numbers of an independent program


@pytest.mark.slow
def test_a_chiral_field_has_the_numbers_of_an_independent_program():
    field, start = turning(16)
    run = lm.integrate(field, LIE, start, h=0.2, steps=5, compiled=False)
    total = field.total_momentum(run.mu, run.g)
    np.testing.assert_allclose(total[-1], [-5.465888765002750e-04, 0.5633797213243470, 0.4152384580600816], atol=2e-15)
    assert np.abs(total - total[0]).max() < 1e-14
    first = [
        [0.934475747396551, -0.083685386041569, 0.346051778915716],
        [0.221680325582876, 0.897342565646717, -0.381620430700504],
        [-0.278590938074317, 0.433327908219216, 0.857096268327678],
    ]
    np.testing.assert_allclose(run.g[-1, 0], first, atol=1e-14)
    third = [-0.231691560828586, 0.200898933862169, -0.235635048713575]
    np.testing.assert_allclose(run.mu[-1, 3] / field.parts[3], third, atol=1e-14)
    body = run.mu.sum(axis=1)  # kept too, where the density does not feel turns of the body
    assert np.abs(body - body[0]).max() < 1e-14


@pytest.mark.slow
@pytest.mark.compiled
def test_a_free_beam_has_the_numbers_of_an_independent_program():
    beam, start = flying(8)
    run = lm.integrate(beam, LIE, start, h=0.5 / 96.0, steps=96)
    tip = [0.244687893343045, -0.161812457196284, 1.158095480142800]
    np.testing.assert_allclose(run.g[-1, -1, :3, 3], tip, atol=1e-13)
    mu = [
        0.003178917244504,
        0.012606148689605,
        0.052444900170110,
        0.312841395185943,
        -0.389715046805614,
        0.385183038561715,
    ]
    np.testing.assert_allclose(run.mu[-1, -1] / beam.parts[-1], mu, atol=1e-13)
    total = [
        0.132007385253906,
        0.190240150451660,
        0.040318984985352,
        0.321913909912109,
        -0.187448120117187,
        0.340637969970703,
    ]
    np.testing.assert_allclose(beam.total_momentum(run.mu, run.g)[-1], total, atol=1e-14)
    assert run.drift()["momentum"].verdict == "exact"


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("closed", [True, False], ids=["ring", "free ends"])
def test_standing_waves_have_the_frequency_of_the_cells_and_the_step(closed):
    """u = cos(k s) cos(w t) with sin(w h/2) = (h/D) sin(k D/2), to rounding; free ends have half a cell's mass."""
    line, h, k = string(12, 2.0 * np.pi, closed=closed), 0.4, 2.0 if closed else 1.5
    D = 2.0 * np.pi / 12
    w = 2.0 / h * np.arcsin(h / D * np.sin(0.5 * k * D))
    run = lm.integrate(line, lm.KickDrift(), line.at_rest(np.cos(k * line.arc)[:, None]), h=h, steps=20, compiled=False)
    np.testing.assert_allclose(run.g[..., 0], np.cos(w * run.t)[:, None] * np.cos(k * line.arc), atol=1e-13)


def test_cells_have_their_own_stiffness_and_rest():
    """One node between two springs: sin(w h/2) = h/2 sqrt((C_1 + C_2)/D^2); without force the strain is that at rest."""
    D, h, C, rest = 0.5, 0.2, np.array([[1.0], [3.0]]), np.array([[0.2], [-0.1]])
    line = lm.Field(LINE, lm.FieldDensity(ONE, lm.StrainEnergy(lm.each(C), lm.each(rest))), 1.0, 2, ends=("held",) * 2)
    assert line.largest_step == pytest.approx(D / np.sqrt(3.0)) and line.shape() == pytest.approx(
        np.array([[0.0], [0.1], [0.05]])
    )
    w, off = 2.0 / h * np.arcsin(0.5 * h * np.sqrt(C.sum()) / D), np.array([[0.0], [0.01], [0.0]])
    run = lm.integrate(line, lm.KickDrift(), line.at_rest(line.shape() + off), h=h, steps=20, compiled=False)
    np.testing.assert_allclose(run.g[:, 1, 0], 0.1 + 0.01 * np.cos(w * run.t), atol=1e-14)
    of_three = lm.FieldDensity(lm.KineticEnergy([1.0] * 3), lm.StrainEnergy([1.0] * 3, lm.each(0.1 * np.eye(3)[:2])))
    ring = lm.Field(lm.SO3(), of_three, 1.0, 2)
    np.testing.assert_allclose(ring.strains(ring.shape()), 0.1 * np.eye(3)[:2], atol=1e-15)


def test_an_energy_of_strain_is_its_own_legendre_transform():
    rng = np.random.default_rng(9)
    for C in ([1.0, 2.0, 3.0], [[2.0, 0.3, 0.0], [0.3, 1.0, 0.1], [0.0, 0.1, 1.5]]):
        phi, eta = lm.StrainEnergy(C, [0.1, -0.2, 0.3]), lm.Vec.of(rng.normal(size=3).tolist())
        lam = phi.momentum(eta)
        np.testing.assert_allclose(phi.gradient(lam), eta, atol=1e-14)
        assert phi.energy(lam) + phi.value(eta) == pytest.approx(lm.dot(lam, eta), abs=1e-13)
        np.testing.assert_allclose(lam, lm.gradient(phi.value, eta), atol=1e-14)


def test_travelling_waves_of_a_chiral_field_are_exact_where_a_wave_crosses_a_cell_in_a_step():
    """g_j+1,k+1 = g_jk for any shape of the wave: h = D/c."""
    field = lm.Field(lm.SO3(), CHIRAL, 3.0, 6, closed=True)
    group, wave = lm.SO3(), lm.SO3().random(np.random.default_rng(2), 6)
    wave = np.asarray(group.exp(0.3 * np.asarray(group.log(wave))))
    before, after = np.roll(wave, 1, axis=0), np.roll(wave, -1, axis=0)
    h = field.largest_step
    x, y = (
        np.asarray(group.log(np.asarray(group.compose(group.inverse(a), b))))
        for a, b in ((wave, before), (after, wave))
    )
    mu = field.parts[:, None] / h * 0.5 * (x + y)  # of the steps after and before, both as large as cells
    run = lm.integrate(field, lm.KickDrift(), field.state(mu=mu, g=wave), h=h, steps=6, compiled=False)
    for k in range(7):
        np.testing.assert_allclose(run.g[k], np.roll(wave, k, axis=0), atol=1e-13)


@pytest.mark.slow
@pytest.mark.compiled
def test_a_kink_of_the_sine_gordon_field_moves_as_in_closed_form():
    """u = 4 arctan exp(gamma (s - v t))."""
    v, errors = 0.5, []
    gamma = 1.0 / np.sqrt(1.0 - v * v)
    for cells in (100, 200, 400):
        line = string(cells, 40.0, acting=(Weight(),))
        s = line.arc - 15.0
        start = line.state(
            xi=(-2.0 * v * gamma / np.cosh(gamma * s))[:, None], g=4.0 * np.arctan(np.exp(gamma * s))[:, None]
        )
        steps = round(10.0 / (0.5 * line.largest_step))
        run = lm.integrate(line, lm.KickDrift(), start, h=10.0 / steps, steps=steps, every=steps)
        errors.append(np.abs(run.g[-1, :, 0] - 4.0 * np.arctan(np.exp(gamma * (s - 10.0 * v)))).max())
    np.testing.assert_allclose(np.diff(np.log2(errors)), -2.0, atol=0.1)


def test_a_loaded_end_pulls_the_line_along_and_a_held_one_holds_it():
    pulled = string(4, ends=("free", Push(0.5)))
    run = lm.integrate(pulled, lm.KickDrift(), pulled.at_rest(), h=0.1, steps=8, compiled=False)
    np.testing.assert_allclose(run.mu.sum(axis=1)[:, 0], 0.5 * run.t, atol=1e-14)
    held = string(4, ends=("held", Push(0.5)))
    still = held.at_rest(held.shape([0.5]))  # C u = F
    run = lm.integrate(held, lm.KickDrift(), still, h=0.1, steps=8, compiled=False)
    np.testing.assert_allclose(run.g[-1], still.g, atol=1e-15)
    hung = string(4, ends=(Weight(), "free"))
    assert hung.energy(np.zeros((5, 1)), np.full((5, 1), 0.3)) == pytest.approx(1.0 - np.cos(0.3))
    assert np.asarray(hung.force(np.full((5, 1), 0.3))).ravel()[0] == pytest.approx(-np.sin(0.3))


# ---------------------------------------------------------------- orders, in time and in space


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("in_space", [False, True], ids=["time", "space"])
def test_orders_of_cells_and_steps_together(in_space):
    ends = []
    for cells in (16, 32, 64, 256):
        field, start = turning(cells, in_space)
        steps = max(1, round(1.0 / (np.pi / cells)))
        run = lm.integrate(field, LIE, start, h=1.0 / steps, steps=steps, every=steps)
        ends.append(run.g[-1][:: cells // 16])
        total = field.total_momentum(run.mu, run.g)
        assert np.abs(total - total[0]).max() < 1e-13
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    np.testing.assert_allclose(np.diff(np.log2(errors)), -2.0, atol=0.15)


@pytest.mark.slow
@pytest.mark.compiled
def test_a_free_beam_is_of_order_two():
    ends = []
    for cells in (16, 32, 64, 256):
        beam, start = flying(cells)
        ends.append(
            lm.integrate(beam, LIE, start, h=1.0 / 24.0 / cells, steps=12 * cells, every=12 * cells).g[
                -1, :: cells // 16
            ]
        )
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    np.testing.assert_allclose(np.diff(np.log2(errors)), -2.1, atol=0.2)


def ended(cells, fades):
    """A line of rotations with free ends whose strain rate fades there, or does not."""
    line = lm.Field(lm.SO3(), CHIRAL, np.pi, cells)
    s = line.arc[:, None]
    xi = np.cos([1, 2, 1] * s) if fades else np.sin([1, 2, 1] * s)
    return line, line.state(xi=[0.6, 0.5, 0.4] * xi, g=np.broadcast_to(np.eye(3), (cells + 1, 3, 3)).copy())


@pytest.mark.slow
def test_a_start_that_a_free_end_does_not_allow_costs_the_order_and_says_so():
    """Where eta_t is not zero at a free end a front comes from there: order one behind it; where it fades, order two."""
    orders = []
    for fades in (True, False):
        ends = []
        for cells in (16, 32, 64, 256):
            with (
                contextlib.nullcontext()
                if fades
                else pytest.warns(lm.errors.OrderWarning, match="the first node is free")
            ):
                line, start = ended(cells, fades)
            run = lm.integrate(line, LIE, start, h=0.5 * np.pi / cells, steps=cells, every=cells)
            ends.append(run.g[-1][:: cells // 16])
        errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
        orders.append(np.diff(-np.log2(errors)))
    assert (orders[0] > 1.85).all() and orders[1][-1] < 1.4


def test_a_force_at_a_free_end_is_told_and_rigid_motion_and_rounding_are_not():
    beam = lm.Field(lm.SE3(), lm.FieldDensity(lm.KineticEnergy(INERTIA), lm.StrainEnergy(INERTIA, STRAIGHT)), 1.0, 8)
    with pytest.warns(
        lm.errors.OrderWarning, match=r"the first node is free, and the force is not zero there: it has 1 of"
    ):
        beam.at_rest(beam.shape([0.0, 0.5, 0.0, 0.0, 0.0, 1.0]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for start in (None, np.array(lm.SE3().exp(lm.vec(0.3, -0.2, 0.5, 1.0, 2.0, 3.0)))):
            g = beam.shape(start=start)
            turned = [lm.SE3().Ad(lm.SE3().inverse(x), lm.vec(0.3, 0.2, 0.4, 0.1, -0.2, 0.3)) for x in g]
            beam.state(xi=np.array(turned), g=g)  # as a rigid body
        held = lm.Field(lm.SE3(), beam.density, 1.0, 8, ends=("held", "held"))
        held.at_rest(held.shape([0.0, 0.5, 0.0, 0.0, 0.0, 1.0]))


@pytest.mark.slow
def test_marching_in_space_finds_the_field_that_marched_in_time():
    """Inside the domain of dependence, which loses one node at each end a column."""
    M = np.array(INERTIA)
    density = lm.FieldDensity(lm.KineticEnergy(M), lm.StrainEnergy(4.0 * M, STRAIGHT))
    beam = lm.Field(lm.SE3(), density, 1.0, 8, retraction=CAYLEY)
    bump = (4.0 * beam.arc * (1.0 - beam.arc))[:, None] ** 4
    start = beam.state(xi=bump * [0.8, 0.5, 1.0, 0.3, 0.4, 0.1], g=beam.shape())
    run = lm.integrate(beam, LIE, start, h=0.05, steps=24, compiled=False)
    column = beam.column(1.2, 24)
    assert column.largest_step == pytest.approx(2.0 * 0.05) and beam.largest_step == pytest.approx(0.125 / 2.0)
    with pytest.warns(lm.errors.StepWarning):  # noise at the ends of the column grows, and does not come in
        along = lm.integrate(column, LIE, column.at_rest(run.g[:, 0]), h=0.125, steps=4, compiled=False)
    for j in range(1, 5):
        assert np.abs(along.g[j, j : 25 - j] - run.g[j : 25 - j, j]).max() < 1e-12
    assert np.abs(run.g[-1] - run.g[0]).max() > 0.1


@pytest.mark.slow
def test_a_kink_that_stands_is_marched_along_as_a_pendulum():
    """u_ss = sin u from u = pi with u_s = 2: u = 4 arctan exp(s)."""
    errors = []
    for steps in (20, 40):
        column = string(2, acting=(Weight(),)).column(1.0, 3, closed=True)
        u = np.full((3, 1), np.pi)
        start = column.state(mu=2.0 * column.parts[:, None], g=u)
        run = lm.integrate(column, lm.KickDrift(), start, h=1.0 / steps, steps=steps, compiled=False)
        errors.append(np.abs(run.g[-1] - 4.0 * np.arctan(np.e)).max())
    assert errors[0] < 1e-2 and errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


# ---------------------------------------------------------------- currents and the multisymplectic law


def test_momentum_and_energy_flow_with_a_wave():
    """u = f(s - t): the currents are the densities of momentum, u_t = -f', and energy, f'^2, times the speed one."""
    ring = string(400, 2.0 * np.pi, closed=True)
    middle = ring.arc + 0.5 * ring.parts[0]
    xi, g = -np.cos(ring.arc)[:, None], np.sin(ring.arc)[:, None]
    np.testing.assert_allclose(ring.currents(g)[:, 0], -np.cos(middle), atol=1e-4)
    flow = ring.energy_currents(ring.parts[:, None] * xi, g)
    np.testing.assert_allclose(flow, np.cos(middle) ** 2, atol=1e-4)


@pytest.mark.slow
def test_nodes_change_by_what_flows_through_cells():
    """Momentum to rounding, energy to second order; a held node is no part of it."""
    energies = []
    for steps in (30, 60):
        beam = lm.Field(lm.SE3(), BEAM, 1.0, 4, ends=("held", "free"))
        g = beam.shape([0.3, 0.5, 0.2, 0.02, 0.0, 1.02])
        run = lm.integrate(beam, lm.KickDrift(), beam.at_rest(g), h=0.6 / steps, steps=steps, compiled=False)
        balance = beam.balance(run)
        assert balance["momentum of nodes"].verdict == "exact"
        energies.append(balance["energy of nodes"].largest)
    assert energies[0] / energies[1] == pytest.approx(4.0, rel=0.2)
    total = beam.total_momentum(run.mu, run.g)[-1]  # what the wall has given
    np.testing.assert_allclose(total, np.trapezoid(beam.currents(run.g)[:, 0], run.t, axis=0), atol=1e-14)
    assert np.abs(total).max() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("group", [lm.SL(2), lm.SU(2), lm.SE2()], ids=repr)
def test_currents_on_other_groups(group):
    rng, three = np.random.default_rng(6), lm.KineticEnergy([1.0, 1.5, 0.8])
    field = lm.Field(
        group, lm.FieldDensity(three, lm.StrainEnergy([2.0, 1.0, 1.5], [0.1, 0.2, 0.3])), 1.0, 3, closed=True
    )
    start = field.state(xi=0.3 * rng.normal(size=(3, 3)), g=field.shape(0.5 * rng.normal(size=(3, 3))))
    run = lm.integrate(field, lm.LieVerlet(), start, h=0.05, steps=4, compiled=False)
    assert field.balance(run)["momentum of nodes"].verdict == "exact"
    assert np.abs(field.currents(run.g)).max() > 0.1


@pytest.mark.parametrize("tau", [lm.Exponential(), CAYLEY], ids=repr)
@pytest.mark.parametrize("group", [lm.SO3(), lm.SE2(), lm.SE3(), LINE], ids=repr)
def test_forces_and_stiffnesses_of_cells_are_those_of_the_energy(group, tau):
    rng, dim = np.random.default_rng(8), group.dim
    cell = Cell(group, lm.StrainEnergy(np.diag(rng.uniform(1.0, 2.0, dim)) + 0.1, rng.normal(size=dim)), 0.7, tau)
    g = [lm.formulas.vectors.small(np.asarray(group.exp(0.7 * rng.normal(size=dim)))) for _ in "ab"]
    ends = [Site(g=x) for x in g]
    for ours, derived in (
        (cell.forces(group, *ends), [lm.Term.force(cell, group, k, *ends) for k in range(2)]),
        (cell.stiffnesses(group, *ends), lm.Term.stiffnesses(cell, group, *ends)),
    ):
        np.testing.assert_allclose(np.array(ours), np.array(derived), rtol=1e-10, atol=1e-12)


@lm.record
class UnevenKicks(lm.KickDrift):
    """Symplectic, with kicks that are not halves: no discrete field equation at the nodes."""

    def step(self, system, t, memory, h):
        state = type(memory.state)(memory.state.mu - 0.1 * h * memory.node, memory.state.g)
        after = super().step(system, t, type(memory)(state, memory.node, memory.past), h)
        state = type(after.state)(after.state.mu + 0.1 * h * after.node, after.state.g)
        return type(after)(state, after.node, after.past)


@pytest.mark.slow
@pytest.mark.parametrize("end", ["free", "held"])
def test_the_two_form_of_every_node_changes_by_what_flows_to_it(end):
    density = lm.FieldDensity(lm.KineticEnergy([1.0, 1.5, 2.0]), lm.KineticEnergy([1.0, 2.0, 0.8]))
    field, rng = lm.Field(lm.SO3(), density, 1.0, 2, ends=(end, "free")), np.random.default_rng(4)
    xi = rng.normal(size=(3, 3)) * [[end == "free"], [True], [True]]
    start = field._written_out(field.state(xi=xi, g=field.shape(0.5 * rng.normal(size=(2, 3)))))
    defects = []
    for method in (lm.KickDrift(), UnevenKicks()):
        trial = MethodTrial(method, field, start, 0.1, False)
        trial.__dict__["journey"] = (0.1, None, None)
        defects.append(FormsOfSites(field, start, True).defect(trial, 0.01))
    assert defects[0] < 1e-12 and defects[1] > 1e-4


# ---------------------------------------------------------------- steps


@pytest.mark.slow
def test_a_twisted_ribbon_is_a_helicoid_and_stays_one():
    """Ten times as stiff one way as the other, with a rest twist k: edges b(cos ks, sin ks, s/b), without force."""
    k, b = 3.0, 0.2
    energy = lm.StrainEnergy([0.5, 0.05, 0.03, 80.0, 80.0, 200.0], [0.0, 0.0, k, 0.0, 0.0, 1.0])
    ribbon = lm.Field(
        lm.SE3(), lm.FieldDensity(lm.KineticEnergy([0.013, 0.002, 0.015, 1.0, 1.0, 1.0]), energy), 2.0, 16
    )
    g, s = ribbon.shape(), ribbon.arc
    for side in (1.0, -1.0):
        edge = g[:, :3, :3] @ [side * b, 0.0, 0.0] + g[:, :3, 3]
        helix = np.stack([side * b * np.cos(k * s), side * b * np.sin(k * s), s], axis=1)
        np.testing.assert_allclose(edge, helix, atol=1e-14)
    assert np.abs(ribbon.stresses(g)).max() < 1e-12
    run = lm.integrate(ribbon, lm.KickDrift(), ribbon.at_rest(), h=0.5 * ribbon.largest_step, steps=20, compiled=False)
    assert np.abs(run.g[-1] - g).max() < 1e-12


@pytest.mark.slow
def test_steps_are_stable_up_to_the_largest_and_a_warning_says_so_before():
    field = lm.Field(lm.SO3(), CHIRAL, 1.0, 8, closed=True)
    start = field.state(mu=1e-6 * np.random.default_rng(1).normal(size=(8, 3)), g=field.shape())
    stable = lm.integrate(field, lm.KickDrift(), start, h=0.99 / 8.0, steps=30, compiled=False)
    with pytest.warns(lm.errors.StepWarning, match=r"h = 0.1375 is longer than 0.125, in which the fastest wave"):
        unstable = lm.integrate(field, lm.KickDrift(), start, h=1.1 / 8.0, steps=30, compiled=False)
    growth = [np.abs(run.mu[-1]).max() / np.abs(start.mu).max() for run in (stable, unstable)]
    assert growth[0] < 10.0 and growth[1] > 1e4


def test_speeds_are_those_of_bending_shear_and_stretch():
    beam = lm.Field(lm.SE3(), BEAM, 1.0, 8)
    np.testing.assert_allclose(beam.speeds[[0, -1]], [np.sqrt(8.0), np.sqrt(30.0)])
    np.testing.assert_allclose(beam.column(1.0, 4).speeds, 1.0 / beam.speeds[::-1])
    assert lm.Field(LINE, lm.FieldDensity(ONE, lm.StrainEnergy([-1.0], [0.0])), 1.0, 3).largest_step == np.inf


# ---------------------------------------------------------------- densities of one's own


@lm.record
class Stiffening(lm.Lagrangian):
    """Phi = eta^2/2 + eta^4/4."""

    def value(self, eta):
        return 0.5 * eta[0] ** 2 + 0.25 * eta[0] ** 4


@pytest.mark.slow
def test_an_energy_of_ones_own():
    density = lm.FieldDensity(ONE, Stiffening())
    line = lm.Field(LINE, density, 1.0, 3)
    assert density.value(lm.vec(0.6), lm.vec(0.4)) == pytest.approx(0.08 - 0.18 - 0.25 * 0.6**4)
    g = line.shape([[0.6], [-0.2], [0.3]])
    start = line.state(xi=np.array([[0.4], [0.1], [-0.3], [0.2]]), g=g)
    np.testing.assert_allclose(line.stresses(g)[:, 0], [u + u**3 for u in (0.6, -0.2, 0.3)])
    lm.check_system(line, start)
    run = lm.integrate(line, lm.KickDrift(), start, h=0.01, steps=50, compiled=False)
    assert line.balance(run)["momentum of nodes"].verdict == "exact"
    assert np.ptp(run.energy) < 1e-3


# ---------------------------------------------------------------- rods are fields


def test_a_rod_is_a_field():
    section = lm.models.RodSection(STIFFNESS, INERTIA)
    rod = lm.models.CosseratRod(section, 1.0, 3, ends=("clamped", "free"))
    field = lm.Field(lm.SE3(), BEAM, 1.0, 3, ends=("held", "free"))
    assert isinstance(rod, FieldInCells) and rod.largest_step == field.largest_step
    g = field.shape([0.3, 0.5, 0.2, 0.02, 0.0, 1.02])
    np.testing.assert_allclose(rod.force(g), field.force(g), atol=1e-14)
    np.testing.assert_allclose(rod.currents(g), field.currents(g), atol=1e-14)
    mu = np.random.default_rng(3).normal(size=(4, 6))
    assert rod.energy(mu, g) == pytest.approx(field.energy(mu, g), rel=1e-14)
    np.testing.assert_allclose(rod.energy_currents(mu, g), field.energy_currents(mu, g), atol=1e-13)


# ---------------------------------------------------------------- what is refused


def moving(line, **options):
    """Two steps of a line."""
    start = line.at_rest(0.1 * line.arc[:, None] ** 2)
    return lm.integrate(line, lm.KickDrift(), start, h=0.2, steps=2, compiled=False, **options)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: string(0), "cells must be a whole number from 1 on; got 0"),
        (lambda: string(2, closed=True), "from 3 on; got 2"),
        (lambda: lm.Field(lm.SO3(), STRING, 1.0, 4), "takes vectors of 1 components"),
        (lambda: string(3, -1.0), "length must be positive and finite; got -1.0"),
        (lambda: string(3, ends=("held",)), "ends are two"),
        (lambda: string(3, ends=("held", "loose")), 'ends are two, each "free", "held", a Potential or a Force'),
        (lambda: string(3, closed=True, ends=("held", "held")), "a closed line has no ends; got .'held', 'held'"),
        (lambda: string(3).balance(moving(string(3), t_eval=[0.0, 0.05, 0.3])), "every step of one run"),
        (lambda: lm.FieldDensity(Stiffening(), ONE), "kinetic is quadratic"),
        (lambda: lm.StrainEnergy([1.0, 2.0], [0.0]), "stiffness is of 2 components, rest of 1"),
        (lambda: lm.StrainEnergy([1.0], [np.nan]), "StrainEnergy: rest"),
        (lambda: string(3, acting=(Push(1.0),)).column(1.0, 4), "has no potential"),
        (lambda: string(3).shape([1.0, 2.0]), r"u is \(1,\) or \(3, 1\)"),
        (lambda: string(3, acting=(Weight(),)).balance(None), "more than the cells acts on nodes"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(make, says):
    with pytest.raises(InvalidInput, match=says):
        make()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: lm.Field(3.0, STRING, 1.0, 4), "target must be"),
        (lambda: lm.Field(LINE, ONE, 1.0, 4), "density must be"),
        (lambda: lm.FieldDensity(ONE, 1.0), "stored must be"),
        (lambda: string(3, acting=(1.0,)), "acting must be Potentials and Forces"),
        (lambda: string(3, acting=Weight()), "acting must be a tuple"),
        (lambda: string(3, ends="held"), "ends must be a tuple"),
        (lambda: string(3, closed="no"), "closed must be True or False"),
        (lambda: type("Mixed", (lm.FieldDensity,), {"value": lambda self, eta, xi: 0.0})(ONE, ONE), "replaces .*value"),
    ],
)  # fmt: skip
def test_what_is_no_field_is_said(make, says):
    with pytest.raises(InvalidType, match=says):
        make()
