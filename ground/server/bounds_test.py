# SPDX-License-Identifier: Apache-2.0
"""What the server bounds, by sockets and queries that ask for more."""
import asyncio
import json
import time
from threading import Event

from aiohttp import WSMsgType

from fledge.ground.server.answers import PART, in_binary, in_csv, in_json
from fledge.ground.server.bounds import SLOW, TABLE, Bounds, LoopWatch
from fledge.ground.server.nothing_lost_test import DATABASE, packet
from fledge.ground.server.web_test import console, flown
from tests.waiting import PATIENCE

FILE = '[[craft]]\nname = "craft"\ndatabase = "craft.xml"\nlink = "tcp://127.0.0.1:1"\n'


def take(room, packets):
    """Packets as they arrive, in the spacecraft's thread."""
    craft = room.craft("craft")
    return asyncio.wrap_future(craft.call(lambda: craft.take([(t, t, packet) for t, packet in packets])))


def served(folder):
    (folder / "craft.xml").write_text(DATABASE)
    return console(folder, FILE)


async def refusal(live):
    """The next one that a WebSocket tells."""
    while (message := (await live.receive(PATIENCE)).json())["kind"] != "refused":
        pass
    return message["error"]


def test_the_loop_finds_what_blocks_it():
    reported = []

    async def blocks():
        watch = LoopWatch(reported.append)
        task = asyncio.create_task(watch.run())
        await asyncio.sleep(0)      # it waits for its first tick
        time.sleep(0.2)     # it computes nothing
        while not reported:
            await asyncio.sleep(0.01)
        slept, until = watch.computed, time.thread_time() + 0.2
        while time.thread_time() < until:
            pass
        while watch.computed < 0.2:
            await asyncio.sleep(0.01)
        task.cancel()
        return watch, slept

    watch, slept = asyncio.run(blocks())
    assert 0.15 < reported[0] <= watch.longest and slept < 0.1
    watch.longest, at = reported[0], time.monotonic()
    for late in (0.1, 0.3, 0.2):    # once a minute at most
        watch.tick(at + 61, late, late / 2)
    assert reported[1:] == [0.1] and watch.recent == 0.3 > SLOW and watch.computed == 0.15
    watch.tick(at + 130, 0.01)
    assert watch.recent == 0.01 and watch.computed == 0 and watch.longest == max(0.3, reported[0])


def test_each_limit_has_one_name_a_figure_and_a_sentence():
    names = [name for name, _, _, _ in TABLE]
    bounds = Bounds()
    assert len(set(names)) == len(names)
    for name in names:
        assert bounds[name] > 0 and "{" not in bounds.says(name) and f"{bounds[name]:,.10g}" in bounds.says(name)
    assert not bounds.over("message", bounds["message"]) and bounds.over("message", bounds["message"] + 1)
    row = next(row for row in bounds.describe() if row["name"] == "message")
    assert (row["peak"], row["refused"], row["used"]) == (bounds["message"], 1, None)


@flown
async def test_a_history_in_parts_is_the_one_as_a_whole(folder):
    async with served(folder) as page:
        n = PART + 1000
        for at in range(1, n + 1, 1000):
            await take(page.room, [(t * 1000, packet(t)) for t in range(at, min(at + 1000, n + 1))])
        craft = page.room.craft("craft")
        found = craft.past.series(["number"], 0, 2**62, 0, -1, True)
        path = "crafts/craft/history?names=number&points=0"
        whole = await page.get(path)
        assert whole == json.loads(b"".join(in_json(found)))
        assert whole["number"]["t_ns"] == [str(t * 1000) for t in range(1, n + 1)]
        assert whole["number"]["value"] == list(range(1, n + 1))
        text = await page.get(path + "&format=csv")
        assert text.encode() == b"".join(in_csv(found)) and len(text.splitlines()) == n + 1
        answer = await page.client.get(f"/api/{path}&format=binary")
        assert await answer.read() == b"".join(in_binary(found))

        many = ",".join(f"number{i}" for i in range(101))
        assert "1 to 100 parameters" in (await page.get(f"crafts/craft/history?names={many}", 400))["error"]
        for bound in ("values read by a user", "values read"):
            most, page.room.bounds[bound] = page.room.bounds[bound], n - 1
            assert f"{n - 1:,} values" in (await page.get(path, 429))["error"]
            page.room.bounds[bound] = most
        answer = await page.client.get(f"/api/{path}")
        assert page.server.reads.total() in (0, n) and answer.status == 200
        await answer.read()
        while page.server.reads.total():
            await asyncio.sleep(0.01)

        page.room.bounds["queries that wait"] = 0
        at_once, goes_on, series = int(page.room.bounds["queries"]), Event(), craft.past.series
        craft.past.series = lambda *given: goes_on.wait() and series(*given)
        try:
            tasks = [asyncio.create_task(page.client.get(f"/api/{path}")) for _ in range(12)]
            while sum(task.done() for task in tasks) < 12 - at_once:
                await asyncio.sleep(0.01)
            refused = [await task.result().json() for task in tasks if task.done()]
        finally:
            goes_on.set()
        assert "wait already" in refused[0]["error"]
        assert [task.status for task in await asyncio.gather(*tasks)].count(200) == at_once


