"""Formulas that stand in the text as one types them, `mu' = ad*_xi mu`, as TeX: what is a formula
for certain is set as one, and everything else stays as it is written.

Accepted are numbers, letters, Greek names, a few functions, indices, powers, brackets and signs;
one word that is none of these, or a sign that only a program has, and the text is no formula.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

GREEK = {
    *(
        "alpha",
        "beta",
        "gamma",
        "delta",
        "epsilon",
        "zeta",
        "eta",
        "theta",
        "kappa",
        "lambda",
        "mu",
    ),
    *("nu", "xi", "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega", "Gamma", "Delta"),
    *("Theta", "Lambda", "Xi", "Pi", "Sigma", "Phi", "Psi", "Omega"),
}
FUNCTIONS = {"exp", "log", "sin", "cos", "tan", "sinh", "cosh", "det"}
UPRIGHT = {"tr", "hat", "vee", "cay", "Ad", "ad", "dexp", "diag"}
ACTIONS = {"Ad", "ad", "dexp", "K", "dtau"}
"""What takes the element by which it acts as an index, `Ad*_tau(x)`."""
SIGNS = {
    "+-": r"\pm ", "<=": r"\le ", ">=": r"\ge ", "->": r"\to ", "...": r"\dots ", "=": "=", "+": "+", "-": "-", "/": "/",
    ",": ",", ";": ";", "<": "<", ">": ">", "|": "|", "(": "(", ")": ")", "[": "[", "]": "]",
}  # fmt: skip
TERM = r"[A-Za-z0-9]+(?:[+-][A-Za-z0-9]+)*"
INDEX = re.compile(rf"{TERM}(?:,{TERM})*")
PAIRS = {"(": ")", "{": "}"}


class NoFormula(Exception):
    """This is not a formula."""


def tex(text: str) -> str | None:
    """The formula in TeX; None if it is no formula, or cannot be set."""
    from latex2mathml.converter import convert

    found = read(text)
    try:
        return found if found is None or convert(found) else None
    except Exception:  # of whatever kind: what cannot be set is left as it is
        return None


def read(text: str) -> str | None:
    """The formula in TeX; None if it is no formula."""
    try:
        return " ".join(_read(text).split())
    except NoFormula:
        return None


def _inside(text: str, i: int) -> str:
    """What a pair of brackets that opens at i holds."""
    depth, close = 0, PAIRS[text[i]]
    for k in range(i, len(text)):
        depth += (text[k] == text[i]) - (text[k] == close)
        if not depth:
            return text[i + 1 : k]
    raise NoFormula


def _name(word: str) -> str:
    """A letter, a Greek name, a function, or the differential of one of the first two."""
    if word == "lam":
        return r"\lambda "
    if len(word) == 1:
        return word
    if word in GREEK:
        return rf"\{word} "
    if word in FUNCTIONS:
        return rf"\{word} "
    if word in ("sum", "int"):
        return rf"\{word} "
    if word in UPRIGHT:
        return rf"\operatorname{{{word}}}"
    if word[0] == "d" and (len(word) == 2 or word[1:] in GREEK):
        return rf"\mathrm{{d}}{_name(word[1:])}"
    raise NoFormula


def _index(found: str) -> str:
    """The letters and numbers of an index; `ij` is i and j, and a word is the name of a program."""
    parts = re.split(r"([+,-])", found)
    if any(re.fullmatch(r"[a-z]{3,}", p) and p not in GREEK | FUNCTIONS for p in parts):
        raise NoFormula
    return "".join(rf"\{p} " if p in GREEK | FUNCTIONS else p for p in parts)


def _read(text: str) -> str:
    """The formula in TeX, from left to right."""
    out, i, last = "", 0, ""
    while i < len(text):
        rest = text[i:]
        if word := re.match(r"[A-Za-z]+(?=[^A-Za-z]|$)", rest):
            name, i = word[0], i + len(word[0])
            around = text[max(0, i - len(name) - 1) : i + 1]
            left, right = text[: i - len(name)], text[i:]
            between = re.search(r"[\w)'*.]\s$", left) and re.match(r"\s([\w(|]|\.\.\.)", right)
            if name in "xo" and around[:1] == " " == around[-1:] and between:
                out += r"\times " if name == "x" else r"\circ "
                continue
            if name == "sqrt" and text[i : i + 1] == "(":
                inner = _inside(text, i)
                out, i = out + rf"\sqrt{{{_read(inner)}}}", i + len(inner) + 2
            else:
                out += r"\mathrm{d}" if name == "d" and text[i : i + 1] == "/" else _name(name)
            last = name
            if digits := re.match(r"\d+(?![.\d])", text[i:]):
                out, i = out + f"_{{{digits[0]}}}", i + len(digits[0])
        elif number := re.match(r"\d+(\.\d+)?(?![A-Za-z.])", rest):
            out, i, last = out + number[0], i + len(number[0]), ""
        elif rest[0] == "_":
            if not out or (out[-1] == " " and text[i - 1] == " "):
                raise NoFormula
            if rest[1:2] in PAIRS:
                inner = _inside(text, i + 1)
                out, i = out + f"_{{{_read(inner)}}}", i + len(inner) + 3
            else:
                found = INDEX.match(text, i + 1)
                if not found:
                    raise NoFormula
                index, i = _index(found[0]), found.end()
                if last in ACTIONS and text[i : i + 1] == "(":  # Ad*_tau(x)
                    inner = _inside(text, i)
                    index, i = index + f"({_read(inner)})", i + len(inner) + 2
                if last in ("Ad", "ad", "K") and (power := re.match(r"\^(-?\w+)", text[i:])):
                    index, i = f"{index}^{{{power[1]}}}", i + len(power[0])
                while more := re.match(r"_([A-Za-z0-9]+)", text[i:]):  # ad*_xi_i
                    index, i = f"{index}_{{{_index(more[1])}}}", i + len(more[0])
                out += f"_{{{index}}}"
        elif rest[0] == "^":
            if rest[1:2] in PAIRS:
                inner = _inside(text, i + 1)
                out, i = out + f"^{{{_read(inner)}}}", i + len(inner) + 3
            elif power := re.match(r"\^(-?\d+[a-z]?(?!\w)|-?\d+|-?[A-Za-z]+|\*)", rest):
                word = power[1]
                if len(word.lstrip("-")) > 1 and not word.lstrip("-")[0].isdigit():
                    word = _name(word.lstrip("-")) if word[0] != "-" else "-" + _name(word[1:])
                out, i = out + f"^{{{word}}}", i + len(power[0])
            else:
                raise NoFormula
        elif rest[0] == "*":  # the dual of a map: it stands behind it
            if not re.search(r"[A-Za-z)}]$", text[:i]) or (
                re.match(r"\*[\s]*[\w(*]", rest) and not re.match(r"\*[\s_)]", rest)
            ):
                raise NoFormula
            out, i = out + "^{*}", i + 1
        elif rest[0] == "'":
            if not re.search(r"[\w)]$", text[:i]):
                raise NoFormula
            out, i = out + "'", i + 1
        elif rest.startswith(" . "):
            out, i = out + r" \cdot ", i + 3
        elif sign := next((s for s in SIGNS if rest.startswith(s)), None):
            if sign == "[" and (re.search(r"\w$", text[:i]) or rest[1:2] == "["):
                raise NoFormula  # an entry of an array, or an array
            if sign == "=" and (rest[1:2] == "=" or (text[i - 1 : i] != " " or rest[1:2] != " ")):
                raise NoFormula  # an argument of a call
            shown = SIGNS[sign]
            if sign == "<" and rest[1:2] not in ("", " "):  # a pairing, <mu, xi>
                shown = r"\langle "
            if sign == ">" and r"\langle" in out and text[i - 1] != " ":
                shown = r"\rangle "
            out, i, last = out + shown, i + len(sign), ""
        elif rest[0] == " ":
            out, i = (
                out + (r"\quad " if rest.startswith("  ") else r"\, " if _beside(text, i) else " "),
                i + 1,
            )
            while i < len(text) and text[i] == " ":
                i += 1
        else:
            raise NoFormula
    return out


def _beside(text: str, i: int) -> bool:
    """Do two factors stand beside each other here?"""
    return bool(re.search(r"[\w)'*]$", text[:i]) and re.match(r"\s[\w(]", text[i:]))


ANY = "|".join(sorted(GREEK))
SURE = re.compile(rf"[=^|]|\w'|\*_|\w_\w|[\w)] (?:{ANY})\b|\b(?:{ANY}) [\w(]")
"""Signs, or a Greek letter beside another factor, without which a piece of code is no formula, but
a name.
"""
SPAN = re.compile(r"(?<![`\w])`([^`\n]+)`(?!`)")
FENCE = re.compile(r"^(```|:::).*?^\1[ ]*$", flags=re.MULTILINE | re.DOTALL)


def pages(app: Sphinx, name: str, source: list[str]) -> None:
    """In the pages a formula in backticks is set as one."""

    def formula(span: re.Match[str]) -> str:
        found = tex(span[1]) if SURE.search(span[1]) else None
        return f"${found}$" if found else span[0]

    def outside(text: str) -> str:
        lines = text.split("\n")
        return "\n".join(
            line if line.startswith("#") else SPAN.sub(formula, line) for line in lines
        )

    text, out, end = source[0], "", 0
    for fence in FENCE.finditer(text):
        out += outside(text[end : fence.start()]) + fence[0]
        end = fence.end()
    source[0] = out + outside(text[end:])


def lines(block: list[str]) -> list[str] | None:
    """The lines of a formula in a docstring as TeX, with the words beside them; None if one of them
    is no formula.
    """
    if any(re.fullmatch(r"[-+| ]*", line) for line in block):  # a drawn table
        return None
    found = []
    for line in block:
        parts = []
        for part in re.split(r"\s{3,}", line.strip()):
            set_ = tex(part.strip(" ."))
            words = re.fullmatch(r"[A-Za-z][A-Za-z ,'()-]*", part)
            if set_ is None and words and " " in part:
                set_ = rf"\text{{{part}}}"
            if set_ is None:
                return None
            parts.append(set_)
        found.append(r" \qquad ".join(parts))
    return found


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", pages, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
