"""The command line: scenes run and are saved, files are strict, mistakes are named, and only what
is asked for is computed.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused
from scenes import slow

import liemech as lm
from liemech.command_line.constructors import names
from liemech.command_line.lists import method_rows
from liemech.command_line.main import COMMANDS, main
from liemech.command_line.run import explained
from liemech.command_line.scene_file import scene_file
from liemech.command_line.scenes import SCENES

BOOK = """
title = "a book"
record = ["mu", "g"]
view = ["momentum"]

[system]
name = "RigidBody"
inertia = [1.0, 1.5, 2.0]

[start]
mu = [0.5, 0.0, 0.8]
g = "identity"

[method]
name = "CovariantVariational"
retraction = "Cayley()"

[run]
h = 0.1
steps = 20
every = 5
"""


# ---------------------------------------------------------------- scenes


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_runs_and_its_method_keeps_the_energy(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", name, "--steps", "6", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["steps"] == 6 and told["files"] == []
    (energy,) = [kept for kept in told["kept"] if kept["name"] == "energy"]
    assert energy["largest change"] < 1e-2


SHOWN = "flip", "heavy-top", "kirchhoff", "pendulum"
NO_PLACE = "hares-and-foxes"
"""Its state is no place, and there is nothing to show in space."""


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", [name if name in SHOWN else slow(name) for name in SCENES if name != NO_PLACE])
def test_every_scene_can_be_shown(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("meshcat")
    assert main(["run", name, "--steps", "8", "--quiet", "--view", "--plot", "--save"]) == 0
    assert capsys.readouterr().out == ""
    assert {path.name for path in folder.iterdir()} == {f"{name}.{ending}" for ending in ("html", "png", "npz")}


def test_a_scene_without_a_place_is_plotted_and_says_so(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", NO_PLACE, "--steps", "8", "--quiet", "--view"])
    assert "whose state is no place; `run.plot()`, or --plot, draws it" in capsys.readouterr().err
    pytest.importorskip("matplotlib")
    assert main(["run", NO_PLACE, "--steps", "8", "--quiet", "--plot"]) == 0
    assert {path.name for path in folder.iterdir()} == {f"{NO_PLACE}.png"}


def test_a_scene_computes_what_it_shows_and_nothing_else() -> None:
    flip, top = SCENES["flip"](), SCENES["heavy-top"]()
    no = {"saved": False, "viewed": False, "plotted": False}
    assert flip.parts(**no) == ("mu",)
    assert flip.parts(**no | {"plotted": True}) == ("mu",)  # the momentum sphere
    assert flip.parts(**no | {"viewed": True}) == ("mu", "g")
    assert flip.changed(view=("momentum",)).parts(**no | {"viewed": True}) == ("mu",)
    assert flip.parts(**no | {"saved": True}) == ("mu", "g")
    assert top.parts(**no) == ("mu", "g")  # the motion depends on both
    run = flip.changed(steps=4).run(flip.parts(**no), 1, False)
    assert run.g is None and list(run.states) == ["mu"]


def test_explain_tells_it_and_runs_nothing(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm, "integrate", None)
    assert main(["run", "flip", "--explain"]) == 0
    told = capsys.readouterr().out
    assert "g             not computed, nothing shows it" in told and "spatial momentum: needs" in told
    assert main(["run", "flip", "--explain", "--view"]) == 0
    told = capsys.readouterr().out
    assert "g             computed, it is recorded or shown" in told and "not told" not in told


def test_another_method_and_step_reach_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["run", "free-body", "--h", "1/4", "--steps", "8", "--method", "CovariantVariational(Cayley)", "--json"])
        == 0
    )
    told = json.loads(capsys.readouterr().out)
    scene = SCENES["free-body"]()
    method = lm.CovariantVariational(lm.Cayley())
    mu = lm.integrate(scene.system, method, scene.start, h=0.25, steps=8, record="mu").mu
    assert told["last"]["mu"] == mu[-1].tolist() and told["last"]["t"] == 2.0
    assert told["method"] == repr(method)


def test_a_failing_run_leaves_what_was_computed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "run",
        "free-body",
        "--h",
        "20",
        "--steps",
        "50",
        "--method",
        "CovariantVariational()",
        "--save",
        "far.npz",
    ]
    assert main(words) == 1
    assert "try" in capsys.readouterr().err
    assert lm.Trajectory.load(folder / "far.npz").mu.shape[1] == 3


def test_ctrl_c_leaves_what_was_computed(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    integrate = lm.integrate

    def interrupted(*arguments: Any, **options: Any) -> Any:
        stopped = lm.errors.IntegrationInterrupted("interrupted")
        stopped.trajectory = integrate(*arguments, **options | {"steps": 3})
        raise stopped

    monkeypatch.setattr(lm, "integrate", interrupted)
    assert main(["run", "flip", "--save"]) == 130
    assert len(lm.Trajectory.load(folder / "flip.npz")) == 4
    assert "interrupted" in capsys.readouterr().err


def test_without_matplotlib_the_run_is_told_and_the_picture_is_missed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["run", "flip", "--steps", "3", "--plot"]) == 1
    printed, complained = capsys.readouterr()
    assert "Casimir 1" in printed and 'pip install "liemech[plot]"' in complained


# ---------------------------------------------------------------- files


def test_a_scene_file_is_the_scene_it_describes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "book.toml").write_text(BOOK)
    scene = scene_file(folder / "book.toml")
    body = lm.RigidBody([1.0, 1.5, 2.0])
    assert scene.system == body and scene.method == lm.CovariantVariational(lm.Cayley()) and scene.view == ("momentum",)
    assert main(["run", "book.toml", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    run = lm.integrate(body, scene.method, body.state([0.5, 0.0, 0.8], np.eye(3)), h=0.1, steps=20, every=5)
    assert told["samples"] == 5 and told["last"]["g"] == run.g[-1].tolist()


def test_scene_files_may_be_adaptive_tilted_and_nested(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = BOOK.replace('"identity"', "{ exp = [0.1, 0.2, 0.3] }").replace('"RigidBody"\ninertia = [1.0, 1.5, 2.0]', (
        '"LiePoissonSystem"\ngroup = "SO3"\nhamiltonian = { name = "KineticEnergy", inertia = [1.0, 1.5, 2.0] }'
    ))  # fmt: skip
    text = text[: text.index("[method]")] + '[method]\nname = "RKMK"\norder = 5\n[run]\nt_end = 2.0\nrtol = 1e-8\n'
    (folder / "tilted.toml").write_text(text)
    assert main(["run", "tilted.toml", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    body = lm.RigidBody([1.0, 1.5, 2.0])
    exact = body.exact(body.state([0.5, 0.0, 0.8], lm.SO3().exp([0.1, 0.2, 0.3])), 2.0)
    assert np.abs(exact.g - told["last"]["g"]).max() < 1e-6


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("inertia", "inertja", r"[system]: RigidBody has no 'inertja' (did you mean inertia?); allowed are inertia"),
        (
            'title = "a book"',
            "titel = 1",
            "'titel' is no key of the file (did you mean title?); allowed are title, record, view, system",
        ),
        ("steps = 20", "step = 20", "[run]: 'step' is no key of the run (did you mean steps?); allowed are h, steps"),
        ("steps = 20", "steps = 2.5", "[run]: steps must be a whole number; got 2.5"),
        ("steps = 20", "", "[run]: give h and steps"),
        ('"RigidBody"', '"RigidBodies"', "'RigidBodies' is no System (did you mean RigidBody?); there are"),
        ('"RigidBody"', '"RKMK"', "'RKMK' is no System"),
        (
            '"Cayley()"',
            '"Kayley()"',
            "[method]: retraction: 'Kayley' is no class of the library (did you mean Cayley?)",
        ),
        ('"Cayley()"', '"__import__(1)"', "is no class of the library"),
        ("mu = [0.5, 0.0, 0.8]", "mu = [0.5, 0.0]", "[start]: RigidBody.state: mu has shape (2,)"),
        ("mu = [0.5", "nu = [0.5", "[start]: 'nu' is no key of the start; allowed are mu, g"),
        ('"identity"', '"unity"', '[start]: g is "identity"'),
        ('"identity"', '{ exp = ["a"] }', "[start]: could not convert string to float"),
        ('"identity"', "{ exp = [1.0] }", "book.toml [start]: SO3.exp: xi has shape (1,)"),
        ('"identity"', "{ log = [1.0] }", "[start]: g: 'log' is no key of g; allowed are exp"),
        ("mu = [0.5, 0.0, 0.8]", 'mu = "up"', "[start]: "),
        ('"RigidBody"', '["RigidBody"]', "[system]: name must be a text such as"),
        ("[method]", "[methods]", "'methods' is no key of the file"),
        ('["momentum"]', '["moment"]', "'moment' is not known; there are body, momentum"),
        ("h = 0.1", "h = ", "is no TOML, Invalid value (at line"),
        ("[1.0, 1.5, 2.0]", "[1.0, -1.5, 2.0]", "[system]: "),
    ],
)
def test_a_wrong_file_gets_one_line_that_names_file_and_key(
    old: str, new: str, complaint: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in BOOK
    (folder / "book.toml").write_text(BOOK.replace(old, new))
    said = refused(capsys, "run", "book.toml", "--explain", "--view")
    assert complaint in said
    assert "book.toml" in said or "moment" in said


def run_of(text: str, asked: str) -> str:
    """A file with another table [run]."""
    return text.partition("[run]")[0] + f"[run]\n{asked}\n"


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        ("h = 0.1\nsteps = 1000000000000000000", "1e+18 steps; a file may ask for 1e+09 at most; --steps"),
        ("h = 0.1\nsteps = 1000000001", "1e+09 at most"),
        ("h = 1e-12\nt_end = 1e6", "1e+18 steps; a file may ask for 1e+09 at most"),
        ("h = -1e-12\nt_end = -1e6", "1e+18 steps"),
        ("h = 0.1\nsteps = 100000000\nevery = 1", "1e+08 steps; a file may ask for 1e+07 at most"),
    ],
)
def test_a_file_asks_for_no_more_than_somebody_would_wait_for(
    asked: str, complaint: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "book.toml").write_text(run_of(BOOK, asked))
    assert complaint in refused(capsys, "run", "book.toml")


def test_adaptive_steps_of_a_file_have_an_end(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every one is kept, so there are at most a million, unless the file says how many."""
    method = 'name = "CovariantVariational"\nretraction = "Cayley()"'
    assert method in BOOK
    text = BOOK.replace(method, 'name = "RKMK"\norder = 5')
    (folder / "far.toml").write_text(run_of(text, "t_end = 1e12"))
    scene = scene_file(folder / "far.toml")
    assert scene.steps == 10**6 and scene.sampling(saved=True) == 1
    (folder / "few.toml").write_text(run_of(text, "t_end = 1e12\nsteps = 30"))
    assert main(["run", "few.toml"]) == 1
    assert "30" in capsys.readouterr().err
    (folder / "many.toml").write_text(run_of(text, "t_end = 1e12\nsteps = 100000000"))
    assert "1e+07 at most" in refused(capsys, "run", "many.toml")


