"""Links that the documents leave to the site: a document that is named, and the code of a finding."""

import re
from collections.abc import Collection

_FENCE = re.compile(r"(^ *```.*?^ *```$)", re.M | re.S)
_SPAN = re.compile(r"(?<!\[)(`[^`\n]+`)(?!\]|`)")
_DOCUMENT = re.compile(r"(?<!\]\()(?<![\w/.`])docs/(\w+)\.md")


def linked(markdown: str, page: str, documents: Collection[str], findings: Collection[str]) -> str:
    """Return a page with links in place of ``docs/name.md`` and of the codes of findings.

    ``page`` is its own path below ``docs``; ``documents`` are the names that exist, without ``.md``. A code
    of one word, such as ``allow``, may mean something else and is left as it is.
    """
    up = "../" * page.count("/")

    def document(match: re.Match[str]) -> str:
        name = match[1]
        return f"[{name.replace('_', ' ')}]({up}{name}.md)" if name in documents else match[0]

    def span(text: str) -> str:
        word = text.strip("`")
        if "-" in word and word in findings and page != f"findings/{word}.md":
            return f"[{text}]({up}findings/{word}.md)"
        return document(whole) if (whole := _DOCUMENT.fullmatch(word)) else text

    def prose(text: str) -> str:
        pieces = _SPAN.split(text)
        return "".join(
            span(piece) if k % 2 else _DOCUMENT.sub(document, piece) for k, piece in enumerate(pieces)
        )

    blocks = _FENCE.split(markdown)
    return "".join(block if k % 2 else prose(block) for k, block in enumerate(blocks))
