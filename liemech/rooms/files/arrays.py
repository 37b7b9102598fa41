"""Arrays in files, NumPy's .npz or HDF5, with a text about them and a checksum: written whole or not
at all, and read with care.

Reading takes no more memory than the file is long: what entries claim to be is compared with what
there is before room is made for them, and what is packed, or lies in other files, is refused.
`numpy.load("run.npz")["state.mu"]` needs no liemech.  The last bytes of an .npz file are a checksum
of all others.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import platform
import re
import secrets
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...errors import InvalidInput, MissingExtra

HDF5 = b"\x89HDF"
MARK = b"sha256:"
"""First bytes of the checksum at the end of a file."""
PIECE = 1 << 20
"""Bytes that are read at once."""
KINDS = "biufcU"
"""Kinds of NumPy's types that are written."""
ABOUT = "about"
"""The name of the text about the arrays, JSON."""


def write(path: Path, arrays: dict[str, Any], about: dict[str, Any]) -> None:
    """Write a file, all of it or nothing: one that is there is replaced when the new one lies on the
    disk.
    """
    packed = in_hdf5 if path.suffix.lower() in (".h5", ".hdf5") else in_npz
    text = np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), np.uint8)
    replace(path, packed(arrays | {ABOUT: text}))


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of a file, and their description.  Raises InvalidInput if it is damaged, or
    was not written here; OSError if it cannot be read.
    """
    with opened(path) as file:
        magic = file.read(4)
        arrays, text = (_of_hdf5 if magic == HDF5 else _of_npz)(path, file)
    about = json.loads(text)
    if not isinstance(about, dict):
        raise InvalidInput(f"{path}: is no run saved by liemech")
    return arrays, about


@contextlib.contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """A file to read from; neither a folder nor a device nor a pipe, on which one would wait."""
    _require_file(path, os.stat(path))
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        _require_file(path, os.fstat(handle))
        yield file


def _require_file(path: Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = {
            stat.S_IFDIR: "a folder",
            stat.S_IFIFO: "a pipe",
            stat.S_IFCHR: "a device",
            stat.S_IFBLK: "a device",
            stat.S_IFSOCK: "a socket",
        }.get(stat.S_IFMT(status.st_mode), "something else")
        raise InvalidInput(f"{path}: is no file but {kind}")


def _damaged(path: Path) -> InvalidInput:
    return InvalidInput(f"{path}: is damaged or no run saved by liemech: its checksum is not that of its content")


def _larger(path: Path, name: str, claimed: int, size: int) -> InvalidInput:
    return InvalidInput(
        f"{path}: is damaged or was forged: its entry {name!r} claims {claimed} bytes where there are {size}"
    )


# ------------------------------------------------------------------ NumPy's


def in_npz(arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of an .npz file whose last ones, the comment of the archive, are a checksum."""
    memory = io.BytesIO()
    np.savez(memory, **arrays)  # type: ignore[arg-type]
    with zipfile.ZipFile(memory, "a") as archive:
        archive.comment = MARK + bytes(32)
    data = memory.getvalue()
    return data[:-32] + hashlib.sha256(data[:-32]).digest()


def _of_npz(path: Path, file: BinaryIO) -> tuple[dict[str, np.ndarray], str]:
    length = file.seek(0, os.SEEK_END)
    file.seek(0)
    magic = file.read(2)
    file.seek(max(0, length - 40))
    end = file.read(40)
    if magic != b"PK" and MARK not in end:
        raise InvalidInput(f"{path}: is no run saved by liemech")
    if end[1:8] != MARK or _sha256(file, length - 32) != end[8:]:
        raise _damaged(path)
    arrays: dict[str, np.ndarray] = {}
    with zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        claimed = 0
        for entry in entries:
            name = entry.filename.removesuffix(".npy")
            claimed += entry.file_size
            if entry.compress_type != zipfile.ZIP_STORED or entry.compress_size != entry.file_size:
                raise InvalidInput(
                    f"{path}: is damaged or was forged: its entry {name!r} is packed, which runs are not"
                )
            if claimed > length:
                raise _larger(path, name, claimed, length)
        for entry in entries:
            name = entry.filename.removesuffix(".npy")
            if name in arrays:
                raise InvalidInput(f"{path}: is damaged or was forged: it has two entries {name!r}")
            arrays[name] = _array(path, name, archive.read(entry))
    text = arrays.pop(ABOUT, None)
    if text is not None and text.dtype == np.uint8 and text.ndim == 1:
        return arrays, text.tobytes().decode()
    if text is None or text.dtype.kind != "U" or text.ndim:  # of files of before
        raise InvalidInput(f"{path}: is no run saved by liemech")
    return arrays, str(text)


def _array(path: Path, name: str, data: bytes) -> np.ndarray:
    """The array of an .npy file."""
    memory = io.BytesIO(data)
    version = np.lib.format.read_magic(memory)
    header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
    shape, by_columns, dtype = header(memory)
    if dtype.kind not in KINDS:
        raise InvalidInput(f"{path}: is damaged or was forged: {name!r} is an array of {dtype}")
    count = 1
    for n in shape:
        count *= n
    length = len(data) - memory.tell()
    if min(shape, default=0) < 0 or not dtype.itemsize or count * dtype.itemsize != length:
        raise _larger(path, name, count * dtype.itemsize, length)
    flat = np.frombuffer(data, dtype, count, memory.tell()) if length else np.empty(0, dtype)
    return flat.reshape(shape, order="F" if by_columns else "C").copy("K")


