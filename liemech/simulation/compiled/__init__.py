"""The part of a run that is compiled, and runs as plain Python too, with the same bits.

control.py: how long a step is, and which is the last.  driver.py: the loop that makes steps under a control.
lanes.py: bodies side by side, as columns of numbers.  execution.py: native code or plain Python.
prepared.py: layouts and native code that runs of one plan share.  systems.py, parameters.py: a system for each
body, and the numbers of a system by their names.
"""
