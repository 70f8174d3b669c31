"""Machine code on disk: kept, found again, and never loaded where others had a hand in it."""

from __future__ import annotations

import os

import numpy as np
import pytest

from blockmech.engines import code_cache, llvm
from tests import gallery

POSIX = pytest.mark.skipif(os.name != "posix", reason="folders of users are kept apart by Windows")
TEXT, CODE = "cpu and text", b"machine code" * 100


@pytest.fixture(autouse=True)
def temporary_folders(tmp_path, monkeypatch):
    """Caches and settings of this test alone."""
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(tmp_path / "caches"))
    for name in ("XDG_CONFIG_HOME", "APPDATA"):
        monkeypatch.setenv(name, str(tmp_path / "settings"))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv(code_cache.FOLDER, raising=False)


def code_file(tmp_path):
    (file,) = tmp_path.rglob("*.o")
    return file


def key_file(tmp_path):
    (file,) = tmp_path.rglob("*.key")
    return file


def test_what_is_kept_is_found_by_its_text_alone(tmp_path):
    assert code_cache.load(TEXT) is None
    code_cache.keep(TEXT, CODE)
    assert code_cache.load(TEXT) == CODE
    assert code_cache.load(f"{TEXT}!") is None
    if os.name == "posix":
        assert code_file(tmp_path).stat().st_mode & 0o077 == 0
        assert key_file(tmp_path).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("position", [0, 31, 32, 500, -1])
def test_a_changed_byte_is_never_loaded(tmp_path, position):
    code_cache.keep(TEXT, CODE)
    file = code_file(tmp_path)
    data = bytearray(file.read_bytes())
    data[position] ^= 1
    file.write_bytes(data)
    assert code_cache.load(TEXT) is None


@pytest.mark.parametrize("length", [0, 31, 32, 200])
def test_half_a_file_is_never_loaded(tmp_path, length):
    code_cache.keep(TEXT, CODE)
    file = code_file(tmp_path)
    file.write_bytes(file.read_bytes()[:length])
    assert code_cache.load(TEXT) is None


def test_code_under_another_name_is_never_loaded(tmp_path):
    code_cache.keep("other", b"other code")
    code = code_file(tmp_path).read_bytes()
    code_cache.keep(TEXT, CODE)
    for file in tmp_path.rglob("*.o"):
        file.write_bytes(code)
    assert code_cache.load(TEXT) is None
    assert code_cache.load("other") == b"other code"


def test_a_folder_from_elsewhere_is_signed_with_another_key(tmp_path):
    code_cache.keep(TEXT, CODE)
    key_file(tmp_path).unlink()
    assert code_cache.load(TEXT) is None
    code_cache.keep("another", b"makes a new key")
    assert code_cache.load(TEXT) is None


@POSIX
@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_what_others_may_write_is_never_loaded(tmp_path, mode):
    code_cache.keep(TEXT, CODE)
    code_file(tmp_path).chmod(mode)
    assert code_cache.load(TEXT) is None


@POSIX
def test_a_key_that_others_may_read_signs_nothing(tmp_path):
    code_cache.keep(TEXT, CODE)
    key_file(tmp_path).chmod(0o644)
    assert code_cache.load(TEXT) is None


@POSIX
def test_a_link_is_not_followed(tmp_path):
    code_cache.keep(TEXT, CODE)
    file = code_file(tmp_path)
    file.rename(file.with_suffix(".moved"))
    file.symlink_to(file.with_suffix(".moved"))
    assert code_cache.load(TEXT) is None


def test_a_named_folder_and_none(tmp_path, monkeypatch):
    monkeypatch.setenv(code_cache.FOLDER, str(tmp_path / "named"))
    code_cache.keep(TEXT, CODE)
    assert code_file(tmp_path / "named").is_file()
    assert code_cache.load(TEXT) == CODE
    monkeypatch.setenv(code_cache.FOLDER, "")
    code_cache.keep("other", CODE)
    assert code_cache.load(TEXT) is None
    assert code_file(tmp_path).is_file()


def test_where_nothing_can_be_kept_nothing_is_said(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    monkeypatch.setenv(code_cache.FOLDER, str(tmp_path / "file"))
    code_cache.keep(TEXT, CODE)
    assert code_cache.load(TEXT) is None


def test_the_oldest_files_go(tmp_path, monkeypatch):
    monkeypatch.setattr(code_cache, "MOST", 3)
    for i in range(5):
        code_cache.keep(str(i), CODE)
        for age, file in enumerate(tmp_path.rglob("*.o")):
            os.utime(file, (1e9 + i + age / 10, 1e9 + i + age / 10))
    assert len(list(tmp_path.rglob("*.o"))) == 3
    assert code_cache.load("4") == CODE


def test_code_from_the_disk_says_the_same_to_the_last_bit(monkeypatch):
    pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    compiled, keep, results = [], code_cache.keep, []

    def counted(text, code):
        compiled.append(text)
        keep(text, code)

    monkeypatch.setattr(code_cache, "keep", counted)
    program = gallery.mechanism("ruiz_fourbar").plan(["crank.drive"], friction="newton").program
    q = np.linspace(0, 6, 50)
    inputs = dict.fromkeys(program.inputs, q)
    for _ in range(2):
        llvm._CODES.clear()
        results.append(llvm.LlvmEngine(program).run(inputs, q.size))
    assert len(compiled) == 1
    for a, b in zip(*results, strict=True):
        assert np.array_equal(a, b, equal_nan=True)
