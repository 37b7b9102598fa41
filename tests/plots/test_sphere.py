"""The geometry behind the momentum sphere, and that the pictures hold what they claim."""

import subprocess
import sys

import numpy as np
import pytest

import liemech as lm
from liemech import plots
from liemech.errors import InvalidInput, InvalidType, LiemechError, MissingExtra

EPS = np.finfo(float).eps
SEED = np.array([2 / 3, 1.0, 2.0])
# the exact seed orbit from (1/2, 0, sqrt(3)/2) at t = 0, 0.5, 5, 100, from the closed form in 40
# digits
ORBIT = np.array(
    [
        [0.5, 0.0, 0.75**0.5],
        [0.476979989770352279, 0.212085309998946577, 0.852941915162647734],
        [-0.460065089372333753, 0.276911948246465352, 0.843599363714300964],
        [0.220396701616357976, -0.634705118801841825, 0.740658292388176756],
    ]
)
VIEWS = [plots.VIEW, (0, 0), (0, 90), (90, -90), (200, -30), (-135, 55), (123, 4)]


def bodies():
    rng = np.random.default_rng(7)
    yield from (SEED, np.array([1, 1.5, 2]), np.array([2.0, 2 / 3, 1.0]), np.array([0.01, 0.7, 0.7000001]))
    for _ in range(5):
        U = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        yield U @ np.diag(rng.uniform(0.1, 3.0, 3)) @ U.T


def twice_energy(inertia, x):
    """x.J^-1 x with the inertia scaled to J_max = 1."""
    J = np.asarray(inertia, dtype=float)
    J = np.diag(J) if J.ndim == 1 else J
    J = J / np.linalg.eigvalsh(J)[-1]
    return np.einsum("...i,ij,...j->...", x, np.linalg.inv(J), x), 1 / np.linalg.eigvalsh(J)


def great_circle(frame, samples=200, phase=0.123):
    s = phase + np.linspace(0, 2 * np.pi, samples)
    return np.outer(np.cos(s), frame[0]) + np.outer(np.sin(s), frame[1])


@pytest.fixture
def matplotlib():
    module = pytest.importorskip("matplotlib")
    module.use("Agg")
    return module


# -------------------------------------------------------------------------------------------------------
# geometry


@pytest.mark.parametrize("view", VIEWS)
def test_projection_is_a_rotation_with_the_eye_in_front_and_axis_three_upwards(view):
    frame = plots.view_frame(*view)
    assert np.abs(frame @ frame.T - np.eye(3)).max() <= 2 * EPS
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=4 * EPS)
    a, e = np.radians(view)
    eye = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
    assert np.abs(frame @ eye - [0, 0, 1]).max() <= 2 * EPS
    assert abs(frame[0, 2]) <= EPS
    assert frame[1, 2] >= -EPS


def test_a_great_circle_is_cut_at_the_two_points_where_it_meets_the_horizon():
    rng = np.random.default_rng(1)
    for _ in range(20):
        plane = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        u, v = plane[0], plane[1]
        curve = great_circle(plane, samples=int(rng.integers(5, 300)), phase=rng.uniform(0, 6))
        front, back = plots.split_at_horizon(curve)
        both = front[np.isfinite(front[:, 0]) & np.isfinite(back[:, 0])]
        assert len(both) == 2
        assert (both[:, 2] == 0.0).all()
        assert np.abs(np.linalg.norm(both, axis=1) - 1).max() <= 4 * EPS
        # the direction that the circle's plane shares with the horizon's
        line = u * v[2] - v * u[2]
        # sin of the angle between
        assert np.abs(np.cross(both, line / np.linalg.norm(line))).max() <= 1e-12
        assert both[0] @ both[1] == pytest.approx(-1.0, abs=1e-12)


def test_front_and_back_together_are_the_curve():
    rng = np.random.default_rng(2)
    curve = rng.normal(size=(400, 3))
    front, back = plots.split_at_horizon(curve)
    assert np.nanmin(front[:, 2]) >= 0.0 >= np.nanmax(back[:, 2])
    merged = np.where(np.isnan(front), back, front)
    cut = np.isfinite(front[:, 0]) & np.isfinite(back[:, 0])
    assert (merged[~cut] == curve).all()
    assert cut.sum() == (np.diff(curve[:, 2] >= 0) != 0).sum()
    a, x, b = merged[np.flatnonzero(cut) - 1], merged[cut], merged[np.flatnonzero(cut) + 1]
    # on the great circle of the neighbours
    assert np.abs(np.einsum("ni,ni->n", np.cross(a, b), x)).max() <= 1e-13
    length = np.linalg.norm([a, x, b], axis=2)
    between = np.sort(length[[0, 2]], axis=0)
    assert (between[0] * (1 - 4 * EPS) <= length[1]).all()
    assert (length[1] <= between[1] * (1 + 4 * EPS)).all()


