# SPDX-License-Identifier: Apache-2.0
"""Damaged copies of files, and what a reader does with each: it reads it, or refuses it in a line, in bounded time and
memory. For hours of it, all kinds or some:

    ./fledge exec python3 -m tests.mutants SEED COUNT [KIND ...]
"""
from __future__ import annotations

import io
import os
import random
import re
import resource
import select
import signal
import sys
import tempfile
import traceback
import warnings
import xml.etree.ElementTree as xml
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fledge
from fledge import files, world
from fledge.archive import ArchiveError
from fledge.archive.mcap import CHUNK, DATA_END, MAGIC, METADATA
from fledge.errors import CompositionError, Failure, RunError, SetupError
from fledge.files import ck, sclk, spk
from fledge.files.sections import Message
from fledge.ground import captures
from fledge.ground.database import Database

SECONDS, BYTES = 10, 500_000_000    # of a processor and of memory, that a copy may take
PATIENCE = 12                       # times as long on a clock, where other programs have the processors
LINE = 1500         # characters that a line of a refusal may have
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")
NUMBERS = [b"", b"0", b"-1", b"1", b"1e999", b"-1e308", b"1e-400", b"nan", b"inf", b"0x10", b"1_000", b"9" * 5000,
           b"2147483647", b"2147483648", b"4294967295", b"4294967296", b"-9223372036854775808", b"9223372036854775808",
           b"18446744073709551615", b"1000000", "\u0663".encode(), b"--1", b"1.2.3"]
WORDS = [0, 1, 2, -1, 2**31 - 1, -2**31, 2**32 - 1, 10**6, 2**63 - 1, -2**63,
         *(int.from_bytes(bytes.fromhex(x), "big") for x in
           ("7ff0000000000000", "fff8000000000000", "7fefffffffffffff", "0000000000000001", "41dfffffffc00000"))]


HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE = 1, 2, 3, 4, 5     # records of MCAP
KEPT = (HEADER, SCHEMA, CHANNEL, MESSAGE, METADATA)


class Verdict(NamedTuple):
    """Of one copy: "read", "refused", or what is wrong; the text of the refusal or of what is wrong."""

    word: str
    text: str
    seconds: float      # of a processor
    bytes: int          # the peak of the process, its program included


def of_bytes(data: bytes, r: random.Random) -> bytes:
    """Bits, words, spans and the end of the data are others."""
    at = r.randrange(len(data) + 1)
    to = min(len(data), at + r.choice([1, 4, 8, 100, 1024]))
    kind = r.randrange(7)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + data[to:]
    if kind == 2:
        return data[:to] + data[at:]
    if kind == 3:
        return data[:at] + bytes(to - at) + data[to:]
    if kind == 4 and data:
        at = min(at, len(data) - 1)
        return data[:at] + bytes([data[at] ^ 1 << r.randrange(8)]) + data[at + 1:]
    size = r.choice([1, 2, 4, 8])
    at -= at % size
    word = (r.choice(WORDS) % 2**(8 * size)).to_bytes(size, r.choice(["little", "big"]))
    return data[:at] + word + data[at + size:]


def of_text(data: bytes, r: random.Random) -> bytes:
    """Numbers, words and lines are others, or elsewhere, or twice there."""
    lines = data.split(b"\n")
    at = r.randrange(len(lines))
    kind = r.randrange(7)
    if kind == 0:
        lines[at:at + 1] = []
    elif kind == 1:
        lines[at:at] = [lines[at]] * r.choice([1, 1, 100])
    elif kind == 2:
        other = r.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 3:
        lines[at] = r.choice([b"\xe9", b"\0", b"\x1b[31m", "\u200e".encode(), b"=", b"\"", b"x" * 100_000]) + lines[at]
    elif kind == 4:
        return of_bytes(data, r)
    else:
        pattern = NUMBER if kind == 5 else re.compile(rb"\w+")
        places = list(pattern.finditer(data))
        if places:
            place = r.choice(places)
            new = r.choice(NUMBERS) if kind == 5 else r.choice(places)[0]
            return data[:place.start()] + new + data[place.end():]
    return b"\n".join(lines)