@flown
async def test_numbers_that_there_are_not_and_replays_that_have_ended_are_refused_in_words(folder):
    async with served(folder) as page:
        await take(page.room, [(t * 1000, packet(t)) for t in range(1, 100)])
        for slot in ("%C2%B2", "9" * 5000, "%D9%A9999999"):
            assert "has the slots 0 to" in (await page.post(f"crafts/craft/alarms/{slot}", {}, 404))["error"]
        for session in (2**63, 10**39, -2):
            assert "of the list of sessions" in (await page.post("crafts/craft/replay", {"session": session}, 400)
                                                 )["error"]
        replay = await page.post("crafts/craft/replay", {})
        codes = [answer.status for answer in await asyncio.gather(*(page.client.delete(
            f"/api/crafts/{replay['name']}/replay", headers={"X-Fledge-CSRF": page.csrf}) for _ in range(8)))]
        assert codes.count(200) == 1 and set(codes) <= {200, 400, 404}, codes


@flown
async def test_a_socket_that_does_not_read_costs_little_and_one_that_asks_too_much_is_closed(folder):
    async with served(folder) as page:
        bounds = page.room.bounds
        bounds["packets of a socket"], bounds["texts of a socket"] = 1_000_000, 20_000
        deaf = await page.client.ws_connect("/api/live")
        await deaf.send_json({"subscribe_packets": "craft"})
        while not page.server.browsers or not page.room.craft("craft").telemetry.sinks:
            await asyncio.sleep(0.01)
        browser, = page.server.browsers
        for at, n in ((1, 2000), (2001, 4000), (6001, 2000)):   # the second is more than the limit by itself
            take(page.room, [(t * 1000, packet(t)) for t in range(at, at + n)])
        for i in range(3000):
            browser.put(f"{i:0100}")
        assert browser.waiting_texts <= 20_000 and browser.skipped > 0
        got = dropped = 0
        while got + dropped < 8000:
            message = await deaf.receive(PATIENCE)
            content = message.json() if message.type == WSMsgType.TEXT and message.data.startswith("{") else {}
            if content.get("kind") == "packets":
                got, dropped = got + len(content["packets"]), content["dropped"]
        assert got >= 2000 and dropped >= 4000 and all(row["peak"] <= row["most"] for row in bounds.describe())

        live = await page.client.ws_connect("/api/live")
        await live.send_json({"subscribe": {"craft": "craft", "slots": list(range(70_000))}})
        assert "at most 65,536 values" in await refusal(live)
        await live.send_str("[" * 40 + "]" * 40)
        assert "at most 32 levels" in await refusal(live)
        await live.send_str(" " * int(bounds["message"] + 1))
        while (message := await live.receive(PATIENCE)).type == WSMsgType.TEXT:
            pass
        assert message.type in (WSMsgType.CLOSE, WSMsgType.CLOSED)
        live = await page.client.ws_connect("/api/live")
        bounds["messages"] = 20
        for _ in range(30):
            await live.send_str('{"unsubscribe": "craft"}')
        while (message := await live.receive(PATIENCE)).type == WSMsgType.TEXT:
            pass
        assert (message.type, message.data, "20 messages" in message.extra) == (WSMsgType.CLOSE, 1008, True)


@flown
async def test_empty_frames_are_bounded_and_delay_no_client(folder):
    """Pings, and parts of a message without content: neither are messages, nor do they have bytes to be counted."""
    async with served(folder) as page:
        bounds = page.server.bounds
        for bound, sent in (("messages", b"\x89\x80abcd" * 700), ("frames", b"\x89\x80abcd" * 100_000),
                            ("frames", b"\x8a\x00" * 100_000),
                            ("frames", b"\x01\x80abcd" + b"\x00\x80abcd" * 100_000)):
            before = {name: bounds.all[name].refused for name in ("messages", "frames")}
            live = await page.client.ws_connect("/api/live")
            live._writer.transport.write(sent)
            while (message := await live.receive(PATIENCE)).type == WSMsgType.TEXT:
                pass
            assert message.type in (WSMsgType.CLOSE, WSMsgType.CLOSED, WSMsgType.ERROR)
            assert bounds.all[bound].refused > before[bound]
            assert bounds.all["frames"].peak <= bounds["frames"]
            while page.server.browsers:
                await asyncio.sleep(0.01)
        live = await page.client.ws_connect("/api/live")
        await live.ping(b"here")
        live._autoping = False
        while (message := await live.receive(PATIENCE)).type == WSMsgType.TEXT:
            pass
        assert (message.type, bytes(message.data)) == (WSMsgType.PONG, b"here")


@flown
async def test_an_administrator_sees_the_limits_and_what_is_in_use(folder):
    async with served(folder) as page:
        state = await page.get("server")
        limits = {limit["name"]: limit for limit in state["limits"]}
        assert [*limits] == [name for name, _, _, _ in TABLE]
        assert limits["disk that stays free"]["used"] > 0 and limits["replays"]["used"] == 0
        assert state["memory"] > 1 << 20 and state["loop"]["longest_ms"] >= state["loop"]["recent_ms"] >= 0
        assert state["journal"]["bytes"] > 0 and state["descriptors"] < state["descriptors_most"]
