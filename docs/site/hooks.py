"""What mkdocs calls while it builds the site: equations, generated pages, pictures that the tool draws."""

import tempfile
from pathlib import Path

import crosslinks
import finding_pages
import pictures
import reference
from mathml import Equations
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from gcode2krl.codes import all_codes

ROOT = Path(__file__).resolve().parents[2]
ASSETS = Path(__file__).with_name("assets")
DOCUMENTS = {path.stem for path in (ROOT / "docs").glob("*.md")}
_scratch = tempfile.TemporaryDirectory(prefix="gcode2krl-site-")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the Markdown extension that turns equations into MathML."""
    config.markdown_extensions.append(Equations())
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and pictures that are made at build; a picture replaces the one in ``docs/images``."""
    pages = {
        "contributing.md": (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"),
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        "reference.md": reference.page(),
        **finding_pages.pages(),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    made = pictures.draw(Path(_scratch.name))
    for name, path in {**made, **{each.name: each for each in ASSETS.iterdir()}}.items():
        earlier = files.get_file_from_path(name)
        if earlier is not None:
            files.remove(earlier)
        files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links at the pages of the site, and the table of findings at the page of each."""
    name = page.file.src_uri
    if name in ("contributing.md", "changelog.md"):
        markdown = markdown.replace("](docs/", "](")
    if name == "findings.md":
        markdown = finding_pages.linked(markdown)
    markdown = markdown.replace(*pictures.LIVE_REPORT).replace(
        "`CONTRIBUTING.md`", "[contributing](contributing.md)"
    )
    return crosslinks.linked(markdown, name, DOCUMENTS, all_codes())


def on_post_build(config: MkDocsConfig) -> None:
    """Remove what the pictures were made from."""
    _scratch.cleanup()
