"""The files of the library, read, parsed and walked through once for all tests that look at them."""

from __future__ import annotations

import ast
import functools
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "liemech"


@functools.cache
def files() -> dict[str, Path]:
    """Every module of the library by its dotted name."""
    named = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = ("liemech", *file.relative_to(PACKAGE).with_suffix("").parts)
        named[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return named


@functools.cache
def texts() -> dict[str, str]:
    """The text of every module."""
    return {module: file.read_text(encoding="utf-8") for module, file in files().items()}


@functools.cache
def trees() -> dict[str, ast.Module]:
    """Every module, parsed."""
    return {module: ast.parse(text, filename=str(files()[module])) for module, text in texts().items()}


@functools.cache
def nodes() -> dict[str, list[ast.AST]]:
    """The nodes of syntax of every module, those of `ast.walk` but Load and Store."""
    return {
        m: [node for node in ast.walk(tree) if not isinstance(node, ast.expr_context)] for m, tree in trees().items()
    }
