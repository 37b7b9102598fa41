"""Files that somebody made to do harm: they name nothing that is called, take no more memory than
they are long, and nothing waits for them.
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import os
import random
import subprocess
import sys
import threading
import time
import tracemalloc
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import slow
from terms_of_spins import Zeeman

import liemech as lm
from liemech.command_line.scene_file import scene_file
from liemech.rooms.files import arrays as files
from liemech.simulation.compiled.control import TAKEN

BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=np.eye(3))
KEPLER: Any = lm.Kepler()


def in_bytes(text: str) -> np.ndarray:
    return np.frombuffer(text.encode("utf-8", "surrogatepass"), np.uint8)


def turned(t: float, state: Any) -> Any:
    """An event."""
    return state.mu[1]


def runs() -> dict[str, Any]:
    """Runs of every kind that has something of its own in files."""
    fictive = lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5))
    starts = BODY.state(mu=[[1.0, 2.0, 3.0], [0.0, 1.0, 0.5]])
    many = BODY.state(mu=np.tile([1.0, 2.0, 3.0], (20, 1)))
    systems = [lm.RigidBody([1.0 + 0.01 * i, 1.6, 2.3]) for i in range(20)]
    table = lm.PiecewisePolynomial.linear(np.linspace(0.0, 2.0, 21), [[0.0, 1.0, 0.5]] * 21)
    driven = Driven(lm.VectorSpace(3), table)
    return {
        "steps": (lm.Plan(BODY, lm.CovariantVariational(), 0.1, compiled=False), START, 4),
        "adaptive": (
            lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, events=turned, compiled=False),
            START,
            3.0,
        ),
        "fictive": (
            lm.Plan(fictive, lm.AdaptiveVerlet(), 0.05, compiled=False),
            KEPLER.pericentre(0.3),
            0.33,
        ),
        "bodies": (lm.Plan(BODY, lm.RKMK(order=3), 0.1, compiled=False), starts, 4),
        "systems": (lm.Plan(systems, lm.RKMK(order=3), 0.1, compiled=False), many, 2),
        "their own": (lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, compiled=False), starts, 2.0),
        "driven": (lm.Plan(driven, lm.RKMK(order=4), 0.1, compiled=False), driven.state(np.zeros(3)), 4),
    }  # fmt: skip


@lm.record
class Driven(lm.GroupEquation):
    """A velocity by a table."""

    velocities: lm.PiecewisePolynomial

    def velocity(self, t: float, g: Any) -> lm.Vec:
        return self.velocities(t)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the files of these runs hold."""
    folder, found = tmp_path_factory.mktemp("runs"), {}
    for name, (plan, start, end) in runs().items():
        run = plan.run(start, **({"steps": end} if type(end) is int else {"t_end": end}))
        run.save(folder / "run.npz")
        found[name] = (*files.read(folder / "run.npz"), plan)
        assert repr(lm.Trajectory.load(folder / "run.npz")) == repr(run)
    return found


# ------------------------------------------------------------------ nothing is called


class Watched:
    """What the interpreter does meanwhile that a file must not be able to ask for."""

    FORBIDDEN = ("os.system", "subprocess.Popen", "os.exec", "os.posix_spawn", "os.remove", "os.rename",
                 "os.mkdir", "shutil.rmtree", "socket.connect", "ctypes.dlopen", "pickle.find_class")  # fmt: skip

    OURS = sys.stdlib_module_names | {"liemech", "numpy", "scipy"}

    def __init__(self) -> None:
        self.active, self.seen = False, []  # type: ignore[var-annotated]
        sys.addaudithook(self.hook)

    def hook(self, event: str, values: tuple[Any, ...]) -> None:
        if not self.active or threading.current_thread() is not threading.main_thread():
            return
        if event in self.FORBIDDEN:
            self.seen.append((event, values))
        if event == "import" and str(values[0]).partition(".")[0] not in self.OURS:
            self.seen.append((event, values))
        if event == "open" and "w" in str(values[1]):
            self.seen.append((event, values))

    @contextlib.contextmanager
    def __call__(self) -> Iterator[None]:
        # Python's own byte code of modules that come along is not what a file asks for
        kept, sys.dont_write_bytecode = sys.dont_write_bytecode, True
        self.active, self.seen = True, []
        try:
            yield
        finally:
            self.active, sys.dont_write_bytecode = False, kept
        assert not self.seen


watched = Watched()


