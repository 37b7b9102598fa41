"""What the pictures of runs show is the mathematics, and every system of the library has one."""

from __future__ import annotations

import math
import subprocess
import sys
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scenes import (
    Driven,
    SteeredFromSpace,
    falling_body,
    heavy_top,
    kirchhoff_body,
    lagrange_top,
    orbiting_body,
    seed_body,
)
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech import plots
from liemech.models import poses
from liemech.plots.invariants import EPSILON, changes, noise
from liemech.plots.spheres.projection import VIEW, view_frame
from liemech.plots.vertical import verticals

pytest.importorskip("matplotlib")

BODY, START = lm.RigidBody([1.0, 1.5, 2.0]), ([0.5, 0.0, 0.75**0.5], np.eye(3))


def follow(system: Any, start: Any, method: Any = None, h: float = 0.1, steps: int = 12, **more: Any) -> Any:
    return lm.integrate(
        system, method or lm.RKMK(order=4), start, h=h, steps=steps, compiled=False, progress=False, **more
    )


@pytest.fixture(scope="module")
def run() -> Any:
    """A tumbling body and its attitude."""
    return follow(BODY, BODY.state(*START), lm.RKMK(order=8), h=0.25, steps=80)


# ---------------------------------------------------------------- a picture for every system

UNITS = [np.array(lm.SO3().random(seed)) for seed in (1, 2, 3)]
TOP, ORBIT, FALL = lagrange_top(), orbiting_body(), falling_body()
FLUID, FLUID_START, _ = kirchhoff_body()
PENDULUM, DOUBLE, PLANET, STARS = (
    lm.models.Pendulum(),
    lm.models.DoublePendulum(),
    lm.Kepler(),
    lm.models.HenonHeiles(),
)
SO4 = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
QUATERNIONS = lm.LiePoissonSystem(lm.UnitQuaternions(), lm.KineticEnergy([1.0, 1.5, 2.0]))
PLANE = lm.LiePoissonSystem(lm.SE2(), lm.KineticEnergy([1.0, 1.5, 2.0]))


