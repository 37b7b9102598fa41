"""Machine code and its company: LLVM, object files, Ctrl-C, guard words."""
