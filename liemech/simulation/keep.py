"""Observers of a run: each keeps something of its steps.

An observer has `see(piece)`, which looks at some more steps, and `forget()`, after Ctrl-C, what it has
seen beyond the place where the run stands.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, IntegrationInterrupted
from .compiled.control import TAKEN

ROWS = 2**17
"""Samples inside of steps whose states are found at once."""


class Piece:
    """Some more steps of some bodies, listed body after body.

    out : (turns + 1, width, bodies) rows, of which the first is where the bodies were.
    begun, taken : of each body what marked its steps so far, and how many there were.
    body, column, turn : of each step.  before : the row where it began.  number : of steps, with it.
    a, b : the times where it began and ended.  kept : is its row a sample, whatever its number?

    Of two bodies and three turns, in which the first one had its second trial rejected: body (0, 0, 1, 1, 1),
    turn (1, 3, 1, 2, 3), before (0, 1, 0, 1, 2).
    """

    def __init__(self, run: Any, bodies: np.ndarray, out: np.ndarray, begun: np.ndarray, taken: np.ndarray) -> None:
        self.out, self.marked = out, run.lanes.mark
        place, sign = out[:, self.marked, : len(bodies)].copy(), run.sign[bodies]
        place[0] = begun[: len(bodies)]
        reached = sign * np.maximum.accumulate(sign * place, axis=0)
        self.column, self.turn = np.nonzero((reached[1:] != reached[:-1]).T)
        self.turn += 1
        self.body = bodies[self.column]
        first = np.flatnonzero(self.begins)
        self.before = np.concatenate([np.zeros(1, int), self.turn[:-1]])[: len(self)]
        self.before[first] = 0
        self.number = self.turn
        if not run.adaptive:  # where every n-th step is kept
            firsts = np.repeat(first, np.diff(np.append(first, len(self))))
            self.number = taken[self.column] + np.arange(len(self)) - firsts + 1
        self.a, self.b = out[self.before, 0, self.column], out[self.turn, 0, self.column]
        self.a[first] = run.here[0, self.body[first]]
        self.kept = self.b == run.t_end[self.body] if self.marked else np.zeros(len(self.b), bool)

    def __len__(self) -> int:
        return len(self.turn)

    @property
    def begins(self) -> np.ndarray:
        """Which steps are the first ones of their bodies?"""
        return np.append(True, self.column[1:] != self.column[:-1])[: len(self)]

    @property
    def ends(self) -> np.ndarray:
        """Which steps are the last ones of their bodies?"""
        return np.append(self.column[1:] != self.column[:-1], True)[: len(self)]

    def rows(self, some: Any, before: bool = False) -> np.ndarray:
        """The rows where some steps end, or begin."""
        return self.out[(self.before if before else self.turn)[some], :, self.column[some]]

    def keep(self, some: np.ndarray) -> None:
        """Leave out all other steps."""
        for name in ("column", "turn", "body", "before", "number", "a", "b", "kept"):
            setattr(self, name, getattr(self, name)[some])


class Samples:
    """Rows of time, state and, of runs in fictive time, fictive time: of every body its own number."""

    def __init__(self, width: int, heads: np.ndarray) -> None:
        self.rows = np.empty((8, heads.shape[1], width))
        self.rows[0] = heads.T
        self.counts = np.ones(heads.shape[1], dtype=np.intp)

    def add(self, body: np.ndarray, rows: np.ndarray) -> None:
        """Some more samples, body after body."""
        if not len(body):
            return
        first = np.flatnonzero(np.append(True, body[1:] != body[:-1]))
        many = np.diff(np.append(first, len(body)))
        place = self.counts[body] + np.arange(len(body)) - np.repeat(first, many)
        self.counts[body[first]] += many
        if self.counts.max() > len(self.rows):
            more = np.empty((int(1.5 * self.counts.max()), *self.rows.shape[1:]))
            more[: len(self.rows)] = self.rows
            self.rows = more
        self.rows[place, body] = rows


class Every:
    """Samples after every n-th step, counted from the start of the motion, and at the end."""

    def __init__(self, run: Any, every: int) -> None:
        self.run, self.every = run, every
        self.samples = Samples(len(run.here), run.here)

    def see(self, piece: Piece) -> None:
        """Keep samples."""
        number, last = piece.number, self.run.limit[piece.body]
        some = (number % self.every == 0) | (number == last) | piece.kept
        self.samples.add(piece.body[some], piece.rows(some)[:, self.run.head])

    def forget(self) -> None:
        """Forget samples beyond the place where the run stands."""
        _forget(self.run, self.samples)

    @property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """The samples, (n, bodies, width), and how many each body has."""
        return self.samples.rows[: self.samples.counts.max(initial=0)], self.samples.counts

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and numbers of the samples of one body so far, which are not kept any longer."""
        rows = self.samples.rows[: self.samples.counts[0], 0].copy()
        self.samples.counts[:] = 0
        return rows[:, 0], rows[:, 1:]