def test_what_does_not_exist_is_named_with_what_does(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "(did you mean flip?); `liemech scenes` lists them" in refused(capsys, "run", "flop")
    assert "did you mean heavy-top?" in refused(capsys, "run", "topp")
    assert "did you mean" not in refused(capsys, "run", "frobnicate")
    assert "did you mean run flip?" in refused(capsys, "flip")
    assert "did you mean run heavy-top?" in refused(capsys, "topp")
    assert "there are run, scenes, methods" in refused(capsys, "fly")
    assert "cannot be read" in refused(capsys, "run", "gone.toml")
    assert "does not end with .npz" in refused(capsys, "run", "flip", "--save", "run.zip")
    assert "RKMK has no 'ordr' (did you mean order?); allowed are order" in refused(
        capsys, "run", "flip", "--method", "RKMK(ordr=4)"
    )
    assert "is no Method; there are AdaptiveVerlet, BondSplitting, Boris" in refused(
        capsys, "run", "flip", "--method", "Kepler"
    )
    assert "accepts" in refused(capsys, "run", "kepler", "--method", "CovariantVariational")
    assert "is no class of the library (did you mean RigidBody?)" in refused(capsys, "check", "RigidBoby")
    assert "no module 'nowhere'" in refused(capsys, "check", "nowhere:Group")
    assert "gone.npz" in refused(capsys, "view", "gone.npz")
    (folder / "other.npz").write_bytes(b"PK")
    assert "other.npz" in refused(capsys, "view", "other.npz")


def test_saved_runs_come_back(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "lagrange-top", "--steps", "6", "--save", "top.npz", "--quiet"]) == 0
    scene = SCENES["lagrange-top"]().changed(steps=6)
    run = lm.Trajectory.load(folder / "top.npz")
    assert run.system == scene.system and (run.g == scene.run(("mu", "g"), 1, False).g).all()
    pytest.importorskip("meshcat")
    assert main(["view", "top.npz", "--out", "page.html", "--show", "vertical"]) == 0
    assert capsys.readouterr().out == "page.html\n" and (folder / "page.html").exists()


