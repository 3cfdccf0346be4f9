"""Programs from elsewhere: translated at once, after one round of remedies, or not at all.

``python benchmarks/strangers.py FOLDER [FOLDER …] [--most N] [--tools LIBRARY] [--json]`` runs the command
line on every G-code file below the folders, each in a process of its own with a time limit, as a user would
type it: the built-in cell, no options but --tools. Where the program is refused, each printed remedy that
`remedies` and `mended` know is followed (a key in a cell based on the demonstration, an option, a word of the
program, the part moved into reach), and it is run again: after one round of remedies, or after a second one.
Programs in a language that is not read yet (expressions, subprograms, cutter compensation, canned cycles,
probing, turning) are counted apart. The exit code is always 0: figures are printed, not judged.
"""

import argparse
import json
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

ENDINGS = (".nc", ".ngc", ".gcode", ".tap", ".cnc", ".mpf")
LANGUAGE = frozenset(
    {
        "o-word",
        "unsupported-g",
        "unsupported-m",
        "unknown-g",
        "expression",
        "rotary-axis",
        "binary-file",
        "no-motion",
    }
)
"""Codes of findings that say a language is not read yet, or that a file is no program (a subprogram file)."""
_FINDING = re.compile(
    r"^(?:(?P<place>.+?): )?(?P<severity>error|warning|note): (?P<message>.*?)"
    r"(?: \[(?P<code>[a-z0-9-]+)\])?(?: -> (?P<remedy>.*))?$"
)
MOST_LINES_OF_ONE_CAUSE = 10
NOT_TURNED = "a_deg = 0.0, b_deg = 0.0, c_deg = 0.0"


@dataclass(frozen=True)
class Attempt:
    """One run of the command line."""

    exit_code: int | None
    """None: over the time limit."""
    seconds: float
    errors: tuple[tuple[str, str], ...]
    """Code and message of each printed error."""
    warnings: tuple[str, ...]
    longest_list: int
    """Lines printed for the commonest code."""
    printed: str


@dataclass(frozen=True)
class Result:
    """Result for one program."""

    name: str
    verdict: str
    """at once, after remedies, after more, refused, language, time."""
    codes: tuple[str, ...]
    remedies: tuple[str, ...]
    seconds: float
    longest_list: int
    last_words: tuple[str, ...]


