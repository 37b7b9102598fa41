"""Plans at work outside of `run`.

stepper.py: a run advanced by hand, with command_blocks.py between a controller and it.  export.py: its steps as C
code.  spread.py: an ensemble on many processes and machines.  measured_orders.py: the order of a method.
"""
