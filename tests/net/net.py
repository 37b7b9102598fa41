"""A net under the runs: hashes of what some hundred runs give, to the last bit.

    python tests/net/net.py --write [--only TEXT]    write hashes.json, of the cases whose name has TEXT

A rebuild of the simulation changes none of them.  Sums, products, quotients and square roots are those of IEEE 754,
without contraction, at every SIMD width.  The C library's functions and the products of matrices by BLAS may round
otherwise on another machine: cases that call them (`needs`) are compared only where these give the numbers of the
machine that wrote the hashes (`fingerprints`).

A case that is refused is recorded as "refused": it may be allowed later.  A run that fails is recorded with the samples
that it leaves.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import json
import math
import pickle
import platform
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import scenes_of_runs as scenes
from scenes_of_runs import Scene

import liemech as lm
from liemech import errors
from liemech.rooms.derivatives.frames import dual_basis

HASHES = Path(__file__).parent / "hashes.json"
REFUSED = "refused"


# ---------------------------------------------------------------- hashes


def digest(x: Any) -> str:
    """Of an array its shape and its bits."""
    array = np.ascontiguousarray(np.asarray(x))
    if array.dtype.kind == "f":
        array = array.astype("<f8")
    text = f"{array.dtype.kind}{array.shape}".encode()
    return hashlib.blake2b(text + array.tobytes(), digest_size=6).hexdigest()


def together(arrays: Any) -> str:
    """Of several arrays."""
    return digest([digest(x) for x in arrays])


def of_state(state: Any, name: str) -> dict[str, str]:
    """Of every part of a state."""
    return {f"{name}.{part}": digest(x) for part, x in state.arrays.items()}


def of_run(run: lm.Trajectory, times: Any = None) -> dict[str, Any]:
    """What a run has found, piece by piece.

    times : where the motion between the samples is looked at.
    """
    found: dict[str, Any] = {"t": digest(run.t), "steps": int(run.steps), "h": digest(run.h)}
    counts = ("rejected", run.rejected), ("ended", run.ended)
    found |= {name: int(x) for name, x in counts if x is not None and not isinstance(x, tuple)}  # events say it by body
    found |= {f"states.{name}": digest(x) for name, x in run.states.items()}
    if isinstance(getattr(run, "tau", None), np.ndarray):
        found["tau"] = digest(run.tau)
    if run.stopped:
        found["stopped"] = {str(i): f"{type(x.error).__name__} after {x.steps}" for i, x in run.stopped.items()}
    for k, event in enumerate(run.events):
        bodies = [event] if run.bodies is None else event
        found[f"events[{k}].n"] = [len(t) for t, _ in bodies]
        found[f"events[{k}].t"] = together([t for t, _ in bodies])
        for part in bodies[0][1].arrays:
            found[f"events[{k}].{part}"] = together([state.arrays[part] for _, state in bodies])
    if times is not None:
        try:
            found |= of_state(run.at(times), "at")
        except errors.InvalidInput:
            found["at"] = REFUSED
    return found


@functools.cache
def fingerprints() -> dict[str, str]:
    """Of what may round otherwise elsewhere: the C library's functions at some hundred places, and
    products, inverses and frames of small matrices by BLAS and LAPACK.
    """
    values: list[float] = []
    for i in range(1, 200):
        x = i / 37.0
        values += [math.sin(x), math.cos(x), math.tan(x), math.exp(-x), math.log(x), math.sinh(x)]
        values += [math.atan2(x, 1.7), math.asin(i / 200.0), math.cosh(x), math.tanh(x)]
        values += [x**0.1, x ** (1 / 60), x ** (1 / 80), x**1.5, x**-0.2, math.cbrt(x)]
    matrices = scenes.spread(36, 36).reshape(36, 6, 6) / 3.0
    products = [matrices[i] @ matrices[i + 1] for i in range(35)]
    rows = [matrices[i] @ matrices[i + 1][:, 0] for i in range(35)]
    inverses = np.linalg.pinv(matrices[:, :, :4])
    frames = [dual_basis(scenes.spread(k, k * 2 * k).reshape(k, k, 2 * k)) for k in (2, 3, 6, 12)]
    changes = [np.swapaxes(x, -1, -2) @ x for x in frames]
    return {"libm": digest(values), "blas": together([products, rows, inverses, *frames, *changes])}


# ---------------------------------------------------------------- cases


@dataclass(frozen=True)
class Case:
    """One run, made in one way.

    way : "whole"; "resumed" in the middle; "stepper" and "begun", by hand; "tangent".
    options, span : of the plan and of the run, over those of the scene.
    """

    scene: Scene
    bodies: int
    observer: str = "all"
    way: str = "whole"
    variant: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    span: dict[str, Any] = field(default_factory=dict)
    worlds: tuple[str, ...] = ("plain", "native")

    @property
    def name(self) -> str:
        """For the JSON; tests put the world before the way."""
        return self.named("")

    def named(self, world: str) -> str:
        """The name of a test."""
        parts = self.scene.name, self.variant, str(self.bodies), self.observer, world, self.way
        return "-".join(filter(None, parts))

    @property
    def needs(self) -> list[str]:
        """Which libraries its bits depend on."""
        blas = self.way == "tangent"  # frames are inverted by it
        return ["libm"] * self.scene.libm + ["blas"] * blas

    def plan(self, compiled: bool) -> lm.Plan:
        """The plan of it."""
        scene, watched = self.scene, scenes.observer(self.scene, self.observer)[0]
        options = scene.options | watched | self.options
        system = options.pop("system", scene.system)
        method = options.pop("method", scene.method)
        return lm.Plan(system, method, compiled=compiled, progress=False, **options)

    def found(self, compiled: bool) -> dict[str, Any]:
        """What it gives in plain Python or in native code."""
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                return self._found(compiled)
            except (errors.InvalidInput, errors.InvalidType, errors.IncompatibleSystem, errors.NotCompilable) as error:
                if getattr(error, "trajectory", None) is None:
                    return {REFUSED: type(error).__name__}
                return self._failed(error)
            except errors.IntegrationFailure as error:
                return self._failed(error)

    def _failed(self, error: Any) -> dict[str, Any]:
        return {"failed": type(error).__name__} | of_run(error.trajectory)

    def _found(self, compiled: bool) -> dict[str, Any]:
        scene, plan = self.scene, self.plan(compiled)
        start = scene.start(self.bodies)
        whole, first, rest, times = scene.spans(self.span)
        if self.way == "whole":
            asked = scenes.observer(scene, self.observer)[1]
            looked = scene.times if self.observer in ("all", "dense") else None
            return of_run(plan.run(start, **{**whole, **asked, **self.span}), looked)
        if self.way == "resumed":
            asked = scenes.observer(scene, self.observer)[1]
            early, late = ({}, {})
            if "t_eval" in asked:
                early, late = ({"t_eval": [x for x in times if (x <= scene.middle) == b]} for b in (True, False))
                if scene.backwards:
                    early, late = ({"t_eval": [x for x in times if (x >= scene.middle) == b]} for b in (True, False))
            begun = plan.run(start, **{**first, **early})
            gone = plan.resume(begun, **{**rest, **late})
            joined = begun.then(gone)
            return of_run(gone) | {f"joined.{n}": x for n, x in of_run(joined).items()}
        if self.way == "stepper":
            stepper = plan.stepper(start)
            stepper.step()
            middle = of_state(stepper.state, "after 1")
            stepper.step(scene.first - 1)
            stepper = pickle.loads(pickle.dumps(stepper))
            stepper.step(scene.rest)
            known = {"t": digest(stepper.t), "steps": stepper.steps}
            return middle | of_state(stepper.state, "state") | known
        if self.way == "begun":
            carry = plan.step(plan.begin(start))
            carry = plan.step(carry, scene.first - 1)
            known = {"t": digest(carry.t)} | of_state(carry.state, "state")
            gone = plan.resume(plan.stepper(carry), steps=scene.rest)
            return known | {f"resumed.{n}": x for n, x in of_run(gone).items()}
        by = list(scene.by)
        run = plan.tangent(start, by=by, **{**scene.short, **self.span})
        return of_run(run) | {f"by.{n}": digest(x) for n, x in run.tangent.items()}


def cases() -> Iterator[Case]:
    """All of them, no name twice."""
    yield from _crossed()
    yield from _by_hand()
    yield from _of_their_own()
    yield from _turned()
    yield from _failing()
    yield from _methods()


def _crossed() -> Iterator[Case]:
    """Control x bodies x observer x whole or resumed."""
    for scene in (scenes.EQUAL, scenes.TOLERANCE, scenes.FICTIVE):
        for bodies in (1, 3, 17):
            for observer in scenes.OBSERVERS:
                for way in ("whole", "resumed"):
                    yield Case(scene, bodies, observer, way, worlds=_worlds(bodies, observer, way))


def _worlds(bodies: int, observer: str, way: str) -> tuple[str, ...]:
    """Plain Python has no lanes: of 17 bodies it makes few runs."""
    if bodies >= 5 and (observer not in ("all", "events") or way == "resumed"):
        return ("native",)
    return "plain", "native"


def _by_hand() -> Iterator[Case]:
    """Step by step, and tangents."""
    for scene in (scenes.EQUAL, scenes.TOLERANCE, scenes.FICTIVE, scenes.COVARIANT):
        for bodies in (1, 3, 17):
            for way in ("stepper", "begun"):
                yield Case(scene, bodies, "all", way)
        for bodies in (1, 3):
            yield Case(scene, bodies, "all", "tangent")


def _of_their_own() -> Iterator[Case]:
    """Bodies with numbers of their own, and several of these at once."""
    for scene in (scenes.EQUAL, scenes.TOLERANCE, scenes.FICTIVE):
        for name, (options, span) in scenes.own(scene).items():
            for observer in ("all", "t_eval", "events", "functions"):
                for way in ("whole", "resumed"):
                    if "t_eval" in span and (way == "resumed" or observer == "t_eval"):
                        continue
                    if way == "resumed" and observer in ("functions", "t_eval"):
                        continue
                    worlds = ("plain", "native") if observer == "all" else ("native",)
                    shown = replace(scene, until=1.25) if observer == "t_eval" else scene
                    yield Case(shown, 5, observer, way, name, options, span, worlds)


def _turned() -> Iterator[Case]:
    """Backwards, breaks, sums, digits."""
    for scene in (scenes.EQUAL, scenes.TOLERANCE, scenes.FICTIVE):
        back = scenes.turned(scene)
        for bodies in (1, 3):
            for observer in ("all", "every", "t_eval", "events", "ends"):
                for way in ("whole", "resumed"):
                    if way == "resumed" and observer in ("every", "ends"):
                        continue
                    yield Case(back, bodies, observer, way)
    for scene in (scenes.EQUAL, scenes.TOLERANCE, scenes.TABLE, scenes.TABLE_TOLERANCE):
        for bodies in (1, 3):
            for observer in ("all", "every", "t_eval", "events"):
                for way in ("whole", "resumed"):
                    if way == "resumed" and observer == "every":
                        continue
                    yield Case(scene, bodies, observer, way, "breaks", {"breaks": [0.31, 1.2]})
    for scene in (scenes.EQUAL, scenes.COVARIANT, scenes.FICTIVE):
        for bodies in (1, 3):
            for name, options in (
                ("bare", {"compensated": False}),
                ("summed", {"compensated": True}),
                ("long", {"precision": "double-double"}),
            ):
                for observer in ("all", "t_eval", "events") if name == "long" else ("all",):
                    for way in ("whole", "resumed"):
                        yield Case(scene, bodies, observer, way, name, options)


def _failing() -> Iterator[Case]:
    """Some bodies come to an end, or the one there is."""
    for scene in scenes.FAILING:
        for bodies in (1, 3, 5):
            for observer in ("all", "every", "t_eval", "functions", "events"):
                yield Case(scene, bodies, observer, worlds=_worlds(bodies, "", "resumed"))


def _methods() -> Iterator[Case]:
    """One case or two of every kind of method, with what it remembers."""
    for scene in scenes.METHODS:
        for bodies in (1, 3):
            for way in ("whole", "resumed"):
                yield Case(scene, bodies, "all", way)


@functools.cache
def stored() -> dict[str, Any]:
    """What was written."""
    known: dict[str, Any] = json.loads(HASHES.read_text())
    return known


def missing(case: Case) -> list[str]:
    """What a case needs and rounds otherwise here than where the hashes were written."""
    written, here = stored()["made_with"], fingerprints()
    return [name for name in case.needs if written[name] != here[name]]


def known(case: Case, world: str) -> dict[str, Any]:
    """What a case gave in this world: where both agree it is written once."""
    found: dict[str, Any] = stored()["cases"]
    return found.get(case.named(world)) or found[case.name]


def differences(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """What changed; what was refused is free."""
    if REFUSED in old:
        return []
    if REFUSED in new:
        return [f"is refused now: {new[REFUSED]}"]
    free = {name for name, x in old.items() if x == REFUSED} | {"needs"}
    return [
        f"{name}: {old.get(name)} is now {new.get(name)}"
        for name in sorted(old.keys() | new.keys())
        if old.get(name) != new.get(name) and name.split(".")[0] not in free
    ]


def main() -> None:
    """Write the hashes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", required=True)
    parser.add_argument("--only", default="", help="only cases whose name has this text")
    args = parser.parse_args()
    kept = stored()["cases"] if args.only and HASHES.exists() else {}
    for case in cases():
        if args.only not in case.name:
            continue
        found = {world: case.found(world == "native") for world in case.worlds}
        first = found[case.worlds[0]]
        marks = {"needs": case.needs} if case.needs else {}
        kept[case.name] = first | marks
        kept.pop(case.named("native"), None)
        if found.get("native", first) != first:
            print(f"{case.name}: native code differs: {differences(first, found['native'])[:4]}")
            kept[case.named("native")] = found["native"] | marks
    made_with = {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
        "libc": " ".join(platform.libc_ver()),
        **fingerprints(),
        "assumed": "IEEE 754 doubles without contraction; any SIMD width; cases that need libm or blas"
        " are compared where these give the same numbers",
    }
    lines = ",\n".join(f"{json.dumps(n)}: {json.dumps(x, sort_keys=True)}" for n, x in sorted(kept.items()))
    HASHES.write_text(f'{{"made_with": {json.dumps(made_with, indent=1)},\n"cases": {{\n{lines}\n}}}}\n')
    print(f"{len(kept)} cases")


if __name__ == "__main__":
    main()
