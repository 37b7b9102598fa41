"""Random calls of every public method of every shipped group, algebra, action, retraction, system,
energy: whatever people pass.

A call ends well if it gives finite numbers of the right shape, or an error of this package that
names the method and an argument (a TypeError of Python's own if the number of arguments is wrong).
Run `python tests/calls/fuzz_calls.py [count] [seed]` for a report.
"""

from __future__ import annotations

import functools
import inspect
import re
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shipped
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.formulas.classes.signatures import bare
from liemech.formulas.classes.signatures import class_text as _class_text

PATIENCE = 2.0
"""Seconds of the processor that a call may take."""


HOOKS = (
    *("distance", "of_blocks", "constants", "symmetry", "rate", "deviation", "join", "moved"),
    *("displaced", "variation"),
)
"""Methods that pass parts of a state, or of several arrays, on to others, which then name themselves."""

SHAPELESS = (
    *("constants", "symmetry", "state", "exact", "essential_part", "variation", "vouched", "further_invariants"),
    *("rotation", "rigid_transform", "objection", "tangent", "isotropy"),
)
"""Methods of states, and of objects other than arrays or of as many as there happen to be, whose
shapes nobody compares.
"""


@dataclass(frozen=True, eq=False)
class Subject:
    """An object whose methods are called, the group that its arguments belong to, and values of some arguments by name."""

    thing: Any
    group: lm.LieGroup
    given: dict[str, Any] = field(default_factory=dict)
    vector: int | None = None
    """The length of vectors that are not in the algebra or its dual."""


def groups() -> list[lm.LieGroup]:
    return [*shipped.GROUPS]


@lm.record
class Turning(lm.LinearGroupEquation):
    """g' = g xi(t)."""

    def drive(self, t: float) -> lm.Vec:
        return lm.vec(1.0 / (2.0 + t * t), t / (1.0 + t * t), 1.0)


