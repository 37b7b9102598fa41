"""The former name of `liemech.formulas`: what was imported from here still is."""

from .formulas import *  # noqa: F403
