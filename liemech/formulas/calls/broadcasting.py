"""Broadcasting: methods called with arrays run over the leading axes; called with small vectors
they are the bare formula.

Every public method of a record passes here.  What one formula hands to another (small vectors,
floats, records) is looked at only by its type and shape; all else is converted and checked.
"""

from __future__ import annotations

import functools
import types
from collections.abc import Callable
from typing import Any

from ..classes.signatures import RECORDS, Signature, bare
from ..numbers.bases import CarriesMore
from ..of_math import taking_all
from ..vectors import Vec
from .arguments import blame, checked
from .one_row import one_row


class Broadcasting:
    """A class whose public methods on `Vec` and `Mat` take arrays too."""

    _takes_rows = True
    """Are arguments rows of numbers, shaped in no other way?"""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        RECORDS[cls.__name__] = cls
        cls._takes_rows = cls._in_rows is Broadcasting._in_rows
        for name, member in vars(cls).copy().items():
            if isinstance(member, types.FunctionType) and not name.startswith("_"):
                signature = Signature(cls, name, bare(member))
                if not signature.says_nothing:
                    setattr(cls, name, _broadcasting(signature))

    @classmethod
    def _wanted(cls, owner: Any) -> str:
        """The end of "must ..." in the message for an argument that is no instance."""
        return f"be a {cls.__name__}"

    @property
    def _space(self) -> Any:
        """The group, or another record, that knows of arguments what follows; None if there is none.  Subclasses know."""
        return None

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        """The shape that an array argument of this kind must have; None if any will do.  Subclasses know."""
        return None if self._space is None else self._space._shape(argument, kind)

    @property
    def is_large(self) -> bool:
        """Whether the owner's matrices are too large for formulas that are written out."""
        return False

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        """A method on whole arrays, batch axis first, for owners that are large; None: use the formula."""
        return None

    def _in_rows(self, value: Any, kind: str) -> Any:
        """An argument as rows of numbers, if it is shaped in another way.  Subclasses know."""
        return value

    def _out_of_rows(self, results: Any, kind: str | None = None) -> Any:
        """Results, an array, in the way in which such arguments are shaped."""
        return results

    def _complex(self, kind: str) -> bool:
        """Whether an argument of this kind may have complex entries, as subclasses say."""
        return self._space is not None and self._space._complex(kind)

    def _objection(self, argument: str, value: Any) -> str | None:
        """The objection to the value of an argument, an array or an option; None if there is none. Subclasses know."""
        return None if self._space is None else self._space._objection(argument, value)

    def _explain(self, arguments: dict[str, Any]) -> None:
        """Raise why the owner cannot serve these arguments, if that is why a formula failed. Subclasses know."""


def _broadcasting(signature: Signature) -> Callable[..., Any]:
    """The formula, its arguments checked: arrays are broadcast, small vectors pass straight through."""
    formula, at, promised = signature.formula, signature.space_at, signature.promise

    @functools.wraps(formula)
    def method(self: Any, *args: Any, **options: Any) -> Any:
        if options:
            return checked(signature, self, args, options)
        for value, passing in zip(args, signature.trusted):
            if passing is not None and type(value) not in passing:
                single = one_row(signature, self, args)
                return checked(signature, self, args, options) if single is None else single
        if at is None or at < len(args):
            space = self if at is None else args[at]
            try:
                shapes = space._shapes[signature]
            except (AttributeError, KeyError):
                shapes = signature.shapes(space)
            for value, shape in zip(args, shapes):
                if shape is not None and value is not None:
                    actual = len(value) if type(value) is Vec else value.shape
                    if actual != shape:
                        return checked(signature, self, args, options)
        try:
            try:
                result = formula(self, *args)
            except CarriesMore:
                result = _CARRIES_MORE
            if result is _CARRIES_MORE:  # what is raised here is not raised because of that
                result = taking_all(formula)(self, *args)
        except Exception as error:
            blame(signature, self, args, error)
            raise
        return signature.kept(self, result) if promised else result

    method.__formula__ = formula  # type: ignore[attr-defined]
    method.__promise__ = promised  # type: ignore[attr-defined]
    return method


_CARRIES_MORE = object()
"""In place of a result: the formula took a function of Python's `math` of a number that carries more."""
