"""Published numbers are reached, and what is not reached is said."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import liemech as lm
from liemech.command_line.main import main
from liemech.command_line.reproduce import drawn
from liemech.errors import InvalidInput
from liemech.groups.representations import AdjointAction
from liemech.groups.rigid.se3 import SE3
from liemech.rooms.published import RESULTS, robots
from liemech.rooms.published.compared import Compared, Reproduced, limit, reproduced, title_of
from liemech.rooms.published.double_spherical_pendulum import DoubleSphericalPendulum
from liemech.rooms.published.four_bars import four_bars
from liemech.rooms.published.governor import governor

LONG = {name for name in RESULTS if name not in ("article-fig1", "elastica")}
QUARTER, _ = quad(lambda q: 1.0 / np.sqrt(1.0 + 2.0 * 9.81 * 3.5 / 3.0 * (1.0 - np.cos(q))), 0.0, np.pi / 2)
"""The time in which two four-bars fall from upright, where they move with 1 m/s, to their dead point."""

PAGE = Path(__file__).parent.parent.parent / "docs" / "proof" / "published_results.md"


def require_robots() -> None:
    """Skip without the package whose files they are."""
    try:
        version("example-robot-data")
    except PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")


@pytest.mark.parametrize("name", [pytest.param(x, marks=pytest.mark.slow) if x in LONG else x for x in RESULTS])
def test_a_published_result_is_reached(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """By the command, which says where it is published."""
    if name == "robots":
        require_robots()
    assert main(["reproduce", name]) == 0
    printed = capsys.readouterr().out
    assert f"{name}:" in printed and title_of(name) in printed and "Source: " in printed


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("name", ["iftomm-a02", "spaghetti-2d", "spaghetti-3d", "wafr-10"])
def test_long_rows_are_reached(name: str) -> None:
    result = reproduced(name, full=True)
    assert result.holds, str(result)


def test_a_number_that_is_not_reached_is_told() -> None:
    assert not Compared("a place", 1.0, 1.1, 0.05).holds
    assert not Compared("an error", 0.01, -0.02).holds
    assert Compared("an error", 0.01, -0.01).holds
    assert not Compared("a place", 1.0, float("nan"), 0.05).holds


def test_a_result_without_its_files_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(robots, "LEGGED", ("no_robot",))
    assert main(["reproduce", "robots"]) == 1
    assert "pip install example-robot-data" in capsys.readouterr().out


def test_even_powers_of_halved_steps_are_taken_off() -> None:
    values = [np.array([1.0 - 2.0 * h**2 + 3.0 * h**4, h**2]) for h in (0.5, 0.25, 0.125)]
    assert limit(values) == pytest.approx([1.0, 0.0], abs=1e-15)


def test_the_double_spherical_pendulum_keeps_its_energy() -> None:
    pendulum = DoubleSphericalPendulum(AdjointAction(SE3() ** 2), 1.5, 4.0)
    q, w = np.array([[0.6, 0.0, 0.8], [0.0, -0.8, 0.6]]), np.array([[0.0, 1.5, 0.0], [2.0, 0.0, 0.0]])
    start = pendulum.state(np.stack([q, w], axis=1).ravel())
    run = lm.integrate(pendulum, lm.RKMK(order=8), start, h=2.5e-3, steps=400, progress=False)
    q1, w1, q2, w2 = np.moveaxis(np.reshape(run.x, (-1, 4, 3)), 1, 0)
    v1, gravity = np.cross(w1, q1), 9.81
    v2 = v1 + np.cross(w2, q2)
    energy = 0.75 * (v1**2).sum(1) + 2.0 * (v2**2).sum(1) + gravity * (5.5 * q1[:, 2] + 4.0 * q2[:, 2])
    assert np.ptp(energy) < 1e-10 * np.abs(energy).max()
    assert (q1**2).sum(1) == pytest.approx(1.0, abs=1e-13) and (q1 * w1).sum(1) == pytest.approx(0.0, abs=1e-12)


def test_results_are_listed_and_a_name_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed and title_of(name) in listed for name in RESULTS)
    with pytest.raises(InvalidInput, match="iftomm-a02"):
        reproduced("iftomm-a99")
    with pytest.raises(SystemExit, match="2"):
        main(["reproduce", "iftomm-a99"])


def test_a_picture_has_a_dot_for_every_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    rows = Compared("a place", 1.0, 1.0 + 5e-9, 1e-8), Compared("an error", 0.02, 0.01), Compared("met", 2.0, 2.0, 1.0)
    (dots, published) = drawn("a result", Reproduced("somebody", rows, 0.0)).get_lines()
    assert dots.get_xdata() == pytest.approx([np.finfo(float).eps, 0.5, 0.5], rel=1e-6)
    assert np.array(published.get_xdata()) == pytest.approx(1.0)
    with pytest.raises(SystemExit, match="2"):
        main(["reproduce", "--picture", str(tmp_path / "all.png")])
    assert "--picture draws one result" in capsys.readouterr().err


def test_every_result_is_on_the_page() -> None:
    page = PAGE.read_text()
    assert all(f"`{name}`" in page for name in RESULTS)


def test_the_governor_starts_where_its_springs_are_at_ease() -> None:
    linkage, start = governor()
    for name in ("strut 2", "strut 3"):
        at = linkage.motion_at(None, linkage.number(name)).at
        assert np.array(at.angles(0.0, start.g)) == pytest.approx([0.5], rel=1e-14)
        assert np.array(at.rates(0.0, start.g, linkage.velocity(start.mu))) == pytest.approx([0.0], abs=1e-14)
    v = np.array(linkage.velocity(start.mu)).reshape(4, 6)
    assert v[2, 4] == pytest.approx(2.0 * np.pi * (0.05 + 5.15 / 5.3 * np.cos(np.pi / 6)), rel=1e-13)


@pytest.mark.compiled
@pytest.mark.slow
@pytest.mark.parametrize("steps", [40, 160])
def test_a_step_that_lands_on_the_dead_point_goes_on(steps: int) -> None:
    linkage, upright = four_bars(2)
    run = lm.integrate(linkage, lm.LieRATTLE(), upright, h=QUARTER / steps, steps=4 * steps, progress=False)
    first, last = (run.joint(f"crank {k}").angle for k in (0, 2))
    assert abs(first[steps] - np.pi / 2) < 1.0 / steps**2  # all bars in one line
    assert np.abs(first - last).max() < 1e-9 and np.ptp(first) > np.pi
    assert np.ptp(run.energy) < 200.0 / steps**2


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("shift", [0.0, 1e-12, 1e-10, 1e-8, 1e-7])
@pytest.mark.filterwarnings("ignore::liemech.errors.StepWarning")
def test_next_to_a_dead_point_a_velocity_is_nearly_right_or_the_run_ends(shift: float) -> None:
    """Impulses of conditions that depend on each other are none: they threw bars by any velocity."""
    linkage, upright = four_bars(2)
    h = QUARTER * (1.0 + shift) / 160
    try:
        run = lm.integrate(linkage, lm.Composition(lm.LieRATTLE(), order=4), upright, h=h, steps=640, progress=False)
    except lm.errors.NoConvergence as error:
        run = error.trajectory
    assert len(run.t) >= 160 and np.ptp(run.energy) < 2e-3
