"""Observers of a run: each keeps something of its steps.

An observer has `see(piece)`, which looks at some more steps, and `forget()`, after Ctrl-C, what it has
seen beyond the place where the run stands.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, IntegrationInterrupted
from ..formulas.sites import room
from .compiled.control import TAKEN

ROWS = 2**17
"""Samples inside of steps whose states are found at once."""


class PieceOfBodies:
    """The steps of one piece of a run, listed body after body.

    out : (turns + 1, width, bodies) rows, of which the first is where the bodies were.
    mark : the number of a row that changes with every step.  marks, taken : of each body that of its last step before
    the piece, and how many steps it had made.
    body, column, turn : of each step its body, the column of this body in `out`, and the row where it ended.
    before : the row where it began.  number : its number in the motion of the body.  a, b : the times where it
    began and ended.  kept : is its row a sample, whatever its number?

    Of two bodies and three turns, in which the first one had its second trial rejected: body (0, 0, 1, 1, 1),
    turn (1, 3, 1, 2, 3), before (0, 1, 0, 1, 2).
    """

    def __init__(
        self, run: Any, bodies: np.ndarray, out: np.ndarray, marks: np.ndarray, taken: np.ndarray, mark: int = 0
    ) -> None:
        self.out, self.marked = out, mark
        place, sign = out[:, self.marked, : len(bodies)].copy(), run.sign[bodies]
        place[0] = marks[: len(bodies)]
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

    @classmethod
    def of_step(cls, body: int, before: np.ndarray, after: np.ndarray, number: int, kept: bool) -> PieceOfBodies:
        """One step of one body, which may have no length, from the rows where it begins and ends."""
        piece = object.__new__(cls)
        piece.out, piece.marked = np.stack([before, after])[:, :, None], 0
        piece.column = piece.before = np.zeros(1, int)
        piece.turn, piece.body, piece.number = np.ones(1, int), np.array([body]), np.array([number])
        piece.a, piece.b, piece.kept = before[:1].copy(), after[:1].copy(), np.array([kept])
        return piece

    def __len__(self) -> int:
        return len(self.turn)

    @property
    def begins(self) -> np.ndarray:
        """Mask of the steps, (n,): those that are the first ones of their bodies."""
        return np.append(True, self.column[1:] != self.column[:-1])[: len(self)]

    @property
    def ends(self) -> np.ndarray:
        """Mask of the steps, (n,): those that are the last ones of their bodies."""
        return np.append(self.column[1:] != self.column[:-1], True)[: len(self)]

    def rows(self, steps: Any, before: bool = False) -> np.ndarray:
        """Rows, (n, width), at the ends of these steps, or where they begin."""
        return self.out[(self.before if before else self.turn)[steps], :, self.column[steps]]

    def keep(self, steps: np.ndarray) -> None:
        """Drop from every list the steps that this mask leaves out."""
        for name in ("column", "turn", "body", "before", "number", "a", "b", "kept"):
            setattr(self, name, getattr(self, name)[steps])


def with_room(rows: np.ndarray, count: int) -> np.ndarray:
    """Rows that have room for so many: themselves, or a copy with half as many more."""
    if count > len(rows):
        rows, short = room(int(1.5 * count), *rows.shape[1:]), rows
        rows[: len(short)] = short
    return rows


class SampleTable:
    """Rows of time, state and, of runs in fictive time, fictive time; each body has a count of its own."""

    def __init__(self, width: int, heads: np.ndarray) -> None:
        self.rows = np.empty((8, heads.shape[1], width))
        self.rows[0] = heads.T
        self.counts = np.ones(heads.shape[1], dtype=np.intp)

    def add(self, body: np.ndarray, rows: np.ndarray) -> None:
        """Append rows, sorted by body, each behind the samples that its body has."""
        if not len(body):
            return
        first = np.flatnonzero(np.append(True, body[1:] != body[:-1]))
        counts = np.diff(np.append(first, len(body)))
        place = self.counts[body] + np.arange(len(body)) - np.repeat(first, counts)
        self.counts[body[first]] += counts
        self.rows = with_room(self.rows, int(self.counts.max()))
        self.rows[place, body] = rows


class Every:
    """Observer of every n-th step, counted from the start of the motion, and of the end."""

    def __init__(self, run: Any, every: int) -> None:
        self.run, self.every = run, every
        self.samples = SampleTable(len(run.here), run.here)

    def see(self, piece: PieceOfBodies) -> None:
        """Keep the row of every n-th step, of a last step, and of a step marked as kept."""
        number, last = piece.number, self.run.limit[piece.body]
        keeps = (number % self.every == 0) | (number == last) | piece.kept
        self.samples.add(piece.body[keeps], piece.rows(keeps)[:, self.run.head])

    def forget(self) -> None:
        """Forget samples beyond the place where each body stands."""
        run, samples = self.run, self.samples
        mark = -1 if run.lanes.mark else 0
        for i in range(run.count):
            n = samples.counts[i]
            beyond = run.sign[i] * (samples.rows[:n, i, mark] - run.here[mark, i]) > 0.0
            samples.counts[i] = n - int(beyond.sum())

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
        """The number of samples up to this step, the first one included."""
        return np.searchsorted(self.numbers, step, "right")

    def ahead(self, step: int, sweep: int) -> tuple[int, int]:
        """The number of next samples that are equally far apart, and the steps to each; or a part of the way to the
        next one.
        """
        k = int(self.samples_after(step))
        if k - self.first == len(self.array):  # those that are full were handed on
            self.first = k
        pending = int(self.numbers[k]) - step
        if pending > sweep:
            return 1, sweep
        numbers = self.numbers[k : k + min(sweep // pending, len(self.array) - (k - self.first))]
        in_step = numbers == step + pending * np.arange(1, len(numbers) + 1)
        return len(numbers) if in_step.all() else int(np.argmin(in_step)), pending

    def target(self, step: int, turns: int, every: int) -> np.ndarray:
        """The rows of `array` where the next samples are written; a scratch row if no sample is due."""
        k = int(self.samples_after(step)) - self.first
        if self.numbers[k + self.first] == step + every:
            return self.array[k : k + turns]
        return np.empty((1, *self.array.shape[1:]))

    @property
    def full(self) -> bool:
        """Whether the next sample has no row left in `array`."""
        return bool(self.samples_after(self.run.reached) - self.first == len(self.array) < len(self.numbers))

    def forget(self) -> None:
        """Nothing to remove: `samples_after` counts only what was reached."""


class AtTimes:
    """Observer of the states at given times.

    asked : (n, bodies) the times.  shown : those that samples have, if others.
    rows : of samples, as in `SampleTable`.  counts : how many each has.
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

    def see(self, piece: PieceOfBodies) -> None:
        """Keep samples at the times asked for within these steps; states inside of steps wait for `move`."""
        if not len(piece):
            return
        reached = self.passed(piece.body, piece.b)
        before = np.concatenate([[0], reached[:-1]])
        begins = piece.begins
        before[begins] = self.counts[piece.body[begins]]
        counts = np.maximum(reached - before, 0)
        total = int(counts.sum())
        if not total:
            return
        step = np.repeat(np.arange(len(piece)), counts)
        place = np.arange(total) - np.repeat(counts.cumsum() - counts, counts)
        sample, body = before[step] + place, piece.body[step]
        times, rows = self.asked[sample, body], piece.rows(step)[:, self.run.head]
        inside = np.flatnonzero(times != piece.b[step])
        rows[:, 0] = self.shown[sample, body]
        self.samples[sample, body] = rows
        if len(inside):
            inputs = self.run.inputs(piece, step[inside], times[inside])
            self.within.append((inputs, times[inside], sample[inside], body[inside]))
            self.waiting += len(inside)
        ends = piece.ends
        np.maximum.at(self.counts, piece.body[ends], reached[ends])
        if self.waiting > ROWS:
            self.move()

    def passed(self, body: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The number of times asked for up to t, for each pair of body and t, (n,)."""
        sign, times = self.run.sign[body], self.asked
        if not len(times):
            return np.zeros(len(t), dtype=np.intp)
        if times.strides[1] == 0 or times.shape[1] == 1:  # all are asked for at the same
            return np.searchsorted(sign[0] * times[:, 0], sign * t, "right")
        low, high = np.zeros(len(t), dtype=np.intp), np.full(len(t), len(times))
        for _ in range(len(times).bit_length()):  # bisection, of all bodies at once
            middle = (low + high) // 2
            below = (low < high) & (sign * times[middle % len(times), body] <= sign * t)
            low, high = np.where(below, middle + 1, low), np.where(below, high, middle)
        return low

    def move(self) -> None:
        """Compute the waiting states inside of steps, all at once."""
        if self.within:
            inputs, times, sample, body = map(np.concatenate, zip(*self.within, strict=True))
            try:
                self.samples[sample, body, 1:] = self.run.moved(inputs, times, body)
            except IntegrationFailure as error:
                k = getattr(error, "row", 0)
                self.counts[body[k]], self.within = sample[k], []
                raise
            self.within, self.waiting = [], 0

    def forget(self) -> None:
        """Forget samples beyond the place where each body stands."""
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


class Dense(Every):
    """Whole rows of all steps, for the motion between them."""

    def __init__(self, run: Any) -> None:
        self.run, heads = run, np.zeros((run.lanes.row.width, run.count))
        heads[run.head] = run.here
        self.samples = SampleTable(len(heads), heads)

    def see(self, piece: PieceOfBodies) -> None:
        self.samples.add(piece.body, piece.rows(slice(None)))

    def rows_of(self, i: int) -> np.ndarray:
        """Rows of body i so far, a copy."""
        rows, counts = self.rows
        return rows[: counts[i], i].copy()


class Quantities:
    """Functions of the samples of the first observer, kept in their place: computed as samples are handed on, or at the
    end.

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
        return self.recorder.values(about, run.view.kind, t, states, run.compiled_asked)

    def flush(self) -> None:
        """Compute the functions of the samples so far and drop these, if the run streams its samples."""
        if not self.run.streams:
            return
        t, numbers = self.run.flush()
        if not len(t) and self.kept:
            return
        try:
            values = self._values(t, self.run.view.arrays(numbers))
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            if hasattr(error, "kept"):
                n, values = error.kept
                self.kept.append((t[:n], values))
            raise
        self.kept.append((t, values))

    def of_body(self, i: int, samples: Any) -> dict[str, Any]:
        """The fields t and states of one body of an ensemble, with the functions as states; the states themselves
        where a function fails. samples : makes these.
        """
        if self.kept:
            n = max(1, int(self.run.observers[0].samples_after(self.run.clocks[TAKEN, i])))
            t = np.concatenate([t for t, _ in self.kept])[:n]
            columns = {name: [values[name] for _, values in self.kept] for name in self.recorder.names}
            states = {name: np.concatenate(x)[:n, i] for name, x in columns.items()}
            return {"t": t if t.ndim == 1 else t[:, i], "states": states}
        fields: dict[str, Any] = samples()
        system = self.run.known(i).get("system", self.run.system_and_method(i)[0])
        about = SimpleNamespace(system=system, bodies=None)
        arguments = about, self.run.view.kind, fields["t"], fields["states"], self.run.compiled_asked
        try:
            return fields | {"states": self.recorder.values(*arguments)}
        except Exception:
            return fields

    def fields(self, samples: Any) -> dict[str, Any]:
        """The fields of a trajectory that are samples.  samples : makes those of the states."""
        if self.kept:
            filled = [pair for pair in self.kept if len(pair[0])] or self.kept[:1]
            names = self.recorder.names
            states = {name: np.concatenate([values[name] for _, values in filled]) for name in names}
            return {"t": np.concatenate([t for t, _ in filled]), "states": states}
        fields: dict[str, Any] = samples()
        if self.until is not None:
            states = {name: x[: self.until] for name, x in fields.pop("states").items()}
            fields = {name: x if x is None else x[: self.until] for name, x in fields.items()}
            fields["states"] = states
        try:
            return fields | {"states": self._values(fields["t"], fields["states"])}
        except (Exception, IntegrationInterrupted) as caught:
            error: Any = caught
            self.until = error.kept[0] if hasattr(error, "kept") else 0
            raise
