"""Object code on disk: found again in a new process, never half-written, safe to share between the
user's processes.

A file holds what the code was made of (the manifest) and the code; the checksum covers both and the
file's name.  For one key there may be several, made while globals or helpers were others.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import shlex
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...errors import warn
from .. import IMPORTED

LIMIT = 256 * 2**20
"""Bytes on disk; what was not used for the longest time goes first."""

VARIANTS = 8
"""Files for one key."""

HOUR = 3600.0

COMPILER = Path(__file__).parents[1]


@functools.cache
def own_source() -> str | None:
    """A hash of the files of formulas and compiler: another compiler makes other code.  None if one
    was edited since the import.
    """
    digest = hashlib.sha256()
    for file in sorted([*COMPILER.rglob("*.py"), *(COMPILER.parent / "formulas").rglob("*.py")]):
        digest.update(f"{file.relative_to(COMPILER.parent)}:".encode() + file.read_bytes())
        if IMPORTED < file.stat().st_mtime < time.time():
            return None
    return digest.hexdigest()


@functools.cache
def folder() -> Path | None:
    """$LIEMECH_CACHE_DIR, or the first of: beside the package, the user's cache; None if that
    cannot be written or is not safe, with a warning of a folder that was named.
    """
    chosen = os.environ.get("LIEMECH_CACHE_DIR")
    package = COMPILER / "__pycache__"
    if sys.platform == "win32":
        user = Path(os.environ.get("LOCALAPPDATA", Path.home())) / "liemech" / "Cache"
    elif sys.platform == "darwin":
        user = Path.home() / "Library" / "Caches" / "liemech"
    else:
        user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "liemech"
    why = ""
    for place in [Path(chosen).resolve()] if chosen else [package, user]:
        try:
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_safe(place.lstat()):
                with tempfile.TemporaryFile(dir=place):
                    return place
            why = (
                "others may write to it or it is another user's, and what is in it will be run; give "
                f"it to yourself alone, chmod 700 {shlex.quote(str(place))}, or name another folder"
            )
        except OSError as error:
            why = f"{error}; name a folder to which you can write"
    if chosen and chosen != os.devnull:  # the one that says: nowhere
        warn(
            f"$LIEMECH_CACHE_DIR, {chosen}, is not used: {why}.  Native code is kept nowhere, and "
            "every process compiles anew",
            RuntimeWarning,
        )
    return None


def _is_safe(status: os.stat_result) -> bool:
    """A folder of the user's own, which nobody else can write: its files are code that will be run."""
    is_own = not hasattr(os, "getuid") or (
        status.st_uid == os.getuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )
    return stat.S_ISDIR(status.st_mode) and is_own


def load(key: str, fits: Callable[[Any], Any]) -> tuple[Any, bytes] | None:
    """The first manifest under this key that `fits` accepts, as it returns it (not None), and the code beside it."""
    for file in _files(key):
        content = _content(file)
        if content is not None:
            accepted = fits(json.loads(content[0]))
            if accepted is not None:
                with contextlib.suppress(OSError):
                    os.utime(file)  # used now
                return accepted, content[1]
    return None


def store(key: str, manifest: Any, code: bytes) -> None:
    """Keep object code; a full or vanished disk is no error, the next process just compiles again."""
    head = json.dumps(manifest).encode()
    files = _files(key)
    if not files:
        return
    contents = [_content(file) for file in files]
    fitting = [f for f, c in zip(files, contents, strict=True) if c and c[0] == head]
    free = [f for f, c in zip(files, contents, strict=True) if c is None]
    with contextlib.suppress(OSError):
        file = [*fitting, *free, *sorted(files, key=_last_use)][0]
        content = head + b"\n" + code
        handle, name = tempfile.mkstemp(dir=file.parent, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as opened:
                opened.write(_checksum(file.name, content) + content)
            os.replace(name, file)  # readers see the old file, the new one or none
        except OSError:
            os.unlink(name)
        _tidy(file.parent)


def _files(key: str) -> list[Path]:
    place = folder()
    return [place / f"{key}-{i}.o" for i in range(VARIANTS)] if place else []


def _last_use(file: Path) -> float:
    try:
        return file.lstat().st_mtime
    except OSError:
        return 0.0


def _tidy(place: Path) -> None:
    """Remove what was not used for the longest time beyond the limit, and what interrupted processes left behind."""
    files = [
        (f.stat().st_mtime, f.stat().st_size, f.path) for f in os.scandir(place) if f.name.endswith((".o", ".tmp"))
    ]
    room = LIMIT
    for last_use, size, path in sorted(files, reverse=True):
        room -= size
        if room < 0 if path.endswith(".o") else last_use < time.time() - HOUR:
            with contextlib.suppress(OSError):
                os.unlink(path)


def _content(file: Path) -> tuple[bytes, bytes] | None:
    """Manifest and code, if the file is there, no link, and whole."""
    try:
        with open(
            os.open(file, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)), "rb"
        ) as opened:
            content = opened.read()
    except OSError:
        return None
    if content[:32] != _checksum(file.name, content[32:]):
        return None
    manifest, _, code = content[32:].partition(b"\n")
    return manifest, code


def _checksum(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\n" + content).digest()
