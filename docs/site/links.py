"""Check a built site: every link and anchor leads somewhere on it, and nothing is loaded from elsewhere.

mkdocs checks links between Markdown pages; this reads the HTML, with what plugins and templates put into it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {("script", "src"), ("link", "href"), ("img", "src"), ("iframe", "src"), ("source", "src")}
"""What a browser fetches without being asked."""
_NOT_FETCHED = {"canonical", "prev", "next", "alternate"}


@dataclass
class _Page(HTMLParser):
    """Ids and links of one page."""

    ids: set[str] = field(default_factory=set)
    links: list[tuple[str, bool]] = field(default_factory=list)
    """Address, and whether the browser fetches it by itself."""

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids and addresses."""
        values = {name: value for name, value in attrs if value is not None}
        self.ids |= {values[name] for name in ("id", "name") if name in values}
        for name in ("href", "src"):
            if name in values:
                fetched = (tag, name) in LOADED and values.get("rel") not in _NOT_FETCHED
                self.links.append((values[name], fetched))


def broken(site: Path) -> list[str]:
    """Return a line for each link that leads nowhere and each file that is fetched from elsewhere."""
    pages = {path.resolve(): _read(path) for path in sorted(site.rglob("*.html"))}
    return [
        f"{path.relative_to(site.resolve())}: {address}: {trouble}"
        for path, page in pages.items()
        for address, trouble in _troubles(path, page, pages, site.resolve())
    ]


def _read(path: Path) -> _Page:
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def _troubles(path: Path, page: _Page, pages: dict[Path, _Page], site: Path) -> Iterator[tuple[str, str]]:
    for address, fetched in page.links:
        parts = urlsplit(address)
        if parts.scheme == "data":
            continue
        if parts.scheme or parts.netloc:
            if fetched:
                yield address, "is fetched from elsewhere"
            continue
        target = _target(path, unquote(parts.path), site)
        if not target.is_file():
            yield address, "no such file"
        elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
            yield address, "no such anchor"


def _target(path: Path, name: str, site: Path) -> Path:
    """Return the file that a link of a page means; the page for missing ones begins its links with ``/``."""
    if name.startswith("/"):
        return site / name.lstrip("/")
    return (path.parent / name).resolve() if name else path
