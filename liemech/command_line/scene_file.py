"""Scenes from files: TOML with strict keys.

    title = "a tumbling book"
    view = ["body", "momentum"]

    [system]
    name = "RigidBody"
    inertia = [1.0, 1.5, 2.0]

    [start]
    mu = [0.5, 0.0, 0.866]
    g = "identity"

    [method]
    name = "CovariantVariational"
    retraction = "Cayley()"

    [run]
    h = 0.1
    steps = 1000

A file names classes of the library and nothing else, unless the user says that it is trusted.
"""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import liemech as lm

from ..names import meant
from ..rooms.files.arrays import opened
from ..simulation.arguments import chooses_steps
from .constructors import from_table
from .scene import Setup

TABLES = ("system", "start", "method", "run")
LISTS = ("record", "view")
RUN = ("h", "steps", "every", "t_end", "rtol", "atol", "t0")
COUNTS = ("steps", "every")


LONGEST = 10_000_000
"""Bytes of a file; longer ones are no scenes."""

MOST_STEPS = 10**9
"""Fixed steps that a file may ask for, some minutes; a user who wants more says so by --steps."""

MOST_KEPT = 10**7
"""Steps that are kept that a file may ask for; of adaptive ones every one is."""

KEPT = 10**6
"""Adaptive steps at most, where a file does not say."""


def scene_file(path: Path, trusted: bool = False) -> Setup:
    """The scene that a file describes.  trusted : modules that it names are imported.

    Raises InvalidInput: the file, the key, and what is allowed.
    """
    where = str(path)
    try:
        with opened(path) as file:
            content = file.read(LONGEST + 1)
        if len(content) > LONGEST:
            raise lm.errors.InvalidInput(f"{where}: is longer than {LONGEST} bytes, and no scene")
        data = tomllib.loads(content.decode("utf-8"))
    except (OSError, UnicodeDecodeError) as refused:
        raise lm.errors.InvalidInput(f"{where}: cannot be read, {refused}") from None
    except tomllib.TOMLDecodeError as wrong:
        raise lm.errors.InvalidInput(f"{where}: is no TOML, {wrong}") from None
    except (RecursionError, ValueError) as wrong:
        raise lm.errors.InvalidInput(f"{where}: is no scene, {wrong}") from None
    _strict(data, ("title", *LISTS, *TABLES), where, "the file")
    for name in TABLES:
        if not isinstance(data.get(name), Mapping):
            raise lm.errors.InvalidInput(f"{where}: needs a table [{name}]; wanted are [{'], ['.join(TABLES)}]")
    title = data.get("title", path.stem)
    if not isinstance(title, str):
        raise lm.errors.InvalidInput(f"{where}: title must be a text; got {title!r}")
    lists: dict[str, Any] = {name: _names(data[name], f"{where}: {name}") for name in LISTS if name in data}
    system = from_table(data["system"], lm.System, f"{where} [system]", trusted)
    method = from_table(data["method"], lm.Method, f"{where} [method]", trusted)
    start = _start(system, data["start"], f"{where} [start]")
    options = _run(data["run"], f"{where} [run]")
    _bounded(options, system, method, f"{where} [run]")
    return Setup(title, system, method, start, **options, **lists)


def _start(system: Any, table: Mapping[str, Any], where: str) -> Any:
    """The state of the system; g may be "identity", or a rotation vector as { exp = [0.6, 0.0, 0.0] }."""
    parts = list(inspect.signature(system.state).parameters)
    _strict(table, parts, where, "the start")
    arguments = dict(table)
    group: Any = getattr(system, "configurations", getattr(system, "group", None))
    g = arguments.get("g")
    if isinstance(g, str) and g != "identity":
        raise lm.errors.InvalidInput(f'{where}: g is "identity", {{ exp = [...] }}, or an element as rows; got {g!r}')
    if isinstance(g, Mapping):
        _strict(g, ("exp",), f"{where}: g", "g")
    try:
        if g == "identity":
            arguments["g"] = np.array(group.identity())
        elif isinstance(g, Mapping):
            arguments["g"] = np.array(group.exp(np.array(g.get("exp"), dtype=float)))
        return system.state(**arguments)
    except Exception as wrong:  # whatever becomes of values that nobody meant
        raise lm.errors.InvalidInput(f"{where}: {wrong}") from wrong


def _run(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The options of the run, all of them numbers."""
    _strict(table, RUN, where, "the run")
    for key, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int if key in COUNTS else (int, float)):
            kind = "a whole number" if key in COUNTS else "a number"
            raise lm.errors.InvalidInput(f"{where}: {key} must be {kind}; got {value!r}")
    if "t_end" not in table and not {"h", "steps"} <= table.keys():
        raise lm.errors.InvalidInput(f"{where}: give h and steps, or t_end for adaptive steps")
    return dict(table)


def _bounded(table: dict[str, Any], system: Any, method: lm.Method, where: str) -> None:
    """Give the number of steps a bound, for nobody may have looked at what a file asks for."""
    h, length = table.get("h"), table.get("t_end", 0.0) - table.get("t0", 0.0)
    fictive = method.fictive or system.fictive
    if "t_end" in table and (fictive or chooses_steps(method)):
        steps, most, advice = table.setdefault("steps", KEPT), MOST_KEPT, ""
    else:
        steps = table["steps"] if "steps" in table else abs(length / h) if h else 0
        most = min(MOST_STEPS, MOST_KEPT * max(1, table.get("every", MOST_STEPS)))
        advice = "; --steps takes more"
    if steps > most:
        raise lm.errors.InvalidInput(f"{where}: {steps:.2g} steps; a file may ask for {most:.0e} at most{advice}")


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not all(isinstance(name, str) for name in value):
        raise lm.errors.InvalidInput(f'{where} must be a list of names such as ["mu"]; got {value!r}')
    return tuple(value)


def _strict(table: Mapping[str, Any], allowed: Any, where: str, what: str) -> None:
    for key in table:
        if key not in allowed:
            raise lm.errors.InvalidInput(
                f"{where}: {key!r} is no key of {what}{meant(key, allowed)}; allowed are {', '.join(allowed)}"
            )