def test_a_function_that_a_file_names_is_not_called(written: dict[str, Any], tmp_path: Path) -> None:
    """A time scale that is a function of the state, and the function another program."""
    arrays, about, _ = written["fictive"]
    about, path = copy.deepcopy(about), tmp_path / "run.npz"
    ((given,), (start,)), ran = about["origins"], tmp_path / "ran"
    start["fields"]["q"] = {"tuple": ["touch", str(ran)]}
    for function in (
        "liemech.viewer.chromium:subprocess.Popen",
        "subprocess:Popen",
        "liemech.rooms.fictive_time.time_scales:OfState.value",
    ):
        given["fields"]["sigma"] = {
            "class": "liemech.rooms.fictive_time.time_scales:OfState",
            "fields": {"function": {"type": function}, "names": {"tuple": ["q"]}},
        }
        files.write(path, arrays, about)
        for trusted in (False, True):
            with watched(), pytest.raises(lm.errors.InvalidInput, match=r"run\.npz: there is no class"):
                lm.Trajectory.load(path, trusted=trusted)
    assert not ran.exists()


def test_a_module_is_imported_if_the_user_trusts_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_records.py").write_text(
        "import dataclasses\nimport liemech as lm\n\n"
        "@dataclasses.dataclass(frozen=True)\nclass Note:\n    text: str = 'noted'\n\n"
        "@lm.record\nclass Noted(lm.RigidBody):\n    note: Note = Note()\n"
    )
    program = (
        "import liemech as lm, own_records\n"
        "body = own_records.Noted([1.0, 2.0, 2.5])\n"
        "lm.integrate(body, lm.RKMK(), body.state([1.0, 2.0, 3.0]), h=0.1, steps=2).save('run.npz')\n"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True)
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "run.npz"
    try:
        with watched(), pytest.raises(lm.errors.InvalidInput) as told:
            lm.Trajectory.load(path)
        assert "trusted=True" in str(told.value) and "modules=['own_records']" in str(told.value)
        assert "own_records" not in sys.modules
        run: Any = lm.Trajectory.load(path, trusted=True)
        assert run.system.note.text == "noted"
        assert lm.Trajectory.load(path, "own_records") == run
        # its records are known now, a class that is none only if the module was named
        with pytest.raises(lm.errors.InvalidInput, match="no class Note of records in own_records"):
            lm.Trajectory.load(path)
    finally:
        sys.modules.pop("own_records", None)


HOSTILE_CLASSES = (
    "os:system",
    "subprocess:Popen",
    "builtins:eval",
    "builtins:type",
    "liemech.formulas.classes.records:Record",
    "liemech.viewer.chromium:subprocess.Popen",
    "liemech.__main__:main",
    "liemech.command_line.main:main",
    "liemech.models.../../evil:Body",
    "liemech.models:../evil",
    "liemech:os",
    "liemech.models.planets.kepler:Kepler.__init__",
    "liemech.simulation.trajectory:Trajectory",
    "liemech.formulas.tables:Table",
    "../evil:Body",
    "evil:Body",
    ":",
    "",
    "__main__:__builtins__.eval",
    "numpy:ndarray",
    "pathlib:Path",
)


def test_only_records_are_classes_of_files(written: dict[str, Any], tmp_path: Path) -> None:
    arrays, about, _ = written["steps"]
    path = tmp_path / "run.npz"
    for name in HOSTILE_CLASSES:
        for kind in ({"class": name, "fields": {}}, {"type": name}, {"class": name}):
            files.write(path, arrays, about | {"system": kind})
            with watched(), pytest.raises(lm.errors.InvalidInput, match=r"run\.npz: "):
                lm.Trajectory.load(path)


OTHER_ARRAYS: dict[str, Any] = {
    "single precision": lambda x: x.astype("<f4"),
    "whole numbers": lambda x: x.astype("<i8"),
    "texts": lambda x: x.astype("<U9"),
    "complex numbers": lambda x: x.astype("<c16"),
    "one more axis": lambda x: x[..., None],
    "the last missing": lambda x: x[..., :-1],
}


