"""Formulas to machine code.

The compiler knows what formulas are made of and nothing of mechanics; only `llvm` knows LLVM's
binding.  Its files, in the order in which a formula comes through them:

* kernel, driver, buffers: native code for a driver; kept: what a process keeps of it between calls.
* changes/: what a formula reads from outside, and whether that has changed (dependencies, content_hashes, staleness);
  object code on disk (cache); words of memory that change with code (words).
* translation/: a driver as a module of LLVM (module); the syntax tree (source), walked with numbers of the run in place of
  floats (translator, statements, expressions, loops, branches, joins, scopes); which calls become functions (inlining,
  call_forms, native_functions); where the translation is, and snapshots (state); a cure for what is refused (advice);
  lists with two names (aliases), `zip` and its kin (iterators), how many instructions there are (instructions).
* numbers/: the numbers (ir_numbers), and many of them: arrays, tables (lookups), loops over memory (memory_loops, counted,
  large_arrays, large_maps), blocks of matrices (square_blocks, rows_of_blocks, rows_in_lanes); python_functions.
* sites/: loops over the sites of one system (loops_over_sites), in passes (fission) between their meetings (meetings);
  numbers of sites in rows (planes, memory); sums over all pairs of them (all_pairs, rounds), on threads (barriers); calls
  (site_calls).
* machine/: LLVM, object files, Ctrl-C, guard words.
* batch, one_row, row_driver: formulas on many arguments at once, on one, and drivers of an array of numbers.
"""

import time

IMPORTED = time.time()
"""When these files were read: what is edited later is not what runs."""