@lm.record
class Circling(lm.HomogeneousEquation):
    """A point on a sphere."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return lm.vec(x[1], x[2], 1.0 / (2.0 + t * t))


@functools.cache
def subjects() -> tuple[Subject, ...]:
    so3, se3 = lm.SO3(), lm.SE3()
    found = [Subject(g, g) for g in groups()]
    found += [Subject(g.algebra, g) for g in groups()]
    found += [Subject(lm.coadjoint(g), g, vector=g.dim) for g in (so3, se3, lm.SU(2))]
    found += [Subject(lm.actions.AdjointAction(se3), se3, vector=6)]
    found += [Subject(lm.actions.RotationAction(lm.UnitQuaternions()), lm.UnitQuaternions(), vector=3)]
    found += [
        Subject(lm.actions.LinearAction(lm.SL(2)), lm.SL(2), vector=2),
        Subject(lm.actions.LeftMultiplication(so3), so3),
    ]
    found += [
        Subject(lm.actions.TranslationAction(4), lm.VectorSpace(4), vector=4),
        Subject(lm.actions.SphereAction(3), so3, vector=3),
    ]
    for retraction in shipped.RETRACTIONS:
        for g in (so3, se3, lm.UnitQuaternions(), lm.SU(2)):
            found.append(Subject(retraction, g, {"group": g, "action": lm.coadjoint(g)}, g.dim))
    inertia = [1.0, 1.6, 2.3]
    found += [
        Subject(lm.RigidBody(inertia), so3),
        Subject(lm.RigidBody(inertia).hamiltonian, so3),
        Subject(lm.models.HeavyTop(inertia, 1.0, [0.0, 0.1, 1.0]), so3),
        Subject(lm.models.LagrangeTop(1.0, 0.5, 1.0, 1.0), so3),
        Subject(lm.models.ReducedHeavyTop(inertia, 1.0, [0.0, 0.1, 1.0]), se3),
        Subject(lm.models.ReducedHeavyTop(inertia, 1.0, [0.0, 0.1, 1.0]).hamiltonian, se3),
        Subject(lm.models.KirchhoffBody(np.diag([1.0, 1.6, 2.3, 1.0, 2.0, 3.0])), se3),
        Subject(lm.models.FallingBody(inertia, mass=1.7), se3),
        Subject(
            lm.models.OrbitingBody([0.05, 0.08, 0.11], mass=1.7, attraction=1.0),
            lm.ProductGroup(so3, lm.VectorSpace(3)),
        ),
        Subject(lm.models.FixedPointGravity(1.0, [0.0, 0.0, 1.0]), so3, {"group": so3}),
        Subject(lm.models.UniformGravity(1.0), se3, {"group": se3}),
        Subject(lm.NoPotential(), so3, {"group": so3}),
        Subject(lm.Kepler(), lm.VectorSpace(4), vector=2),
        Subject(lm.models.HenonHeiles(), lm.VectorSpace(4), vector=2),
        Subject(lm.models.Pendulum(), lm.VectorSpace(2), vector=1),
        Subject(lm.models.DoublePendulum(), lm.VectorSpace(4), vector=2),
        Subject(Turning(so3), so3),
        Subject(Circling(lm.actions.SphereAction(3)), so3, vector=3),
    ]
    return tuple(found)


@dataclass(frozen=True)
class Method:
    """A public method and what it says of its arguments."""

    subject: Subject
    name: str

    @functools.cached_property
    def parameters(self) -> dict[str, str]:
        parameters = inspect.signature(bare(getattr(type(self.subject.thing), self.name))).parameters
        return {
            name: _class_text(p.annotation).removesuffix(" | None")
            for name, p in list(parameters.items())[
                (not inspect.ismethod(getattr(type(self.subject.thing), self.name))) :
            ]
            if p.kind is not p.VAR_POSITIONAL
        }

    @functools.cached_property
    def required(self) -> tuple[str, ...]:
        parameters = inspect.signature(bare(getattr(type(self.subject.thing), self.name))).parameters
        return tuple(name for name in self.parameters if parameters[name].default is inspect.Parameter.empty)

    def __str__(self) -> str:
        return f"{self.subject.thing!r:.60}.{self.name}"


OF_LARGE_GROUPS = {"moving", "velocity_matrix"}
"""Methods that are asked for where momenta are matrices in memory, and not on the groups here."""


@functools.cache
def methods() -> tuple[Method, ...]:
    found = []
    for subject in subjects():
        for name in dir(type(subject.thing)):
            member = inspect.getattr_static(type(subject.thing), name)
            if (
                not name.startswith("_")
                and name not in OF_LARGE_GROUPS
                and (inspect.isfunction(member) or isinstance(member, classmethod))
            ):
                method = Method(subject, name)
                if method.parameters:
                    found.append(method)
    return tuple(found)


# ------------------------------------------------------------------ arguments


def shape_of(method: Method, name: str, text: str) -> tuple[int, ...] | None:
    """The shape of one argument of a method; None if it is no array."""
    subject, kind = method.subject, text
    if text in ("Any", ""):
        kind = "Element" if name in ("g", "h", "rate") else "Vec" if name in ("mu", "x", "q", "p", "xi", "t") else ""
    if kind not in ("Vec", "Mat", "Element", "Ambient", "float"):
        return None
    if kind == "float" or name == "t":
        return ()
    if kind != "Vec":
        element = subject.group.element_shape
        matrix = element if len(element) == 2 else (3, 3)
        return element if kind != "Mat" else matrix
    if subject.vector is not None and name in ("x", "p", "q", "velocity"):
        return (subject.vector,)
    if subject.vector is not None and isinstance(subject.thing, lm.HamiltonianSystem) and name != "omega":
        return (subject.vector,)
    if isinstance(subject.thing, lm.MechanicalSystem) and name == "omega":
        return (subject.thing.group.dim,)
    if isinstance(subject.thing, lm.actions.LeftMultiplication) and name == "x":
        return subject.group.element_shape
    return (subject.group.dim,)


@functools.cache
def state_of(subject: Subject) -> Any:
    """A state of a system."""
    rng, thing = np.random.default_rng(3), subject.thing
    if isinstance(thing, lm.HamiltonianSystem):
        return thing.state(*rng.normal(size=(2, subject.vector)))
    if isinstance(thing, lm.HomogeneousEquation):
        return thing.state([0.6, 0.0, 0.8])
    if isinstance(thing, lm.GroupEquation):
        return thing.state(subject.group.random(1))
    return thing.state(rng.normal(size=subject.group.dim), subject.group.random(1))


def right(method: Method, name: str, text: str, lead: tuple[int, ...], rng: np.random.Generator) -> Any:
    """An argument as it should be."""
    subject = method.subject
    if name in subject.given:
        return subject.given[name]
    shape = shape_of(method, name, text)
    if shape is not None:
        if shape == subject.group.element_shape and (text in ("Element", "Ambient") or name in ("g", "h")):
            return subject.group.random(rng, lead)
        if isinstance(subject.thing, lm.actions.SphereAction) and name == "x":
            return subject.thing.random(rng, lead)
        numbers = rng.normal(size=(*lead, *shape))
        return numbers if shape else float(numbers) if not lead else numbers
    if name == "start" and isinstance(subject.thing, lm.models.ReducedHeavyTop):
        return lm.models.HeavyTop([1.0, 1.6, 2.3], 1.0, [0.0, 0.1, 1.0]).state([1.0, 2.0, 3.0], np.eye(3))
    if text.endswith("State") or text in ("Position", "Point") or name in ("state", "start"):
        return state_of(subject)
    choices: dict[str, Any] = {
        "int": int(rng.integers(0, 6)),
        "bool": bool(rng.integers(2)),
        "str": str(rng.choice(["right", "left"])),
        "Retraction": lm.Exponential(),
        "np.random.Generator | int": 5,
        "int | tuple[int, ...]": (2,),
    }
    if name == "rng":
        return 5
    if name == "size":
        return int(rng.integers(0, 5))
    return choices.get(text)


def wrong(method: Method, name: str, text: str, rng: np.random.Generator) -> Any:
    """An argument as it should not be, or only might."""
    shape = shape_of(method, name, text) or (3,)
    one = rng.normal(size=shape)
    size = 10.0 ** float(rng.choice([-320, -300, -160, -30, -8, 8, 30, 100, 160, 300, 308]))
    ragged = [[1.0, 2.0], [1.0]]
    masked = np.ma.masked_array(one, mask=rng.integers(0, 2, size=shape).astype(bool))
    with np.errstate(all="ignore"):
        huge = size * one
    options: list[Callable[[], Any]] = [
        lambda: 3.0, lambda: -0.0, lambda: 7, lambda: 10**400, lambda: True, lambda: None, lambda: "abc", lambda: b"abc",
        lambda: "", list, lambda: (), lambda: [[]], dict, lambda: {"mu": 1.0}, lambda: {1.0, 2.0}, lambda: object(), lambda: object,
        lambda: 1j, lambda: np.nan, lambda: np.inf, lambda: -np.inf, lambda: np.float64(2.0), lambda: np.float32(2.0),
        lambda: np.int64(3), lambda: np.bool_(True), lambda: np.array(2.0), lambda: np.datetime64("2020-01-01"),
        lambda: ragged, lambda: [1.0, "a", None], lambda: [None] * 3, lambda: np.full(shape, None), lambda: one.astype(object),
        lambda: one.astype(str), lambda: one.astype(complex), lambda: one + 1j, lambda: one > 0.0, lambda: one.astype(np.float32),
        lambda: one.astype(int), lambda: one.astype(np.longdouble), lambda: np.longdouble("1e400") * np.ones(shape, np.longdouble),
        lambda: one.tolist(), lambda: tuple(one.tolist()) if shape else 1.0, lambda: one[..., None], lambda: one[None],
        lambda: np.ones(shape[0] + 1), lambda: np.ones(max(shape[0] - 1, 0)), lambda: np.zeros((0, *shape)),
        lambda: np.zeros((2, 0)),
        lambda: np.ones((2, 2, 2, 2)), lambda: huge, lambda: huge, lambda: huge, lambda: size * np.ones(shape),
        lambda: np.where(rng.integers(0, 2, size=shape), one, np.nan),
        lambda: np.where(rng.integers(0, 2, size=shape), one, np.inf),
        lambda: np.zeros(shape), lambda: masked, lambda: np.ma.masked_array(one, mask=False), lambda: np.matrix(np.eye(3)),
        lambda: lm.vec(*[1.0] * (shape[0] + 1)), lambda: lm.vec(*[1.0] * max(shape[0] - 1, 0)), lambda: lm.vec(),
        lambda: lm.mat(lm.vec(1.0, 2.0), lm.vec(3.0, 4.0)),
        lambda: lm.SO3(), lambda: lm.SO3, lambda: lm.RigidBody([1.0, 1.6, 2.3]), lambda: lm.Exponential(),
        lambda: Rotation.identity(),
        lambda: Rotation.random(4, random_state=1), lambda: Rotation, lambda: (x for x in (1.0, 2.0, 3.0)), lambda: iter([1.0]),
        lambda: len, lambda: range(3), lambda: memoryview(b"abc"), lambda: slice(3), lambda: Ellipsis, lambda: NotImplemented,
        lambda: method.subject.group.random(rng, (5,)), lambda: 2.0 * np.eye(3), lambda: -np.eye(3), lambda: np.zeros((3, 3)),
        lambda: lm.RigidBody([1.0, 1.6, 2.3]).state([1.0, 2.0, 3.0]), lambda: np.array([{}, []], dtype=object),
        lambda: Exception("x"),
        lambda: -1, lambda: -5, lambda: 10**19 if name == "size" else 10**9, lambda: "up", lambda: ["right"], lambda: float(size),
    ]  # fmt: skip
    return options[int(rng.integers(len(options)))]()


def call(method: Method, rng: np.random.Generator) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Arguments for a call: in half of the cases one is wrong, else perhaps several."""
    names = [n for n in method.parameters if n in method.required or rng.random() < 0.5]
    lead: tuple[int, ...] = [(), (), (2,), (3, 1), (1,), (11,)][int(rng.integers(6))]
    bad = {str(rng.choice(names))} if names and rng.random() < 0.7 else {n for n in names if rng.random() < 0.4}
    texts = method.parameters
    made = {n: wrong(method, n, texts[n], rng) if n in bad else right(method, n, texts[n], lead, rng) for n in names}
    keep = len(method.required) if rng.random() < 0.8 else int(rng.integers(0, len(names) + 1))
    args = tuple(made[n] for n in list(made)[:keep])
    options = {n: made[n] for n in list(made)[keep:]}
    dice = rng.random()
    if dice < 0.01:
        return (*args, 1.0, 2.0, 3.0), options
    if dice < 0.02:
        return args, options | {"colour": 3}
    if dice < 0.03:
        return args[:-1], options
    return args, options


