"""Parts of an energy whose flow is known by what they are.  One with a flow of your own is a subclass
of `lm.Part`.
"""

from .names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
