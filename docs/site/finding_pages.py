"""A page for each finding, from the one table ``gcode2krl/codes.toml``."""

import re

from gcode2krl.codes import Code, all_codes

_PAGE = """---
title: {name}
search:
  boost: 2
---

# `{name}`

**{severity}** · [all findings](../findings.md)

{why}

## Example

> {example}

## What to do

{remedy}

## May it be released?

{allow}{release}

{relatives}At the terminal: `gcode2krl explain {name}`
"""


def pages() -> dict[str, str]:
    """Return the pages by their paths below ``docs``."""
    codes = all_codes()
    return {f"findings/{name}.md": _page(code, codes) for name, code in codes.items()}


def linked(table: str) -> str:
    """Return the page of all findings with each code a link to its page, which has example and remedy."""
    head = re.compile(r"^\| code \|.*\n\|.*\n", re.M)
    rows = re.compile(r"^\| `([a-z0-9-]+)` \| ([^|]*) \| ((?:\\\||[^|])*) \|.*$", re.M)
    shorter = head.sub("| code | severity | why |\n| --- | --- | --- |\n", table)
    shorter = shorter.replace("the last column says when", "its page says when")
    return rows.sub(r"| [`\1`](findings/\1.md) | \2 | \3 |", shorter)


def _page(code: Code, codes: dict[str, Code]) -> str:
    releasable = "error" in code.severity and not code.allow.startswith("never")
    return _PAGE.format(
        name=code.name,
        severity=code.severity,
        why=code.why,
        example=code.example,
        remedy=code.remedy,
        allow=code.allow[:1].upper() + code.allow[1:] + ("" if code.allow.endswith(".") else "."),
        release=f" Then:\n\n```text\n--allow {code.name}:LINE\n```" if releasable else "",
        relatives=_relatives(code, codes),
    )


def _relatives(code: Code, codes: dict[str, Code]) -> str:
    """Return the findings that this one follows from, and those that follow from it."""
    after = [each.name for each in codes.values() if code.name in each.follows]
    kinds = (
        ("Counted behind its cause where it follows from", code.follows),
        ("What may follow from it", after),
    )
    return "".join(
        f"{words}: {', '.join(f'[`{name}`]({name}.md)' for name in names)}.\n\n"
        for words, names in kinds
        if names
    )
