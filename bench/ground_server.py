# SPDX-License-Identifier: Apache-2.0
"""The whole server of the control room, as `fledge ground serve` starts it, with programs beside it that send packets
by UDP and read as browsers do: the cores that it uses [the processor time of its process by the time that passes] and
what it loses; the time from a packet's sending to its value's arrival at a WebSocket, which asks for it 60 times a
second."""
from __future__ import annotations

import asyncio
import json
import os
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bench.rows import Rows

NUMBERS, CONTAINERS = 369, 28       # of 32 bits in a packet, kinds of packets: 10,332 values
HEAD = struct.Struct(">HHHq")       # of a space packet, and when it was sent [ns]
SECONDS = 10.0                      # of each measurement
WEEK, WEEKLY = 7 * 86400, 1         # [s]; packets a second of the week
TICKS = os.sysconf("SC_CLK_TCK")


def xtce() -> str:
    """Kinds of packets by their stream, each with the time of its sending and its own numbers, all with limits."""
    def entries(names: list[str]) -> str:
        return "<EntryList>" + "".join(f'<ParameterRefEntry parameterRef="{name}"/>' for name in names) + "</EntryList>"

    def integer(name: str, bits: int, more: str = "") -> str:
        return (f'<IntegerParameterType name="{name}" signed="false"><IntegerDataEncoding sizeInBits="{bits}"/>{more}'
                "</IntegerParameterType>")

    names = [f"p{k}_{i}" for k in range(CONTAINERS) for i in range(NUMBERS)]
    limits = ('<DefaultAlarm><StaticAlarmRanges><WarningRange maxInclusive="4000000000"/><CriticalRange '
              'maxInclusive="4200000000"/></StaticAlarmRanges></DefaultAlarm>')
    kinds = "".join(
        f'<SequenceContainer name="C{k}">{entries([f"sent{k}", *names[k * NUMBERS:(k + 1) * NUMBERS]])}<BaseContainer '
        f'containerRef="Packet"><RestrictionCriteria><Comparison parameterRef="stream" value="{0x0800 + k}"/>'
        "</RestrictionCriteria></BaseContainer></SequenceContainer>" for k in range(CONTAINERS))
    parameters = "".join(f'<Parameter name="{name}" parameterTypeRef="u16"/>' for name in ("stream", "count", "length"))
    parameters += "".join(f'<Parameter name="{name}" parameterTypeRef="u32"/>' for name in names)
    parameters += "".join(f'<Parameter name="sent{k}" parameterTypeRef="u64"/>' for k in range(CONTAINERS))
    return ('<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>'
            f'{integer("u16", 16)}{integer("u32", 32, limits)}{integer("u64", 64)}</ParameterTypeSet><ParameterSet>'
            f'{parameters}</ParameterSet><ContainerSet><SequenceContainer name="Packet" abstract="true">'
            f'{entries(["stream", "count", "length"])}</SequenceContainer>{kinds}</ContainerSet></TelemetryMetaData>'
            "</SpaceSystem>")


def packet(k: int, count: int, numbers: bytes, sent: int = 0) -> bytes:
    return HEAD.pack(0x0800 + k, 0xC000 | count & 0x3FFF, HEAD.size + len(numbers) - 7, sent) + numbers


class Server:
    """A server of one spacecraft, whose packets come by UDP; and of `more`, as the file has them."""

    def __init__(self, folder: Path, more: str = "") -> None:
        self.folder = folder
        with socket.socket() as tcp, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            tcp.bind(("127.0.0.1", 0))
            udp.bind(("127.0.0.1", 0))
            self.http, self.udp = tcp.getsockname()[1], udp.getsockname()[1]
        (folder / "craft.xml").write_text(xtce(), encoding="utf-8")
        (folder / "ground.toml").write_text(
            f'port = {self.http}\nfolder = "{folder}"\n[[craft]]\nname = "craft"\ndatabase = "craft.xml"\n'
            f'link = "udp://127.0.0.1:9?listen={self.udp}"\n{more}')
        self._process = subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", "ground", "serve",
                                          str(folder / "ground.toml")], stdout=subprocess.PIPE, text=True)
        assert self._process.stdout and "http" in self._process.stdout.readline(), "the server does not begin"

    def end(self) -> None:
        self._process.terminate()
        self._process.wait(30)

    def cpu(self) -> float:
        """[s] that its process has used."""
        words = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) / TICKS

    def memory(self) -> float:
        """[MB] that it has."""
        return int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    def ask(self, path: str, content: Any = None) -> Any:
        from urllib.request import Request, urlopen

        address = f"http://127.0.0.1:{self.http}/api/"
        headers = {}
        if content is not None:
            with urlopen(f"{address}session") as made:
                headers = {"X-Fledge-CSRF": json.load(made)["csrf"], "Content-Type": "application/json"}
        data = json.dumps(content).encode() if content is not None else None
        with urlopen(Request(address + path, data, headers)) as made:
            return json.load(made)

    def packets(self, name: str = "craft") -> int:
        return next(int(craft["packets"]) for craft in self.ask("crafts") if craft["name"] == name)


