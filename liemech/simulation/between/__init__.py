"""The motion inside of the steps: dense.py evaluates it at given times, events.py looks for zeros in it, at which a
state may jump (jump.py, impact.py).
"""
