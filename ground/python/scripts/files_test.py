# SPDX-License-Identifier: Apache-2.0
"""Files to a craft and from it, over a link in memory that loses, repeats and delays packets: the other end is another
entity of the same class, without flight around it."""
from contextlib import suppress
from functools import reduce
from heapq import heappop, heappush
from operator import xor
from pathlib import Path
from random import Random
import os
import signal
import struct
import time

import pytest

from fledge import _ground, ground
from fledge.cli import main
from fledge.commands import SERVICES, Code, Timed
from fledge.errors import SetupError
from fledge.ground.scripts.files import CRAFT, GROUND, Files
from fledge.ground.scripts.links import Link
from fledge.units import minute, s

STEP = 10_000_000


def test_numbers_and_names_that_need_more_room_are_not_cut():
    """The ids in a message, by the layout of 727.0-B-5, 6.2.4: lengths less 1 of both, then each."""
    for source, number, lengths in [(1, 1, (2, 4)), (0x10000, 2**32, (3, 5)), (2**64 - 1, 2**64 - 1, (8, 8))]:
        message = _ground.Entity.message(0x30, (source, number))
        ids, numbers = lengths
        assert message[2:] == b"cfdp\x30" + bytes([(ids - 1) << 4 | numbers - 1]) + source.to_bytes(ids, "big") \
            + number.to_bytes(numbers, "big")
        assert _ground.Entity.read_message(message[2:]) == (0x30, (source, number), 0)
    with pytest.raises(ValueError, match="a text of CFDP has 255 bytes at most, not 300: aaa"):
        _ground.Entity.message(0x10, first="a" * 300)
    with pytest.raises(ValueError, match="a message of CFDP has 255 bytes at most"):
        _ground.Entity.message(0x10, first="a" * 200, second="b" * 100)


class Board(Link):
    """A craft that knows files alone: a PDU each way at each 10 ms."""

    def __init__(self, dictionary, folder, loss=0.0, twice=0.0, delay=100_000_000, seed=1):
        folder.mkdir(exist_ok=True)
        self.dictionary, self.loss, self.twice, self.delay = dictionary, loss, twice, delay
        self.random, self.flying, self.n, self.now, self.up, self.out = Random(seed), [], 0, 0, 0, False
        self.entity = _ground.Entity(folder=str(folder), own=CRAFT, peer=GROUND, sequence=1, timeout=2 * 10**9,
                                     inactivity=60 * 10**9, limit=10, allowed=15)

    @property
    def t(self):
        return self.now

    def carry(self, up, data):
        for _ in range(1 + (self.random.random() < self.twice)):
            if self.random.random() >= self.loss and not self.out:
                self.n += 1
                late = self.random.randrange(2) * self.random.randrange(300) * 10**6 if self.twice else 0
                heappush(self.flying, (self.now + self.delay + late, self.n, up, data))

    def send(self, packet):
        assert packet[6] == Code.PDU and reduce(xor, packet) == 0xFF and len(packet) <= 8 + 512
        self.up += len(packet)
        self.carry(True, packet[8:])

    def receive(self, until):
        arrived = []
        while self.now < until and not arrived:
            self.now = min(until, self.now + STEP)
            self.entity.time(self.now)
            while self.flying and self.flying[0][0] <= self.now:
                _, _, up, data = heappop(self.flying)
                if up:
                    self.entity.take(data)
                else:
                    arrived.append(Timed(self.now, data))
            if pdu := self.entity.next():
                self.carry(False, struct.pack(">3H10x", self.dictionary.texts + 1 + SERVICES.index("files"), 0xC000,
                                              9 + len(pdu)) + pdu)
        return arrived


DICTIONARY = ground.dictionary_of("nadir_spin")


@pytest.fixture()
def connected(tmp_path):
    """Makes a craft with a board, whose files are in the folder `board`."""
    def make(**link):
        craft = ground.Craft(Board(DICTIONARY, tmp_path / "board", **link), DICTIONARY)
        craft.files = Files(craft, timeout=2 * s)
        return craft

    return make


def some(path, n, seed=1):
    path.write_bytes(Random(seed).randbytes(n))
    return path


