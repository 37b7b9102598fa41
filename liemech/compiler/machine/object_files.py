"""Object files for C: kernels that run without Python, and how much their steps do at most."""

from __future__ import annotations

import graphlib
import re
from collections.abc import Callable, Iterable

import numpy as np

from ...errors import NotCompilable
from ...formulas.classes.frozen import frozen
from ...formulas.functions import LIBM
from . import llvm
from .stop_checks import KEEPING, LOOK

_C = {f"liemech_{f.__name__}": f.__name__ for f in (*LIBM, pow)}
"""The functions of the C library by the names under which LLVM knows nothing about them."""

_ASKED = re.compile(r"liemech_((?:math|numpy)_\w+?)_[12](?!\w)")

_NEVER = f"\ndefine internal {KEEPING} i1 @look() {{\n  ret i1 false\n}}\n"
"""Nobody interrupts C code."""

_DECLARED = re.compile(r'^declare double @"(liemech_\w+)"\(([^)]*)\).*$', re.MULTILINE)


WORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while alignas alignof "
    "and and_eq asm bitand bitor bool catch class co_await co_return co_yield compl concept const_cast consteval constexpr "
    "constinit decltype delete dynamic_cast explicit export false friend mutable namespace new noexcept not not_eq nullptr "
    "operator or or_eq private protected public reinterpret_cast requires static_assert static_cast template this "
    "thread_local throw true try typeid typename typeof typeof_unqual using virtual xor xor_eq "
    "main linux unix FILE NULL EOF NAN INFINITY"
)
"""The keywords of C and C++, `main`, and what their headers define that is no function."""


def is_taken(name: str) -> bool:
    """Whether a name is a word of C or C++, or of their libraries."""
    return name in WORDS.split() or name.endswith("_t") or hasattr(llvm.c_library(), name)


def object_file(kernels: dict[str, str], target: str | None) -> tuple[bytes, str, str, Bound | None]:
    """Machine code of kernels, by the names that C calls them by, the platform and processor that it
    is for, and a bound on the steps of the first one, None if there is none.

    kernels : in LLVM's language.  target : None, "native", or LLVM's words for another platform.
    Raises NotCompilable for formulas that ask Python.
    """
    texts = [_alone(text, name) for name, text in kernels.items()]
    code, text, triple, processor = llvm.portable(texts, target)
    endless = '@"look"' in next(iter(kernels.values()))
    bound = None if endless else bound_of(text, next(iter(kernels)))
    return code, triple, processor, bound


def _alone(text: str, name: str) -> str:
    """A kernel that asks nothing but the C library."""
    python_calls = sorted({f.replace("_", ".", 1) for f in _ASKED.findall(text)})
    if python_calls:
        raise NotCompilable(
            f"Plan.export: formulas ask Python for {', '.join(python_calls)}, and C code runs without it; "
            "take the functions of liemech.formulas, which are those of the C library"
        )
    text = text.replace(LOOK, _NEVER)
    text = text.replace('define void @"loop"', 'define internal void @"loop"')
    text = text.replace('@"kernel"', f'@"{name}"')
    used_names: set[str] = set()

    def defined(match: re.Match[str]) -> str:
        inner, count = match[1], match[2].count("double")
        if inner not in _C:
            raise NotCompilable(f"Plan.export: native code needs {inner}, which C does not have")
        used_names.add(f"declare double @{_C[inner]}({', '.join(['double'] * count)})\n")
        parameters = ", ".join(f"double %x{i}" for i in range(count))
        return (
            f'define internal double @"{inner}"({parameters}) noinline nounwind {{\n'
            f"  %y = call double @{_C[inner]}({parameters}) nobuiltin\n  ret double %y\n}}"
        )

    text = _DECLARED.sub(defined, text)
    return text + "".join(sorted(used_names))


# ------------------------------------------------------------------ how much a step does


@frozen
class Bound:
    """The most operations of a step of a kernel, whatever its numbers are, and of a call beside its steps."""

    instructions: int  # of LLVM, each of which is one of the processor or a few
    arithmetic: int  # sums, products and comparisons of doubles among them
    divisions: int  # of doubles, with square roots
    calls: int  # of the C library
    overhead: int  # instructions of a call beside those of its steps


_ARITHMETIC = re.compile(r"= (?:tail |fast )*(?:fadd|fsub|fmul|fneg|fcmp)\b|@llvm\.(?:fabs|copysign)")
_DIVISION = re.compile(r"= (?:fdiv|frem)\b|@llvm\.sqrt")
_CALL = re.compile(r'call [^@]*@"?(liemech_\w+)')
_OTHER_CALL = re.compile(r'call [^@]*@(?:"([^"]+)"|([\w.$-]+))\(')
_FUNCTION = re.compile(r"^define [^\n]*?@(?:\"([^\"]+)\"|([\w.$-]+))\([^\n]*\{\n(.*?)^\}", re.M | re.S)
_LABEL = re.compile(r'^(?:"([^"]+)"|([\w.$-]+)):')
_TARGET = re.compile(r'label %(?:"([^"]+)"|([\w.$-]+))')