def test_view_opens_the_page(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    (folder / "page.html").write_text("")
    assert main(["view", "page.html"]) == 0
    assert opened == [(folder / "page.html").as_uri()]


# ---------------------------------------------------------------- lists, checks, measurements


def test_methods_are_listed_with_their_claims(capsys: pytest.CaptureFixture[str]) -> None:
    rows = {row["method"]: row for row in method_rows()}
    assert set(names(lm.Method)) - set(rows) <= {"ExactMoserVeselov"}
    assert rows["RKMK"] | {"about": ""} == {
        "method": "RKMK",
        "order": 4,
        "symmetric": False,
        "symplectic": False,
        "about": "",
    }
    assert rows["StormerVerlet"]["symplectic"] and rows["ExactFreeBody"]["order"] is None
    assert main(["methods"]) == 0 and main(["scenes"]) == 0
    printed = capsys.readouterr().out
    assert "LiePoissonHamiltonJacobi" in printed and "double-pendulum" in printed
    assert main(["scenes", "--json"]) == 0
    assert [row["scene"] for row in json.loads(capsys.readouterr().out)] == list(SCENES)


OWN = """
import liemech as lm
import numpy as np

@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec
    rotor: lm.Vec
    def energy(self, mu):
        return 0.5 * lm.dot(mu - self.rotor, self.gradient(mu))
    def gradient(self, mu):
        return (mu - self.rotor) / self.inertia

@lm.record
class Boastful(lm.models.Pendulum):
    def constants(self, states):
        return super().constants(states) | {"angle": states["q"][..., 0]}

system = lm.LiePoissonSystem(lm.SO3(), Gyrostat([1.0, 2.0, 3.0], [0.0, 0.2, 0.0]))
start = system.state([0.1, 1.0, 0.0])
"""


def test_check_and_bench_take_what_a_user_wrote(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "own_things.py").write_text(OWN)
    try:
        assert main(["check", "own_things:system"]) == 0
        assert "none broken" in capsys.readouterr().out
        assert main(["check", "own_things:Boastful", "--json"]) == 1
        assert "broken" in {v for report in json.loads(capsys.readouterr().out) for v in report["laws"].values()}
        words = ["--start", "own_things:start", "--steps", "50", "--h", "0.4", "--json"]
        assert main(["bench", "own_things:system", *words]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["order"] == pytest.approx(4.0, abs=0.25) and told["ns per step"] > 0.0 and told["parts"] == ["mu"]
        from own_things import system  # type: ignore[import-not-found]

        run = lm.integrate(system, lm.RKMK(order=4), system.state([0.1, 1.0, 0.0]), h=0.1, steps=3)
        run.save(folder / "own.npz")
        assert lm.Trajectory.load(folder / "own.npz", ["own_things"]).system == system
        assert "is no state" in refused(capsys, "bench", "own_things:system", "--start", "own_things:system")
    finally:
        sys.modules.pop("own_things", None)


@pytest.mark.slow
def test_methods_are_checked_on_a_system_they_accept(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "StormerVerlet"]) == 0
    assert "Kepler" in capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit:
        main([command, "--help"])
    assert exit.value.code == 0 and f"usage: liemech {command}" in capsys.readouterr().out


@pytest.mark.slow
def test_the_module_is_the_command_and_loads_no_pictures() -> None:
    code = (
        "import sys; from liemech.command_line.main import main; main(['run', 'kepler', '--steps', '3', '--quiet']); "
    )
    code += "assert not {'matplotlib', 'meshcat', 'sympy'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
    done = subprocess.run([sys.executable, "-m", "liemech", "nonsense"], capture_output=True, text=True)
    assert done.returncode == 2 and "there are run" in done.stderr


def test_explanations_of_adaptive_runs() -> None:
    scene = SCENES["kepler"]().changed(method=lm.RKMK(order=5), t_end=3.0)
    assert "adaptive, to t = 3" in explained(scene, ("q", "p"), 1)
    assert scene.changed(h=0.1, steps=4).t_end is None


def test_columns_are_apart_and_sentences_are_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition("  ")[0] for line in lines if not line.startswith(" ")] == list(SCENES)
    assert main(["methods"]) == 0
    lines += capsys.readouterr().out.splitlines()
    assert not [line for line in lines if "..." in line and "order=..." not in line]
