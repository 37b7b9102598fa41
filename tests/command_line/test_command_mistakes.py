"""What the command line is given by mistake is refused in one line; what was computed before Ctrl-C is kept."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from refusals import refused
from scenes import slow

import liemech as lm
from liemech.command_line import main_job as job
from liemech.command_line.check import _reports
from liemech.command_line.constructors import read
from liemech.command_line.main import main
from liemech.command_line.run import explained
from liemech.command_line.scene_file import scene_file
from liemech.errors import InvalidInput

pytestmark = pytest.mark.usefixtures("folder")

PENDULUM = """
[system]
name = "Pendulum"

[start]
q = [1.0]
p = [0.0]

[method]
name = "{method}"

[run]
{run}
"""


def pendulum(run: str, method: str = "RKMK") -> Any:
    Path("scene.toml").write_text(PENDULUM.format(run=run, method=method), encoding="utf-8")
    return scene_file(Path("scene.toml"))


# ---------------------------------------------------------------- Ctrl-C


def test_ctrl_c_keeps_what_the_main_job_has_computed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, calls = lm.integrate, []

    def stopping(system: Any, method: Any, start: Any, **step: Any) -> Any:
        calls.append(method)
        if len(calls) < 2:
            return whole(system, method, start, compiled=False, **step)
        stopped = lm.errors.IntegrationInterrupted()
        stopped.trajectory = whole(system, method, start, **(step | {"steps": 7}), compiled=False)
        raise stopped

    monkeypatch.setattr(lm, "integrate", stopping)
    monkeypatch.setattr(job, "draw", lambda *_: True)
    monkeypatch.setattr(job, "page", lambda *_: None)
    assert main(["--steps", "20", "--methods", "rkmk4", "exp", "hj4"]) == 130
    printed, complained = capsys.readouterr()
    assert "Algorithm 1, exp: interrupted at t = 2.1" in complained
    assert "RKMK4" in printed and "Algorithm 1, exp" in printed and "Hamilton-Jacobi" not in printed


def test_ctrl_c_elsewhere_in_the_main_job(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def stop(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(job, "parse", stop)
    assert main([]) == 130
    assert "interrupted" in capsys.readouterr().err


# ---------------------------------------------------------------- texts


@pytest.mark.parametrize(
    "text",
    [
        "RKMK(**{'order': 2})",
        "RigidBody(array())",
        "RigidBody(array([[1.0, 2.0], [3.0]]))",
        "RigidBody([[1.0, 2.0], [3.0]])",
        "RigidBody(array([1.0], [2.0], 3.0))",
    ],
)
def test_texts_that_are_no_objects(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InvalidInput):
        read(text, lm.Record, "argument")
    refused(capsys, "check", text)


def test_modules_that_cannot_be_imported(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("broken_on_purpose.py").write_text("x = 1 / 0\n", encoding="utf-8")
    Path("unreadable_on_purpose.py").write_text("def (:\n", encoding="utf-8")
    for module, told in (("broken_on_purpose", "ZeroDivisionError"), ("unreadable_on_purpose", "SyntaxError")):
        complained = refused(capsys, "check", f"{module}:X")
        assert told in complained and "line 1" in complained
    refused(capsys, "view", "run.npz", "--modules", "there_is_no_such_module")


def test_files_that_cannot_be_written(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("run.npz").mkdir()
    assert "it is a folder" in refused(capsys, "run", "kepler", "--save", "run.npz")
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "permission denied" in refused(capsys, "run", "kepler", "--view", "run.html")


# ---------------------------------------------------------------- scenes from files


@pytest.mark.parametrize(
    ("run", "method", "told"),
    [
        ("h = 0.1\nsteps = 4\nevery = 0", "StormerVerlet", "every"),
        ("h = 0.1\nsteps = 4\nrtol = 1e-3", "StormerVerlet", "rtol"),
        ("t_end = 1.0\nevery = 3", "RKMK(order=5)", "every"),
    ],
)
def test_no_option_of_a_run_is_dropped(run: str, method: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    name, _, rest = method.partition("(")
    if rest:
        run = f"{run}\n"
        text = PENDULUM.format(run=run, method=name).replace(f'"{name}"', f'"{name}"\norder = 5')
        Path("scene.toml").write_text(text, encoding="utf-8")
    else:
        pendulum(run, name)
    assert told in refused(capsys, "run", "scene.toml", "--quiet")


def test_steps_that_are_all_alike_are_explained_as_such() -> None:
    told = explained(pendulum("h = 0.1\nt_end = 1.0", "StormerVerlet"), ("q", "p"), 1)
    assert "h = 0.1" in told and "adaptive" not in told
    assert "adaptive" in explained(pendulum("t_end = 1.0"), ("q", "p"), 1)


def test_steps_in_fictive_time_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "comet", "--explain"]) == 0
    told = capsys.readouterr().out
    assert "in fictive time" in told and "angular momentum" in told


# ---------------------------------------------------------------- checks, and runs that cannot be saved


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RATTLE(), lm.PoissonEuler(), slow(lm.LieRATTLE())])
def test_methods_with_systems_of_their_own_are_checked(method: lm.Method) -> None:
    (report,) = _reports(method)
    assert report["order"].verdict == "holds" and not report.broken


def test_poisson_structures_are_checked() -> None:
    (report,) = _reports(lm.models.LotkaVolterra().structure)
    assert not report.broken and "Jacobi" in str(report)
    with pytest.raises(InvalidInput, match=r"lm\.check_method\(method, system, start\)"):
        _reports(lm.AdaptiveVerlet())


@pytest.mark.slow
def test_a_run_that_cannot_be_saved_has_its_other_outputs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def save(self: Any, path: Any) -> None:
        raise InvalidInput("Trajectory.save: not of runs in fictive time")

    monkeypatch.setattr(lm.Trajectory, "save", save)
    assert main(["run", "comet", "--steps", "10", "--save", "--view", "--quiet"]) == 1
    *_, last = capsys.readouterr().err.splitlines()  # behind a notice of slow compiling
    assert last == "liemech: comet.npz is not written: Trajectory.save: not of runs in fictive time"
    assert Path("comet.html").exists()
