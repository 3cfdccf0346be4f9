"""Tool libraries of other people: how many tools are read, and why the others are not.

    python benchmarks/tool_libraries.py FOLDER [FOLDER …]

Reads every library below the folders as `gcode2krl tools import` does: Fusion (.json, .tools, .csv), FreeCAD
(.fctl; .fctb where there is no .fctl), LinuxCNC (.tbl, in mm). A tool is *read* where a section of a cell
comes out, *open* where something is left to be stated (`--set`), *unread* where a cell cannot describe it.
The exit code is always 0: figures are printed, not judged.
"""

import argparse
import re
from collections import Counter
from pathlib import Path

from gcode2krl.cell.tool_files import read_tools, sections_of
from gcode2krl.errors import Gcode2KrlError

ENDINGS = (".json", ".tools", ".csv", ".fctl", ".fctb", ".tbl")


def judged(file: Path) -> tuple[Counter, str]:
    """Return the counts of one library, and why it is none."""
    try:
        tools = read_tools(file, "mm")
    except Gcode2KrlError as error:
        return Counter(), error.issues[0].message
    sections, issues = sections_of(tools, {}, file.name)
    counts = Counter(tools=len(tools), read=len(sections))
    counts["with length"] = sum("length_mm" in keys for keys in sections.values())
    for issue in issues:
        if issue.severity == "warning":
            why = re.sub(r"^.*?: ", "", issue.message.removesuffix("; left out"), count=1)
            why = re.sub(r"the file \S+", "the file of its cutter", why)
            kind = "open" if "not stated" in why or "number" in why else "unread"
            counts[kind] += 1
            counts[f"  {kind}: {why[:60]}"] += 1
    return counts, ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    folders = parser.parse_args().folders
    files = [
        file for folder in folders for file in sorted(folder.rglob("*")) if file.suffix.lower() in ENDINGS
    ]
    in_libraries = {file.parent for file in files if file.suffix.lower() == ".fctl"}
    if in_libraries:  # FreeCAD keeps the cutters beside the libraries that name them
        files = [file for file in files if file.suffix.lower() != ".fctb"]
    total, none = Counter(), []
    for file in files:
        counts, why = judged(file)
        if why:
            none.append((file.name, why))
            continue
        total += counts
        numbers = (f"{name} {counts[name]:4}" for name in ("tools", "read", "open", "unread", "with length"))
        print(f"{file.name[:42]:42}", *numbers)
    print(f"{len(files) - len(none)} libraries, {len(none)} files that are none")
    for name in ("tools", "read", "with length", "open", "unread"):
        print(f"  {name:12} {total[name]}")
    for name, count in total.most_common():
        if name.startswith("  "):
            print(f"    {count:4} {name.strip()}")
    for name, why in none[:20]:
        print(f"  no library: {name[:50]}: {why[:80]}")


if __name__ == "__main__":
    main()
