"""Rooms of a package: what stands directly below a folder, and the imports between its modules."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from import_graph_reading import Import, Module, floors, graph_of, imports_of, modules_of, room_of

Arrow = tuple[str, str]


@dataclass(frozen=True)
class Map:
    """What stands directly below a root, and the imports between its modules."""

    root: str
    modules: dict[str, Module]
    """Those below the root."""
    inner: list[Import]
    """From one of these to another."""
    outer: list[Import]
    """From one of these to the rest of the package."""

    def room(self, name: str) -> str:
        """Return the room of a module below the root."""
        return room_of(name, self.root) or name

    @property
    def rooms(self) -> list[str]:
        """Return the rooms, by name."""
        return sorted({self.room(name) for name in self.modules})

    @property
    def arrows(self) -> dict[Arrow, Counter[str]]:
        """Return how many imports lead from room to room, by the time when they happen."""
        found: dict[Arrow, Counter[str]] = {}
        for each in self.inner:
            ends = self.room(each.importer), self.room(each.imported)
            if ends[0] != ends[1]:
                found.setdefault(ends, Counter())[each.when] += 1
        return dict(sorted(found.items()))

    @property
    def floors(self) -> dict[str, int]:
        """Return the floor of each room; imports for types alone do not count."""
        arrows = [ends for ends, count in self.arrows.items() if count["import"] or count["function"]]
        return floors(graph_of(arrows, self.rooms))


def map_of(package: Path, room: str | None = None) -> Map:
    """Read a package, or one room of it. Raises ValueError where there is no such package or room."""
    modules = modules_of(package)
    top = package.name
    root = f"{top}.{room}" if room else top
    if root not in modules or (room and not modules[root].is_package):
        names = sorted(
            {room_of(name, top) or "" for name, one in modules.items() if one.is_package} - {"__init__"}
        )
        raise ValueError(f"{top} has no room {room!r}: name one of {', '.join(names)}")
    below = {name: one for name, one in modules.items() if name == root or name.startswith(f"{root}.")}
    imports = [each for each in imports_of(modules) if each.importer in below]
    inner = [each for each in imports if each.imported in below]
    return Map(root, below, inner, [each for each in imports if each.imported not in below])


def count_text(count: Counter[str]) -> str:
    """Return the imports of an arrow: those at import, +f in functions, +t for types alone."""
    text = str(count["import"]) if count["import"] else ""
    text += f"+{count['function']}f" if count["function"] else ""
    return text + (f"+{count['types']}t" if count["types"] else "")
