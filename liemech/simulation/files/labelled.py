"""Samples with names on their axes, for xarray and pandas."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import MissingExtra


def to_xarray(run: Any) -> Any:
    """The samples of a run as a Dataset."""
    try:
        import xarray
    except ImportError:
        raise MissingExtra("Trajectory.to_xarray needs xarray", "data") from None
    time, coordinates = _time(run)
    lead = (time,) if run.bodies is None else (time, "body")
    found = {name: ((*lead, *(f"{name}_{i}" for i in range(x.ndim - len(lead)))), x) for name, x in run.states.items()}
    about = {"system": repr(run.system), "method": repr(run.method), "h": run.h, "steps": run.steps}
    return xarray.Dataset(found, coordinates, about)


def to_pandas(run: Any) -> Any:
    """The samples of a run as a DataFrame."""
    try:
        import pandas
    except ImportError:
        raise MissingExtra("Trajectory.to_pandas needs pandas", "data") from None
    time, coordinates = _time(run)
    lead = 1 if run.bodies is None else 2
    columns: dict[str, np.ndarray] = {}
    for name, x in run.states.items():
        for at in np.ndindex(x.shape[lead:]):
            columns[f"{name}[{','.join(map(str, at))}]" if at else name] = x[(..., *at)].ravel()
    for name, (axes, x) in coordinates.items():
        if name not in (time, "body"):
            columns[name] = x.ravel() if len(axes) == lead else np.repeat(x, run.bodies or 1)
    times = coordinates[time][1]
    if run.bodies is None:
        return pandas.DataFrame(columns, pandas.Index(times, name=time))
    return pandas.DataFrame(columns, pandas.MultiIndex.from_product([times, range(run.bodies)], names=[time, "body"]))


def _time(run: Any) -> tuple[str, dict[str, tuple[tuple[str, ...], np.ndarray]]]:
    """The axis of the samples, and what is known along it: times, perhaps of each body of an
    ensemble.
    """
    tau = getattr(run, "tau", None) if hasattr(type(run), "tau") else None
    if run.t.ndim == 1:
        return "t", {"t": (("t",), run.t)} | ({} if tau is None else {"tau": (("t",), tau)})
    own = {} if tau is None else {"tau": (("sample", "body"), tau)}
    if tau is None or np.ndim(tau) == 2:  # bodies with steps of their own
        return "sample", {"sample": (("sample",), np.arange(len(run.t))), "t": (("sample", "body"), run.t)} | own
    return "tau", {"tau": (("tau",), np.asarray(tau)), "t": (("tau", "body"), run.t)}
