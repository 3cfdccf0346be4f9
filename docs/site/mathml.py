"""Equations as MathML, which browsers draw without a script.

A fenced block ``math`` is an equation of its own, ``$`x`$`` one within a line; repositories show both, too.
``\\tag{3}`` numbers an equation: it stands at its right, and ``#eq-3`` leads to it.
"""

import re
from typing import Any
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor

_FENCE = re.compile(r"^```math\n(.*?)^```$", re.M | re.S)
_TAG = re.compile(r"\\tag\{([^}]*)\}")
_WORD = re.compile(r"\\operatorname\{([^}]*)\}")


def block(latex: str) -> str:
    """Return an equation as HTML, with its number."""
    tag = _TAG.search(latex)
    shown = f'<div class="equation__body">{_mathml(_TAG.sub("", latex), "block")}</div>'
    if tag is None:
        return f'<div class="equation" data-search-exclude>{shown}</div>'
    number = f'<div class="equation__number">({tag[1]})</div>'
    return f'<div class="equation" id="eq-{tag[1]}" data-search-exclude>{shown}{number}</div>'


def inline(latex: str) -> str:
    """Return an equation within a line as HTML."""
    return _mathml(latex, "inline")


def _mathml(latex: str, display: str) -> str:
    """Return LaTeX as MathML; a command that is not known is an error, not a word of the equation."""
    text = convert(_WORD.sub(r"\\text{\1}", latex.strip()), display=display)
    unknown = [
        each.text for each in ElementTree.fromstring(text).iter() if (each.text or "").startswith("\\")
    ]
    if unknown:
        raise ValueError(f"{' '.join(map(str, unknown))} in the equation {latex.strip()!r} is not known")
    return text


class _Blocks(Preprocessor):
    def run(self, lines: list[str]) -> list[str]:
        """Replace fenced equations by placeholders of their HTML."""

        def stored(match: re.Match[str]) -> str:
            return f"\n{self.md.htmlStash.store(block(match[1]))}\n"

        return _FENCE.sub(stored, "\n".join(lines)).split("\n")


class _Inline(InlineProcessor):
    def handleMatch(self, m: re.Match[str], data: str) -> tuple[Any, int, int]:
        """Replace ``$`x`$`` by a placeholder of its HTML."""
        return self.md.htmlStash.store(inline(m[1])), m.start(0), m.end(0)


class Equations(Extension):
    """The Markdown extension."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Look for equations after line ends are normalised (30), before fenced code (25) and inline code."""
        md.preprocessors.register(_Blocks(md), "equations", 27)
        md.inlinePatterns.register(_Inline(r"\$`([^`]+)`\$", md), "equation", 200)
