"""One formula in three worlds: plain Python, native code for one body, native code for many bodies in lanes."""

from __future__ import annotations

import importlib.util
import struct
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from liemech.compiler import kernel
from liemech.compiler.driver import accepted, attempt, itself, read, write
from liemech.errors import NotCompilable as NotCompilable
from liemech.formulas import Vec, where
from liemech.formulas.classes.layouts import NUMBER, layout_of

REJECTED = "rejected"  # the formula raised

BEHIND = 64
"""Rows behind a result, which nothing may write."""

UNWRITTEN = 0x7FF5_0123_4567_89AB
"""The bits of a nan that no formula gives."""

SPECIAL = (0.0, -0.0, 1.0, -1.0, 1e-310, 1e300, -1e300, float("inf"), float("-inf"), float("nan"))


def drive(formula: Any, extra: Any, layout: Any, turns: int, given: Any, out: Any, fine: Any) -> None:
    """The driver: the formula's numbers, in `out`, and whether it went through, in `fine`."""
    value = attempt(formula, *extra, *read(given, 0, layout), turns)
    write(out, 0, value, layout_of(value))
    write(fine, 0, where(accepted(value, itself), 1.0, 0.0), NUMBER)


def flat(value: Any) -> Any:
    """All numbers of a result, as a vector: in plain Python only, formulas under test return one."""
    if isinstance(value, (tuple, list)):
        return [x for item in value for x in flat(item)]
    return [float(value)]


def bits(x: float) -> bytes:
    """The bits of a float; all nans are one, for IEEE 754 leaves their sign and payload open."""
    return b"nan" if x != x else struct.pack("<d", x)


def plain(formula: Callable[..., Any], row: Sequence[float], turns: int) -> Any:
    try:
        return [bits(x) for x in flat(formula(*row, turns))]
    except (ArithmeticError, ValueError, AssertionError):
        return REJECTED


def native(
    formula: Callable[..., Any],
    rows: Sequence[Sequence[float]],
    width: int,
    turns: int,
    lanes: int,
    extra: tuple[Any, ...] = (),
) -> list[Any]:
    """What native code gives for each row of arguments, after those that all rows share; like
    `plain`.
    """
    found = outcomes(formula, rows, width, turns, lanes, extra)
    return [values if fine or not all(map(_finite, values)) else REJECTED for values, fine in found]


def outcomes(
    formula: Callable[..., Any],
    rows: Sequence[Sequence[float]],
    width: int,
    turns: int,
    lanes: int,
    extra: tuple[Any, ...] = (),
) -> list[tuple[list[bytes], bool]]:
    """What native code gives for each row of arguments, and whether it went through and is finite."""
    layout = layout_of(Vec(*([0.0] * len(rows[0]))))
    columns = -(-len(rows) // lanes) * lanes
    given = np.array([*rows, *[rows[-1]] * (columns - len(rows))], dtype=float).T.copy()
    results: list[Any] = []

    def run(given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        out, fine = np.empty((width + BEHIND, given.shape[1])), np.zeros((1, given.shape[1]))
        out.view(np.int64)[...] = UNWRITTEN
        args = formula, extra, layout, turns, given, out, fine
        n = given.shape[1]
        kernel.kernel(drive, *args, lanes=lanes)(*args, bodies=n, end=n)
        empty = out.view(np.int64) == UNWRITTEN
        assert empty[width:].all(), f"{formula} gives more than {width} numbers"
        assert not empty[:width, fine[0] != 0.0].any(), f"{formula} gives less than {width} numbers"
        return out[:width], fine

    if lanes > 1:
        out, fine = run(given)
    else:  # a single body has arrays of one column
        parts = [run(np.ascontiguousarray(given[:, i : i + 1])) for i in range(columns)]
        out, fine = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    for i in range(len(rows)):
        values = [bits(x) for x in out[:, i].tolist()]
        results.append((values, bool(fine[0, i])))
    return results


def same_in_all_worlds(
    formula: Callable[..., Any], rows: Iterable[Sequence[float]], turns: int = 3, lanes: Iterable[int] | None = None
) -> None:
    """Assert that `formula(*row, turns)` gives the same bits plain, compiled and in every lane
    beside all the other rows.
    """
    rows = [list(map(float, row)) for row in rows]
    expected = [plain(formula, row, turns) for row in rows]
    lengths = {len(e) for e in expected if not isinstance(e, str)}
    assert len(lengths) <= 1, "a formula must return the same number of numbers on every way"
    assert lengths, "not one row of arguments goes through"
    width = lengths.pop()
    for count in lanes or (1, kernel.lanes()):
        found = outcomes(formula, rows, width, turns, count)
        for row, right, got in zip(rows, expected, found, strict=True):
            values, fine = got
            what = (
                f"{count} lanes, arguments {row}, turns {turns}: {_shown(values)}, {fine}, instead of {_shown(right)}"
            )
            assert fine is (right is not REJECTED and all(map(_finite, right))), what
            assert right is REJECTED or values == right, what


def _finite(x: bytes) -> bool:
    return x != b"nan" and bool(np.isfinite(struct.unpack("<d", x)[0]))


def _shown(values: Any) -> Any:
    return values if isinstance(values, str) else [v if v == b"nan" else struct.unpack("<d", v)[0] for v in values]


def module_from(text: str, folder: Path, name: str) -> ModuleType:
    """The module with this text, from a file of its own."""
    file = folder / f"{name}.py"
    file.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
