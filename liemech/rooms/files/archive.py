"""Saving and loading of runs: arrays in binary, everything else as JSON.  Nothing is pickled."""

from __future__ import annotations

import dataclasses
import datetime
import importlib
import math
import os
import platform
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileWarning, IntegrationFailure, InvalidInput, MissingExtra, warn
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.records import records_in
from ...groups.composed.power import PowerGroup
from ...groups.composed.species import SpeciesGroup
from ...integrators.ending_at_jumps import ending_at_jumps
from ...integrators.method import Method
from ...joints.link import LinkShape
from ...simulation.between.dense import DenseOutput, DenseOutputs
from ...simulation.between.events import Met
from ...simulation.checkpoint import require_ending
from ...simulation.compiled.control import CLOCK, REJECTED, TAKEN
from ...simulation.compiled.systems import Methods, OfBodies, Systems, each_of, of_body
from ...simulation.runs.carry import Carry, SiteCarry
from ...simulation.stopped import Stopped
from ...systems.canonical import CanonicalState
from ...systems.lie_poisson import BodyState, with_sites
from ...systems.system import State, System, small_state
from ..fictive_time.arrival import FictiveMotion
from ..fictive_time.origin import FictiveCarry, Origin
from ..poisson.poisson import PoissonState
from ..sites.runs.between import SitesDense
from ..sites.runs.states import kind_of
from .arrays import read, write
from .encoding import LARGEST, LIBRARY, POOL, Decoder, Pool, encoded, encoded_each
from .labelled import to_csv

FORMAT = 4
READ = 2, 3, 4
"""Formats that can be read: 4 has long lists of numbers beside the text; in 2 the run stands in another
way, so that it cannot be gone on with.
"""
KINDS = "Trajectory", "TransformedTrajectory", "TangentTrajectory"


def save(run: Any, path: str | os.PathLike[str]) -> None:
    """Write a run, all of it or nothing: a file that is there is replaced when the new one lies on
    the disk.
    """
    if require_ending(path) == ".csv":
        to_csv(run, path)
        return
    kind = type(run).__name__
    if kind not in KINDS:
        raise InvalidInput(f"Trajectory.save: a {kind} has more than samples; save the arrays you need, numpy.savez")
    pool, fictive = Pool(), kind == "TransformedTrajectory"
    arrays: dict[str, Any] = {"t": run.t, **{f"state.{name}": x for name, x in run.states.items()}}
    about: dict[str, Any] = {"format": FORMAT, "written": here(), "h": encoded(run.h, pool)}
    about |= {"steps": run.steps, "bodies": run.bodies}
    about |= {"method": _of_each(run.method, pool), "system": _of_each(run.system, pool)}
    about |= {"compiled": run.compiled, "rejected": run.rejected, "observed": list(run.observed)}
    about |= {"breaks": list(run.breaks), "ended": run.ended, "parts": list(run.states)}
    about["stopped"] = {str(body): [stop.steps, str(stop.error)] for body, stop in run.stopped.items()}
    if fictive:
        arrays |= {"tau": run.tau} if run.z is None else {"tau": run.tau, "z": run.z}
        origins = run.origin if isinstance(run.origin, tuple) else (run.origin,)
        about["origins"] = [encoded_each([getattr(o, x) for o in origins], pool) for x in ORIGIN]
        about["together"] = origins is not run.origin
    if kind == "TangentTrajectory":
        arrays |= {f"tangent.{name}": x for name, x in run.tangent.items()}
        arrays |= {} if run.tau is None else {"tau": run.tau}
        about["tangent"] = list(run.tangent)
        arrays |= {
            f"tangent.{k}.{i}.{name}": x
            for k, event in enumerate(run.time_tangents)
            for i, by_name in enumerate(event if run.bodies else (event,))
            for name, x in by_name.items()
        }
    if isinstance(run.dense, FictiveMotion):
        arrays |= {"dense.t": run.dense.t, "dense.points": run.dense.points}
        if run.dense.begun is not None:
            arrays["dense.begun"] = run.dense.begun
    elif run.dense is not None:
        each = run.dense.bodies if run.bodies is not None else (run.dense,)
        arrays["dense"] = np.concatenate([motion.rows for motion in each])
        about["dense"] = [each[0].order, encoded(each[0].example, pool)]
        if run.bodies is not None:
            about["dense"].append([len(motion.rows) for motion in each])
        if isinstance(each[0], SitesDense):
            about["dense.sites"] = each[0].sites
    about["events"] = []
    for i, event in enumerate(run.events):
        zeros = event if run.bodies is not None else (event,)
        arrays[f"event.{i}"] = np.concatenate([times for times, _ in zeros])
        for name in zeros[0][1].arrays:
            arrays[f"event.{i}.{name}"] = np.concatenate([states.arrays[name] for _, states in zeros])
        about["events"].append([list(zeros[0][1].arrays), [len(times) for times, _ in zeros]])
        about["states"] = encoded(type(zeros[0][1]))
    if run.carry is not None:
        about["carry"] = _carried(run.carry, arrays, pool)
    write(Path(path), arrays | pool.arrays, about)


