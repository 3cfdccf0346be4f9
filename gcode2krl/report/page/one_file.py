"""The page as one file: template, style, scripts, libraries and data inside it, nothing fetched."""

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from gcode2krl.files import write_together
from gcode2krl.report.page.content import Content, duration
from gcode2krl.version import __version__

HERE = Path(__file__).parent
LIBRARIES = HERE / "vendor"
_SCRIPTS = ("data.js", "simplify.js", "lines.js", "scene.js", "robot.js", "plots.js", "listing.js")
_PART_COLOURS = {
    "error": "error by deflection",
    "nominal": "above the nominal part",
    "force": "force",
    "tool": "tool",
    "plain": "plain",
    "": "hidden",
}
_COMMENT_OR_MARGIN = re.compile(r"^[ \t]*//.*\n|^[ \t]+", re.MULTILINE)
_EXPORT = re.compile(r"export\s*\{([^{}]*)\}\s*;?\s*$")
_BACKTICKS = re.compile("`([^`]+)`")
_IMPORT = re.compile(r"import\s*\{([^{}]*)\}\s*from\s*['\"]three['\"]\s*;")


def write_page(content: Content, file: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Write the page; raises `NotUnderstoodError` where the file cannot be written or is an input."""
    write_together({file: page(content).encode("utf-8")}, inputs)


def page(content: Content) -> str:
    """Return the page as text."""
    return (
        environment()
        .get_template("page.html.j2")
        .render(
            content=content,
            base_css=base_css(),
            page_css=_text(HERE / "page.css"),
            plot_css=_text(LIBRARIES / "uPlot.min.css"),
            part_colours=_part_colours,
            script=_script(content.head["rows"] > 0, bool(content.part))
            if content.head["rows"] or content.head["has_text"]
            else "",
            version=__version__,
        )
    )


def _part_colours(content: Content) -> list[tuple[str, str]]:
    """Return what the part may be coloured by, with words."""
    drawn = {*content.head["part"]["ends"], *(one["name"] for one in content.head["quantities"])}
    always = ("tool", "plain", "")
    return [(name, words) for name, words in _PART_COLOURS.items() if name in drawn or name in always]


def base_css() -> str:
    """Return the style that all pages of the package share."""
    return _text(HERE / "base.css")


def environment() -> jinja2.Environment:
    """Return what renders the page's templates; text is escaped."""
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"duration": duration, "figure": figure, "coded": coded}
    return made


def figure(value: float) -> str:
    """Return a number with about three digits."""
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{value:.1f}" if abs(value) >= 10.0 else f"{value:.2f}"


def coded(text: str) -> Markup:
    """Return a sentence as HTML, with what stands between backticks as code."""
    return Markup(_BACKTICKS.sub(r"<code>\1</code>", str(escape(text))))


@cache
def _script(has_path: bool, has_part: bool) -> str:
    """Return the scripts as one module, with the libraries where there is a path to draw.

    Comments and indentation stay behind.
    """
    names = (*_SCRIPTS, *(("heights.js", "surface.js", "part.js") if has_part else ()), "page.js")
    scripts = [_COMMENT_OR_MARGIN.sub("", _text(HERE / name)) for name in names]
    if not has_path:
        return "\n".join(scripts)
    libraries = [
        _comment(LIBRARIES / "three.LICENSE"),
        as_constant(_text(LIBRARIES / "three.module.min.js"), "THREE"),
        as_constant(_text(LIBRARIES / "OrbitControls.js"), "CONTROLS"),
        _comment(LIBRARIES / "uPlot.LICENSE"),
        _text(LIBRARIES / "uPlot.iife.min.js"),
    ]
    return "\n".join([*libraries, *scripts])


def as_constant(module: str, name: str) -> str:
    """Return a module of one file as a constant that holds what it exports.

    A page that is opened from a disk may not import another file, so that ``import`` and ``export`` at the
    module's ends become an assignment. Raises `ValueError` where it does not end in one list of exports.
    """
    ending = _EXPORT.search(module)
    if ending is None:
        raise ValueError(f"{name}: the module does not end in a list of exports")
    exported = [each.split(" as ") for each in re.split(r"\s*,\s*", ending[1].strip().strip(","))]
    members = ",".join(f"{pair[-1]}:{pair[0]}" for pair in exported)
    body = _IMPORT.sub(lambda found: f"const {{{found[1]}}} = THREE;", module[: ending.start()])
    return f"const {name} = (() => {{\n{body}\nreturn {{{members}}};\n}})();"


def _comment(file: Path) -> str:
    """Return a licence as a comment: every copy of the library carries it."""
    return f"/*\n{_text(file)}*/"


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")
