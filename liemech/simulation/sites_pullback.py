"""Products of cotangents with the derivatives of a run of many sites, as a user asks for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from .sites_adjoint import BackwardRun
from .tangent import frame


def pulled_back(
    plan: Any, start: Any, steps: int, t0: float, names: tuple[str, ...], every: int | None,
    cotangent: Any,
) -> tuple[dict[str, np.ndarray], Any]:  # fmt: skip
    """The products of a cotangent with the derivatives of the last state by "start" and by parameters of
    terms, or of all samples, `every` so many steps; and the run.

    cotangent : (N,) in the components of tangent maps, or by the parts of the state, {"mu": (sites, dim)},
    {"g": (sites, n, n)}; with an axis of samples in front where there is an `every`.  Raises InvalidInput
    for other shapes.
    """
    shown = plan.replace(every=every or max(1, steps))
    run = shown.run(start, steps=steps, t0=t0)
    numbers = np.minimum(np.arange(len(run.t)) * (every or max(1, steps)), steps)
    state = shown._start_of_sites(start)
    back = BackwardRun(shown._sites, state, steps, t0, tuple(n for n in names if n != "start"))
    some = len(numbers) if every else 1
    rows = (
        _of_parts(back, run, cotangent, some, every is not None)
        if isinstance(cotangent, dict)
        else _shaped(cotangent, "", (back.components,), some, every is not None)
    )
    found, by = back.back(dict(zip(numbers[-some:].tolist(), rows, strict=True)))
    by["start"] = found
    return {name: by[name] for name in names}, run


def _shaped(given: Any, name: str, shape: tuple[int, ...], some: int, along: bool) -> np.ndarray:
    """A cotangent by the components of a part, (samples, ...)."""
    what, wanted = f"cotangent[{name!r}]" if name else "cotangent", (some,) * along + shape
    array = np.asarray(given)
    if array.shape != wanted or array.dtype.kind not in "fiu":
        raise InvalidInput(
            f"Plan.pullback: {what} is {wanted}, as the samples are; got {array.shape}"
        )
    if not np.isfinite(array).all():
        raise InvalidInput(f"Plan.pullback: {what} must be finite")
    return array.reshape(some, *shape).astype(float)


def _of_parts(back: BackwardRun, run: Any, given: Any, some: int, along: bool) -> np.ndarray:
    """Cotangents by the arrays of a state as components, (samples, N)."""
    unknown = [name for name in given if name not in back.names]
    if unknown:
        raise InvalidInput(
            f"Plan.pullback: cotangent has {unknown[0]!r}; the parts of the state are {', '.join(back.names)}"
        )
    found = []
    for name, size in back.dims.items():
        there = run.states[name][-some:]
        if name not in given:
            found.append(np.zeros((some, back.sites * size)))
            continue
        own = _shaped(given[name], name, there.shape[1:], some, along)
        if name == "g":
            points = there.reshape(some * back.sites, *there.shape[2:])
            basis = frame(back.plan._sites.site, "g", back.first.parts["g"])(points)
            basis = basis.reshape(len(points), size, -1)
            own = np.einsum("sn,scn->sc", own.reshape(len(points), -1), basis)
        found.append(own.reshape(some, -1))
    return np.concatenate(found, axis=1)
