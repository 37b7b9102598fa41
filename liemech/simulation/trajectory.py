"""`Trajectory`: the samples of a run, and quantities computed from them when asked for."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import Record
from ..formulas.classes.frozen import frozen
from ..formulas.classes.records import fields_of
from ..integrators.ending_at_jumps import ending_at_jumps, jumps_between
from ..systems.lie_poisson import with_sites
from ..systems.many.site_state import StateOfSites
from ..systems.system import State, System, small_state
from .between.dense import DenseOutput, DenseOutputs, ShortSteps, flat
from .compiled.systems import OfBodies, Systems, of_body
from .reports.drift import RECORDED, Drift
from .reports.written_tables import html_table
from .runs.carry import SiteCarry
from .stopped import NONE, Stop

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from scipy.spatial.transform import Rotation

    from ..integrators.method import Method
    from ..rooms.files.sources import Sources
    from ..viewer import Scene


@frozen(eq=False, repr=False)
class Trajectory:
    """Samples of a motion, and the quantities that should stay constant along it.

    t : (n,) times in s.  states : the recorded parts of the state by name, (n, ...) each; also as
    attributes, such as
    mu : (n, dim) body momentum and g : (n, k, k) group elements, None if they were not recorded.
    In an ensemble of m bodies mu is (n, m, dim) and g is (n, m, k, k); if they have steps of their
    own h is (m,) and t is (n, m).  Of adaptive steps h is the mean; `at(t)` gives the state at any
    time; rejected : the steps that were tried in vain;
    events : for every event function the times, and the states then; ended : the number of the
    terminal one that ended the run; of an ensemble those of its bodies, (m,), None for the others.
    carry : what the method carries along at the end, with which `Plan.resume` goes on.
    observed : names in `states` that are no parts of the state but functions of it, which `record`
    asked for.  breaks : times at which fixed steps had to end.  written : of a run from a file the
    versions of liemech, Python and NumPy, the platform and the date.
    stopped : for an ensemble, the bodies that did not reach the end, each with the `steps` it took
    and the `error` that ended it.  It stays there, at its own time where t is (n, m).
    """

    system: System
    method: Method
    h: Any
    t: np.ndarray
    states: dict[str, np.ndarray]
    bodies: int | None
    steps: int
    compiled: bool = False
    stopped: Mapping[int, Stop] = field(default_factory=lambda: NONE)
    rejected: int | None = None
    dense: DenseOutput | DenseOutputs | None = None
    events: tuple[tuple[np.ndarray, State], ...] = ()
    carry: Any = field(default_factory=lambda: None)
    observed: tuple[str, ...] = ()
    breaks: tuple[float, ...] = ()
    ended: int | tuple[int | None, ...] | None = None
    written: Any = None

    @classmethod
    def promised(cls, rest: Any, **known: Any) -> Trajectory:
        """A trajectory whose other fields, among `PROMISED`, are made when they are first asked
        for, by the functions of this name that `rest` has.
        """
        known["_rest"] = rest
        if "dense" not in known and not hasattr(rest, "dense"):
            known["dense"] = None
        return cls._of(known)

    @classmethod
    def _of(cls, fields: dict[str, Any]) -> Trajectory:
        """A trajectory with these fields."""
        run = object.__new__(cls)
        object.__setattr__(run, "__dict__", fields)
        return run

    def __len__(self) -> int:
        return len(self.t)

    def __getstate__(self) -> dict[str, Any]:
        """The fields of the run for pickling; promised ones are computed first."""
        for name in PROMISED:
            getattr(self, name)
        return {name: x for name, x in vars(self).items() if name != "_rest"}

    def __eq__(self, other: Any) -> bool:
        """Whether both runs are of equal systems and methods, with the same samples and events to the bit."""
        if type(self) is not type(other):
            return NotImplemented
        fields, other_fields = self._compared, other._compared
        return fields.keys() == other_fields.keys() and all(_same(x, other_fields[n]) for n, x in fields.items())

    def __hash__(self) -> int:
        return hash((type(self), self.steps, self.bodies))

    @property
    def _compared(self) -> dict[str, Any]:
        """The fields that equal runs have equal."""
        fields = {"system": self.system, "method": self.method, "h": self.h, "t": self.t}
        events = [[times, state.arrays] for times, state in self._met]
        return fields | {"states": self.states, "steps": self.steps, "events": events}

    @property
    def _met(self) -> list[Any]:
        """Times and states of every event, in an ensemble of every body."""
        if self.bodies is None:
            return [*self.events]
        return [met for event in self.events for met in event]

    def __getattr__(self, name: str) -> Any:
        """A part of the state that belongs to this kind of system."""
        fields = vars(self)
        states = self.states if "_rest" in fields else fields.get("states", {})
        if name in states:
            return self._by_site(name, states[name])
        attribute = inspect.getattr_static(type(self), name, None)
        # it is here since a formula has raised an AttributeError, which Python does not show
        if isinstance(attribute, (property, cached_property)):
            formula: Any = attribute.fget if isinstance(attribute, property) else attribute.func
            try:
                return formula(self)
            except AttributeError as error:
                raise RuntimeError(f"Trajectory.{name} could not be made: {error}") from error
        raise AttributeError(f"a Trajectory has no {name!r}; this one recorded {', '.join(states)}")

    @property
    def g(self) -> np.ndarray | None:
        """The group elements, (n, k, k); None if they were not recorded."""
        g = self.states.get("g")
        return None if g is None else self._by_site("g", g)

    def _by_site(self, name: str, array: np.ndarray) -> np.ndarray:
        """A part of the state with an axis of sites, if there are such."""
        if name in self.observed:
            return array
        return part_with_sites(self.system, name, array, 2 + (self.bodies is not None))

    @property
    def _laws(self) -> Any:
        """The system of a body, whose formulas take all samples at once."""
        return self.system

    @cached_property
    def energy(self) -> np.ndarray:
        """The energy at every sample, in J.  (n,)"""
        return self._quantity("energy", "has no energy")

    @cached_property
    def casimirs(self) -> np.ndarray:
        """The Casimir functions at every sample; |mu|^2 on SO(3).  (n, number of Casimirs)"""
        return self._quantity(
            "casimirs",
            "has no Casimir functions, of which free bodies and Poisson systems know. "
            "`run.drift()` names what it keeps",
        )

    @cached_property
    def multipliers(self) -> np.ndarray:
        """The multipliers of the constraints at every sample: forces of constraint.  (n, number of constraints)"""
        return self._quantity("multipliers", "has no constraints")

    def joint(self, name: str | int) -> Any:
        """A joint of a linkage, by its name or number, along the run: its `angle`, `rate`, `torque`,
        `reaction`, `moment`, `power` and `work`.
        """
        return self._of_linkage("joint", "motion_at", name)

    def link(self, name: str | int) -> Any:
        """A body of a linkage, by its name or number, along the run: its `pose` and `velocity`, the
        `load` on it, with `power` and `work`.
        """
        return self._of_linkage("link", "link_at", name)

    def _of_linkage(self, noun: str, method: str, name: str | int) -> Any:
        """A joint or a link of a linkage along the run, by a method of the system."""
        motion = getattr(self._laws, method, None)
        if motion is None:
            raise InvalidInput(f"Trajectory.{noun}: {self.system!r} has no {noun}s")
        self._recorded(noun, ["mu", "g"])
        return motion(self, name)

    def _quantity(self, name: str, otherwise: str) -> np.ndarray:
        """A quantity of the system at every sample, computed from parts of the state or recorded."""
        if name in self.observed:
            return self.states[name]
        if name == "energy" and self._is_of_sites:
            return self._runs_by_sites.energy(self.system, self.t, self.states)
        formula = getattr(self._laws, name, None)
        if formula is None:
            raise InvalidInput(f"Trajectory.{name}: {self.system!r} {otherwise}")
        arguments = [*inspect.signature(formula).parameters]
        self._recorded(name, [part for part in arguments if part != "t"])
        inputs = {
            "t": self.t
            if self.bodies is None
            else np.broadcast_to(self.t if self.t.ndim == 2 else self.t[:, None], (len(self.t), self.bodies)),
            **self.states,
        }
        return formula(*(inputs[part] for part in arguments))

    def _recorded(self, what: str, needed: Iterable[str]) -> None:
        """Refuse what needs parts of the state that were not recorded."""
        missing = [part for part in needed if part not in self.states or part in self.observed]
        if missing:
            raise InvalidInput(
                f"Trajectory.{what} needs {', '.join(missing)}; this run recorded {', '.join(self.states)}"
            )

    @cached_property
    def xi(self) -> np.ndarray:
        """The velocities of a variational method: that of the interval after each sample, one step
        long, in 1/s.  (n, dim)

        Between the samples of a run that kept every step xi, and not J^-1 mu, is what carries g
        along: g_i+1 = g_i tau(h xi_i).
        """
        between = getattr(self.method, "velocity", None)
        if between is None:
            raise InvalidInput(
                "Trajectory.xi is for methods with a velocity on every interval, as "
                f"CovariantVariational; {self.method!r} has none. At the samples of a free body "
                "the velocity is `run.system.velocity(run.mu)`"
            )
        if self.bodies is not None:
            h = np.broadcast_to(self.h, self.bodies).tolist()
            each = [
                of_body(self.method, i).velocity(of_body(self.system, i), self.mu[:, i], h[i])
                for i in range(self.bodies)
            ]
            return np.stack(each, axis=1)
        return between(self.system, self.mu, self.h)

    @cached_property
    def spatial_momentum(self) -> np.ndarray:
        """The momentum seen from space, K_g mu, at every sample.  (n, dim)"""
        if "spatial_momentum" in self.observed:
            return self.states["spatial_momentum"]
        g = self._attitude("spatial_momentum")
        self._recorded("spatial_momentum", ["mu"])
        return self._laws.spatial_momentum(self.mu, g)

    @cached_property
    def rotation(self) -> Rotation:
        """The attitudes as SciPy rotations, body to space; on a product those of its one rotation."""
        from scipy.spatial.transform import Rotation

        from ..groups.composed.product import ProductGroup
        from ..groups.rigid.so3 import SO3
        from ..groups.rigid.unit_quaternions import UnitQuaternions

        g: Any = self._attitude("rotation")
        group: Any = getattr(self.system, "configurations", self.system.group)
        if isinstance(group, ProductGroup):
            turning = (SO3, UnitQuaternions)
            factors_that_turn = [k for k, f in enumerate(group.factors) if isinstance(f, turning)]
            if len(factors_that_turn) != 1:
                raise InvalidInput(
                    f"Trajectory.rotation is for one rotation of space, and {group!r} has "
                    f"{len(factors_that_turn) or 'none'}; take the factors apart, {type(group).__name__}.split(run.g)"
                )
            g, group = group.split(g)[factors_that_turn[0]], group.factors[factors_that_turn[0]]
        if isinstance(group, UnitQuaternions):
            return group.rotation(g)
        if group.element_shape != (3, 3) or not np.all(SO3().contains(g)):
            raise InvalidInput(f"Trajectory.rotation is for rotations of space, which elements of {group!r} are not")
        return Rotation.from_matrix(g)

    @property
    def last(self) -> State:
        """The last state, from which a run can be continued: that of the terminal event that ended
        it, or the last sample; of a run without samples where it stands.  In an ensemble every body
        has its own.  Of a method that leaves the constraints it is beside them, and no start.
        """
        events: Any = self.events
        if isinstance(self.ended, int):
            arrays = events[self.ended][1].arrays
            return self._laws._reached(**{name: array[-1] for name, array in arrays.items()})
        zeros: list[Any] = [e if e is None else events[e][i][1].arrays for i, e in enumerate(self.ended or ())]
        if not zeros:
            return self._last_sample
        others = self._last_sample.arrays if None in zeros else zeros[0]
        parts = {
            name: np.stack([others[name][i] if at is None else at[name][-1] for i, at in enumerate(zeros)])
            for name in others
        }
        return self._laws._reached(**parts)

    @property
    def _last_sample(self) -> State:
        """The state of the last sample; of a run without samples the one where it stands."""
        if self.observed or not len(self):
            if self.carry is None:
                raise InvalidInput(
                    "Trajectory.last: this run kept "
                    f"{'functions of the state only' if self.observed else 'no samples'}, "
                    "and has not come to its end"
                )
            return with_sites(self.system, self.carry.state, int(self.bodies is not None))
        return self._laws._reached(**{name: array[-1] for name, array in self.states.items()})

    def at(self, t: Any) -> Any:
        """The state at any time of the run, or at many, (m,); between the steps too it is on the
        group.

        Between adaptive steps by the polynomial of the method, between fixed steps by a
        shorter step from the last sample.
        Of an ensemble all bodies at these times, (m, bodies, ...), those that an event has ended at their ends.
        """
        return with_sites(self.system, self._motion(t), np.ndim(t) + (self.bodies is not None))

    @property
    def _at_every_step(self) -> bool:
        """Whether samples are at the ends of all fixed steps, t0 + n h, none of which a jump or an end cuts."""
        if self.bodies is not None or self.rejected is not None or len(self.t) != self.steps + 1:
            return False
        rounding = 1e-6 * abs(self.h) + 2.0 * np.spacing(np.abs(self.t).max())
        cut = jumps_between(self.method, self.system, self.breaks, *self.t[[0, -1]].tolist())
        return not cut and bool((np.abs(np.diff(self.t) - self.h) <= rounding).all())

    @cached_property
    def _motion(self) -> Any:
        """The dense output of the run, or shorter steps of its method; InvalidInput without either."""
        if self.dense is not None:
            return self.dense
        if self.bodies is not None and self.rejected is None and getattr(self, "tau", None) is None:
            return DenseOutputs(tuple([self._alone(i)._motion for i in range(self.bodies)]))
        system: Any = self.system
        # where the state jumps there are more samples
        complete = self.bodies is None and not self.observed and len(self.t) > self.steps > 0
        example = system._reached(**{name: x[0] for name, x in self.states.items()}) if complete else None
        of_sites = isinstance(example, StateOfSites) and all(
            self.states[name].shape[1:] == x.shape for name, x in example.arrays.items()
        )
        if isinstance(self.carry, SiteCarry) or (self.carry is None and of_sites):
            if complete and self.rejected is None:
                return self._runs_by_sites.between(self, type(example))
            example = None
        if example is not None:
            example = system._written_out(example)  # as the run was
        far = abs(self.h) * (1.0 + 1e-6) + 2.0 * np.spacing(np.abs(self.t).max(initial=0.0))
        if example is None or self.rejected is not None or np.abs(np.diff(self.t)).max() > far:
            raise InvalidInput(
                "Trajectory.at needs a run that kept all its steps: adaptive ones do with dense=True, "
                "fixed ones with every=1"
            )
        method = ending_at_jumps(self.method, self.system, self.breaks)
        states = {name: self.states[name] for name in example.arrays}  # as in the state
        rows = np.column_stack([self.t, flat(states, len(self.t))])
        return ShortSteps(system, method, example, rows)

    def _alone(self, i: int) -> Trajectory:
        """The samples of body i of an ensemble with fixed steps, up to where it ended."""
        t = self.t if self.t.ndim == 1 else self.t[:, i]
        steps = int(np.flatnonzero(np.diff(t, prepend=t[0]))[-1:].sum())  # later rows are repeated
        if self.t.ndim == 1 and i in self.stopped:
            steps = self.stopped[i].steps
        states = {name: x[: steps + 1, i] for name, x in self.states.items()}
        of_this_body = of_body(self.system, i), of_body(self.method, i), self.h if np.ndim(self.h) == 0 else self.h[i]
        return Trajectory(
            *of_this_body, t[: steps + 1], states, None, steps, observed=self.observed, breaks=self.breaks
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the run to a file: NumPy's .npz, with what the arrays are in JSON, and a checksum;
        nothing is pickled.

        path : with the ending .h5 or .hdf5 an HDF5 file, which needs h5py; with .csv the samples alone, as
        comma-separated values, which `load` does not read.
        A file of this name is replaced when the new one lies on the disk, not before.
        Raises InvalidInput for another ending, and if a parameter of the system or the method is no number, vector,
        matrix, text or record.
        """
        from ..rooms.files.archive import save

        save(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str], modules: Sequence[str] = (), trusted: bool = False) -> Trajectory:
        """A run that was saved, with its system and its method, which `Plan.resume` goes on with.

        modules : names of modules to import for classes of your own, unless they are imported
        already.  trusted : import whatever modules the file names, which runs their code; only for
        files whose origin you know.
        Warns (FileWarning) where another version of liemech or Python, or another machine, has
        written it; `written` of the run has all that is told.
        Raises InvalidInput if the file is damaged or was not written by `save`, or if a class is
        not there.  Without `trusted` a file chooses among the records of the library and of your
        program; it names nothing that is called, and nothing of it is imported or evaluated.
        """
        from ..rooms.files.archive import load

        fields = load(path, modules, trusted)
        if "tangent" in fields:
            return TangentTrajectory(**fields)
        return TransformedTrajectory(**fields) if "origin" in fields else Trajectory(**fields)

    def to_xarray(self) -> Any:
        """The samples as an xarray.Dataset over t: mu is (t, mu_0), g (t, g_0, g_1), in an ensemble
        with `body` behind t.
        """
        from ..rooms.files.labelled import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> Any:
        """The samples as a pandas.DataFrame: a row for each time t, or each t and body; columns mu[0], g[0,1], ..."""
        from ..rooms.files.labelled import to_pandas

        return to_pandas(self)

    def then(self, rest: Trajectory) -> Trajectory:
        """This run and the one that `Plan.resume` made of it, as one: the samples of both, the one
        that they share once.  Where they meet is a sample, also between two multiples of `every`.

        Raises InvalidInput if the second begins at another time than this one's `carry` has.
        """
        refused = InvalidInput(f"Trajectory.then: {rest!r} does not begin where {self!r} was to go on")
        if type(self) is not type(rest) or self.carry is None or self.states.keys() != rest.states.keys():
            raise refused
        end, t, later = self._clock(self.carry), self._clock(), rest._clock()
        direction = self.h
        if self.rejected is not None and self.bodies is not None:  # every body its own
            direction = np.sign(end - t[0]) if len(t) else 0.0
        first = later[0] if len(later) else rest._clock(rest.carry)
        if np.any((first - end) * direction < 0.0):
            raise refused
        # kept by both; bodies that failed stand before it
        shared = int(len(t) > 0 and len(later) > 0 and bool(np.all(self._going(later[0] == t[-1]))))
        joined = _rows_of_both(self, rest, shared)
        return replace(
            rest,
            t=joined(self.t, rest.t),
            states={name: joined(x, rest.states[name]) for name, x in self.states.items()},
            steps=self.steps + rest.steps,
            rejected=None if rest.rejected is None else rest.rejected + (self.rejected or 0),
            events=tuple([_joined(*pair) for pair in zip(self.events, rest.events, strict=False)]),
            ended=self._ends(rest),
            **self._more(rest, joined),
        )

    def _going(self, of_bodies: Any) -> Any:
        """The values of bodies that have not failed, where there is one of each."""
        return np.delete(of_bodies, [*self.stopped]) if np.ndim(of_bodies) else of_bodies

    def _ends(self, rest: Trajectory) -> Any:
        """The events that ended the bodies of the joined run; with fixed steps none goes on that one has ended."""
        if not isinstance(self.ended, tuple) or self.rejected is not None:
            return rest.ended
        later = rest.ended if isinstance(rest.ended, tuple) else self.ended
        return tuple([first if last is None else last for first, last in zip(self.ended, later, strict=True)])

    def _clock(self, carry: Any = None) -> Any:
        """The times by which samples are ordered, or the time of a carry."""
        return self.t if carry is None else carry.t

    def _more(self, rest: Any, joined: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> dict[str, Any]:
        """The fields of the joined run beside its samples.  joined : what is there of each sample, of both runs."""
        if self.dense is None or rest.dense is None:
            return {"dense": None}
        return {"dense": self.dense.then(rest.dense)}

    def view(self, show: Any = None) -> Scene:
        """The run as a moving picture: `run.view().show()` opens it, notebooks show it.  show : as in viewer.Scene."""
        from ..viewer import Scene

        if isinstance(self.system, Systems):
            raise InvalidInput("Trajectory.view shows bodies of one system; run one of them by itself")
        return Scene(self, show)

    def plot(self, ax: Any = None) -> Axes:
        """The picture that tells most about the run, on Matplotlib axes: the given ones, or new
        ones.  More are in `lm.plots`.
        """
        from ..plots import plot

        return plot(self, ax=ax)

    def drift(self) -> Drift:
        """How well the constants of the motion were kept: bounded or drifting, and how fast.

        Of a run that recorded functions of the state instead, those among them that stay constant:
        energy, casimirs, ...
        """
        if self.observed or (len(self.t) > 1 and self._is_of_sites):
            return Drift.recorded(self._constants, self.t, self.bodies)
        return Drift.of(self.system, self.t, self._at_times, self.bodies)

    def cite(self) -> Sources:
        """The sources of the method, of the system and of what they are made of, as a paper cites them: as text, and for
        BibTeX as `run.cite().bibtex`.
        """
        from ..rooms.files.sources import sources_of

        return sources_of(self.method, self.system)

    @property
    def _at_times(self) -> dict[str, np.ndarray]:
        """The states, of a system with given motions with the times beside them."""
        if not getattr(self.system, "rheonomic", False):
            return self.states
        is_ensemble = self.bodies is not None and self.t.ndim == 1
        t = np.repeat(self.t[:, None], self.bodies or 1, axis=1) if is_ensemble else self.t
        return self.states | {"t": t}

    @property
    def _is_of_sites(self) -> bool:
        if self.bodies is not None or self.system.site_form is None:
            return False
        return self._runs_by_sites.of_samples(self.system, self.states) is not None

    @property
    def _runs_by_sites(self) -> Any:
        """The class that makes the runs of the sites, which knows totals of their samples, too."""
        site: Any = self.system.site_form
        return site.runs_by_sites

    @cached_property
    def _constants(self) -> dict[str, np.ndarray]:
        """The constants of the motion at every sample: those of `drift`, by name."""
        if self.observed:
            return {name: self.states[name] for name in self.observed if name in RECORDED}
        if self._is_of_sites:
            return self._runs_by_sites.constants(self.system, self.t, self.states)
        return self.system.constants(self._at_times)

    def _attitude(self, what: str) -> np.ndarray:
        if self.g is None:
            raise InvalidInput(f"Trajectory.{what} needs the attitude; start from a state with a g and record it")
        return self.g

    def __repr__(self) -> str:
        ensemble = "" if self.bodies is None else f"{self.bodies} bodies, "
        end = f"to t = {_range(self.t[-1])}" if len(self) else "none"
        steps = f"h = {_range(self.h)}" if self.rejected is None else f"{self.steps} steps, {self.rejected} rejected"
        return (
            f"Trajectory({self.method!r}: {ensemble}{len(self)} samples {end}, {steps}, "
            f"{'compiled' if self.compiled else 'plain'}; {', '.join(self.states)})"
        )

    def _repr_html_(self) -> str:
        arrays = {"t": self.t} | self.states
        rows = [(name, str(x.shape), _range(x) if x.size else "none") for name, x in arrays.items()]
        return html_table(repr(self), ("recorded", "shape", "values"), rows)


def require_savable(value: Any) -> None:
    """Raise InvalidInput for a system or a method that a file cannot hold."""
    from ..rooms.files.encoding import encoded

    encoded(value)


class _Promised:
    """A field of a run that is made when it is first asked for."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.__doc__ = None  # the class of the run says what it is

    def __get__(self, run: Any, owner: Any = None) -> Any:
        fields = {} if run is None else vars(run)
        promises = fields.get("_rest")
        if promises is None:  # or another thread has kept them all
            if self.name in fields:
                return fields[self.name]
            raise AttributeError(self.name)
        try:
            value = fields.setdefault(self.name, getattr(promises, self.name)())
        except AttributeError as error:  # which `__getattr__` would hide
            raise RuntimeError(f"Trajectory.{self.name} could not be made") from error
        if fields.keys() >= _PROMISED:
            fields.pop("_rest", None)
        return value


PROMISED = "t", "states", "carry", "dense"
_PROMISED = {*PROMISED}
for _name in PROMISED:  # not before: the class would take them for defaults
    setattr(Trajectory, _name, _Promised(_name))


@frozen(eq=False, repr=False)
class TransformedTrajectory(Trajectory):
    """Samples of a run in fictive time.

    t : physical times, (n,), whose distances differ; of an ensemble of m members (n, m).
    tau : (n,) fictive times.
    h : the step in fictive time.
    z : (n,) what a ReversibleController takes for 1/sigma; None for other methods.
    origin : where the motion began.
    """

    tau: np.ndarray = None  # type: ignore[assignment]
    z: np.ndarray | None = None
    origin: Any = None

    @property
    def sigma(self) -> Any:
        """The time scale, dt = sigma dtau, bound to the start of the motion."""
        if isinstance(self.origin, tuple):  # every body its own
            return [origin.whole.sigma for origin in self.origin]
        return self.origin.whole.sigma

    @cached_property
    def scale(self) -> np.ndarray:
        """sigma at every sample, (n,): physical time for a unit of fictive time."""
        if self.bodies is not None:
            raise InvalidInput("TransformedTrajectory.scale takes one body at a time")
        kind, needed = type(self.origin.start), self.sigma.parts
        self._recorded("scale", self.origin.start.arrays if needed is None else needed)
        return np.array(
            [
                self.sigma.value_at(
                    self.system, float(self.t[k]), small_state(kind, {n: x[k] for n, x in self.states.items()})
                )
                for k in range(len(self))
            ]
        )

    def drift(self) -> Drift:
        """How well the constants of the motion were kept; for an ensemble over fictive time, which
        its members share.
        """
        if self.observed:
            return super().drift()
        return Drift.of(self.system, self.t if self.bodies is None else self.tau, self.states, self.bodies)

    @property
    def _compared(self) -> dict[str, Any]:
        return super()._compared | {"tau": self.tau, "z": self.z}

    def _clock(self, carry: Any = None) -> Any:
        return self.tau if carry is None else carry.tau

    def _more(self, rest: Any, joined: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> dict[str, Any]:
        dense: Any = self.dense
        if dense is not None and rest.dense is not None and len(rest.dense.t) > 1:
            # what both share lies inside of a step: no place to step from
            inside = rest.dense.begun is not None
            first, end = int(inside or dense.t[-1] == rest.dense.t[0]), len(dense.t) - inside
            rows = np.concatenate([dense.rows[:end], rest.dense.rows[first:]])
            dense = replace(dense, rows=rows) if end else rest.dense
        return {
            "dense": dense,
            "tau": joined(self.tau, rest.tau),
            "z": None if self.z is None else joined(self.z, rest.z),
        }

    def __repr__(self) -> str:
        ensemble = "" if self.bodies is None else f"{self.bodies} bodies, "
        sigma = self.sigma[0] if isinstance(self.origin, tuple) else self.sigma
        end = f"to t = {np.ravel(self.t[-1])[0]:g}, " if len(self) and self.bodies is None else ""
        last = f"tau = {_range(self.tau[-1])}, " if len(self) else ""
        return (
            f"Trajectory({self.method!r}, {sigma!r}: {ensemble}{len(self)} samples {end}{last}h = "
            f"{_range(self.h)} in tau, {'compiled' if self.compiled else 'plain'}; "
            f"{', '.join(self.states)})"
        )


@frozen(eq=False, repr=False)
class TangentTrajectory(Trajectory):
    """Samples of a motion, and its derivative.

    tangent : by name, "start" or that of a parameter, (n, out, in) matrices: how the state at each
    sample depends on it.  Rows are the components of the recorded parts of the state in turn; of a
    group element g the components of eta in dg = g hat(eta).  So are the columns of "start"; those
    of a parameter are its components.  Of an ensemble of m bodies (n, m, out, in).
    tau : of a run in fictive time, (n,), the fictive times.  The derivative is that at the same
    fictive time, and the last row that of the physical time.
    time_tangents : of a run with events, by event and by name, (zeros, in): how the times in `events` depend on it; of
    an ensemble by event, by body and by name.
    """

    tangent: dict[str, np.ndarray] = None  # type: ignore[assignment]
    tau: np.ndarray | None = None
    time_tangents: tuple[Any, ...] = ()

    @property
    def _compared(self) -> dict[str, Any]:
        return super()._compared | {
            "tangent": self.tangent, "tau": self.tau, "time_tangents": self.time_tangents,
        }  # fmt: skip


def part_with_sites(system: Any, name: str, array: np.ndarray, flat: int = 2) -> Any:
    """A part of states with an axis of sites, if there are such.  flat : the number of its axes without one."""
    group = getattr(system, "configurations", system.group)
    return group._out_of_rows(array, "Element" if name == "g" else "Vec") if array.ndim == flat else array


def _rows_of_both(first: Any, rest: Any, shared: int) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """How arrays of samples of two runs are joined: those of bodies with times of their own body by body, and the last one
    of a body is repeated at the end alone.

    shared : is the first sample of the next run the last one of this?
    """
    if first._clock().ndim == rest._clock().ndim == 1:
        return lambda a, b: np.concatenate([a, b[shared:]])

    def each(x: np.ndarray) -> np.ndarray:
        return x if x.ndim > 1 else np.repeat(x[:, None], first.bodies, axis=1)

    def own(run: Any) -> Any:
        """How many samples each body has before it repeats the last one."""
        parts = [
            x.reshape(len(run), first.bodies, math.prod(x.shape[2:]))
            for x in (each(run._clock()), *run.states.values())
        ]
        repeated = np.logical_and.reduce([(x == x[-1:]).all(axis=2) for x in parts])
        return np.minimum(len(run) + 1 - np.logical_and.accumulate(repeated[::-1]).sum(axis=0), len(run))

    counts = own(first)
    total = counts + own(rest) - shared
    row = np.minimum(np.arange(total.max(initial=0))[:, None], total - 1)
    row += (row >= counts) * (len(first) + shared - counts)

    def joined(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        if a.ndim == b.ndim == 1 and (counts == len(first)).all() and (total == total[:1]).all():
            return np.concatenate([a, b[shared:]])  # times that are those of all bodies
        rows = np.concatenate([each(a), each(b)])
        return np.take_along_axis(rows, row.reshape(row.shape + (1,) * (rows.ndim - 2)), axis=0)

    return joined


def _same(x: Any, y: Any) -> bool:
    """Whether two parts of runs are equal, arrays to the bit."""
    if isinstance(x, np.ndarray) or isinstance(y, np.ndarray):
        of_one_kind = np.shape(x) == np.shape(y) and np.asarray(x).dtype == np.asarray(y).dtype
        return of_one_kind and np.asarray(x).tobytes() == np.asarray(y).tobytes()
    if isinstance(x, dict) and isinstance(y, dict):
        return x.keys() == y.keys() and all(_same(v, y[name]) for name, v in x.items())
    if isinstance(x, (list, tuple, OfBodies)) and type(x) is type(y):
        return len(x) == len(y) and all(_same(*pair) for pair in zip(x, y, strict=True))
    if isinstance(x, Record) and type(x) is type(y):  # whose fields may be arrays
        return _same(fields_of(x), fields_of(y))
    return bool(x == y or (x != x and y != y))  # nan is as nan


def _range(values: Any) -> str:
    """A number, or from which one to which."""
    low, high = np.min(values), np.max(values)
    return f"{low:g}" if low == high else f"{low:g} ... {high:g}"


def _joined(first: Any, second: Any) -> Any:
    """The times and states of an event in one run and in the next; of an ensemble those of each body."""
    if not isinstance(first[0], np.ndarray):
        return tuple([_joined(*pair) for pair in zip(first, second, strict=True)])
    parts = zip(first[1].parts.values(), second[1].parts.values(), strict=True)
    states = type(first[1])(*(None if a is None else np.concatenate([a, b]) for a, b in parts))
    return np.concatenate([first[0], second[0]]), states
