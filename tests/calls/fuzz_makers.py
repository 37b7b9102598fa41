"""Random calls of what makes things: constructors, tableaus, checks, and the methods of integrators
that are called with numbers, each with one argument that nobody could mean; and classes of users
with one method that takes or gives something else than its base.

A call ends well if it gives something, or an error of this package, without warnings of NumPy's.
Run `python tests/calls/fuzz_makers.py [count] [seed]` for a report.
"""

from __future__ import annotations

import functools
import re
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from fuzz_calls import PATIENCE, Method, Subject, _shown, numbers_in, wrong
from scipy.linalg import LinAlgWarning

import liemech as lm

Maker = tuple[Callable[..., Any], dict[str, Any]]


@functools.cache
def makers() -> tuple[Maker, ...]:
    """What is called, and arguments with which it goes well."""
    rng = np.random.default_rng(8)
    so3, body = lm.SO3(), lm.RigidBody([1.0, 1.6, 2.3])
    mu, g, q = [0.3, 0.2, 0.8], so3.random(rng), [0.4, 0.1]
    library: Any = lm
    algorithm: Any = lm.CovariantVariational()
    hj: Any = lm.LiePoissonHamiltonJacobi(order=4)
    state = body.state(mu, g)
    kepler, eye = library.Kepler(), np.eye(3)
    tableaus: Any = lm.tableaus
    table = ([0.0, 1.0, 2.0], [[0.0, 1.0], [1.0, 2.0], [0.5, 0.0]])
    tops = {"inertia": [1.0, 1.5, 0.7], "weight": 1.3, "centre": [0.6, 0.0, 0.8]}
    return (
        (library.RigidBody, {"inertia": [1.0, 1.6, 2.3]}),
        (library.models.HeavyTop, tops),
        (library.models.LagrangeTop, {"weight": 1.0, "transverse": 0.5, "axial": 1.0, "length": 1.0}),
        (library.models.ReducedHeavyTop, tops),
        (library.models.KirchhoffBody, {"inertia": [1.0, 1.6, 2.3, 1.0, 2.0, 3.0]}),
        (library.models.KirchhoffBody.of_blocks, {"angular": [1.2, 2.0, 2.6], "linear": [1.3, 1.8, 2.5], "coupling": 0.1 * eye}),
        (library.models.FallingBody, {"inertia": [1.0, 1.6, 2.3], "mass": 1.0}),
        (library.models.OrbitingBody, {"inertia": [0.05, 0.08, 0.11], "mass": 1.7, "attraction": 1.0}),
        (library.Kepler, {"attraction": 1.0}),
        (library.models.Pendulum, {}),
        (library.models.DoublePendulum, {"masses": [1.0, 0.5], "lengths": [1.0, 0.8]}),
        (library.SphericalPendulum, {"length": 1.0}),
        (library.models.ChainPendulum, {"masses": [1.0, 0.5], "lengths": [1.0, 0.8]}),
        (library.models.NBody, {"masses": [1.0, 0.5, 0.2]}),
        (library.models.PlanetarySystem, {"masses": [1.0, 0.001]}),
        (library.models.TodaLattice, {"particles": 3}),
        (library.models.FermiPastaUlam, {"particles": 3}),
        (library.models.LotkaVolterra, {}),
        (library.models.MaxwellBloch, {}),
        (library.models.PoissonTop, {"moments": [1.0, 1.5, 0.7], "weight": 1.3, "centre": [0.6, 0.0, 0.8]}),
        (library.joints.Link, {"mass": 1.0, "inertia": [0.1, 0.2, 0.2]}),
        (library.KineticEnergy, {"inertia": [1.0, 2.0, 3.0]}),
        (library.LiePoissonSystem, {"group": so3, "hamiltonian": library.KineticEnergy([1.0, 2.0, 3.0])}),
        (library.structures.ConstantStructure, {"values": [[0.0, 1.0], [-1.0, 0.0]]}),
        (library.structures.LogCanonical, {"values": [[0.0, 1.0], [-1.0, 0.0]]}),
        (library.PiecewisePolynomial.linear, {"t": table[0], "values": table[1]}),
        (library.PiecewisePolynomial.cubic, {"t": table[0], "values": table[1]}),
        (library.PiecewisePolynomial.constant, {"t": [0.0, 1.0, 2.0, 3.0], "values": table[1]}),
        (lm.MatrixLieGroup.of, {"generators": so3.generators if hasattr(so3, "generators") else lm.SO(3).generators}),
        (lm.SO, {"n": 3}), (lm.SU, {"n": 2}), (lm.U, {"n": 2}), (lm.SL, {"n": 2}), (lm.GL, {"n": 2}), (lm.Sp, {"n": 2}),
        (lm.VectorSpace, {"n": 3}), (lm.Heisenberg, {"n": 1}),
        (lm.ProductGroup, {"0": so3, "1": so3}),
        (lm.RKMK, {"order": 4}), (lm.Taylor, {"order": 8}), (lm.Magnus, {"order": 4}), (lm.CommutatorFree, {"order": 4}),
        (lm.LiePoissonHamiltonJacobi, {"order": 4}), (lm.HamiltonJacobi, {"order": 4}), (lm.Splitting, {"order": 4}),
        (lm.GalerkinVariational, {"order": 4}), (lm.CovariantVariational, {"retraction": lm.Cayley()}),
        (lm.Composition, {"base": lm.StormerVerlet(), "order": 4}), (lm.KickDrift, {"order": 2}),
        (lm.MoserVeselov, {}), (lm.MultipleTimeSteps, {"ratios": (3,)}), (lm.AdaptiveVerlet, {}),
        (lm.ReversibleController, {"method": lm.StormerVerlet(), "sigma": lm.time_scales.DistancePower(1.5)}),
        (library.time_scales.DistancePower, {"power": 1.5}),
        (lm.TimeTransformed, {"system": kepler, "sigma": lm.time_scales.DistancePower(1.5)}),
        *((getattr(tableaus, name), {"stages": 3})
          for name in ("gauss", "lobatto_iiia", "lobatto_iiib", "lobatto_iiic", "radau_iia")),
        (tableaus.suzuki, {"base_order": 2}), (tableaus.triple_jump, {"base_order": 2}),
        (tableaus.named, {"0": "Dormand-Prince 5(4)"}),
        (algorithm.largest_step, {"system": body, "start": state}),
        (algorithm.velocity, {"system": body, "mu": mu, "h": 0.1}),
        (algorithm.momentum, {"system": body, "xi": mu, "h": 0.1}),
        (algorithm.step_warning, {"system": body, "start": state, "h": 0.1}),
        (hj.require, {"system": body}),
        (lm.check_group, {"group": so3, "seed": 0}),
        (lm.check_retraction, {"retraction": lm.Cayley(), "group": so3, "seed": 0}),
        (lm.check_poisson, {"structure": lm.structures.ConstantStructure([[0.0, 1.0], [-1.0, 0.0]])}),
        (kepler.pericentre, {"eccentricity": 0.3}),
        (kepler.state, {"q": q, "p": q}),
        (body.state, {"mu": mu, "g": g}),
        (body.exact, {"start": state, "t": [0.0, 1.0]}),
        (library.RigidBody(inertia=[1.0, 1.6, 2.3]).velocity, {"mu": mu}),
        (lm.integrate, {"system": body, "method": lm.RKMK(), "start": state, "h": 0.1, "steps": 2, "compiled": False}),
        (lm.integrate, {"system": body, "method": lm.RKMK(order=5), "start": state, "t_end": 0.1, "rtol": 1e-6, "atol": 1e-9,
                        "compiled": False, "t0": 0.0}),
        (lm.Plan, {"system": body, "method": lm.RKMK(), "h": 0.1, "every": 1}),
    )  # fmt: skip


