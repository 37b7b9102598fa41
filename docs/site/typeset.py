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
SHORT = {"lam": "lambda", "th": "theta", "Om": "Omega", "eps": "epsilon", "hbar": "hbar"}
"""Greek letters as programs write them."""
FUNCTIONS = {
    "exp",
    "log",
    "ln",
    "sin",
    "cos",
    "tan",
    "cot",
    "sinh",
    "cosh",
    "tanh",
    "det",
    "max",
    "min",
}
UPRIGHT = {"tr", "Re", "Im", "hat", "vee", "cay", "Ad", "ad", "dexp", "diag"}
ACTIONS = {"Ad", "ad", "dexp", "K", "dtau"}
"""What takes the element by which it acts as an index, `Ad*_tau(x)`."""
SIGNS = {
    "+-": r"\pm ", "<=": r"\le ", ">=": r"\ge ", "!=": r"\neq ", "->": r"\to ", "!": "!", "+=": r"\mathrel{+}=",
    "...": r"\dots ", "..": r"\dots ", "=": "=", "+": "+", "-": "-", "/": "/",
    ",": ",", ";": ";", "<": "<", ">": ">", "|": r"\vert ", "{": r"\{", "}": r"\}", "(": "(", ")": ")", "[": "[", "]": "]",
}  # fmt: skip
TERM = r"-?[A-Za-z0-9]+(?:[+-][A-Za-z0-9]+)*"
INDEX = re.compile(rf"{TERM}(?:,{TERM})*")
PAIRS = {"(": ")", "{": "}"}


class NoFormula(Exception):
    """This is not a formula."""


def tex(text: str) -> str | None:
    """The formula in TeX; None if it is no formula, or cannot be set."""
    found = read(text)
    return None if found is None else convertible(found)


def convertible(found: str) -> str | None:
    """TeX that can be set; None for what cannot, which is left as it is written."""
    from latex2mathml.converter import convert

    try:
        return found if convert(found) else None
    except Exception:  # of whatever kind
        return None


def read(text: str, words: bool = False) -> str | None:
    """The formula in TeX; None if it is no formula.  words : may words stand in it?"""
    try:
        return " ".join(_read(text, words).split())
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
    if len(word) == 1:
        return word
    if word in GREEK | FUNCTIONS | {"sum", "int", "hbar"}:
        return rf"\{word} "
    if word in SHORT:
        return _name(SHORT[word])
    if word in UPRIGHT:
        return rf"\operatorname{{{word}}}"
    if word[0] == "d" and (len(word) == 2 or word[1:] in GREEK):
        return rf"\mathrm{{d}}{_name(word[1:])}"
    if re.fullmatch(r"[a-z][A-Z]", word):  # two factors
        return word
    raise NoFormula


def _index(found: str) -> str:
    """The letters and numbers of an index; `ij` is i and j, and a word is the name of a program."""
    parts = re.split(r"([+,-])", found)
    if any(re.fullmatch(r"[a-z]{3,}", p) and p not in GREEK | FUNCTIONS | UPRIGHT for p in parts):
        raise NoFormula
    return "".join(_name(p) if p in GREEK | FUNCTIONS | UPRIGHT else p for p in parts)


WORD = re.compile(r"[A-Za-z]+(?:-[a-z]+)*")
SETTING = re.compile(r'(?:[a-z]+=)?"\w+"')
"""A choice among the formulas beside which it stands, first="kick"."""


def _words(text: str, i: int) -> tuple[str, int] | None:
    """Words of English that begin here, and where they end; a name that stands in a formula is one, too."""
    found = []
    while word := WORD.match(text, i):
        try:
            known = bool(_name(word[0])) and not (found and word[0] == "a")
        except NoFormula:
            known = False
        if known:
            break
        found.append(word[0])
        i = word.end()
        if not re.match(r" [A-Za-z]", text[i:]):
            break
        i += 1
    return (" ".join(found), i) if found else None


