"""Vectors and matrices in memory as native code has them: loops over their numbers, and calls of BLAS
and LAPACK.

Every result has a piece of memory of its own, known while translating: what is found in a turn of a
loop is overwritten in the next one, and what the loop carries on is copied at the end of the turn.
"""

from __future__ import annotations

import contextlib
import hashlib
import operator
from collections.abc import Callable, Iterator
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.layouts import Layout
from ...formulas.large import TOGETHER, Large, size_of
from ...formulas.numbers.complex_numbers import Complex
from . import large_maps
from .counted import counted
from .ir_numbers import F64, I32, I64, Emitter, Num
from .lookups import constants

WIDE = 8
"""Numbers that are worked on side by side."""

TILE = 8
"""Rows and columns of the blocks in which a matrix is transposed, so that they stay in the cache."""

_INSTRUCTIONS = {operator.add: "fadd", operator.sub: "fsub", operator.mul: "fmul", operator.truediv: "fdiv"}  # fmt: skip
BYTE, POINTER = ir.IntType(8), F64.as_pointer()


class Deferred(Large):
    """An elementwise expression of vectors or matrices, evaluated when its place is first read."""

    __slots__ = ("_place", "engine", "node")
    _place: Any
    engine: LargeArrays
    node: tuple[Any, ...]

    @classmethod
    def made(cls, engine: LargeArrays, node: tuple[Any, ...], form: tuple[Any, ...]) -> Deferred:
        deferred = object.__new__(cls)
        deferred.shape, deferred.is_complex = form
        deferred.numbers, deferred._place, deferred.engine, deferred.node = None, None, engine, node
        return deferred

    @property
    def place(self) -> Any:
        if self._place is None:
            self._place = self.engine.computed(self.node, self.form)
        return self._place

    @property
    def _engine(self) -> Any:
        return self.engine


