"""Coordinates: canonical ones of Poisson structures, local ones of submanifolds, and changes between
canonical ones.
"""

from .names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
