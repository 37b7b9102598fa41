"""Poisson structures that are ready.  One of your own is a subclass of `lm.PoissonStructure`."""

from .names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
