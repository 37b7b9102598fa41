"""Random small formulas: branches, loops, returns and errors in every nesting, for the comparison of the three worlds."""

from __future__ import annotations

import random

HEADER = """from liemech.formulas import *


class Stop(ArithmeticError):
    pass


"""
NAMES = ("a", "b", "c", "d")


class Writer:
    """Writes one formula of four floats and a run-time integer that returns four floats."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.lines: list[str] = []
        self.helpers: list[str] = []
        self.fresh = 0

    # ---------------------------------------------------------------- expressions

    def name(self) -> str:
        return self.random.choice(self.names)

    def expression(self, depth: int = 1) -> str:
        r = self.random
        if depth == 0 or r.random() < 0.3:
            return r.choice([self.name(), self.name(), r.choice(["0.5", "-1.25", "2.0", "0.0", "-0.0", "3.0", "1e-3"])])
        one = two = lambda: self.expression(depth - 1)
        kinds = [
            lambda: f"({one()} {r.choice('+-*')} {two()})",
            lambda: f"({one()} {r.choice('+-*')} {two()})",
            lambda: f"({one()} / (1.5 + abs({two()})))",
            lambda: f"{r.choice(['sin', 'cos', 'atan', 'tanh', 'abs', '-', 'sqrt', 'exp', 'log'])}({one()})",
            lambda: f"{r.choice(['min', 'max'])}({one()}, {two()})",
            lambda: f"where({self.condition(1)}, {one()}, {two()})",
            lambda: f"({one()} if {self.condition(1)} else {two()})",
            lambda: f"({one()} {r.choice(['and', 'or'])} {two()})",
            lambda: f"dot(vec({one()}, {self.name()}), vec({two()}, 0.5))",
            lambda: f"[{one()}, {two()}, {self.name()}][{r.choice(['0', '1', '2', '-1', 'n - 1'])}]",
            lambda: f"max([x * {self.name()} for x in ({one()}, {two()}) if {r.choice(['True', '1 < 2'])}])",
        ]
        if self.helpers:
            kinds += [lambda: f"{r.choice(self.helpers)}({one()}, {two()}, {self.name()}, n)[{r.choice('012')}]"] * 3
        return r.choice(kinds)()

    def condition(self, depth: int = 1) -> str:
        r = self.random
        if depth and r.random() < 0.3:
            kind = r.choice(["and", "or", "not"])
            if kind == "not":
                return f"not ({self.condition(depth - 1)})"
            return f"({self.condition(depth - 1)} {kind} {self.condition(depth - 1)})"
        e = lambda: self.expression(int(r.random() < 0.3))  # noqa: E731
        return r.choice(
            [
                lambda: f"{e()} {r.choice(['<', '<=', '>', '>=', '==', '!='])} {e()}",
                lambda: f"{e()} < {e()}",
                lambda: f"{e()} < {e()} <= {e()}",
                lambda: f"n {r.choice(['<', '==', '>'])} {r.choice('123')}",
                lambda: f"{e()} > 0.0",
                lambda: r.choice(["n > 1000", "True", "self_static == 2"]),
            ]
        )()

    # ---------------------------------------------------------------- statements

    def put(self, indent: int, line: str) -> None:
        self.lines.append("    " * indent + line)

    def block(self, indent: int, depth: int, loops: tuple[str, ...]) -> None:
        for _ in range(self.random.randint(1, 3)):
            if self.statement(indent, depth, loops):
                return

    def statement(self, indent: int, depth: int, loops: tuple[str, ...]) -> bool:
        """Write one statement; True if control does not come past it."""
        r = self.random
        choice = r.random()
        if depth == 0 or choice < 0.3:
            kind = r.random()
            if kind < 0.7:
                self.put(indent, f"{r.choice(NAMES)} = {self.expression()}")
            elif kind < 0.8:
                self.put(indent, f"{r.choice(NAMES)} {r.choice('+-*')}= {self.expression(1)}")
            elif kind < 0.9:
                self.put(indent, f"{', '.join(r.sample(NAMES, 2))} = {self.expression(1)}, {self.expression(1)}")
            else:
                self.put(indent, f"s[{r.choice('012')}] = {self.expression(1)}")
        elif choice < 0.6:
            self.put(indent, f"if {self.condition()}:")
            self.block(indent + 1, depth - 1, loops)
            while r.random() < 0.2:
                self.put(indent, f"elif {self.condition()}:")
                self.block(indent + 1, depth - 1, loops)
            if r.random() < 0.5:
                self.put(indent, "else:")
                self.block(indent + 1, depth - 1, loops)
        elif choice < 0.72:
            i = self.loop_name()
            seq = r.choice(
                [f"{i} in range({r.randint(0, 4)})", f"{i} in (0.5, -1.0, {self.name()})", f"{i}, _ in enumerate((a, b))",
                 f"{i}, _ in zip((1.0, 2.0), (a, b))", f"{i} in vec(a, b)"]
            )  # fmt: skip
            self.put(indent, f"for {seq}:")
            self.inside(indent, depth, (*loops, "static"), i)
        elif choice < 0.80:
            i = self.loop_name()
            self.put(indent, f"for {i} in range({r.choice(['n', '1, n', '70', 'n + 1', '-1, n'])}):")
            self.inside(indent, depth, (*loops, "dynamic"), i)
        elif choice < 0.88:
            k = self.loop_name()
            bound = r.choice(["6", "n", "3.5"])
            self.put(indent, f"{k} = {r.choice(['0', '0.0'])}")
            self.put(
                indent, f"while {k} < {bound}{r.choice(['', f' and {self.condition()}', f' and {self.condition()}'])}:"
            )
            self.put(indent + 1, f"{k} = {k} + 1")
            self.inside(indent, depth, (*loops, "dynamic"), k)
        elif choice < 0.93 and loops:
            if r.random() < 0.3:
                self.put(indent, r.choice(["break", "continue"]))
                return True
            self.put(indent, f"if {self.condition()}:")
            if r.random() < 0.5:
                self.put(indent + 1, f"{r.choice(NAMES)} = {self.expression(1)}")
            self.put(indent + 1, r.choice(["break", "continue"]))
        elif choice < 0.97:
            if RETURN_IN_LOOPS or "dynamic" not in loops:
                if r.random() < 0.7:
                    self.put(indent, f"if {self.condition()}:")
                    self.put(indent + 1, self.give())
                else:
                    self.put(indent, self.give())
                    return True
            else:
                self.put(indent, "pass")
        else:
            self.put(indent, f"if {self.condition()}:")
            self.put(indent + 1, f"raise Stop(f'{{{self.name()}}} is too much')")
        return False

    def loop_name(self) -> str:
        self.fresh += 1
        return f"i{self.fresh}"

    def inside(self, indent: int, depth: int, loops: tuple[str, ...], counter: str) -> None:
        # an int that is a float on another way may lose the sign of a zero
        self.names = (*self.names, f"(1.0 * {counter})")
        self.block(indent + 1, depth - 1, loops)
        self.names = self.names[:-1]

    def give(self) -> str:
        return f"return vec({self.expression(1)}, {self.name()}, {self.name()}, {self.expression(1)})"

    def formula(self, name: str, arguments: str, depth: int) -> str:
        self.lines = []
        self.names: tuple[str, ...] = NAMES
        self.put(0, f"def {name}({arguments}):")
        self.put(1, "self_static = 2")
        if "d" not in arguments:
            self.put(1, "d = a * 0.5")
        self.put(1, "s = [a, 0.0, b]")
        for _ in range(self.random.randint(1, 4)):
            if self.statement(1, depth, ()):
                break
        self.put(1, f"return vec({self.name()}, a + s[0], b, c * s[1] - s[2])")
        return "\n".join(self.lines) + "\n\n\n"

    def module(self) -> str:
        text = HEADER
        for i in range(self.random.randint(0, 2)):
            text += self.formula(f"helper{i}", "a, b, c, n", 1)
            self.helpers.append(f"helper{i}")
        return text + self.formula("formula", "a, b, c, d, n", 2)


RETURN_IN_LOOPS = False


def arguments(seed: int, count: int, special: tuple[float, ...]) -> list[list[float]]:
    """Rows of arguments of all sizes, with some special values among them."""
    r = random.Random(seed)
    return [
        [
            r.choice(special) if r.random() < 0.15 else r.uniform(-3.0, 3.0) * 10.0 ** r.choice([0, 0, 0, 1, -3])
            for _ in NAMES
        ]
        for _ in range(count)
    ]