@pytest.mark.parametrize(
    ("curve", "crossings"),
    [
        ([[0, 0, 1]], 0),
        ([[0, 0, -1]], 0),
        ([[1, 0, 0], [0, 0, -1]], 1),  # starts on the horizon
        ([[0, 0, -1], [1, 0, 0], [0, 0, -1]], 2),  # touches it
        ([[0, 0, 1], [0, 0, -1]], 1),  # through the centre: no direction to prefer, but no NaN
    ],
)
def test_splitting_where_the_curve_is_awkward(curve, crossings):
    front, back = plots.split_at_horizon(curve)
    both = np.isfinite(front).all(axis=1) & np.isfinite(back).all(axis=1)
    assert both.sum() == crossings
    assert len(front) == len(curve) + crossings
    assert (np.isfinite(front) | np.isfinite(back)).all()


@pytest.mark.parametrize("inertia", list(bodies()), ids=lambda J: "x".join(map(str, np.shape(J))))
def test_level_curves_lie_on_sphere_and_energy_ellipsoid(inertia):
    count = 9
    curves = plots.energy_levels(inertia, count)
    assert len(curves) == 2 * count
    assert np.abs(np.linalg.norm(curves, axis=2) - 1).max() <= 4 * EPS
    energy, inverse = twice_energy(inertia, curves)
    level = energy.mean(axis=1, keepdims=True)
    assert np.abs(energy - level).max() <= 32 * EPS * inverse.max()
    assert np.abs(curves[:, 0] - curves[:, -1]).max() <= 4 * EPS  # closed
    # each energy has a curve about either end of its axis
    centres = curves[:, :-1].mean(axis=1).reshape(count, 2, 3)
    assert np.abs(centres.sum(axis=1)).max() <= 16 * EPS
    assert np.linalg.norm(centres, axis=2).min() > 0.1
    level = np.unique(level.round(12))
    assert len(level) == count
    assert inverse.min() < level.min() < level.max() < inverse.max()
    assert not np.isclose(level, inverse[1], rtol=1e-6, atol=0).any()  # none is the separatrix


def test_the_seed_orbit_is_a_level_curve():
    # count = 2 on the seed body puts one curve about axis 3, half way to the separatrix at 45
    # degrees
    curve = next(c for c in plots.energy_levels(SEED, 2) if (c[:, 2] > 0).all())
    assert curve[0] == pytest.approx([np.sin(np.pi / 8), 0, np.cos(np.pi / 8)], abs=4 * EPS)
    # and the orbit, whose angle is 30 degrees, is the closed form of the docstring with
    # A_1^2 = 1/4, A_2^2 = 1/2
    x = ORBIT
    assert np.abs(4 * x[:, 0] ** 2 + 2 * x[:, 1] ** 2 - 1).max() <= 8 * EPS
    assert np.abs(0.75 * 4 * x[:, 0] ** 2 + 0.5 * 2 * x[:, 1] ** 2 - x[:, 2] ** 2).max() <= 8 * EPS


@pytest.mark.parametrize("inertia", list(bodies()), ids=lambda J: "x".join(map(str, np.shape(J))))
def test_separatrix_runs_through_the_middle_axis_at_its_energy(inertia):
    axes = np.linalg.eigh(np.diag(inertia) if np.ndim(inertia) == 1 else inertia)[1]
    circles = plots.separatrix(inertia)
    energy, inverse = twice_energy(inertia, circles)
    assert np.abs(np.linalg.norm(circles, axis=2) - 1).max() <= 4 * EPS
    assert np.abs(energy - inverse[1]).max() <= 64 * EPS * inverse.max()
    for circle in circles:
        assert np.abs(circle @ axes[:, 1]).max() == pytest.approx(1.0, abs=4 * EPS)
        assert np.linalg.matrix_rank(circle, tol=1e-9) == 2  # a great circle
    assert np.abs(circles[0] - circles[1]).max() > 1e-5  # two of them


