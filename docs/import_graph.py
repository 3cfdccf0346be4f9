"""The map of the package: rooms, who imports whom, cycles, and the figures of each room.

``python docs/import_graph.py`` reads ``gcode2krl`` of this repository; ``--package FOLDER`` another one. A
room is what stands directly in the package, a folder or a file; ``--room gap`` shows what stands in that room
and what it imports of the others. ``-o graph.svg`` (or .png, .pdf, .dot) draws rooms above those they import.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from import_graph_figures import Complex, Figures, complexities, figures
from import_graph_map import Map, count_text, map_of
from import_graph_pictures import dot, draw
from import_graph_reading import TIMES, Import, cycles, graph_of, loops, room_of

PACKAGE = Path(__file__).resolve().parents[1] / "gcode2krl"
MOST_COMPLEX = 15
COLUMNS = {
    "files": "files",
    "lines": "lines",
    "code_lines": "code",
    "functions": "func",
    "classes": "class",
    "constants": "const",
    "fmt_skips": "skip",
    "module_named": "same",
    "array_names": "array",
}
LEGEND = f"""\
figures: code = lines without blank ones, comments and docstrings; func, class, const = functions, classes,
  constants; skip = `# fmt: skip`; same = functions with the name of their module; array = definitions of
  Floats, Ints, Bools; >{MOST_COMPLEX} = functions with a higher complexity"""


def report(package_map: Map) -> str:
    """Return the whole map as text."""
    parts = (_counts, _floors, _arrows, _outside, _cycles, _figures, _complex)
    return "\n\n".join("\n".join(lines) for part in parts if (lines := list(part(package_map))))


def _counts(m: Map) -> Iterator[str]:
    when = Counter(each.when for each in m.inner)
    yield (
        f"{m.root}: {len(m.modules)} files in {len(m.rooms)} rooms, {len(m.inner)} imports between files: "
        f"{when['import']} at import, {when['function']} in functions, {when['types']} for types alone"
    )


def _floors(m: Map) -> Iterator[str]:
    height = m.floors
    yield f"floors: {max(height.values()) + 1}, each imports only what is below"
    for floor in range(max(height.values()), -1, -1):
        yield f"  {floor:2d}  {'  '.join(room for room in m.rooms if height[room] == floor)}"


def _arrows(m: Map) -> Iterator[str]:
    arrows = m.arrows
    yield f"arrows between rooms: {len(arrows)} (imports; +f in functions, +t for types alone)"
    for room in m.rooms:
        leaving = [f"{b} {count_text(count)}" for (a, b), count in arrows.items() if a == room]
        if leaving:
            yield f"  {room} -> {', '.join(leaving)}"


def _outside(m: Map) -> Iterator[str]:
    top = m.root.partition(".")[0]
    if m.root == top:
        return
    count = Counter(room_of(each.imported, top) for each in m.outer)
    yield f"imports of other rooms: {len(m.outer)}"
    yield "  " + ", ".join(f"{room} {n}" for room, n in sorted(count.items(), key=lambda pair: -pair[1]))


def _cycles(m: Map) -> Iterator[str]:
    """Yield the cycles of rooms and of modules, without and with those that types alone close."""
    levels: dict[str, Callable[[str], str]] = {"rooms": m.room, "modules": str}
    for what, node_of in levels.items():
        for name, whens in (("when imported or run", TIMES[:2]), ("types included", TIMES)):
            graph = graph_of(_pairs([each for each in m.inner if each.when in whens], node_of))
            found = [loop for knot in cycles(graph) for loop in loops(graph, knot)]
            yield f"cycles between {what}, {name}: {len(found)}"
            yield from (f"  {' -> '.join([*loop, loop[0]])}" for loop in found)


def _pairs(imports: Sequence[Import], node_of: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    for each in imports:
        pair = node_of(each.importer), node_of(each.imported)
        if pair[0] != pair[1]:
            yield pair


def _figures(m: Map) -> Iterator[str]:
    rooms = {room: Figures() for room in m.rooms}
    above: Counter[str] = Counter()
    for name, module in m.modules.items():
        rooms[m.room(name)] += figures(module.text, module.tree, name)
        above[m.room(name)] += sum(each.complexity > MOST_COMPLEX for each in complexities(module.tree))
    rooms["all"], above["all"] = sum(rooms.values(), Figures()), above.total()
    wide = max(len(room) for room in rooms)
    yield LEGEND
    yield " " * (2 + wide) + "".join(f"{title:>7}" for title in [*COLUMNS.values(), f">{MOST_COMPLEX}"])
    for room, each in rooms.items():
        row = [getattr(each, column) for column in COLUMNS]
        yield f"  {room:{wide}}" + "".join(f"{figure:7d}" for figure in [*row, above[room]])


def _complex(m: Map) -> Iterator[str]:
    found: list[tuple[Complex, str]] = [
        (each, name)
        for name, module in m.modules.items()
        for each in complexities(module.tree)
        if each.complexity > MOST_COMPLEX
    ]
    yield f"functions with a complexity above {MOST_COMPLEX}: {len(found)}"
    for each, name in sorted(found, key=lambda pair: (-pair[0].complexity, pair[1])):
        yield f"  {each.complexity:3d}  {name}.{each.name} (line {each.line})"


def main(given: Sequence[str] | None = None) -> int:
    """Print the map, and draw it where a file is named; exit code 2 where there is no such package."""
    parser = argparse.ArgumentParser(prog="import_graph.py", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--package", type=Path, default=PACKAGE)
    parser.add_argument("--room", help="what stands in this room")
    parser.add_argument("-o", "--output", type=Path, help="a picture: .svg, .png, .pdf or .dot")
    options = parser.parse_args(given)
    try:
        package_map = map_of(options.package.resolve(), options.room)
    except (ValueError, SyntaxError) as error:
        print(f"import_graph: {error}", file=sys.stderr)
        return 2
    print(report(package_map))
    if options.output is not None and options.output.suffix == ".dot":
        options.output.write_text(dot(package_map), encoding="utf-8")
    elif options.output is not None:
        draw(package_map, options.output)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
