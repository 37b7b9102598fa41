"""Random programs over the whole language: native code gives what CPython gives, or refuses by name.

`python tests/compiler/test_whole_language.py 0 2000` runs many, and prints failures and refusals by
kind; `... 0 100 memories` runs methods that remember something, in every driver, between guard
words, `... 0 2000 special` derivatives at special points.
"""

from __future__ import annotations

import collections
import random
import re
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import fuzz
import fuzz_language
import mpmath
import numpy as np
import pytest
import worlds

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.changes import cache
from liemech.compiler.machine import guard_words
from liemech.errors import InvalidInput, NotCompilable

ROWS = 12
UNFRIENDLY = re.compile(r"^(?!IndexError)\w*(Error|Exception|StopIteration)\b")
"""A refusal that only repeats what went wrong inside of the compiler."""


class Difference(AssertionError):
    """Native code gives another number than CPython."""


marked: collections.Counter[str] = collections.Counter()
"""Rows that plain Python computes again although their results are finite, because an integer did
not fit; and the others.
"""


def refusal(error: Exception) -> str:
    """What was refused, without names and numbers."""
    reason = str(error).partition("cannot be compiled: ")[2] or str(error)
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?|0x\w+", "#", re.sub(r"`.*`", "`...`", reason))[:110]


def truth(formula: Any, row: list[float], turns: int) -> Any:
    """What CPython gives, as bits; the exception if it raises."""
    try:
        return [worlds.bits(x) for x in worlds.flat(formula(*row, turns))]
    except RecursionError:
        raise
    except Exception as error:
        return error


def compare(world: Any, rows: list[list[float]], turns: int, lanes: tuple[int, ...]) -> bool:
    """Raise `Difference` or what the compiler raises; False if CPython has no result for any row."""
    expected = [truth(world.formula, row, turns) for row in rows]
    widths = {len(e) for e in expected if isinstance(e, list)}
    if len(widths) != 1:
        return False
    (width,) = widths
    for count in lanes:
        found = worlds.outcomes(type(world).formula, rows, width, turns, count, (world,))
        for row, right, (values, fine) in zip(rows, expected, found, strict=True):
            what = f"{count} lanes, {row}, n = {turns}: {worlds._shown(values)}"
            if fine and isinstance(right, Exception):
                raise Difference(f"{what}, where CPython raises {right!r}")
            if fine and (values != right or not all(map(worlds._finite, right))):
                raise Difference(f"{what} instead of {worlds._shown(right)}")
            marked[
                "finite, marked"
                if not fine and isinstance(right, list) and all(map(worlds._finite, right))
                else "others"
            ] += 1
    return True


