"""Ensembles on many processes and machines: chunks of bodies, by any executor of
concurrent.futures.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pickle
import secrets
import tempfile
from concurrent import futures
from typing import Any

import numpy as np

from ...errors import IntegrationInterrupted, InvalidInput, InvalidType, warn
from ...simulation import arguments
from ...simulation.compiled.systems import OfBodies, Systems
from ...simulation.reports.progress import WANTED, Bar
from ...simulation.result import ends, of_some
from ...simulation.runs.carry import Carry, all_of
from ...simulation.stopped import Stopped
from ...simulation.trajectory import Trajectory, TransformedTrajectory
from ...systems.system import State
from ..fictive_time.origin import FictiveCarry, origin_of

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
        raise InvalidType(f"integrate: executor is one of concurrent.futures, or has its `submit`; got {executor!r}")
    if not isinstance(start, State) or start.bodies is None:
        raise InvalidInput(
            "integrate: executor is for ensembles, whose bodies it spreads; executor.submit(plan.run, ...) for one"
        )
    plan._started(start, how["t0"])
    arguments.ends(how["t_end"], start.bodies)
    arguments.columns(how["t_eval"], start.bodies)
    chunks = _chunks(start.bodies, how.get("steps") or 1000, getattr(executor, "_max_workers", None))
    work = Work(plan, start, chunks, how, executor)
    try:
        with Bar(plan.options.progress, start.bodies, "body") as bar:
            work.run(bar)
    except BaseException as error:
        work.leave()
        if not isinstance(error, KeyboardInterrupt):
            raise
        raise work.interrupted() from None
    return work.whole()


class Work:
    """The chunks of an ensemble, run by an executor.

    jobs : by chunk, its plan, its start and its times.  found : by chunk that is done, its run.  tries : by chunk, how
    often it was handed out.  running : by future, the chunk that a worker has.
    """

    def __init__(self, plan: Any, start: Any, chunks: list[Any], how: dict[str, Any], executor: Any) -> None:
        self.plan, self.chunks, self.executor = plan, chunks, executor
        self.jobs = [
            (_part_of(plan, first, end), _members(start, first, end), _times_of(how, first, end))
            for first, end in chunks
        ]
        self.found: dict[int, Any] = {}
        self.tries = [0] * len(self.jobs)
        self.running: dict[Any, int] = {}
        # a file that tells workers of this machine that nobody waits for them any more
        name = f"liemech-{secrets.token_hex(16)}.stop"
        self.unless = os.path.join(tempfile.gettempdir(), name)

    def hand_out(self, i: int) -> None:
        """Give a chunk to the executor; compute it here if that is broken or keeps losing it."""
        self.tries[i] += 1
        try:
            if self.tries[i] <= TRIES:
                self.running[self.executor.submit(_run, *self.jobs[i], self.unless)] = i
                return
        except futures.BrokenExecutor:
            pass
        warn(f"integrate: the executor lost chunk {i} of {len(self.jobs)}; it is computed here", RuntimeWarning)
        self.found[i] = _run(*self.jobs[i])

    def run(self, bar: Bar) -> None:
        """Hand out all chunks, and those again whose workers were lost, until all are done."""
        for i in range(len(self.jobs)):
            self.hand_out(i)
        while self.running:
            finished, _ = futures.wait(self.running, timeout=LOOK, return_when=futures.FIRST_COMPLETED)
            for future in finished:
                i = self.running.pop(future)
                try:
                    self.found[i] = future.result()
                except (Exception, futures.CancelledError) as error:
                    if "pickle" in str(error).lower():
                        self._require_sendable()
                    if self.tries[i] >= TRIES and not isinstance(error, futures.BrokenExecutor):
                        raise
                    self.hand_out(i)
                if i in self.found:
                    bar.advance(self.chunks[i][1] - self.chunks[i][0])

    def _require_sendable(self) -> None:
        """Raise InvalidInput for the argument that cannot be sent to another process."""
        for name, value in self.plan._given.items():
            try:
                pickle.dumps(value)
            except Exception as error:
                raise InvalidInput(
                    f"integrate: executor: {name} cannot be sent to other processes ({error}). Define its functions "
                    "and classes at the top of a module, with def, or give an executor of threads"
                ) from None

    def leave(self) -> None:
        """Take what is done, and tell workers that nobody waits for the rest."""
        left = set()
        for future, i in self.running.items():
            if future.cancel():
                continue
            if not future.done():
                left.add(future)
            elif future.exception() is None:
                self.found[i] = future.result()
        _end(left, self.unless)

    def interrupted(self) -> IntegrationInterrupted:
        """The interruption, with the chunks that were done."""
        finished = {i: run for i, run in self.found.items() if isinstance(run, Trajectory)}
        stopped = IntegrationInterrupted(
            f"integrate: interrupted; {len(finished)} of {len(self.jobs)} chunks of bodies were done; they "
            "are in `.trajectory`, where the other bodies stand at their starts"
        )
        waiting = [job[0].replace(compiled=False, progress=False)._standing(job[1], job[2]["t0"]) for job in self.jobs]
        parts = [finished.get(i, standing) for i, standing in enumerate(waiting)]
        stopped.trajectory = _joined(self.plan, self.chunks, parts)
        return stopped

    def whole(self) -> Any:
        """The run of all bodies.  Raises what the run of a chunk has raised."""
        for i, result in sorted(self.found.items()):
            if isinstance(result, Exception):
                first, end = self.chunks[i]
                result.add_note(
                    f"[integrate: in the chunk of bodies {first} to {end - 1}, which are counted from 0 there]"
                )
                raise result
        return _joined(self.plan, self.chunks, [self.found[i] for i in range(len(self.jobs))])


def _run(plan: Any, start: Any, how: dict[str, Any], unless: str | None = None) -> Any:
    """Run a chunk where it is computed.  Errors of its run are results: one of `submit` tells of a lost worker.

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


