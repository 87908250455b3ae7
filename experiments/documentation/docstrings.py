"""Docstrings as this project writes them, made the reStructuredText that Sphinx reads.

They are plain text with Markdown's backticks and fences, with sections (`Args:`, `Raises:`, ...), and with fields of
arrays that stand one below the other (`speed: (vehicle,) [m/s]`). An environment's is a manual, which has a page of its
own. Sphinx's extension for Google's sections takes what stands before a colon for a type, so it is not used.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from textwrap import dedent, indent

SECTION = re.compile(r"^(Args|Attributes|Raises|Returns):\n((?:    .*\n?|\n(?=    ))+)", re.MULTILINE)
FIELD = re.compile(r"[\w.]+(, [\w.]+)*: ")
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"(?<![`:\w])`([^`\n]+)`(?!`)")
MANUAL = re.compile(r"^(#+ |!\[|\| )", re.MULTILINE)
FIELD_NUMBER = "Alias for field number"  # what NamedTuple says of a field without a docstring

Link = Callable[[str], str | None]
"""The full name of what a name in backticks stands for, if the site has it."""


def as_rst(lines: Sequence[str], link: Link) -> list[str]:
    """A docstring's lines, without their indentation, for Sphinx."""
    text = "\n".join(lines).strip("\n")
    if text.startswith(FIELD_NUMBER):
        return []
    if MANUAL.search(text):
        text = f"{lines[0]}\n\nIts manual is a section of :doc:`environments`."
    text = FENCE.sub(_code_block, text)
    text = SECTION.sub(_section, text + "\n")
    text = "\n\n".join(_fields(paragraph) for paragraph in text.split("\n\n"))
    return CODE.sub(lambda match: _named(match[1], link), text).split("\n")


def signature_as_written(thing: Callable[..., object]) -> tuple[str, str]:
    """A signature's arguments and what it returns, with annotations as the source has them: `NDArray[np.int8]`."""
    found = inspect.signature(thing)
    parameters = [
        one.replace(annotation=_AsWritten(one.annotation)) if isinstance(one.annotation, str) else one
        for one in found.parameters.values()
        if one.name != "self"
    ]
    returned = found.return_annotation
    return (
        str(found.replace(parameters=parameters, return_annotation=inspect.Signature.empty)),
        returned if isinstance(returned, str) and not inspect.isclass(thing) else "",
    )


class _AsWritten(str):
    """An annotation that shows itself as it stands in the source."""

    __repr__ = str.__str__


def _code_block(fence: re.Match[str]) -> str:
    language, code = fence.groups()
    return f".. code-block:: {language}\n\n{indent(code, '    ')}"


def _section(found: re.Match[str]) -> str:
    title, block = found.groups()
    text = dedent(block).strip("\n")
    if title == "Returns":
        return f"**Returns** {text}\n\n"
    return f"**{title}**\n\n{_listed(text)}\n\n"


def _fields(paragraph: str) -> str:
    """A paragraph that names fields one below the other as a list of them; any other as it is."""
    first, *others = paragraph.strip("\n").split("\n")
    names_fields = FIELD.match(first) and all(FIELD.match(line) or line.startswith("    ") for line in others)
    return _listed(paragraph.strip("\n")) if names_fields else paragraph


def _listed(fields: str) -> str:
    """Fields, each with its further lines indented, as a list."""
    lines = []
    for line in fields.split("\n"):
        if line.startswith("    ") or not line:
            lines.append(f"  {line.strip()}")
        else:
            name, colon, rest = line.partition(":")
            lines.append(f"- ``{name}``{colon}{rest}" if colon else f"- {line}")
    return "\n".join(lines)


def _named(name: str, link: Link) -> str:
    full = link(name)
    return f"``{name}``" if full is None else f":py:obj:`{name} <{full}>`"
