"""Formulas to machine code: source, translation, control flow, the numbers of native code, buffers,
reads, cache, kernels.

It knows what formulas are made of and nothing of mechanics; only `llvm` knows LLVM's binding.
"""

import time

IMPORTED = time.time()
"""When these files were read: what is edited later is not what runs."""