@dataclass(frozen=True)
class Overridable:
    """A class that users derive from, whose methods are as they should be, what is made of an
    object of it, and a run or a call that needs every method.
    """

    base: type
    methods: dict[str, tuple[str, str]]
    """The arguments after `self`, and the expression that is returned."""
    made: Callable[[Any], Any]
    used: Callable[[Any], Any]
    fields: tuple[tuple[str, Any], ...] = ()
    given: tuple[Any, ...] = ()
    """What the class is called with."""

    def cls(self, methods: dict[str, str]) -> Any:
        """A record with these methods, as a user would write it."""
        space: dict[str, Any] = {"lm": lm}
        exec("\n".join(methods.values()), space)
        body = {name: space[name] for name in methods}
        cls = type("Mine", (self.base,), body | dict(self.fields) | {"__module__": "users"})
        return lm.record(cls)

    def right(self) -> dict[str, str]:
        return {name: text(name, *given) for name, given in self.methods.items()}


def text(name: str, arguments: str, value: str) -> str:
    return f"def {name}({', '.join(filter(None, ('self', arguments)))}):\n    return {value}"


def run_of(method: Any, *start: Any) -> Callable[[Any], Any]:
    """A few steps in plain Python from the state of these parts."""

    def used(system: Any) -> Any:
        state = system.state(*start)
        return lm.integrate(system, method, state, h=0.01, steps=2, compiled=False, progress=False)

    return used


