"""Formulas to machine code.

The compiler knows what formulas are made of and nothing of mechanics; only `llvm` knows LLVM's
binding.  Its files, in the order in which a formula comes through them:

* kernel, driver, buffers: native code for a driver, kept while what it has read is unchanged.
* source, dependencies, content_hashes, staleness: the text of a formula, what it reads from
  outside, and whether that has changed.  cache: object code on disk.
* translation, statements, expressions, loops, branches, joins, scopes, iterators, aliases: the
  syntax tree, translated with numbers of the run in place of floats.  state: where the translation
  is, and snapshots.  advice: a cure for what is refused.
* ir_numbers, arrays, python_functions, memory_loops, lookups: the numbers and what is done to them.
* inlining, call_forms, native_functions, instructions: which calls become functions of their own.
* llvm, callbacks, interrupts, stop_checks, gc_pause, guard_words: machine code and its company.
* batch: formulas on many arguments at once.
"""

import time

IMPORTED = time.time()
"""When these files were read: what is edited later is not what runs."""