# ------------------------------------------------------------------ endings


def numbers_in(value: Any) -> Iterator[np.ndarray]:
    """All arrays of a result."""
    if isinstance(value, dict):
        for part in value.values():
            yield from numbers_in(part)
    elif isinstance(value, lm.Record):
        for part in getattr(value, "parts", {}).values() if isinstance(value, lm.State) else ():
            yield from numbers_in(part)
    elif isinstance(value, tuple) and not isinstance(value, lm.Vec):
        for part in value:
            yield from numbers_in(part)
    elif isinstance(value, (float, int, complex, np.ndarray, np.number, lm.Vec, lm.Mat)):
        yield np.asarray(value)


@functools.cache
def plain_shapes(method: Method) -> list[tuple[int, ...]] | None:
    """The shapes of a result for arguments that are right; None if the group has no such method."""
    rng = np.random.default_rng(11)
    for _ in range(5):
        try:
            made = {n: right(method, n, method.parameters[n], (), rng) for n in method.required}
            return [a.shape for a in numbers_in(getattr(method.subject.thing, method.name)(**made))]
        except lm.errors.LiemechError:
            continue
    return None


def leading(method: Method, arguments: dict[str, Any]) -> tuple[int, ...] | None:
    """The leading axes that a result must have; None if that cannot be told."""
    leads = []
    for name, value in arguments.items():
        if value is not method.subject.given.get(name, value):
            return None  # another group
        shape = shape_of(method, name, method.parameters[name])
        if shape is None:
            continue
        found = np.shape(value.as_matrix() if isinstance(value, Rotation) else value)
        if not isinstance(found, tuple):
            return None  # a class, whose `shape` is a property
        if len(found) < len(shape) or found[len(found) - len(shape) :] != shape:
            return None
        leads.append(found[: len(found) - len(shape)])
    return np.broadcast_shapes(*leads)