class Straight:
    """Samples of bodies that make the same steps, which native code writes where they stay.

    numbers : (n,) the steps that were taken before each, from the start of the motion on.  array : (n,
    width, columns) of states; of a run that keeps functions of them a part.
    """

    def __init__(self, run: Any, numbers: np.ndarray, array: np.ndarray) -> None:
        self.run, self.numbers, self.array = run, numbers, array
        self.first = 0  # of the samples that are there
        self.given = 0  # how many were handed on

    def samples_after(self, step: Any) -> Any:
        """How many samples there are after so many steps."""
        return np.searchsorted(self.numbers, step, "right")

    def ahead(self, step: int, sweep: int) -> tuple[int, int]:
        """The next samples that are so many steps away, and how many steps lead to each; or a part of
        the way to the next one.
        """
        k = int(self.samples_after(step))
        if k - self.first == len(self.array):  # those that are full were handed on
            self.first = k
        pending = int(self.numbers[k]) - step
        if pending > sweep:
            return 1, sweep
        left = self.numbers[k : k + min(sweep // pending, len(self.array) - (k - self.first))]
        same = left == step + pending * np.arange(1, len(left) + 1)
        return len(left) if same.all() else int(np.argmin(same)), pending

    def target(self, step: int, turns: int, every: int) -> np.ndarray:
        """Where these samples are written."""
        k = int(self.samples_after(step)) - self.first
        if self.numbers[k + self.first] == step + every:
            return self.array[k : k + turns]
        return np.empty((1, *self.array.shape[1:]))

    @property
    def full(self) -> bool:
        """Is there no place for the next sample?"""
        return bool(self.samples_after(self.run.reached) - self.first == len(self.array) < len(self.numbers))

    def forget(self) -> None:
        """Nothing is to be forgotten: what was not reached is not counted."""


def _forget(run: Any, samples: Samples) -> None:
    """Forget samples beyond the places where the bodies stand."""
    mark = -1 if run.lanes.mark else 0
    for i in range(run.count):
        n = samples.counts[i]
        beyond = run.sign[i] * (samples.rows[:n, i, mark] - run.here[mark, i]) > 0.0
        samples.counts[i] = n - int(beyond.sum())


class At:
    """States at given times.

    asked : (n, bodies) the times.  shown : those that samples have, if others.
    rows : of samples, as in `Samples`.  counts : how many each has.
    """

    def __init__(self, run: Any, asked: np.ndarray, shown: np.ndarray | None = None) -> None:
        self.run, self.asked, self.shown = run, asked, asked if shown is None else shown
        self.samples = np.empty((*asked.shape, len(run.here)))
        at_start = asked == run.here[0]
        self.counts = np.logical_and.accumulate(at_start, axis=0).sum(axis=0)  # the first ones
        self.samples[:] = np.where(at_start[..., None], run.here.T, 0.0)
        self.samples[..., 0] = self.shown
        self.given = 0  # how many of them were handed on
        # samples inside of steps, of which the states are still to be found
        self.within: list[Any] = []
        self.waiting = 0

    def see(self, piece: Piece) -> None:
        """Keep the states that are asked for in these steps."""
        if not len(piece):
            return
        reached = self.passed(piece.body, piece.b)
        before = np.concatenate([[0], reached[:-1]])
        begins = piece.begins
        before[begins] = self.counts[piece.body[begins]]
        many = np.maximum(reached - before, 0)
        total = int(many.sum())
        if not total:
            return
        step = np.repeat(np.arange(len(piece)), many)
        place = np.arange(total) - np.repeat(many.cumsum() - many, many)
        sample, body = before[step] + place, piece.body[step]
        times, rows = self.asked[sample, body], piece.rows(step)[:, self.run.head]
        inside = np.flatnonzero(times != piece.b[step])
        rows[:, 0] = self.shown[sample, body]
        self.samples[sample, body] = rows
        if len(inside):
            given = self.run.given(piece, step[inside], times[inside])
            self.within.append((given, times[inside], sample[inside], body[inside]))
            self.waiting += len(inside)
        ends = piece.ends
        np.maximum.at(self.counts, piece.body[ends], reached[ends])
        if self.waiting > ROWS:
            self.move()

    def passed(self, body: np.ndarray, t: np.ndarray) -> np.ndarray:
        """How many of the times lie before these?"""
        sign, asked = self.run.sign[body], self.asked
        if not len(asked):
            return np.zeros(len(t), dtype=np.intp)
        if asked.strides[1] == 0 or asked.shape[1] == 1:  # all are asked for at the same
            return np.searchsorted(sign[0] * asked[:, 0], sign * t, "right")
        low, high = np.zeros(len(t), dtype=np.intp), np.full(len(t), len(asked))
        for _ in range(len(asked).bit_length()):  # bisection, of all bodies at once
            middle = (low + high) // 2
            there = (low < high) & (sign * asked[middle % len(asked), body] <= sign * t)
            low, high = np.where(there, middle + 1, low), np.where(there, high, middle)
        return low

    def move(self) -> None:
        """Find the states inside of steps that were asked for."""
        if self.within:
            given, times, sample, body = map(np.concatenate, zip(*self.within, strict=True))
            try:
                self.samples[sample, body, 1:] = self.run.moved(given, times, body)
            except IntegrationFailure as error:
                k = getattr(error, "row", 0)
                self.counts[body[k]], self.within = sample[k], []
                raise
            self.within, self.waiting = [], 0

    def forget(self) -> None:
        """Forget samples beyond the place where the run stands."""
        bodies = np.arange(self.run.count)
        np.minimum(self.counts, self.passed(bodies, self.run.here[0]), out=self.counts)

    @property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """The samples, (n, bodies, width), and how many each body has."""
        if not self.run.rows:  # there are none but at the start and where the bodies stand
            at_end = (self.asked == self.run.here[0]) & ~self.run.open
            self.samples[:] = np.where(at_end[..., None], self.run.here.T, self.samples)
            np.maximum(
                self.counts,
                np.where(at_end, np.arange(1, len(at_end) + 1)[:, None], 0).max(axis=0, initial=0),
                out=self.counts,
            )
        self.move()
        return self.samples, self.counts

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and numbers of the samples of one body so far, once each."""
        self.move()
        begin, self.given = self.given, int(self.counts[0])
        rows = self.samples[begin : self.given, 0].copy()
        return rows[:, 0], rows[:, 1:]


class Dense:
    """Whole rows of all steps of one body, for the motion between them."""

    def __init__(self, run: Any) -> None:
        self.run, self.filled = run, 1
        self.array = np.zeros((64, run.lanes.row.width))
        self.array[0, run.head] = run.here[:, 0]

    def add(self, rows: np.ndarray) -> None:
        """Some more rows."""
        wanted = self.filled + len(rows)
        if wanted > len(self.array):
            size = max(len(self.array) + len(self.array) // 2, wanted)
            self.array.resize((size, self.array.shape[1]), refcheck=False)
        self.array[self.filled : wanted] = rows
        self.filled = wanted

    def see(self, piece: Piece) -> None:
        """Keep rows."""
        self.add(piece.out[piece.turn, :, 0])

    def forget(self) -> None:
        """Forget rows beyond the place where the run stands."""
        mark, run = self.run.lanes.mark, self.run
        place = run.here[-1 if mark else 0, 0]
        beyond = run.sign[0] * (self.array[: self.filled, mark] - place) > 0.0
        self.filled -= int(beyond.sum())

    @property
    def rows(self) -> np.ndarray:
        """All of them so far."""
        return self.array[: self.filled]


class DenseOfBodies(Every):
    """Whole rows of all steps of many bodies, for the motion between them."""

    def __init__(self, run: Any) -> None:
        self.run, heads = run, np.zeros((run.lanes.row.width, run.count))
        heads[run.head] = run.here
        self.samples = Samples(len(heads), heads)

    def see(self, piece: Piece) -> None:
        """Keep rows."""
        self.samples.add(piece.body, piece.rows(slice(None)))

    def of(self, i: int) -> np.ndarray:
        """The rows of a body so far."""
        rows, counts = self.rows
        return rows[: counts[i], i].copy()


class Quantities:
    """Functions of the samples that the first observer of a run has, kept instead of these: as the run
    goes, of what it hands on, or at its end.

    kept : times, and the values by name, of some samples after others.
    until : the number of the first sample at which a function failed, at the end of a run.
    """

    def __init__(self, run: Any, recorder: Any) -> None:
        self.run, self.recorder, self.kept = run, recorder, []  # type: Any, Any, list[Any]
        self.until: int | None = None

    def _values(self, t: np.ndarray, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The values of the functions at some samples.  An error of one has, as `kept`, how many samples
        come before the one at which it failed, and the values there.
        """
        run = self.run
        about = SimpleNamespace(system=run.known(None).get("system", run.plan.system), bodies=run.bodies)
        found: dict[str, np.ndarray] = self.recorder.values(about, run.view.kind, t, states, run.asked_for)
        return found

    def flush(self) -> None:
        """Keep what is asked for of the samples so far, which are needed no longer."""
        if not self.run.streams:
            return
        t, numbers = self.run.flush()
        if not len(t) and self.kept:
            return
        try:
            kept = self._values(t, self.run.view.arrays(numbers))
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            if hasattr(error, "kept"):
                n, kept = error.kept
                self.kept.append((t[:n], kept))
            raise
        self.kept.append((t, kept))

    def of_body(self, i: int, samples: Any) -> dict[str, Any]:
        """Those fields of the run of one body beside others, as far as it came; the states themselves
        where a function fails.  samples : makes these.
        """
        if self.kept:
            n = max(1, int(self.run.observers[0].samples_after(self.run.clocks[TAKEN, i])))
            t = np.concatenate([t for t, _ in self.kept])[:n]
            kept = {name: [one[name] for _, one in self.kept] for name in self.recorder.names}
            states = {name: np.concatenate(x)[:n, i] for name, x in kept.items()}
            return {"t": t if t.ndim == 1 else t[:, i], "states": states}
        found: dict[str, Any] = samples()
        system = self.run.known(i).get("system", self.run.of(i)[0])
        about = SimpleNamespace(system=system, bodies=None)
        given = about, self.run.view.kind, found["t"], found["states"], self.run.asked_for
        try:
            return found | {"states": self.recorder.values(*given)}
        except Exception:
            return found

    def fields(self, samples: Any) -> dict[str, Any]:
        """The fields of a trajectory that are samples.  samples : makes those of the states."""
        if self.kept:
            some = [one for one in self.kept if len(one[0])] or self.kept[:1]
            names = self.recorder.names
            states = {name: np.concatenate([kept[name] for _, kept in some]) for name in names}
            return {"t": np.concatenate([t for t, _ in some]), "states": states}
        found: dict[str, Any] = samples()
        if self.until is not None:
            states = {name: x[: self.until] for name, x in found.pop("states").items()}
            found = {name: x if x is None else x[: self.until] for name, x in found.items()}
            found["states"] = states
        try:
            return found | {"states": self._values(found["t"], found["states"])}
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            self.until = error.kept[0] if hasattr(error, "kept") else 0
            raise
