"""Meshes that are damaged, misnamed, or made to harm: one line, and little memory."""

import io
import zipfile

import pytest
import trimesh

from gcode2krl.cutting import mesh_file
from gcode2krl.cutting.raw_part import load_mesh
from gcode2krl.errors import NotUnderstoodError

BALL = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
MODEL = (
    '<?xml version="1.0" encoding="UTF-8"?>\n{0}<model unit="millimeter" '
    'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>{1}</resources>'
    "<build>{2}</build></model>"
)
PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"


def exported(kind, **how):
    data = BALL.export(file_type=kind, **how)
    return data.encode() if isinstance(data, str) else data


def refused(file, *words):
    """Check that a mesh is refused in one line with all words."""
    with pytest.raises(NotUnderstoodError) as caught:
        load_mesh(file)
    assert len(str(caught.value).splitlines()) == 1
    assert caught.value.source == str(file)
    for word in words:
        assert word in str(caught.value)


def packed(objects, items='<item objectid="1"/>', before="", **more):
    """Return a 3MF file of a box as object 1, with further objects."""
    box = trimesh.creation.box(extents=(10, 10, 10))
    points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*row) for row in box.vertices)
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in box.faces)
    mesh = f"<vertices>{points}</vertices><triangles>{faces}</triangles>"
    first = f'<object id="1" type="model"><mesh>{mesh}</mesh></object>'
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", MODEL.format(before, first + objects, items))
        for name, data in more.items():
            archive.writestr(name, data)
    return out.getvalue()


@pytest.mark.parametrize(
    ("kind", "how", "ending"),
    [
        ("stl", {}, "stl"),
        ("stl_ascii", {}, "stl"),
        ("ply", {}, "ply"),
        ("ply", {"encoding": "ascii"}, "ply"),
        ("3mf", {}, "3mf"),
        ("stl", {}, "STL"),
    ],
)
def test_sound_meshes_of_every_form_are_read(tmp_path, kind, how, ending):
    file = tmp_path / f"raw.{ending}"
    file.write_bytes(exported(kind, **how))
    assert load_mesh(file).volume == pytest.approx(BALL.volume, rel=1e-4)


@pytest.mark.parametrize("ending", ["glb", "gltf", "obj", "off", "dae", "step", ""])
def test_another_form_is_refused_by_its_name(tmp_path, ending):
    file = tmp_path / f"raw.{ending}".rstrip(".")
    file.write_bytes(exported("glb") if ending == "glb" else exported("off"))
    refused(file, "allowed: .stl, .ply or .3mf")


@pytest.mark.parametrize(("kind", "ending"), [("glb", "stl"), ("ply", "stl"), ("3mf", "ply"), ("stl", "3mf")])
def test_the_content_must_be_what_the_name_says(tmp_path, kind, ending):
    file = tmp_path / f"raw.{ending}"
    file.write_bytes(exported(kind))
    refused(file, f"named .{ending}, but its content is")


@pytest.mark.parametrize("count", [0, 319, 321, 2**31, 2**32 - 1])
def test_a_binary_stl_has_as_many_triangles_as_it_says(tmp_path, count):
    file = tmp_path / "raw.stl"
    data = bytearray(exported("stl"))
    data[80:84] = count.to_bytes(4, "little")
    file.write_bytes(data)
    refused(file)


@pytest.mark.parametrize("cut", [0.1, 0.5, 0.9, 0.999])
@pytest.mark.parametrize(
    ("kind", "how", "ending"),
    [
        ("stl_ascii", {}, "stl"),
        ("ply", {"encoding": "ascii"}, "ply"),
        ("ply", {}, "ply"),
        ("3mf", {}, "3mf"),
        ("stl", {}, "stl"),
    ],
)
def test_a_mesh_that_is_cut_off(tmp_path, kind, how, ending, cut):
    file = tmp_path / f"raw.{ending}"
    data = exported(kind, **how)
    file.write_bytes(data[: int(cut * len(data))])
    refused(file)