def attempt(part: Path, folder: Path, arguments: tuple[str, ...], limit_s: float) -> Attempt:
    """Run ``translate`` on a program in a separate process."""
    started = time.perf_counter()
    command = [sys.executable, "-m", "gcode2krl", "translate", str(part), "-o", str(folder / "PART.src")]
    try:
        done = subprocess.run(
            [*command, *arguments],
            capture_output=True,
            timeout=limit_s,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        return Attempt(None, time.perf_counter() - started, (), (), 0, "")
    printed = done.stderr.decode("utf-8", "replace")
    found = [match for line in printed.splitlines() if (match := _FINDING.match(line))]
    errors = tuple((m["code"] or "-", m["message"]) for m in found if m["severity"] == "error")
    warnings = tuple(m["code"] or "-" for m in found if m["severity"] == "warning")
    longest = max(Counter(m["code"] for m in found).values(), default=0)
    return Attempt(done.returncode, time.perf_counter() - started, errors, warnings, longest, printed)


def remedies(first: Attempt, extent_mm: str) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield code, text for the cell and options, for each error whose printed remedy can be followed."""
    codes = {code for code, _ in first.errors}
    messages = {code: [m for c, m in first.errors if c == code] for code in codes}
    dialects = re.findall(r"-> --dialect ([a-z-]+)", first.printed)
    if "other-dialect" in codes and dialects:
        yield "other-dialect", "", ("--dialect", dialects[0])
    if "[program.cutter]" in first.printed:
        yield "dialect-code", '[program.cutter]\nlead_in = "a"\nd = "radius"\n', ()
    if "g43-missing" in codes:
        yield "g43-missing", '[program]\ntool_length = "from_table"\n', ()
    if any("it was stopped by" in message for message in messages.get("spindle-off", ())):
        yield "spindle-off", "", ("--allow", "spindle-off")
    elif "spindle-off" in codes:
        yield "spindle-off", "[program.start]\nspindle_rpm = 10000.0\n", ()
    if codes & {"undefined-position", "offset-from-unknown"}:
        yield "undefined-position", "[program.start]\nposition_mm = [0.0, 0.0, 50.0]\n", ()
    speeds = [float(s) for m in messages.get("spindle-speed", ()) for s in re.findall(r"^S(\d+) is", m)]
    if speeds:
        yield "spindle-speed", f"[spindle]\nmax_rpm = {max(speeds)}\n", ()
    mounted = [n for m in messages.get("tool-not-changed", ()) for n in re.findall(r"\bT(\d+)\b", m)]
    if mounted:
        yield "tool-not-changed", f"mounted_tool = {mounted[0]}\n", ()
    if codes & {"out-of-reach", "joint-limit", "singularity", "home-limit"} and extent_mm:
        yield "out-of-reach", extent_mm, ()
    unmapped = {m for text in messages.get("m-code-unmapped", ()) for m in re.findall(r"\bM(\d+)\b", text)}
    if unmapped:
        lines = "".join(
            f'M{number} = "; M{number} does nothing here"\n' for number in sorted(unmapped, key=int)
        )
        yield "m-code-unmapped", f"[m_code]\n{lines}", ()
    unknown = {
        t
        for code in ("tool-unknown", "tool-undeclared")
        for text in messages.get(code, ())
        for t in re.findall(r"\bT(\d+)\b|tool (\d+)", text)
    }
    for number in sorted({int(a or b) for a, b in unknown}):
        yield "tool-unknown", f"[tool.{number}]\ndiameter_mm = 6.0\nteeth = 2\nlength_mm = 100.0\n", ()
    offsets = {
        m
        for text in messages.get("work-offset-unknown", ())
        for m in re.findall(r"\bG5[4-9](?:\.[123])?(?![\d.])", text)
    }
    for offset in sorted(offsets):
        place = f"x_mm = 0.0, y_mm = 0.0, z_mm = 0.0, {NOT_TURNED}"
        yield "work-offset-unknown", f'[work_offsets]\n"{offset}" = {{ {place} }}\n', ()
    heights = [float(m) for m in re.findall(r"raise \[clearance\] z_mm to ([-\d.]+)", first.printed)]
    if heights and "above-clearance" in codes:
        yield "above-clearance", f"[clearance]\nz_mm = {max(heights) + 5.0:.1f}\n", ()
    for code in ("unit-doubtful", "cut-off", "h-differs"):
        if code in codes:
            yield code, "", ("--allow", code)


def mended(text: bytes, first: Attempt) -> tuple[bytes, tuple[str, ...]]:
    """Return the program after the remedies that change its text, and the codes of their findings."""
    codes = {code for code, _ in first.errors}
    done = []
    if "comment-nested" in codes:
        text = b"\n".join(map(_without_inner_comments, text.split(b"\n")))
        done.append("comment-nested")
    if "line-ends" in codes:
        text = text.replace(b"\r", b"\n")
        done.append("line-ends")
    if any(code == "bad-character" and "'*'" in message for code, message in first.errors):
        text = re.sub(rb"\*\d+[ \t]*(?=\r?$)", b"", text, flags=re.MULTILINE)
        done.append("bad-character")
    for code, remedy, pattern, by in _TEXT_REMEDIES:
        if code in codes and remedy in first.printed:
            text = re.sub(pattern, by, text, count=int(code == "no-feed"), flags=re.MULTILINE | re.IGNORECASE)
            done.append(code)
    return text, tuple(done)


_TEXT_REMEDIES = (
    ("bad-character", "remove the line: $", rb"^\s*\$.*$", b""),
    (
        "no-number",
        "or remove the letter",
        rb"^(\s*(?:N\d+)?\s*G0*28)((?:\s*[XYZ])+)(?=\s*(?:[;(]|\r?$))",
        rb"\1",
    ),
    ("unknown-letter", "write it out", rb"[-+]?\d*\.?\d+\^?e-(?:[6-9]|\d\d+)", b"0"),
    ("unknown-g", "remove G50", rb"\bG50\b(?!\.)", b""),
    ("no-feed", "program F before", rb"^([^;(\n]*\bG0*[123]\b[^;(\r\n]*)", rb"\1 F600"),
    ("feed-too-high", "write at most that", rb"F\d{6,}(?:\.\d*)?", b"F120000"),
)
"""Remedies that change the text: the code, words of the remedy, what is replaced, and by what."""


def _without_inner_comments(line: bytes) -> bytes:
    """Return a line whose comments hold no ( and )."""
    depth, kept = 0, bytearray()
    for byte in line:
        depth += (byte == ord("(")) - (byte == ord(")"))
        inner = (byte == ord("(") and depth > 1) or (byte == ord(")") and depth > 0)
        if not inner:
            kept.append(byte)
    return bytes(kept)


def try_program(part: Path, limit_s: float, always: tuple[str, ...] = ()) -> Result:
    """Run a program at once and, while it is refused, once or twice more with its remedies followed.

    ``always`` are options of all runs.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        again, cell = folder / part.name, folder / "cell.toml"
        done = first = attempt(part, folder, always, limit_s)
        followed: list[tuple[str, str, tuple[str, ...]]] = []
        text, names = part.read_bytes(), dict[str, None]()
        for verdict in ("at once", "after remedies", "after more"):
            if done.exit_code is None:
                return Result(part.name, "time", _codes(done), tuple(names), done.seconds, 0, ())
            if done.exit_code == 0:
                codes = first.warnings if done is first else _codes(first)
                longest = first.longest_list
                return Result(part.name, verdict, codes, tuple(names), first.seconds, longest, ())
            new = [one for one in remedies(done, _into_reach(part)) if one not in followed]
            text, changed = mended(text, done)
            if verdict == "after more" or not (new or changed):
                break
            followed += new
            names |= dict.fromkeys((*(code for code, _, _ in new), *changed))
            again.write_bytes(text)
            cell.write_text(
                'based_on = "demonstration"\n' + _joined(text for _, text, _ in followed), "utf-8"
            )
            options = (word for _, _, words in followed for word in words)
            done = attempt(again, folder, ("--cell", str(cell), *options, *always), limit_s)
        last_words = tuple(message[:110] for _, message in done.errors[:3])
        verdict = "language" if set(_codes(done)) & LANGUAGE else "refused"
        return Result(part.name, verdict, _codes(done), (), first.seconds, first.longest_list, last_words)


def _codes(done: Attempt) -> tuple[str, ...]:
    return tuple(sorted({code for code, _ in done.errors}))


def _joined(texts: Iterator[str]) -> str:
    """Return the text of a cell, plain keys before tables, each table and key once, as said last."""
    tables: dict[str, dict[str, str]] = {"": {}}
    for text in texts:
        head = ""
        for line in text.splitlines():
            if line.startswith("["):
                head = line
            else:
                tables.setdefault(head, {})[line.partition(" = ")[0]] = line
    return "\n".join(line for head, keys in tables.items() for line in (head, *keys.values())) + "\n"


def _into_reach(part: Path) -> str:
    """Return a ``$BASE`` that puts the middle of the program where the demonstration cell reaches well."""
    from gcode2krl import Gcode2KrlError, load_cell, read_gcode

    try:
        path = read_gcode(part, load_cell())
    except Gcode2KrlError:
        return ""
    place = path.position_mm[1:][~path.machine[1:]]
    if len(place) == 0:
        return ""
    low, high = place.min(axis=0), place.max(axis=0)
    x_mm, y_mm, z_mm = (*(-(low + high)[:2] / 2.0), -low[2])
    base = f"x_mm = {1600.0 + x_mm:.1f}, y_mm = {y_mm:.1f}, z_mm = {760.0 + z_mm:.1f}, {NOT_TURNED}"
    plane = f"[clearance]\nz_mm = {max(100.0, high[2] + 5.0):.1f}\n"
    return f'[frames]\nspin = "auto"\nbase = {{ {base} }}\n{plane}'


def programs(folders: list[Path], most: int | None, seed: int) -> list[Path]:
    """Return the G-code files below the folders, at most ``most`` of each, drawn by the seed."""
    chosen: list[Path] = []
    for folder in folders:
        found = (
            [folder]
            if folder.is_file()
            else sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS)
        )
        if most is not None and len(found) > most:
            found = sorted(random.Random(seed).sample(found, most))
        chosen += found
    return chosen


