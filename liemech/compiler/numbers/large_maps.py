"""Linear maps between large vectors and matrices in native code: tables of coefficients, and equations along diagonals.

The tables lie in the memory of this process; `arrays` is the `LargeArrays` of the translation.
"""

from __future__ import annotations

import functools
from typing import Any

from llvmlite import ir

from ...formulas.large import Large, size_of
from ...formulas.large_maps import DiagonalSolver, LinearMap
from .counted import counted
from .ir_numbers import F64, I64


def mapped(arrays: Any, linear: LinearMap, x: Large) -> Large:
    """The image of a linear map."""
    return arrays.result(linear.target, ("_map", linear.content), functools.partial(_map, arrays, linear), x)


def along_diagonals(arrays: Any, solver: DiagonalSolver, x: Large) -> Large:
    """The solution of tridiagonal equations along the diagonals, row by row."""
    return arrays.result(x.form, ("_along", solver.content), functools.partial(_along, arrays, solver), x)


def _map(arrays: Any, linear: LinearMap, source: ir.Value, target: ir.Value) -> None:
    b, size = arrays.e.builder, size_of(linear.target)
    if sum(len(rows) for rows, *_ in linear.groups) < size:
        zero = ir.Constant(F64, 0.0)
        arrays.wide(size, lambda i, w: arrays.store(arrays.e.spread(zero, w), target, i))
    for k, (rows, coefficients, _) in enumerate(linear.groups):
        terms = coefficients.shape[1]
        places, factors, at = (_table(arrays, linear, k, part) for part in range(3))
        with arrays.turns(len(rows)) as i:
            first = b.mul(i, ir.Constant(I64, terms))
            total = _term(arrays, places, factors, source, first)
            if terms == 2:
                total = b.fadd(total, _term(arrays, places, factors, source, b.add(first, ir.Constant(I64, 1))))
            elif terms > 2:
                with counted(b, I64(1), I64(terms), values=[total]) as turn:
                    term = _term(arrays, places, factors, source, b.add(first, turn.index))
                    turn.values = [b.fadd(turn.values[0], term)]
                total = turn.values[0]
            arrays.store(total, target, _integer(arrays, at, i))


def _along(arrays: Any, solver: DiagonalSolver, source: ir.Value, target: ir.Value) -> None:
    b, n = arrays.e.builder, solver.shape[0]
    arrays.move(source, target, 2 * n * n)
    if solver.singular:
        _without_trace(arrays, target, n)
    down, up, inverse = (_global(arrays, solver.symbol(k), F64) for k in range(3))
    row, inner = ir.Constant(I64, 2 * n), 2 * (n - 1)

    def at(first: ir.Value, i: ir.Value, back: int = 0) -> ir.Value:
        return b.add(b.add(first, i), ir.Constant(I64, back))

    def eliminate(first: ir.Value, to: int, factor: ir.Value, other: int) -> None:
        """x_i - factor_i x_i+other for the numbers of a row from `to` on."""

        def body(i: ir.Value, w: int) -> None:
            index = at(first, i, to)
            product = b.fmul(
                arrays.load(factor, index, w), arrays.load(target, at(index, ir.Constant(I64, 0), other), w)
            )
            arrays.store(b.fsub(arrays.load(target, index, w), product), target, index)

        arrays.wide(inner, body)

    def scale(first: ir.Value) -> None:
        def body(i: ir.Value, w: int) -> None:
            index = at(first, i)
            value = b.fmul(arrays.load(target, index, w), arrays.load(inverse, index, w))
            arrays.store(value, target, index)

        arrays.wide(2 * n, body)

    with arrays.turns(n - 1) as j:
        eliminate(b.mul(b.add(j, ir.Constant(I64, 1)), row), 2, down, -2 * n - 2)
    scale(ir.Constant(I64, 2 * n * (n - 1)))
    with arrays.turns(n - 1) as j:
        first = b.mul(b.sub(ir.Constant(I64, n - 2), j), row)
        eliminate(first, 0, up, 2 * n + 2)
        scale(first)
    if solver.singular:
        _without_trace(arrays, target, n)


def _without_trace(arrays: Any, target: ir.Value, n: int) -> None:
    """Subtract from the main diagonal of a complex matrix its mean."""
    b = arrays.e.builder
    zero, step = ir.Constant(ir.VectorType(F64, 2), [0.0, 0.0]), I64(2 * n + 2)
    with counted(b, I64(0), I64(n), values=[zero]) as turn:
        turn.values = [b.fadd(turn.values[0], arrays.load(target, b.mul(turn.index, step), 2))]
    mean = b.fmul(turn.values[0], ir.Constant(zero.type, [1.0 / n] * 2))
    with arrays.turns(n) as k:
        at = b.mul(k, step)
        arrays.store(b.fsub(arrays.load(target, at, 2), mean), target, at)


def _term(arrays: Any, places: ir.Value, factors: ir.Value, source: ir.Value, at: ir.Value) -> ir.Value:
    b = arrays.e.builder
    return b.fmul(arrays.load(factors, at, 1), arrays.load(source, _integer(arrays, places, at), 1))


def _integer(arrays: Any, table: ir.Value, at: ir.Value) -> ir.Value:
    b = arrays.e.builder
    return b.load(b.gep(table, [at], source_etype=I64), typ=I64, align=8)


def _table(arrays: Any, linear: LinearMap, group: int, part: int) -> ir.Value:
    """A table of a linear map, which lies in the memory of this process: the places, the
    coefficients, the rows of a group.
    """
    return _global(arrays, linear.symbol(group, part), F64 if part == 1 else I64)


def _global(arrays: Any, name: str, type_: ir.Type) -> ir.Value:
    """A table in the memory of this process."""
    module = arrays.e.builder.module
    table = module.globals.get(name)
    if table is None:
        table = ir.GlobalVariable(module, type_, name)
        table.global_constant, table.linkage = True, "external"
    return table
