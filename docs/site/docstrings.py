"""Docstrings as they are written, in plain text with formulas, made readable: nothing in them has
to know of this site.

* An indented paragraph is a formula or a table and keeps its lines.
* `name` in single backticks is code, and a link where it is a public name or a member of the class.
* A line `name : what it is` describes a parameter; "Source:" begins a paragraph of its own.
* A line that ends with a sentence, although the next word would fit on it, ends a paragraph.
* All else is text, in which no sign has a second meaning.
"""

from __future__ import annotations

import functools
import inspect
import itertools
import operator
import re
from typing import Any

import typeset
from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

import liemech
from liemech.names import everything, members

WIDTH = 100
PARAMETER = re.compile(r"((?:\*{0,2}\w+)(?:, \*{0,2}\w+)*) : (?=\S)")
ITEM = re.compile(r"(\d+\.|[*-]) +")


@functools.cache
def public() -> dict[str, str]:
    """The full name of every public thing, by its own name and by those with `lm.` or its module in
    front.
    """
    found: dict[str, str] = {}
    spaces = [name for name in liemech.__all__ if inspect.ismodule(getattr(liemech, name))]
    for module in ["", *spaces]:
        inside, path = (getattr(liemech, module), f"{module}.") if module else (liemech, "")
        for name in [] if module == "formulas" else members(module) if module else liemech.__all__:
            if not inspect.ismodule(getattr(inside, name)):
                spellings = [f"lm.{path}{name}", f"liemech.{path}{name}", f"{path}{name}", name]
                alone = name[0].isupper() or (not module and ("_" in name or name == "integrate"))
                # `record` and `drift` alone are words
                known = spellings if alone else spellings[: 3 if module else 2]
                found = (
                    dict.fromkeys(known, f"liemech.{path}{name}") | found
                )  # of two, the one with fewer dots
    return found


@functools.cache
def full_name(kind: type) -> str | None:
    """The full name of a public class: of those with one name, such as `Field`, its own."""
    spelled = {name for name in public().values() if name.rpartition(".")[2] == kind.__name__}
    return next(
        (x for x in spelled if operator.attrgetter(x.removeprefix("liemech."))(liemech) is kind),
        None,
    )


def home(owner: type, name: str) -> str | None:
    """The full name of a documented member of a class, in the class that has its docstring."""
    for one in owner.__mro__:
        member = vars(one).get(name)
        if member is not None and not name.startswith("_"):
            method = inspect.isroutine(member) or isinstance(
                member, property | functools.cached_property
            )
            has_text = method and bool((member.__doc__ or "").strip())
            path = full_name(one)
            return f"{path}.{name}" if has_text and path else None
    return None


def place(code: str, owner: type | None = None) -> str | None:
    """The full name of what code names, a public thing or a member of a class; None if it has no
    place in the reference.
    """
    name = code.partition("(")[0]
    if owner is not None and name.isidentifier() and (found := home(owner, name)):
        return found
    if name in public() or name.count(".") != 1:
        return public().get(name)
    one, member = name.split(".")
    thing = everything().get(one)
    return home(thing, member) if inspect.isclass(thing) else None


def linked(code: str, owner: type | None) -> str:
    """Code in the text; a link where it names something that has a place in the reference."""
    target = place(code, owner)
    return f":obj:`{code} <{target}>`" if target else f"``{code}``"


def marked(text: str) -> str:
    """Text in which no sign has a second meaning."""
    return re.sub(r"([\\*_|`])", r"\\\1", text)


def escaped(text: str, owner: type | None) -> str:
    """Text in which only backticks have a meaning; formulas are set."""
    parts = re.split(r"(`+)(.+?)\1", text)
    out = ""
    for plain, _, code in zip(parts[::3], [*parts[1::3], ""], [*parts[2::3], ""], strict=True):
        end = 0
        for first, last in typeset.inside(plain):
            out += marked(plain[end:first])
            if found := typeset.tex(plain[first:last]):
                out += f"\\ :math:`{found}`\\ "
            else:
                out += marked(plain[first:last])
            end = last
        out += marked(plain[end:])
        if code:  # a role ends before a space or a sign of punctuation
            out += ("" if out[-1:] in ("", " ", "(", "[") else "\\ ") + linked(code, owner) + "\\ "
    return re.sub(r"\\ (?=[\s.,:;!?)\]]|$)", "", out)


def paragraphs(lines: list[str]) -> list[str]:
    """The lines of one block joined to paragraphs, where its author broke them on purpose."""
    found: list[str] = []
    previous = ""
    for line in lines:
        starts = (
            PARAMETER.match(line)
            or ITEM.match(line)
            or re.match(r"(Source|Sources|Raises|Returns|Warns)\b", line)
        )
        ended = (
            previous.endswith((".", ":", ";"))
            and len(previous) + 1 + len(line.split(" ")[0]) <= WIDTH
        )
        if found and not starts and not ended:
            found[-1] += " " + line.strip()
        else:
            found.append(line.strip())
        previous = line
    return found


