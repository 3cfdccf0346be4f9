"""The cache: whole entries or none, the oldest go first, nothing that is not its own is removed."""

import contextlib
import hashlib
import json
import multiprocessing
import os
import sys
import zipfile
from pathlib import Path

import pytest

from gcode2krl.batch.cache import FOLDER_VARIABLE, Cache, default_folder
from gcode2krl.errors import NotUnderstoodError

RECORD = {"exit_code": 0, "files": ["Größe.src"], "time_s": 1.5}
CONTENT = b"DEF PART()\r\n" * 1000


def key(number):
    return hashlib.sha256(str(number).encode()).hexdigest()


def sha256(content):
    return hashlib.sha256(content).hexdigest()


@pytest.fixture
def cache(tmp_path):
    return Cache(tmp_path / "cache", 10**9)


def test_what_is_kept_comes_back(cache):
    assert cache.get(key(1)) is None
    cache.put(key(1), RECORD, {"Größe.src": CONTENT})
    entry = cache.get(key(1))
    assert entry.record == RECORD
    assert entry.content("Größe.src", sha256(CONTENT)) == CONTENT
    assert cache.get(key(2)) is None


def test_an_entry_is_a_plain_zip(cache):
    cache.put(key(1), RECORD, {"PART.src": CONTENT})
    ((place, _),) = cache.entries()
    with zipfile.ZipFile(place) as archive:
        assert json.loads(archive.read("record.json")) == RECORD
        assert archive.read("files/PART.src") == CONTENT


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.99])
def test_a_cut_entry_is_none(cache, share):
    cache.put(key(1), RECORD, {"PART.src": os.urandom(5000)})
    ((place, about),) = cache.entries()
    with place.open("r+b") as stream:
        stream.truncate(int(share * about.st_size))
    assert cache.get(key(1)) is None


def test_a_changed_byte_of_a_file_is_noticed_when_it_is_read(cache):
    content = os.urandom(5000)
    cache.put(key(1), RECORD, {"PART.src": content})
    ((place, _),) = cache.entries()
    damaged = bytearray(place.read_bytes())
    at = damaged.index(b"files/PART.src") + 2000
    damaged[at] ^= 1
    place.write_bytes(damaged)
    entry = cache.get(key(1))
    with pytest.raises(ValueError, match=r"\.zip"):
        entry.content("PART.src", sha256(content))


def test_another_content_under_a_good_name_is_noticed(cache):
    cache.put(key(1), RECORD, {"PART.src": b"other"})
    with pytest.raises(ValueError, match="not what was written"):
        cache.get(key(1)).content("PART.src", sha256(CONTENT))


def test_the_entries_used_longest_ago_go_first(cache):
    for number in range(5):
        cache.put(key(number), RECORD, {"PART.src": os.urandom(10_000)})
        os.utime(cache.folder / key(number)[:2] / f"{key(number)}.zip", (number, number))
    cache.get(key(0))  # used now
    size = sum(about.st_size for _, about in cache.entries())
    small = Cache(cache.folder, size - 15_000)
    assert small.prune() > 10_000
    assert [cache.get(key(number)) is not None for number in range(5)] == [True, False, False, True, True]
    assert small.prune() == 0


def test_clear_removes_entries_and_nothing_else(cache):
    cache.put(key(1), RECORD, {"PART.src": CONTENT})
    own = [cache.folder / "notes.txt", cache.folder / "ab" / "thesis.zip"]
    for file in own:
        file.parent.mkdir(exist_ok=True)
        file.write_text("mine")
    assert cache.clear() > 0
    assert cache.get(key(1)) is None
    assert all(file.read_text() == "mine" for file in own)
    assert cache.clear() == 0
    assert Cache(cache.folder / "nowhere", 1).clear() == 0


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotUnderstoodError, match="cannot write"):
        Cache(tmp_path / "file" / "cache", 1).put(key(1), RECORD, {})


@pytest.mark.parametrize("error", [FileNotFoundError, FileExistsError])
def test_a_folder_that_another_process_takes_away_is_made_again(tmp_path, monkeypatch, error):
    cache, mkdir, times = Cache(tmp_path / "cache", 10**9), Path.mkdir, iter([True, True, False])

    def taken_away(path, *arguments, **options):
        if next(times, False):
            raise error
        mkdir(path, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", taken_away)
    cache.put(key(1), RECORD, {})
    assert cache.get(key(1)) is not None


def test_a_file_in_place_of_the_folder_is_an_error(tmp_path):
    cache = Cache(tmp_path / "cache", 10**9)
    cache.folder.mkdir()
    (cache.folder / key(1)[:2]).write_text("")
    with pytest.raises(NotUnderstoodError, match="cannot write"):
        cache.put(key(1), RECORD, {})


def put_many(folder):
    cache = Cache(folder, 10**9)
    for number in range(200):
        cache.put(key(number % 7), RECORD, {"PART.src": CONTENT})
        entry = cache.get(key((number + 3) % 7))
        with contextlib.suppress(ValueError):  # cleared meanwhile, which is a miss
            assert entry is None or entry.content("PART.src", sha256(CONTENT)) == CONTENT
        if number % 50 == 49:
            cache.clear()


def test_two_processes_may_use_one_folder(tmp_path):
    context = multiprocessing.get_context("spawn")
    others = [context.Process(target=put_many, args=(tmp_path / "cache",)) for _ in range(2)]
    for other in others:
        other.start()
    for other in others:
        other.join(60)
    assert [other.exitcode for other in others] == [0, 0]


def test_the_folder_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert default_folder() == tmp_path
    monkeypatch.delenv(FOLDER_VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))
    for platform, place in (
        ("linux", tmp_path / "gcode2krl"),
        ("win32", tmp_path / "gcode2krl" / "Cache"),
        ("darwin", Path.home() / "Library" / "Caches" / "gcode2krl"),
    ):
        monkeypatch.setattr(sys, "platform", platform)
        assert default_folder() == place