@functools.cache
def overridables() -> tuple[Overridable, ...]:
    """What the pages tell users to derive from."""
    so3: Any = lm.SO3()
    body: Any = lm.RigidBody([1.0, 1.6, 2.3])
    mu, eye, q = [0.3, 0.2, 0.8], np.eye(3), [0.4, 0.1]
    in_field: Any = lm.MechanicalSystem
    library: Any = lm
    half = "0.5 * lm.dot({0}, {0})".format
    return (
        Overridable(
            lm.Hamiltonian, {"energy": ("mu", half("mu")), "gradient": ("mu", "1.0 * mu")},
            lambda mine: lm.LiePoissonSystem(so3, mine), run_of(lm.RKMK(order=4), mu),
        ),
        Overridable(
            lm.DrivenHamiltonian, {"energy": ("t, mu", half("mu")), "gradient": ("t, mu", "1.0 * mu")},
            lambda mine: library.DrivenLiePoissonSystem(so3, mine), run_of(lm.RKMK(order=4), mu),
        ),
        Overridable(
            lm.Potential, {"energy": ("g", "g[2, 2]")},
            lambda mine: in_field(body, mine), run_of(lm.LieVerlet(), mu, eye),
        ),
        Overridable(
            lm.Potential, {"energy": ("g", "0.0 * g[2, 2]"), "force": ("group, g", "lm.vec(0.0, 0.0, 0.0)")},
            lambda mine: in_field(body, mine), run_of(lm.LieVerlet(), mu, eye),
        ),
        Overridable(
            lm.Force, {"covector": ("t, xi, g", "-0.1 * xi")},
            lambda mine: in_field(body, lm.NoPotential(), load=mine), run_of(lm.RKMK(order=4), mu, eye),
        ),
        Overridable(
            lm.Constraint, {"value": ("g", "lm.vec(g[2, 0])")},
            lambda mine: library.ConstrainedBody(in_field(body, lm.NoPotential()), mine),
            run_of(lm.LieRATTLE(), [0.0, 0.0, 0.3], eye),
        ),
        Overridable(
            lm.HamiltonianSystem,
            {"energy": ("q, p", f"{half('q')} + {half('p')}"), "velocity": ("q, p", "1.0 * p"), "force": ("q, p", "-q")},
            lambda mine: mine, run_of(lm.RKMK(order=4), q, q), (("degrees", 2),),
        ),
        Overridable(
            lm.SeparableSystem, {"kinetic": ("p", half("p")), "potential": ("q", half("q"))},
            lambda mine: mine, run_of(lm.StormerVerlet(), q, q), (("degrees", 2),),
        ),
        Overridable(
            lm.DrivenHamiltonianSystem, {"energy": ("t, q, p", f"{half('q')} + {half('p')}")},
            lambda mine: mine, run_of(lm.RKMK(order=4), q, q), (("degrees", 2),),
        ),
        Overridable(
            lm.ConstrainedSystem, {"energy": ("q, p", half("p")), "constraint": ("q", "lm.vec(lm.dot(q, q) - 1.0)")},
            lambda mine: mine, run_of(lm.RATTLE(), [1.0, 0.0], [0.0, 1.0]), (("degrees", 2),),
        ),
        Overridable(
            lm.LinearGroupEquation, {"drive": ("t", "lm.vec(1.0, t, 0.5)")},
            lambda mine: mine, run_of(lm.RKMK(order=4), eye), (), (so3,),
        ),
        Overridable(
            lm.HomogeneousEquation, {"velocity": ("t, x", "lm.vec(x[1], x[2], t)")},
            lambda mine: mine, run_of(lm.RKMK(order=4), [0.6, 0.0, 0.8]), (), (lm.actions.SphereAction(3),),
        ),
        Overridable(
            library.VectorField, {"velocity": ("y", "lm.vec(y[1], -y[0])")},
            lambda mine: mine, run_of(lm.RKMK(order=4), q), (("dim", 2),),
        ),
        Overridable(
            lm.Method,
            {
                "start": ("system, state, h", "(state, 1)"), "observe": ("memory", "memory[0]"),
                "step": ("system, t, memory, h", "(memory[0], memory[1])"),
            },
            lambda mine: mine,
            lambda mine: run_of(mine, mu)(body), (("order", 1),),
        ),
    )  # fmt: skip