@lm.record
class Turning(lm.HomogeneousEquation):
    """x turns about a fixed axis."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return lm.vec(0.3, 0.4, 1.0)


SYSTEMS: dict[str, tuple[Any, Any]] = {
    "body": (BODY, BODY.state(*START)),
    "body, momentum only": (BODY, BODY.state(START[0])),
    "body at rest": (BODY, BODY.state([0.0, 0.0, 0.0], np.eye(3))),
    "bodies": (BODY, BODY.state(mu=[[0.5, 0.0, 0.8], [0.0, 2.0, 0.1], [0.1, 0.2, 0.3]])),
    "bodies with attitudes": (
        BODY,
        BODY.state(mu=[[0.5, 0.0, 0.8], [0.0, 2.0, 0.1], [0.1, 0.2, 0.3]], g=np.array(UNITS)),
    ),
    "quaternion body": (QUATERNIONS, QUATERNIONS.state(START[0], [0.0, 0.0, 0.0, 1.0])),
    "heavy top": heavy_top(),
    "Lagrange top": TOP,
    "top on se(3)*": (TOP[0].reduced, TOP[0].reduced.from_top(TOP[1])),
    "top on se(3)*, momentum only": (TOP[0].reduced, TOP[0].reduced.state(TOP[0].reduced.from_top(TOP[1]).mu)),
    "tops": (TOP[0], TOP[0].state([[0.1, 0.2, 1.0]] * 3, np.array(UNITS))),
    "Kirchhoff": (FLUID, FLUID_START),
    "Kirchhoff, momentum only": (FLUID, FLUID.state(FLUID_START.mu)),
    "falling body": FALL,
    "satellite": ORBIT,
    "pendulum": (PENDULUM, PENDULUM.state(1.0, 0.0)),
    "pendulums": (PENDULUM, PENDULUM.state([[1.0], [3.0]], [[0.0], [9.0]])),
    "double pendulum": (DOUBLE, DOUBLE.state([1.0, -0.5], [0.0, 0.0])),
    "Kepler": (PLANET, PLANET.pericentre(0.6)),
    "planets": (PLANET, PLANET.state([[1.0, 0.0], [0.0, 1.5]], [[0.0, 1.0], [-0.8, 0.0]])),
    "stars": (STARS, STARS.state([0.1, 0.2], [0.1, 0.0])),
    "body in four dimensions": (SO4, SO4.state([0.6, -0.3, 0.5, 0.4, 0.2, -0.7])),
    "body in the plane": (PLANE, PLANE.state([0.6, -0.3, 0.5], np.eye(3))),
    "equation on rotations": (Driven(lm.SO3()), Driven(lm.SO3()).state(np.eye(3))),
    "equation on matrices": (Driven(lm.Heisenberg()), Driven(lm.Heisenberg()).state(np.eye(3))),
    "equations on rotations": (SteeredFromSpace(lm.SO3()), SteeredFromSpace(lm.SO3()).state(np.array(UNITS))),
    "point on a sphere": (
        Turning(lm.actions.SphereAction(3)),
        Turning(lm.actions.SphereAction(3)).state([0.6, 0.0, 0.8]),
    ),
}


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", SYSTEMS)
def test_every_system_has_a_picture_that_draws_something_finite(name: str) -> None:
    ax = follow(*SYSTEMS[name]).plot()
    points = np.vstack([np.asarray(line.get_xydata()) for line in ax.lines] + [c.get_offsets() for c in ax.collections])
    assert np.isfinite(points).all(axis=1).any()
    ax.figure.draw_without_rendering()
    assert ax.title.get_text() == ""


def test_two_species_are_drawn_in_their_plane() -> None:
    species = lm.models.LotkaVolterra()
    run = follow(species, species.state(y=[1.0, 4.0]), lm.Splitting())
    ax = run.plot()
    assert (np.asarray(ax.lines[0].get_xydata()) == run.y).all()
    assert (np.asarray(ax.lines[-1].get_xydata()) == run.y[:1]).all()


def test_ideal_flow_is_drawn_by_its_vorticity_at_the_end() -> None:
    sphere = lm.models.ZeitlinSphere(13)
    run = follow(sphere, sphere.state(mu=np.random.default_rng(3).normal(size=168)), h=0.01, steps=2)
    (image,) = run.plot().images
    shown, (azimuth, elevation) = np.asarray(image.get_array()), np.radians(VIEW)
    middle = sphere.vorticity(run.mu[-1], [elevation], [azimuth])[0, 0]
    rows = len(shown) // 2
    assert shown[rows - 1 : rows + 1, rows - 1 : rows + 1].mean() == pytest.approx(middle, rel=0.01)


def test_the_arms_of_a_linkage_lead_to_its_joints() -> None:
    rods, poses = lm.joints.chain(2), np.tile(np.eye(4), (2, 1, 1))
    poses[0, :3, :3] = lm.SO3().exp([0.7, 0.2, 0.0])
    poses[0, :3, 3] = -0.5 * poses[0, :3, 2]
    poses[1, :3, 3] = 2.0 * poses[0, :3, 3] - 0.5 * poses[1, :3, 2]
    run = follow(rods, rods.assembled(poses), lm.LieRATTLE(), h=0.01, steps=3)
    upper, lower = rods.poses(run.g)[-1]
    hinge, tip = upper[:3, 3] - 0.5 * upper[:3, 2], lower[:3, 3]
    wanted = [(upper[:3, 3], np.zeros(3)), (upper[:3, 3], hinge), (tip, hinge)]
    lines = [np.asarray(line.get_xydata()) for line in run.plot().lines]
    for ends in wanted:
        shown = np.array(ends) @ view_frame(*VIEW)[:2].T
        assert any(line.shape == (2, 2) and np.abs(line - shown).max() < 1e-9 for line in lines), ends


def test_one_sample_or_a_foreign_thing() -> None:
    assert follow(*SYSTEMS["heavy top"], steps=0).plot().lines
    with pytest.raises(lm.errors.InvalidType, match="integrate"):
        plots.plot([1, 2, 3])
    with pytest.raises(lm.errors.InvalidType, match="integrate"):
        plots.drift({"a": 3})


@pytest.mark.slow
def test_pictures_draw_on_given_axes_and_leave_settings_alone(run: Any) -> None:
    import matplotlib
    from matplotlib.figure import Figure

    before = matplotlib.rcParams.copy()
    pendulum = follow(*SYSTEMS["pendulum"])
    for draw in (
        *(lambda ax, f=f: f(run, ax=ax) for f in (plots.plot, plots.invariants, plots.drift, plots.components)),
        *(
            lambda ax, f=f: f(run, ax=ax)
            for f in (plots.euler_angles, plots.quaternion, plots.polhode, plots.herpolhode)
        ),
        lambda ax: plots.vertical(run, ax=ax),
        lambda ax: plots.path(pendulum, ax=ax),
        lambda ax: plots.phase_portrait(pendulum, ax=ax),
        lambda ax: plots.poincare_section(follow(PLANET, PLANET.pericentre(0.3), steps=150), ax=ax),
        lambda ax: plots.orders([0.1, 0.2], {"a": [1.0, 4.0]}, ax=ax),
        lambda ax: plots.work_precision({"a": ([1.0, 0.1], [1.0, 2.0])}, ax=ax),
        lambda ax: plots.cloud(follow(*SYSTEMS["bodies"]), ax=ax),
    ):
        ax = Figure().add_subplot()
        assert draw(ax) is ax
    assert before == matplotlib.rcParams


@pytest.mark.slow
def test_pictures_need_neither_pyplot_nor_settings() -> None:
    code = """
