"""Ensembles on many processes and machines: chunks of bodies, by any executor of
concurrent.futures.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import secrets
import tempfile
from concurrent import futures
from typing import Any

import numpy as np

from ...errors import IntegrationInterrupted, InvalidInput, InvalidType, warn
from ...systems.system import State
from .. import arguments
from ..carry import Carry, all_of
from ..compiled.systems import OfBodies, Systems
from ..origin import FictiveCarry, origin_of
from ..reports.progress import WANTED, Bar
from ..result import of_some
from ..stopped import Stopped
from ..trajectory import Trajectory, TransformedTrajectory

CHUNK = 2**22
"""Steps of all bodies of a chunk together, at least: some tenths of a second in native code."""

CHUNKS = 64
"""Chunks at most, for executors that do not say how many workers they have; else four for each
worker.
"""

TRIES = 3
"""How often a chunk is handed out whose worker was lost."""

LANES = 16
"""Bodies of a chunk are a multiple of this: what runs side by side in native code."""

LOOK = 0.25
"""Seconds between two looks at the keyboard."""


def spread(plan: Any, start: Any, executor: Any, **how: Any) -> Any:
    """A run of an ensemble by an executor: chunks of bodies, joined in order, each with the bits
    that it has alone.

    A chunk whose worker was lost is handed out again; if the executor is broken or keeps losing it,
    it is computed here.
    """
    if not callable(getattr(executor, "submit", None)):
        raise InvalidType(
            "integrate: executor is one of concurrent.futures, "
            f"or has its `submit`; got {executor!r}"
        )
    if not isinstance(start, State) or start.bodies is None:
        raise InvalidInput(
            "integrate: executor is for ensembles, whose bodies it spreads; "
            "executor.submit(plan.run, ...) for one"
        )
    plan._started(start)
    arguments.ends(how["t_end"], start.bodies)
    arguments.columns(how["t_eval"], start.bodies)
    chunks = _chunks(
        start.bodies, how.get("steps") or 1000, getattr(executor, "_max_workers", None)
    )
    jobs = [
        (_part_of(plan, first, end), _members(start, first, end), _times_of(how, first, end))
        for first, end in chunks
    ]
    found: dict[int, Any] = {}
    tries = [0] * len(jobs)
    running: dict[Any, int] = {}

    # a file that tells workers of this machine that nobody waits for them any more
    unless = os.path.join(tempfile.gettempdir(), f"liemech-{secrets.token_hex(16)}.stop")

    def here(i: int) -> None:
        found[i] = _run(*jobs[i])

    def hand_out(i: int) -> None:
        tries[i] += 1
        try:
            if tries[i] <= TRIES:
                running[executor.submit(_run, *jobs[i], unless)] = i
                return
        except futures.BrokenExecutor:
            pass
        warn(
            f"integrate: the executor lost chunk {i} of {len(jobs)}; it is computed here",
            RuntimeWarning,
        )
        here(i)

    try:
        with Bar(plan.options.progress, start.bodies, "body") as bar:
            for i in range(len(jobs)):
                hand_out(i)
            while running:
                done, _ = futures.wait(running, timeout=LOOK, return_when=futures.FIRST_COMPLETED)
                for future in done:
                    i = running.pop(future)
                    try:
                        found[i] = future.result()
                    except (Exception, futures.CancelledError) as error:
                        if tries[i] >= TRIES and not isinstance(error, futures.BrokenExecutor):
                            raise
                        hand_out(i)
                    if i in found:
                        bar.advance(chunks[i][1] - chunks[i][0])
    except BaseException as error:
        left = set()
        for future, i in running.items():
            if future.cancel():
                continue
            if not future.done():
                left.add(future)
            elif future.exception() is None:
                found[i] = future.result()
        _end(left, unless)
        if not isinstance(error, KeyboardInterrupt):
            raise
        whole = {i: run for i, run in found.items() if isinstance(run, Trajectory)}
        stopped = IntegrationInterrupted(
            f"integrate: interrupted; {len(whole)} of {len(jobs)} chunks of bodies were done; they "
            "are in `.trajectory`, where the other bodies stand at their starts"
        )
        parts = [whole[i] if i in whole else _waiting(*jobs[i]) for i in range(len(jobs))]
        stopped.trajectory = _joined(plan, chunks, parts)
        raise stopped from None
    for i, result in sorted(found.items()):
        if isinstance(result, Exception):
            first, end = chunks[i]
            result.add_note(
                f"[integrate: in the chunk of bodies {first} to "
                f"{end - 1}, which are counted from 0 there]"
            )
            raise result
    return _joined(plan, chunks, [found[i] for i in range(len(jobs))])


def _run(plan: Any, start: Any, how: dict[str, Any], unless: str | None = None) -> Any:
    """A chunk, where it is computed.  What its run raises is a result: an error of `submit` tells
    of a lost worker.

    unless : a file; when it is there, nobody waits for the chunk.
    """
    before, WANTED.unless = WANTED.unless, unless
    try:
        if unless is not None and os.path.exists(unless):
            return None
        return plan.run(start, **how)
    except Exception as error:
        return error
    except KeyboardInterrupt:
        if unless is not None and os.path.exists(unless):
            return None
        raise
    finally:
        WANTED.unless = before


def _end(running: set[Any], unless: str) -> None:
    """Tell the workers of these futures that nobody waits for them; the file goes with the last."""
    if not running:
        return
    with contextlib.suppress(OSError), open(unless, "x"):  # else they come to their ends
        pass

    def ended(future: Any) -> None:
        running.discard(future)
        if not running:
            with contextlib.suppress(OSError):
                os.unlink(unless)

    for future in tuple(running):
        future.add_done_callback(ended)


def _waiting(plan: Any, start: Any, how: dict[str, Any]) -> Any:
    """A chunk that is not done: every body stands at its start."""
    return plan.replace(compiled=False, progress=False)._standing(start, how["t0"])


def _chunks(bodies: int, steps: int, workers: int | None) -> list[tuple[int, int]]:
    """Where chunks begin and end."""
    wanted = 4 * workers if workers else CHUNKS
    size = max(-(-bodies // wanted), CHUNK // max(1, steps))
    size = -(-min(size, bodies) // LANES) * LANES
    return [(first, min(first + size, bodies)) for first in range(0, bodies, size)]


def _part_of(plan: Any, first: int, end: int) -> Any:
    """The plan of some bodies."""
    own = {name: [*values][first:end] for name, values in plan.of_each.items()}
    return plan.replace(progress=False, **own)


def _times_of(how: dict[str, Any], first: int, end: int) -> dict[str, Any]:
    """The arguments of the run of some bodies, with their own t_end and t_eval."""
    t_end, t_eval = how["t_end"], how["t_eval"]
    if arguments.axes(t_end, "t_end") == 1:
        t_end = np.asarray(t_end)[first:end]
    if arguments.axes(t_eval, "t_eval") == 2:
        t_eval = np.asarray(t_eval)[:, first:end]
    return how | {"t_end": t_end, "t_eval": t_eval}


def _members(start: Any, first: int, end: int) -> Any:
    return type(start)(
        *(None if x is None else np.array(x[first:end]) for x in start.parts.values())
    )


def _joined(plan: Any, chunks: list[tuple[int, int]], runs: list[Any]) -> Any:
    """The runs of all chunks as one."""
    bodies = chunks[-1][1]
    places = {begin + i: (run, i) for (begin, _), run in zip(chunks, runs) for i in run.stopped}
    steps = {body: run.stopped.steps[i] for body, (run, i) in places.items()}
    stopped = Stopped(steps, lambda body: places[body][0].stopped[places[body][1]].error)
    if steps:
        some = ", ".join(f"body {i} after {n} steps" for i, n in list(steps.items())[:5])
        warn(
            f"integrate: {len(steps)} of {bodies} bodies stopped early: {some}. "
            f"{stopped[min(steps)].error}",
            RuntimeWarning,
        )
    own: dict[str, Any] = {}
    if isinstance(runs[0], TransformedTrajectory):
        own = {"origin": _origin(runs)}
    own |= {
        "system": _systems(plan, runs),
        "method": plan.method,
        "stopped": stopped,
        "events": tuple([sum(found, ()) for found in zip(*(run.events for run in runs))]),
    }
    return of_some(runs, lambda: _carry([run.carry for run in runs], own.get("origin")), **own)


def _systems(plan: Any, runs: list[Any]) -> Any:
    """The systems that move; of runs in fictive time those inside."""
    if isinstance(plan.system, OfBodies) and isinstance(runs[0], TransformedTrajectory):
        return Systems(sum([tuple(run.system) for run in runs], ()))
    return runs[0].system if isinstance(runs[0], TransformedTrajectory) else plan.system


def _origin(runs: list[Any]) -> Any:
    """Where the motions began: one for all, or a tuple if it is so of some."""
    origins = [run.origin for run in runs]
    if not any(isinstance(one, tuple) for one in origins):
        return dataclasses.replace(origins[0], start=all_of([one.start for one in origins]))
    return tuple([origin_of(run.origin, i) for run in runs for i in range(run.bodies)])


def _carry(carries: list[Any], origin: Any) -> Any:
    """Where all bodies stand; None if those of a chunk have all ended."""
    if None in carries:
        return None
    if origin is None:
        return Carry.beside(carries)
    inner, here = Carry.beside([one.inner for one in carries]), None
    if any(one.here is not None for one in carries):
        here = np.concatenate([one.standing for one in carries], axis=1)
    return FictiveCarry(origin, inner, here)
