"""The motion inside of the steps: dense.py evaluates it at given times, events.py looks for zeros in it."""