import sys, liemech as lm
body = lm.RigidBody([1.0, 1.5, 2.0])
run = lm.integrate(body, lm.RKMK(order=4), body.state([1.0, 2.0, 3.0]), h=0.1, steps=3, compiled=False)
assert "matplotlib" not in sys.modules
run.plot()
assert "matplotlib" in sys.modules and "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


# ---------------------------------------------------------------- invariants


def test_the_change_of_an_invariant_is_that_of_the_drift_report(run: Any) -> None:
    for name in ("energy", "Casimir 1", "spatial momentum"):
        assert changes(run, name)[1:].max() == pytest.approx(max(run.drift()[name].largest, 0.1 * EPSILON), rel=1e-12)
    assert noise(run)[0] == EPSILON
    assert noise(run)[-1] == pytest.approx(EPSILON * 9.0)  # a walk of 80 steps, and the start


@pytest.mark.slow
def test_bounded_errors_are_flat_and_drifts_have_slope_one() -> None:
    methods = {"RKMK4": lm.RKMK(order=4), "Algorithm 1": lm.CovariantVariational(lm.Cayley())}
    runs = {name: follow(BODY, BODY.state(START[0]), method, h=1.0, steps=500) for name, method in methods.items()}
    ax = plots.drift(runs)
    slopes = {}
    for line in ax.lines[::2]:
        t, change = np.asarray(line.get_xydata()).T
        late = t > 100.0
        slopes[line.get_label()] = np.polyfit(np.log(t[late]), np.log(change[late]), 1)[0]
    assert slopes["RKMK4"] == pytest.approx(1.0, abs=0.1)
    assert abs(slopes["Algorithm 1"]) < 0.02


def test_unknown_constants_are_refused(run: Any) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"'mass' is no constant.*energy, Casimir 1, spatial momentum"):
        plots.invariants(run, ["mass"])
    with pytest.raises(lm.errors.InvalidInput, match="no constants"):
        plots.invariants(follow(*SYSTEMS["equation on rotations"]))


# ---------------------------------------------------------------- orders


def test_the_order_is_the_slope_above_the_floor() -> None:
    h = 2.0 ** -np.arange(8.0)
    for p in (1, 2, 4, 6):
        assert plots.order_of(h, 3.0 * h**p) == pytest.approx(p, abs=1e-12)
        floor = np.maximum(h**p, 1e-9 * (1.0 + 0.3 * np.cos(np.arange(8))))
        assert plots.order_of(h[::-1], floor[::-1]) == pytest.approx(p, abs=0.35)
    assert plots.order_of([0.1, 0.2], [0.0, 1.0]) is None
    ax = plots.orders(h, {"two": h**2, "none": np.full(8, np.nan)})
    assert ax.get_legend_handles_labels()[1] == ["two: order 2.00", "none"]


def test_the_measured_order_of_a_method_stands_in_the_legend() -> None:
    start, errors, steps = BODY.state(START[0]), [], 2.0 ** -np.arange(1, 6)
    exact = BODY.exact(start, 4.0).mu
    for h in steps:
        errors.append(np.abs(follow(BODY, start, h=h, steps=round(4 / h)).mu[-1] - exact).max())
    (label,) = plots.orders(steps, {"RKMK4": errors}).get_legend_handles_labels()[1]
    assert float(label.rpartition(" ")[2]) == pytest.approx(4.0, abs=0.15)


def test_impossible_errors_are_refused() -> None:
    with pytest.raises(lm.errors.InvalidInput, match="positive"):
        plots.orders([0.1, -0.2], {"a": [1.0, 2.0]})
    with pytest.raises(lm.errors.InvalidInput, match=r"wanted is \(2,\)"):
        plots.work_precision({"a": ([1.0, 2.0], [1.0])})


