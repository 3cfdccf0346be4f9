"""Write docs/findings.md, the table of all findings, from ``gcode2krl/codes.toml``.

python docs/make_findings.py
"""

from pathlib import Path

from gcode2krl.codes import Code, all_codes

PAGE = Path(__file__).with_name("findings.md")
_HEAD = """# Findings

Made by `docs/make_findings.py` from `gcode2krl/codes.toml`; `gcode2krl explain CODE` prints one of them.

A finding is one line: `part.nc:12: error: what is wrong [code] -> what to do`. An *error* refuses the
program (nothing is written), a *warning* does so with `--strict` only, a *note* never. Where a severity is
"error, warning", the reason says when it is which.

- Errors stand first. Equal findings are one line that names the first lines and counts the rest; at most 20
  lines are printed, at most eight of one code, then the count. `--json` lists every finding.
- What only follows from another finding (a feed that is missing because the line that sets it could not be
  read) is counted behind its cause and not printed. Mend the cause, and it goes or is shown.
- `--allow CODE:LINE` releases an error by hand; the last column says when a person may. The program's header
  lists it. "never" cannot be released. A finding is released even where it is only counted.

| code | severity | why | example | remedy | allow |
| --- | --- | --- | --- | --- | --- |
"""


def page() -> str:
    """Return the page."""
    return _HEAD + "".join(_row(code) for code in all_codes().values())


def _row(code: Code) -> str:
    cells = (f"`{code.name}`", code.severity, code.why, code.example, code.remedy, code.allow)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