class LargeArrays:
    """Operations of native code on vectors and matrices in memory.

    used : the size of the memory so far, in numbers.  widest : that of the largest piece.  nested : the depth of the
    expression that is being translated, in which operators are deferred.
    """

    def __init__(self, emitter: Emitter) -> None:
        self.e, self.used, self.widest, self.nested = emitter, 0, 0, 0
        self.results: list[ir.Value] = []  # where results lie, which are not carried from turn to turn
        b = emitter.builder
        self.size, self.spare = ir.Constant(I64, 0), ir.Constant(I64, 0)
        self.raw = b.call(self._function("malloc", BYTE.as_pointer(), [I64]), [self.size])
        begin = b.add(b.ptrtoint(self.raw, I64), ir.Constant(I64, 63))
        self.begin = b.and_(begin, ir.Constant(I64, -64))
        self.blank = b.add(self.begin, self.spare)

    def finish(self) -> None:
        """Set the size of the memory, which is known now, and free it."""
        self.spare.constant = 8 * self.used
        self.size.constant = 8 * (self.used + self.widest) + 64
        free = self._function("free", ir.VoidType(), [BYTE.as_pointer()])
        self.e.builder.call(free, [self.raw])

    # ---------------------------------------------------------------- memory

    def allocate(self, count: int) -> Num:
        """The place of memory for `count` numbers."""
        at, self.used = self.used, self.used + -(-count // WIDE) * WIDE
        self.widest = max(self.widest, count)
        place = self.e.builder.add(self.begin, ir.Constant(I64, 8 * at))
        self.results.append(place)
        return self.e.num([place])

    def anywhere(self) -> Num:
        """A place that every vector and matrix fits into, for numbers that are never read."""
        return self.e.num([self.blank])

    def new(self, form: tuple[Any, ...]) -> Large:
        """A vector or matrix of this form in memory of its own."""
        return Large.at(self.allocate(size_of(form)), form)

    def stored(self, x: Any) -> Large:
        """A copy in memory of a vector that is written out."""
        memory = self.new(((len(x),), False))
        target = self.address(memory)
        for i, c in enumerate(x):
            self.store(self.e.cast(c, "f", False)[0], target, ir.Constant(I64, i))
        return memory

    def address(self, x: Large) -> ir.Value:
        """The address of the first number of a vector or matrix."""
        if x.numbers is not None:
            return constants(self.e, x.numbers.ravel(), F64)
        return self.e.builder.inttoptr(x.place.value, POINTER)

    def pointer(self, place: Num) -> ir.Value:
        return self.e.builder.inttoptr(place.value, POINTER)

    def copied(self, place: Num, form: tuple[Any, ...], to: Num | None = None) -> Num:
        """The numbers that lie at a place, in memory of their own or at another place."""
        to = self.allocate(size_of(form)) if to is None else to
        self.move(self.pointer(place), self.pointer(to), size_of(form))
        return to

    def copies_for_next_turn(self, moves: list[tuple[Num, Any]]) -> list[Num]:
        """The places of copies, at the end of a turn, of what a loop carries on, given by place and form.

        Carried memory may be the target of another copy: it is first copied out of the way.
        """
        at = [
            place if any(place.value is x for x in self.results) else self.copied(place, form) for place, form in moves
        ]
        return [self.copied(place, form) for place, (_, form) in zip(at, moves)]

    def move(self, source: ir.Value, target: ir.Value, count: int) -> None:
        """Copy `count` floats from source to target, by memmove."""
        move = self._function("memmove", BYTE.as_pointer(), [BYTE.as_pointer()] * 2 + [I64])
        b = self.e.builder
        pointers = [b.bitcast(x, BYTE.as_pointer()) for x in (target, source)]
        b.call(move, [*pointers, ir.Constant(I64, 8 * count)])

    def _function(self, name: str, result: ir.Type, arguments: list[ir.Type]) -> ir.Function:
        module = self.e.builder.module
        function = module.globals.get(name)
        if function is None:
            function = ir.Function(module, ir.FunctionType(result, arguments), name)
            function.attributes.add("nounwind")
        return function

    # ---------------------------------------------------------------- loops

    @contextlib.contextmanager
    def turns(self, count: int, step: int = 1) -> Iterator[ir.Value]:
        """A loop over 0, step, ... below count."""
        if count <= step:
            yield ir.Constant(I64, 0)
            return
        with self._range(ir.Constant(I64, 0), ir.Constant(I64, count), step) as i:
            yield i

    def wide(self, count: int, body: Callable[[ir.Value, int], None]) -> None:
        """A loop over numbers, `WIDE` at once, and the last ones one by one."""
        whole = count // WIDE * WIDE
        if whole:
            with self.turns(whole, WIDE) as i:
                body(i, WIDE)
        if count > whole:
            with self.turns(count - whole) as i:
                body(self.e.builder.add(i, ir.Constant(I64, whole)), 1)

    def load(self, first: ir.Value, i: ir.Value, width: int) -> ir.Value:
        b = self.e.builder
        type_ = F64 if width == 1 else ir.VectorType(F64, width)
        return b.load(b.gep(first, [i], source_etype=F64), typ=type_, align=8)

    def store(self, value: ir.Value, first: ir.Value, i: ir.Value) -> None:
        b = self.e.builder
        place = b.gep(first, [i], source_etype=F64)
        b.store(value, b.bitcast(place, value.type.as_pointer()), align=8)

    # ---------------------------------------------------------------- number by number

    def by_numbers(self, op: Any, a: Any, b: Any) -> Large:
        """The result of an operator, number by number."""
        form = next(x.form for x in (a, b) if isinstance(x, Large))
        deferred = Deferred.made(self, (_INSTRUCTIONS[op], self._operand(a), self._operand(b)), form)
        if not self.nested:
            deferred.place  # noqa: B018
        return deferred

    @contextlib.contextmanager
    def deferring(self, nested: bool) -> Iterator[None]:
        """Inside, operators are deferred if they are nested in an expression."""
        before, self.nested = self.nested, self.nested + 1 if nested else 0
        try:
            yield
        finally:
            self.nested = before

    def _operand(self, x: Any) -> Any:
        if isinstance(x, Deferred) and x._place is None:
            return x.node
        if isinstance(x, Large):
            return x
        if isinstance(x, (int, float, Num)):
            return self.e.num(self.e.cast(x, "f", False))
        return self.stored(x) if any(isinstance(c, Num) for c in x) else Large(x)

    def absolute(self, a: Large) -> Large:
        """The absolute values |a_i|, number by number."""
        return Large.at(self.computed(("abs", a), a.form), a.form)

    def computed(self, node: tuple[Any, ...], form: tuple[Any, ...]) -> Num:
        """The place of the values of an expression, evaluated number by number."""
        place = self.allocate(size_of(form))
        leaves: dict[int, ir.Value] = {}
        pattern = self._pattern(node, leaves)

        def body(target: ir.Value, *inputs: ir.Value) -> None:
            sources = dict(zip(leaves, inputs))
            self.wide(size_of(form), lambda i, width: self.store(self._value(node, sources, i, width, {}), target, i))

        self.outlined((pattern, size_of(form)), [self.pointer(place), *leaves.values()], body)
        return place

    def _pattern(self, node: Any, leaves: dict[int, ir.Value]) -> Any:
        """The form of an expression; its leaves, addresses and numbers, are added to `leaves`."""
        if isinstance(node, tuple):
            return node[0], *[self._pattern(x, leaves) for x in node[1:]]
        if id(node) not in leaves:
            leaves[id(node)] = self.address(node) if isinstance(node, Large) else node.value
        return [*leaves].index(id(node)), isinstance(node, Large)

    def outlined(
        self,
        key: tuple[Any, ...],
        values: list[ir.Value],
        body: Callable[..., ir.Value | None],
        result: ir.Type | None = None,
    ) -> ir.Value:
        """The result of a call of a native function, made once for all places with this key, so that code stays short.

        body : emits its code, and returns its result from its parameters.
        """
        b = self.e.builder
        name = f"large.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}"
        function = b.module.globals.get(name)
        if function is None:
            kind = ir.FunctionType(result or ir.VoidType(), [v.type for v in values])
            function = ir.Function(b.module, kind, name)
            function.linkage = "internal"
            for attribute in ("noinline", "nounwind"):
                function.attributes.add(attribute)
            with b.inside(function, False):
                b.position_at_end(function.append_basic_block("entry"))
                returned = body(*function.args)
                b.ret_void() if returned is None else b.ret(returned)
        return b.call(function, values)

    def result(self, form: tuple[Any, ...], key: tuple[Any, ...], body: Callable[..., None], *of: Large) -> Large:
        """A vector or matrix of this form, which a native function of its own makes of others.

        body : emits its code, of their addresses and that of the result.
        """
        memory = self.new(form)
        self.outlined(key, [self.address(x) for x in (*of, memory)], body)
        return memory

    def _value(
        self, node: Any, sources: dict[int, ir.Value], i: ir.Value, width: int, computed: dict[int, Any]
    ) -> ir.Value:
        if id(node) not in computed:
            b = self.e.builder
            if isinstance(node, Large):
                computed[id(node)] = self.load(sources[id(node)], i, width)
            elif isinstance(node, Num):
                computed[id(node)] = self.e.spread(sources[id(node)], width)
            else:
                parts = [self._value(x, sources, i, width, computed) for x in node[1:]]
                if node[0] == "abs":
                    type_ = parts[0].type
                    name = "llvm.fabs.f64" if width == 1 else f"llvm.fabs.v{width}f64"
                    computed[id(node)] = b.call(self._function(name, type_, [type_]), parts)
                else:
                    computed[id(node)] = getattr(b, node[0])(*parts)
        return computed[id(node)]

    # ---------------------------------------------------------------- sums

    def inner(self, a: Large, b: Large) -> Num:
        """The sum of the products of numbers, in the order of `formulas.large.total`."""
        build = self.e.builder

        def product(i: ir.Value, w: int, first: ir.Value, second: ir.Value) -> ir.Value:
            return build.fmul(self.load(first, i, w), self.load(second, i, w))

        return self._sum("inner", product, a, b)

    def distance2(self, a: Large, b: Large) -> Num:
        """The sum of squared differences."""
        build = self.e.builder

        def square(i: ir.Value, w: int, first: ir.Value, second: ir.Value) -> ir.Value:
            difference = build.fsub(self.load(first, i, w), self.load(second, i, w))
            return build.fmul(difference, difference)

        return self._sum("distance", square, a, b)

    def sum(self, a: Large) -> Num:
        """The sum of all numbers."""
        return self._sum("sum", lambda i, w, first: self.load(first, i, w), a)

    def _sum(self, name: str, term: Callable[..., ir.Value], *of: Large) -> Num:
        """The sum of terms, each a function of the numbers at one index of some vectors."""
        count = of[0].size

        def body(*places: ir.Value) -> ir.Value:
            return self._summed(count, lambda i, w: term(i, w, *places))

        addresses = [self.address(x) for x in of]
        return self.e.num([self.outlined((name, count), addresses, body, F64)])

    def _summed(self, count: int, term: Callable[[ir.Value, int], ir.Value]) -> ir.Value:
        b = self.e.builder
        whole, total = count // TOGETHER * TOGETHER, ir.Constant(F64, 0.0)
        if whole:
            places = range(0, TOGETHER, WIDE)
            sums = [term(ir.Constant(I64, k), WIDE) for k in places]
            if whole > TOGETHER:
                with counted(b, I64(TOGETHER), I64(whole), TOGETHER, sums) as turn:
                    terms_of_turn = [term(b.add(turn.index, I64(k)), WIDE) for k in places]
                    turn.values = [*map(b.fadd, turn.values, terms_of_turn)]
                sums = turn.values
            numbers = [b.extract_element(s, I32(k)) for s in sums for k in range(WIDE)]
            while len(numbers) > 1:  # by halves
                half = len(numbers) // 2
                numbers = [*map(b.fadd, numbers[:half], numbers[half:])]
            total = numbers[0]
        for k in range(whole, count):
            total = b.fadd(total, term(ir.Constant(I64, k), 1))
        return total

    # ---------------------------------------------------------------- matrices

    def product(self, a: Large, b: Large) -> Large:
        """A B, by BLAS: stored by columns, B^T A^T."""
        key, form = ("product", a.form, b.form), ((a.shape[0], b.shape[1]), a.is_complex)
        return self.result(form, key, lambda *places: self._multiply(a, b, *places), a, b)

    def _multiply(self, a: Large, b: Large, left: ir.Value, right: ir.Value, target: ir.Value) -> None:
        (m, k), n = a.shape, b.shape[1]
        kind = "z" if a.is_complex else "d"
        no, sizes = self._constant_argument(BYTE, ord("N")), [self._constant_argument(I32, x) for x in (n, m, k)]
        unit, zero = (constants(self.e, [x, 0.0], F64) for x in (1.0, 0.0))
        self._call(
            f"{kind}gemm", no, no, *sizes, unit, right, sizes[0], left, sizes[2], zero, target, sizes[0],
        )  # fmt: skip

    def over(self, b: Large, a: Large) -> Large:
        """B A^-1, by LAPACK; nan if A is singular."""
        build, n, m = self.e.builder, len(a), len(b)
        quotient, factors = self.new(b.form), self.new(a.form)
        for source, target in ((b, quotient), (a, factors)):
            self.move(self.address(source), self.address(target), source.size)
        pivots, kind = self.allocate(n), "z" if a.is_complex else "d"
        with build.goto_entry_block():
            info = build.alloca(I32)
        build.store(ir.Constant(I32, 0), info)
        sizes = [self._constant_argument(I32, x) for x in (n, m)]
        self._call(
            f"{kind}gesv", *sizes, self.address(factors), sizes[0], self.pointer(pivots),
            self.address(quotient), sizes[0], info,
        )  # fmt: skip
        singular = build.icmp_signed("!=", build.load(info, typ=I32), ir.Constant(I32, 0))
        with build.if_then(singular):
            nan, target = self.e.constant(float("nan")).value, self.address(quotient)
            self.wide(quotient.size, lambda i, w: self.store(self.e.spread(nan, w), target, i))
        return quotient

    def determinant(self, a: Large) -> Any:
        """det A, the product of LAPACK's pivots."""
        result = self.allocate(2)
        factors, pivots = self.new(a.form), self.allocate(len(a))
        places = [self.address(a), self.address(factors), self.pointer(pivots), self.pointer(result)]
        self.outlined(("determinant", a.form), places, lambda *given: self._pivots(a, *given))
        parts = [self.e.num([self.load(self.pointer(result), ir.Constant(I64, k), 1)]) for k in range(2)]
        return Complex(*parts) if a.is_complex else parts[0]

    def _pivots(self, a: Large, source: ir.Value, factors: ir.Value, pivots: ir.Value, both: ir.Value) -> None:
        b, n, width = self.e.builder, len(a), 2 if a.is_complex else 1
        self.move(source, factors, a.size)
        info, size = b.alloca(I32), self._constant_argument(I32, n)
        self._call(f"{'z' if a.is_complex else 'd'}getrf", size, size, factors, size, pivots, info)
        zero, unit = (ir.Constant(I64, k) for k in (0, 1))
        for k, value in ((zero, 1.0), (unit, 0.0)):
            self.store(ir.Constant(F64, value), both, k)
        with self._range(zero, ir.Constant(I64, n)) as k:
            at = b.load(b.gep(b.bitcast(pivots, I32.as_pointer()), [k], source_etype=I32), typ=I32)
            unmoved = b.icmp_signed("==", b.sext(at, I64), b.add(k, unit))
            s = b.select(unmoved, ir.Constant(F64, 1.0), ir.Constant(F64, -1.0))
            place = b.mul(k, ir.Constant(I64, width * (n + 1)))
            x = b.fmul(s, self.load(factors, place, 1))
            y = b.fmul(s, self.load(factors, b.add(place, unit), 1) if width == 2 else ir.Constant(F64, 0.0))
            re, im = self.load(both, zero, 1), self.load(both, unit, 1)
            self.store(b.fsub(b.fmul(re, x), b.fmul(im, y)), both, zero)
            self.store(b.fadd(b.fmul(re, y), b.fmul(im, x)), both, unit)

    def turned(self, a: Large, conjugate: bool) -> Large:
        """The transpose, of complex matrices perhaps of the conjugate, block by block."""
        key, form = ("turned", a.form, conjugate), (a.shape[::-1], a.is_complex)
        return self.result(form, key, lambda *places: self._turn(a, conjugate, *places), a)

    def _turn(self, a: Large, conjugate: bool, source: ir.Value, target: ir.Value) -> None:
        (m, n), parts = a.shape, 2 if a.is_complex else 1
        with self.turns(m, TILE) as i0, self.turns(n, TILE) as j0, self._until(i0, m) as i, self._until(j0, n) as j:
            x = self.load(source, self._place(i, j, n, parts), parts)
            self.store(self._conjugate(x) if conjugate else x, target, self._place(j, i, m, parts))

    def _place(self, i: ir.Value, j: ir.Value, columns: int, parts: int) -> ir.Value:
        """The index of the first number of entry (i, j) of a matrix with so many columns, whose entries have one or two."""
        b = self.e.builder
        at = b.add(b.mul(i, ir.Constant(I64, columns)), j)
        return b.mul(at, ir.Constant(I64, parts)) if parts > 1 else at

    def _conjugate(self, x: ir.Value) -> ir.Value:
        return self.e.builder.fmul(x, ir.Constant(ir.VectorType(F64, 2), [1.0, -1.0]))

    def without_adjoint(self, a: Large) -> Large:
        """A - A^H, an entry and its mirror image at a time, block by block."""
        return self.result(a.form, ("without adjoint", a.form), lambda *places: self._less_adjoint(a, *places), a)

    def _less_adjoint(self, a: Large, source: ir.Value, target: ir.Value) -> None:
        b, n, parts = self.e.builder, len(a), 2 if a.is_complex else 1

        def save(i: ir.Value, j: ir.Value, entry: ir.Value, mirror: ir.Value) -> None:
            difference = b.fsub(entry, self._conjugate(mirror) if a.is_complex else mirror)
            self.store(difference, target, self._place(i, j, n, parts))

        with self.turns(n) as i:
            diagonal = self.load(source, self._place(i, i, n, parts), parts)
            save(i, i, diagonal, diagonal)
        zero, unit = (ir.Constant(I64, x) for x in (0, 1))
        with (
            self.turns(n, TILE) as i0,
            self._range(zero, b.add(i0, unit), TILE) as j0,
            self._until(i0, n) as i,
            b.if_then(b.icmp_signed(">", i, j0)),
            self._until(j0, i) as j,
        ):
            x, y = (self.load(source, self._place(*at, n, parts), parts) for at in ((i, j), (j, i)))
            save(i, j, x, y)
            save(j, i, y, x)

    @contextlib.contextmanager
    def _range(self, begin: ir.Value, end: ir.Value, step: int = 1) -> Iterator[ir.Value]:
        """A loop over begin, begin + step, ... below a larger end."""
        with counted(self.e.builder, begin, end, step) as turn:
            yield turn.index

    @contextlib.contextmanager
    def _until(self, begin: ir.Value, count: int | ir.Value) -> Iterator[ir.Value]:
        """A loop over at most TILE indices from `begin` on, below `count`."""
        b = self.e.builder
        end: ir.Value = b.add(begin, ir.Constant(I64, TILE))
        most = ir.Constant(I64, count) if isinstance(count, int) else count
        end = b.select(b.icmp_signed("<", end, most), end, most)
        with self._range(begin, end) as i:
            yield i

    def plus(self, a: Large, s: Any) -> Large:
        """A + s 1 in new memory: s is added along the diagonal."""
        shifted, b = self.new(a.form), self.e.builder
        self.move(self.address(a), self.address(shifted), a.size)
        added, target = self.e.cast(s, "f", False)[0], self.address(shifted)
        step = (len(a) + 1) * (2 if a.is_complex else 1)
        with self.turns(len(a)) as i:
            at = b.mul(i, ir.Constant(I64, step))
            self.store(b.fadd(self.load(target, at, 1), added), target, at)
        return shifted

    mapped, along_diagonals = large_maps.mapped, large_maps.along_diagonals

    def entry(self, a: Large, index: Any) -> Any:
        """The number of a vector or matrix at a constant index."""
        indices = index if isinstance(index, tuple) else (index,)
        if len(indices) != a.axes or not all(isinstance(i, int) for i in indices):
            raise NotCompilable("an entry of a large vector or matrix by indices known at run time")
        at = 0
        for i, n in zip(indices, a.shape):
            at = at * n + i % n
        first = self.address(a)
        if not a.is_complex:
            return self.e.num([self.load(first, ir.Constant(I64, at), 1)])
        re_and_im = (self.load(first, ir.Constant(I64, 2 * at + k), 1) for k in (0, 1))
        return Complex(*[self.e.num([x]) for x in re_and_im])

    # ---------------------------------------------------------------- calls

    def _constant_argument(self, type_: ir.Type, value: int) -> ir.Value:
        """The address of a constant, as routines of BLAS and LAPACK take their arguments."""
        module, name = self.e.builder.module, f"told.{type_}.{value}"
        variable = module.globals.get(name)
        if variable is None:
            variable = ir.GlobalVariable(module, type_, name)
            variable.global_constant, variable.linkage = True, "internal"
            variable.initializer = ir.Constant(type_, value)
        return variable

    def _call(self, routine: str, *arguments: ir.Value) -> None:
        b, byte = self.e.builder, BYTE.as_pointer()
        function = self._function(f"liemech_{routine}", ir.VoidType(), [byte] * len(arguments))
        b.call(function, [b.bitcast(x, byte) for x in arguments])


# ------------------------------------------------------------------ layouts


def spans(layout: Layout, at: int = 0) -> Iterator[tuple[str, int, Any]]:
    """The numbers of a layout, and the arrays in memory as a whole: kind, place among the numbers of the
    layout, and form of each.
    """
    if layout.kind == "large":
        yield "large", at, layout.detail
    elif layout.parts:
        for part in layout.parts:
            yield from spans(part, at)
            at += part.width
    elif layout.width:
        yield layout.kind, at, layout.detail


def in_places(layout: Layout) -> Layout:
    """The layout of the same value in native code, which knows places only."""
    if not layout.in_memory:
        return layout
    if layout.kind == "large":
        return Layout("place", (), layout.detail)
    return Layout(layout.kind, tuple(map(in_places, layout.parts)), layout.detail)
