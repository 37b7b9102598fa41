"""Plans at work outside of `run`.

stepper.py            a run that is advanced by hand: for control loops, filters and live pictures
command_blocks.py     holds, latencies, limits between a controller and a stepper; a command that changes evenly
export.py             the steps as C code
spread.py             an ensemble on many processes and machines
measured_orders.py    the order of a method, measured
"""
