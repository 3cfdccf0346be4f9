"""Write docs/krl_truth.md, the table of the KRL and RSI that is written, from ``constructs.toml``.

python docs/make_krl_truth.py
"""

from collections import Counter
from pathlib import Path

from gcode2krl.krl.constructs import Construct, all_constructs, sources

PAGE = Path(__file__).with_name("krl_truth.md")
_HEAD = """# The truth about each KRL construct

Made by `docs/make_krl_truth.py` from `gcode2krl/krl/constructs.toml`: each construct of KRL and RSI that a
program or a file beside it may have, what we rely on, and what public source says so. No controller has run
a program of ours yet.

- *right*: a manual, a file that KUKA's RSI Visual made, or a program that ran on a controller says so.
- *probable*: a public program or page has the same form; nobody is known to have checked what we rely on.
- *assumed*: nothing public was found, or only something similar. The header of a program and the check list
  of `runkit` name those that this program uses, under "ASSUMED, look at this in T1".

"""
_VERSIONS = """## Versions

`[controller] kss` and `rsi` of the cell say what the controller runs (*Help > Info*). Without them a
program is written for KSS 8.x and RSI 3, and its header says that this is assumed.

| KSS | RSI | signal flow | `RSI_CREATE` | written |
| --- | --- | --- | --- | --- |
| 8.3 | 3 (3.2, 3.3) | `NAME.rsi.xml`, counts from 1 | `"NAME.rsi"` | up to 4 MB (`program-memory`) |
| 8.5 | 4 (4.0) | `NAME.rsix`, counts from 0 | `"NAME"` | everything |
| 8.6 | 4 (4.1) | `NAME.rsix` | `"NAME"` | everything |
| 8.7 | 5 (5.0) | `NAME.rsix` | `"NAME"` | everything |
| iiQKA | 6 | `.rsix`, by iiQWorks | none: `RSI_LOAD`, `RSI_ACTIVATE` … | nothing (`kss-iiqka`) |

A pair that does not belong together, such as `kss = "8.3"` with `rsi = "5"`, is refused when the cell is
read. The pairs are those of the headers that RSI Visual writes into its files, and of the tables of ROS
drivers. The lists of all objects in the files for RSI 4.1 (B567) and 5.0 (B485) agree in every object,
number and parameter that we write; a file for RSI 4.0 (B3083) has the same form. Files of RSI 3 were
compared with signal flows that have run on a KR 16-2. That KSS 8.3 holds about 4 MB of programs (another
report says 8 MB) is what users write in robot-forum.com thread 49620 and on industrialmonitordirect.com;
splitting into files does not help there, as all lie in R1 at once.

"""


def page() -> str:
    """Return the page."""
    counts = Counter(each.sure for each in all_constructs())
    counted = ", ".join(f"{counts[sure]} {sure}" for sure in ("right", "probable", "assumed"))
    named = "".join(f"- *{short}*: {text}\n" for short, text in sources().items())
    table = "".join(_row(each) for each in all_constructs())
    head = "| construct | what we rely on | source | sure | from |\n| --- | --- | --- | --- | --- |\n"
    rows = f"{len(all_constructs())} constructs: {counted}.\n\n{head}{table}"
    return f"{_HEAD}{rows}\n{_VERSIONS}## Sources\n\n{named}"


def _row(each: Construct) -> str:
    watched = f"; in T1: {each.look}" if each.look else ""
    cells = (each.name, f"{each.relies}{watched}", ", ".join(each.source), each.sure, each.since)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
