"""Damaged and made-up meshes of a raw part: STL, PLY, 3MF, and other files with their names.

python benchmarks/fuzz_meshes.py --count 10000 --seed 1
"""

import io
import re
import sys
import zipfile
from pathlib import Path

import numpy as np
from fuzz_common import Try, main_of, mutated

ENDINGS = ("stl", "ply", "3mf", "glb", "obj", "off", "dae", "xyz", "STL", "")
WORDS = (b"nan", b"inf", b"-1e308", b"1e999", b"abc", b"", b"999999999999999999999", b"-1", b"0x10", b"1,5")
COUNTS = (
    b"0",
    b"1",
    b"-1",
    b"4294967295",
    b"99999999999999999999999",
    b"9" * 200,
    b"1000000000",
    b"1e3",
    b"nan",
)


def prepare(place: Path) -> Try:
    """Make good meshes once; return the function that tries a case."""
    import trimesh

    from gcode2krl.cutting.raw_part import load_mesh

    solid = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    good = {kind: solid.export(file_type=kind) for kind in ("stl", "ply", "3mf", "glb", "off", "obj")}
    good["text stl"] = solid.export(file_type="stl_ascii")
    good["text ply"] = solid.export(file_type="ply", encoding="ascii")
    files = {name: data.encode() if isinstance(data, str) else data for name, data in good.items()}

    def attempt(rng: np.random.Generator, _: Path) -> str:
        kinds = (damage, damage, numbers, header, archive, archive, tricks, misnamed)
        what, ending, data = kinds[int(rng.integers(len(kinds)))](rng, files)
        file = place / f"raw.{ending}"
        file.write_bytes(data)
        mesh = load_mesh(file)
        assert np.isfinite(mesh.bounds).all()
        assert len(mesh.triangles) > 0
        return what

    return attempt


def damage(rng: np.random.Generator, files: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Damage the bytes of a mesh."""
    name, other = (str(n) for n in rng.choice(sorted(files), 2))
    return f"bytes of {name}", name.split()[-1], mutated(rng, files[name], files[other])


def numbers(rng: np.random.Generator, files: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Replace numbers and words of a text."""
    name = str(rng.choice(["text stl", "text ply"]))
    words = re.split(rb"(\s+)", files[name])
    for _ in range(int(rng.integers(1, 5))):
        words[2 * int(rng.integers(len(words) // 2))] = WORDS[int(rng.integers(len(WORDS)))]
    return f"numbers of {name}", name.split()[-1], b"".join(words)


def header(rng: np.random.Generator, files: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Change the counts and types that a header announces."""
    if rng.random() < 0.3:
        data = bytearray(files["stl"])
        data[80:84] = int(rng.integers(0, 2**32)).to_bytes(4, "little")
        return "count of a STL", "stl", bytes(data)
    name = str(rng.choice(["ply", "text ply"]))
    head, mark, body = files[name].partition(b"end_header")
    lines = head.splitlines(keepends=True)
    at = int(rng.integers(len(lines)))
    kind = int(rng.integers(5))
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines[at:at] = [lines[int(rng.integers(len(lines)))]]
    elif kind == 2:
        lines = [
            re.sub(rb"(element \w+ )\d+", rb"\g<1>" + COUNTS[int(rng.integers(len(COUNTS)))], line)
            for line in lines
        ]
    elif kind == 3:
        kinds = (b"double", b"uchar", b"list uint uint", b"list uchar double", b"foo", b"")
        lines[at] = re.sub(rb"float|int|uchar", kinds[int(rng.integers(len(kinds)))], lines[at])
    else:
        lines[1] = (
            b"format "
            + (b"ascii", b"binary_big_endian", b"binary_little_endian")[int(rng.integers(3))]
            + b" 1.0\n"
        )
    return f"header of {name}", "ply", b"".join(lines) + mark + body


def archive(rng: np.random.Generator, files: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Change the model in a 3MF file and pack it again, or what is packed with it."""
    with zipfile.ZipFile(io.BytesIO(files["3mf"])) as source:
        parts = {info.filename: source.read(info) for info in source.infolist()}
    name = next(n for n in parts if n.endswith(".model"))
    model = parts[name]
    kind = int(rng.integers(9))
    if kind == 0:
        parts[name] = mutated(rng, model)
    elif kind == 1:
        parts[name] = model.replace(b"<object", b'<object x="&amp;"', 1)
    elif kind == 2:  # objects in objects: 10 levels of 10, or one in itself
        levels, itself = int(rng.integers(2, 12)), bool(rng.random() < 0.3)
        more = b"".join(
            b'<object id="%d" type="model"><components>' % (n + 100)
            + (b'<component objectid="%d"/>' % (n + 99 + itself)) * int(rng.integers(1, 12))
            + b"</components></object>"
            for n in range(levels)
        )
        parts[name] = model.replace(b"</resources>", more + b"</resources>").replace(
            b"<item ", b'<item objectid="%d"/><item ' % (99 + levels), 1
        )
    elif kind == 3:
        number = WORDS[int(rng.integers(len(WORDS)))]
        parts[name] = re.sub(
            rb'(x|v1|v2|id|objectid)="[^"]*"', rb'\1="' + number + b'"', model, count=int(rng.integers(1, 9))
        )
    elif kind == 4:
        parts[name] = (
            b'<!DOCTYPE a [<!ENTITY b "' + b"c" * 50 + b'"><!ENTITY d "' + b"&b;" * 50 + b'">]>' + model
        )
    elif kind == 5:
        parts[name] = model.decode("utf-8").encode(("utf-16", "utf-32", "latin-1")[int(rng.integers(3))])
    elif kind == 6:
        parts = {n: data for n, data in parts.items() if n != str(rng.choice(sorted(parts)))}
    elif kind == 7:
        parts["3D/other.model"] = model * int(rng.integers(1, 3))
    else:
        parts["bomb"] = bytes(int(rng.choice([10**6, 10**8])))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as target:
        for part, data in parts.items():
            target.writestr(part, data)
    packed = out.getvalue()
    return f"3MF, {kind}", "3mf", mutated(rng, packed) if rng.random() < 0.3 else packed


def tricks(rng: np.random.Generator, files: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Nothing, random bytes, or one thing without end."""
    ending = str(rng.choice(ENDINGS[:3]))
    choices = (
        b"",
        b"\n" * 1000,
        rng.bytes(int(rng.integers(2000))),
        b"solid a\n" * int(rng.integers(1, 5000)),
        b"solid\n" + b"facet normal 0 0 1\nouter loop\n" * 500,
        b"ply\n" + b"element vertex 1\n" * 500,
        b"ply\nformat ascii 1.0\n" + b"property float x\n" * 500 + b"end_header\n",
        b"PK\x03\x04" + rng.bytes(200),
        bytes(80) + b"\xff\xff\xff\xff" + bytes(50),
        bytes(84),
        b"PK\x05\x06" + bytes(18),
        b"solid a\nendsolid a\n" * 2000,
        b"<" * 5000,
        b"solid " + b"facet " * 4000 + b"endsolid",
    )
    return "trick", ending, choices[int(rng.integers(len(choices)))]


def misnamed(rng: np.random.Generator, files: dict[str, bytes]) -> tuple[str, str, bytes]:
    """A mesh of one kind named as another."""
    return "misnamed", str(rng.choice(ENDINGS)), files[str(rng.choice(sorted(files)))]


main = main_of("meshes", prepare, __doc__, 10_000)

if __name__ == "__main__":
    sys.exit(main())
