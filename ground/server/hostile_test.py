# SPDX-License-Identifier: Apache-2.0
"""Damaged files of a server: each gets a sentence, or is read as far as it is good. FLEDGE_CASES: how many damages."""
import os
import struct
from random import Random

import pytest

from fledge.archive import Archive, ArchiveError
from fledge.cli import main
from fledge.cli.ground.packets_test import XTCE, packet
from fledge.ground.server.journal import LISTS, Journal
from fledge.errors import SetupError
from fledge.ground import Database

CASES = int(os.environ.get("FLEDGE_CASES", "15"))
SIZES = [0, 1, 2**31, 2**32 - 1, 2**60, 2**63, 2**64 - 1]


def damaged(data, r):
    """With a few damages, half of them near the ends, where lengths are."""
    data = bytearray(data)
    for _ in range(r.choice([1, 1, 2, 5])):
        n = len(data)
        at = r.choice([r.randrange(n), r.randrange(min(600, n)), n - 1 - r.randrange(min(1500, n))])
        if (what := r.randrange(7)) == 0:
            data[at] ^= 1 << r.randrange(8)
        elif what == 1:
            data[at:at + 8] = struct.pack("<Q", r.choice(SIZES))
        elif what == 2:
            data[at:at + 4] = struct.pack(">I", r.choice(SIZES) & 0xFFFFFFFF)
        elif what == 3:
            del data[max(at, 1):]
        elif what == 4:
            data[at:at + r.randrange(200)] = r.randbytes(r.randrange(200))
        elif what == 5:
            data += r.randbytes(r.randrange(1, 3000))
        else:
            data[at:at + 64] = bytes(64)
    return bytes(data) or b"\0"


@pytest.mark.parametrize("seed", range(2))
def test_a_damaged_journal_gets_a_sentence(tmp_path, seed):
    r, journal = Random(seed), Journal(tmp_path)
    for kind in LISTS:
        for i in range(40):
            journal.save(kind, "one", {"text": "x" * 80, "t_ns": str(i), "state": "active"})
    journal.close()
    whole, errors = journal.path.read_bytes(), []
    for _ in range(CASES):
        for left in tmp_path.glob("journal.sqlite*"):
            left.unlink()
        journal.path.write_bytes(damaged(whole, r))
        try:
            again = Journal(tmp_path)
        except SetupError as error:
            errors.append(str(error))
            continue
        for kind in LISTS:
            for read in (again.rows, again.all):
                try:
                    assert all(isinstance(row["id"], int) for row in read(kind, "one"))
                except SetupError as error:
                    errors.append(str(error))
        again.close()
    assert errors and all(error.startswith(f"{journal.path}") and error.isprintable() and len(error) < 400
                          for error in errors)


@pytest.mark.parametrize("seed", range(2))
def test_a_damaged_archive_is_read_as_far_as_it_is_good_and_written_on(tmp_path, seed, capsys):
    r, xml, folder = Random(seed), tmp_path / "s.xml", tmp_path / "archive"
    xml.write_text(XTCE, encoding="utf-8")
    database = Database.load(xml)

    def archive(first, n):
        monitor, writer = database.monitor("/S/P"), database.archive(folder, "one")
        monitor.sink(writer)
        for i in range(first, first + n):
            monitor.take([(i * 10**9, i * 10**9, packet(i, bytes([i % 250, 1])))])
        writer.close()

    archive(0, 300)
    archive(1000, 300)
    whole = {path: path.read_bytes() for path in folder.rglob("*.mcap")}
    assert len(whole) == 2
    for _ in range(CASES):
        for writer in folder.rglob("*.mcap"):
            writer.unlink()
        for writer, data in whole.items():
            writer.write_bytes(data)
        file = r.choice(sorted(whole))
        file.write_bytes(damaged(whole[file], r))
        history = database.history(folder, "one", "/S/P")
        good = [found for session in history.sessions() for batch in history.replay(session=session["session"])
                for _, _, found in batch]
        first = 0 if "000001" in file.name else 1000
        other = [packet(i, bytes([i % 250, 1])) for i in range(1000 - first, 1300 - first)]
        assert set(other) <= set(good), "the file that is whole is read whole"
        del history
        archive(5000, 1)
        assert database.history(folder, "one", "/S/P").packets(5000 * 10**9, 5000 * 10**9)
        assert main(["packets", str(file), "--database", str(xml)]) in (0, 1, 2)
        try:
            record = Archive(file)
            for topic in record.topics:
                record[topic]
        except ArchiveError as error:
            assert str(error).startswith(str(file))
    err = capsys.readouterr().err
    assert "Traceback" not in err and "defect" not in err


@pytest.mark.parametrize("text", [b"&#27;", b"&#xD800;", b"\xff", b"\xc0\x80", b"\xed\xa0\x80", b"&#x110000;"])
@pytest.mark.parametrize("before", [b"<Unit>V", b"'bus", b"'Q", b"value='5"])
def test_what_is_no_text_in_a_database_is_refused_with_its_line(tmp_path, text, before):
    (tmp_path / "s.xml").write_bytes(XTCE.encode().replace(before, before + text))
    with pytest.raises(SetupError, match=r"s.xml:\d+: a name or text is not UTF-8, or has a character that"):
        Database.load(tmp_path / "s.xml")
