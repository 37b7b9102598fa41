"""Modules that are no files: namespaces such as `lm.actions`, made of the stubs beside this file, and former names."""

import ast
import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from . import lazily
from .places import LIBRARY, package_of, place_of, stub_of


class Namespace:
    """Makes a namespace, whose names are imported when they are asked for."""

    @staticmethod
    def create_module(spec: ModuleSpec) -> None:
        """None: an ordinary module is created."""

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        """Fill a namespace with its docstring and its lazy names."""
        module.__doc__ = ast.get_docstring(stub_of(module.__name__))
        vars(module)["__getattr__"], vars(module)["__dir__"], vars(module)["__all__"] = lazily(module.__name__)


class Former:
    """Imports the module of today for a former name."""

    @staticmethod
    def create_module(spec: ModuleSpec) -> None:
        """None: a module that `exec_module` replaces."""

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        """Put the module of today under its former name into `sys.modules`, with a warning."""
        now = place_of(module.__name__)
        warnings.warn(f"{module.__name__} is {now} now", DeprecationWarning, stacklevel=2)
        sys.modules[module.__name__] = import_module(now)


NAMESPACE: Any = Namespace()
FORMER: Any = Former()


class Finder:
    """Finds, for `import`, namespaces by their stubs and modules by their former names."""

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """The spec of a former name or of a namespace; None for any other module."""
        if not name.startswith(f"{LIBRARY}."):
            return None
        if place_of(name) != name:
            return ModuleSpec(name, FORMER)
        return ModuleSpec(name, NAMESPACE) if package_of(name) != name else None