def test_symmetric_bodies():
    assert len(plots.energy_levels([3, 3, 3])) == 0
    assert len(plots.separatrix(0.1 * np.eye(3))) == 0
    for inertia, axis in (([1, 1, 2], 2), ([0.1, 1, 1], 0), ([1, 2, 1], 1)):
        curves = plots.energy_levels(inertia, 5)
        assert len(curves) == 10
        # circles of latitude (a square root of rounding)
        assert np.ptp(curves[:, :, axis], axis=1).max() <= 2e-8
        assert np.abs(plots.separatrix(inertia)[:, :, axis]).max() <= 4 * EPS  # the equator


def test_only_the_ratios_of_the_moments_matter():
    for scale in (2.0**-500, 2.0**400):
        assert (plots.energy_levels(SEED * scale) == plots.energy_levels(SEED)).all()
        assert (plots.separatrix(np.diag(SEED) * scale) == plots.separatrix(SEED)).all()


@pytest.mark.parametrize(
    "inertia", [[1, 2], [1, 2, 0], [1, -1, 2], [1, 2, np.nan], np.zeros((3, 3)), np.triu(np.ones((3, 3)))]
)
def test_impossible_inertia_is_refused(inertia):
    with pytest.raises(InvalidInput, match="inertia must"):
        plots.energy_levels(inertia)


# --------------------------------------------------------------------------------------------------------
# pictures


def lines(ax):
    """Every drawn line's points, as one list."""
    return [line.get_xydata() for line in ax.lines]


def test_sphere_shows_dots_exact_curve_ends_and_axes(matplotlib):
    ax = plots.momentum_sphere(ORBIT[:3], ORBIT, SEED, end=ORBIT[2], label="mine", levels=4, title="T")
    assert ax.get_title() == "T"
    assert isinstance(ax, matplotlib.axes.Axes)
    assert [t.get_text() for t in ax.texts if t.get_text()] == [r"$\mu_1$", r"$\mu_2$", r"$\mu_3$"]
    assert ax.get_legend_handles_labels()[1] == ["mine"]
    assert len(ax.images) == 1
    # front and back of 8 level curves, 2 separatrix circles, the dots, the exact curve; the two
    # marks
    assert len(ax.lines) == 2 * (8 + 2 + 1 + 1) + 2
    dots = np.vstack([line.get_xydata() for line in ax.lines if line.get_linestyle() == "None"][:2])
    seen = ORBIT[:3] @ plots.view_frame(*plots.VIEW).T
    assert sorted(map(tuple, dots)) == sorted(map(tuple, seen[:, :2]))


def test_everything_behind_is_below_everything_in_front(matplotlib):
    curve = great_circle(np.eye(3)[[0, 2]])
    ax = plots.momentum_sphere(curve, curve, SEED)
    behind = [line for line in ax.lines if line.get_zorder() < 0.95]
    assert len(behind) == len(ax.lines) / 2
    assert all(line.get_zorder() >= 1.0 for line in ax.lines if line not in behind)
    (limb,) = ax.patches
    assert max(line.get_zorder() for line in behind) < limb.get_zorder() < 1.0


