"""Files of runs: how large they are, who has written them, and that those of before are still read."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.rooms.files import archive
from liemech.rooms.files import arrays as files
from liemech.rooms.files.encoding import Decoder, Pool, encoded, encoded_each

OLD = Path(__file__).parent / "old_files"
"""Of liemech 0.1.0 in November 2026, format 2."""
BODY = lm.RigidBody([1.0, 1.5, 2.0])


def ensemble(n: int, suffix: str, folder: Path) -> tuple[lm.Trajectory, Path]:
    rng = np.random.default_rng(3)
    systems = [lm.RigidBody(J) for J in rng.uniform(1.0, 1.4, (n, 3))]
    starts = BODY.state(rng.normal(size=(n, 3)), lm.SO3().random(1, n))
    run = lm.integrate(systems, lm.RKMK(order=4), starts, h=0.1, steps=60)
    path = folder / f"{n}{suffix}"
    run.save(path)
    return run, path


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_parameters_of_many_systems_are_arrays(suffix: str, tmp_path: Path) -> None:
    """The text about 300 systems is as long as that about 30, and the file little longer than the samples."""
    lengths = []
    for n in (30, 300):
        run, path = ensemble(n, suffix, tmp_path)
        _, about = files.read(path)
        lengths.append(len(str(about)))
        assert path.stat().st_size < 1.2 * sum(x.nbytes for x in run.states.values()) + 8000
        again = lm.Trajectory.load(path)
        assert again == run and [*again.system] == [*run.system]
    assert abs(lengths[1] - lengths[0]) < 100


def test_text_is_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    run = lm.integrate(BODY, lm.RKMK(order=4), BODY.state([1.0, 2.0, 3.0]), h=0.1, steps=2)
    run.save(path)
    with np.load(path) as raw:
        text = raw["about"]
        assert text.dtype == np.uint8 and '"format": 4' in text.tobytes().decode()
    arrays, about = files.read(path)
    files.write(path, arrays, about | {"note": "Kreisel, Euler'sche Gleichungen: ẋ = ω × x"})
    assert files.read(path)[1]["note"].endswith("ω × x") and lm.Trajectory.load(path) == run


def test_long_tables_and_arrays_are_there_once() -> None:
    pool = Pool()
    table = lm.PiecewisePolynomial.linear(np.linspace(0.0, 1.0, 30), np.ones((30, 2)))
    many = [encoded(table, pool) for _ in range(4)]
    numbers = np.arange(50.0) * (1 + 2j)
    told = encoded({1: numbers}.get(1), pool)
    sizes = {name: x.size for name, x in pool.arrays.items()}
    alone = Pool()
    encoded(table, alone)
    assert sizes["pool.float64"] == alone.arrays["pool.float64"].size
    decode = Decoder("here", pool=pool.arrays)
    back = [decode(x) for x in many]
    assert all(x == table for x in back) and np.array_equal(decode(told), numbers)
    assert decode(told).dtype == complex


def test_what_is_not_of_one_kind_is_told_one_by_one() -> None:
    pool = Pool()
    of_groups = [lm.SO(3), lm.SO(4)] * 10  # integers are parts of the formulas
    told = encoded_each(of_groups, pool)
    assert isinstance(told, list) and Decoder("here").each(told, lm.SO) == of_groups
    bodies = [lm.RigidBody([1.0 + i, 2.0 + i, 2.5 + i]) for i in range(20)]
    told = encoded_each(bodies, pool)
    assert told.keys() == {"first", "count", "at"}
    assert Decoder("here", pool=pool.arrays).each(told, lm.RigidBody) == bodies


@pytest.mark.slow
def test_a_file_takes_no_more_than_its_pool(tmp_path: Path) -> None:
    """Numbers that are asked for outside of it, more of them than are there, of another type, again and again."""
    pool = {"pool.float64": np.arange(100.0), "pool.bool": np.zeros(8, bool)}
    for bad in (
        {"table": {"at": 90, "count": 11}},
        {"table": {"at": -1, "count": 5}},
        {"table": {"at": 0, "count": -5}},
        {"table": {"at": 0.0, "count": 5}},
        {"table": {"at": True, "count": 5}},
        {"array": {"at": 0}, "dtype": "<f8", "shape": [10, 11]},
        {"array": {"at": 0}, "dtype": "<f8", "shape": [-10, -10]},
        {"array": {"at": 0}, "dtype": "<i8", "shape": [10]},
        {"array": {"at": 0}, "dtype": "O", "shape": [10]},
        {"tuple": [{"table": {"at": i, "count": 60}} for i in range(2)]},
    ):
        with pytest.raises(lm.errors.InvalidInput, match="here: "):
            Decoder("here", pool=pool)(bad)
    again = Decoder("here", pool=pool)({"tuple": [{"table": {"at": 3, "count": 97}}] * 1000})
    assert len({*map(id, again)}) == 1 and float(again[0].array[0]) == 3.0
    _, path = ensemble(30, ".npz", tmp_path)
    arrays, about = files.read(path)
    for name, value in (("count", 10**12), ("count", -1), ("count", 29), ("first", 3)):
        forged: Any = copy.deepcopy(about)
        forged["system"][name] = value
        files.write(path, arrays, forged)
        with pytest.raises(lm.errors.InvalidInput, match=r"30\.npz: "):
            lm.Trajectory.load(path)


# ------------------------------------------------------------------ versions


def test_files_say_who_wrote_them_and_loading_what_differs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.npz"
    run = lm.integrate(BODY, lm.RKMK(order=4), BODY.state([1.0, 2.0, 3.0]), h=0.1, steps=2)
    run.save(path)
    assert run.written is None
    written = lm.Trajectory.load(path).written
    assert written["liemech"] == lm.__version__ and written["numpy"] == np.__version__
    assert {"python", "platform", "date"} <= written.keys() and written["date"].endswith("+00:00")
    here = archive.here()
    monkeypatch.setattr(archive, "here", lambda: here | {"liemech": "9.0", "python": "3.99.1"})
    with pytest.warns(lm.errors.FileWarning, match=rf"liemech {lm.__version__} \(here 9\.0\), Python"):
        assert lm.Trajectory.load(path) == run
    monkeypatch.setattr(archive, "here", lambda: here | {"date": "later", "numpy": "99"})
    lm.Trajectory.load(path)  # warnings are errors in this suite
    arrays, about = files.read(path)
    about["format"], about["written"]["liemech"] = 5, "2.0"
    files.write(path, arrays, about)
    with pytest.raises(lm.errors.InvalidInput, match=r"load it with the version that wrote it: liemech 2\.0"):
        lm.Trajectory.load(path)


@pytest.mark.parametrize("name", ["body.npz", "body.h5", "systems.npz", "adaptive.npz", "fictive.npz"])
def test_files_of_before_are_read(name: str) -> None:
    """They do not say who wrote them, and plans go on from their last state only."""
    with pytest.warns(lm.errors.FileWarning, match=r"no plan goes on from them but from run\.last"):
        old = lm.Trajectory.load(OLD / name)
    assert old.written is None and old.carry is None
    systems = [lm.RigidBody([1.0 + 0.01 * i, 1.5, 2.0]) for i in range(3)]
    kepler: Any = lm.Kepler()
    fictive = lm.TimeTransformed(kepler, lm.time_scales.DistancePower(1.5))
    two = kepler.state([[1.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [0.0, 0.9]])
    one, starts = BODY.state([0.5, 0.0, 0.75], np.eye(3)), BODY.state([[0.5, 0.0, 0.75]] * 3)
    off: Any = {"compiled": False}
    now, more = {
        "body": (lambda: (lm.Plan(BODY, lm.RKMK(order=4), h=0.1, **off), one), {"steps": 3}),
        "systems": (lambda: (lm.Plan(systems, lm.RKMK(order=4), h=0.1, **off), starts), {"steps": 3}),
        "adaptive": (lambda: (lm.Plan(systems, lm.RKMK(order=5), rtol=1e-6, **off), starts), {"t_end": 1.0}),
        "fictive": (lambda: (lm.Plan(fictive, lm.AdaptiveVerlet(), h=0.05, **off), two), {"t_end": 0.3}),
    }[name.partition(".")[0]]  # fmt: skip
    plan, start = now()
    run = plan.run(start, **more)
    rounding = 1e-6 if name == "adaptive.npz" else 1e-13  # its first step was chosen otherwise
    for part, values in run.states.items():
        assert np.allclose(old.states[part], values, rtol=rounding, atol=0.1 * rounding)
    if old.bodies is None:
        further = plan.run(old.last, **more)
        assert np.allclose(further.mu[0], run.mu[-1], rtol=1e-13)
