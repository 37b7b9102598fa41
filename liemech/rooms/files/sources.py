"""Sources: where the formulas of a run's method and system stand in print, as a paper cites them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from inspect import getdoc
from typing import Any

from ...errors import InvalidInput
from ...formulas import Record
from ...formulas.classes.frozen import frozen
from ...formulas.classes.records import fields_of
from ...simulation.compiled.systems import OfBodies
from ...simulation.reports.written_tables import latex


@frozen
class Sources:
    """The sources of the method and the system of a run, and of the parts that they are made of; `print` it.

    named : by class, what its docstring says after `Source:`.  version : of the library.
    """

    named: dict[str, str]
    version: str

    def __getitem__(self, name: str) -> str:
        if name not in self.named:
            raise InvalidInput(f"Sources: {name!r} names none; known are: {', '.join(self.named)}")
        return self.named[name]

    def __str__(self) -> str:
        wide = max([len("liemech"), *map(len, self.named)])
        lines = [f"{'liemech':<{wide}}  liemech: mechanics on Lie groups, version {self.version}"]
        return "\n".join([*lines, *(f"{name:<{wide}}  {source}" for name, source in self.named.items())])

    @property
    def bibtex(self) -> str:
        """The sources as entries of BibTeX, their words as notes, under the names of the classes."""
        entries = {"liemech": f"liemech: mechanics on Lie groups, version {self.version}"} | self.named
        return "\n\n".join(f"@misc{{{name},\n  note = {{{latex(text)}}}\n}}" for name, text in entries.items())


def sources_of(*things: Any) -> Sources:
    """The sources of things and of what they are made of, in the order in which they come."""
    from ... import __version__

    named: dict[str, str] = {}
    for kind in dict.fromkeys(_kinds(things)):
        source = re.search(r"Source:\s*(.*?)\s*(?:\n\s*\n|\Z)", getdoc(kind) or "", re.DOTALL)
        if source and " ".join(source[1].split()) not in named.values():
            named[kind.__name__] = " ".join(source[1].split())
    return Sources(named, __version__)


def _kinds(things: Any) -> Iterator[type]:
    """The classes of things and of the records among their fields; of each the first base class that names a source."""
    for thing in things:
        if isinstance(thing, (list, tuple, OfBodies)):
            yield from _kinds(getattr(thing, "members", thing))
        elif isinstance(thing, Record):
            sourced = (kind for kind in type(thing).__mro__ if "Source:" in (kind.__doc__ or ""))
            yield from [*sourced][:1]
            yield from _kinds([*fields_of(thing).values(), getattr(thing, "group", None)])