def _read(text: str, words: bool = False) -> str:
    """The formula in TeX, from left to right.  words : may words stand in it?"""
    out, i, last = "", 0, ""
    while i < len(text):
        rest = text[i:]
        if words and (said := SETTING.match(rest) or _words(text, i)):
            what, end = said if isinstance(said, tuple) else (said[0], i + said.end())
            apart = text[end - 1 : end] == " "
            out += rf"\text{{{' ' if text[i - 1 : i] == ' ' else ''}{what}{' ' if apart else ''}}}"
            i, last = end, ""
        elif twice := re.match(r"d2([A-Za-z]+)/d([A-Za-z]+)2", rest):  # a second derivative
            out += rf"\mathrm{{d}}^2 {_name(twice[1])}/\mathrm{{d}}{_name(twice[2])}^2"
            i, last = i + twice.end(), ""
        elif word := re.match(r"[A-Za-z]+(?=[^A-Za-z]|$)", rest):
            name, i = word[0], i + len(word[0])
            around = text[max(0, i - len(name) - 1) : i + 1]
            left, right = text[: i - len(name)], text[i:]
            between = re.search(r"[\w)'*.]\s$", left) and re.match(r"\s([\w(|]|\.\.\.)", right)
            between = between and not (words and out.endswith("}") and _words(text, i + 1))
            if name in "xo" and around[:1] == " " == around[-1:] and between:
                out += r"\times " if name == "x" else r"\circ "
                continue
            if name == "sqrt" and text[i : i + 1] == "(":
                inner = _inside(text, i)
                out, i = out + rf"\sqrt{{{_read(inner, words)}}}", i + len(inner) + 2
            else:
                out += r"\mathrm{d}" if name == "d" and text[i : i + 1] == "/" else _name(name)
            last = name
            if digits := re.match(r"\d+(?![.\d])", text[i:]):
                out, i = out + f"_{{{digits[0]}}}", i + len(digits[0])
        elif number := re.match(r"\d+(\.\d+)?(?![A-Za-z]|\.(?!\.|\s|$))", rest):
            out, i, last = out + number[0], i + len(number[0]), ""
        elif rest[0] == "_":
            if not out or (out[-1] == " " and text[i - 1] == " "):
                raise NoFormula
            if rest[1:2] in PAIRS:
                inner = _inside(text, i + 1)
                out, i = out + f"_{{{_read(inner, words)}}}", i + len(inner) + 3
            else:
                found = INDEX.match(text, i + 1)
                if not found:
                    raise NoFormula
                index, i = _index(found[0]), found.end()
                if last in ACTIONS and text[i : i + 1] == "(":  # Ad*_tau(x)
                    inner = _inside(text, i)
                    index, i = index + f"({_read(inner, words)})", i + len(inner) + 2
                if last in ("Ad", "ad", "K") and (power := re.match(r"\^(-?\w+)", text[i:])):
                    index, i = f"{index}^{{{power[1]}}}", i + len(power[0])
                while more := re.match(r"_([A-Za-z0-9]+)", text[i:]):  # ad*_xi_i
                    index, i = f"{index}_{{{_index(more[1])}}}", i + len(more[0])
                out += f"_{{{index}}}"
        elif rest[0] == "^":
            if rest[1:2] in PAIRS:
                inner = _inside(text, i + 1)
                out, i = out + f"^{{{_read(inner, words)}}}", i + len(inner) + 3
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
            if not re.search(r"[\w)']$", text[:i]):
                raise NoFormula
            out, i = out + "'", i + 1
        elif rest[0] == "." and re.match(
            r"\w\.\w(?!\w)", text[i - 1 :]
        ):  # a product of vectors, q.P
            out, i = out + r" \cdot ", i + 1
        elif words and rest[0] in ".:" and rest[1:2] in ("", " "):
            out, i, last = out + rest[0], i + 1, ""
        elif rest.startswith(" . "):
            out, i = out + r" \cdot ", i + 3
        elif sign := next((s for s in SIGNS if rest.startswith(s)), None):
            if sign == "[" and (re.search(r"\w$", text[:i]) or rest[1:2] == "["):
                raise NoFormula  # an entry of an array, or an array
            if sign == "=" and (
                rest[1:2] == "=" or (text[:i] not in ("", text[: i - 1] + " ") or rest[1:2] != " ")
            ):
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


SPACE = re.compile(r"(?<![\w^])[RCST]\^(?:\d*[nN]|\d)(?![\w^])")
"""A space of numbers, a torus or a sphere, R^2n."""
RELATION = re.compile(r" (=|<=|->) |(?<=\w)' = ")
ARTICLE = re.compile(r"^[aAI] (?=[a-z]+\b)|(?<=\w) [aAI]$")


