"""Read the parameters of a docstring as this project writes them: ``name : what it is``.

The numpy style has the type behind the colon. Here types stand in the signature, so what stands there is the
beginning of the description. Names that share an entry become one each.
"""

import re
from typing import Any

import griffe

_SECTION = re.compile(r"^(Parameters|Returns|Attributes)\n-+\n", re.M)
_ENTRY = re.compile(r"^(\w[\w, *]*) : ([^\n]+(?:\n +[^\n]+)*)", re.M)
_NEXT = re.compile(r"^\w[^\n]*\n-{3,}\n", re.M)


def described(text: str) -> str:
    """Return a docstring whose entries have everything but the name in their description."""
    pieces, end = [], 0
    for section in _SECTION.finditer(text):
        following = _NEXT.search(text, section.end())
        stop = following.start() if following else len(text)
        colon = " :" if section[1] == "Returns" else ""

        def entry(match: re.Match[str], colon: str = colon) -> str:
            return "\n".join(f"{name}{colon}\n    {match[2]}" for name in match[1].split(", "))

        entries = _ENTRY.sub(entry, text[section.end() : stop])
        pieces += [text[end : section.end()], entries]
        end = stop
    return "".join(pieces) + text[end:]


class Described(griffe.Extension):
    """Rewrite each docstring when its object is loaded."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of a module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = described(obj.docstring.value)