# ---------------------------------------------------------------- attitude


def test_euler_angles_and_quaternions_are_those_of_the_attitude(run: Any) -> None:
    lines = plots.euler_angles(run).lines
    phi, theta, psi = (np.radians(y[np.isfinite(y)]) for y in (np.asarray(line.get_ydata()) for line in lines))
    g = [
        lm.SO3().exp([0, 0, a]) @ lm.SO3().exp([b, 0, 0]) @ lm.SO3().exp([0, 0, c]) for a, b, c in zip(phi, theta, psi)
    ]
    # a square root of rounding at the start, where theta is zero
    assert np.abs(np.array(g) - run.g).max() < 1e-7
    x, y, z, w = (np.asarray(line.get_ydata()) for line in plots.quaternion(run).lines)
    # no jump of sign
    assert np.abs(np.array([x, y, z, w])[:, 1:] - np.array([x, y, z, w])[:, :-1]).max() < 0.2
    from scipy.spatial.transform import Rotation

    assert np.abs(Rotation.from_quat(np.array([x, y, z, w]).T).as_matrix() - run.g).max() < 1e-14
    with pytest.raises(lm.errors.InvalidInput, match="ZZ"):
        plots.euler_angles(run, "ZZX")
    with pytest.raises(lm.errors.InvalidInput, match="attitude"):
        plots.quaternion(follow(*SYSTEMS["body, momentum only"]))


def test_the_herpolhode_lies_at_the_distance_that_the_energy_leaves(run: Any) -> None:
    # |w|^2 is what lies along the momentum, (2 H/|mu|)^2, and what lies across it
    w = BODY.velocity(run.mu)
    along = 2.0 * run.energy / np.linalg.norm(run.mu, axis=1)
    across = np.linalg.norm(plots.herpolhode_points(run), axis=1)
    assert np.abs(across**2 + along**2 - (w**2).sum(axis=1)).max() < 1e-14


def test_units_do_not_matter() -> None:
    tiny = lm.RigidBody(np.array([1.0, 1.5, 2.0]) * 2.0**-700)
    large = follow(BODY, BODY.state(*START))
    small = follow(tiny, tiny.state(np.array(START[0]) * 2.0**-700, START[1]))
    assert (plots.herpolhode_points(small) == plots.herpolhode_points(large)).all()
    clouds = []
    for body, unit in ((BODY, 1.0), (tiny, 2.0**-700)):
        mu = np.array([[0.5, 0.0, 0.8], [0.0, 2.0, 0.1]]) * unit
        clouds.append(plots.cloud(follow(body, body.state(mu=mu))).collections)
    assert [c.get_offsets().tolist() for c in clouds[0]] == [c.get_offsets().tolist() for c in clouds[1]]


def test_complex_components_show_both_parts(recwarn: pytest.WarningsRecorder) -> None:
    equation = Driven(lm.SU(2))
    run = follow(equation, equation.state(np.eye(2)))
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in run.plot().lines}
    assert (drawn["Im $g_{1,2}$"] == run.g[:, 0, 1].imag).all()
    assert not recwarn.list


def test_a_body_that_only_turns_has_no_path(run: Any) -> None:
    with pytest.raises(lm.errors.InvalidInput, match="path is for"):
        plots.path(run)


@pytest.mark.parametrize(
    "inertia", [[1.0, 1.5, 2.0], [[1.0, 0.2, 0.1], [0.2, 1.4, -0.3], [0.1, -0.3, 1.9]], [1.0, 1.0, 1.0]]
)
def test_the_polhode_is_drawn_inside_the_outline_of_the_ellipsoid(inertia: Any) -> None:
    body = lm.RigidBody(inertia)
    ax = plots.polhode(follow(body, body.state([0.3, 0.8, 0.5]), lm.RKMK(order=8), h=0.2, steps=40))
    J = np.array(body.inertia) if np.ndim(body.inertia) == 2 else np.diag(np.array(body.inertia))
    frame = plots.view_frame(*plots.VIEW)[:2]
    mu = np.array([0.3, 0.8, 0.5])
    twice = mu @ np.linalg.solve(J, mu)
    unit = np.sqrt(twice / np.linalg.eigvalsh(J)[0])
    # x . shadow x = 1 on the outline
    shadow = np.linalg.inv(frame @ np.linalg.inv(J) @ frame.T) * unit**2 / twice
    (outline,) = ax.patches
    rim = outline.get_xy()
    assert np.abs(np.einsum("ni,ij,nj->n", rim, shadow, rim) - 1.0).max() < 1e-12
    for line in ax.lines:
        x = np.asarray(line.get_xydata())
        x = x[np.isfinite(x).all(axis=1)]
        assert (np.einsum("ni,ij,nj->n", x, shadow, x) <= 1.0 + 1e-9).all()


