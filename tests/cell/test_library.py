"""The model library: names without parsing, each file parsed once and only if it is asked for."""

import tomllib
from collections import Counter

import numpy as np
import pytest

from gcode2krl.cell import library, resolve_cell
from gcode2krl.collision import scene
from gcode2krl.collision.along import Way
from gcode2krl.collision.bodies import FOOT, capsules_of, parts_of
from gcode2krl.collision.surroundings import pairs_of


@pytest.fixture
def parsed(monkeypatch):
    """How often each file is parsed, from an empty cache on."""
    counts = Counter()
    read = library.read_toml

    def counted(file):
        counts[file.stem] += 1
        return read(file)

    monkeypatch.setattr(library, "read_toml", counted)
    forget()
    yield counts
    forget()


def forget():
    library._names.cache_clear()
    library._of_library.cache_clear()


@pytest.mark.parametrize("kind", library.KINDS)
def test_names_are_those_that_toml_reads(kind):
    folder = library.models_folder() / kind
    files = sorted(folder.glob("*.toml"))
    stated = [str(tomllib.loads(file.read_text(encoding="utf-8")).get("model", file.stem)) for file in files]
    assert list(library.names(kind).items()) == list(zip(stated, files, strict=True))
    assert stated


@pytest.mark.parametrize(
    "content",
    [
        b'model = "plain"\n',
        b'model = "plain"\r\nteeth = 2\r\n',
        b'model = "no line end"',
        b'\xef\xbb\xbfmodel = "with a mark"\n',
        b'model = "an \\u0041 escaped"\n',
        b'model = "a # b" # c\n',
        b"model = 'single'\n",
        b'model = """three"""\n',
        b'model = "\xc3\xa4"\n',
        b'# comment\nmodel = "second line"\n',
        b'model.x = "a table"\n',
        b'kind = "ball"\n',
        b'model = "' + b"long" * 400 + b'"\n',
        b"model = 7\n",
        b"",
    ],
)
def test_a_name_is_read_as_toml_reads_it(content, tmp_path):
    file = tmp_path / "stem.toml"
    file.write_bytes(content)
    name = tomllib.loads(content.decode("utf-8-sig")).get("model", "stem")
    assert list(library._names(tmp_path)) == [str(name)]


@pytest.mark.parametrize("content", [b'model = "\x00"\n', b'model = "\xff"\n', b'model = "a\tb\x7f"\n'])
def test_a_name_that_toml_refuses_is_an_error_that_names_the_file(content, tmp_path):
    (tmp_path / "bad.toml").write_bytes(content)
    with pytest.raises(Exception, match=r"bad\.toml"):
        library._names(tmp_path)


def test_a_cell_parses_its_own_models_once(parsed):
    drill = {"model": "drill 8 z2"}
    resolve_cell({"robot": {"model": "KR 6 R900 sixx"}, "tool": {"1": drill, "2": drill}})
    resolve_cell({"robot": {"model": "KR6R900SIXX"}})
    assert parsed == {"kr_6_r900_sixx": 1, "drill_8": 1}


def test_a_read_model_is_a_copy():
    changed = library.read_model("tools", "drill 8 z2")
    changed["teeth"] = 99
    assert library.read_model("tools", "drill 8 z2")["teeth"] != 99


ROBOTS = library.names("robots")
HOME = np.radians([[0, -90, 90, 0, 0, 0], [0, -90, 90, 0, 90, 0]])


def watched(cell, obstacle, pairs, q):
    parts, geometry = parts_of(cell, 1), cell.robot.geometry.array()
    way = Way(
        capsules_of(parts, geometry), obstacle, pairs, geometry, near_mm=5, horizon_mm=2000, is_sampled=False
    )
    return way.take(q).gap_mm


@pytest.mark.parametrize("name", ROBOTS)
def test_each_link_has_capsules_with_source_and_how_sure(name):
    body = resolve_cell({"robot": {"model": name}}).robot.body
    links = [capsule.link for capsule in body.capsules]
    assert sorted(set(links)) == ["A1", "A2", "A3", "A4", "A5", "A6", "foot"]
    assert max(links.count(link) for link in links) <= 3
    assert body.sure == ("assumption" if body.source.startswith("estimated") else "checked")
    assert "kuka_experimental@" in body.source


@pytest.mark.parametrize("name", ROBOTS)
def test_an_arm_on_the_floor_hits_neither_the_floor_nor_itself_at_home(name):
    cell = resolve_cell({"robot": {"model": name}})
    parts = parts_of(cell, 1)
    floor = scene.plane([0, 0, 0], [0, 0, 1])
    moving = [(number, 0, 0) for number, part in enumerate(parts) if part.link != FOOT]
    assert (watched(cell, floor, moving, HOME) > 5).all()
    assert (watched(cell, floor, pairs_of(parts, ()), HOME) > 50).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_capsules_reach_from_axis_to_axis(name):
    """Seen from the side, axis A2, the forearm and the wrist's centre lie within their links' capsules."""
    cell = resolve_cell({"robot": {"model": name}})
    arm = cell.robot.geometry
    ends = {"A2": [0.0, 0, 0], "A3": [arm.c3_mm * 0.2, 0, -arm.a2_mm], "A5": [0.0, 0, 0]}
    for link, point in ends.items():
        sizes = [
            _distance(np.array(point)[::2], np.array([c.from_mm, c.to_mm])[:, ::2]) - c.radius_mm
            for c in cell.robot.body.capsules
            if c.link == link
        ]
        assert min(sizes) < 0, link


def _distance(point, ends):
    way = ends[1] - ends[0]
    t = np.clip((point - ends[0]) @ way / max(way @ way, 1e-9), 0, 1)
    return np.linalg.norm(point - ends[0] - t * way)
