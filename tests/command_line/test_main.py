"""The main job: its table tells the truth, its picture is drawn, and what cannot be done is said in one line."""

from __future__ import annotations

import builtins
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.command_line.main import main
from liemech.command_line.options import count, duration, number, short

ARTICLE = ["--inertia", "2/3", "1", "2", "--h", "1/2"]
# After 200 steps of h = 0.5 of the article's body: momentum error, energy error, from runs in 45
# digits.
EXPECTED = {
    "RKMK4": (4.4e-2, -1.7e-3),
    "Algorithm 1, Cayley": (1.3, -2.3e-3),
    "Algorithm 1, exp": (8.5e-2, -8.9e-4),
    "Hamilton-Jacobi 4": (2.5e-3, -2.3e-5),
}


def rows(printed: str) -> dict[str, list[str]]:
    """The lines of the table by their names: momentum, attitude, largest error of the energy and
    the verdict on it, |mu|^2, g mu, time, unit.
    """
    lines = printed[printed.index("---") :].splitlines()[1:]
    return {line[:20].strip(): line[20:].split() for line in lines[: lines.index("")]}


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """What a stranger sees who runs it in an empty folder, and the folder."""
    folder = tmp_path_factory.mktemp("job")
    done = subprocess.run([sys.executable, "-m", "liemech"], cwd=folder, capture_output=True, text=True, timeout=100)
    # of runs and compilations that take long, as on a busy machine
    bars = "step/s]", "liemech: compiling"
    others = [s for s in done.stderr.splitlines() if s.strip() and not any(b in s for b in bars)]
    assert (done.returncode, others) == (0, [])
    return done.stdout, folder


@pytest.mark.slow
def test_the_table_has_the_errors_of_the_reference_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*ARTICLE, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "diag(0.666667, 1, 2)" in printed and "triangle inequality" in printed
    table = rows(printed)
    assert list(table) == [*EXPECTED, "exact"]
    for name, (momentum, energy) in EXPECTED.items():
        assert float(table[name][0]) == momentum
        assert abs(energy) <= float(table[name][2]) < 1.2 * abs(energy)
        # |mu| and the spatial momentum are kept, whatever the step
        assert max(map(float, table[name][4:6])) < 1e-14
    assert float(table["exact"][2]) < 1e-15


@pytest.mark.slow
def test_families_look_like_what_they_are(job: tuple[str, Path]) -> None:
    """The energy of the symplectic ones is bounded, and none is off by a right angle."""
    table = rows(job[0])
    verdicts = {name: cells[3] for name, cells in table.items()}
    assert verdicts.pop("RKMK4") == "drifting" and verdicts.pop("exact") == "exact"
    assert set(verdicts.values()) == {"bounded"} and len(verdicts) == 3
    assert all(float(cells[1]) < 45.0 for name, cells in table.items() if name != "exact")
    assert float(table["Algorithm 1, exp"][0]) > 100.0 * float(table["Hamilton-Jacobi 4"][0])


@pytest.mark.slow
def test_attitude_error_is_the_angle_between_the_attitudes(job: tuple[str, Path]) -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    method = lm.CovariantVariational(lm.Exponential())
    g = lm.integrate(body, method, start, h=0.3, steps=200).g[-1]
    cosine = (np.trace(body.exact(start, 60.0).g.T @ g) - 1.0) / 2.0
    assert rows(job[0])["Algorithm 1, exp"][1] == short(np.degrees(np.arccos(cosine)))


@pytest.mark.slow
def test_it_says_what_it_simulates_and_where_the_picture_is(job: tuple[str, Path]) -> None:
    printed, folder = job
    assert "diag(1, 1.5, 2)" in printed and "200 steps of h = 0.3 s to t = 60 s" in printed
    assert "triangle inequality" not in printed and "Warning" not in printed
    assert printed.endswith("Picture: rigid_body.png\n")
    assert (folder / "rigid_body.png").read_bytes().startswith(b"\x89PNG")
    assert max(map(len, printed.splitlines())) <= 88