def rendered(paragraph: str, owner: type | None) -> list[str]:
    """One paragraph as reStructuredText."""
    if PARAMETER.match(paragraph):
        lines = []
        paragraph, *source = re.split(r"(?<=\.) +(?=Sources?: )", paragraph, maxsplit=1)
        for part in re.split(r"(?<=\.)  (?=(?:\w+)(?:, \w+)* : )", paragraph):
            names, _, what = part.partition(" : ")
            # `n. Books` begins no list
            what = re.sub(r"^(?=\w+\.( |$))", r"\\ ", escaped(what, owner))
            lines += [", ".join(f"``{name}``" for name in names.split(", ")), f"    {what}"]
        return [*lines, "", *(line for text in source for line in rendered(text, owner))]
    if item := ITEM.match(paragraph):
        return [f"{item[1]} {escaped(paragraph[item.end() :], owner)}", ""]
    if paragraph.startswith(("Source:", "Sources:")):
        return [".. container:: source", "", f"    {escaped(paragraph, owner)}", ""]
    return [escaped(paragraph, owner), ""]


def readable(lines: list[str], owner: type | None) -> list[str]:
    """The lines of a docstring as reStructuredText."""
    blocks = [block.split("\n") for block in re.split(r"\n\s*\n", "\n".join(lines).strip("\n"))]
    out: list[str] = []
    for block in blocks:
        for formula, part in itertools.groupby(
            zip(formulas(block), block, strict=True), lambda pair: pair[0]
        ):
            if formula:  # the empty comment parts it from a formula before it
                shown = [line for _, line in part]
                if set_ := typeset.lines(shown):
                    for line in set_:
                        out += [".. math::", "", f"    {line}", ""]
                else:
                    out += ["..", "", "::", "", *shown, ""]
            else:
                for paragraph in paragraphs([line for _, line in part]):
                    out += rendered(paragraph, owner)
    return out


def formulas(block: list[str]) -> list[bool]:
    """Which lines are formulas: the indented ones, unless they go on with an item or the text of a
    parameter.
    """
    found = []
    hanging = False
    for i, line in enumerate(block):
        if not line.startswith("    "):
            hanging = bool(PARAMETER.match(line) or ITEM.match(line))
        elif i and block[i - 1].endswith(":"):
            hanging = False
        found.append(line.startswith("    ") and not hanging)
    return found


def convert(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Sphinx asks for every docstring."""
    owner = thing if inspect.isclass(thing) else everything().get(name.split(".")[-2])
    lines[:] = readable(lines, owner if inspect.isclass(owner) else None)


def signature(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, arguments: str, returns: str
) -> tuple[str, str] | None:
    """The arguments of a class are its fields: those of a record stand in its `__signature__`."""
    if what != "class" or not arguments:
        return None
    known = inspect.signature(thing)
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in known.parameters.values()]
    return str(known.replace(parameters=bare, return_annotation=inspect.Signature.empty)), ""


def bases(app: Sphinx, name: str, thing: type, options: Any, found: list[Any]) -> None:
    """Of the classes above a class those that have a place in the reference."""
    known = set(public().values())

    def documented(base: Any) -> list[Any]:
        full = public().get(getattr(base, "__name__", ""), "")
        if full in known and base is not liemech.Record:
            return [base]
        return [one for above in getattr(base, "__bases__", ()) for one in documented(above)]

    up = [one for base in found for one in documented(base)]
    own = [
        base for base in found if not base.__module__.startswith("liemech") and base is not object
    ]
    found[:] = list(dict.fromkeys(up or own or [object]))


def link_pages(app: Sphinx, doctree: nodes.document) -> None:
    """In the pages too, code that is a public name leads to the reference.  Classes without a base
    do not say so.
    """
    for line in [p for p in doctree.findall(nodes.paragraph) if p.astext() == "Bases: object"]:
        line.parent.remove(line)
    for code in list(doctree.findall(nodes.literal)):
        target = place(code.astext())
        if target and not isinstance(
            code.parent, nodes.reference | nodes.title | addnodes.pending_xref
        ):
            link = addnodes.pending_xref(
                "", code.deepcopy(), refdoc=app.env.docname, refexplicit=True, refwarn=True
            )
            link.attributes |= {"refdomain": "py", "reftype": "obj", "reftarget": target}
            code.replace_self(link)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", convert)
    app.connect("doctree-read", link_pages)
    app.connect("autodoc-process-signature", signature)
    app.connect("autodoc-process-bases", bases)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
