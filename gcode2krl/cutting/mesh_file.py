"""Checks the mesh file of a raw part before a library reads it: its format, and its size when unpacked.

STL (3D Systems 1989), PLY (Turk 1994) and 3MF (core specification 1.3). The header may announce more than the
file holds, a zipped file may unfold to terabytes, an object may contain itself: all of it is refused here.
"""

import io
import re
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

KINDS = ("stl", "ply", "3mf")
REMEDY = "export a closed solid as STL, PLY or 3MF in mm"
MOST_TRIANGLES = 1_200_000
LARGEST_BYTES, LARGEST_TEXT_BYTES, LARGEST_XML_BYTES = 100_000_000, 50_000_000, 35_000_000
"""Largest files. Reading each takes some 1 GB, measured: 2 million triangles of a STL take 1.3 GB, 28 MB of
XML 0.7 GB."""
MOST_INSTANCES, MOST_FILES = 10_000, 1000
_LONGEST_HEADER = 65_536
_SIZES = {
    "char": 1,
    "int8": 1,
    "uchar": 1,
    "uint8": 1,
    "short": 2,
    "int16": 2,
    "ushort": 2,
    "uint16": 2,
    "int": 4,
    "int32": 4,
    "uint": 4,
    "uint32": 4,
    "float": 4,
    "float32": 4,
    "double": 8,
    "float64": 8,
}
_XML_TRICKS = re.compile(rb"<!(?:DOCTYPE|ENTITY)", re.IGNORECASE)


class MeshError(ValueError):
    """The file is not a mesh or may not be read; the text says why, without the file's name."""


def read_mesh_file(file: Path) -> tuple[bytes, str]:
    """Return the bytes of a mesh file and what it is (one of `KINDS`).

    Raises `MeshError` where its ending, its content and its header do not fit each other, `OSError` where it
    cannot be read.
    """
    ending = file.suffix.lower().lstrip(".")
    if ending not in KINDS:
        raise MeshError(f"found {file.suffix or 'no ending'!r}, allowed: .stl, .ply or .3mf")
    with file.open("rb") as stream:
        data = stream.read(LARGEST_BYTES + 1)
    if len(data) > LARGEST_BYTES:
        raise MeshError(f"larger than {LARGEST_BYTES / 1e6:.0f} MB")
    kind = _content(data)
    if kind != ending:
        raise MeshError(f"named .{ending}, but its content is {kind.upper() if kind else 'no mesh'}")
    {"stl": _check_stl, "ply": _check_ply, "3mf": _check_3mf}[kind](data)
    return data, kind


def _content(data: bytes) -> str:
    """Return the kind of a file by its first bytes, "" if none of `KINDS`; binary STL has no mark."""
    if data.startswith(b"PK\x03\x04"):
        return "3mf"
    if re.match(rb"ply\s", data):
        return "ply"
    is_binary = len(data) >= 84 and len(data) == 84 + 50 * _binary_count(data)
    return "stl" if is_binary or data[:1024].lstrip().lower().startswith(b"solid") else ""


def _binary_count(data: bytes) -> int:
    return int.from_bytes(data[80:84], "little")


def _check_stl(data: bytes) -> None:
    if len(data) >= 84 and len(data) == 84 + 50 * _binary_count(data):
        return _check_triangles(_binary_count(data))
    _check_text(data)
    counts = {
        word: len(re.findall(rb"^[ \t]*" + word + rb"\b", data, re.IGNORECASE | re.MULTILINE))
        for word in (b"solid", b"endsolid", b"facet", b"endfacet", b"vertex")
    }
    facets = counts[b"facet"]
    if counts[b"solid"] != counts[b"endsolid"] or counts[b"endfacet"] != facets:
        raise MeshError("the text is cut off: a solid or a facet has no end")
    if counts[b"vertex"] != 3 * facets:
        raise MeshError(f"{counts[b'vertex']} corners of {facets} triangles")
    _check_triangles(facets)