def main(argv: list[str] | None = None) -> None:
    """Run the programs and print the result of each, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--most", type=int, help="At most so many programs of each folder, drawn by --seed.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=300.0, help="Time limit for each run.")
    parser.add_argument("--tools", type=Path, help="A library of tools for every run.")
    parser.add_argument("--json", action="store_true", help="One JSON object on standard output.")
    options = parser.parse_args(argv)
    results = []
    for part in programs(options.folders, options.most, options.seed):
        always = ("--tools", str(options.tools)) if options.tools is not None else ()
        result = try_program(part, options.seconds, always)
        results.append(result)
        if not options.json:
            tail = ", ".join(result.remedies or result.codes)
            print(
                f"{result.verdict:<15} {result.seconds:6.1f} s  {result.longest_list:>3}  "
                f"{result.name:<44} {tail}"
            )
            for words in result.last_words:
                print(f"{'':28} | {words}")
            sys.stdout.flush()
    counts = Counter(result.verdict for result in results)
    read = [r for r in results if r.verdict != "language"]
    figures = {
        "programs": len(results),
        **{
            name: counts[name]
            for name in ("at once", "after remedies", "after more", "refused", "time", "language")
        },
        "refused by the pilot": sum(
            any(c.startswith("pilot") for c in r.codes) for r in read if r.verdict == "refused"
        ),
        "refused by corner-tolerance": sum(
            "corner-tolerance" in r.codes for r in read if r.verdict == "refused"
        ),
        "more than ten lines for one cause": sum(r.longest_list > MOST_LINES_OF_ONE_CAUSE for r in results),
    }
    if options.json:
        json.dump(
            {"programs": [asdict(result) for result in results], "totals": figures}, sys.stdout, indent=2
        )
        return
    print()
    for name, count in figures.items():
        print(f"{name:<36} {count}")


if __name__ == "__main__":
    main()