def test_the_vertical_is_the_last_row_of_the_attitude(run: Any) -> None:
    assert np.abs(verticals(run) - run.g[:, 2]).max() < 1e-15
    top, start = TOP
    same = lm.RKMK(order=8)
    there, reduced = (follow(top, start, same, h=0.02), follow(*SYSTEMS["top on se(3)*, momentum only"], same, h=0.02))
    assert np.abs(verticals(there) - verticals(reduced)).max() < 1e-12  # one motion, told twice
    many = follow(*SYSTEMS["tops"])
    assert np.abs(verticals(many) - many.g[..., 2, :]).max() < 1e-15


# ---------------------------------------------------------------- phase planes and sections


@pytest.mark.slow
def test_the_section_of_an_orbit_is_exact_to_fourth_order() -> None:
    errors = []
    for h in (0.1, 0.05, 0.025):
        start = PLANET.pericentre(0.3)
        there = PLANET.state([0.7 * np.cos(1.0), -0.7 * np.sin(1.0)], start.p)
        run = follow(PLANET, there, lm.RKMK(order=8), h=h, steps=round(7 / h))
        q, p, member = plots.section(run, coordinate=1, direction=1)
        assert np.abs(q[:, 1]).max() < 1e-12 and (p[:, 1] > 0.0).all() and not member.any()
        errors.append(np.abs(np.asarray(PLANET.energy(q, p)) - PLANET.energy(there.q, there.p)).max())
    assert np.log2(errors[0] / errors[1]) > 3.5 and np.log2(errors[1] / errors[2]) > 3.5


def test_falling_and_rising_crossings_take_turns_and_members_are_told_apart() -> None:
    run = follow(*SYSTEMS["planets"], lm.StormerVerlet(), h=0.05, steps=200)
    up, down, both = (plots.section(run, 1, direction=d) for d in (1, -1, 0))
    assert len(up[0]) + len(down[0]) == len(both[0])
    assert set(both[2]) == {0, 1} and (up[1][:, 1] > 0.0).all() and (down[1][:, 1] < 0.0).all()
    with pytest.raises(lm.errors.InvalidInput, match="never pierces"):
        plots.poincare_section(run, value=1e9)
    with pytest.raises(lm.errors.InvalidInput, match="canonical"):
        plots.section(follow(*SYSTEMS["body"]))


def test_a_phase_portrait_wraps_angles_and_breaks_curves_there() -> None:
    ax = plots.phase_portrait(follow(*SYSTEMS["pendulums"], lm.StormerVerlet(), h=0.05, steps=100))
    swinging, turning = (np.asarray(line.get_xdata()) for line in ax.lines[::2])
    assert np.isfinite(swinging).all() and np.isnan(turning).any()
    assert np.nanmax(np.abs(turning)) <= np.pi
    with pytest.raises(lm.errors.InvalidInput, match="degree = 3"):
        plots.phase_portrait(follow(*SYSTEMS["Kepler"]), 3)


def test_the_article_body_is_drawn_where_its_momenta_are() -> None:
    body, start = seed_body()
    run = follow(body, start)
    dots = [line for line in run.plot().lines if line.get_linestyle() == "None"]
    seen = run.mu / math.hypot(*run.mu[0]) @ plots.view_frame(*plots.VIEW).T
    assert sorted(map(tuple, np.vstack([d.get_xydata() for d in dots]))) == sorted(map(tuple, seen[:, :2]))


pytest.importorskip("matplotlib", reason="needs the extra plot")


@pytest.mark.parametrize("count", [4, 5, 6, 7, 8, 11])
def test_labels_of_steps_do_not_overlap(count: int) -> None:
    steps = 2.0 ** -np.arange(1.0, count + 1)
    figure = lm.plots.orders(steps, {"two": steps**2}).figure
    figure.set_size_inches(4.5, 4.0)
    figure.draw_without_rendering()
    ticks = figure.axes[0].xaxis
    labels = [*ticks.get_majorticklabels(), *ticks.get_minorticklabels()]
    seen = [label.get_window_extent() for label in labels if label.get_text()]
    low, high = figure.axes[0].bbox.intervalx
    inside = sorted((b.x0, b.x1) for b in seen if low <= (b.x0 + b.x1) / 2 <= high)
    assert len(inside) > 1
    assert all(left[1] < right[0] for left, right in pairwise(inside))


