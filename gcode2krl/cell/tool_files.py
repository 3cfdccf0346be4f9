"""Cutters from where people keep them: libraries of Fusion, FreeCAD, LinuxCNC and HSM, and header comments.

Each reader gives a tool's number and the keys of a cell's ``[tool.N]`` that the file states, in mm; nothing
is made up, and a tool that a cell cannot describe is told with the reason. Where a file states the length
from gauge line to tip (Fusion's assembly gauge length), it is taken; else it has to be measured.
"""

import csv
import json
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

from gcode2krl.errors import Issue, NotUnderstoodError, input_error
from gcode2krl.units import MM_PER_INCH

_LARGEST_BYTES = 64_000_000
_KINDS = {
    "flat": "flat",
    "ball": "ball",
    "bull": "bull-nose",
    "radius": "bull-nose",
    "torus": "bull-nose",
    "face": "flat",
    "chamfer": "tapered",
    "taper": "tapered",
    "v-bit": "tapered",
    "vbit": "tapered",
    "spot": "drill",
    "drill": "drill",
    "end": "flat",
}
"""A word in a type, the first that is there, and what a cell calls the cutter."""
_NOT_OF_A_CELL = re.compile(
    r"\btap\b|thread|ream|probe|slit|dovetail|lollipop|counter|\bbor|turning|holder", re.IGNORECASE
)
_UNITS = {"mm": 1.0, "millimeters": 1.0, "inch": MM_PER_INCH, "inches": MM_PER_INCH, "in": MM_PER_INCH}

_ASKED = {"kind": "flat", "teeth": "2", "corner_radius_mm": "0.5"}
"""Keys without which a section would say something that the file does not, with examples."""


@dataclass(frozen=True)
class FileTool:
    """A tool of a file."""

    number: int | None
    name: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    """Of ``[tool.N]``, lengths in mm."""
    unread: str = ""
    """Why a cell cannot describe it; empty where it can."""


def read_tools(file: Path, unit: str = "") -> list[FileTool]:
    """Return the tools of a file; ``unit``, mm or inch, is needed where the file states none.

    Raises `NotUnderstoodError` for a file that is no such library, or that leaves its unit open.
    """
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise _no_library(file, f"larger than {_LARGEST_BYTES / 1e6:.0f} MB")
        reader = _READERS.get(file.suffix.lower(), _comments)
        tools = list(reader(file, unit))
    except OSError as error:
        raise input_error(
            "file-unreadable", f"cannot read: {error.strerror}", "name the right file", source=str(file)
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, zipfile.BadZipFile) as error:
        raise _no_library(
            file, str(error).splitlines()[0][:120] if str(error) else "not as expected"
        ) from None
    if not tools:
        raise _no_library(file, "no tool in it")
    return tools


def sections_of(
    tools: Iterable[FileTool], stated: Mapping[int, Mapping[str, Any]], source: str
) -> tuple[dict[int, dict[str, Any]], list[Issue]]:
    """Return the sections ``[tool.N]`` of tools, and a finding for each that has none or no length.

    ``stated`` holds keys that the file leaves open, by the tools' numbers.
    """
    sections: dict[int, dict[str, Any]] = {}
    issues: list[Issue] = []

    def left_out(tool: FileTool, why: str, remedy: str) -> None:
        place = f"T{tool.number} " if tool.number is not None else ""
        issues.append(Issue("warning", "tool-file", 0, f"{place}{tool.name}: {why}; left out", remedy))

    for tool in tools:
        number = tool.number
        keys = {**tool.keys, **stated.get(number or 0, {})}
        if tool.unread:
            left_out(tool, tool.unread, "describe it in the cell by hand where a program needs it")
        elif number is None:
            left_out(tool, "it has no number", "number it in the library")
        elif number in sections:
            left_out(tool, "the number is taken by an earlier tool", "number it otherwise in the library")
        elif lacking := [key for key in _ASKED if key not in keys and key in _asked_of(keys)]:
            words = " ".join(f"--set {number}.{key}={_ASKED[key]}" for key in lacking)
            left_out(tool, f"{' and '.join(lacking)} not stated", words)
        else:
            # what a CAM system keeps was never measured on this spindle
            sections[number] = keys | {"source": f"{tool.name}, from {source}", "sure": "assumption"}
            if "length_mm" not in keys:
                sentence = f"T{number} {tool.name}: no length from the spindle's gauge line to the tip"
                issues.append(
                    Issue("note", "tool-file", 0, sentence, f"measure it: --set {number}.length_mm=")
                )
    return sections, issues


