"""Functions on a group that are constant on conjugacy classes: what generating functions of the first
kind start from.
"""

from .names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
