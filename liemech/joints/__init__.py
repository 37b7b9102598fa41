"""Joints between rigid bodies, linkages of bodies, and contacts that roll or glide.

lm.joints.chain(12, mass=0.5, length=0.2)
"""

from ..names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
