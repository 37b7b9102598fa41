"""Records as JSON, and back: numbers to the last bit, classes by their names.

A file can name classes of records and nothing else: those of the library, and those that the program
has defined or imported itself.  It names no functions, no module is searched for what it names, and
nothing of it is called: a record has the fields of the file, for which its class makes one too, with
the checks that a user meets.  Modules that a file names are imported if the user says that it is trusted.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import pkgutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, NoReturn

import numpy as np

from ...errors import FormulaWarning, InvalidInput, warn
from ...formulas import Record
from ...formulas.classes.fields import FrozenDict
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import build, gatherer, layout_of
from ...formulas.classes.of_each import Each
from ...formulas.classes.records import known, refilled
from ...formulas.large import Large
from ...formulas.numbers.complex_numbers import Complex
from ...formulas.sites import SiteArray, SiteTable
from ...formulas.tables import Table
from ...formulas.vectors import Mat, Vec
from ...groups.matrices.matrix_group import MatrixLieGroup
from ...names.places import class_of
from ...systems.in_time.tabulated import PiecewisePolynomial
from .fingerprints import changed, fingerprint

LIBRARY = __name__.partition(".")[0]
WITH_RECORDS = "groups", "integrators", "joints", "models", "rooms", "systems", "tableaus"
"""The packages of the library that have records."""
NUMBERS = "biufc"
"""Kinds of NumPy's types that are numbers."""
INLINE = 16
"""Longer arrays and tables are not written into the text."""
OF_TABLES = PiecewisePolynomial, SiteTable, SiteArray, Each
"""Classes of the library whose tables come from files: they compare them with their numbers."""
LARGEST = 10**6
"""Sizes that a file may ask for that holds fewer numbers: those of its systems would fill the memory."""


class Pool:
    """The numbers of arrays and tables beside the text, end to end, those of each type apart; what is
    put in twice is there once.
    """

    def __init__(self) -> None:
        self.parts: dict[str, list[np.ndarray]] = {}
        self.known: dict[int, tuple[Any, int]] = {}
        self.length: dict[str, int] = {}

    def put(self, owner: Any, array: np.ndarray) -> int:
        """Add the numbers of an array; returns their offset in the pool.  owner : the object that they are of, which
        is added once.
        """
        entry = self.known.get(id(owner))
        if entry is not None:
            return entry[1]
        name, begin = array.dtype.name, self.length.get(array.dtype.name, 0)
        self.parts.setdefault(name, []).append(np.ascontiguousarray(array).ravel())
        self.length[name] = begin + array.size
        self.known[id(owner)] = owner, begin
        return begin

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of the pool, one for each type, by name."""
        return {f"{POOL}{name}": np.concatenate(parts) for name, parts in self.parts.items()}


POOL = "pool."


def encoded_each(values: Sequence[Any], pool: Pool) -> Any:
    """Values, many of one kind: the first one as JSON, the numbers of all in an array."""
    layouts = {layout_of(x) for x in values}
    if len(values) <= INLINE or len(layouts) > 1:
        return [encoded(x, pool) for x in values]
    (layout,) = layouts
    if not layout.width or {*layout.kinds} != {"number"}:
        return [encoded(x, pool) for x in values]
    numbers = np.array([*map(gatherer(layout), values)], dtype=float)
    record = {"first": encoded(values[0], pool), "count": len(values)}
    return record | {"at": pool.put(numbers, numbers)}


def encoded(value: Any, pool: Pool | None = None) -> Any:
    """A record, and what it may hold, as JSON; with a pool long arrays and tables are put there."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (np.float64, np.str_)):
        return value.item()
    if isinstance(value, (int, float, str)):
        plain = next(kind.__name__ for kind in (int, float, str) if isinstance(value, kind))
        raise InvalidInput(
            f"Trajectory.save: {value!r} of the class {type(value).__name__} cannot be saved, for a "
            f"plain {plain} would come back, which is another thing to formulas; let the record hold "
            f"the {plain} itself"
        )
    if isinstance(value, type) and (issubclass(value, Record) or dataclasses.is_dataclass(value)):
        return {"type": f"{value.__module__}:{value.__qualname__}"}
    if isinstance(value, Vec):
        return {"vec": [encoded(x, pool) for x in value]}
    if isinstance(value, Mat):
        return {"mat": [encoded(row, pool) for row in value.rows]}
    if isinstance(value, Large):
        return {"large": encoded(np.array(value), pool)}
    if isinstance(value, Table):
        if pool is None or len(value) <= INLINE:
            return {"table": value.array.tolist()}
        return {"table": {"at": pool.put(value, value.array), "count": len(value)}}
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag], "as": "complex"}
    if isinstance(value, Complex):
        return {"complex": [value.re, value.im], "as": "Complex"}
    # a long double has no number in JSON
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in NUMBERS and value.dtype.char not in "gG":
        if pool is not None and value.size > INLINE and value.dtype.isnative:
            at = {"at": pool.put(value, np.asarray(value))}
            return {"array": at, "dtype": value.dtype.str, "shape": list(value.shape)}
        flat = np.ascontiguousarray(value)
        entry = {"array": flat.view(float).ravel().tolist() if flat.dtype.kind == "c" else flat.ravel().tolist(),
                "dtype": flat.dtype.str, "shape": list(value.shape)}  # fmt: skip
        return entry | {"scalar": True} if isinstance(value, np.generic) else entry
    if type(value) in (tuple, list):
        return {type(value).__name__: [encoded(x, pool) for x in value]}
    if isinstance(value, FrozenDict):
        return {"dict": [[encoded(k, pool), encoded(x, pool)] for k, x in value.items()]}
    if dataclasses.is_dataclass(value):
        cls = type(value)
        fields = {f.name: encoded(getattr(value, f.name), pool) for f in dataclasses.fields(value)}
        record = {"class": f"{cls.__module__}:{cls.__qualname__}", "fields": fields}
        formulas = fingerprint(cls)
        return record if formulas is None else record | {"formulas": formulas}
    raise InvalidInput(
        f"Trajectory.save: {value!r} cannot be saved; records hold numbers, vectors, matrices, texts and records"
    )