KNOWN = "|".join(sorted(GREEK | FUNCTIONS | UPRIGHT | {*SHORT, "by"}))
BESIDE = re.compile(rf" (?!(?:{KNOWN})\b)[a-z]{{2,}}(?![\w(^])| [A-Z][a-z]|[,;:.)](?: |$)(?! \.)|$")
"""What may stand behind a formula: a word, a sign, the end."""
TERMS = re.compile(r"[-+*/|<] (?:[\w']+ )?$|<[^>]*$| : \S+ \($")
"""Before a formula: a sign, or a term behind one, which belongs to it."""


def inside(text: str) -> list[tuple[int, int]]:
    """Where formulas stand in a sentence: spaces, and what can be read as one about a sign of equality."""
    found, last = [], 0
    for sign in RELATION.finditer(text):
        if sign.start() < last:
            continue
        starts = [last, *(last + m.end() for m in re.finditer(r"[ (]", text[last : sign.start()]))]
        ends = [sign.end() + m.start() for m in re.finditer(r"(?=[ ,;:.)]|$)", text[sign.end() :])]
        ranges = ((a, b) for a in starts[-14:] for b in reversed(ends[:24]))
        if best := next((pair for pair in ranges if _stands(text, *pair)), None):
            found.append(best)
            last = best[1]
    spaces = [m.span() for m in SPACE.finditer(text)]
    return sorted(
        found + [one for one in spaces if not any(a < one[1] and one[0] < b for a, b in found)]
    )


def _stands(text: str, a: int, b: int) -> bool:
    """Is this a formula by itself: every part of it an equation, its brackets closed, words beside it?"""
    formula, depth, parts = text[a:b], 0, [""]
    for letter in formula:
        depth += (letter in "([{") - (letter in ")]}")
        if depth < 0:
            return False
        parts = [*parts, ""] if letter in ",;" and not depth else [*parts[:-1], parts[-1] + letter]
    numbers = all(re.fullmatch(r" (\d+|\.\.\.)", part) for part in parts[1:])
    return (
        not depth
        and formula == formula.strip(" ,;:.=+-")
        and bool(BESIDE.match(text, b))
        and not TERMS.search(text[:a])
        and not ARTICLE.search(formula)
        and not formula.count("|") % 2
        and (numbers or all(RELATION.search(part) for part in parts))
        and read(formula) is not None
    )


INDENTED = re.compile(r"(?<=\n\n)((?:    \S.*\n)+)(?=\n)")
"""A formula on lines of its own."""


def pages(app: Sphinx, name: str, source: list[str]) -> None:
    """In the pages a formula in backticks, or on indented lines, is set as one; in those that are
    generated it is set already.
    """
    if name.startswith("generated/"):
        return

    def formula(span: re.Match[str]) -> str:
        typed = span[1].replace(r"\|", "|")  # as a table has it
        found = tex(typed) if SURE.search(typed) else None
        return f"${found}$" if found else span[0]

    def display(block: re.Match[str]) -> str:
        found = lines([line[4:] for line in block[1].splitlines()])
        return "\n".join(f"$$ {line} $$\n" for line in found) if found else block[0]

    def outside(text: str) -> str:
        return "\n".join(
            line if line.startswith("#") else SPAN.sub(formula, line)
            for line in INDENTED.sub(display, text).split("\n")
        )

    text, out, end = source[0], "", 0
    for fence in FENCE.finditer(text):
        out += outside(text[end : fence.start()]) + fence[0]
        end = fence.end()
    source[0] = out + outside(text[end:])


CODE = re.compile(
    r"[a-z]{2,}\.[a-z_]{2,}|\w\[|\w\(\w+=[^=\"]|__|^ *(class|for|def|return|with \w+\.|#) |[`#]|^ *[A-Z]\w+\(.*\)\."
)
"""What only a program has."""


def lines(block: list[str]) -> list[str] | None:
    """The lines of a formula in a docstring as TeX, with the words beside them; None if one of them
    is no formula.
    """
    if any(re.fullmatch(r"[-+| ]*", line) or CODE.search(line) for line in block):
        return None  # a drawn table, or a program
    if not any(SURE.search(line) for line in block):
        return None  # words
    found = []
    for line in block:
        parts = [read(part.strip(), words=True) for part in re.split(r"\s{3,}", line.strip())]
        if None in parts or convertible(whole := r" \qquad ".join(map(str, parts))) is None:
            return None
        found.append(whole)
    return found


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", pages, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
