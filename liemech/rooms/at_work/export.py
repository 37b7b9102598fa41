"""C code of a plan: an object file, a header that says how the state lies in memory, and an example."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

from ...compiler import kernel
from ...errors import IncompatibleSystem, InvalidInput, InvalidType, NotCompilable
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import Layout, gatherer, layout_of, leaves
from ...formulas.tables import Table
from ...simulation.compiled.control import CLOCK, FRESH, GOAL, MARK, STRAIGHT, TAKEN, TIME
from ...simulation.compiled.parameters import Input, full_name
from ...simulation.compiled.prepared import RunShape
from ...simulation.runs.short import ENDLESS
from ...systems.system import State

WORDS = 9
"""Words of the arguments of steps, before the constants; those of the beginning are the last 7."""


@frozen(eq=False)
class Exported:
    """The files that `Plan.export` has written.

    object, header, example : the files.  bound : what a step does at most, in operations; None if a
    step may take any number of turns, as where an equation is solved.  platform, processor : that it
    is for.
    """

    object: Path
    header: Path
    example: Path
    bound: Any
    platform: str
    processor: str


def export(plan: Any, path: str | os.PathLike[str], start: Any, inputs: Any, target: str | None) -> Exported:
    """Write the files; `Plan.export` says what they are."""
    path = Path(path)
    name = path.name
    if not re.fullmatch(r"[A-Za-z_]\w*", name):
        raise InvalidInput(f"Plan.export: {name!r} is no name in C")
    if why := kernel.available():
        raise NotCompilable(f"Plan.export: {why}")
    from ...compiler.machine.object_files import is_taken, object_file

    if is_taken(name):
        raise InvalidInput(f"Plan.export: {name!r} has a meaning in C or C++ already; take a name such as '{name}_run'")

    shape, start = laid_out(plan, start)
    if shape.layout.in_memory:
        raise IncompatibleSystem(
            f"Plan.export: the code of {plan.system!r} calls BLAS and reads tables of this process, as "
            "that of all large matrices does"
        )
    steps = plan._steps
    lanes = shape.lanes_of(steps, STRAIGHT, (), shape.side)
    entry, *arguments = lanes.stepping.call
    kernels = {f"{name}_advance": kernel.translated(entry, *arguments)}
    if shape.order is None:
        beginning: Any = shape.beginning(steps, lanes)
        kernels[f"{name}_start"] = kernel.translated(*beginning.call)
    code, platform, processor, bound = object_file(kernels, target)
    named = {} if inputs is None else inputs_of(plan, inputs)
    text = Header(name, plan, shape, lanes, named, bound, platform, processor)
    machine_code, header, example = (path.with_name(name + end) for end in (".o", ".h", "_example.c"))
    machine_code.write_bytes(code)
    header.write_text(text.header(), encoding="utf-8")
    example.write_text(text.example(start), encoding="utf-8")
    return Exported(machine_code, header, example, bound, platform, processor)


def laid_out(plan: Any, start: Any) -> tuple[RunShape, Any]:
    """The layouts of runs from a start; without one those of the only kind that the plan has made."""
    if plan.adaptive or plan.fictive or isinstance(plan._steps.h, tuple) or plan.of_each:
        raise IncompatibleSystem(
            "Plan.export is of one system with fixed steps in time; give the plan an h, and no tolerances"
        )
    if plan._sites is not None:
        raise IncompatibleSystem("Plan.export is of few bodies, not of systems of many sites")
    if plan.events or plan.recorder is not None:
        raise IncompatibleSystem("Plan.export: C code has no events and records the state")
    if start is None:
        shapes = [x for (_, side), x in [*plan._steps.shapes.items()] if side == 0]
        if len(shapes) != 1:
            raise InvalidInput(
                "Plan.export: give start=, a state that says what the state in C has, such as system.state(...)"
            )
        return shapes[0], None
    if not isinstance(start, State) or start.bodies is not None:
        raise InvalidType(f"Plan.export: start is the state of one body; got {start!r}")
    shape = plan.begin(start).shape
    return shape, start


def inputs_of(plan: Any, names: Any) -> dict[str, Input]:
    """The inputs by their names in C."""
    from ...compiler.machine.object_files import WORDS

    if isinstance(names, str) or not all(isinstance(x, str) for x in names):
        raise InvalidType(f"Plan.export: inputs are names such as ['torque']; got {names!r}")
    inputs: dict[str, Input] = {}
    for name in names:
        full = full_name(plan.system, name, "Plan.export")
        entry = Input(plan.system, full, "Plan.export")
        if entry.places is None:
            raise InvalidInput(
                f"Plan.export: other numbers of the system follow from {full}, or it is checked when a "
                "system is made, so it is no input of C code; a field that formulas read as it is can be "
                "one"
            )
        if "table" in entry.layout.kinds:
            raise InvalidInput(f"Plan.export: {full} is a table, which is a constant of C code")
        short = re.sub(r"\W", "_", name)
        if short in WORDS.split():
            raise InvalidInput(f"Plan.export: the input {short} has a meaning in C or C++ already; rename the field")
        if short in inputs:
            raise InvalidInput(f"Plan.export: two inputs are called {short}")
        inputs[short] = entry
    return inputs


class Header:
    """The texts of the header and of the example."""

    def __init__(
        self, name: str, plan: Any, shape: RunShape, lanes: Any, inputs: dict[str, Input],
        bound: Any, platform: str, processor: str,
    ) -> None:  # fmt: skip
        self.name, self.plan, self.shape, self.lanes, self.inputs = name, plan, shape, lanes, inputs
        self.bound, self.platform, self.processor = bound, platform, processor
        self.h = float(plan._steps.h)
        things = lanes.arguments[:3]
        self.numbers = [x for thing in things for x in leaves(thing, layout_of(thing))]
        self.kinds = [kind for thing in things for kind in layout_of(thing).kinds]
        self.first = layout_of(things[0]).width  # number of the system

    def header(self) -> str:
        """The text of the header file: types, functions and constants of the run."""
        name, carried, shown = self.name, self.shape.layout.width, self.shape.shown
        tables = {i: Table.at(x) for i, (x, kind) in enumerate(zip(self.numbers, self.kinds))
                  if kind == "table"}  # fmt: skip
        constants = ["0.0" if i in tables else real(x) for i, x in enumerate(self.numbers)]
        lines = [
            f"/* {name}: {comment(repr(self.plan.method))} in steps of h = {self.h!r} s.",
            f"   System: {comment(repr(self.plan.system))}",
            f"   Written by liemech for {self.platform}, {self.processor}; link {name}.o and -lm.",
            "",
            *[f"   {x}" for x in self._bound()],
            "",
            "   No memory is allocated, nothing is shared: each run is a struct of its own, and may be",
            "   copied.  The numbers of a run are those of the library, to the bit, where the C library is",
            "   the one that Python has. */",
            f"#ifndef {name.upper()}_H",
            f"#define {name.upper()}_H",
            "#include <math.h>",
            "#include <stdint.h>",
            "#include <string.h>",
            "",
            "/* The state, as `start` gives it and every step leaves it. */",
            "typedef struct {",
            *[f"  {line}" for line in members(shown)],
            f"}} {name}_state;",
            "",
        ]
        if self.inputs:
            lines += [
                "/* What may change between steps: fields of the system. */",
                "typedef struct {",
                *[f"  double {short}{dimensions(entry)};  /* {entry.name} */" for short, entry in self.inputs.items()],
                f"}} {name}_inputs;",
                "",
            ]
        argument = f", const {name}_inputs *inputs" if self.inputs else ""
        lines += [
            "/* A run: the arguments of native code, what the method carries along, its clock, its goal",
            "   and the state. */",
            "typedef struct {",
            f"  int64_t words[{WORDS}];",
            f"  double constants[{max(1, len(constants))}];",
            f"  double carried[{max(1, carried)}];",
            f"  double clock[{CLOCK.width}];",
            f"  double goal[{GOAL.width}];",
            f"  {name}_state state;",
            f"}} {name};",
            "",
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            f"void {name}_advance(void *words);",
            *([f"void {name}_start(void *words);"] if self.shape.order is None else []),
            "#ifdef __cplusplus",
            "}",
            "#endif",
            "",
        ]
        for i, table in tables.items():
            rows = wrapped([real(x) for x in table.array.tolist()])
            lines += [f"static const double {name}_table_{i}[] = {{", *rows, "};"]
        lines += [
            f"static const double {name}_constants[] = {{",
            *wrapped(constants or ["0.0"]),
            "};",
            "",
            *self._begin(tables, argument),
            *self._step(argument),
            "/* The time, t0 + n h after n steps, in s. */",
            f"static inline double {name}_time(const {name} *run) {{ return run->clock[{TIME}]; }}",
            "#endif",
        ]
        return "\n".join(lines) + "\n"

    def _bound(self) -> list[str]:
        """The bound on the operations of a step, as lines of the header."""
        if self.bound is None:
            return [
                f"No bound on the time of a step: {type(self.plan.method).__name__} or the formulas go on in loops",
                "until something is small enough, such as the rest of an equation.",
            ]
        b = self.bound
        return [
            f"A step does at most {b.instructions} operations of the processor (of LLVM, before they are laid",
            f"out), of which {b.arithmetic} are sums, products and comparisons, {b.divisions} divisions and square roots,",
            f"and calls the C library (sin, cos, ...) at most {b.calls} times; a call of {self.name}_step at most",
            f"{b.overhead} beside that of its steps.  There are no loops in a step.",
        ]

    def _begin(self, tables: dict[int, Table], argument: str) -> list[str]:
        name, order = self.name, self.shape.order
        clock = [real(x) for x in (0.0, self.h, *FRESH)]
        goal = [real(x) for x in (math.inf, 0.0, 0.0, 0.0, ENDLESS, 0.0)]
        lines = [
            "/* Begin at a state and a time; 0 if the method cannot begin there.",
            *(["   inputs: NULL leaves those of the system. */"] if argument else ["   */"]),
            f"static inline int {name}_begin({name} *run, const {name}_state *start{argument}, double t0) {{",
            f"  static const double clock[] = {{{', '.join(clock)}}};",
            f"  static const double goal[] = {{{', '.join(goal)}}};",
        ]
        if order is not None:
            lines += [
                f"  static const int from[] = {{{', '.join(map(str, order))}}};",
                "  const double *given = (const double *)start;",
                "  int i;",
            ]
        lines += [
            "  memset(run, 0, sizeof *run);",
            f"  memcpy(run->constants, {name}_constants, sizeof {name}_constants);",
            *[f"  run->constants[{i}] = (double)((uintptr_t){name}_table_{i} / 8);" for i in tables],
            "  memcpy(run->clock, clock, sizeof clock);",
            "  memcpy(run->goal, goal, sizeof goal);",
            f"  run->clock[{TIME}] = run->goal[5] = t0;",
            "  run->state = *start;",
        ]
        if argument:
            lines.append(f"  if (inputs) {name}_take(run, inputs);")
        if order is not None:
            lines += [
                f"  for (i = 0; i < {len(order)}; i++) run->carried[i] = from[i] < 0 ? 0.0 : given[from[i]];",
                "  return 1;",
            ]
        else:
            lines.append(f"  return {name}_restart(run);")
        before: list[str] = []
        if self.inputs:
            before += [f"static inline void {name}_take({name} *run, const {name}_inputs *inputs) {{"]
            for short, entry in self.inputs.items():
                source = f"&inputs->{short}"
                before += [
                    f"  memcpy(run->constants + {self.first + place}, {source}, sizeof inputs->{short});"
                    for place in entry.places or ()
                ]
            before += ["}", ""]
        if order is None:
            before += [
                "/* Let the method begin with the state of a run. */",
                f"static inline int {name}_restart({name} *run) {{",
                "  int64_t *words = run->words + 2;",
                "  words[0] = 1, words[1] = 0, words[2] = 1;",
                "  words[3] = (intptr_t)&run->state, words[4] = (intptr_t)run->clock;",
                "  words[5] = (intptr_t)run->carried, words[6] = (intptr_t)&run->state;",
                f"  run->clock[{MARK}] = 0.0;",
                f"  {name}_start(words);",
                f"  if (run->clock[{MARK}] == 0.0) return 1;",
                f"  run->clock[{MARK}] = 0.0;",
                "  return 0;",
                "}",
                "",
            ]
        return [*before, *lines, "}", ""]

    def _step(self, argument: str) -> list[str]:
        name = self.name
        again = self.shape.order is None
        take = f"  if (inputs) {name}_take(run, inputs);"
        if again:
            take = f"  if (inputs) {{ {name}_take(run, inputs); if (!{name}_restart(run)) return 0; }}"
        return [
            "/* Go on by so many steps; how many were made: fewer if one fails, before which the run stands.",
            *(["   inputs: NULL leaves them as they are. */"] if argument else ["   */"]),
            f"static inline int64_t {name}_step({name} *run{argument}, int64_t steps) {{",
            f"  const double before = run->clock[{TAKEN}];",
            *([take] if argument else []),
            "  run->words[0] = 1, run->words[1] = 0, run->words[2] = 1;",
            "  run->words[3] = 1, run->words[4] = steps;",
            "  run->words[5] = (intptr_t)run->goal, run->words[6] = (intptr_t)run->carried;",
            "  run->words[7] = (intptr_t)run->clock, run->words[8] = (intptr_t)&run->state;",
            f"  {name}_advance(run->words);",
            f"  run->clock[{MARK}] = 0.0;",
            f"  return (int64_t)(run->clock[{TAKEN}] - before);",
            "}",
            "",
        ]

    # ---------------------------------------------------------------- the example

    def example(self, start: Any) -> str:
        """A program that makes steps and prints the time and the numbers of the state, 17 digits each."""
        name, width = self.name, self.shape.shown.width
        numbers = [0.0] * width if start is None else gatherer(self.shape.given)(start)
        argument = "&inputs, " if self.inputs else ""
        lines = [
            f"/* cc {name}_example.c {name}.o -lm -o {name} && ./{name} 10 5 */",
            "#include <stdio.h>",
            "#include <stdlib.h>",
            f'#include "{name}.h"',
            "",
            "/* The first argument: how often to print; the second: steps between. */",
            "int main(int count, char **words) {",
            "  const int rows = count > 1 ? atoi(words[1]) : 10, every = count > 2 ? atoi(words[2]) : 1;",
            f"  static const double numbers[{width}] = {{",
            *wrapped([real(x) for x in numbers], "    "),
            "  };",
            f"  {name}_state start;",
            f"  {name} run;",
            "  const double *shown = (const double *)&run.state;",
            "  int row, i;",
        ]
        if self.inputs:
            lines.append(f"  {name}_inputs inputs;")
        lines.append("  memcpy(&start, numbers, sizeof start);")
        for short, entry in self.inputs.items():
            place = self.first + (entry.places or (0,))[0]
            lines.append(f"  memcpy(&inputs.{short}, {name}_constants + {place}, sizeof inputs.{short});")
        lines += [
            f"  if (!{name}_begin(&run, &start, {argument}0.0)) return 1;",
            "  for (row = 0; row <= rows; row++) {",
            *(["    /* NULL: inputs as they are; or &inputs, with a new command in it */"] if argument else []),
            f"    if (row && {name}_step(&run, {'NULL, ' if argument else ''}every) != every) return 2;",
            f'    printf("%.17g", {name}_time(&run));',
            f'    for (i = 0; i < {width}; i++) printf(" %.17g", shown[i]);',
            '    printf("\\n");',
            "  }",
            "  return 0;",
            "}",
        ]
        return "\n".join(lines) + "\n"


def members(shown: Layout) -> list[str]:
    """The parts of a state in C, in the order in which they lie in memory."""
    lines: list[str] = []
    place = 0
    for part, layout in zip(shown.detail[1], shown.parts, strict=True):
        if not layout.width:
            continue
        size = f"[{layout.width}]"
        if layout.kind == "mat":
            size = f"[{len(layout.parts)}][{layout.width // len(layout.parts)}]"
        elif layout.kind == "number":
            size = ""
        lines.append(f"double {part}{size};  /* numbers {place} to {place + layout.width - 1} */")
        place += layout.width
    return lines


def dimensions(entry: Input) -> str:
    """The shape of an input as C writes it behind a name."""
    shape = (entry.width,) if entry.shape is None else entry.shape
    return "".join(f"[{n}]" for n in shape)


def real(x: float) -> str:
    """A literal of a double in C, in hexadecimal digits, so that no bit is lost."""
    if math.isnan(x):
        return "NAN"
    if math.isinf(x):
        return "INFINITY" if x > 0.0 else "-INFINITY"
    return float(x).hex()


def wrapped(items: list[str], margin: str = "  ") -> list[str]:
    """Lines of an initialiser in C, four items each."""
    return [margin + ", ".join(items[i : i + 4]) + "," for i in range(0, len(items), 4)]


def comment(text: str) -> str:
    """A text inside of a comment in C."""
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())[:300]