@frozen
class Decoder:
    """Decodes what `encoded` made of a value."""

    where: str  # the file, for messages
    modules: frozenset[str] = frozenset()  # modules named by the user, which may be imported
    trusted: bool = False  # may all modules that the file names be imported?
    pool: Mapping[str, np.ndarray] = field(default_factory=dict)  # the arrays that hold long rows of numbers
    largest: int = LARGEST  # the largest size of a system that the file may ask for
    taken: dict[Any, Any] = field(default_factory=dict)
    totals: dict[str, int] = field(default_factory=dict)

    def __call__(self, value: Any) -> Any:
        """The value that `encoded` has written as this JSON."""
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if not isinstance(value, dict) or not value:
            self._refuse(value)
        (kind, content), *others = value.items()
        known_kinds: dict[str, Callable[[Any, dict[str, Any]], Any]] = {
            "type": lambda given, _: self.cls(given),
            "vec": lambda given, _: Vec(*self._numbers(given)),
            "mat": lambda given, _: Mat(*self._rows(given)),
            "complex": self._complex,
            "array": self._array,
            "large": lambda given, _: Large(self(given)),
            "table": self._table,
            "tuple": lambda given, _: tuple(map(self, self._list(given))),
            "list": lambda given, _: [*map(self, self._list(given))],
            "dict": lambda given, _: FrozenDict({self(k): self(x) for k, x in self._list(given)}),
            "class": self._record,
        }
        if kind not in known_kinds:
            self._refuse(value)
        return known_kinds[kind](content, dict(others))

    def each(self, value: Any, kind: type) -> list[Any]:
        """Many records of this kind, such as the systems of an ensemble."""
        if isinstance(value, (list, tuple)):
            return [self.record(x, kind) for x in value]
        if not isinstance(value, dict) or value.keys() != {"first", "count", "at"}:
            self._refuse(value)
        first = self.record(value["first"], kind)
        layout = layout_of(first)
        if not layout.width or {*layout.kinds} != {"number"} or type(value["count"]) is not int:
            self._refuse(value)
        count = value["count"]
        numbers = self._pooled("float64", value["at"], count * layout.width)
        rows = numbers.reshape(count, layout.width).tolist()
        return [build(layout, iter(row)) for row in rows]

    def record(self, value: Any, kind: type) -> Any:
        """A record of this kind, such as a method."""
        decoded = self(value)
        if not isinstance(decoded, kind):
            raise InvalidInput(f"{self.where}: {decoded!r} is no {kind.__name__}")
        return decoded

    def cls(self, path: Any) -> Any:
        """The class of this name, among the records that are known here."""
        if not isinstance(path, str) or path.count(":") != 1:
            self._refuse(path)
        module, _, name = class_of(path).partition(":")
        of_library = module.partition(".")[0] == LIBRARY
        if of_library and module not in sys.modules and _has_records(module):
            importlib.import_module(module)
        kind = known(module, name) if "<locals>" not in name else None
        if kind is None and self.trusted and not of_library and module != "__main__":
            try:
                importlib.import_module(module)
            except Exception as error:  # whatever the module does when it is loaded
                raise InvalidInput(
                    f"{self.where}: module {module!r} cannot be imported: {type(error).__name__}: {error}"
                ) from error
            kind = known(module, name)
        if kind is None and (self.trusted or module in self.modules):
            kind = _plain_dataclass(module, name)
        if kind is None:
            raise InvalidInput(f"{self.where}: {self._unknown(module, name, of_library)}")
        return kind

    def _unknown(self, module: str, name: str, ours: bool) -> str:
        """Why no class has this name, and what helps, in words."""
        if "<locals>" in name:
            return (
                f"{name} of {module} was defined inside of a function, where there may be many of this "
                "name; define it at the top of the module, and save the run again"
            )
        if module == "__main__":
            return (
                f"{name} was a class of the script that saved the run, and {self.where} is loaded by "
                "another one; define it there too, or save runs of a class of a module"
            )
        if ours:
            return f"there is no class {name} in {module}; the file is of another version of liemech"
        if self.trusted or module in self.modules or module in sys.modules:
            return (
                f"there is no class {name} of records in {module}; files name subclasses of "
                "liemech.Record, and no functions"
            )
        return (
            f"there is no class {name} of {module} here, which is not a module of liemech; import it "
            f"before, or load the file with modules=[{module!r}].  If you trust the file, "
            "trusted=True imports all modules that it names, and so runs their code"
        )

    # ---------------------------------------------------------------- kinds of values

    def _record(self, content: Any, others: dict[str, Any]) -> Any:
        cls, encoded_fields = self.cls(content), others.get("fields")
        if not isinstance(encoded_fields, dict):
            self._refuse(others)
        fields = {name: self(x) for name, x in encoded_fields.items()}
        known_fields = {f.name: f.init for f in dataclasses.fields(cls)}
        of_others = {name for name, init in known_fields.items() if not init}  # what a class makes of its other fields
        if not known_fields.keys() - of_others <= fields.keys() <= known_fields.keys():
            raise InvalidInput(
                f"{self.where}: {cls.__qualname__} does not have the fields of the file, {', '.join(fields)}"
            )
        if changed(cls, others.get("formulas")):
            warn(
                f"{self.where}: the formulas of {cls.__qualname__} are others now than when this was "
                "saved; its samples are of the old ones, and what is computed of them, or goes on "
                "from them, is of the new ones",
                FormulaWarning,
            )
        if issubclass(cls, Record):
            if cls.__module__.partition(".")[0] == LIBRARY:
                require_sizes(self.where, cls, fields, self.largest)
                if not issubclass(cls, OF_TABLES) and any(isinstance(x, Table) for x in fields.values()):
                    raise InvalidInput(f"{self.where}: {cls.__qualname__} is made for a run, and no part of files")
            if len(fields) < len(known_fields):
                return cls(**{name: x for name, x in fields.items() if known_fields[name]})
            return refilled(cls, fields)
        instance = object.__new__(cls)
        for name, x in fields.items():
            object.__setattr__(instance, name, x)
        return instance

    def _complex(self, content: Any, others: dict[str, Any]) -> Any:
        re, im = self._numbers(content)
        return Complex(re, im) if others.get("as") == "Complex" else complex(re, im)

    def _table(self, content: Any, _: dict[str, Any]) -> Table:
        if isinstance(content, dict) and content.keys() == {"at", "count"}:
            numbers, key = (self._pooled("float64", content["at"], content["count"]), ("table", *content.values()))
            if key not in self.taken:  # tables of the same numbers are one
                self.taken[key] = Table(numbers)
            return self.taken[key]
        return Table([float(x) for x in self._list(content)])

    def _pooled(self, name: str, at: Any, count: Any) -> np.ndarray:
        """Numbers of a pool.  All that a file asks for is no more than is there."""
        pool = self.pool.get(f"{POOL}{name}")
        key = name, at, count
        if pool is None or type(at) is not int or type(count) is not int or pool.dtype.name != name:
            self._refuse(key)
        if key not in self.taken:
            total = self.totals.get(name, 0) + max(count, 0)
            if at < 0 or count < 0 or at + count > pool.size or total > pool.size:
                self._refuse(key)
            self.taken[key], self.totals[name] = pool[at : at + count], total
        return self.taken[key]

    def _array(self, content: Any, others: dict[str, Any]) -> Any:
        type_code, shape = others.get("dtype"), self._list(others.get("shape"))
        dtype = np.dtype(type_code) if isinstance(type_code, str) and len(type_code) < 8 else np.dtype(object)
        whole = all(type(n) is int and n >= 0 for n in shape)
        if dtype.kind not in NUMBERS or not whole or math.prod([max(n, 1) for n in shape]) > self.largest:
            self._refuse(others)
        if isinstance(content, dict) and content.keys() == {"at"}:
            return self._pooled(dtype.name, content["at"], math.prod(shape)).reshape(shape)
        numbers = np.array(self._list(content), dtype=float if dtype.kind == "c" else dtype)
        array = (numbers.view(dtype) if dtype.kind == "c" else numbers).reshape(shape)
        return array[()] if others.get("scalar") is True else array

    def _rows(self, content: Any) -> list[Any]:
        rows = [self(row) for row in self._list(content)]
        if not all(isinstance(row, Vec) for row in rows):
            self._refuse(content)
        return rows

    def _numbers(self, content: Any) -> list[Any]:
        numbers = [self(x) for x in self._list(content)]
        if not all(isinstance(x, (int, float, complex, Complex, Vec)) for x in numbers):
            self._refuse(content)
        return numbers

    def _list(self, content: Any) -> list[Any]:
        if not isinstance(content, list):
            self._refuse(content)
        return content

    def _refuse(self, value: Any) -> NoReturn:
        shown = repr(value)
        shown = shown if len(shown) < 80 else f"{shown[:77]}..."
        raise InvalidInput(f"{self.where}: {shown} is nothing that Trajectory.save writes")


