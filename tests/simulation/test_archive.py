"""Runs in files: all of it comes back, damage is seen, and a killed run goes on where it was."""

from __future__ import annotations

import copy
import dataclasses
import enum
import inspect
import io
import json
import os
import pickle
import signal
import subprocess
import sys
import time
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.command_line.constructors import names, read
from liemech.command_line.lists import EXAMPLES
from liemech.command_line.scenes import SCENES
from liemech.names import everything
from liemech.rooms.files import arrays as files
from liemech.rooms.files.encoding import encoded

BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=np.eye(3))


@lm.record
class Mine(lm.Hamiltonian):
    """A Hamiltonian of one's own, with fields of all kinds."""

    inertia: lm.Vec
    shape: lm.Mat
    name: str = "mine"
    powers: tuple[int, ...] = (2, 4)
    scale: float = 0.1

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, mu / self.inertia) + self.scale * mu[0] ** self.powers[1]


TOP = lm.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])
OWN = lm.LiePoissonSystem(lm.SO3(), Mine([1.0, 2.0, 3.0], np.diag([1.0, 1e-300, -0.0])))
SU2 = lm.LiePoissonSystem(lm.SU(2), lm.KineticEnergy([1.0, 2.0, 3.0]))
CASES = {
    "body": (lm.Plan(BODY, lm.Composition(lm.CovariantVariational(lm.Cayley()), order=4), 0.05, compiled=False), START),
    "top": (lm.Plan(TOP, lm.LieVerlet(), 0.05, compiled=False), TOP.state(mu=[0.1, 0.2, 5.0], g=np.eye(3))),
    "canonical": (
        lm.Plan(lm.Kepler(), lm.StormerVerlet(), 0.01, compiled=False),
        lm.Kepler().state(q=[0.4, 0.0], p=[0.0, 2.0]),
    ),
    "own": (lm.Plan(OWN, lm.RKMK(order=4), 0.05, compiled=False), OWN.state(mu=[0.1, 0.2, 5.0])),
    "complex": (lm.Plan(SU2, lm.RKMK(order=4), 0.05, compiled=False), SU2.state(mu=[0.1, 0.2, 0.5], g=np.eye(2))),
    "several": (
        lm.Plan([BODY, lm.RigidBody([1.0, 1.1, 1.2])], lm.RKMK(order=3), 0.1, compiled=False),
        BODY.state(mu=[[1.0, 2.0, 3.0], [0.0, 1.0, 0.5]]),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_saved_run_comes_back_and_goes_on(case: str, tmp_path: Path) -> None:
    plan, start = CASES[case]
    run, whole = plan.run(start, steps=12, t0=0.2), plan.run(start, steps=20, t0=0.2)
    run.save(tmp_path / "run.npz")
    again = lm.Trajectory.load(tmp_path / "run.npz")
    assert repr(again) == repr(run)
    assert repr(again.system) == repr(run.system)
    assert again.states.keys() == run.states.keys()
    assert all(np.array_equal(x, run.states[name]) for name, x in again.states.items())
    assert np.array_equal(again.energy, run.energy)
    joined = again.then(plan.resume(again, steps=8))
    assert np.array_equal(joined.t, whole.t)
    assert all(np.array_equal(x, whole.states[name]) for name, x in joined.states.items())
    with np.load(tmp_path / "run.npz") as plain:  # without liemech
        assert np.array_equal(plain["t"], run.t)


@pytest.mark.slow
def test_whatever_the_library_has_can_be_in_files() -> None:
    """Read in a process that knows nothing but the library."""
    made = [getattr(scene(), part) for scene in SCENES.values() for part in ("system", "method", "start")]
    made += [read(EXAMPLES.get(name, name), lm.Method, name) for name in names(lm.Method)
             if name in EXAMPLES or not inspect.signature(everything()[name]).parameters]  # fmt: skip
    program = (
        "import sys, json, liemech as lm\nfrom liemech.rooms.files.encoding import Decoder\n"
        "print(*(repr(Decoder('file')(x)) for x in json.load(sys.stdin)), sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=json.dumps([*map(encoded, made)]),
        text=True,
        capture_output=True,
        check=True,
    )
    assert done.stdout == "\n".join(map(repr, made)) + "\n"


def test_adaptive_runs_come_back_with_the_way_between_the_steps(tmp_path: Path) -> None:
    def event(t: float, state: Any) -> float:
        return float(state.mu[1])

    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-8, events=event, compiled=False)
    run = plan.run(START, t_end=20.0)
    run.save(tmp_path / "run.npz")
    again = lm.Trajectory.load(tmp_path / "run.npz")
    times = np.linspace(0.0, 20.0, 37)
    assert np.array_equal(again.at(times).mu, run.at(times).mu)
    assert len(run.events[0][0]) > 0
    assert np.array_equal(again.events[0][0], run.events[0][0])
    assert np.array_equal(again.events[0][1].g, run.events[0][1].g)
    assert np.array_equal(plan.resume(again, t_end=25.0).mu, plan.resume(run, t_end=25.0).mu)


def test_what_stopped_is_told(tmp_path: Path) -> None:
    starts = BODY.state(mu=[[0.1, 0.2, 0.3], [1e200, 2e200, 3e200]])
    with pytest.warns(RuntimeWarning, match="1 of 2"):
        run = lm.integrate(BODY, lm.RKMK(order=2), starts, h=1e150, steps=4, compiled=False)
    run.save(tmp_path / "run.npz")
    again = lm.Trajectory.load(tmp_path / "run.npz")
    assert again.stopped.keys() == run.stopped.keys() != set()  # type: ignore[comparison-overlap]
    body = min(run.stopped)
    assert str(again.stopped[body].error) == str(run.stopped[body].error)


def test_every_damage_is_seen(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    CASES["body"][0].run(START, steps=3).save(path)
    data = path.read_bytes()
    rng = np.random.default_rng(7)
    damaged = [data[:n] for n in {0, 1, 39, 40, *rng.integers(0, len(data), 60).tolist()}]
    for at, bit in zip(rng.integers(0, len(data), 500).tolist(), rng.integers(0, 8, 500).tolist(), strict=True):
        damaged.append(data[:at] + bytes([data[at] ^ (1 << bit)]) + data[at + 1 :])
    for bad in [*damaged, data + b"x", b"hello"]:
        path.write_bytes(bad)
        with pytest.raises(lm.errors.InvalidInput, match=r"run\.npz: is (damaged|no run)"):
            lm.Trajectory.load(path)


def test_a_hostile_file_runs_no_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither pickles nor modules that nobody has imported."""
    (tmp_path / "evil.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "run.npz"
    CASES["body"][0].run(START, steps=3).save(path)
    arrays, about = files.read(path)
    hostile = (
        {"class": "evil:Body", "fields": {}},
        {"type": "os:system"},
        {"class": "os:stat_result", "fields": {}},
        {"call": "os"},
    )
    for system in hostile:
        about["system"] = system
        files.write(path, arrays, about)
        with pytest.raises(lm.errors.InvalidInput, match=r"run\.npz"):
            lm.Trajectory.load(path)
    assert not (tmp_path / "ran").exists()
    memory = io.BytesIO()
    np.savez(memory, about=np.array([object()], dtype=object), allow_pickle=True)
    assert zipfile.is_zipfile(memory)


def test_a_class_of_another_script_is_told(tmp_path: Path) -> None:
    program = (
        "import sys, liemech as lm\n"
        "class Scripted(lm.RigidBody):\n    pass\n"
        "def local():\n    class Inner(lm.RigidBody):\n        pass\n    return Inner\n"
        "for name, kind in (('run', Scripted), ('inner', local())):\n"
        "    body = kind([1.0, 1.5, 2.0])\n"
        "    run = lm.integrate(body, lm.RKMK(), body.state([0.1, 0.2, 0.3]), h=0.1, steps=2)\n"
        "    run.save(f'{name}.npz')\n"
        "assert lm.Trajectory.load('run.npz').system == Scripted([1.0, 1.5, 2.0])\n"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True)
    with pytest.raises(lm.errors.InvalidInput, match="Scripted was a class of the script that"):
        lm.Trajectory.load(tmp_path / "run.npz", trusted=True)
    with pytest.raises(lm.errors.InvalidInput, match="Inner of __main__ was defined inside of a"):
        lm.Trajectory.load(tmp_path / "inner.npz")


def test_what_cannot_be_saved_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.npz").write_text("before")
    system = lm.LiePoissonSystem(lm.SO3(), Called(lambda mu: 0.5 * lm.dot(mu, mu)))
    run = lm.integrate(system, lm.RKMK(order=2), system.state(mu=[1.0, 2.0, 3.0]), h=0.1, steps=2, compiled=False)
    with pytest.raises(lm.errors.InvalidInput, match="cannot be saved; records hold numbers"):
        run.save(tmp_path / "run.npz")
    assert (tmp_path / "run.npz").read_text() == "before"
    assert os.listdir(tmp_path) == ["run.npz"]


class Shape(enum.StrEnum):
    FLAT = "flat"


class Kind(enum.IntEnum):
    FLAT = 1


class Reversed(float):
    def __mul__(self, other: Any) -> float:
        return -float(self) * other


@pytest.mark.parametrize("value", [Shape.FLAT, Kind.FLAT, Reversed(2.0), np.longdouble("0.1"), int], ids=repr)
def test_what_would_come_back_as_something_else_is_refused(value: Any, tmp_path: Path) -> None:
    """A formula may ask `is Shape.FLAT`, which no text that is read from a file is."""
    run = run_holding(value)
    with pytest.raises(lm.errors.InvalidInput, match=r"Trajectory\.save: .* cannot be saved"):
        run.save(tmp_path / "run.npz")


@pytest.mark.parametrize(
    "value",
    [
        np.array([[1.0 + 2.0j, -0.0j]]),
        np.array([1.0 + 2.0j, np.inf], dtype="c8"),
        np.array([True, False]),
        np.array(3.5),
        np.zeros((0, 3)),
        np.int64(3),
        np.float32(0.1),
        np.True_,
        float("nan"),
    ],
    ids=repr,
)
def test_a_record_comes_back_with_what_it_held(value: Any, tmp_path: Path) -> None:
    run = run_holding(value)
    run.save(tmp_path / "run.npz")
    again = lm.Trajectory.load(tmp_path / "run.npz")
    system: Any = again.system
    found = system.hamiltonian.value
    assert type(found) is type(value)
    assert np.asarray(found).dtype == np.asarray(value).dtype
    assert np.asarray(found).tobytes() == np.asarray(value).tobytes()
    assert again == run
    assert again != run_holding(0.25)


@lm.record
class Holding(lm.Hamiltonian):
    value: Any

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, mu)


@lm.record
class Derived(lm.Hamiltonian):
    scale: float

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "half", 0.5 * self.scale)

    def energy(self, mu: lm.Vec) -> float:
        return self.half * lm.dot(mu, mu)  # type: ignore[attr-defined,no-any-return]


def test_what_a_formula_misses_is_told_and_not_taken_for_a_part_of_the_run(tmp_path: Path) -> None:
    """What a class keeps beside its fields is not in a file."""
    system = lm.LiePoissonSystem(lm.SO3(), Derived(2.0))
    start = system.state(mu=[1.0, 2.0, 3.0])
    run = lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=2, compiled=False)
    run.save(tmp_path / "run.npz")
    again = lm.Trajectory.load(tmp_path / "run.npz")
    with pytest.raises(RuntimeError, match=r"Trajectory\.energy could not be made.*'half'"):
        again.energy  # noqa: B018
    assert not hasattr(again, "half")


@lm.record
class Tilted(lm.Hamiltonian):
    """An energy by an angle in degrees, kept in radians."""

    angle: float
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 10.0 <= self.angle <= 90.0:
            raise ValueError("angle is in degrees, 10 to 90")
        object.__setattr__(self, "angle", np.deg2rad(self.angle).item())
        object.__setattr__(self, "names", ("root", *self.names))

    def energy(self, mu: lm.Vec) -> float:
        return self.angle * lm.dot(mu, mu)


def test_what_a_class_of_a_user_made_of_its_fields_is_not_made_again(tmp_path: Path) -> None:
    """In files, pickles, copies: radians are no degrees."""
    system = lm.LiePoissonSystem(lm.SO3(), Tilted(60.0))
    start = system.state(mu=[1.0, 2.0, 3.0])
    run = lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=2, compiled=False)
    run.save(tmp_path / "run.npz")
    for again in (lm.Trajectory.load(tmp_path / "run.npz"), pickle.loads(pickle.dumps(run)), copy.deepcopy(run)):
        assert again.system.hamiltonian.angle == np.pi / 3.0
        assert again.system.hamiltonian.names == ("root",)
        assert np.array_equal(again.energy, run.energy)


def run_holding(value: Any) -> lm.Trajectory:
    system = lm.LiePoissonSystem(lm.SO3(), Holding(value))
    start = system.state(mu=[1.0, 2.0, 3.0])
    return lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=2, compiled=False)


@pytest.mark.parametrize("suffix", ["npz", "h5"])
@pytest.mark.parametrize("case", ["body", "canonical"])
def test_the_parts_of_states_keep_their_order(case: str, suffix: str, tmp_path: Path) -> None:
    """HDF5 sorts the names of arrays; the motion between the samples is by the order in the state."""
    if suffix == "h5":
        pytest.importorskip("h5py")
    plan, start = CASES[case]
    run = plan.run(start, steps=6)
    run.save(tmp_path / f"run.{suffix}")
    again = lm.Trajectory.load(tmp_path / f"run.{suffix}")
    assert list(again.states) == list(run.states)
    t = 2.5 * run.h
    found, wanted = again.at(t).arrays, run.at(t).arrays
    assert all(np.array_equal(found[name], x) for name, x in wanted.items())
    swapped = dataclasses.replace(run, states=dict(reversed(run.states.items())))
    found = swapped.at(t).arrays
    assert all(np.array_equal(found[name], x) for name, x in wanted.items())


@lm.record
class Called(lm.Hamiltonian):
    function: Any

    def energy(self, mu: lm.Vec) -> float:
        return self.function(mu)


# ------------------------------------------------------------------ checkpoints


@pytest.mark.parametrize("every", [1, 7])
def test_a_checkpoint_is_the_run_so_far(every: int, tmp_path: Path) -> None:
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.05, every=every, compiled=False)
    whole = plan.run(START, steps=300)
    plan.run(START, steps=300, checkpoint=tmp_path / "run.npz", checkpoint_every=0.0)
    part = lm.Trajectory.load(tmp_path / "run.npz")
    assert 0 < part.carry.step <= 300
    rest = plan.resume(part, steps=300 - part.carry.step)
    joined = part.then(rest)
    assert np.array_equal(joined.t, whole.t)
    assert np.array_equal(joined.mu, whole.mu)


def test_a_folder_that_is_not_there_is_told_by_the_name_that_was_given(tmp_path: Path) -> None:
    run, path = CASES["body"][0].run(START, steps=3), tmp_path / "nowhere" / "run.npz"
    with pytest.raises(FileNotFoundError) as told:
        run.save(path)
    assert told.value.filename == str(path)
    with pytest.raises(TypeError, match="PathLike"):
        lm.Trajectory.load(None)  # type: ignore[arg-type]


def test_where_a_checkpoint_may_lie(tmp_path: Path) -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1)
    with pytest.raises(lm.errors.InvalidInput, match="a folder that exists"):
        plan.run(START, steps=3, checkpoint=tmp_path / "nowhere" / "run.npz")
    with pytest.raises(lm.errors.InvalidInput, match="number of seconds; got -1"):
        plan.run(START, steps=3, checkpoint=tmp_path / "run.npz", checkpoint_every=-1.0)


def test_files_are_like_other_files(tmp_path: Path) -> None:
    """New ones obey the umask, old ones keep their mode, links stay; what was left is swept."""
    run, path = CASES["body"][0].run(START, steps=3), tmp_path / "run.npz"
    before = os.umask(0o027)
    try:
        run.save(path)
        assert path.stat().st_mode & 0o777 == 0o640
        path.chmod(0o604)
        run.save(path)
        assert path.stat().st_mode & 0o777 == 0o604
        link = tmp_path / "elsewhere" / "link.npz"
        link.parent.mkdir()
        for target in (Path("..") / "run.npz", Path("..") / "new.npz"):
            link.unlink(missing_ok=True)
            link.symlink_to(target)
            run.save(link)
            assert link.is_symlink() and lm.Trajectory.load(link.parent / target) == run
        assert os.listdir(link.parent) == ["link.npz"]
    finally:
        os.umask(before)
    program = (  # killed while it writes
        "import os, sys, liemech as lm\nfrom liemech.rooms.files import arrays as files\n"
        "os.fsync = lambda handle: os.kill(os.getpid(), 9)\n"
        f"lm.Trajectory.load({str(path)!r}).save({str(path)!r})"
    )
    for _ in range(2):
        subprocess.run([sys.executable, "-c", program], check=False)
        assert len([x for x in os.listdir(tmp_path) if x.endswith(".part")]) == 1
    mine = tmp_path / files.unfinished(path).name  # of a process that is alive
    mine.write_text("")
    others = tmp_path / ".run.npz.notes.part"
    others.write_text("")
    run.save(path)
    assert {*os.listdir(tmp_path)} == {"run.npz", "new.npz", "elsewhere", mine.name, others.name}
    assert lm.Trajectory.load(path) == run


PROGRAM = """
import sys, numpy as np, liemech as lm
from liemech.simulation import checkpoint
checkpoint.SHARE = 1e9  # it does nothing but write
body = lm.RigidBody([1.0, 1.6, 2.3])
plan = lm.Plan(body, lm.CovariantVariational(lm.Cayley()), 0.05, every=10)
plan.run(body.state(mu=[0.5, -0.3, 0.75], g=np.eye(3)), steps=10**7, checkpoint=sys.argv[1], checkpoint_every=0.0)
"""


@pytest.mark.slow
@pytest.mark.compiled
def test_a_killed_run_leaves_a_whole_file(tmp_path: Path) -> None:
    """Killed at random moments: each file loads, and goes on bit for bit."""
    path, rng = tmp_path / "run.npz", np.random.default_rng(3)
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.05, every=10, compiled=True)
    reached = []
    for _ in range(50):
        path.unlink(missing_ok=True)
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(path)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        while not path.exists() and process.poll() is None:
            time.sleep(0.01)
        time.sleep(float(rng.uniform(0.0, 0.3)))
        process.send_signal(signal.SIGKILL)
        process.wait()
        part = lm.Trajectory.load(path)
        reached.append(part.carry.step)
        if len(reached) % 10 == 0:
            whole = plan.run(START, steps=part.carry.step + 50)
            assert np.array_equal(part.then(plan.resume(part, steps=50)).mu, whole.mu)
    assert max(reached) > min(reached) > 0


# ---------------------------------------------------------------- formulas that are others now


@lm.record
class Stiff(lm.Hamiltonian):
    """An energy of one's own, with a constant of its class."""

    scale = 2.0

    def energy(self, mu: lm.Vec) -> float:
        """Some energy."""
        return self.scale * lm.dot(mu, mu) + mu[0] ** 4


def test_a_run_says_that_its_formulas_have_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another power, another constant of the class; not other words of documentation."""
    system = lm.LiePoissonSystem(lm.SO3(), Stiff())
    start = system.state([1.0, 2.0, 3.0])
    run = lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=2, compiled=False)
    run.save(tmp_path / "run.npz")

    def loaded() -> list[warnings.WarningMessage]:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            assert np.array_equal(lm.Trajectory.load(tmp_path / "run.npz").mu, run.mu)
        return told

    def energy(self: Any, mu: lm.Vec) -> float:
        """Other words."""
        return self.scale * lm.dot(mu, mu) + mu[0] ** 4

    def other(self: Any, mu: lm.Vec) -> float:
        return self.scale * lm.dot(mu, mu) + mu[0] ** 6

    assert not loaded()
    monkeypatch.setattr(Stiff, "energy", energy)
    assert not loaded()
    monkeypatch.setattr(Stiff, "energy", other)
    (told,) = loaded()
    assert told.category is lm.errors.FormulaWarning and "Stiff" in str(told.message)
    monkeypatch.undo()
    monkeypatch.setattr(Stiff, "scale", 3.0)
    assert [w.category for w in loaded()] == [lm.errors.FormulaWarning]
    monkeypatch.undo()
    assert not loaded()