@pytest.mark.parametrize("way", OTHER_ARRAYS)
def test_arrays_of_other_shapes_and_types_are_refused(way: str, written: dict[str, Any], tmp_path: Path) -> None:
    """When the file is read, or before the run goes on."""
    path, many = tmp_path / "run.npz", Zeeman(lm.each(np.ones((12, 3)))).over()
    spins = lm.LiePoissonSystem(lm.SO3() ** 12, lm.Terms(many))
    plan = lm.Plan(spins, lm.RKMK(order=2), 0.1, compiled=False)
    plan.run(spins.state(mu=np.ones((12, 3))), steps=2).save(path)
    for arrays, about, theirs in [*written.values(), (*files.read(path), plan)]:
        for name in arrays:
            if name.startswith("pool.") or (way == "the last missing" and name.startswith(("dense", "event."))):
                continue
            files.write(path, arrays | {name: OTHER_ARRAYS[way](arrays[name])}, about)
            with pytest.raises(lm.errors.InvalidInput):
                theirs.resume(lm.Trajectory.load(path), **({"t_end": 9.0} if theirs.adaptive else {"steps": 1}))


# ------------------------------------------------------------------ valid structure, hostile values

HOSTILE = (None, True, -1, 0, 3, 10**12, 2**63, -(10**30), 1e300, -1e-320, float("nan"), float("inf"),
           "", "../../etc/passwd", "sh -c id", "__class__", "os:system", "\x00", "mu", [], {}, [[]], [1, "a"],
           {"vec": []}, {"vec": ["a"]}, {"vec": [1.0] * 40}, {"mat": [1.0]}, {"mat": [{"vec": [1.0]}]}, {"vec": None},
           {"complex": [1.0, 2.0], "as": "Complex"}, {"complex": [1.0]}, {"complex": 3},
           {"array": [], "dtype": "<f8", "shape": [10**10, 0]}, {"array": [0], "dtype": "V1000000000", "shape": [1]},
           {"array": [1.0], "dtype": "O", "shape": [1]}, {"array": ["a"], "dtype": "U9", "shape": [1]},
           {"array": [1.0], "dtype": "<f8", "shape": [-1]}, {"array": [1.0, 2.0], "dtype": "<c8", "shape": [1]},
           {"table": 10**9}, {"table": [[1.0]]}, {"table": []}, {"tuple": "abc"}, {"list": [1.0]}, {"dict": [[{"dict": []}, 1]]},
           {"dict": [1]}, {"type": "liemech.groups.rigid.so3:SO3"}, {"type": "subprocess:Popen"}, {"type": 3}, {"call": "os"},
           {"class": "liemech.groups.matrices.classical:SO", "fields": {"n": 10**6}},
           {"class": "liemech.groups.vector_space:VectorSpace", "fields": {"n": 10**12}},
           {"class": "liemech.integrators.rkmk:RKMK", "fields": {}},
           {"class": "liemech.rooms.fictive_time.time_scales:OfState",
            "fields": {"function": {"type": "os:system"}, "names": {"tuple": ["q"]}}},
           {"class": "liemech.groups.rigid.so3:SO3", "fields": {}},
           {"class": "liemech.groups.rigid.so3:SO3", "fields": {"__class__": 1}},
           {"class": "liemech.groups.rigid.so3:SO3", "fields": []}, {"class": ["a"], "fields": {}},
           {"array": {"at": 0}, "dtype": "<f8", "shape": [10**9]}, {"array": {"at": -5}, "dtype": "<f8", "shape": [2]},
           {"table": {"at": 10**9, "count": 3}}, {"table": {"at": 0, "count": -1}}, {"at": 0, "count": 20, "first": {}},
           {"fields": {}, "class": 1})  # fmt: skip


