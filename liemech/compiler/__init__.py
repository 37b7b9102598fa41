"""Formulas to machine code: source, translation, control flow, the numbers of native code, buffers, cache, kernels.

It knows what formulas are made of and nothing of mechanics; only `kernel` knows LLVM's binding.
"""
