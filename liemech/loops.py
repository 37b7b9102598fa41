"""Blocks for control loops: what becomes of a command between a controller and `stepper.step`.

lm.loops.RateLimit(rate=2.0, period=0.01, first=[0.0, 0.0, 0.0])
"""

from .names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