Blocks = dict[str, tuple[list[str], list[str]]]
"""The blocks of a function by name: the instructions of each, and the blocks that follow it."""


def bound_of(text: str, name: str) -> Bound | None:
    """The bound of a kernel in LLVM's language, after its passes; None if there are loops in its steps."""
    functions = {a or b: _blocks(body) for a, b, body in _FUNCTION.findall(text)}
    weights: list[Callable[[str], int]] = [
        lambda line: 1,
        lambda line: bool(_ARITHMETIC.search(line)),
        lambda line: bool(_DIVISION.search(line)),
        lambda line: bool(_CALL.search(line)),
    ]
    bounds: list[tuple[int, int]] = []
    try:
        for weigh in weights:
            steps: list[int] = []
            total = _most(functions, name, weigh, steps, 0, [])
            bounds.append((steps[0], total))
    except (_Loops, IndexError):
        return None
    (instructions, total), *others = bounds
    arithmetic, divisions, calls = (step for step, _ in others)
    return Bound(instructions, arithmetic, divisions, calls, total - instructions)


class _Loops(Exception):
    """Raised when there are loops in a step."""


STEPS = 3
"""How many loops there are around a step: over bodies, samples, and the steps of each."""


def _blocks(body: str) -> Blocks:
    blocks: Blocks = {}
    lines: list[str] = []
    follow: list[str] = []
    name = ""
    for line in body.splitlines():
        label = _LABEL.match(line)
        if label:
            if lines or name:
                blocks[name] = lines, follow
            name, lines, follow = label[1] or label[2], [], []
        elif line.strip() and not line.strip().startswith(";"):
            lines.append(line)
            follow += [a or b for a, b in _TARGET.findall(line)]
    blocks[name] = lines, follow
    return blocks


def _most(
    functions: dict[str, Blocks], name: str, weigh: Callable[[str], int], steps: list[int], deep: int, loops: list[int]
) -> int:
    """The most that a call of a function weighs, with one turn of each loop.

    steps : gets the weight of one turn of the loop of steps.  deep : loops around the call.
    loops : gets how deep each loop is that was met.
    """
    blocks = functions[name]

    def alone(block: str) -> int:
        total = 0
        for line in blocks[block][0]:
            total += weigh(line)
            called = _OTHER_CALL.search(line)
            inner = called and (called[1] or called[2])
            if inner in functions and not inner.startswith("liemech_"):
                # a function that all calls share has no loops of its own, but the kernel has
                total += _most(functions, str(inner), weigh, steps, deep, loops)
        return total

    def region(inside: set[str], entries: set[str], deep: int) -> int:
        """The longest way through some blocks."""
        parts = _components(inside, lambda b: [x for x in blocks[b][1] if x in inside])
        of = {block: i for i, part in enumerate(parts) for block in part}
        most: list[int] = []
        for i, part in enumerate(parts):  # those that follow come first
            first = next(iter(part))
            loop = len(part) > 1 or first in blocks[first][1]
            if loop:
                loops.append(deep)
                if deep >= STEPS or loops.count(deep) > 1:
                    raise _Loops  # others than those around the steps
                outside = (set(blocks) - part) if deep == 0 else (inside - part)
                heads = {x for b in outside for x in blocks[b][1] if x in part} or (entries & part)
                weight = turn(part, heads, deep + 1)
            else:
                weight = alone(first)
            after = {of[x] for b in part for x in blocks[b][1] if x in inside} - {i}
            most.append(weight + max((most[k] for k in after), default=0))
        return max(most, default=0)

    def turn(part: set[str], heads: set[str], deep: int) -> int:
        """The longest way through one turn of a loop."""
        if len(heads) != 1:
            raise _Loops
        (head,) = heads
        weight = alone(head) + region(part - {head}, set(blocks[head][1]) & part, deep)
        if deep == STEPS:
            steps.append(weight)
        return weight

    return region(set(blocks), {next(iter(blocks))}, deep)


def _components(nodes: Iterable[str], follow: Callable[[str], list[str]]) -> list[set[str]]:
    """Strongly connected components, those that follow before those they follow from."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    nodes = [*nodes]
    numbers = {node: i for i, node in enumerate(nodes)}
    edges = [(i, numbers[other]) for node, i in numbers.items() for other in follow(node)]
    ends = np.array(edges, dtype=int).reshape(-1, 2).T
    count, labels = connected_components(coo_array((ends[0] >= 0, ends), (len(nodes),) * 2), connection="strong")
    parts: list[set[str]] = [set() for _ in range(count)]
    for node, k in zip(nodes, labels, strict=True):
        parts[k].add(node)
    after: dict[int, set[int]] = {k: set() for k in range(count)}
    for i, k in labels[ends.T]:
        after[i] |= {k} - {i}
    return [parts[k] for k in graphlib.TopologicalSorter(after).static_order()]
