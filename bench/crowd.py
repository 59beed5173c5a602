# SPDX-License-Identifier: Apache-2.0
"""The whole server of the control room under a crowd: 1,000 WebSockets that read, 28 values each twice a second, 100
that ask for all values and packets and never read, 50,000 packets a second of 369 integers by UDP, an archive of a
month, of which a client requests a day of 28 parameters again and again. The cores and the memory of the server, its
losses, how long its event loop was blocked by its own measure, and how long another request took."""
from __future__ import annotations

import asyncio
import json
import os
import struct
import sys
import time
from pathlib import Path

from bench.ground_server import CONTAINERS, NUMBERS, Server, packet, result, served, xtce
from bench.rows import Rows, options, report

READERS, DEAF, RATE = 1000, 100, 50_000     # [1/s] packets
MONTH, EVERY = 30 * 86400, 20               # [s]; between two packets of the archive
SECONDS = 15.0
ADDRESSES = 12                              # of loopback, for each may have 128 connections


def month(folder: Path) -> None:
    """The archive of a month."""
    from fledge.ground import Database

    (folder / "craft.xml").write_text(xtce(), encoding="utf-8")
    database = Database.load(folder / "craft.xml")
    archive, monitor = database.archive(folder / "archive", "craft"), database.monitor()
    monitor.sink(archive)
    first, body = time.time_ns() - (MONTH + 3600) * 10**9, struct.pack(f">{NUMBERS}I", *range(NUMBERS))
    for i in range(0, MONTH // EVERY, 1000):
        monitor.take([(at := first + n * EVERY * 10**9, at, packet(n % CONTAINERS, n, body))
                      for n in range(i, i + 1000)])
    monitor.sink(None)
    archive.close()


async def crowd(port: int, readers: int, deaf: int, slots: list[int], seconds: float) -> int:
    """How many frames the readers got; the program of the crowd."""
    from aiohttp import ClientSession, TCPConnector, WSMsgType

    async def client(session: ClientSession, reads: bool) -> int:
        got = 0
        async with session.ws_connect(f"http://127.0.0.1:{port}/api/live", max_msg_size=0, autoping=reads) as live:
            if not reads:
                await live.send_json({"subscribe": {"craft": "craft", "slots": "all", "hz": 20}})
                await live.send_json({"subscribe_packets": "craft"})
                live._response.connection.transport.pause_reading()     # type: ignore[union-attr]
                await asyncio.sleep(seconds)
                return 0
            await live.send_json({"subscribe": {"craft": "craft", "slots": slots, "hz": 2}})
            end = time.monotonic() + seconds
            while (rest := end - time.monotonic()) > 0:
                try:
                    got += (await live.receive(rest)).type == WSMsgType.BINARY
                except asyncio.TimeoutError:
                    break
        return got

    sessions = [ClientSession(connector=TCPConnector(limit=0, local_addr=(f"127.0.0.{k + 2}", 0)))
                for k in range(ADDRESSES)]
    found = await asyncio.gather(*(client(sessions[k % ADDRESSES], k >= deaf) for k in range(deaf + readers)),
                                 return_exceptions=True)
    for session in sessions:
        await session.close()
    print(json.dumps([sum(count for count in found if isinstance(count, int)),
                      [str(count) for count in found if not isinstance(count, int)][:3]]))
    return 0


def under(server: Server, rows: Rows, name: str, readers: int, deaf: int, rate: float) -> None:
    """Rows of a load."""
    from subprocess import PIPE, Popen

    def beside(*words: object) -> Popen[str]:
        return Popen([sys.executable, "-m", *map(str, words)], stdout=PIPE, text=True)

    slots = [slot["slot"] for slot in server.ask("crafts/craft/slots") if slot["name"].startswith("sent")]
    before = server.packets()
    crowded = beside("bench.crowd", server.http, readers, deaf, json.dumps(slots), SECONDS + 5)
    sender = beside("bench.ground_server", "send", server.udp, rate, SECONDS + 5)
    time.sleep(5)
    cpu, began, took, queries = server.cpu(), time.monotonic(), [], 0
    ends = time.time_ns() - MONTH // 2 * 10**9
    names = ",".join(f"p{k}_0" for k in range(CONTAINERS))
    while time.monotonic() - began < SECONDS - 3:
        start = time.monotonic()
        server.ask("crafts")
        took.append(1e3 * (time.monotonic() - start))
        server.ask(f"crafts/craft/history?names={names}&from_ns={ends - 86400 * 10**9}&to_ns={ends}")
        queries += 1
        time.sleep(0.2)
    cores = (server.cpu() - cpu) / (time.monotonic() - began)
    found, memory = server.ask("server"), server.memory()
    sent, (frames, problems) = result(sender), result(crowded)
    time.sleep(1)
    lost = 1 - (server.packets() - before) / sent
    rows.add(name, "cores", cores, "cores", note=f"{queries} queries of a day; {os.cpu_count()} cores for all")
    rows.add(name, "lost on their way", 100 * lost, "%", note=f"of {sent / (SECONDS + 5):.0f} packets/s that came")
    rows.add(name, "the loop's longest block, a minute", found["loop"]["recent_ms"], "ms")
    rows.add(name, "it computed at once, at most", found["loop"]["computed_ms"], "ms", note="without waits for a core")
    rows.add(name, "another request, median", sorted(took)[len(took) // 2], "ms")
    rows.add(name, "another request, longest", max(took), "ms")
    rows.add(name, "memory", memory, "MB",
             note=f"{frames} frames to readers{''.join('; ' + problem for problem in problems)}")


def main(arguments: list[str]) -> int:
    chosen, rows = options("crowd", arguments, runs=1), Rows()
    for name, load in (("1,000 that read, 100 that do not, 50,000 packets/s", (READERS, DEAF, RATE)),
                       ("1,000 that read, 20,000 packets/s", (READERS, 0, 20_000)),
                       ("100 that do not read, 20,000 packets/s", (0, DEAF, 20_000))):
        with served(month) as server:
            under(server, rows, name, *load)
    report(rows, chosen)
    return 0


if __name__ == "__main__":
    asyncio.run(crowd(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), json.loads(sys.argv[4]),
                      float(sys.argv[5])))
