"""Runs in files: the arrays as they are, in NumPy's .npz, and beside them in words what they are.

`numpy.load("run.npz")["mu"]` needs no liemech; nothing is pickled.
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

import liemech as lm

from .constructors import read

FORMAT = 1


def save(run: lm.Trajectory, path: Path, title: str = "", view: tuple[str, ...] | None = None) -> None:
    """Write the times, the recorded parts of the state, and `about`, a text in JSON: system, method, step, title."""
    about: dict[str, Any] = {"format": FORMAT, "version": lm.__version__, "title": title}
    about |= {"system": repr(run.system), "modules": _modules(run.system)}
    about |= {"method": repr(run.method), "h": run.h, "steps": run.steps, "bodies": run.bodies, "view": view}
    with path.open("wb") as file:
        np.savez(file, about=np.array(json.dumps(about)), t=run.t, **run.states)  # type: ignore[arg-type]


def load(path: Path) -> tuple[lm.viewer.Motion, dict[str, Any]]:
    """The motion in a file, and what is told about it.  Raises InvalidInput for other files."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        about = json.loads(str(arrays.pop("about")))
        form, text, modules = about["format"], about["system"], about["modules"]
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as wrong:
        raise lm.errors.InvalidInput(f"{path}: is no run saved by liemech ({wrong})") from None
    if form != FORMAT:
        raise lm.errors.InvalidInput(f"{path}: is of format {form}; this liemech {lm.__version__} reads format {FORMAT}")
    system = read(text, lm.System, f"{path}: system", modules)
    t = arrays.pop("t")
    return lm.viewer.Motion(system, t, arrays, about["bodies"]), about


def _modules(thing: Any) -> list[str]:
    """The modules of the user's classes in an object."""
    found = set() if type(thing).__module__.partition(".")[0] == "liemech" else {type(thing).__module__}
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if isinstance(value, lm.Record):
            found |= set(_modules(value))
    return sorted(found)
