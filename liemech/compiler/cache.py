"""Object code on disk: found again in a new process, never stale, never half-written, safe to share between processes."""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import tempfile
from pathlib import Path

KEEP = 500  # kernels on disk; the oldest go first


@functools.cache
def own_source() -> str:
    """A hash of this package's own files: another compiler makes other code."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


@functools.cache
def folder() -> Path | None:
    """The first folder that can be written: $LIEMECH_CACHE_DIR, beside the package, or the user's cache; else None."""
    chosen = os.environ.get("LIEMECH_CACHE_DIR")
    package = Path(__file__).parent / "__pycache__"
    if sys.platform == "win32":
        user = Path(os.environ.get("LOCALAPPDATA", Path.home())) / "liemech" / "Cache"
    elif sys.platform == "darwin":
        user = Path.home() / "Library" / "Caches" / "liemech"
    else:
        user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "liemech"
    for place in [Path(chosen)] if chosen else [package, user]:
        try:
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=place):
                return place
        except OSError:
            continue
    return None


def load(key: str) -> bytes | None:
    """The object code stored under this key, if it is there and whole."""
    place = folder()
    if place is None:
        return None
    try:
        content = (place / f"{key}.o").read_bytes()
    except OSError:
        return None
    checksum, code = content[:32], content[32:]
    return code if hashlib.sha256(code).digest() == checksum else None


def store(key: str, code: bytes) -> None:
    """Keep object code; a full or vanished disk is no error, the next process just compiles again."""
    place = folder()
    if place is None:
        return
    try:
        handle, name = tempfile.mkstemp(dir=place, suffix=".tmp")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(name, place / f"{key}.o")  # readers see the old file, the new one or none
        except OSError:
            os.unlink(name)
        _forget_oldest(place)
    except OSError:
        return


def _forget_oldest(place: Path) -> None:
    kernels = sorted(place.glob("*.o"), key=lambda f: f.stat().st_mtime)
    for old in kernels[:-KEEP]:
        old.unlink(missing_ok=True)
