"""Fingerprints of the formulas of a user's class, by which a saved run knows whether they have changed
since.
"""

from __future__ import annotations

import hashlib
import sys
import types
from collections.abc import Iterator
from typing import Any

from ...formulas.classes.signatures import bare

LIBRARY = __name__.partition(".")[0]
LETTERS = 16
PYTHON = "{}.{}".format(*sys.version_info)
"""Other versions of Python make other code of the same formulas: nothing is told between them."""

PLAIN = bool, int, float, complex, str, tuple, frozenset, type(None)
"""Attributes of a class that are constants of its formulas."""


def fingerprint(cls: type) -> str | None:
    """Fingerprint of the methods and constants that a class and its bases have from the user; None for
    classes of the library.

    Documentation and names of arguments do not count, nor do functions outside of the class.
    """
    digest, of_user = hashlib.sha256(), False
    for base in cls.__mro__:
        if base.__module__.partition(".")[0] in (LIBRARY, *sys.stdlib_module_names):
            continue
        for name, member in sorted(vars(base).items()):
            for words in _words(name, member):
                of_user = True
                digest.update(words.encode())
    return f"{PYTHON}:{digest.hexdigest()[:LETTERS]}" if of_user else None


def changed(cls: type, former: Any) -> bool:
    """Whether the formulas of a class differ from those of this fingerprint; False where Python versions do."""
    current = fingerprint(cls)
    comparable = isinstance(former, str) and former.startswith(f"{PYTHON}:")
    return comparable and current is not None and current != former


def _words(name: str, member: Any) -> Iterator[str]:
    """The words hashed for an attribute of a class: the code of a function, the value of a constant."""
    for part in ("__func__", "fget", "func"):  # of class methods, properties, cached properties
        member = getattr(member, part, member)
    code = getattr(bare(member), "__code__", None)
    if isinstance(code, types.CodeType):
        if code.co_filename != "<string>":  # where dataclasses write theirs
            yield f"{name}({_code(code)})"
    elif isinstance(member, PLAIN) and not name.startswith("__"):
        yield f"{name}={_constant(member)}"


def _code(code: types.CodeType) -> str:
    """Instructions, names and constants of a function, without its documentation."""
    constants = code.co_consts[1:] if isinstance((*code.co_consts, None)[0], str) else code.co_consts
    return f"{code.co_code.hex()} {code.co_names} {[_constant(x) for x in constants]}"


def _constant(value: Any) -> str:
    if isinstance(value, types.CodeType):
        return _code(value)
    return str(sorted(map(repr, value))) if isinstance(value, frozenset) else repr(value)
