"""BLAS and LAPACK as SciPy brings them: the routines by their addresses, which native code calls
too, on one thread.

Matrices are stored by rows here and by columns there: what is A B here is B^T A^T there.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

ROUTINES = {"gemm": 13, "gesv": 8, "getrf": 6}
"""The routines that are used, and how many arguments each has, all of them addresses."""


@functools.cache
def addresses() -> dict[str, int]:
    """The addresses of the routines of BLAS and LAPACK by name: dgemm, zgemm, ..."""
    from scipy.linalg import cython_blas, cython_lapack

    name, pointer = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name.restype, name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    pointers = {}
    for kind in "dz":
        for routine in ROUTINES:
            library = cython_blas if routine == "gemm" else cython_lapack
            capsule = library.__pyx_capi__[kind + routine]
            pointers[kind + routine] = pointer(capsule, name(capsule))
    return pointers


@functools.cache
def _routine(name: str) -> Any:
    """A routine that Python can call."""
    of_addresses = [ctypes.c_void_p] * ROUTINES[name[1:]]
    return ctypes.CFUNCTYPE(None, *of_addresses)(addresses()[name])


@functools.cache
def _threads() -> Any:
    """OpenBLAS's functions that tell and set its number of threads; None of other libraries."""
    import glob

    import scipy

    home = os.path.dirname(scipy.__file__)
    folders = os.path.join(home, os.pardir, "scipy.libs"), os.path.join(home, ".dylibs")
    for path in [p for folder in folders for p in glob.glob(os.path.join(folder, "*openblas*"))]:
        library = ctypes.CDLL(path)
        for prefix in ("scipy_openblas", "openblas"):
            with contextlib.suppress(AttributeError):
                return (getattr(library, f"{prefix}_get_num_threads"), getattr(library, f"{prefix}_set_num_threads"))
    return None


class _Alone:
    """The count of callers, in all threads, that want BLAS on one thread at present, and the threads that the first of
    them found it on.
    """

    inside, before = 0, 1
    lock = threading.Lock()


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """While this lasts, SciPy's BLAS works on one thread, which fixes the order of its sums.  The number of its
    threads is that of the process: the first caller changes it, and the last one changes it back.
    """
    functions = _threads()
    if functions is None:
        yield
        return
    count, set_count = functions
    with _Alone.lock:
        if not _Alone.inside:
            _Alone.before = count()
        _Alone.inside += 1
        if count() != 1:
            set_count(1)
    try:
        yield
    finally:
        with _Alone.lock:
            _Alone.inside -= 1
            if not _Alone.inside and _Alone.before != 1:
                set_count(_Alone.before)


def _after_fork() -> None:
    """The threads that were at work are not in the child."""
    if _Alone.inside and _Alone.before != 1 and _threads() is not None:
        _threads()[1](_Alone.before)
    _Alone.inside, _Alone.lock = 0, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def on_one_thread(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function while `one_thread` lasts."""

    def alone(*args: Any) -> Any:
        with one_thread():
            return function(*args)

    return alone


_ONE, _ZERO = (ctypes.c_double * 2)(1.0, 0.0), (ctypes.c_double * 2)(0.0, 0.0)


def product(a: np.ndarray, b: np.ndarray, is_complex: bool) -> np.ndarray:
    """A B.  a : (m, k), b : (k, n), of complex ones with a last axis of 2, in one piece."""
    (m, k), n = a.shape[:2], b.shape[1]
    c = np.empty((m, n, *a.shape[2:]))
    no, sizes = (ctypes.byref(ctypes.c_char(b"N")), [ctypes.byref(ctypes.c_int(x)) for x in (n, m, k)])
    with one_thread():
        _routine("zgemm" if is_complex else "dgemm")(
            no, no, *sizes, _ONE, b.ctypes.data, sizes[0], a.ctypes.data, sizes[2], _ZERO,
            c.ctypes.data, sizes[0],
        )  # fmt: skip
    return c


def over(b: np.ndarray, a: np.ndarray, is_complex: bool) -> np.ndarray:
    """B A^-1; nan if A is singular.  a : (n, n), b : (m, n), as of `product`."""
    n, m = len(a), len(b)
    factors, quotient, pivots, info = a.copy(), b.copy(), np.empty(n, dtype=np.int32), ctypes.c_int(0)
    sizes = [ctypes.byref(ctypes.c_int(x)) for x in (n, m)]
    with one_thread():
        _routine("zgesv" if is_complex else "dgesv")(
            *sizes, factors.ctypes.data, sizes[0], pivots.ctypes.data, quotient.ctypes.data, sizes[0],
            ctypes.byref(info),
        )  # fmt: skip
    if info.value:
        quotient[:] = np.nan
    return quotient


def determinant(a: np.ndarray, is_complex: bool) -> tuple[float, float]:
    """The real and the imaginary part of det A, the product of the pivots.  a : (n, n), as of `product`."""
    n, factors, info = len(a), a.copy(), ctypes.c_int(0)
    pivots, size = np.empty(n, dtype=np.int32), ctypes.byref(ctypes.c_int(n))
    with one_thread():
        _routine("zgetrf" if is_complex else "dgetrf")(
            size, size, factors.ctypes.data, size, pivots.ctypes.data, ctypes.byref(info)
        )
    det, of_one = (1.0, 0.0), 1 if is_complex else 0
    for k, at in enumerate(pivots.tolist()):
        c = factors[k, k].tolist() if of_one else [factors.item(k, k), 0.0]
        s = 1.0 if at == k + 1 else -1.0
        x, y = s * c[0], s * c[1]
        det = det[0] * x - det[1] * y, det[0] * y + det[1] * x
    return det
