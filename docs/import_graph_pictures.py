"""The rooms of a package as a picture: boxes by floors, arrows from who imports to what is imported."""

from pathlib import Path

from import_graph_map import Map, count_text


def dot(m: Map) -> str:
    """Return the rooms as a graph for Graphviz."""
    lines = [f'digraph "{m.root}" {{', "  rankdir = TB; node [shape = box];"]
    height = m.floors
    for floor in sorted(set(height.values()), reverse=True):
        names = "; ".join(f'"{room}"' for room in m.rooms if height[room] == floor)
        lines.append(f"  {{ rank = same; {names} }}")
    for (a, b), count in m.arrows.items():
        style = "" if count["import"] else ", style = dashed"
        lines.append(f'  "{a}" -> "{b}" [label = "{count_text(count)}"{style}];')
    return "\n".join([*lines, "}", ""])


def draw(m: Map, file: Path) -> None:
    """Draw the rooms by floors; the more imports, the wider an arrow.

    Dashed where functions or types alone make the imports, red where they do not lead down.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    height = m.floors
    storeys = [[r for r in m.rooms if height[r] == floor] for floor in range(max(height.values()) + 1)]
    widest = max(len(storey) for storey in storeys)
    place = {
        room: ((i + 0.4 + 0.2 * (floor % 2)) / len(storey), float(floor))
        for floor, storey in enumerate(storeys)
        for i, room in enumerate(storey)
    }
    figure, axes = plt.subplots(figsize=(max(8.0, 1.7 * widest), 1.1 * len(storeys) + 1.0))
    for (a, b), count in m.arrows.items():
        look = {
            "arrowstyle": "-|>",
            "connectionstyle": "arc3,rad=0.08",
            "linewidth": 0.4 + 0.25 * count.total() ** 0.5,
            "linestyle": "-" if count["import"] else "--",
            "color": "#c0392b" if height[a] <= height[b] else "#7f8c8d",
            "shrinkA": 12,
            "shrinkB": 12,
        }
        axes.annotate("", place[b], place[a], arrowprops=look)
    for room, (x, y) in place.items():
        axes.text(x, y, room, ha="center", va="center", bbox={"boxstyle": "round", "facecolor": "#eef3f7"})
    axes.set(xlim=(0.0, 1.0), ylim=(-0.6, len(storeys) - 0.4), title=f"{m.root}: imports between rooms")
    axes.axis("off")
    figure.savefig(file, bbox_inches="tight")
    plt.close(figure)
