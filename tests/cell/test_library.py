"""The model library: names without parsing, each file parsed once and only if it is asked for."""

import tomllib
from collections import Counter

import pytest

from gcode2krl.cell import library, resolve_cell


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