def test_of_many_curves_each_has_its_name_at_its_end() -> None:
    from liemech.plots.style import look, marked

    ax = lm.plots.subplots()[1]
    t = np.geomspace(1.0, 100.0, 50)
    for k in range(14):
        ax.loglog(t, t * 1.01**k, label=f"curve {k}", **look(k))
    lm.plots.legend(ax)
    assert ax.get_legend() is None
    heights = {text.get_text(): text.get_position()[1] for text in ax.texts}
    assert list(heights) == [f"curve {k}" for k in range(14)]  # in the order of their ends
    assert (np.diff(list(heights.values())) > 0.99 / 14).all()  # none covers another
    assert min(heights.values()) >= 0.0 and max(heights.values()) <= 1.0
    assert len({(look(k)["color"], str(look(k)["linestyle"])) for k in range(36)}) == 36
    assert len({(marked(k)["color"], marked(k)["marker"]) for k in range(36)}) == 36


def test_axes_of_ones_own_look_like_all_others() -> None:
    figure, axes = lm.plots.subplots(2, 2, figsize=(6.0, 4.0), sharex=True)
    assert axes.shape == (2, 2) and figure.get_size_inches().tolist() == [6.0, 4.0]
    for ax in axes.flat:
        assert not ax.spines["top"].get_visible() and ax.spines["left"].get_visible()
    (line,) = axes[0, 0].plot([0.0, 1.0])
    assert line.get_color() == lm.plots.COLORS[0]


def test_angles_have_no_strokes_where_they_begin_anew(run: Any) -> None:
    ax = lm.plots.euler_angles(run)
    for line in ax.lines:
        jumps = np.abs(np.diff(line.get_ydata()))
        assert not (jumps > 90.0).any()
    assert any(np.isnan(line.get_ydata()).any() for line in ax.lines)


def test_a_long_run_has_the_envelope_of_its_errors() -> None:
    """No comb: not one of the zeros between the roundings, and every maximum."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    run = lm.integrate(body, lm.CovariantVariational(), start, h=0.1, steps=20_000)
    ax = lm.plots.invariants(run)
    for line, name in zip(ax.lines, run.drift(), strict=True):
        drawn = line.get_ydata()
        assert len(drawn) <= 400
        assert np.nanmax(drawn) == pytest.approx(run.drift()[name].largest, rel=1e-9)
        # neighbours are alike
        assert np.nanmax(np.abs(np.diff(np.log10(drawn)))) < 1.0
    (box,) = [ax.get_legend().get_window_extent()]
    assert box.x0 > ax.get_window_extent().x1  # beside the curves


def test_recorded_energies_are_enough_for_pictures_of_what_is_kept() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=100, record=["energy"])
    assert len(lm.plots.drift({"RKMK4": run}).lines) == 2
    assert len(lm.plots.invariants(run).lines) == 1
    assert lm.plots.invariants(run).get_xlabel() == "time $t$ (s)"


@lm.record
class Mixed(lm.CotangentSystem):
    """An energy in which momentum and place meet."""

    configurations: lm.LieGroup

    def energy(self, mu: lm.Vec, g: lm.Element) -> float:
        return 0.5 * lm.dot(mu, mu) + 0.3 * mu[0] * g[2, 0] + g[2, 2]


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3()], ids=repr)
def test_a_body_whose_energy_mixes_momentum_and_place_is_drawn_as_a_body(group: lm.LieGroup) -> None:
    """Elements of G x g*, on which its momenta add up, were taken for its poses."""
    system = Mixed(group)
    start = system.state(mu=[0.5, -0.3, 0.7, 0.1, 0.2, 0.3][: group.dim], g=group.identity())
    run = lm.integrate(system, lm.RKMK(order=4), start, h=0.1, steps=5, compiled=False)
    assert poses.configurations(system) is group and poses.flies(system) == isinstance(group, lm.SE3)
    turned = Rotation.from_quat(poses.attitude(system, run.g)).as_matrix()
    assert np.allclose(turned, run.g[:, :3, :3], rtol=0, atol=1e-14)
    assert run.plot() is not None and lm.viewer.Scene(run) is not None