def of_xml(data: bytes, r: random.Random) -> bytes:
    """Elements and attributes are others, elsewhere, twice there or absent; or as a text."""
    try:
        root = xml.fromstring(data)
    except xml.ParseError:
        root = None
    if root is None or r.randrange(4) == 0:
        return of_text(data, r)
    parents = [(parent, child) for parent in root.iter() for child in parent]
    parent, element = r.choice(parents)
    kind = r.randrange(6)
    if kind == 0:
        parent.remove(element)
    elif kind == 1:
        parent.insert(0, element)
    elif kind == 2:
        inside = set(element.iter())
        r.choice([other for other, _ in parents if other not in inside]).append(element)
    elif kind == 3:
        element.tag = r.choice(parents)[1].tag
    elif kind == 4 and element.text and element.text.strip():
        element.text = r.choice(NUMBERS).decode()
    else:
        owners = [owner for owner in root.iter() if owner.attrib]
        owner = r.choice(owners)
        name = r.choice(sorted(owner.attrib))
        new = r.choice([None, r.choice(NUMBERS).decode(), r.choice(sorted(r.choice(owners).attrib.values()))])
        if new is None:
            del owner.attrib[name]
        else:
            owner.set(name, new)
    return xml.tostring(root)


def of_archive(data: bytes, r: random.Random) -> bytes:
    """A zip of which a file of XML, or any byte, is another."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            entries = {name: old.read(name) for name in old.namelist()}
    except Exception:       # zipfile has many for what is damaged already
        entries = {}
    if not entries or r.randrange(3) == 0:
        return of_bytes(data, r)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new:
        for name, content in entries.items():
            new.writestr(name, of_xml(content, r) if name.endswith(".xml") else content)
    return packed.getvalue()


def of_record(data: bytes, r: random.Random) -> bytes:
    """An MCAP file without chunks, checksums and summary, of which a record, or a text in it, is another, elsewhere,
    twice there or absent."""
    rows = list(_rows(data, len(MAGIC)))
    rows = [row for op, body in rows for row in (_rows(body, 40) if op == CHUNK else [(op, body)]) if row[0] in KEPT]
    if not rows:
        return of_bytes(data, r)
    at, other = r.randrange(len(rows)), r.randrange(len(rows))
    kind = r.randrange(6)
    if kind == 0:
        del rows[at]
    elif kind == 1:
        rows.insert(at, rows[other])
    elif kind == 2:
        rows[at], rows[other] = rows[other], rows[at]
    elif kind == 3:
        rows[at] = rows[at][0], of_bytes(rows[at][1], r)
    else:       # of a schema, channel or metadata; a text follows its length
        at = r.choice([i for i, (op, _) in enumerate(rows) if op != MESSAGE] or [at])
        body = rows[at][1]
        begins = [i for i in range(2, len(body) - 4) if 0 < int.from_bytes(body[i - 4:i], "little") <= len(body) - i]
        begin = r.choice(begins or [len(body)])
        end = begin + int.from_bytes(body[begin - 4:begin], "little")
        new = of_text(body[begin:end], r)
        rows[at] = rows[at][0], body[:begin - 4] + len(new).to_bytes(4, "little") + new + body[end:]
    rows += [(DATA_END, bytes(4)), (FOOTER, bytes(20))]
    return MAGIC + b"".join(bytes([op]) + len(body).to_bytes(8, "little") + body for op, body in rows) + MAGIC


def _rows(data: bytes, at: int) -> Iterator[tuple[int, bytes]]:
    """(operation code, content) of each whole record from a byte on."""
    while at + 9 <= len(data) and at + 9 + (size := int.from_bytes(data[at + 1:at + 9], "little")) <= len(data):
        yield data[at], data[at + 9:at + 9 + size]
        at += 9 + size


def copies(data: bytes, change: Callable[[bytes, random.Random], bytes], seed: int, count: int) -> Iterator[bytes]:
    """The same for the same seed."""
    for i in range(count):
        r, copy = random.Random(f"{seed} {i}"), data
        for _ in range(r.choice([1, 1, 1, 2, 3])):
            copy = change(copy, r)
        yield copy


def judge(read: Callable[[Path], object], path: Path, refusals: tuple[type[BaseException], ...]) -> Verdict:
    """What `read` does with a file, in a process of its own, which ends with its time or memory."""
    out, end = os.pipe()
    child = os.fork()
    if child == 0:
        text = ""
        try:
            size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (size + 2 * BYTES,) * 2)
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                read(path)
            text = "read\n"
        except refusals as refusal:
            text = f"refused\n{refusal}"
        except BaseException as error:      # whatever it is, it is the verdict
            text = f"{type(error).__name__}\n" + "".join(traceback.format_exception(error)[-4:])[-3000:]
        finally:
            os.write(end, text.encode(errors="replace")[:60_000])
            os._exit(0)
    os.close(end)
    answered = bool(select.select([out], [], [], PATIENCE * SECONDS)[0])
    if not answered:
        os.kill(child, signal.SIGKILL)
    text = os.read(out, 60_000).decode()
    os.close(out)
    _, status, usage = os.wait4(child, 0)
    word, _, text = text.partition("\n")
    seconds, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
    if not answered or os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
        word = f"no end within {SECONDS} s"
    elif os.WIFSIGNALED(status):
        word = f"ended by {signal.Signals(os.WTERMSIG(status)).name}"
    elif peak > BYTES:
        word = f"takes {peak / 1e6:.0f} MB"
    elif word == "refused" and max(map(len, text.split("\n"))) > LINE:
        word = "refused in a line that is too long"
    elif word == "refused" and not text.replace("\n", "").isprintable():
        word = "refused by characters that are not shown"
    return Verdict(word, text, seconds, peak)


# What makes a file of each kind, how a copy is damaged, and what reads it.

REFUSALS = (Failure, SetupError, CompositionError, RunError, ArchiveError)
TIMES = np.arange(0, 20) * 60 * 10**9
TLE = """ISS (ZARYA)
1 25544U 98067A   20287.20334972  .00001264  00000-0  31212-4 0  9995
2 25544  51.6431 132.5211 0001357  54.3017  42.4190 15.49309239250274
"""
FIELD = """6378136.3, 3.986004415e14, 7.292115e-5, 2, 2, 1, 0, 0
0, 0, 1, 0, 0, 0
1, 0, 0, 0, 0, 0
1, 1, 0, 0, 0, 0
2, 0, -4.841692e-4, 0, 0, 0
2, 1, -2e-10, 1.4e-9, 0, 0
2, 2, 2.439e-6, -1.4e-6, 0, 0
"""
DRIFTING = """product_type gravity_field
earth_gravity_constant 3.986004415e14
radius 6378136.3
max_degree 2
tide_system tide_free
end_of_head
gfct 2 0 -4.84e-4 0 20050101
trnd 2 0 1e-11 0
gfc 2 1 0 0
gfc 2 2 2.4e-6 -1.4e-6
"""
Maker = Callable[[Path], Path]


def text(name: str, content: str) -> Maker:
    def make(folder: Path) -> Path:
        (folder / name).write_text(content)
        return folder / name
    return make


def kernel(folder: Path, kind: int) -> Path:
    angle = TIMES[:, None] / 1e9 * 1.1e-3 + [0, 1, 2]
    spk.write(folder / "a.bsp", target=-999, center="EARTH", times=TIMES, r=7e6 * np.sin(angle),
              v=7.7e3 * np.cos(angle), type=kind, degree=7)
    return folder / "a.bsp"


def positions(path: Path) -> None:
    for segment in spk.read(path):
        segment.at([segment.begin, segment.end])


def followed(path: Path) -> None:
    """The reader of the simulation."""
    sim = fledge.Simulation("mutants")
    epoch = "2016-12-31T23:59:59" if path.suffix == ".oem" else "2000-01-01T12:05:00 TDB"
    sim.world.craft = world.EphemerisCraft(orbit=path, sky=world.Sky(epoch, center=world.EARTH))
    sim.world.task("world", every=1.0, run=[sim.world.craft])
    sim.run(1.0)


def attitudes(folder: Path) -> Path:
    from fledge.files.ck_test import write
    from fledge.files.sclk_test import BEPI

    (folder / "a.tsc").write_text(BEPI)
    return Path(write(folder / "a.bc", np.arange(0, 500, 10.0), [0, 200]))


def turned(path: Path) -> None:
    for segment in ck.read(path, sclk.read(path.with_name("a.tsc"))):
        segment.at(segment.times)


def messages(path: Path) -> None:
    for message in files.read_all(path):
        files.ndm.text_of(message) if isinstance(message, Message) else repr(message)


def pulled(path: Path) -> None:
    world.EARTH.harmonics(path, tides="tide_free", epoch="2025-01-01 TDB")


def database(folder: Path) -> Path:
    from fledge.ground.testing import databases

    (folder / "a.xml").write_text(databases.Random(3).text)
    return folder / "a.xml"


def decoded(path: Path) -> None:
    for lenient in (True, False):
        read = Database.load(path, lenient=lenient)
        for first in range(8):
            read.decode(bytes([first, *range(40)]))
        for command in read.commands:
            try:
                read.encode(command)
            except SetupError:
                pass    # arguments are missing


def capture(folder: Path, form: str) -> Path:
    from fledge.cli.ground import packets_test as made

    path = folder / f"a.{form}"
    datagrams = [made.datagram(packet) for packet in made.ALL]
    path.write_bytes({"pcap": lambda: made.pcap(datagrams), "pcapng": lambda: made.pcapng(datagrams),
                      "frames": lambda: b"".join(made.frames_of(b"".join(made.ALL))),
                      "bin": lambda: b"".join(made.ALL)}[form]())
    return path


def captured(path: Path) -> None:
    list(captures.read(path, captures.Format(frames=64 if path.suffix == ".frames" else 0)))


def record(folder: Path) -> Path:
    sim = fledge.load("nadir_spin")
    sim.record(sim.flight.tracking.error, sim.world.craft.state, every=0.5)
    sim.archive(folder / "a.mcap", mission="nadir_spin", scenario="free")
    sim.run(2.0)
    sim.close_archive(outcome="passed", ended="2 s")
    converted(folder / "a.mcap")        # imports, once, what the process of each copy would import
    return folder / "a.mcap"


def frames(path: Path) -> None:
    with fledge.Archive(path) as archive:
        archive.frame()
        repr(archive)


def converted(path: Path) -> None:
    from fledge.archive.compare import compare, digest

    with fledge.Archive(path) as archive, fledge.Archive(path) as same:
        readable = [topic for topic, channel in archive.topics.items() if not channel.problem]
        archive.frame(readable), archive.parameters, digest(archive, archive.topics), compare(archive, same, readable)
        archive.to_csv(path.with_suffix(""), readable)
        archive.to_hdf5(path.with_suffix(".h5"), readable)
        archive.to_mat(path.with_suffix(".mat"), readable)


def fmu(folder: Path) -> Path:
    from fmi.testing import oscillator

    return oscillator.make(folder)


def imported(path: Path) -> None:
    sim = fledge.Simulation("mutants")
    sim.world.model = world.Fmu(path)
    sim.world.task("world", every=0.1, run=[sim.world.model])
    sim.run(1.0)


def kinds() -> dict[str, tuple[Maker, Callable[[bytes, random.Random], bytes], Callable[[Path], object]]]:
    from fledge.files.sclk_test import BEPI
    from fledge.files.stk_test import ORBIT, SPIN
    from fledge.files.testing import examples

    found = {f"SPK {kind}": (partial(kernel, kind=kind), of_bytes, positions) for kind in (9, 13)}
    found |= {f"SPK {kind} in flight": (partial(kernel, kind=kind), of_bytes, followed) for kind in (9, 13)}
    found |= {"CK": (attitudes, of_bytes, turned), "SCLK": (text("a.tsc", BEPI), of_text, sclk.read)}
    found |= {name: (text(f"a.{name.lower()}", getattr(examples, name)), of_text, messages)
              for name in ("OPM", "OEM", "AEM", "OCM", "CDM", "APM", "OMM")}
    return found | {
        "OCM in XML": (text("a.xml", files.ndm.text_of(files.read(examples.OCM), "xml")), of_xml, messages),
        "OEM in flight": (text("a.oem", examples.OEM), of_text, followed),
        "STK orbit": (text("a.e", ORBIT), of_text, messages), "STK attitude": (text("a.a", SPIN), of_text, messages),
        "TLE": (text("a.tle", TLE), of_text, messages), "SHADR": (text("a.csv", FIELD), of_text, pulled),
        "ICGEM": (text("a.gfc", DRIFTING), of_text, pulled), "XTCE": (database, of_xml, decoded),
        **{form: (partial(capture, form=form), of_bytes, captured) for form in ("pcap", "pcapng", "frames", "bin")},
        "MCAP": (record, of_bytes, frames), "MCAP records": (record, of_record, converted),
        "FMU": (fmu, of_archive, imported)}


def campaign(kind: str, seed: int, count: int) -> Iterator[tuple[int, Verdict]]:
    """(number, verdict) of each copy of a file of this kind."""
    make, change, read = kinds()[kind]
    with tempfile.TemporaryDirectory() as folder:
        original = make(Path(folder))
        for i, copy in enumerate([original.read_bytes(), *copies(original.read_bytes(), change, seed, count)]):
            path = original.with_name(f"mutant_{i}{original.suffix}")
            path.write_bytes(copy)
            verdict = judge(read, path, REFUSALS)
            yield i, verdict if i or verdict.word == "read" else verdict._replace(word="the original is not read")
            path.unlink(missing_ok=True)


def main(seed: str, count: str, *wanted: str) -> int:
    wrong = 0
    for kind in wanted or kinds():
        words: dict[str, int] = {}
        slowest, largest = 0.0, 0
        for i, verdict in campaign(kind, int(seed), int(count)):
            words[verdict.word] = words.get(verdict.word, 0) + 1
            slowest, largest = max(slowest, verdict.seconds), max(largest, verdict.bytes)
            if verdict.word not in ("read", "refused"):
                wrong += 1
                print(f"{kind} {i}: {verdict.word} ({verdict.seconds:.1f} s): {verdict.text}", flush=True)
        print(f"{kind}: {words}, at most {slowest:.2f} s and {largest / 1e6:.0f} MB", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
