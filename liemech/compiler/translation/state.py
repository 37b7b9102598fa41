"""The state of a translation, and snapshots of it: a piece of a formula may be translated in one way,
taken back and translated in another.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from ...formulas.classes.taken_back import back
from .iterators import Region

if TYPE_CHECKING:
    from .joins import Open
    from .scopes import Env

HUGE = 3000
"""Formulas of more instructions are never written out in the native function of a formula."""


@dataclasses.dataclass(eq=False)
class TranslationState:
    """The state of the translation of one native function."""

    base: Any = None  # the mask of lanes for which the present code was entered; None for all
    since: float = math.inf  # before linear forms that are made where some lanes may rest
    depth: int = 0  # conditions around it, in the present call, that differ between lanes
    region: Region = ()  # the branches and loops of unknown length around
    # of attempts: for each that is around it, the places from where control goes to its end
    escapes: list[list[Open]] = dataclasses.field(default_factory=list)
    failed: Any = None  # the slot of the lanes that have raised in the present one
    raises: int = 0  # places so far in it where a formula may raise
    marks: int = 0  # those among them where control goes on
    outcome: Any = None  # of the last one that has ended
    # of inlining: the instructions that calls have cost, by form
    spent: list[tuple[Any, int]] = dataclasses.field(default_factory=list)
    patience: int = 1  # the factor of LONG
    huge: int = dataclasses.field(default_factory=lambda: HUGE)  # instructions from which a formula is not written out
    # the counts of instructions at which the formulas begin that are being written out
    begun: list[int] = dataclasses.field(default_factory=list)
    site_loop: Any = None  # the loop over sites that is being translated

    def of_function(self, copied: bool) -> TranslationState:
        """The state in which the translation of another native function begins.  copied : it is one
        that LLVM copies, which counts as written out here.
        """
        if not copied:
            return TranslationState(region=self.region)
        return TranslationState(region=self.region, patience=self.patience, huge=self.huge, begun=self.begun)


class Snapshot:
    """A point of a translation, with the variables there."""

    def __init__(self, translator: Any, env: Env) -> None:
        b, state, frame = translator.builder, translator.state, translator.frames[-1]
        self.translator, self.block, self.emitted = translator, b.block, b.emitted
        loops = [state.site_loop] if state.site_loop is not None else []
        memory = [translator.emitter.large] if translator.emitter.large is not None else []
        self.attributes = [(x, vars(x).copy()) for x in (state, frame, *loops, *memory)]
        self.env, self.variables = env, dict(env)
        grow = translator.frames, frame.loops, frame.returns, state.escapes, state.spent
        code = b.function.blocks, b.block.instructions
        passes = [items for loop in loops for items in (loop.passes, loop.loops)]
        self.lengths = [(items, len(items)) for items in (*grow, *state.escapes, *code, *passes)]
        self.streams = [(stream, stream.taken, stream.region) for stream in translator.streams]
        self.take_back = back()

    def restore(self) -> None:
        """Take back all code since this point, and restore the state and the variables."""
        self.take_back()
        for items, length in self.lengths:
            del items[length:]
        for x, before in self.attributes:
            vars(x).update(before)
        self.env.clear()
        self.env.update(self.variables)
        for stream, taken, region in self.streams:
            stream.back_to(taken, region)
        b = self.translator.builder
        self.block.terminator, b.emitted = None, self.emitted
        b.position_at_end(self.block)
