"""The motion inside of the steps.

dense.py       its states at any times
turning.py     how often a step is looked into, so that no zero is missed
events.py      zeros of functions of time and state
jump.py        jumps of the state at zeros; impact.py: by Newton's law of restitution
"""
