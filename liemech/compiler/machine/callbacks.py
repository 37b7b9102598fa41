"""Functions of floats that native code asks Python for: those of `math` and NumPy that are not the
C library's.

`math.hypot` and `np.exp` round in ways of their own, so native code calls the very functions that
plain Python calls.  The functions of `liemech.formulas` are the C library's in both worlds and take
a tenth of the time.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import re
from typing import Any

import numpy as np

from ...formulas import blas
from ...formulas.large_maps import TABLES
from .interrupts import THREAD

_MATH = "acosh asinh atanh cbrt erf erfc exp2 fmod gamma hypot lgamma log10 log2 nextafter remainder"
_NUMPY = (
    "sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh arcsinh arccosh arctanh exp exp2 "
    "expm1 log log2 log10 log1p logaddexp power hypot cbrt square reciprocal sign floor ceil trunc "
    "rint maximum minimum fmax fmin fmod mod copysign heaviside deg2rad rad2deg"
)

FUNCTIONS: dict[Any, str] = {
    **{getattr(math, name): f"liemech_math_{name}" for name in _MATH.split() if hasattr(math, name)},
    **{getattr(np, name): f"liemech_numpy_{name}" for name in _NUMPY.split()},
}
"""The functions and their names in native code, one for each number of arguments."""

_BY_NAME = {name: function for function, name in FUNCTIONS.items()}

_NO_VALUE = ArithmeticError, ValueError, TypeError
"""The errors of a function outside of its domain."""

_PYTHON = (
    "PyFloat_FromDouble PyObject_CallFunctionObjArgs PyFloat_AsDouble Py_DecRef PyErr_Occurred "
    "PyErr_ExceptionMatches PyErr_Clear"
)


@functools.cache
def addresses() -> dict[str, int]:
    """The addresses of Python's C functions that the definitions call, by name."""
    return {name: ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0 for name in _PYTHON.split()}


def in_memory(code: bytes) -> dict[str, int]:
    """The addresses of the tables and of the routines of BLAS and LAPACK that this object code asks for.

    Raises LookupError for a table that this process has not made yet.
    """
    pointers: dict[str, int] = {}
    for content, number in set(re.findall(rb"liemech_table_([0-9a-f]{24})_(\d+)", code)):
        table = TABLES[content.decode()][int(number)]
        pointers[f"liemech_table_{content.decode()}_{int(number)}"] = table.ctypes.data
    for name in set(re.findall(rb"liemech_([dz]ge(?:mm|sv|trf))(?!\w)", code)):
        pointers[f"liemech_{name.decode()}"] = blas.addresses()[name.decode()]
    for name in ("malloc", "free", "memmove"):
        if name.encode() in code:
            library: Any = ctypes.CDLL(None) if os.name != "nt" else ctypes.CDLL("ucrtbase")
            address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
            pointers[name] = address or 0
    return pointers


def definitions(code: bytes) -> str:
    """The functions that this object code asks Python for, in LLVM's language; '' if there are none."""
    names = set(re.findall(rb"liemech_(?:math|numpy)_\w+?_[12](?!\w)", code))
    functions = [_definition(*name.decode().rsplit("_", 1)) for name in sorted(names)]
    return f"; 1 instructions\n{_DECLARED}{''.join(functions)}" if functions else ""


def _definition(name: str, count: str) -> str:
    places = range(int(count))
    return _DEFINED.format(
        name=f"{name}_{count}",
        function=id(_BY_NAME[name]),
        no_value=id(_NO_VALUE),
        given=", ".join(f"double %x{i}" for i in places),
        made="".join(f"  %a{i} = call ptr @PyFloat_FromDouble(double %x{i})\n" for i in places),
        passed="".join(f"ptr %a{i}, " for i in places),
        released="".join(f"  call void @Py_DecRef(ptr %a{i})\n" for i in places),
        THREAD=THREAD,
    )


_DECLARED = f"""
@liemech_raised = external global [4 x ptr]
declare i32 @liemech_ensure()
declare void @liemech_release(i32)
declare void @liemech_fetch(ptr, ptr, ptr)
declare {THREAD} @liemech_thread()
declare ptr @PyFloat_FromDouble(double)
declare ptr @PyObject_CallFunctionObjArgs(ptr, ...)
declare double @PyFloat_AsDouble(ptr)
declare void @Py_DecRef(ptr)
declare ptr @PyErr_Occurred()
declare i32 @PyErr_ExceptionMatches(ptr)
declare void @PyErr_Clear()
"""

_DEFINED = """
define double @{name}({given}) {{
entry:
  %state = call i32 @liemech_ensure()
{made}  %function = inttoptr i64 {function} to ptr
  %result = call ptr (ptr, ...) @PyObject_CallFunctionObjArgs(ptr %function, {passed}ptr null)
  %there = icmp ne ptr %result, null
  br i1 %there, label %number, label %wrong
number:
  %value = call double @PyFloat_AsDouble(ptr %result)
  call void @Py_DecRef(ptr %result)
  %error = call ptr @PyErr_Occurred()
  %sound = icmp eq ptr %error, null
  br i1 %sound, label %end, label %wrong
wrong:
  %no_value = inttoptr i64 {no_value} to ptr
  %expected = call i32 @PyErr_ExceptionMatches(ptr %no_value)
  %known = icmp ne i32 %expected, 0
  br i1 %known, label %clear, label %hold
clear:
  call void @PyErr_Clear()
  br label %end
hold:
  %at_value = getelementptr [4 x ptr], ptr @liemech_raised, i64 0, i64 1
  %at_traceback = getelementptr [4 x ptr], ptr @liemech_raised, i64 0, i64 2
  %at_owner = getelementptr [4 x ptr], ptr @liemech_raised, i64 0, i64 3
  call void @liemech_fetch(ptr @liemech_raised, ptr %at_value, ptr %at_traceback)
  %thread = call {THREAD} @liemech_thread()
  %me = inttoptr {THREAD} %thread to ptr
  store volatile ptr %me, ptr %at_owner
  br label %end
end:
  %y = phi double [ %value, %number ], [ 0x7FF8000000000000, %clear ], [ 0x7FF8000000000000, %hold ]
{released}  call void @liemech_release(i32 %state)
  ret double %y
}}
"""
"""The value of a function of Python's; nan where it raises, which native code takes for a failure.
What says more than that there is no value, such as a warning that is an error, is held."""
