"""Samples with names on their axes, for xarray and pandas."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import MissingExtra
from ...simulation.reports.written_tables import WrittenTable


def to_xarray(run: Any) -> Any:
    """The samples of a run as a Dataset."""
    try:
        import xarray
    except ImportError:
        raise MissingExtra("Trajectory.to_xarray needs xarray", "data") from None
    time, coordinates = _time(run)
    lead = (time,) if run.bodies is None else (time, "body")
    arrays = {name: ((*lead, *(f"{name}_{i}" for i in range(x.ndim - len(lead)))), x) for name, x in run.states.items()}
    about = {"system": repr(run.system), "method": repr(run.method), "h": run.h, "steps": run.steps}
    return xarray.Dataset(arrays, coordinates, about)


def to_pandas(run: Any) -> Any:
    """The samples of a run as a DataFrame."""
    try:
        import pandas
    except ImportError:
        raise MissingExtra("Trajectory.to_pandas needs pandas", "data") from None
    time, columns = _columns(run)
    times = columns.pop(time)
    if run.bodies is None:
        return pandas.DataFrame(columns, pandas.Index(times, name=time))
    del columns["body"]
    times = times[:: run.bodies]
    return pandas.DataFrame(columns, pandas.MultiIndex.from_product([times, range(run.bodies)], names=[time, "body"]))


def to_csv(run: Any, path: Any) -> None:
    """Write the samples of a run as comma-separated values, with all digits: a row for each time, or each time and
    body.
    """
    columns = _columns(run)[1]
    rows = zip(*[x.tolist() for x in columns.values()], strict=True)
    WrittenTable(tuple(columns), tuple(rows)).to_csv(path)


def _columns(run: Any) -> tuple[str, dict[str, np.ndarray]]:
    """The axis of the samples, and by their names the times, of an ensemble the bodies, and the numbers of the states: a
    row for each time and body.
    """
    time, coordinates = _time(run)
    lead, bodies = (1, 1) if run.bodies is None else (2, run.bodies)
    times = coordinates.pop(time)[1]
    columns = {time: np.repeat(times, bodies)}
    if run.bodies is not None:
        columns["body"] = np.tile(np.arange(bodies), len(times))
    for name, x in run.states.items():
        for at in np.ndindex(x.shape[lead:]):
            columns[f"{name}[{','.join(map(str, at))}]" if at else name] = x[(..., *at)].ravel()
    for name, (axes, x) in coordinates.items():
        columns[name] = x.ravel() if len(axes) == lead else np.repeat(x, bodies)
    return time, columns


def _time(run: Any) -> tuple[str, dict[str, tuple[tuple[str, ...], np.ndarray]]]:
    """The axis of the samples, and what is known along it: times, perhaps of each body of an
    ensemble.
    """
    tau = getattr(run, "tau", None) if hasattr(type(run), "tau") else None
    if run.t.ndim == 1:
        return "t", {"t": (("t",), run.t)} | ({} if tau is None else {"tau": (("t",), tau)})
    taus = {} if tau is None else {"tau": (("sample", "body"), tau)}
    if tau is None or np.ndim(tau) == 2:  # bodies with steps of their own
        return "sample", {"sample": (("sample",), np.arange(len(run.t))), "t": (("sample", "body"), run.t)} | taus
    return "tau", {"tau": (("tau",), np.asarray(tau)), "t": (("tau", "body"), run.t)}