def send(port: int, rate: float, seconds: float) -> None:
    """Packets of all kinds in turn, at a rate; the program of the sender."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.connect(("127.0.0.1", port))
        began, n = time.monotonic(), 0
        numbers = [struct.pack(f">{NUMBERS}I", *range(k, k + NUMBERS)) for k in range(1000)]
        while (spent := time.monotonic() - began) < seconds:
            while n < rate * spent:
                made.send(packet(n % CONTAINERS, n, numbers[n % 1000], time.monotonic_ns()))
                n += 1
            time.sleep(0.002)
    print(n)


def read(port: int, clients: int, hz: float, slots: str, seconds: float) -> None:
    """What browsers do, many in one program; prints how many values came, and how long each of `sent` took."""
    from aiohttp import ClientSession, WSMsgType

    wanted = json.loads(slots)

    async def client(session: Any) -> tuple[int, list[float]]:
        got, under_way = 0, []
        async with session.ws_connect(f"http://127.0.0.1:{port}/api/live", max_msg_size=0) as live:
            await live.send_json({"subscribe": {"craft": "craft", "slots": wanted, "hz": hz}})
            end = time.monotonic() + seconds
            first = True
            while (rest := end - time.monotonic()) > 0:
                try:
                    message = await live.receive(rest)
                except asyncio.TimeoutError:
                    break
                if message.type == WSMsgType.BINARY:
                    now = time.monotonic_ns()
                    n, = struct.unpack_from("<I", message.data, 24)
                    got += n
                    if wanted != "all" and not first:
                        under_way += [(now - struct.unpack_from("<Q", message.data, 32 + 24 * i + 16)[0]) / 1e6
                                      for i in range(n)]
                    first = False
        return got, under_way

    async def all_of_them() -> list[tuple[int, list[float]]]:
        async with ClientSession() as session:
            return await asyncio.gather(*(client(session) for _ in range(clients)))

    found = asyncio.run(all_of_them())
    print(json.dumps([sum(got for got, _ in found), [ms for _, each in found for ms in each]]))


def beside(*words: Any) -> subprocess.Popen[str]:
    """send() or read() in a program of its own."""
    return subprocess.Popen([sys.executable, "-m", "bench.ground_server", *map(str, words)], stdout=subprocess.PIPE,
                            text=True)


def result(process: subprocess.Popen[str]) -> Any:
    return json.loads(process.communicate()[0])


@contextmanager
def served(prepare: Any = None) -> Iterator[Server]:
    with tempfile.TemporaryDirectory() as folder:
        if prepare:
            prepare(Path(folder))
        made = Server(Path(folder))
        try:
            time.sleep(1)
            yield made
        finally:
            made.end()


def loaded(server: Server, rate: float, clients: int = 0, hz: float = 20, slots: Any = "all"
           ) -> tuple[float, int, int, list[Any]]:
    """(cores, packets sent, packets that the server has, what clients got) under a load."""
    before = server.packets()
    reader = beside("read", server.http, clients, hz, json.dumps(slots), SECONDS + 1) if clients else None
    sender = beside("send", server.udp, rate, SECONDS + 2)
    time.sleep(1.5)
    cpu, began = server.cpu(), time.monotonic()
    time.sleep(SECONDS - 2)
    cores = (server.cpu() - cpu) / (time.monotonic() - began)
    sent = result(sender)
    time.sleep(0.5)
    return cores, sent, server.packets() - before, result(reader) if reader else []


def week(folder: Path) -> None:
    """The archive of a week."""
    from fledge.ground import Database

    (folder / "craft.xml").write_text(xtce(), encoding="utf-8")
    database = Database.load(folder / "craft.xml")
    archive = database.archive(folder / "archive", "craft")
    monitor = database.monitor()
    monitor.sink(archive)
    first = time.time_ns() - (WEEK + 3600) * 10**9
    body = struct.pack(">369I", *range(NUMBERS))
    for i in range(0, WEEK * WEEKLY, 1000):
        monitor.take([(at, at, packet(n % CONTAINERS, n, body)) for n in range(i, i + 1000)
                      for at in (first + n * (10**9 // WEEKLY),)])
    monitor.sink(None)
    archive.close()


def add_rows(rows: Rows) -> None:
    with served() as server:
        cores, sent, found, _ = loaded(server, 20_000)
        rows.add("server, 20,000 packets/s of 369 integers", "cores", cores, "cores")
        archived = sum(row["packets"] for row in server.ask("crafts/craft/sessions"))
        assert archived == found and not server.ask("crafts")[0]["undecoded"], f"{archived} of {found} are archived"
        rows.add("server, 20,000 packets/s of 369 integers", "lost on their way", 100 * (1 - found / sent), "%",
                 note=f"{found} of {sent} decoded, checked and archived")
    with served() as server:
        idle = loaded(server, 20 * CONTAINERS)[0]
        for clients in (1, 10):
            cores, _, _, (got, _) = loaded(server, 20 * CONTAINERS, clients)
            rows.add(f"server, 10,000 values at 20 Hz to {clients} browsers", "cores more", cores - idle, "cores",
                     note=f"{got / clients / (SECONDS + 1) / 1e3:.0f} thousand values/s to each")
        slots = [slot["slot"] for slot in server.ask("crafts/craft/slots") if slot["name"].startswith("sent")]
        under_way = sorted(loaded(server, 1000, 1, 60, slots)[3][1])
        rows.add("server, packet to browser", "median", statistics.median(under_way), "ms")
        rows.add("server, packet to browser", "99 %", under_way[int(0.99 * len(under_way))], "ms")
    with served(week) as server:
        server.ask("crafts/craft/replay", {"session": -1, "from_ns": "0", "to_ns": str(2**63 - 1), "speed": 1000})
        time.sleep(2)
        cpu, began, before = server.cpu(), time.monotonic(), server.packets("craft@replay")
        time.sleep(SECONDS)
        spent, found = time.monotonic() - began, server.packets("craft@replay") - before
        rows.add("server, a week at 1,000 times", "cores", (server.cpu() - cpu) / spent, "cores",
                 note=f"{found / spent / WEEKLY:.0f} times; {found / spent:.0f} packets/s of 369 integers")


if __name__ == "__main__":
    kind, *words = sys.argv[1:]
    if kind == "send":
        send(int(words[0]), float(words[1]), float(words[2]))
    else:
        read(int(words[0]), int(words[1]), float(words[2]), words[3], float(words[4]))