def test_files_go_both_ways_at_the_rate_of_the_link(connected, tmp_path):
    plan, board = some(tmp_path / "plan", 30_000), tmp_path / "board"
    with connected() as craft:
        seen = []
        sent = craft.put(plan, to="next", progress=lambda transfer: seen.append(transfer.done))
        assert sent.completed(within=1 * minute) is sent and sent.ended and repr(sent) == \
            "<send plan as next: complete>"
        assert (board / "next").read_bytes() == plan.read_bytes()
        assert 0.95 < craft.link.up / craft.files.rate / (craft.link.t / 1e9) < 1.3 and len(seen) > 50
        assert seen == sorted(seen) and seen[-1] == 30_000
        some(board / "science", 50_000, 2)
        got = craft.fetch("science", to=tmp_path / "got", within=1 * minute)
        assert got.ended and (tmp_path / "got").read_bytes() == (board / "science").read_bytes()
        assert craft.directory("") == ["next", "science"]
        craft.put(plan, class1=True, within=1 * minute)
        craft.listen(1 * s)
        assert (board / "plan").read_bytes() == plan.read_bytes()
        some(board / "empty", 0)
        craft.fetch("empty", to=tmp_path / "empty", class1=True, within=10 * s)
        assert (tmp_path / "empty").read_bytes() == b""
        craft.files.rate = 40_000
        begin = craft.link.t
        craft.put(plan, to="fast", within=1 * minute)
        assert craft.link.t - begin < 2 * 10**9 and list(craft.files.folder.iterdir()) == []
    assert not craft.files.folder.exists()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_link_that_loses_repeats_and_delays_loses_no_byte(connected, tmp_path, seed):
    plan, board = some(tmp_path / "plan", 20_000, seed), tmp_path / "board"
    with connected(loss=0.1, twice=0.05, seed=seed) as craft:
        some(board / "science", 20_000)
        both = [craft.put(plan), craft.fetch("science", to=tmp_path / "got")]
        for transfer in both:
            transfer.completed(within=10 * minute)
        assert craft.directory("", within=1 * minute) == ["plan", "science"]
    assert (board / "plan").read_bytes() == plan.read_bytes()
    assert (tmp_path / "got").read_bytes() == (board / "science").read_bytes()


def test_what_fails_says_why(connected, tmp_path):
    plan = some(tmp_path / "plan", 3_000)
    with connected() as craft:
        for call, says in [
                (lambda: craft.fetch("none", to=tmp_path / "x", within=10 * s),
                 "fetch none: the file store refused it on board"),
                (lambda: craft.fetch("../x", to=tmp_path / "x", within=10 * s), "the file store refused it on board"),
                (lambda: craft.put(plan, to="../x", within=10 * s), "send plan as ../x: the file store refused it"),
                (lambda: craft.put(plan, to="a/b", within=10 * s), "the file store refused it"),
                (lambda: craft.directory("none"), "list none: there is no such directory on board"),
                (lambda: craft.put(plan, within=0.1),
                 r"send plan as plan: \d+ of 3000 bytes went, and it did not end within")]:
            with pytest.raises(ground.NoAnswer, match=says):
                call()
        for call, says in [
                (lambda: craft.put(tmp_path / "none"), "there is no such file"),
                (lambda: craft.put(plan, to="n" * 200), "a name has at most 127 bytes"),
                (lambda: craft.fetch("a", to=tmp_path / "none/a"), "there is no folder"),
                (lambda: craft.fetch("a" * 300, to=tmp_path / "x"), "a text of CFDP has 255 bytes at most"),
                (lambda: craft.directory("a" * 250), "a message of CFDP has 255 bytes at most"),
                (lambda: Files(craft, rate=0), "the rate is more than 0"),
                (lambda: Files(craft, folder=tmp_path / "none"), "there is no folder")]:
            with pytest.raises(SetupError, match=says):
                call()
        craft.link.out = True
        silent = craft.put(plan)
        with pytest.raises(ground.NoAnswer, match="it was sent again and again, and not acknowledged"):
            silent.completed(within=10 * minute)
        assert not (tmp_path / "x").exists() and {path.name for path in tmp_path.iterdir()} == {"plan", "board"}


def test_cancel_suspend_and_resume(connected, tmp_path):
    plan, board = some(tmp_path / "plan", 30_000), tmp_path / "board"
    with connected() as craft:
        some(board / "science", 300_000)
        for begin in [lambda: craft.put(plan, to="next"), lambda: craft.fetch("science", to=tmp_path / "got")]:
            transfer = begin()
            craft.listen(2 * s)
            transfer.suspend()
            craft.listen(5 * s)
            done = transfer.done
            craft.listen(100 * s)       # longer than the inactivity of the board
            assert 0 < done == transfer.done and not transfer.ended and not transfer.problem
            transfer.resume()
            transfer.completed(within=1 * minute)
        assert (tmp_path / "got").read_bytes() == (board / "science").read_bytes()
        for begin in [lambda: craft.put(plan, to="other"), lambda: craft.fetch("science", to=tmp_path / "more")]:
            for after in (1e-3, 2.0):
                transfer = begin()
                craft.listen(after)
                transfer.cancel()
                with pytest.raises(ground.NoAnswer, match="it was cancelled"):
                    transfer.completed(within=1 * minute)
        craft.listen(10 * s)
        assert not craft.files.entity.busy and not craft.link.entity.busy
    assert {path.name for path in board.iterdir()} == {"next", "science"} and not (tmp_path / "more").exists()


