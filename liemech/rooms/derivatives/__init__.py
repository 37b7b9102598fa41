"""Derivatives of runs, of the discrete motion and exact up to rounding.

Forwards, numbers carry a slope through the steps as they stand (`Dual`), one run for each direction; `plan.tangent`:

    frames.py             directions in which states move, and components of changes along them
    directions.py         directions of a start, and of parameters of system and method: where slopes begin
    tangent_runs.py       which run it is: tangent.py of one body, through_events.py from jump to jump, of_sites/tangent.py
                          of many sites and of linkages

Backwards, J^T w goes through the run once, whatever the number of parameters; `plan.gradient` and `plan.pullback`:

    gradient.py           which run it is: of bodies, of bodies with events; losses.py: w, by the states at samples
    through_blocks.py     of bodies: Jacobians of blocks of steps, forwards; blocks.py: these as bodies of one ensemble
    of_sites/             of many sites and linkages: step by step, from states that are made again (reversal.py)
    steps_backwards.py    J^T w of one step, by its formulas (`formulas/numbers/transposes.py`) or by a rule; of steps of
                          linkages the rules are in `joints/in_memory`

By parameters: varied.py systems and methods whose numbers carry slopes; varied_input.py tables; differences.py what
follows from a parameter in Python.  bridges.py: runs as functions of JAX and PyTorch.
"""