def ending(method: Method, args: tuple[Any, ...], options: dict[str, Any]) -> str:
    """What became of a call: "" if it ended well, else what is wrong with its end."""
    names = list(method.parameters)
    given = {*names[: len(args)], *options}
    counted = len(args) <= len(names) and set(options) <= set(names[len(args) :]) and set(method.required) <= given
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            result = getattr(method.subject.thing, method.name)(*args, **options)
    except lm.errors.LiemechError as error:
        if time.process_time() - begun > PATIENCE:
            return "slow"
        if isinstance(error, (lm.errors.InvalidInput, lm.errors.InvalidType)):
            somebody = re.search(r"\w(\(.*\))?\.\w+(:| has| gave) \w+", str(error)) is not None
            named = (somebody and f".{method.name}" in str(error)) or method.name in HOOKS
            if "unexpected keyword" in str(error):  # which is none of its arguments
                return "" if not counted and f"{method.name}()" in str(error) else "which keyword"
            return "" if named else f"unnamed: {type(error).__name__}: {error}"
        return "" if str(error) else "no message"
    except TypeError as error:
        counted = counted and "positional argument" not in str(error)  # of one that has to be named
        return "" if not counted else f"bare: {_shown(error)}"
    except Exception as error:
        return f"bare: {_shown(error)}"
    if time.process_time() - begun > PATIENCE:
        return "slow"
    found = list(numbers_in(result))
    if not all(a.dtype.kind in "biufc" and np.isfinite(a).all() for a in found):
        return "not finite"
    shapes, lead = plain_shapes(method), leading(method, dict(zip(names, args)) | options)
    if method.name == "energy" and isinstance(method.subject.thing, lm.NoPotential):
        return ""
    if shapes is None or lead is None or "rng" in names or method.name in SHAPELESS:
        return ""
    seen = [a.shape for a in found]
    return "" if seen == [lead + s for s in shapes] else f"shape: {seen}, not {lead} + {shapes}"