def test_what_the_craft_sends_unasked_is_kept(connected, tmp_path):
    (tmp_path / "down").mkdir()
    with connected(loss=0.1) as craft:
        craft.files = Files(craft, tmp_path / "down", timeout=2 * s)
        some(tmp_path / "board/science", 5000)
        craft.link.entity.put("science", "tonight", b"", False)
        craft.wait(lambda _: craft.files.received, within=1 * minute)
        assert craft.files.received == [tmp_path / "down/tonight"]
        assert (tmp_path / "down/tonight").read_bytes() == (tmp_path / "board/science").read_bytes()


def test_no_file_that_comes_replaces_another_one_and_hidden_names_are_refused(connected, tmp_path):
    board, down = tmp_path / "board", tmp_path / "down"
    down.mkdir()
    with connected() as craft:
        craft.files = Files(craft, down, timeout=2 * s)
        sizes = [100, 2000, 0, 300]
        for place, size in enumerate(sizes):
            some(board / f"of{place}", size, place)
            for to in ("log.bin", "log"):
                craft.link.entity.put(f"of{place}", to, b"", False)
                craft.wait(lambda _: len(craft.files.received) == 2 * place + 1 + (to == "log"), within=1 * minute)
        refused = [".hidden", "..", "../out", "a/b", "/etc/x", "new\nline", "\x7f", ".way1-got", ".way1-list"]
        for number, name in enumerate(refused, 1):
            craft.link.entity.put("of1", name, b"", False)
            craft.wait(lambda _: len(craft.files.failed) == number, within=1 * minute)
        got = craft.fetch("of1", to=down / "log")
        got.replaces = False
        assert got.completed(within=1 * minute).local == down / "log.5"
        assert craft.directory("") == [f"of{place}" for place in range(4)]
    assert [name for name, _ in craft.files.failed] == refused
    assert all(why == "the file store refused it" for _, why in craft.files.failed)
    files = {path.name: path.read_bytes() for path in down.iterdir()}
    ours = [(board / f"of{place}").read_bytes() for place in (0, 1, 2, 3, 1)]
    assert files == dict(zip(["log", "log.2", "log.3", "log.4", "log.5"], ours)) | dict(
        zip(["log.bin", "log.2.bin", "log.3.bin", "log.4.bin"], ours))
    assert {received.name for received in craft.files.received} == files.keys() - {"log.5"}


def test_files_that_come_are_whole_or_not_there_after_kill_9(connected, tmp_path):
    """FLEDGE_CASES: at how many instants. The other process tells of each file that has come."""
    board, down, chance, reported = tmp_path / "board", tmp_path / "down", Random(7), 0
    board.mkdir()
    down.mkdir()
    content = some(board / "of", 60_000).read_bytes()
    for _ in range(int(os.environ.get("FLEDGE_CASES", "5"))):
        ours, theirs = os.pipe()
        if not (child := os.fork()):
            with suppress(BaseException):
                craft = connected()
                craft.files = Files(craft, down, timeout=2 * s)
                while True:
                    before = len(craft.files.received)
                    craft.link.entity.put("of", "log", b"", False)
                    craft.wait(lambda _: len(craft.files.received) > before, within=10 * minute)
                    os.write(theirs, b".")
            os._exit(1)
        os.close(theirs)
        os.read(ours, 1)
        time.sleep(chance.uniform(0, 0.2))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        reported += 1
        while more := os.read(ours, 100):
            reported += len(more)
        os.close(ours)
        files = [path for path in down.iterdir() if not path.name.startswith(".")]
        assert len(files) >= reported and all(path.read_bytes() == content for path in files)
    print(f"{reported} files reported, {len(files)} there")


