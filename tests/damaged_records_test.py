# SPDX-License-Identifier: Apache-2.0
"""Every reader of records, with each byte of a record wrong: it reads what it can, or names the file and its damage in
one line. A few hundred bytes by default; with FLEDGE_LONG=1 all, one after the other.
"""
import os
import random

import pytest

import fledge
import fledge.scene.foxglove
from fledge import Archive, cli
from fledge.archive import ArchiveError
from fledge.archive.compare import compare, digest
from fledge.archive.mcap import CHUNK, DATA_END, METADATA, metadata
from fledge.cosim.replay import Exchange

LONG = os.environ.get("FLEDGE_LONG", "") not in ("", "0")
BYTES = 40         # wrong bytes of each kind in the long test


def scene(path, whole):
    fledge.scene.of(path)


def foxglove(path, whole):
    with Archive(path) as archive:
        fledge.scene.foxglove.write(fledge.scene.of(archive), path, path.with_suffix(".scene.mcap"))


def numbers(path, whole):
    with Archive(path) as archive:
        archive.frame()
        assert archive.parameters or archive.problem
        repr(archive), archive._repr_html_()


def compared(path, whole):
    with Archive(path) as a, Archive(whole) as b:
        compare(a, b), digest(a, a.topics)


def exchange(path, whole):
    exchange = Exchange(path)
    for node in exchange.nodes:
        exchange.part(node, exchange.known)


def command(*words):
    def read(path, whole):
        out = ["--out", str(path.with_suffix(""))] if "--csv" in words else []
        code = cli.main([*words[:1], str(path), *words[1:], *out])
        assert code in (0, 1, 2), "a defect"
    return read


READERS = {"numbers": numbers, "compare": compared, "scene": scene, "foxglove": foxglove,
           "metadata": lambda path, whole: metadata(path), "convert --about": command("convert", "--about"),
           "convert --csv": command("convert", "--csv")}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A short record with all that a record has."""
    folder = tmp_path_factory.mktemp("damage")
    sim = fledge.load("nadir_spin")
    sim.record(*sim.world, *sim.flight, every=1.0)
    sim.archive(folder / "whole.mcap", mission="nadir_spin", scenario="free")
    sim.run(2.0)
    sim.close_archive(outcome="passed", ended="2 s")
    return folder / "whole.mcap"


@pytest.fixture(scope="module")
def exchanged(tmp_path_factory):
    """A short record of an exchange."""
    folder = tmp_path_factory.mktemp("exchange")
    assert cli.main(["up", "nadir_spin", "--until", "2s", "--exchange", "--out", str(folder)]) == 0
    return folder / "exchange.mcap"


def records(data):
    """(operation code, begin, end) of each record of the data section."""
    at = 8
    while data[at] != DATA_END:
        end = at + 9 + int.from_bytes(data[at + 1:at + 9], "little")
        yield data[at], at, end
        at = end


def places(data, count):
    """Bytes of the metadata, and of all else: so many of each."""
    about = [i for op, at, end in records(data) if op == METADATA for i in range(at, end)]
    rest = sorted(set(range(len(data))) - set(about))
    rng = random.Random(1)
    return range(len(data)) if LONG else [*rng.sample(about, min(count, len(about))), *rng.sample(rest, count)]


def flipped(file, folder, readers, count):
    """(byte, problem) of each reader that does not end with an error of one line."""
    data, path, rng, wrong = file.read_bytes(), folder / "run.mcap", random.Random(2), []
    for at in places(data, count):
        for flip in {1 << rng.randrange(8), rng.randrange(1, 256)}:
            path.write_bytes(data[:at] + bytes([data[at] ^ flip]) + data[at + 1:])
            for name, read in readers.items():
                try:
                    read(path, file)
                except ArchiveError as error:
                    if str(path) not in str(error):
                        wrong.append((name, at, flip, f"does not name the file: {error}"))
                except fledge.SetupError as error:      # a whole record in which something is not there
                    if str(path) not in str(error) and name not in ("scene", "foxglove"):
                        wrong.append((name, at, flip, f"does not name the file: {error}"))
                except Exception as error:
                    wrong.append((name, at, flip, repr(error)))
    return wrong


@pytest.mark.long("wrong bytes for all readers: 20 s")
def test_a_wrong_byte_in_a_record_is_one_line_for_every_reader(whole, tmp_path, capsys):
    assert flipped(whole, tmp_path, READERS, BYTES) == []


def test_some_wrong_bytes_in_a_record_are_one_line_for_every_reader(whole, tmp_path, capsys):
    assert flipped(whole, tmp_path, READERS, 3) == []


def test_a_wrong_byte_in_a_record_of_an_exchange_is_one_line(exchanged, tmp_path):
    assert flipped(exchanged, tmp_path, {"exchange": exchange}, BYTES) == []


def test_a_wrong_parameter_is_named(whole, tmp_path):
    data, path = whole.read_bytes(), tmp_path / "run.mcap"
    with Archive(whole) as archive:
        name, text = next((n, t) for n, t in archive.metadata["parameters"].items() if t.startswith("["))
    at = data.index(text.encode(), data.index(name.encode()))
    path.write_bytes(data[:at] + b"x" + data[at + 1:])
    with pytest.raises(ArchiveError, match=rf"run.mcap: the metadata of the parameter {name} are damaged: found 'x.*"
                                           "the checksum of the data section is wrong"):
        Archive(path).parameters


def test_a_record_that_is_cut_off_in_its_first_chunk_is_read_to_the_last_whole_message(whole, tmp_path, capsys):
    data, path = whole.read_bytes(), tmp_path / "run.mcap"
    begin, end = next((at, end) for op, at, end in records(data) if op == CHUNK)
    path.write_bytes(data[:begin + (end - begin) * 9 // 10])
    with Archive(path) as archive, Archive(whole) as full:
        assert not archive.complete and "read without a checksum" in archive.problem
        read = {topic: channel.count for topic, channel in archive.topics.items()}
        assert sum(read.values()) > 10
        for topic, n in read.items():
            assert archive[topic].tobytes() == full[topic][:n].tobytes()
    assert cli.main(["convert", str(path), "--csv", "--out", str(tmp_path / "csv")]) == 0
    assert "damaged or cut off" in capsys.readouterr().err