def _shown(error: Exception) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({where.filename.rpartition('/')[2]}, line {where.lineno})"


def failures(count: int, seed: int) -> list[str]:
    """What ended badly among so many calls."""
    rng, found, all_methods = np.random.default_rng(seed), [], methods()
    for _ in range(count):
        method = all_methods[int(rng.integers(len(all_methods)))]
        args, options = call(method, rng)
        what = ending(method, args, options)
        if what:
            found.append(f"{what}\n    {method}(*{args!r:.300}, **{options!r:.300})")
    return found


# ------------------------------------------------------------------ batches


def same(a: Any, b: Any) -> bool:
    """Equal bit for bit, tuples part by part."""
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def part(value: Any, i: int) -> Any:
    """Row i of a result."""
    return tuple(part(x, i) for x in value) if isinstance(value, tuple) else value[i]


def batch_failure(method: Method, rng: np.random.Generator, rows: int = 24) -> str:
    """Whether a batch is its single calls, for numbers from 1e-320 to 1e308: "" if so."""
    made = {n: right(method, n, method.parameters[n], (rows,), rng) for n in method.required}
    arrays = [n for n, a in made.items() if isinstance(a, np.ndarray)]
    for name in arrays:
        if method.parameters[name] in ("Vec", "Mat", "float", "Ambient"):
            with np.errstate(all="ignore"):
                factors = 10.0 ** rng.choice(
                    [-320, -310, -200, -100, -20, -3, 0, 0, 0, 1, 2, 20, 100, 200, 307], size=rows
                )
                made[name] = made[name] * factors.reshape(rows, *[1] * (made[name].ndim - 1))
    if not arrays:
        return ""
    call = getattr(method.subject.thing, method.name)
    singles: list[Any] = []
    for i in range(rows):
        try:
            singles.append(call(**{n: a[i] if n in arrays else a for n, a in made.items()}))
        except lm.errors.LiemechError as error:
            singles.append(error)
    well = [i for i in range(rows) if not isinstance(singles[i], Exception)]
    ill = [i for i in range(rows) if i not in well]
    if len(well) > 1:
        together = call(**{n: a[well] if n in arrays else a for n, a in made.items()})
        off = [i for k, i in enumerate(well) if not same(part(together, k), singles[i])]
        if off:
            i, k = off[0], well.index(off[0])
            return f"{method}: row {i} is {part(together, k)}, alone {singles[i]}"
    if ill:
        chosen = [*well, ill[0]]
        try:
            call(**{n: a[chosen] if n in arrays else a for n, a in made.items()})
        except lm.errors.LiemechError as error:
            return "" if type(error) is type(singles[ill[0]]) else f"{method}: {error!r}, alone {singles[ill[0]]!r}"
        return f"{method}: a row that is refused alone, {singles[ill[0]]!r}, passes in a batch"
    return ""


def of_arrays() -> list[Method]:
    """The methods that broadcast."""
    apart = {
        *SHAPELESS,
        "random",
        "split",
        "join",
        "parts",
        "moved",
        "rate",
        "knows",
        "from_top",
        "essential",
        "circular_orbit",
    }
    return [m for m in methods() if m.name not in apart and plain_shapes(m)]


if __name__ == "__main__":
    count, seed = map(int, (*sys.argv[1:], "0")[:2] if len(sys.argv) > 1 else (2000, 0))
    bad = failures(count, seed)
    print("\n".join(sorted(bad)))
    kinds = Counter(b.partition(":")[0].partition("\n")[0] for b in bad)
    print(count, "calls,", len(methods()), "methods,", len(bad), "ended badly:", dict(kinds))