@pytest.mark.parametrize("number", ["nan", "inf", "1e999", "abc", "1,5", ""])
def test_a_corner_that_is_no_number(tmp_path, number):
    file = tmp_path / "raw.stl"
    words = exported("stl_ascii").decode().split("vertex ")
    words[4] = f"{number} " + words[4].split(" ", 1)[1]
    file.write_text("vertex ".join(words))
    refused(file)


@pytest.mark.parametrize("count", ["1000000000", "4294967296", "9" * 30, "-1", "nan"])
@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_a_ply_that_announces_more_than_it_holds(tmp_path, order, count):
    file = tmp_path / "raw.ply"
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    file.write_text(PLY.format(order, count) + faces + "0 0 0\n" * 5)
    refused(file)


def test_a_zip_that_unfolds_to_much_more(tmp_path, monkeypatch):
    file = tmp_path / "raw.3mf"
    file.write_bytes(packed("", bomb=bytes(mesh_file.LARGEST_XML_BYTES)))
    assert file.stat().st_size < 100_000
    refused(file, "unfolds to more than")


def test_objects_in_objects_without_end(tmp_path):
    file = tmp_path / "raw.3mf"
    ten = "".join(
        f'<object id="{n}" type="model"><components>'
        + f'<component objectid="{n - 1}"/>' * 10
        + "</components></object>"
        for n in range(2, 14)
    )
    file.write_bytes(packed(ten, '<item objectid="13"/>'))
    refused(file, "copies of objects")


@pytest.mark.parametrize("parts", [("2", "2"), ("3", "2")])
def test_an_object_that_contains_itself(tmp_path, parts):
    file = tmp_path / "raw.3mf"
    objects = "".join(
        f'<object id="{n}" type="model"><components><component objectid="{part}"/></components></object>'
        for n, part in zip(("2", "3"), parts, strict=True)
    )
    file.write_bytes(packed(objects, '<item objectid="2"/>'))
    refused(file, "contains itself")


def test_an_assembly_is_read(tmp_path):
    file = tmp_path / "raw.3mf"
    two = '<object id="2" type="model"><components><component objectid="1"/></components></object>'
    file.write_bytes(packed(two, '<item objectid="2"/>'))
    assert load_mesh(file).volume == pytest.approx(1000.0)


@pytest.mark.parametrize(
    "before",
    ['<!DOCTYPE a [<!ENTITY b "cc">]>', '<!DOCTYPE a SYSTEM "file:///etc/hostname">', "<!doctype a>"],
)
def test_xml_with_declarations_is_refused(tmp_path, before):
    file = tmp_path / "raw.3mf"
    file.write_bytes(packed("", before=before))
    refused(file, "declarations")


def test_a_mesh_names_no_other_file(tmp_path):
    """A PLY may name a picture as its texture; only the mesh itself is read."""
    file = tmp_path / "raw.ply"
    data = exported("ply").replace(b"element vertex", b"comment TextureFile /dev/stdin\nelement vertex", 1)
    file.write_bytes(data)
    assert len(load_mesh(file).faces) == len(BALL.faces)


def test_a_large_mesh_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 100)
    for kind in ("stl", "ply", "3mf"):
        file = tmp_path / f"raw.{kind}"
        file.write_bytes(exported(kind))
        refused(file, "at most 100")


def test_a_folder_is_no_mesh(tmp_path):
    (tmp_path / "raw.stl").mkdir()
    refused(tmp_path / "raw.stl", "cannot read")


def test_readers_say_nothing_by_themselves(tmp_path, capfd):
    file = tmp_path / "raw.stl"
    text = exported("stl_ascii").decode().replace("normal ", "normal x", 3)
    file.write_text(text)
    assert load_mesh(file).volume == pytest.approx(BALL.volume, rel=1e-4)  # its own normals count
    assert capfd.readouterr().err == ""


def test_a_path_that_no_file_can_have_is_no_file(tmp_path):
    refused(tmp_path / f"{'m' * 400}.stl", "no such file")
