"""From a system, a method and a start to a trajectory: the loops over steps, their native code,
samples and diagnostics.
"""
