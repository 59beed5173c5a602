# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all."""

import pytest

from fledge.cli.failures import in_words
from fledge.disk import Part, keep, write_files


def test_a_file_takes_its_name_when_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    with Part(path) as part:
        part.write_text("new")
        assert not path.exists()
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"] and path.read_text() == "new"


def test_what_was_there_stays_where_writing_fails(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(OSError) as error:
        with Part(path) as part, open(part, "w") as file:
            file.write("ne")
            raise OSError(28, "No space left on device")
    assert (error.value.filename, error.value.strerror) == (str(path), "cannot be written: No space left on device")
    with pytest.raises(ZeroDivisionError):
        with Part(path) as part:
            part.write_text(str(1 / 0))
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"] and path.read_text() == "old"


def test_a_full_disk_is_named_by_file_or_folder(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(OSError) as error:
        write_files({"a/b.txt": "text"}, tmp_path)
    assert in_words(error.value) == f"{tmp_path}/a/b.txt: cannot be written: No space left on device"
    assert not list(tmp_path.iterdir())
    assert in_words(OSError(28, "No space left on device"), tmp_path) == \
        f"No space left on device, in {tmp_path} or the folder of temporary files"


def test_what_only_spares_work_is_written_where_it_can_be(tmp_path):
    path = tmp_path / "a/b.txt"
    keep(path, "one")
    with Part(path):
        keep(path, "two")
    assert not path.read_text()     # the file of the other
    keep(path, "two")
    assert path.read_text() == "two"
    keep(path / "below a file", "three")