def test_by_hand(tmp_path, monkeypatch, capsys):
    board = tmp_path / "board"
    plan = some(tmp_path / "plan", 8000)
    monkeypatch.setattr(ground, "open_link", lambda *_: Board(DICTIONARY, board))
    monkeypatch.chdir(tmp_path)
    assert main(["send", "plan", "--to", "udp://x", "nadir_spin", "--as", "next", "--rate", "8000"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("  sent     plan as next, 8000 bytes in ")
    assert (board / "next").read_bytes() == plan.read_bytes()
    assert main(["fetch", "next", "--to", "udp://x", "nadir_spin"]) == 0 and Path("next").read_bytes() == \
        plan.read_bytes()
    assert main(["fetch", "/", "--to", "udp://x", "nadir_spin"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "next"
    assert main(["fetch", "none", "--to", "udp://x", "nadir_spin"]) == 1
    assert "fetch none: the file store refused it on board" in capsys.readouterr().err
    assert main(["send", "none", "--to", "udp://x", "nadir_spin"]) == 2
    assert main(["send", "plan", "--to", "udp://x", "nadir_spin", "--within", "0.1s"]) == 1


class Hostile(Board):
    """A board that also sends what it should not: PDUs of its own that it has changed, repeated and made up."""

    names = [b"../out", b"/etc/x", b"a\xff\xfe", b"-rf", b"\x1b[2J\n", b".cfdp0", "\u202egpj".encode(), b"n" * 127]

    def __init__(self, *arguments, **named):
        super().__init__(*arguments, **named)
        self.old, self.chance = [], Random(named.get("seed", 1) + 100)

    def carry(self, up, data):
        super().carry(up, data)
        if not up:
            self.old.append(data)
            for _ in range(3):
                pdu = self.forged(data[16:])
                super().carry(False, data[:4] + (9 + len(pdu)).to_bytes(2, "big") + data[6:16] + pdu)

    def pdu(self, directive, body, sequence, large=0, to_sender=0, source=CRAFT):
        kind = 0x10 if directive is None else 0
        body = body if directive is None else bytes([directive]) + body
        return struct.pack(">BHBHIH", 0x20 | kind | to_sender << 3 | large, len(body), 0x13, source, sequence,
                           GROUND if source == CRAFT else CRAFT) + body

    def forged(self, own):
        """One more PDU: mostly of a transaction that was not begun."""
        r = self.chance
        other, at, name = r.randrange(500, 5000), r.choice([0, 2**32 - 1, 2**32, 2**62, 2**63, 2**64 - 1]), r.choice(
            self.names)
        text = bytes([len(name)]) + name
        return r.choice([
            lambda: own[:r.randrange(len(own))],
            lambda: r.choice(self.old)[16:],
            lambda: own[:4] + r.randbytes(8) + own[12:],
            lambda: self.pdu(7, bytes([r.randrange(16)]) + at.to_bytes(8, "big") + text * 2, other, 1),
            lambda: self.pdu(7, bytes([0]) + (9).to_bytes(4, "big") + text * 2, other),
            lambda: self.pdu(None, at.to_bytes(8, "big") + r.randbytes(r.randrange(1, 200)), other, 1),
            lambda: self.pdu(None, bytes(4) + b"forged", r.randrange(500, 505)),
            lambda: self.pdu(4, bytes([0]) + r.randbytes(4) + (6).to_bytes(4, "big"), r.randrange(500, 505)),
            lambda: self.pdu(8, bytes(8) + b"".join(struct.pack(">2I", 2 * i, 2 * i + 1) for i in range(120)),
                             r.randrange(10), to_sender=1, source=GROUND),
            lambda: self.pdu(7, bytes([0]) + bytes(4) + text * 2 + b"\2\12cfdp\0\1\2\1a\1b", other),
            lambda: self.pdu(4, bytes([0]) + bytes(8), other),
        ])()


@pytest.mark.parametrize("seed", range(int(os.environ.get("FLEDGE_CASES", "3"))))
def test_forged_pdus_bring_nothing_down_and_honest_files_arrive(tmp_path, seed):
    """FLEDGE_CASES: how many seeds, each some seconds of files."""
    plan, (down, board) = some(tmp_path / "plan", 20_000), (tmp_path / "down", tmp_path / "board")
    down.mkdir()
    with ground.Craft(Hostile(DICTIONARY, board, seed=seed), DICTIONARY) as craft:
        craft.files = Files(craft, down, timeout=2 * s)
        some(board / "science", 20_000, 2)
        both = [craft.put(plan, to="next"), craft.fetch("science", to=tmp_path / "got")]
        for transfer in both:
            transfer.completed(within=5 * minute)
        assert craft.directory("", within=1 * minute) == ["next", "science"]
        assert len(craft.files._messages) < 300 and len(craft.files.received) < 300
    assert (board / "next").read_bytes() == plan.read_bytes()
    assert (tmp_path / "got").read_bytes() == (board / "science").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"plan", "down", "board", "got"}
    for path in down.iterdir():
        assert path.name.isprintable() and not path.name.startswith("-") and path.stat().st_blocks < 2000, path