ORIGIN = "given", "start"
"""The fields of the origin of a run in fictive time that are kept."""


def here() -> dict[str, str]:
    """The versions, platform and date of the writer of a file."""
    versions = {
        "liemech": sys.modules[LIBRARY].__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return versions | {"platform": f"{platform.system()} {platform.machine()}", "date": now}


def told_apart(written: Any, now: dict[str, str]) -> str:
    """The differences of library, Python and machine between a file and here, in words; empty without any."""
    if not isinstance(written, dict):
        return ""
    differences = []
    for name in ("liemech", "python", "platform"):
        version, version_here = str(written.get(name, "?")), now[name]
        digits = -1 if name == "python" else None  # without the last number of its version
        if version.split(".")[:digits] != version_here.split(".")[:digits]:
            differences.append(f"{'Python' if name == 'python' else name} {version} (here {version_here})")
    return ", ".join(differences)


def _of_each(thing: Any, pool: Pool) -> Any:
    """A system or a method, or those of each body."""
    return encoded_each([*thing], pool) if isinstance(thing, OfBodies) else encoded(thing, pool)


def _carried(carry: Any, arrays: dict[str, Any], pool: Pool) -> dict[str, Any]:
    """The JSON part of a carry; its arrays are added to `arrays`."""
    if isinstance(carry, SiteCarry):
        parts = {f"carry.state.{part}": x for part, x in carry.state.arrays.items()}
        arrays |= {"carry.numbers": carry.numbers} | parts
        arrays |= {} if carry.clock is None else {"carry.clock": carry.clock}
        fields = {"t0": carry.t0, "h": carry.h, "step": carry.step, "sites": list(carry.state.arrays)}
        return fields | {"met": carry.met, "ended": carry.event}
    fictive = isinstance(carry, FictiveCarry)
    inner = carry.inner if fictive else carry
    arrays |= {f"carry.{name}": getattr(inner, name) for name in ("numbers", "clock", "last")}
    if fictive and carry.here is not None:
        arrays["carry.here"] = carry.here
    errors = {str(i): None if error is None else str(error) for i, error in inner.ended.items()}
    return {
        "t0": inner.t0.tolist() if isinstance(inner.t0, np.ndarray) else inner.t0,
        "state": encoded(tuple(inner.state.parts.values()) if fictive else inner.state, pool),
        "ended": errors,
        "met": [[i, met] for i, met in carry.met.items()],
        "cut": [[i, event] for i, event in inner.cut.items()],
    }


def _carry_of(fields: Any, arrays: dict[str, Any], bodies: int | None, origin: Any, decode: Decoder) -> Any:
    """The carry that `_carried` wrote.  origin : of a run in fictive time."""
    if "sites" in fields:
        _require_numbers(f"{decode.where}: h", fields["h"], (float, int), None)
        _require_numbers(f"{decode.where}: step", fields["step"], (int,), None)
        parts = {part: arrays[f"carry.state.{part}"] for part in fields["sites"]}
        kinds: Any = {"mu": BodyState, "y": PoissonState, "q": CanonicalState}
        by_site = "mu" in parts and np.ndim(parts["mu"]) == 2  # else of several species, in a row
        state_of_sites = kind_of(parts)(**parts) if by_site else small_state(kinds[fields["sites"][0]], parts)
        zeros = Met([(event, n) for event, n in fields.get("met", ())])
        arrays_of_sites = arrays["carry.numbers"], state_of_sites, zeros, arrays.get("carry.clock")
        return SiteCarry(fields["t0"], fields["h"], fields["step"], *arrays_of_sites, fields.get("ended"))
    state: Any = decode(fields["state"])
    kind: Any = State if origin is None else tuple
    if not isinstance(state, kind):
        raise InvalidInput(f"{decode.where}: {state!r} is no state")
    numbers, clock, last = (arrays[f"carry.{name}"] for name in ("numbers", "clock", "last"))
    lead = () if bodies is None else (bodies,)
    if origin is None:
        for name, x in state.arrays.items():
            if x.dtype.kind not in "fc" or x.shape[: len(lead)] != lead:
                raise InvalidInput(f"{decode.where}: {name}, where the run stands, is {x!r}")
    for array, height in (numbers, len(numbers)), (clock, CLOCK.width), (last, len(last)):
        _require_shape(decode.where, array, (height, *lead))
    counts = clock[[TAKEN, REJECTED]]
    if not ((counts >= 0.0) & (counts < 2.0**53) & (counts == np.floor(counts))).all():
        raise InvalidInput(f"{decode.where}: {counts.tolist()!r} are no numbers of steps")
    t0 = np.array(fields["t0"]) if isinstance(fields["t0"], list) else fields["t0"]
    ended = {int(i): None if text is None else IntegrationFailure(text) for i, text in fields["ended"].items()}
    each = {i: Met([(event, n) for event, n in counts]) for i, counts in fields["met"]}
    cut = dict(fields["cut"])
    met_by_body = {} if origin is not None else each
    carry = Carry(None, t0, numbers, clock, last, bodies, ended, met_by_body, cut)
    if origin is None:
        vars(carry)["state"] = state
        return carry
    first, standing = origin[0] if isinstance(origin, tuple) else origin, arrays.get("carry.here")
    if standing is not None:
        _require_shape(decode.where, standing, (len(last) + 2, *lead))
    vars(carry)["state"] = type(first.whole.extended(first.start, 0.0))(*state)
    return FictiveCarry(origin, carry, standing, each)


def load(path: str | os.PathLike[str], modules: Sequence[str] = (), trusted: bool = False) -> dict[str, Any]:
    """Read a run: the fields of a Trajectory.

    modules : names of modules to import for the classes of the user; those that are imported
    already are found without.  trusted : modules that the file names are imported.
    Raises InvalidInput for files that are damaged, of another kind, or whose classes are not there.
    """
    path = Path(path)
    named = (modules,) if isinstance(modules, str) else tuple(modules)
    for name in named:
        importlib.import_module(name)
    try:
        arrays, about = read(path)
        differs = told_apart(about.get("written"), here())
        if about.get("format") not in READ:
            raise InvalidInput(
                f"{path}: is of format {about.get('format')!r}, and liemech {here()['liemech']} reads "
                f"formats {READ[0]} to {FORMAT}: load it with the version that wrote it"
                f"{f': {differs}' if differs else ''}"
            )
        if about["format"] == 2 and about.keys() & {"carry", "carries"}:
            about = {name: x for name, x in about.items() if name not in ("carry", "carries")}
            warn(
                f"{path}: is of format 2, in which a run stands in another way: its samples are here, "
                "and no plan goes on from them but from run.last, as a start",
                FileWarning,
            )
        pool = {name: arrays.pop(name) for name in [*arrays] if name.startswith(POOL)}
        numbers = sum([x.size for x in [*arrays.values(), *pool.values()]])
        decode = Decoder(f"{path}", frozenset(named), bool(trusted), pool, max(LARGEST, numbers))
        fields = _run_of(arrays, about, decode) | {"written": about.get("written")}
        outside = [] if trusted else meshes_outside(fields["system"], path)
        if outside:
            warn(
                f"{path}: its bodies are shown by files outside of its folder, {', '.join(outside)}: a picture "
                "of it holds what they hold; if you know them, load it with trusted=True",
                FileWarning,
            )
        if differs:
            warn(
                f"{path}: was written elsewhere: {differs}; the samples are as they were, what is "
                "computed of them, or goes on from them, may differ in the last digits",
                FileWarning,
            )
        return fields
    except (MissingExtra, OSError):
        raise
    # anything may come of damaged content
    except Exception as error:
        if isinstance(error, InvalidInput) and str(error).startswith(f"{path}: "):
            raise
        reason = f"{error}".partition("\n")[0] or type(error).__name__
        raise InvalidInput(f"{path}: is damaged or was not written by Trajectory.save: {reason}") from error


def meshes_outside(system: Any, path: Path) -> list[str]:
    """The mesh files that show the bodies of systems and do not lie in the folder of a saved run."""
    folder = path.resolve().parent
    shapes = [shape for law in each_of(system) for shape in records_in(law, LinkShape)]
    names = sorted({shape.file for shape in shapes if shape.file is not None})
    return [name for name in names if not Path(name).resolve().is_relative_to(folder)]


def _run_of(arrays: dict[str, Any], about: dict[str, Any], decode: Decoder) -> dict[str, Any]:
    """The fields of a Trajectory from the content of a file."""
    bodies = about["bodies"]
    if bodies is not None and type(bodies) is not int:
        raise InvalidInput(f"{decode.where}: {bodies!r} is no number of bodies")
    for name, x in arrays.items():
        if x.dtype != np.dtype(complex if x.dtype.kind == "c" and name.endswith(".g") else float):
            raise InvalidInput(f"{decode.where}: {name!r} is an array of {x.dtype} instead of doubles")
    h = decode(about["h"])
    for name, x, kinds, of_each in (
        ("h", h, (float, int), True),
        ("steps", about["steps"], (int,), False),
        ("rejected", about["rejected"], (int, type(None)), True),
    ):
        _require_numbers(f"{decode.where}: {name}", x, kinds, bodies if of_each else None)
    system = _one_or_each(about["system"], System, Systems, bodies, decode)
    method = _one_or_each(about["method"], Method, Methods, bodies, decode)
    states = _states_of(arrays, about, bodies, system, decode)
    origin = _origin_of(about, method, decode) if about.keys() & {"origin", "origins"} else None
    dense: Any = None
    if origin is not None and "dense.t" in arrays:
        dense = _fictive_motion_of(arrays, h, method, origin, decode)
    elif origin is None and "dense" in about:
        motion = about["dense"], about.get("dense.sites")
        dense = _dense_of(arrays["dense"], *motion, system, method, decode)
    events = tuple([_event_of(i, arrays, about, system, bodies, decode) for i in range(len(about["events"]))])
    ended = about.get("ended")
    numbers = ended if isinstance(ended, list) else [ended]
    if not all(number is None or (type(number) is int and 0 <= number < len(events)) for number in numbers):
        raise InvalidInput(f"{decode.where}: {ended!r} is the number of no event")
    if ended is not None and (len(ended) if isinstance(ended, list) else None) != bodies:
        raise InvalidInput(f"{decode.where}: {ended!r} has not one entry for each of {bodies or 1} bodies")
    encoded_carry, reasons = about.get("carry"), {int(i): x for i, x in about["stopped"].items()}
    if encoded_carry is not None:
        none = () if about["rejected"] is None else (type(None),)  # adaptive steps have no t0
        _require_numbers(f"{decode.where}: t0", encoded_carry["t0"], (float, int, *none), bodies)
    carry = None if encoded_carry is None else _carry_of(encoded_carry, arrays, bodies, origin, decode)
    first = (
        origin.start if isinstance(origin, Origin) else None if origin is not None else getattr(carry, "state", None)
    )
    if first is not None:
        _require_samples(decode.where, states, events, first, system, about.get("observed", ()), bodies)
    fields_of_kind: dict[str, Any] = {}
    if origin is not None:
        fields_of_kind = {"tau": arrays["tau"], "z": arrays.get("z"), "origin": origin}
    samples = arrays["t"].shape[:1]
    if fields_of_kind and arrays["tau"].shape not in (samples, (*samples, bodies)):
        raise InvalidInput(f"{decode.where}: tau has shape {arrays['tau'].shape}, the times {arrays['t'].shape}")
    if "tangent" in about:
        tangent = {name: arrays[f"tangent.{name}"] for name in about["tangent"]}
        fields_of_kind = {"tangent": tangent, "tau": arrays.get("tau")}
        times = [
            [
                {n: arrays[f"tangent.{k}.{i}.{n}"] for n in tangent if n not in ("along", "against")}
                for i in range(bodies or 1)
            ]
            for k in range(len(events))
        ]
        fields_of_kind["time_tangents"] = tuple([tuple(x) if bodies else x[0] for x in times])
    return fields_of_kind | {
        "system": system,
        "method": method,
        "h": h,
        "t": arrays["t"],
        "states": states,
        "bodies": bodies,
        "steps": about["steps"],
        "compiled": about["compiled"],
        "stopped": Stopped(
            {i: steps for i, (steps, _) in reasons.items()}, lambda i: IntegrationFailure(reasons[i][1])
        ),
        "rejected": about["rejected"],
        "dense": dense,
        "events": events,
        "carry": carry,
        "observed": tuple(about.get("observed", ())),
        "breaks": tuple([float(t) for t in about.get("breaks", ())]),
        "ended": tuple(ended) if isinstance(ended, list) else ended,
    }


def _one_or_each(written: Any, kind: type, of_each: Any, bodies: int | None, decode: Decoder) -> Any:
    """A system or a method, or those of each body, which `_of_each` wrote."""
    if isinstance(written, dict) and "class" in written:
        return decode.record(written, kind)
    several = of_each(tuple(decode.each(written, kind)))
    if len(several) != bodies:
        raise InvalidInput(f"{decode.where}: {several!r} are not those of {bodies} bodies")
    return several


def _states_of(
    arrays: dict[str, Any], about: dict[str, Any], bodies: int | None, system: Any, decode: Decoder
) -> dict[str, np.ndarray]:
    """The samples, by the names of the parts of the state."""
    states = {name.removeprefix("state."): x for name, x in arrays.items() if name.startswith("state.")}
    # not every kind of file keeps the order of its arrays
    parts = about.get("parts", list(states))
    if not isinstance(parts, list) or sorted(map(str, parts)) != sorted(states):
        raise InvalidInput(f"{decode.where}: samples of {', '.join(states)} are told as {parts!r}")
    t = arrays["t"]
    if t.ndim != 1 and (bodies is None or t.shape[1:] != (bodies,)):
        raise InvalidInput(f"{decode.where}: the times have shape {t.shape}")
    for name, x in states.items():
        if len(x) != len(t) or (bodies is not None and x.shape[1:2] != (bodies,)):
            raise InvalidInput(f"{decode.where}: the samples of {name} have shape {x.shape}, the times {t.shape}")
    first = of_body(system, 0)
    group = getattr(first, "configurations", getattr(first, "group", None))
    if "mu" in states and "mu" not in about.get("observed", ()) and isinstance(group, (PowerGroup, SpeciesGroup)):
        shape = states["mu"].shape[1 if bodies is None else 2 :]
        if math.prod(shape) != group.dim:
            raise InvalidInput(
                f"{decode.where}: its momenta have shape {shape}, and those of {group!r} {group.dim} numbers"
            )
    return {name: states[name] for name in parts}


def _origin_of(about: dict[str, Any], method: Any, decode: Decoder) -> Any:
    """The origin of a run in fictive time, or a tuple with one for each body."""
    columns = about["origins"] if "origins" in about else [*zip(*about["origin"], strict=True)]
    systems, starts = decode.each(columns[0], System), decode.each(columns[1], State)
    pairs = enumerate(zip(systems, starts, strict=True))
    origins = tuple([Origin(system, of_body(method, i), start) for i, (system, start) in pairs])
    return origins[0] if about["together"] else origins


def _fictive_motion_of(arrays: dict[str, Any], h: Any, method: Any, origin: Origin, decode: Decoder) -> FictiveMotion:
    """The motion between the samples of a run in fictive time."""
    example = origin.whole.extended(origin.start, 0.0)
    t, points, start = arrays["dense.t"], arrays["dense.points"], arrays.get("dense.begun")
    width = layout_of(example).width
    if points.shape[1:] == (width,):  # of older files
        points = np.column_stack([points, np.zeros(len(points))])
    _require_shape(decode.where, t, points.shape[:1])
    _require_shape(decode.where, points, (len(t), width + 1))
    if start is not None:
        _require_shape(decode.where, start, (width + 1,))
    cut, rows = ending_at_jumps(method, origin.whole, ()), np.column_stack([t, points])
    return FictiveMotion(cut, origin.whole, type(origin.start), example, h, rows, None, start)


def _dense_of(
    rows: np.ndarray, description: Any, sites: int | None, system: Any, method: Any, decode: Decoder
) -> DenseOutput | DenseOutputs | SitesDense:
    """The motion between adaptive steps, of one body or of each.  sites : of systems of many."""
    (order, _, *counts), example = description, decode.record(description[1], State)
    least, dim = layout_of(example).width, system.group.dim
    if sites is not None:
        fits = type(sites) is int and sites > 0 and of_body(system, 0).site_form is not None
        least, dim = least * sites if fits else rows.shape[1], sites if fits else 1
    terms, excess = divmod(rows.shape[1] - 1 - least, dim)
    if terms < 0 or excess:
        raise InvalidInput(f"{decode.where}: rows of {rows.shape[1]} numbers are no way")
    _require_shape(decode.where, rows, rows.shape[:1] + rows.shape[1:2])

    def motion_of(i: int, part_rows: np.ndarray) -> Any:
        law, method_of_body = of_body(system, i), of_body(method, i)
        if sites is not None:
            return SitesDense(law, method_of_body, example, sites, part_rows, order)
        return DenseOutput(law, method_of_body.retraction, example, part_rows, order)

    if not counts:
        return motion_of(0, rows)
    ends = np.cumsum(counts[0])
    if not len(ends) or min(counts[0]) < 1 or ends[-1] != len(rows):
        raise InvalidInput(f"{decode.where}: {counts[0]!r} steps are not {len(rows)} rows")
    return DenseOutputs(tuple([motion_of(i, part) for i, part in enumerate(np.split(rows, ends[:-1]))]))


def _event_of(
    i: int, arrays: dict[str, Any], about: dict[str, Any], system: Any, bodies: int | None, decode: Decoder
) -> Any:
    """Times and states at which event i was met, or those of each body."""
    names, counts = about["events"][i]
    cls = decode(about["states"])
    if not (isinstance(cls, type) and issubclass(cls, State)):
        raise InvalidInput(f"{decode.where}: {cls!r} is no class of states")
    zeros, ends = [], np.cumsum(counts)
    for name in (f"event.{i}", *[f"event.{i}.{part}" for part in names]):
        if min(counts) < 0 or len(arrays[name]) != ends[-1] or (name == f"event.{i}" and arrays[name].ndim != 1):
            raise InvalidInput(f"{decode.where}: {name!r} has shape {arrays[name].shape} for {ends[-1]} zeros")
    for first, end in zip(ends - counts, ends, strict=True):
        parts = {name: arrays[f"event.{i}.{name}"][first:end] for name in names}
        times = arrays[f"event.{i}"][first:end]
        zeros.append((times, with_sites(system, cls(*(parts.get(f.name) for f in dataclasses.fields(cls))), 1)))
    return zeros[0] if bodies is None else tuple(zeros)


def _require_samples(
    where: str, states: dict[str, np.ndarray], events: Any, like: State, system: Any, observed: Any, bodies: int | None
) -> None:
    """Refuse samples, and states at events, that are of another shape than the state at which the run stands; at zeros of
    sums over many sites there are none of the sites.
    """
    lead, zeros = 0 if bodies is None else 1, [x for event in events for x in ((event,) if bodies is None else event)]
    parts, parts_of_zeros = like.arrays, with_sites(system, like, lead).arrays
    samples = [(len(x), x, n, parts[n].shape, ()) for n, x in states.items() if n in parts and n not in observed]
    for t, at in zeros:
        for n, x in at.arrays.items():
            if n in parts:
                shape = parts_of_zeros[n].shape[lead:]
                samples.append((t.size, x, n, shape, (t.size, 0, *shape[1:]) if shape else ()))
    for count, x, name, shape, of_no_site in samples:
        if count and (x.shape not in ((count, *shape), of_no_site) or x.dtype != parts[name].dtype):
            raise InvalidInput(
                f"{where}: {count} samples of {name} are {x.shape} of {x.dtype}; one is {shape} of {parts[name].dtype}"
            )


def _require_numbers(where: str, value: Any, kinds: tuple[type, ...], bodies: int | None) -> None:
    """Refuse what is neither a number of these kinds nor, of an ensemble, one for each body."""
    each = value.tolist() if isinstance(value, np.ndarray) and value.ndim == 1 else value
    each = each if isinstance(each, list) and bodies == len(each) else [each]
    if not all(type(x) in kinds for x in each):
        raise InvalidInput(f"{where} is {value!r}, where a run has {kinds[0].__name__}s")


def _require_shape(where: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    """Refuse an array of another shape or type, which native code would read beyond its end."""
    if array.shape != shape or array.dtype != np.dtype(float):
        raise InvalidInput(f"{where}: wanted is an array of {shape} floats; got {array.shape} of {array.dtype}")
