"""The processors, of three generations, that code can be made for and run here.

python tests/compiler/processors.py    prints their names, as .ci/run asks for them
"""

from __future__ import annotations

import os
import sys
from unittest import mock

from liemech.compiler.machine import llvm
from liemech.errors import InvalidInput

AMONG = "x86-64", "x86-64-v3", "x86-64-v4"
processor_for = llvm.processor.__wrapped__


def available(name: str) -> bool:
    """Can code for this processor run here?"""
    with mock.patch.dict(os.environ, LIEMECH_CPU=name):
        try:
            return bool(processor_for()[0] == name)
        except InvalidInput:
            return False


if __name__ == "__main__":
    print("this processor:", llvm.processor()[0], file=sys.stderr)
    for name in AMONG:
        if available(name):
            print(name)
        else:
            print(f"code for {name}: this processor cannot run it", file=sys.stderr)