def _chunks(bodies: int, steps: int, workers: int | None) -> list[tuple[int, int]]:
    """Pairs (first, end) of the bodies of each chunk, in whole lanes."""
    chunks = 4 * workers if workers else CHUNKS
    size = max(-(-bodies // chunks), CHUNK // max(1, steps))
    size = -(-min(size, bodies) // LANES) * LANES
    return [(first, min(first + size, bodies)) for first in range(0, bodies, size)]


def _part_of(plan: Any, first: int, end: int) -> Any:
    """The plan of the bodies from `first` to `end`, with their own parameters."""
    parameters = {name: [*values][first:end] for name, values in plan.of_each.items()}
    return plan.replace(progress=False, **parameters)


def _times_of(how: dict[str, Any], first: int, end: int) -> dict[str, Any]:
    """The arguments of the run of some bodies, with their own t_end and t_eval."""
    t_end, t_eval = how["t_end"], how["t_eval"]
    if arguments.axes(t_end, "t_end") == 1:
        t_end = np.asarray(t_end)[first:end]
    if arguments.axes(t_eval, "t_eval") == 2:
        t_eval = np.asarray(t_eval)[:, first:end]
    return how | {"t_end": t_end, "t_eval": t_eval}


def _members(start: Any, first: int, end: int) -> Any:
    return type(start)(*(None if x is None else np.array(x[first:end]) for x in start.parts.values()))


def _joined(plan: Any, chunks: list[tuple[int, int]], runs: list[Any]) -> Any:
    """The trajectories of all chunks as that of the ensemble, with a warning of bodies that stopped."""
    bodies = chunks[-1][1]
    places = {begin + i: (run, i) for (begin, _), run in zip(chunks, runs) for i in run.stopped}
    steps = {body: run.stopped.steps[i] for body, (run, i) in places.items()}
    stopped = Stopped(steps, lambda body: places[body][0].stopped[places[body][1]].error)
    if steps:
        examples = ", ".join(f"body {i} after {n} steps" for i, n in list(steps.items())[:5])
        warn(
            f"integrate: {len(steps)} of {bodies} bodies stopped early: {examples}. {stopped[min(steps)].error}",
            RuntimeWarning,
        )
    fields: dict[str, Any] = {}
    if isinstance(runs[0], TransformedTrajectory):
        fields = {"origin": _origin(runs)}
    fields |= {
        "system": _systems(plan, runs),
        "method": plan.method,
        "stopped": stopped,
        "events": tuple([sum(events, ()) for events in zip(*(run.events for run in runs))]),
        "ended": ends([number for run in runs for number in run.ended or [None] * run.bodies]),
    }
    return of_some(runs, lambda: _carry([run.carry for run in runs], fields.get("origin")), **fields)


def _systems(plan: Any, runs: list[Any]) -> Any:
    """The systems that move; of runs in fictive time those inside."""
    if isinstance(plan.system, OfBodies) and isinstance(runs[0], TransformedTrajectory):
        return Systems(sum([tuple(run.system) for run in runs], ()))
    return runs[0].system if isinstance(runs[0], TransformedTrajectory) else plan.system


def _origin(runs: list[Any]) -> Any:
    """The origin of all motions: one, or a tuple with one for each body if chunks have such."""
    origins = [run.origin for run in runs]
    if not any(isinstance(origin_of_chunk, tuple) for origin_of_chunk in origins):
        return dataclasses.replace(origins[0], start=all_of([origin_of_chunk.start for origin_of_chunk in origins]))
    return tuple([origin_of(run.origin, i) for run in runs for i in range(run.bodies)])


def _carry(carries: list[Any], origin: Any) -> Any:
    """The carry of all bodies; None if those of a chunk have all ended."""
    if None in carries:
        return None
    if origin is None:
        return Carry.beside(carries)
    inner, standing = Carry.beside([carry.inner for carry in carries]), None
    if any(carry.here is not None for carry in carries):
        standing = np.concatenate([carry.standing for carry in carries], axis=1)
    return FictiveCarry(origin, inner, standing)