def places(value: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """All containers and keys in a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, x in list(items):
        found.append((value, key))
        if isinstance(x, (dict, list)):
            places(x, found)
    return found


def forged(arrays: dict[str, Any], about: dict[str, Any], rng: random.Random) -> tuple[Any, Any]:
    """The same with one to three things that are not as they were."""
    arrays, about = dict(arrays), copy.deepcopy(about)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        at, key = rng.choice(places(about, []))
        name = rng.choice(list(arrays))
        x = arrays[name]
        way = rng.randrange(12)
        if way < 6:
            at[key] = copy.deepcopy(rng.choice(HOSTILE))
        elif way == 6:
            other, its = rng.choice(places(about, []))
            at[key] = copy.deepcopy(other[its])
        elif way == 7 and isinstance(at, dict):
            at.pop(key, None)
        elif way == 8:
            del arrays[name]
            if not arrays:
                arrays = {"t": np.zeros(3)}
        elif way == 9:
            arrays[name] = rng.choice((x[:1], x[..., :1], x.ravel(), x[None], np.zeros((0, 4)), np.zeros(3)))
        elif way == 10 and x.dtype.kind != "U":  # it may have been forged before
            arrays[name] = rng.choice((x.astype(complex), x.astype("f4"), x > 0, x.astype("U3"), x * np.nan, x * 1e300))
        else:
            arrays[rng.choice(("state.energy", "state.__class__", "dense", "carry.numbers", "state.t"))] = x
    return arrays, about


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("cases", "seed"), [(100, 26), slow(3000, 27)])
def test_forged_files_are_refused_or_read(cases: int, seed: int, written: dict[str, Any], tmp_path: Path) -> None:
    """What is read can be shown and gone on with: with whatever error, but without one of memory."""
    rng, path = random.Random(seed), tmp_path / "run.npz"
    read = refused = 0
    for _ in range(cases):
        arrays, about, plan = written[rng.choice(list(written))]
        more: Any = {"steps": 20, "t_end": 3.2} if plan.adaptive else {"steps": 2}
        files.write(path, *forged(arrays, about, rng))
        with watched():
            begun = time.process_time()
            try:
                run = lm.Trajectory.load(path)
            except lm.errors.InvalidInput as error:
                assert "run.npz" in str(error)
                refused += 1
            else:
                read += 1
                for use in (
                    repr,
                    lambda run: run.last,
                    lambda run: run.at(run.t[:2]),
                    lambda run, plan=plan, more=more: plan.resume(run, **more),
                ):
                    with contextlib.suppress(Exception):
                        use(run)
            assert time.process_time() - begun < 5.0
    assert read > cases // 20 and refused > cases // 20


@pytest.mark.parametrize("number", ["\x00", None, {"complex": [1.0, 2.0]}, [1.0, 1.6, 2.3], True, {"vec": [0.1, 0.1]}])
@pytest.mark.parametrize("name", ["h", "steps", "t0"])
@pytest.mark.parametrize("kind", ["steps", "bodies", "systems"])
def test_what_is_no_number_of_a_run_is_refused(
    kind: str, name: str, number: Any, written: dict[str, Any], tmp_path: Path
) -> None:
    """It was read, and Python's own error came of the run that went on."""
    arrays, about, _ = written[kind]
    about, path = copy.deepcopy(about), tmp_path / "run.npz"
    (about["carry"] if name == "t0" else about)[name] = number
    files.write(path, arrays, about)
    with pytest.raises(lm.errors.InvalidInput, match=rf"run\.npz: ({name} is|.* is nothing that)"):
        lm.Trajectory.load(path)


@pytest.mark.parametrize("number", [-np.inf, np.nan, -1.0, 0.5, 2.0**53])
@pytest.mark.parametrize("kind", ["steps", "bodies"])
def test_what_counts_no_steps_is_refused(kind: str, number: float, written: dict[str, Any], tmp_path: Path) -> None:
    """It was read, and a run that went on ended in an OverflowError."""
    arrays, about, _ = written[kind]
    arrays, path = copy.deepcopy(arrays), tmp_path / "run.npz"
    arrays["carry.clock"][TAKEN] = number
    files.write(path, arrays, about)
    with pytest.raises(lm.errors.InvalidInput, match=r"run\.npz: .* are no numbers of steps"):
        lm.Trajectory.load(path)


def test_samples_of_no_numbers_are_refused(written: dict[str, Any], tmp_path: Path) -> None:
    arrays, about, _ = written["steps"]
    path = tmp_path / "run.npz"
    files.write(path, arrays | {"state.mu": arrays["state.mu"][:, :0]}, about)
    with pytest.raises(lm.errors.InvalidInput, match=r"samples of mu are \(.*, 0\)"):
        lm.Trajectory.load(path)


def test_a_state_of_another_shape_is_no_place_to_stand(written: dict[str, Any], tmp_path: Path) -> None:
    arrays, about, _ = written["bodies"]
    about, path = copy.deepcopy(about), tmp_path / "run.npz"
    about["carry"]["state"]["fields"]["g"] = "\x00"
    files.write(path, arrays, about)
    with pytest.raises(lm.errors.InvalidInput, match="g, where the run stands, is"):
        lm.Trajectory.load(path)


def test_an_empty_array_of_many_rows_takes_no_memory(written: dict[str, Any], tmp_path: Path) -> None:
    """Ten thousand million lists without a number."""
    arrays, about, _ = written["steps"]
    about, path = copy.deepcopy(about), tmp_path / "run.npz"
    about["system"]["fields"]["inertia"] = {"array": [], "dtype": "<f8", "shape": [10**10, 0]}
    files.write(path, arrays, about)
    with pytest.raises(lm.errors.InvalidInput, match="is nothing that"):
        lm.Trajectory.load(path)


def test_texts_about_the_arrays_that_are_none(written: dict[str, Any], tmp_path: Path) -> None:
    arrays = written["steps"][0]
    path = tmp_path / "run.npz"
    texts = ["", "3", "[]", "{", '{"format": 2}', '{"format": "2"}', "[" * 100_000, '{"a":' * 100_000,
             "\ud800", "9" * 5000, '{"format": 2, "system": ' + '{"tuple": [' * 5_000 + "]}" * 5_000 + "}"]  # fmt: skip
    for text in texts:
        for told in (np.array(text), in_bytes(text)):  # of files of before, and of now
            path.write_bytes(files.in_npz(arrays | {"about": told}))
            with pytest.raises(lm.errors.InvalidInput, match=r"run\.npz"):
                lm.Trajectory.load(path)
    for about_ in (np.zeros(3), np.array(["a", "b"]), np.array(b"{}")):
        path.write_bytes(files.in_npz(arrays | {"about": about_}))
        with pytest.raises(lm.errors.InvalidInput, match=r"run\.npz"):
            lm.Trajectory.load(path)


# ------------------------------------------------------------------ paths


def test_nothing_waits_for_what_is_no_file(tmp_path: Path) -> None:
    """A pipe into which nobody writes, a folder, a device."""
    pipe = tmp_path / "pipe.npz"
    os.mkfifo(pipe)
    run = runs()["steps"][0].run(START, steps=1)
    for path, kind in ((pipe, "a pipe"), (tmp_path, "a folder"), (Path("/dev/zero"), "a device")):
        with pytest.raises(lm.errors.InvalidInput, match=f"is no file but {kind}"):
            lm.Trajectory.load(path)
        with pytest.raises(lm.errors.InvalidInput, match=f"is no file but {kind}"):
            scene_file(path)
        with pytest.raises(lm.errors.InvalidInput, match=f"is no file but {kind}"):
            run.save(path)
    with pytest.raises(FileNotFoundError):
        lm.Trajectory.load(tmp_path / "gone.npz")


# ------------------------------------------------------------------ bombs


def checked(data: bytes) -> bytes:
    """An archive with the checksum that it must have."""
    import hashlib

    memory = io.BytesIO(data)
    with zipfile.ZipFile(memory, "a") as archive:
        archive.comment = files.MARK + bytes(32)
    whole = memory.getvalue()[:-32]
    return whole + hashlib.sha256(whole).digest()


def npy(shape: tuple[int, ...], dtype: str, data: bytes) -> bytes:
    """An entry that says what it likes about itself."""
    memory = io.BytesIO()
    np.lib.format.write_array_header_1_0(memory, {"shape": shape, "fortran_order": False, "descr": dtype})
    return memory.getvalue() + data


@pytest.mark.parametrize("way", ["claims", "packed", "twice", "overlapping", "objects", "many", "folders"])
def test_an_archive_that_grows_when_it_is_read(way: str, written: dict[str, Any], tmp_path: Path) -> None:
    path, memory = tmp_path / "run.npz", io.BytesIO()
    kind = zipfile.ZIP_DEFLATED if way == "packed" else zipfile.ZIP_STORED
    with zipfile.ZipFile(memory, "w", kind) as archive:
        if way == "claims":
            archive.writestr("t.npy", npy((1_250_000_000,), "<f8", b"12345678"))
        elif way == "packed":
            archive.writestr("t.npy", npy((20_000_000,), "|i1", bytes(20_000_000)))
        elif way == "twice":
            archive.writestr("t.npy", npy((1,), "<f8", bytes(8)))
            with pytest.warns(UserWarning, match="Duplicate"):
                archive.writestr("t.npy", npy((1,), "<f8", bytes(8)))
        elif way == "overlapping":
            archive.writestr("t.npy", npy((100_000,), "<f8", bytes(800_000)))
            for i in range(200):
                twin = copy.copy(archive.filelist[0])
                twin.filename = f"state.{i}.npy"
                archive.filelist.append(twin)
                archive.NameToInfo[twin.filename] = twin
        elif way == "objects":
            archive.writestr("t.npy", npy((1,), "|O", bytes(8)))
        elif way == "many":
            archive.writestr("t.npy", npy((10**6, 10**6, 0), "<f8", b""))
            archive.writestr("about.npy", npy((10**10,), "<U0", b""))
        else:
            archive.writestr("../../t.npy", npy((1,), "<f8", bytes(8)))
    path.write_bytes(checked(memory.getvalue()))
    tracemalloc.start()
    try:
        with watched(), pytest.raises(lm.errors.InvalidInput, match=r"run\.npz: is"):
            lm.Trajectory.load(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * path.stat().st_size + 5_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("way", ["fill", "packed", "elsewhere", "link", "virtual", "about", "checksum", "group"])
def test_an_hdf5_file_that_grows_when_it_is_read(way: str, written: dict[str, Any], tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    arrays, about, _ = written["steps"]
    path.write_bytes(files.in_hdf5(arrays | {"about": in_bytes(json.dumps(about))}))
    with h5py.File(path, "r+") as file:
        del file["t"]
        if way == "fill":  # chunks that were never written
            file.create_dataset("t", (1_700_000_000,), "f8", chunks=(1000,))
        elif way == "packed":
            file.create_dataset("t", data=np.zeros(3_000_000), compression="gzip")
        elif way == "elsewhere":
            file.create_dataset("t", (100,), "u1", external=[("/etc/passwd", 0, 100)])
        elif way == "link":
            file["t"] = h5py.ExternalLink("/tmp/other.h5", "t")
        elif way == "virtual":
            layout = h5py.VirtualLayout((1_000_000_000,), "f8")
            file.create_virtual_dataset("t", layout)
        elif way == "about":
            del file["about"]
            file.create_dataset("about", (1_000_000_000,), "S8", chunks=(1000,))
        elif way == "checksum":
            file["t"] = arrays["t"]
            file.attrs["checksum"] = np.zeros(4000)
        else:
            file.create_group("t")
    tracemalloc.start()
    try:
        with pytest.raises(lm.errors.InvalidInput, match=r"run\.h5: is damaged"):
            lm.Trajectory.load(path)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()


# ------------------------------------------------------------------ scenes

SCENE = """
[system]
name = "RigidBody"
inertia = {inertia}
[start]
mu = [1.0, 0.0, 0.0]
[method]
name = "{method}"
[run]
h = 0.1
steps = 2
"""


@pytest.mark.parametrize(
    "inertia",
    [
        "\"os:system('touch ran')\"",
        "\"os:system\"",
        "\"builtins:eval('1')\"",
        "\"subprocess:Popen(['touch', 'ran'])\"",
        "\"__import__('os').system('touch ran')\"",
        "\"[].__class__\"",
        "\"(lambda: 1)()\"",
        "\"integrate(1)\"",
        "\"lm.SO3()\"",
        "\"Record.__subclasses__()\"",
        "\"evil:Body\"",
        "{ name = \"os:system\", command = \"touch ran\" }",
        "\"1 if 1 else 2\"",
        "\"'a' * 1000000000000\"",
        "\"10 ** 1000000000\"",
        f"\"{'(' * 5000}\"",
        f"\"{'-' * 50000}1\"",
        f"\"{'9' * 5000}\"",
        f"{'[' * 50000}",
        "[inf, 1.0, 1.0]",
        "\"TodaLattice(1000000000)\"",
        "{ name = \"TodaLattice\", particles = 1000000000 }",
    ],
)  # fmt: skip
@pytest.mark.parametrize("trusted", [False, True])
def test_a_text_of_a_scene_is_never_code(
    inertia: str, trusted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("scene.toml")
    path.write_text(SCENE.format(inertia=inertia, method="RKMK"))
    with watched(), pytest.raises(lm.errors.InvalidInput, match=r"scene\.toml"):
        scene_file(path, trusted)
    assert not Path("ran").exists()


def test_a_scene_names_modules_if_the_user_trusts_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own_methods.py").write_text("import liemech as lm\nclass Mine(lm.RKMK):\n    pass\n")
    Path("scene.toml").write_text(SCENE.format(inertia="[1.0, 2.0, 2.5]", method="own_methods:Mine"))
    try:
        with pytest.raises(lm.errors.InvalidInput, match="--trusted imports the modules that it names"):
            scene_file(Path("scene.toml"))
        assert "own_methods" not in sys.modules
        assert type(scene_file(Path("scene.toml"), trusted=True).method).__name__ == "Mine"
    finally:
        sys.modules.pop("own_methods", None)


def test_a_scene_is_a_short_text(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    with path.open("wb") as file:
        file.truncate(10**12)  # takes no room
    with pytest.raises(lm.errors.InvalidInput, match="is longer than"):
        scene_file(path)