WRONG_ARGUMENTS: dict[str, Callable[[list[str]], list[str] | None]] = {
    "an argument more": lambda names: [*names, "scale"],
    "an argument more in front": lambda names: ["t0", *names],
    "an argument less": lambda names: names[:-1] if names else None,
    "no argument": lambda names: [] if names else None,
    "by name only": lambda names: ["*", *names] if names else None,
}
GIVES_NUMBER = re.compile("def (energy|kinetic|potential)")
WRONG_VALUES: dict[str, Callable[[str], str]] = {
    "nothing": lambda body: body.replace("return ", "", 1),
    "None": lambda body: body.partition("return ")[0] + "return None",
    "None on one way": lambda body: body.replace("    return ", "    if abs(0.5) > 1.0:\n        return ", 1),
    "a text": lambda body: body.partition("return ")[0] + "return 'abc'",
    "a vector of two in a tuple": lambda body: body.partition("return ")[0] + "return (lm.vec(1.0, 2.0),)",
    "a dict": lambda body: body.partition("return ")[0] + "return {'a': 1.0}",
    "a vector, or a number": lambda body: (
        body.partition("return ")[0] + ("return lm.vec(0.5, 0.25, 0.125)" if GIVES_NUMBER.match(body) else "return 1.5")
    ),
    "a generator": lambda body: body.replace("return ", "yield ", 1),
}


def signature_ending(rng: np.random.Generator) -> tuple[str, str]:
    """How a class with one wrong method ends, `made` if it is refused there as it should be, and the class."""
    all_of_them = overridables()
    what = all_of_them[int(rng.integers(len(all_of_them)))]
    name = str(rng.choice(list(what.methods)))
    arguments, value = what.methods[name]
    names, methods = arguments.split(", "), what.right()
    kind = str(rng.choice([*WRONG_ARGUMENTS, *WRONG_VALUES]))
    if kind in WRONG_ARGUMENTS:
        other = WRONG_ARGUMENTS[kind]([x for x in names if x])
        assert other is not None
        methods[name] = text(name, ", ".join(other), value)
    else:
        methods[name] = WRONG_VALUES[kind](methods[name])
    said = f"{what.base.__name__} with {kind}: {methods[name]}"
    try:
        try:
            system = what.made(what.cls(methods)(*what.given))
        except lm.errors.LiemechError as error:
            return ("made" if name in str(error) else f"nameless: {error}"), said
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            what.used(system)
    except lm.errors.LiemechError as error:
        return f"late: {error}", said
    except Exception as error:
        # a run raises as it is what a line of the user's raises
        own = traceback.extract_tb(error.__traceback__)[-1].filename == "<string>"
        return f"{'late' if own else 'bare'}: {_shown(error)}", said
    return "silent", said


