"""Time scales that are ready: how much time a unit of fictive time takes.  One of your own is a
subclass of `lm.TimeScale`, or a function.
"""

from .names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