def require_sizes(where: str, cls: Any, fields: Mapping[str, Any], largest: int) -> None:
    """Raise InvalidInput for sizes of a class of the library that are beyond what a file may ask for."""
    for name, value in fields.items():
        for x in value if isinstance(value, tuple) else (value,):
            count = x * x if issubclass(cls, MatrixLieGroup) and type(x) is int else x  # entries of matrices
            if type(count) is int and abs(count) > largest:
                raise InvalidInput(
                    f"{where}: {cls.__qualname__}: {name} = {value!r} asks for more than {largest} numbers, the most "
                    "for a text or file that holds fewer"
                )


def _has_records(module: str) -> bool:
    """Whether this is a module of the library with records. The folders are listed, nothing is imported by a name
    before it is known to be one of these.
    """
    package, home, *names = LIBRARY, *module.split(".")
    if home != LIBRARY or not names or names[0] not in WITH_RECORDS:
        return False
    for name in names:
        folder = getattr(importlib.import_module(package), "__path__", ())
        if not any(entry.name == name for entry in pkgutil.iter_modules(folder)):
            return False
        package += f".{name}"
    return True


def _plain_dataclass(module: str, name: str) -> Any:
    """A dataclass of a module of the user's that is no record."""
    member = vars(sys.modules[module]).get(name) if module in sys.modules else None
    is_this = isinstance(member, type) and (member.__module__, member.__qualname__) == (module, name)
    return member if is_this and dataclasses.is_dataclass(member) else None