def check(seed: int, folder: Path, lanes: tuple[int, ...], text: str | None = None) -> str | None:
    """Compare one program, then with another static field, then with another global; the kind of
    refusal, if it is refused.
    """
    text = text or fuzz_language.Language(seed).module()
    module = worlds.module_from(text, folder, f"random_program_{seed}")
    rows = fuzz.arguments(seed, ROWS, worlds.SPECIAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not compare(module.World(), rows, 2, lanes):
                return "nothing to compare"
            for name, value in fuzz_language.STATIC_CHANGES.items():
                if f"self.{name}" in text.partition("def formula")[2]:
                    compare(module.World(**{name: eval(value, vars(module))}), rows, 2, lanes[:1])
            for name, value in fuzz_language.GLOBAL_CHANGES.items():
                if name in text.partition("def formula")[2]:
                    change(module, name, value)
                    compare(module.World(), rows, 2, lanes[:1])
    except NotCompilable as error:
        return refusal(error)
    finally:
        del sys.modules[f"random_program_{seed}"]
    return None


def change(module: ModuleType, name: str, value: str) -> None:
    owner, _, attribute = name.rpartition(".")
    setattr(getattr(module, owner) if owner else module, attribute, eval(value, vars(module)))


def sample(seeds: range, folder: Path, show: Any = None) -> tuple[collections.Counter[str], dict[str, list[str]]]:
    """Refusals by kind, and failures by the features of the program."""
    refused: collections.Counter[str] = collections.Counter()
    failed: dict[str, list[str]] = {}
    for seed in seeds:
        try:
            kind = check(seed, folder, (1, kernel.lanes()) if seed % 4 == 0 else (1,))
            refused[kind or "compared"] += 1
        except Exception as failure:
            program = fuzz_language.Language(seed)
            program.module()
            failed.setdefault(f"{type(failure).__name__}", []).append(
                f"seed {seed} ({', '.join(program.used)}): {failure}"
            )
        if show and seed % 100 == 99:
            show(
                f"{seed + 1 - seeds.start} programs, {refused['compared']} compared, "
                f"{sum(map(len, failed.values()))} failed"
            )
    return refused, failed


def forms_alone(folder: Path, rounds: int = 3) -> Iterator[tuple[str, collections.Counter[str]]]:
    """What becomes of each form of each feature alone in a formula."""
    number = 10**6
    for form in (form for feature in fuzz_language.FEATURES for form in feature.forms):
        found: collections.Counter[str] = collections.Counter()
        for _ in range(rounds):
            number += 1
            writer = fuzz_language.Language(number)
            writer.names = fuzz.NAMES
            body = "self_static = 2\n" + writer.fill(form) + "\nreturn vec(a, b, c, d)\n"
            head = "    def formula(self, a, b, c, d, n):\n"
            text = fuzz_language.HEADER + head + textwrap.indent(body, " " * 8)
            try:
                kind = check(number, folder, (1,), text) or "same"
            except Exception as failure:
                kind = f"FAILED {type(failure).__name__}: {str(failure)[:400]}"
            found[kind] += 1
        yield form, found


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("hundred", range(2))
def test_random_programs(hundred: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "store", lambda *_: None)  # nobody will ever need them again
    marked.clear()
    refused, failed = sample(range(1000 * hundred, 1000 * hundred + 50), tmp_path)
    assert not failed, "\n".join(text for texts in failed.values() for text in texts)
    assert not [kind for kind in refused if UNFRIENDLY.search(kind)]
    assert refused["compared"] >= 25 and marked["finite, marked"] < 0.1 * marked["others"]


def of_mpmath() -> dict[str, Any]:
    """What random derivatives are made of, in as many digits as are asked for."""
    named = ("sin", "cos", "tan", "sinh", "tanh", "atan", "atan2", "exp", "expm1", "log1p", "sqrt")
    names: dict[str, Any] = {name: getattr(mpmath, name) for name in named}
    hyper = mpmath.hyper
    return names | {
        "vec": lambda *x: x,
        "dot": lambda u, v: sum(x * y for x, y in zip(u, v, strict=True)),
        "where": lambda condition, yes, no: yes if condition else no,
        "hypot": lambda *x: mpmath.sqrt(sum(a * a for a in x)),
        "derivative": lambda f, x, d: mpmath.diff(f, x) * d,
        "sinc": lambda x: hyper([], [1.5], -x * x / 4),
        "sinh_over": lambda x: hyper([], [1.5], x * x / 4),
        "expm1_over": lambda x: hyper([1], [2], x),
        "log1p_over": lambda x: hyper([1, 1], [2], -x),
        "atan_over": lambda x: hyper([0.5, 1], [1.5], -x * x),
        "stumpff": lambda k, z: (
            hyper([1], [(k + 1) / mpmath.mpf(2), (k + 2) / mpmath.mpf(2)], -z / 4) / mpmath.factorial(k)
        ),
    }


def check_derivatives(seed: int, folder: Path, lanes: tuple[int, ...], writer: Any = fuzz_language.Derivatives) -> str:
    """Derivatives within derivatives are those of mpmath's differences of 60 digits, and of one
    form in all worlds.  Which are refused by name, of those at special points.
    """
    text = writer(seed).module()
    module = worlds.module_from(text, folder, f"random_derivative_{seed}")
    rows = [[0.3 + 0.1 * i, -0.7 + 0.2 * i, 1.1 - 0.3 * i, 0.0] for i in range(3)]
    refused, special = [], writer is fuzz_language.SpecialPoints
    if special:
        points = random.Random(seed).sample(fuzz_language.SPECIAL_ROWS, 5)
        rows += [[*point, 0.0] for point in points]
    names = of_mpmath()
    exec(text.partition("\n\n\n")[2], names)
    with mpmath.workdps(60):
        for row in tuple(rows):
            try:
                found = module.formula(*row, 2)
            except InvalidInput as refusal:
                if not special:
                    raise
                refused.append(f"{row}: {refusal}")
                rows.remove(row)
                continue
            right = names["formula"](*map(mpmath.mpf, row), 2)
            for x, y in zip(right, found, strict=True):
                if not abs(x - y) <= 1e-9 * (1.0 + abs(x)) and mpmath.isfinite(x):
                    raise Difference(f"{text}\n{row}: {found} instead of {[float(x) for x in right]}")
    if rows and lanes:
        worlds.same_in_all_worlds(module.formula, rows, 2, lanes)
    return "\n".join(refused)


@pytest.mark.sample(3)
@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(8))
def test_random_derivatives(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "store", lambda *_: None)
    check_derivatives(seed, tmp_path, (1, kernel.lanes()) if seed < 4 else (1,))


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("thousand", (10, 11))
def test_many_random_programs(
    thousand: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four hundred here; twenty thousand by
    `python tests/compiler/test_whole_language.py 10000 30000`.
    """
    monkeypatch.setattr(cache, "store", lambda *_: None)
    refused, failed = sample(range(1000 * thousand, 1000 * thousand + 200), tmp_path)
    with capsys.disabled():
        print(
            f"\n200 programs, {refused['compared']} compared",
            *(f"{n:6} {kind}" for kind, n in refused.most_common()),
            sep="\n",
        )
    assert not failed, "\n".join(text for texts in failed.values() for text in texts)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("hundred", (1, 2))
def test_many_random_derivatives(hundred: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "store", lambda *_: None)
    for seed in range(100 * hundred, 100 * hundred + 40):
        check_derivatives(seed, tmp_path, (1,))


STEPS = 23
BODY = lm.RigidBody([1.0, 1.5, 2.0])
MOMENTA = np.random.default_rng(26).normal(size=(600, 3))


def stepped(method: lm.Method, mu: np.ndarray) -> np.ndarray:
    """The momenta of a run of STEPS, by nothing but the method's own `start`, `step`, `observe`."""
    small = BODY.state(mu=mu.tolist())
    carried = method.start(BODY, lm.BodyState(lm.vec(*small.mu), None), 0.1)
    found = [[*method.observe(carried).mu]]
    for n in range(STEPS):
        carried = method.step(BODY, n * 0.1, carried, 0.1)
        found.append([*method.observe(carried).mu])
    return np.array(found)


def check_memory(seed: int, folder: Path, every_driver: bool = True) -> None:
    """A method that remembers what it likes has one motion in every driver, and native code has the
    bits of plain Python.
    """
    program = fuzz_language.Memories(seed)
    text = program.module()
    module = worlds.module_from(text, folder, f"random_memory_{seed}")

    def same(found: Any, expected: Any, driver: str) -> None:
        if not np.array_equal(found, expected):
            raise Difference(f"{driver}: {found} instead of {expected}\n{text}")

    many = MOMENTA[: (3, 11, 17, 600)[seed % 4]]
    method, one = module.Random(), BODY.state(mu=MOMENTA[0])
    exact = stepped(method, MOMENTA[0])
    if not np.isfinite(exact).all():
        raise Difference(f"the numbers of a memory grew\n{text}")
    for compiled in (False, True):
        world = "native" if compiled else "plain"
        plan = lm.Plan(BODY, method, h=0.1, compensated=False, compiled=compiled)
        same(plan.run(one, steps=STEPS).mu, exact, f"{world} run")
        run = plan.resume(plan.run(one, steps=seed % 5 + 1), steps=3)
        run.save(folder / "run.npz")
        run = plan.resume(lm.Trajectory.load(folder / "run.npz", trusted=True), steps=STEPS - run.carry.step)
        same(run.mu[-1], exact[-1], f"{world} run from a file")
        stepper = plan.stepper(one)
        for steps in (1, 2, 1, 5):
            stepper.step(steps)
        same(stepper.mu, exact[9], f"{world} stepper")
        bodies = many if compiled else many[:3]
        all_of_them = plan.run(BODY.state(mu=bodies), steps=STEPS)
        for i in {0, 1, len(bodies) - 1}:
            same(all_of_them.mu[:, i], stepped(method, bodies[i]), f"{world} body {i} of {len(bodies)}")
        rest = plan.resume(plan.run(BODY.state(mu=bodies), steps=4), steps=STEPS - 4)
        same(rest.mu[-1], all_of_them.mu[-1], f"{world} ensemble that went on")
    if not every_driver:
        return
    for how in DRIVERS:
        # a symmetric method may be the base of others
        of_many = lm.Composition(method, order=4) if program.past and seed % 2 else method
        plain, native = (HOW[how](of_many, one, compiled) for compiled in (False, True))
        for a, b in zip(plain, native, strict=True):
            same(b, a, f"native {how}")


@pytest.mark.sample(8)
@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(40))
def test_derivatives_at_special_points(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At zero, on axes, on diagonals, at ends of branches: right, or refused by name."""
    monkeypatch.setattr(cache, "store", lambda *_: None)
    lanes = (1, kernel.lanes()) if seed % 8 == 0 else ()
    refused = check_derivatives(seed, tmp_path, lanes, fuzz_language.SpecialPoints)
    assert all("carries a derivative" in line for line in refused.splitlines())


def test_guarded_quotients_are_written_at_special_points_too() -> None:
    texts = [fuzz_language.SpecialPoints(seed).module() for seed in range(1000)]
    assert any(" != 0.0 else 1.0" in text for text in texts)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(20))
def test_random_memories(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.setattr(cache, "store", lambda *_: None)
    monkeypatch.setattr(guard_words, "ON", True)
    warnings.simplefilter("ignore")
    check_memory(seed, tmp_path, every_driver=request.node.get_closest_marker("slow") is not None)


def crossing(t: float, state: Any) -> Any:
    return state.mu[2] - 0.02


HOW: dict[str, Any] = {
    "t_eval": lambda method, start, compiled: [
        lm.integrate(BODY, method, start, h=0.1, t_end=2.0, t_eval=[0.3, 1.0, 1.91], compiled=compiled).mu
    ],
    "events": lambda method, start, compiled: (
        run := lm.integrate(BODY, method, start, h=0.1, steps=STEPS, events=[crossing], compiled=compiled),
        [run.mu, run.events[0][0], run.events[0][1].mu],
    )[1],
    "tangent": lambda method, start, compiled: [
        lm.Plan(BODY, method, h=0.1, compiled=compiled).tangent(start, by=("start",), steps=7).tangent["start"]
    ],
    "compensated": lambda method, start, compiled: [
        lm.integrate(BODY, method, start, h=0.1, steps=STEPS, compensated=True, compiled=compiled).mu
    ],
}
DRIVERS = tuple(HOW)


def each(first: int, last: int, checked: Any) -> None:
    """Print which seeds fail, how many were refused, and how many went well."""
    found: collections.Counter[str] = collections.Counter()
    for seed in range(first, last):
        try:
            found["refused" if checked(seed) else "fine"] += 1
        except Exception as failure:
            found[type(failure).__name__] += 1
            print(f"seed {seed}: {type(failure).__name__}: {failure}", flush=True)
    print(dict(found))


def main(first: int, last: int, kind: str = "") -> None:
    cache.store = lambda *_: None
    with tempfile.TemporaryDirectory() as folder:
        if kind:
            warnings.simplefilter("ignore")
            guard_words.ON, home, writer = (kind == "memories", Path(folder), fuzz_language.SpecialPoints)
            each(
                first,
                last,
                lambda seed: (
                    check_memory(seed, home)
                    if kind == "memories"
                    else check_derivatives(seed, home, () if seed % 10 else (1,), writer)
                ),
            )
            return
        if first == last:
            for form, kinds in forms_alone(Path(folder)):
                print(f"--- {form!r}", *(f"{count} {kind}" for kind, count in kinds.items()), sep="\n    ", flush=True)
            return
        refused, failed = sample(range(first, last), Path(folder), print)
    for kind, count in refused.most_common():
        print(f"{count:6} {kind}")
    for name, texts in failed.items():
        print(f"{name}: {len(texts)}", *texts, sep="\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