def _asked_of(keys: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(_ASKED) if keys.get("kind") == "bull-nose" else ("kind", "teeth")


def _no_library(file: Path, why: str) -> NotUnderstoodError:
    remedy = "export a library of Fusion (.json, .tools, .csv), FreeCAD (.fctb, .fctl) or LinuxCNC (.tbl)"
    return input_error("tool-file", f"no tool library: {why}", remedy, source=str(file))


# readers ----------------------------------------------------------------------------------------------------


def _fusion(file: Path, _unit: str) -> Iterator[FileTool]:
    """Fusion's library: ``geometry`` has DC, NOF, RE, LCF, SFDM, LB (out of the holder), TA, SIG."""
    if zipfile.is_zipfile(file):
        with zipfile.ZipFile(file) as packed:
            name = next(each for each in packed.namelist() if each.endswith(".json"))
            if packed.getinfo(name).file_size > _LARGEST_BYTES:
                raise ValueError("larger than it may be")
            text = packed.read(name).decode("utf-8-sig")
    else:
        text = file.read_text(encoding="utf-8-sig")
    for tool in json.loads(text)["data"]:
        if tool["type"] == "holder":
            continue
        geometry, holder = tool.get("geometry", {}), tool.get("holder") or {}
        segments = holder.get("segments") or []
        yield _tool(
            tool.get("post-process", {}).get("number"),
            tool.get("description") or tool["type"],
            tool["type"],
            _UNITS[tool["unit"]],
            {
                "diameter_mm": geometry.get("DC"),
                "teeth": geometry.get("NOF"),
                "corner_radius_mm": geometry.get("RE"),
                "flute_length_mm": geometry.get("LCF"),
                "shank_diameter_mm": geometry.get("SFDM"),
                "stick_out_mm": geometry.get("LB") if holder else None,
                "length_mm": geometry.get("assemblyGaugeLength") if holder else None,
                "holder_diameter_mm": max((s["lower-diameter"] for s in segments), default=None),
                "taper_deg": geometry.get("TA"),
                "point_deg": geometry.get("SIG"),
                "tip_mm": geometry.get("tip-diameter"),
            },
        )


_COLUMNS = {
    "diameter_mm": "tool_diameter",
    "teeth": "tool_numberOfFlutes",
    "corner_radius_mm": "tool_cornerRadius",
    "flute_length_mm": "tool_fluteLength",
    "shank_diameter_mm": "tool_shaftDiameter",
    "stick_out_mm": "tool_bodyLength",
    "length_mm": "tool_assemblyGaugeLength",
    "taper_deg": "tool_taperAngle",
    "point_deg": "tool_tipAngle",
    "tip_mm": "tool_tipDiameter",
}


def _hsm_csv(file: Path, _unit: str) -> Iterator[FileTool]:
    """The table that Fusion and HSM export: headings such as ``Diameter (tool_diameter)``, a row a preset."""
    text = file.read_text(encoding="utf-8-sig")
    separator = max("\t;,", key=text.partition("\n")[0].count)
    seen: set[str] = set()
    for number, row in enumerate(csv.DictReader(StringIO(text), delimiter=separator), start=1):
        named = {(key or "").rpartition("(")[2].rstrip(")"): value for key, value in row.items()}
        index = named.get("tool_index") or str(number)
        if index in seen:
            continue
        seen.add(index)
        values = {key: _number(named.get(column)) for key, column in _COLUMNS.items()}
        if not named.get("holder_description"):
            values["stick_out_mm"] = values["length_mm"] = None
        title = named.get("tool_description") or named["tool_type"]
        yield _tool(named.get("tool_number"), title, named["tool_type"], _UNITS[named["tool_unit"]], values)


def _freecad_bit(file: Path, _unit: str, number: int | None = None) -> Iterator[FileTool]:
    """FreeCAD's tool bit: parameters as ``"5.0000 mm"``; flutes stand there only in newer ones."""
    bit = json.loads(file.read_text(encoding="utf-8-sig"))
    stated, shape = bit["parameter"], str(bit.get("shape-type") or bit.get("shape", ""))
    length = {
        name: _length_mm(stated.get(name)) for name in ("Diameter", "CuttingEdgeHeight", "ShankDiameter")
    }
    flutes = _number(stated.get("Flutes") or bit.get("attribute", {}).get("Flutes"))
    is_drill = "drill" in shape.lower()
    angle = _number(stated.get("TipAngle") or stated.get("CuttingEdgeAngle"))
    yield _tool(
        number,
        bit.get("name") or file.stem,
        shape,
        1.0,
        {
            "diameter_mm": length["Diameter"],
            "teeth": flutes,
            "corner_radius_mm": _length_mm(stated.get("CornerRadius")),  # FlatRadius is that of the flat end
            "flute_length_mm": length["CuttingEdgeHeight"],
            "shank_diameter_mm": length["ShankDiameter"],
            "point_deg": angle if is_drill else None,
            "taper_deg": None if is_drill or angle is None else angle / 2.0,
            "tip_mm": _length_mm(stated.get("TipDiameter")),
        },
    )


def _freecad_library(file: Path, unit: str) -> Iterator[FileTool]:
    """FreeCAD's library: numbers and the files of bits, which stand beside it or in the folder ``Bit``."""
    for entry in json.loads(file.read_text(encoding="utf-8-sig"))["tools"]:
        name = Path(str(entry["path"])).name
        bit_folders = [
            folder / bits for folder in (file.parent.parent, file.parent) for bits in ("Bit", "bit")
        ]
        places = [folder / name for folder in (file.parent, *bit_folders)]
        bit = next((place for place in places if place.is_file()), None)
        if bit is None:
            yield FileTool(
                int(entry["nr"]), name, unread=f"the file {name} is neither beside the library nor in Bit"
            )
        else:
            yield from _freecad_bit(bit, unit, int(entry["nr"]))


_WORD = re.compile(r"([TPDZ])\s*([-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)


def _linuxcnc(file: Path, unit: str) -> Iterator[FileTool]:
    """LinuxCNC's tool table: ``T1 P1 D6.0 Z+45.1 ; 6 mm 3 flute``; its unit is the machine's."""
    for line in file.read_text(encoding="utf-8-sig", errors="replace").splitlines():
        words, _, comment = line.partition(";")
        stated = {letter.upper(): float(value) for letter, value in _WORD.findall(words)}
        if "T" not in stated:
            continue
        scale = _asked(unit, file)
        flutes = re.search(r"(\d+)\s*-?\s*(?:FL\b|FLUTE)", comment, re.IGNORECASE)
        values = {"diameter_mm": stated.get("D"), "teeth": flutes and float(flutes[1])}
        named = next((word for word in _KINDS if word in comment.lower()), "")
        yield _tool(int(stated["T"]), comment.strip() or "tool", named and comment, scale, values)


_HEADER = re.compile(
    r"\(\s*T(\d+)\s+D\s*=\s*([\d.]+)\s+CR\s*=\s*([\d.]+)(?:\s+TAPER\s*=\s*([\d.]+)DEG)?[^)]*?-\s*([^-)]+)\)",
    re.IGNORECASE,
)
_INCHES = re.compile(rb"^\s*(?:N\d+\s*)?(?:[^(;\n]*\s)?G(?:20|70)\b", re.MULTILINE | re.IGNORECASE)


def _comments(file: Path, unit: str) -> Iterator[FileTool]:
    """Comments of HSM posts in a program: ``(T5 D=10. CR=0.5 - ZMIN=-2. - bullnose end mill)``."""
    data = file.read_bytes()
    headers = list(_HEADER.finditer(data.decode("latin-1")))
    scale = _asked(unit, file) if unit else (MM_PER_INCH if _INCHES.search(data) else 1.0)
    for said in headers:
        values = {
            "diameter_mm": _number(said[2]),
            "corner_radius_mm": _number(said[3]),
            "point_deg" if "drill" in said[5].lower() else "taper_deg": _number(said[4]),
        }
        yield _tool(said[1], said[5].strip(), said[5], scale, values)


def _asked(unit: str, file: Path) -> float:
    if not unit:
        sentence = "a tool table of LinuxCNC does not state its unit"
        raise input_error("tool-file", sentence, "--unit mm or --unit inch", source=str(file))
    return _UNITS[unit]


_READERS: Mapping[str, Callable[[Path, str], Iterator[FileTool]]] = {
    ".json": _fusion,
    ".tools": _fusion,
    ".csv": _hsm_csv,
    ".tsv": _hsm_csv,
    ".fctb": _freecad_bit,
    ".fctl": _freecad_library,
    ".tbl": _linuxcnc,
}


# what a cell calls it ---------------------------------------------------------------------------------------


def _tool(number: Any, name: str, type_name: str, scale: float, stated: Mapping[str, Any]) -> FileTool:
    """Return a tool with the keys of a cell; ``scale`` are mm of its unit, angles are degrees.

    Without a type's name the tool has no ``kind``.
    """
    nr = int(number) if str(number or "").strip().isdigit() and int(number) > 0 else None
    words = type_name.lower()
    kind = next((kind for word, kind in _KINDS.items() if word in words), None)
    if (kind is None and words) or _NOT_OF_A_CELL.search(words):
        return FileTool(nr, name, unread=f"a cell has no {type_name.strip()}")
    keys: dict[str, Any] = {
        key: round(float(value) * (scale if key.endswith("_mm") else 1.0), 6)
        for key, value in stated.items()
        if value not in (None, "") and float(value) > 0.0
    }
    tip_mm = keys.pop("tip_mm", None)
    if kind is not None:
        keys["kind"] = kind
    if "teeth" in keys:
        keys["teeth"] = int(keys["teeth"])
    if kind == "tapered":
        if tip_mm is None or "taper_deg" not in keys:
            return FileTool(nr, name, unread="a tapered mill without a flat tip, or its angle is not stated")
        keys["diameter_mm"] = tip_mm
    if kind != "tapered":
        keys.pop("taper_deg", None)
    if kind != "drill":
        keys.pop("point_deg", None)
    if kind != "bull-nose":
        keys.pop("corner_radius_mm", None)
    if "diameter_mm" not in keys:
        return FileTool(nr, name, unread="no diameter is stated")
    return FileTool(nr, name, keys)


def _number(value: Any) -> float | None:
    """Return the number at the start of a text, with a decimal comma too; None where there is none."""
    match = re.match(r"\s*([-+]?(?:\d+[.,]?\d*|[.,]\d+))", str(value)) if value is not None else None
    return float(match[1].replace(",", ".")) if match else None


def _length_mm(value: Any) -> float | None:
    number = _number(value)
    if number is None:
        return None
    unit = re.sub(r"[\d\s.,+-]", "", str(value)).lower()
    return number * _UNITS.get({'"': "inch", "": "mm"}.get(unit, unit), 1.0)