def wrong_signatures(count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """How many of so many classes with one wrong method end how, and those that end badly."""
    rng, found, bad = np.random.default_rng(seed), Counter[str](), []
    for _ in range(count):
        end, said = signature_ending(rng)
        found[end.partition(":")[0]] += 1
        if not end.startswith(("made", "late")):
            bad.append(f"{end}\n    {said}")
    return found, bad


def called(function: Callable[..., Any], given: dict[str, Any]) -> Any:
    """The result; names that are numbers stand for places."""
    places = [x for name, x in given.items() if name.isdigit()]
    return function(*places, **{name: x for name, x in given.items() if not name.isdigit()})


SUBJECT = Subject(lm.SO3(), lm.SO3())
METHOD = Method(SUBJECT, "exp")


def ending(maker: Maker, rng: np.random.Generator) -> str:
    """What became of a call with one argument that is not as it should be."""
    function, given = maker
    names = list(given)
    name = names[int(rng.integers(len(names)))] if names else None
    value = wrong(METHOD, "mu", "Vec", rng)
    arguments = given | {name: value} if name else given
    large = isinstance(value, int) and abs(value) > 10**6
    if name == "t_end" or (large and name in ("n", "steps", "particles")):
        return ""  # what is asked for takes long
    if isinstance(value, lm.Vec) and None in value:
        return ""  # a small vector of no numbers, which formulas do not look at
    begun = time.process_time()
    said = f"\n    {getattr(function, '__qualname__', function)}(..., {name}={value!r:.200})"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", category=RuntimeWarning)
            warnings.filterwarnings("ignore", message="integrate: ", category=RuntimeWarning)
            warnings.filterwarnings("ignore", category=LinAlgWarning)  # SciPy's, of bad knots
            result = called(function, arguments)
    except lm.errors.LiemechError:
        return f"slow{said}" if time.process_time() - begun > PATIENCE else ""
    except Exception as error:
        return f"bare: {_shown(error)}{said}"
    if time.process_time() - begun > PATIENCE:
        return f"slow{said}"
    if isinstance(result, lm.Trajectory):
        result = (result.t, *result.states.values())
    try:
        found = list(numbers_in(result))
    except ValueError:
        found = []  # a vector of vectors
    if not all(np.isfinite(a).all() for a in found if a.dtype.kind in "biufc"):
        return f"not finite{said}"
    return ""


def failures(count: int, seed: int) -> list[str]:
    """What ended badly among so many calls."""
    rng, all_makers = np.random.default_rng(seed), makers()
    endings = (ending(all_makers[int(rng.integers(len(all_makers)))], rng) for _ in range(count))
    return [what for what in endings if what]


if __name__ == "__main__":
    count, seed = map(int, (*sys.argv[1:], "0")[:2] if len(sys.argv) > 1 else (2000, 0))
    for function, given in makers():
        try:
            called(function, given)
        except Exception as error:
            print("WRONG TABLE", function, repr(error)[:200])
    bad = failures(count, seed)
    print("\n".join(sorted(bad)))
    kinds = Counter(b.partition(":")[0].partition("\n")[0] for b in bad)
    print(count, "calls,", len(bad), "ended badly:", dict(kinds))
    ends, bad = wrong_signatures(count, seed)
    print(*bad, f"{count} classes with a wrong method: {dict(ends)}", sep="\n")