@pytest.mark.slow
def test_options_reach_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "deep" / "exp.svg"
    options = ["--steps", "1e1", "--h", "-1/4", "--inertia", "1", "3/2", "2", "--mu", "-1/2", "-1e-3", "0"]
    assert main([*options, "--methods", "exp", "--out", str(picture)]) == 0
    printed = capsys.readouterr().out
    assert list(rows(printed)) == ["Algorithm 1, exp", "exact"]
    for said in ("(1, 1.5, 2)", "(-0.5, -0.001, 0)", "10 steps of h = -0.25 s to t = -2.5 s"):
        assert said in printed
    assert "</svg>" in picture.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("start", ["--mu 0 1 0", "--inertia 1 1 1", "--inertia 1 1 2", "--mu 1e-150 0 1e-150"])
def test_every_kind_of_motion_can_be_drawn(start: str, tmp_path: Path) -> None:
    assert main(["--steps", "5", "--quiet", "--out", str(tmp_path), *start.split()]) == 0
    assert (tmp_path / "rigid_body.png").exists()


@pytest.mark.slow
def test_quiet_prints_nothing_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quiet", "--steps", "5", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr() == ("", "")
    assert (tmp_path / "rigid_body.png").exists()


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--steps", "0"], "whole number from 1"),
        (["--steps", "1.5"], "whole number from 1"),
        (["--steps", "1e300"], "whole number from 1"),
        (["--h", "0"], "zero"),
        (["--h", "nan"], "finite"),
        (["--h", "1e308"], "inf"),
        (["--inertia", "1", "-2", "3"], "positive"),
        (["--inertia", "1", "2"], "3 arguments"),
        (["--mu", "0", "0", "0"], "rest"),
        (["--mu", "1/0", "0", "0"], "finite"),
        (["--methods", "euler"], "rkmk4"),
        (["--out", "picture.jpg"], ".png"),
        (["--out", f"{__file__}/here"], "cannot write"),
        (["--what"], "--what"),
    ],
    ids=" ".join,
)
def test_bad_options_get_one_line_and_status_2(
    options: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as exit:
        main(options)
    printed, complained = capsys.readouterr()
    assert exit.value.code == 2 and printed == ""
    assert complaint in complained and complained.count("\n") == 1


@pytest.mark.slow
def test_a_method_that_fails_leaves_the_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--h", "20", "--out", str(tmp_path)]) == 1
    printed, complained = capsys.readouterr()
    assert "Algorithm 1, exp" not in rows(printed) and "Algorithm 1, Cayley" in rows(printed)
    assert "the solution that grows out of h = 0 ends" in complained and "try" in complained
    assert (tmp_path / "rigid_body.png").exists()


@pytest.mark.parametrize("quiet", [False, True])
def test_without_matplotlib_the_table_is_printed(
    quiet: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = builtins.__import__

    def absent(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", absent)
    status = main(["--steps", "5", "--out", str(tmp_path), *(["--quiet"] if quiet else [])])
    printed, complained = capsys.readouterr()
    advice = complained if quiet else printed
    assert status == quiet  # without a table the picture is all that was asked for
    assert 'pip install "liemech[plot]"' in advice
    assert quiet or "RKMK4" in rows(printed)


def test_help_teaches(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit:
        main(["--help"])
    printed = capsys.readouterr().out
    assert exit.value.code == 0
    for taught in ("--steps", "mu' = mu x w", "|mu|", "examples:", "--inertia 1 2 3"):
        assert taught in printed


def test_numbers_are_read_and_written() -> None:
    assert (number("2/3"), number("-1e-3"), count("1e6")) == (2 / 3, -1e-3, 1_000_000)
    assert [short(x) for x in (0.0, 1.30, 0.12, 172.4, -1.7e-3, 4.4e-16, 12345.0)] == [
        "0", "1.3", "0.12", "172", "-1.7e-3", "4.4e-16", "1.2e4"
    ]  # fmt: skip
    times = {
        2.0: "2 s",
        3e-3: "3 ms",
        2.5e-4: "250 us",
        1.2e-7: "120 ns",
        0.9999: "1 s",
        9.999e-4: "1 ms",
        4321.0: "4320 s",
    }
    assert [duration(s) for s in times] == [*times.values()]
