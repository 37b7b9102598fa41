"""Runs in files: the arrays as they are, in NumPy's .npz or in HDF5, and beside them in JSON what
they are.  Nothing is pickled.

`numpy.load("run.npz")["state.mu"]` needs no liemech.  The last bytes of a file are a checksum of
all others.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib
import io
import json
import os
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, InvalidInput, MissingExtra
from ..formulas import Record
from ..formulas.complex_numbers import Complex
from ..formulas.fields import FrozenDict
from ..formulas.tables import Table
from ..formulas.vectors import Mat, Vec
from ..integrators.ending_at_jumps import ending_at_jumps
from .arrival import FictiveMotion
from .carry import AdaptiveCarry, Carries, Carry, Ended, Waiting
from .dense import DenseOutput
from .events import Met
from .fictive import FictiveCarry, Origin
from .stopped import Stopped
from .systems import Methods, OfBodies, Systems, of_body

FORMAT = 2
HDF5 = b"\x89HDF"
KINDS = "Trajectory", "TransformedTrajectory", "TangentTrajectory"
MARK = b"sha256:"
"""What the checksum begins with, at the end of a file."""


def save(run: Any, path: str | os.PathLike[str]) -> None:
    """Write a run, all of it or nothing: a file that is there is replaced when the new one lies on
    the disk.
    """
    kind = type(run).__name__
    if kind not in KINDS:
        raise InvalidInput(
            f"Trajectory.save: a {kind} has more than "
            "samples; save the arrays you need, numpy.savez"
        )
    fictive = kind == "TransformedTrajectory"
    arrays: dict[str, Any] = {"t": run.t, **{f"state.{name}": x for name, x in run.states.items()}}
    about: dict[str, Any] = {"format": FORMAT, "h": encoded(run.h)}
    about |= {"steps": run.steps, "bodies": run.bodies}
    about |= {"method": _of_each(run.method), "system": _of_each(run.system)}
    about |= {"compiled": run.compiled, "rejected": run.rejected, "observed": list(run.observed)}
    about |= {"breaks": list(run.breaks), "ended": run.ended}
    about["stopped"] = {
        str(body): [stop.steps, str(stop.error)] for body, stop in run.stopped.items()
    }
    if fictive:
        arrays |= {"tau": run.tau} if run.z is None else {"tau": run.tau, "z": run.z}
        origins = run.origin if isinstance(run.origin, tuple) else (run.origin,)
        about["origin"] = [[encoded(o.given), encoded(o.start)] for o in origins]
        about["together"] = origins is not run.origin
    if kind == "TangentTrajectory":
        arrays |= {f"tangent.{name}": x for name, x in run.tangent.items()}
        arrays |= {} if run.tau is None else {"tau": run.tau}
        about["tangent"] = list(run.tangent)
    if isinstance(run.dense, FictiveMotion):
        arrays |= {"dense.t": run.dense.t, "dense.points": run.dense.points}
        if run.dense.begun is not None:
            arrays["dense.begun"] = run.dense.begun
    elif run.dense is not None:
        arrays["dense"] = run.dense.rows
        about["dense"] = [run.dense.order, encoded(run.dense.example)]
    about["events"] = []
    for i, event in enumerate(run.events):
        met = event if run.bodies is not None else (event,)
        arrays[f"event.{i}"] = np.concatenate([times for times, _ in met])
        for name in met[0][1].arrays:
            arrays[f"event.{i}.{name}"] = np.concatenate([states.arrays[name] for _, states in met])
        about["events"].append([list(met[0][1].arrays), [len(times) for times, _ in met]])
        about["states"] = encoded(type(met[0][1]))
    if isinstance(run.carry, Carries):
        members = enumerate(run.carry.members)
        about["carries"] = [_carried(member, f"carry.{i}", arrays) for i, member in members]
    elif run.carry is not None:
        about["carry"] = _carried(run.carry, "carry", arrays)
    packed = _in_hdf5 if Path(path).suffix in (".h5", ".hdf5") else _packed
    _replace(Path(path), packed(arrays | {"about": np.array(json.dumps(about))}))


def _of_each(thing: Any) -> Any:
    """A system or a method, or those of each body."""
    return [encoded(x) for x in thing] if isinstance(thing, OfBodies) else encoded(thing)


def _carried(carry: Any, name: str, arrays: dict[str, Any]) -> dict[str, Any]:
    """What is told of a carry; its arrays go to the others, by this name."""
    if isinstance(carry, Waiting):
        return {"state": encoded(carry.state), "waiting": carry.t}
    if isinstance(carry, Ended):
        error = None if carry.error is None else str(carry.error)
        there = [carry.t, carry.steps, error, carry.tau, carry.z]
        return {"state": encoded(carry.state), "there": there}
    if isinstance(carry, AdaptiveCarry):
        arrays |= {f"{name}.numbers": carry.numbers, f"{name}.clock": carry.clock}
        told = {"t": carry.t, "state": encoded(carry.state), "ended": carry.ended}
        return told | {"met": carry.met}
    fictive, met = isinstance(carry, FictiveCarry), carry.met
    inner = carry.inner if fictive else carry
    arrays |= {f"{name}.numbers": inner.numbers, f"{name}.last": inner.last}
    told = {"t0": inner.t0, "h": encoded(inner.h), "step": inner.step, "met": met}
    told["state"] = encoded(tuple(inner.state.parts.values()) if fictive else inner.state)
    told["failures"] = {str(i): str(error) for i, error in inner.failures.items()}
    if fictive:
        ahead = None if carry.ahead is None else tuple(carry.ahead.parts.values())
        told |= {"tau": carry.tau, "ahead": encoded(ahead)}
    return told


def _carry_of(
    kept: Any, name: str, arrays: dict[str, Any], bodies: int | None, origin: Any, decode: Any
) -> Any:
    """The carry of which that was told.  origin : of a run in fictive time."""
    state = decode(kept["state"])
    if "waiting" in kept:
        return Waiting(state, kept["waiting"])
    if "there" in kept:
        t, steps, text, tau, z = kept["there"]
        error = None if text is None else IntegrationFailure(text)
        return Ended(state, t, steps, error, tau, z, origin)
    met = Met([(event, n) for event, n in kept.get("met", ())])  # older files have none
    if "t" in kept:
        own = arrays[f"{name}.numbers"], arrays[f"{name}.clock"]
        return AdaptiveCarry(*own, state, kept["t"], kept["ended"], met)
    failures: dict[int, Exception | None] = {
        int(i): IntegrationFailure(text) for i, text in kept["failures"].items()
    }
    own = arrays[f"{name}.numbers"], arrays[f"{name}.last"]
    carry = Carry(None, kept["t0"], decode(kept["h"]), kept["step"], bodies, *own, failures, met)
    if origin is None:
        vars(carry)["state"] = state
        return carry
    kind = type(origin.whole.extended(origin.start, 0.0))
    vars(carry)["state"], ahead = kind(*state), decode(kept["ahead"])
    return FictiveCarry(origin, carry, None if ahead is None else kind(*ahead), kept["tau"], met)


def load(path: str | os.PathLike[str], modules: Sequence[str] = ()) -> dict[str, Any]:
    """Read a run: the fields of a Trajectory.

    modules : names of modules to import for the classes of the user; those that are imported
    already are found without.
    Raises InvalidInput for files that are damaged, of another kind, or whose classes are not there.
    """
    arrays, about = _unpacked(Path(path))
    allowed = frozenset(modules)
    for name in modules:
        importlib.import_module(name)

    def decode(value: Any) -> Any:
        return decoded(value, allowed, f"{path}")

    made, method = (
        kind(tuple(map(decode, told))) if isinstance(told, list) else decode(told)
        for told, kind in ((about["system"], Systems), (about["method"], Methods))
    )
    dense: Any = None
    events = []
    carry: Any = None
    origin: Any = None
    if "origin" in about:
        origin = tuple(
            [
                Origin(decode(given), of_body(method, i), decode(start))
                for i, (given, start) in enumerate(about["origin"])
            ]
        )
        if about["together"]:
            origin = origin[0]
        if "dense.t" in arrays:
            example = origin.whole.extended(origin.start, 0.0)
            points, kind = (arrays["dense.t"], arrays["dense.points"]), type(origin.start)
            dense = FictiveMotion(
                ending_at_jumps(method, origin.whole, ()),
                origin.whole,
                kind,
                example,
                about["h"],
                *points,
                None,
                arrays.get("dense.begun"),
            )
    elif "dense" in about:
        order, point = about["dense"]
        dense = DenseOutput(made, method.retraction, decode(point), arrays["dense"], order)
    for i, (names, counts) in enumerate(about["events"]):
        cls = decode(about["states"])
        met, ends = [], np.cumsum(counts)
        for first, end in zip(ends - counts, ends, strict=True):
            parts = {name: arrays[f"event.{i}.{name}"][first:end] for name in names}
            times = arrays[f"event.{i}"][first:end]
            met.append((times, cls(*(parts.get(f.name) for f in dataclasses.fields(cls)))))
        events.append(met[0] if about["bodies"] is None else tuple(met))
    if "carry" in about:
        carry = _carry_of(about["carry"], "carry", arrays, about["bodies"], origin, decode)
    elif "carries" in about:
        own = origin if isinstance(origin, tuple) else (None,) * about["bodies"]
        carry = Carries(
            tuple(
                [
                    _carry_of(told, f"carry.{i}", arrays, None, own[i], decode)
                    for i, told in enumerate(about["carries"])
                ]
            )
        )
    reasons = {
        int(body): (steps, IntegrationFailure(text))
        for body, (steps, text) in about["stopped"].items()
    }
    more: dict[str, Any] = {}
    if origin is not None:
        more = {"tau": arrays["tau"], "z": arrays.get("z"), "origin": origin}
    if "tangent" in about:
        tangent = {name: arrays[f"tangent.{name}"] for name in about["tangent"]}
        more = {"tangent": tangent, "tau": arrays.get("tau")}
    return more | {
        "system": made,
        "method": method,
        "h": decode(about["h"]),
        "t": arrays["t"],
        "states": {
            name.removeprefix("state."): x
            for name, x in arrays.items()
            if name.startswith("state.")
        },
        "bodies": about["bodies"],
        "steps": about["steps"],
        "compiled": about["compiled"],
        "stopped": Stopped(
            {body: steps for body, (steps, _) in reasons.items()}, lambda body: reasons[body][1]
        ),
        "rejected": about["rejected"],
        "dense": dense,
        "events": tuple(events),
        "carry": carry,
        "observed": tuple(about.get("observed", ())),
        "breaks": tuple(about.get("breaks", ())),
        "ended": about.get("ended"),
    }


# ------------------------------------------------------------------ records as JSON


def encoded(value: Any) -> Any:
    """A record, and what it may hold, as JSON: numbers to the last bit, classes by their names."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, type):
        return {"type": f"{value.__module__}:{value.__qualname__}"}
    if isinstance(value, Vec):
        return {"vec": [encoded(x) for x in value]}
    if isinstance(value, Mat):
        return {"mat": [encoded(row) for row in value.rows]}
    if isinstance(value, Table):
        return {"table": value.array.tolist()}
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag], "as": "complex"}
    if isinstance(value, Complex):
        return {"complex": [value.re, value.im], "as": "Complex"}
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "biufc":
        flat = np.ascontiguousarray(value)
        return {"array": flat.view(float).ravel().tolist() if flat.dtype.kind == "c" else flat.ravel().tolist(),
                "dtype": flat.dtype.str, "shape": list(value.shape)}  # fmt: skip
    if isinstance(value, (tuple, list)):
        return {type(value).__name__: [encoded(x) for x in value]}
    if isinstance(value, FrozenDict):
        return {"dict": [[encoded(k), encoded(x)] for k, x in value.items()]}
    if dataclasses.is_dataclass(value):
        cls = type(value)
        fields = {f.name: encoded(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"class": f"{cls.__module__}:{cls.__qualname__}", "fields": fields}
    raise InvalidInput(
        f"Trajectory.save: {value!r} cannot be saved; records hold "
        "numbers, vectors, matrices, texts and records"
    )


def decoded(value: Any, modules: frozenset[str], where: str) -> Any:
    """What was encoded.  Classes are found in liemech, in modules that are imported, and in
    `modules`; no code of a file runs.
    """
    if not isinstance(value, dict):
        return value
    (kind, given), *more = value.items()

    def inside(x: Any) -> Any:
        return decoded(x, modules, where)

    match kind:
        case "type":
            return _class(given, modules, where)
        case "vec":
            return Vec(*map(inside, given))
        case "mat":
            return Mat(*map(inside, given))
        case "complex":
            return Complex(*given) if value["as"] == "Complex" else complex(*given)
        case "array":
            dtype = np.dtype(value["dtype"])
            numbers = (
                np.array(given, dtype=float).view(dtype)
                if dtype.kind == "c"
                else np.array(given, dtype=dtype)
            )
            return numbers.reshape(value["shape"])
        case "table":
            return Table(given)
        case "tuple":
            return tuple(map(inside, given))
        case "list":
            return [*map(inside, given)]
        case "dict":
            return FrozenDict({inside(k): inside(x) for k, x in given})
        case "class":
            cls: Any = _class(given, modules, where)
            fields = {name: inside(x) for name, x in dict(more)["fields"].items()}
            named = (
                {f.name for f in dataclasses.fields(cls)} if dataclasses.is_dataclass(cls) else None
            )
            if named != set(fields):
                raise InvalidInput(
                    f"{where}: {cls.__qualname__} no longer has the "
                    f"fields of the file, {', '.join(fields)}"
                )
            made: Any = object.__new__(cls)
            if isinstance(made, Record):
                made.__setstate__(fields)
            else:
                for name, x in fields.items():
                    object.__setattr__(made, name, x)
            return made
    raise InvalidInput(f"{where}: there is no {kind!r} in format {FORMAT}")


def _class(path: str, modules: frozenset[str], where: str) -> Any:
    module, _, name = path.partition(":")
    if module not in sys.modules and module not in modules and module.split(".")[0] == "liemech":
        with contextlib.suppress(ImportError):
            importlib.import_module(module)
    found: Any = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    if not isinstance(found, type):
        raise InvalidInput(
            f"{where}: {name} was a class of the script that saved the run, and {where} is loaded by "
            "another one; define it there too, or save runs of a class of a module"
            if module == "__main__"
            else f"{where}: there is no class {name} in {module}; import the module before, or load "
            f"the file with modules=[{module!r}]"
        )
    return found


# ------------------------------------------------------------------ files


def _packed(arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of an .npz file whose last ones, the comment of the archive, are a checksum."""
    memory = io.BytesIO()
    np.savez(memory, **arrays)  # type: ignore[arg-type]
    with zipfile.ZipFile(memory, "a") as archive:
        archive.comment = MARK + bytes(32)
    data = memory.getvalue()
    return data[:-32] + hashlib.sha256(data[:-32]).digest()


def _unpacked(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of a file, and what is told about them."""
    data = path.read_bytes()
    if data.startswith(HDF5):
        return _of_hdf5(path, data)
    if not data.startswith(b"PK") and MARK not in data[-40:]:
        raise InvalidInput(f"{path}: is no run saved by liemech")
    if data[-39:-32] != MARK or hashlib.sha256(data[:-32]).digest() != data[-32:]:
        raise InvalidInput(
            f"{path}: is damaged or no run saved by liemech: its "
            "checksum is not that of its content"
        )
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    return arrays, _about(path, str(arrays.pop("about")))


def _about(path: Path, text: str) -> dict[str, Any]:
    """What is told about the arrays."""
    about: dict[str, Any] = json.loads(text)
    if about["format"] != FORMAT:
        raise InvalidInput(
            f"{path}: is of format {about['format']}; this liemech reads format {FORMAT}"
        )
    return about


def _in_hdf5(arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of an HDF5 file: a dataset for each array and for what is told about them, and a
    checksum as attribute.
    """
    memory = io.BytesIO()
    with _h5py().File(memory, "w") as file:
        for name, array in arrays.items():
            file[name] = str(array) if name == "about" else array
        file.attrs["checksum"] = _checksum(arrays)
    return memory.getvalue()


def _of_hdf5(path: Path, data: bytes) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of an HDF5 file, and what is told about them."""
    damaged = InvalidInput(
        f"{path}: is damaged or no run saved by liemech: its checksum is not that of its content"
    )
    h5py = _h5py()
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            arrays = {name: np.asarray(file[name]) for name in file if name != "about"}
            text, checksum = str(file["about"].asstr()[()]), file.attrs["checksum"]
    # what h5py has to say of damaged files
    except (OSError, KeyError, RuntimeError, ValueError, TypeError):
        raise damaged from None
    if checksum != _checksum(arrays | {"about": np.array(text)}):
        raise damaged
    return arrays, _about(path, text)


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    """One of names, types, shapes and bytes."""
    whole = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        whole.update(
            repr((name, array.dtype.str, array.shape)).encode()
            + np.ascontiguousarray(array).tobytes()
        )
    return whole.hexdigest()


def _h5py() -> Any:
    try:
        import h5py
    except ImportError:
        raise MissingExtra("HDF5 files need h5py", "data") from None
    return h5py


def _replace(path: Path, data: bytes) -> None:
    """Write a file under another name, and give it its own when it lies on the disk."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise
    with contextlib.suppress(OSError):  # not every system opens folders
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