def _sha256(file: BinaryIO, length: int) -> bytes:
    """The checksum of so many bytes from the beginning."""
    whole = hashlib.sha256()
    file.seek(0)
    while length > 0:
        piece = file.read(min(PIECE, length))
        if not piece:
            break
        whole.update(piece)
        length -= len(piece)
    return whole.digest()


# ------------------------------------------------------------------ HDF5


def in_hdf5(arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of an HDF5 file: a dataset for each array and for what is told about them, and a
    checksum as attribute.
    """
    memory = io.BytesIO()
    with _h5py().File(memory, "w") as file:
        for name, array in arrays.items():
            file[name] = array.tobytes().decode() if name == ABOUT else array
        file.attrs["checksum"] = _checksum(arrays)
    return memory.getvalue()


def _of_hdf5(path: Path, opened: BinaryIO) -> tuple[dict[str, np.ndarray], str]:
    length = opened.seek(0, os.SEEK_END)
    opened.seek(0)
    h5py = _h5py()
    try:
        with h5py.File(opened, "r") as file:
            datasets = {name: _dataset(path, file, name, h5py) for name in file}
            size = 0
            for name, dataset in datasets.items():
                size += dataset.nbytes
                if size > length:
                    raise _larger(path, name, size, length)
            about = datasets.pop(ABOUT)
            checksum = file.attrs.get_id("checksum")
            for text in (about, checksum):
                if text.shape != () or not h5py.check_string_dtype(text.dtype):
                    raise _damaged(path)
            arrays = {name: np.asarray(dataset) for name, dataset in datasets.items()}
            words, whole = str(about.asstr()[()]), file.attrs["checksum"]
    except InvalidInput:
        raise
    # what h5py has to say of damaged files
    except Exception:
        raise _damaged(path) from None
    text = np.frombuffer(words.encode(), np.uint8)
    if whole not in (_checksum(arrays | {ABOUT: x}) for x in (text, np.array(words))):
        raise _damaged(path)  # the second one is that of files of before
    return arrays, words


def _dataset(path: Path, file: Any, name: str, h5py: Any) -> Any:
    """A dataset whose numbers lie in the file uncompressed, and all of them."""
    if not isinstance(file.get(name, getlink=True), h5py.HardLink):
        raise InvalidInput(f"{path}: is damaged or was forged: {name!r} is a link")
    dataset = file[name]
    if not isinstance(dataset, h5py.Dataset):
        raise InvalidInput(f"{path}: is damaged or was forged: {name!r} is no array")
    if name == ABOUT:
        return dataset
    if dataset.dtype.kind not in KINDS:
        raise InvalidInput(f"{path}: is damaged or was forged: {name!r} is an array of {dataset.dtype}")
    if dataset.chunks is not None or dataset.external or dataset.is_virtual:
        raise InvalidInput(
            f"{path}: is damaged or was forged: {name!r} is packed or lies elsewhere, which runs are not"
        )
    if dataset.id.get_storage_size() != dataset.nbytes:
        raise _larger(path, name, dataset.nbytes, dataset.id.get_storage_size())
    return dataset


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 of names, types, shapes and bytes of arrays, in hexadecimal."""
    whole = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        whole.update(repr((name, array.dtype.str, array.shape)).encode() + np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()


def _h5py() -> Any:
    try:
        import h5py
    except ImportError:
        raise MissingExtra("HDF5 files need h5py", "data") from None
    return h5py


# ------------------------------------------------------------------ on the disk

_HOST = hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def replace(path: Path, data: bytes) -> None:
    """Write a file under another name, and give it its own when it lies on the disk.

    A file that is there keeps its mode, a new one gets that of all new files; of a symbolic link
    the file that it leads to is written.  What killed processes left unfinished is swept.
    """
    target = Path(os.path.realpath(path))
    mode = None
    with contextlib.suppress(FileNotFoundError):
        status = os.stat(target)
        _require_file(path, status)
        mode = stat.S_IMODE(status.st_mode)
        if not os.access(target, os.W_OK):
            raise PermissionError(13, os.strerror(13), str(path))
    _sweep(target)
    beside = unfinished(target)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        handle = os.open(beside, flags, 0o666)
    except OSError as error:  # of the file that was asked for
        raise OSError(error.errno, error.strerror, str(path)) from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            if mode is not None:
                with contextlib.suppress(OSError):  # not every disk has modes
                    os.chmod(beside, mode)
            os.fsync(file.fileno())
        os.replace(beside, target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(beside)
        raise
    with contextlib.suppress(OSError):  # not every system opens folders
        folder = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def unfinished(target: Path) -> Path:
    """A name beside a file under which this process writes it."""
    return target.with_name(f".{target.name}.{os.getpid()}-{_HOST}-{secrets.token_hex(4)}.part")


def _sweep(target: Path) -> None:
    """Remove what processes of this machine left unfinished that are no more."""
    name = re.compile(rf"\.{re.escape(target.name)}\.(\d+)-{_HOST}-[0-9a-f]{{8}}\.part")
    with contextlib.suppress(OSError):
        for entry in os.listdir(target.parent):
            left = name.fullmatch(entry)
            if left and not _alive(int(left[1])):
                with contextlib.suppress(OSError):
                    os.unlink(target.with_name(entry))


def _alive(process: int) -> bool:
    """Whether a process of this number runs, as far as one can know."""
    if os.name == "nt":  # where signal 0 would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