def _check_ply(data: bytes) -> None:
    """Raise where the body is too short for the elements that the header announces."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    body = data.find(b"\n", end) + 1
    if end < 0 or body == 0:
        raise MeshError("no PLY header, or it has no end")
    text, elements = _ply_elements(data[:end].decode("latin-1"))
    if text:
        _check_text(data)
    announced = sum(count * (1 if text else size) for count, size in elements.values())
    available = data.count(b"\n", body) + 1 if text else len(data) - body
    if announced > available:
        raise MeshError("the file is cut off, or its header announces more than it holds")
    if "vertex" not in elements or "face" not in elements:
        raise MeshError("no vertices or no faces")
    _check_triangles(max(count for count, _ in elements.values()))


def _property_bytes(words: list[str]) -> int | None:
    """Return the least bytes of ``property KIND NAME`` or ``property list COUNT_KIND KIND NAME``, or None."""
    if len(words) == 3:
        return _SIZES.get(words[1])
    if len(words) == 5 and words[1] == "list" and words[3] in _SIZES:
        return _SIZES.get(words[2])  # an empty list
    return None


def _ply_elements(header: str) -> tuple[bool, dict[str, tuple[int, int]]]:
    """Return whether the body is text, and of each element its number and the least bytes of one."""
    text, elements, last = None, {}, ""
    for line in header.splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            text = words[1:2] == ["ascii"]
        elif words[:1] == ["element"]:
            if len(words) != 3 or not re.fullmatch(r"\d{1,18}", words[2], re.ASCII) or words[1] in elements:
                raise MeshError(f"{line[:60]!r} is not an element of a PLY file")
            last = words[1]
            elements[last] = (int(words[2]), 0)
        elif words[:1] == ["property"]:
            least_bytes = _property_bytes(words)
            if not last or least_bytes is None:
                raise MeshError(f"{line[:60]!r} is not a property of a PLY file")
            elements[last] = (elements[last][0], elements[last][1] + least_bytes)
    if text is None:
        raise MeshError("the PLY header names no format")
    return text, elements


@dataclass
class _Solid:
    """An object of a 3MF file."""

    triangles: int = 0
    parts: list[str] = field(default_factory=list)


def _check_3mf(data: bytes) -> None:
    """Raise where the file unfolds to more than may be read, or an object contains itself."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = archive.infolist()
            if len(files) > MOST_FILES or sum(info.file_size for info in files) > LARGEST_XML_BYTES:
                raise MeshError(f"unfolds to more than {LARGEST_XML_BYTES / 1e6:.0f} MB")
            texts = [archive.read(info) for info in files if info.filename.lower().endswith(".model")]
    except (zipfile.BadZipFile, OSError, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        if isinstance(error, MeshError):
            raise
        raise MeshError(f"a damaged 3MF file: {str(error)[:80]}") from None
    except Exception as error:  # zlib.error, lzma.LZMAError: each way of packing has its own
        raise MeshError(f"a damaged 3MF file: {str(error)[:80]}") from None
    solids: dict[str, _Solid] = {}
    placed: list[str] = []
    for text in texts:
        _read_structure(text, solids, placed)
    instances, triangles = _unfolded(solids, placed)
    if instances > MOST_INSTANCES:
        raise MeshError(f"more than {MOST_INSTANCES} copies of objects")
    _check_triangles(triangles)


def _read_structure(text: bytes, solids: dict[str, _Solid], placed: list[str]) -> None:
    """Add the objects of a model, and those that it places."""
    from xml.etree import ElementTree

    if b"\x00" in text or _XML_TRICKS.search(text):
        raise MeshError("its XML is not plain UTF-8 without declarations")
    solid = _Solid()
    try:
        for _, element in ElementTree.iterparse(io.BytesIO(text)):
            tag = element.tag.rpartition("}")[2]
            if tag == "triangle":
                solid.triangles += 1
            elif tag == "component":
                solid.parts.append(element.get("objectid", ""))
            elif tag == "object":
                known = solids.setdefault(element.get("id", ""), _Solid())
                known.triangles += solid.triangles
                known.parts += solid.parts
                solid = _Solid()
            elif tag == "item":
                placed.append(element.get("objectid", ""))
            element.clear()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MeshError(f"not the XML of a 3MF file: {str(error)[:80]}") from None


def _unfolded(solids: dict[str, _Solid], placed: list[str]) -> tuple[int, int]:
    """Return how many instances and triangles there are once every object is placed."""
    counts: dict[str, tuple[int, int]] = {}
    order, open_ = [], set()
    stack = [(name, False) for name in placed]
    while stack:  # objects below an object come before it
        name, done = stack.pop()
        if done:
            open_.discard(name)
            order.append(name)
            continue
        if name in open_:
            raise MeshError(f"object {name[:40]!r} contains itself")
        if name in counts or name not in solids:
            continue
        counts[name] = (0, 0)
        open_.add(name)
        stack.append((name, True))
        stack += [(part, False) for part in solids[name].parts]
    for name in order:
        below = [counts.get(part, (0, 0)) for part in solids[name].parts]
        counts[name] = (1 + sum(n for n, _ in below), solids[name].triangles + sum(t for _, t in below))
    both = [counts.get(name, (0, 0)) for name in placed]
    return sum(n for n, _ in both), sum(t for _, t in both)


def _check_text(data: bytes) -> None:
    if len(data) > LARGEST_TEXT_BYTES:
        raise MeshError(f"text of more than {LARGEST_TEXT_BYTES / 1e6:.0f} MB: export it as binary")


def _check_triangles(count: int) -> None:
    if count > MOST_TRIANGLES:
        raise MeshError(f"{count} triangles announced, at most {MOST_TRIANGLES} are read")