def test_pictures_do_not_depend_on_units(matplotlib):
    plain = lines(plots.momentum_sphere(ORBIT, ORBIT, SEED, end=ORBIT[-1]))
    for scale in (2.0**-1000, 2.0**1000):
        ax = plots.momentum_sphere(ORBIT * scale, ORBIT * scale, SEED * 2.0**-100, end=ORBIT[-1] * scale)
        for a, b in zip(plain, lines(ax), strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_momentum_off_the_sphere_is_drawn_where_it_is(matplotlib):
    ax = plots.momentum_sphere([ORBIT[0], 0.5 * ORBIT[1]])
    last = ax.lines[1].get_xydata()[-1]
    assert last == pytest.approx(0.5 * (plots.view_frame(*plots.VIEW) @ ORBIT[1])[:2], rel=1e-15)


@pytest.mark.sample(3)
@pytest.mark.parametrize("view", VIEWS)
def test_axis_names_are_inside_the_picture(matplotlib, view):
    ax = plots.momentum_sphere(ORBIT, view=view)
    ax.figure.draw_without_rendering()
    low, high = ax.get_window_extent().get_points()
    for name in (t for t in ax.texts if t.get_text()):
        a, b = name.get_window_extent().get_points()
        assert (a >= low).all()
        assert (b <= high).all()
    assert ax.get_aspect() == 1.0


def test_long_runs_are_thinned_with_both_ends_kept(matplotlib):
    curve = great_circle(plots.view_frame(*plots.VIEW)[[1, 2]], samples=50_000)
    dots = np.vstack(lines(plots.momentum_sphere(curve)))
    assert len(dots) == plots.MOST_DOTS
    for point in curve[[0, -1]] @ plots.view_frame(*plots.VIEW).T:
        assert np.abs(dots - point[:2]).max(axis=1).min() == 0.0


def test_draws_on_axes_that_are_given_and_leaves_settings_and_pyplot_alone(matplotlib, tmp_path):
    from matplotlib import pyplot
    from matplotlib.figure import Figure

    before, open_figures = matplotlib.rcParams.copy(), pyplot.get_fignums()
    ax = Figure().add_subplot()
    assert plots.momentum_sphere(ORBIT, ax=ax) is ax
    plots.save(plots.figure_one([("a", ORBIT)], ORBIT, SEED), tmp_path / "a.svg")
    assert before == matplotlib.rcParams
    assert pyplot.get_fignums() == open_figures


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_figure_one_has_a_sphere_a_caption_each_and_one_legend_with_no_text_cut_off(matplotlib, count):
    panels = [
        plots.Panel(f"method {k}", ORBIT, "momentum error 4.4e-2\nenergy -1.7e-3", ORBIT[-1]) for k in range(count)
    ]
    figure = plots.figure_one(panels, ORBIT, SEED)
    assert [ax.get_title() for ax in figure.axes] == [f"method {k}" for k in range(count)]
    assert all(ax.get_legend() is None for ax in figure.axes)
    (legend,) = figure.legends
    names = ["numerical", "exact", "last step: numerical, exact", "separatrix", "constant energy"]
    assert [text.get_text() for text in legend.get_texts()] == names
    figure.draw_without_rendering()
    texts = [t for ax in figure.axes for t in (ax.title, *ax.texts) if t.get_text()]
    assert sum("energy -1.7e-3" in t.get_text() for t in texts) == count
    boxes = [t.get_window_extent() for t in texts] + [legend.get_window_extent()]
    for k, box in enumerate(boxes):
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1
        assert not any(box.overlaps(other) for other in boxes[:k])


def test_legend_names_only_what_is_drawn(matplotlib):
    figure = plots.figure_one([("a", ORBIT), ("b", ORBIT)], inertia=[1, 1, 1])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["numerical"]


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_the_same_picture_gives_the_same_bytes(matplotlib, tmp_path, ending):
    written = []
    for name in ("a", "b"):
        path = tmp_path / f"{name}.{ending}"
        plots.save(plots.figure_one([("a", ORBIT)], ORBIT, SEED), path, dpi=60)
        written.append(path.read_bytes())
    assert written[0] == written[1]
    assert len(written[0]) > 1000


@pytest.mark.parametrize(
    ("mu", "wanted"),
    [
        ([[1, 2]], r"mu must have shape \(n, 3\)"),
        (np.empty((0, 3)), r"mu must have shape \(n, 3\)"),
        (np.ones((2, 2, 3)), r"mu must have shape \(n, 3\)"),
        ([[1, 0, 0], [np.nan, 0, 0]], "mu must be finite; row 1"),
        ([0, 0, 0], "first momentum zero"),
    ],
)
def test_impossible_momenta_are_refused(matplotlib, mu, wanted):
    with pytest.raises(InvalidInput, match=wanted):
        plots.momentum_sphere(mu)


def test_no_panels_are_refused(matplotlib):
    with pytest.raises(InvalidInput, match="at least one panel"):
        plots.figure_one([])


def test_missing_matplotlib_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for draw in (lambda: plots.momentum_sphere(ORBIT), lambda: plots.figure_one([("a", ORBIT)])):
        with pytest.raises(MissingExtra, match=r'pip install "liemech\[plot\]"') as caught:
            draw()
        assert isinstance(caught.value, LiemechError)
        assert isinstance(caught.value, ImportError)


@pytest.mark.slow
def test_matplotlib_is_loaded_only_to_draw_and_pyplot_never():
    pytest.importorskip("matplotlib")
    code = """
import sys, liemech.plots as plots
assert not any(name.startswith("matplotlib") for name in sys.modules)
plots.figure_one([("a", [[1, 0, 0]])])
assert "matplotlib" in sys.modules and "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["mu", "exact"])
def test_a_run_is_no_momentum(name):
    body = lm.RigidBody([1.0, 1.5, 2.0])
    run = lm.Plan(body, lm.RKMK(order=4), h=0.1).run(body.state(mu=ORBIT[0]), steps=3)
    with pytest.raises(InvalidType, match=rf"{name} must be vectors.*run\.mu"):
        plots.momentum_sphere(**{"mu": ORBIT, name: run})
