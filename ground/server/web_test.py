# SPDX-License-Identifier: Apache-2.0
"""The server in real flights, by HTTP and WebSocket."""
import asyncio
import re
import secrets
import socket
import struct
import subprocess
import sys
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from shutil import copytree
from threading import Event, get_ident
from unittest.mock import patch

import pytest
from aiohttp import ClientSession, WSMsgType
from aiohttp.test_utils import TestClient, TestServer

from fledge.commands import Dictionary
from fledge.ground.server.commanding import Commanding
from fledge.ground.server.handlers import common
from fledge.ground.server.room import Room
from fledge.ground.server.run_control import Pace
from fledge.ground.server.settings import read
from fledge.ground.server.past import number_of
from fledge.ground.server.telemetry import Telemetry
from fledge.ground.server.web import Server
from tests.tree import ROOT
from tests.waiting import PATIENCE, wait_for


class Console:
    """What a browser does."""

    def __init__(self, client, server, csrf):
        self.client, self.server, self.room, self.csrf = client, server, server.room, csrf

    async def get(self, path, status=200):
        return await self._answer(await self.client.get(f"/api/{path}"), status)

    async def post(self, path, content=None, status=200, data=None, method="post"):
        how = {"data": data} if data is not None else {"json": content}
        return await self._answer(await getattr(self.client, method)(
            f"/api/{path}", headers={"X-Fledge-CSRF": self.csrf}, **how), status)

    @staticmethod
    async def _answer(response, status):
        text = await response.text()
        assert response.status == status, text
        return await response.json() if "json" in response.content_type else text

    async def until(self, path, holds):
        """Ask again until the answer is as it must be."""
        content = None
        try:
            while not holds(content := await self.get(path)):
                await asyncio.sleep(0.05)
        except asyncio.CancelledError:
            raise AssertionError(f"waited in vain for {path}, which is {content}") from None
        return content

    async def verified(self, craft, name, arguments, stage="completed"):
        """Send a command; its row when it has come to a stage."""
        number = (await self.post(f"crafts/{craft}/send", {"name": name, "arguments": arguments}))["id"]
        return await self.row(craft, number, stage)

    async def row(self, craft, number, stage="completed"):
        """The row of a sent command that has come to a stage; one that has failed does not come to another."""
        def reached(rows):
            return [stage["stage"] for row in rows if row["id"] == number for stage in row["stages"]]

        rows = await self.until(f"crafts/{craft}/sent", lambda rows: {stage, "failed"} & {*reached(rows)})
        row = next(row for row in rows if row["id"] == number)
        assert stage in reached(rows), f"{row}; {await self.get(f'crafts/{craft}/events')}"
        return row


@asynccontextmanager
async def console(folder, text, patience=PATIENCE):
    """A browser at a server of a file. patience: [s] of the server with the thread of a spacecraft."""
    (folder / "ground.toml").write_text(text)
    room = Room(read(folder / "ground.toml"))
    with ExitStack() as stack:
        stack.callback(room.close)
        stack.enter_context(patch.object(common, "PATIENCE", patience))
        server = Server(room)
        async with TestClient(TestServer(server.app)) as client:
            room.start()
            csrf = (await (await client.get("/api/session")).json())["csrf"]
            yield Console(client, server, csrf)


def flown(test):
    """Run a test's coroutine."""
    def run(tmp_path):
        asyncio.run(asyncio.wait_for(test(tmp_path), PATIENCE))

    run.__name__ = test.__name__
    return run


SIGMA = "flight.tracking.error.sigma_BR[0]"
NADIR = '[[craft]]\nmission = "nadir_spin"\nspeed = 20\n'


@flown
async def test_values_move_and_a_command_is_verified(tmp_path):
    async with console(tmp_path, NADIR) as c:
        craft, = await c.get("crafts")
        assert craft["name"] == "nadir_spin" and craft["simulated"] and craft["clock"] == "simulated"
        rows = await c.until("crafts/nadir_spin/slots", lambda rows: SIGMA in [row["name"] for row in rows])
        places = {row["name"]: row["slot"] for row in rows}
        slot = places[SIGMA]
        live = await c.client.ws_connect("/api/live")
        await live.send_json({"subscribe": {"craft": "nadir_spin", "slots": [slot], "hz": 30}})
        seen = []
        while len(seen) < 3:
            message = await live.receive(PATIENCE)
            if message.type == WSMsgType.BINARY:
                magic, number, _, t, n, _ = struct.unpack_from("<IIQqII", message.data)
                assert (magic, number) == (0x31444C46, craft["index"])
                seen += [(t, struct.unpack_from("<d", message.data, 32 + 16)[0])] * (
                    n == 1 and struct.unpack_from("<I", message.data, 32)[0] == slot)
        assert seen[0][0] < seen[1][0] < seen[2][0] and len({value for _, value in seen}) == 3

        row = await c.verified("nadir_spin", "flight.write.control.K", {"K": 3})
        assert [stage["stage"] for stage in row["stages"]] == ["released", "accepted", "completed"]
        assert all(stage["good"] for stage in row["stages"]) and row["user"] == "operator"
        control = c.room.crafts["nadir_spin"].simulation.flight.control
        assert control.K == 3.0
        stages = []
        while "completed" not in stages:
            message = await live.receive(PATIENCE)
            if message.type == WSMsgType.TEXT and message.json()["kind"] == "sent":
                stages = [stage["stage"] for stage in message.json()["stages"]]


@flown
async def test_forms_previews_and_refusals(tmp_path):
    async with console(tmp_path, '[[craft]]\nmission = "earth_imager"\nspeed = 0\n') as c:
        forms = {row["name"]: row for row in await c.get("crafts/earth_imager/commands")}
        gain = forms["flight.write.steering.K1"]["arguments"][0]
        assert (gain["name"], gain["type"], gain["unit"], gain["size"]) == ("K1", "real", "rad/s", 64)
        assert forms["flight.reset_flight"]["hazardous"] and "flight.write.control" not in forms
        craft = "crafts/earth_imager"
        preview = await c.post(f"{craft}/preview", {"name": "flight.write.steering.K1", "arguments": {"K1": 0.25}})
        packet = bytes.fromhex(preview["hex"])
        assert packet[-8:] == struct.pack(">d", 0.25) and int.from_bytes(packet[4:6], "big") == len(packet) - 7
        field = preview["fields"][-1]
        assert (field["name"], field["bit"], field["bits"], field["argument"]) == ("K1", 8 * len(packet) - 64, 64, True)
        for name, arguments, why in (
                ("flight.write.steering.K1", {"K1": -1}, "K1"), ("flight.write.steering.K1", {"K1": "x"}, "K1"),
                ("flight.write.steering.K1", {}, "K1"), ("flight.write.steering.K1", {"K1": 1, "L": 2}, "L"),
                ("flight.write.steering.K1", {"K1": None}, "K1"), ("flight.write.steering.K1", {"K1": [1]}, "K1"),
                ("flight.write.steering.K2", {}, "did you mean"),
                ("flight.telemetry", {"output": "x", "on": "on"}, "output")):
            refusal = await c.post(f"{craft}/preview", {"name": name, "arguments": arguments}, 400)
            assert why in refusal["error"] and refusal.get("argument") == (why if len(why) < 8 else None), refusal
        refusal = await c.post(f"{craft}/send", {"name": "flight.reset_flight"}, 409)
        assert "begin anew" in refusal["hazardous"]
        await c.post(f"{craft}/send", {"name": "flight.reset_flight", "confirmed": True})
        refused = await c.verified("earth_imager", "flight.commit", {"module": "flight.steering", "crc": 3}, "failed")
        assert "nothing of this module is staged" in refused["stages"][-1]["text"]
        log = await c.get("log")
        assert [row["action"] for row in log[:4]].count("POST /api/crafts/earth_imager/send") == 3
        assert any(row["action"] == "refused" and not row["good"] for row in log)


@flown
async def test_what_reads_the_database_for_a_request_is_not_done_by_the_loop(tmp_path):
    """A large one would keep all other clients waiting."""
    threads = {}

    def watched(of, name):
        work = getattr(of, name)

        def recorded(*given, **named):
            threads[name] = get_ident()
            return work(*given, **named)

        return patch.object(of, name, recorded)

    with watched(Commanding, "hazard"), watched(Commanding, "preview"), watched(Telemetry, "inspect"), \
            watched(Dictionary, "text"), watched(Pace, "faults"):
        async with console(tmp_path, NADIR) as c:
            craft = "crafts/nadir_spin"
            for what in ("dictionary", "run"):
                await c.get(f"{craft}/{what}")
            packet = {"hex": (await c.post(f"{craft}/preview", {"name": "flight.noop"}))["hex"]}
            await c.post(f"{craft}/inspect", packet)
            await c.post(f"{craft}/raw", packet)
    assert len(threads) == 5 and get_ident() not in threads.values()


@flown
async def test_run_control_and_faults(tmp_path):
    async with console(tmp_path, NADIR) as c:
        run = "crafts/nadir_spin/run"
        paused = await c.post(run, {"action": "pause"})
        assert paused["state"] == "paused"
        later = await c.post(run, {"action": "step", "seconds": 5})
        stepped = await c.until(run, lambda state: state["state"] == "paused")
        assert int(stepped["t_ns"]) - int(paused["t_ns"]) == 5 * 10**9 and later["speed"] == 20
        wheels = c.room.crafts["nadir_spin"].simulation.world.wheels
        await c.post(run, {"fault": {"path": "world.wheels.friction", "value": [0, 0.03, 0, 0]}})
        assert list(wheels.friction)[:4] == [0, 0.03, 0, 0]
        rows = (await c.get(run))["faults"]
        units = [row["path"] for row in rows if "example" in row]
        assert [row["path"] for row in rows[:len(units)]] == units and units[-1] == "world.nav.faults"
        assert "kinds: HIGH, LOW" in rows[0]["meaning"] and rows[0]["value"] == []
        answer = await c.post(run, {"fault": {"path": units[-1], "value": rows[len(units) - 1]["example"]}})
        first = answer["faults"][0]      # the unit with the most faults
        assert first["path"] == units[-1] and first["value"] == [{"kind": "DEAD", "begin": int(stepped["t_ns"])}]
        assert len(first["example"]) == 2
        for fault, why in (({"path": "world.wheels.frictio", "value": 1}, "did you mean 'friction'"),
                           ({"path": "world.wheel.friction", "value": 1}, "did you mean 'wheels'"),
                           ({"path": "world.wheels.friction", "value": "x"}, "friction"),
                           ({"path": "world.wheels.__class__", "value": 1}, "a fault is of a parameter"),
                           ({"path": 3}, "a fault is of a parameter")):
            assert why in (await c.post(run, {"fault": fault}, 400))["error"]
        assert "found 'fly'" in (await c.post(run, {"action": "fly"}, 400))["error"]
        assert "speed" in (await c.post(run, {"speed": -1}, 400))["error"]
        assert (await c.post(run, {"action": "go", "speed": 0}))["state"] == "running"
        await c.until(run, lambda state: int(state["t_ns"]) > int(stepped["t_ns"]) + 20 * 10**9)
        events = await c.get("crafts/nadir_spin/events")
        assert any(event["source"] == "run" and "friction" in event["text"] for event in events)


@flown
async def test_files_and_tables_of_flight(tmp_path):
    async with console(tmp_path, '[[craft]]\nmission = "flatsat"\nspeed = 20\n') as c:
        craft = "crafts/flatsat"
        assert {"files", "tables", "run"} <= set((await c.get("crafts"))[0]["can"])
        content = bytes(range(256)) * 20
        number = (await c.post(f"{craft}/files?name=waypoints-1", data=content))["id"]
        rows = await c.until(f"{craft}/transfers", lambda rows: rows[0]["state"] != "active")
        assert (rows[0]["id"], rows[0]["state"], rows[0]["done"], rows[0]["up"]) == (number, "completed", 5120, True)
        assert "waypoints-1" in (await c.post(f"{craft}/directory"))["names"]
        await c.post(f"{craft}/fetch", {"name": "waypoints-1"})
        rows = await c.until(f"{craft}/transfers", lambda rows: rows[0]["state"] != "active")
        assert (rows[0]["state"], rows[0]["up"]) == ("completed", False)
        assert [file["name"] for file in await c.get(f"{craft}/files")] == ["waypoints-1"]
        assert await (await c.client.get(f"/api/{craft}/files/waypoints-1")).read() == content
        (c.room.crafts["flatsat"].transfers.folder / "waypoints-1").write_bytes(b"other")
        await c.post(f"{craft}/fetch", {"name": "waypoints-1"})
        rows = await c.until(f"{craft}/transfers", lambda rows: rows[0]["state"] != "active")
        assert rows[0]["text"] == "it is waypoints-1.2 here"
        contents = {path.name: path.read_bytes() for path in c.room.crafts["flatsat"].transfers.folder.glob("[!.]*")}
        assert contents == {"waypoints-1": b"other", "waypoints-1.2": content}
        with patch.object(Path, "write_bytes", side_effect=OSError(28, "No space left on device")):
            refused = await c.post(f"{craft}/files?name=x", data=b"x", status=400)
        assert refused["error"] == "x cannot be kept here to be sent: No space left on device"
        for bound, figure in (("files of a spacecraft", 1000), ("disk that stays free", 1 << 62)):
            most, c.room.bounds[bound] = c.room.bounds[bound], figure
            refused = await c.post(f"{craft}/files?name=x", data=bytes(1001), status=400)
            assert refused["error"].startswith(f"x cannot be kept here to be sent: {c.room.bounds.says(bound)}")
            c.room.bounds[bound] = most
        for path, status in (("files/..%2fjournal.sqlite", 404), ("files/none", 404)):
            await c.get(f"{craft}/{path}", status)
        await c.post(f"{craft}/fetch", {"name": "none"})
        rows = await c.until(f"{craft}/transfers", lambda rows: rows[0]["state"] != "active")
        assert rows[0]["state"] == "failed" and rows[0]["text"]
        await c.post(f"{craft}/files?name=", data=b"x", status=400)
        await c.post(f"{craft}/transfers/99", {"action": "cancel"}, 400)

        table = f"{craft}/tables/flight.control"
        assert "read flight.control first" in (await c.post(table, {"values": {"K": 3.0}}, 400))["error"]
        await c.row("flatsat", (await c.post(table, {"read": True}))["ids"][0])
        control = c.room.crafts["flatsat"].simulation.flight.control
        read = next(row for row in await c.get(f"{craft}/tables") if row["name"] == "flight.control")
        assert read["values"]["K"] == control.K and read["read_ns"]
        await c.row("flatsat", (await c.post(table, {"values": {"K": 3.5}}))["ids"][0])
        assert control.K == 3.5
        row = await c.row("flatsat", (await c.post(table, {"values": {"K": -3.5}}))["ids"][0], "failed")
        assert "the parameters would break a rule" in row["stages"][-1]["text"] and control.K == 3.5
        await c.post(f"{craft}/tables/flight.contro", {"read": True}, 400)
        await c.post(table, {"values": {"k": 1}}, 400)
        await c.post(table, {"values": {"K": "x"}}, 400)


@flown
async def test_each_refusal_has_its_reason(tmp_path):
    async with console(tmp_path, NADIR) as c:
        for path in ("nothing", "crafts/other", "crafts/other/slots", "crafts/nadir_spin/packets/1-2"):
            assert (await c.get(path, 404))["error"]
        for path in ("slots?first=x", "slots?first=-1", "packets?limit=0", "sent?before=1e3",
                     "events?before=" + "9" * 30):
            assert "is a whole number" in (await c.get(f"crafts/nadir_spin/{path}", 400))["error"]
        for path, body in (("send", b"{"), ("send", b"[]"), ("send", b'{"name": 3}'), ("send", b'{"nam": "x"}'),
                           ("preview", b"[" * 100000), ("inspect", b'{"hex": "0g"}'), ("run", b'{"action": true}'),
                           ("alarms/0", b"{}"), ("stored", b'{"list": 1}')):
            assert (await c.post(f"crafts/nadir_spin/{path}", data=body, status=400))["error"]
        await c.post("crafts/nadir_spin/alarms/99999", {"acknowledge": True}, 404)
        assert (await c.client.post("/api/crafts/nadir_spin/send", json={})).status == 403      # without the CSRF word
        live = await c.client.ws_connect("/api/live")
        for text in ("{", "3", '{"subscribe": 3}', '{"subscribe": {"craft": "x"}}',
                     '{"subscribe": {"craft": "nadir_spin", "slots": "some"}}',
                     '{"subscribe": {"craft": "nadir_spin", "slots": [-1]}}',
                     '{"subscribe": {"craft": "nadir_spin", "slots": [], "hz": 1e9}}'):
            await live.send_str(text)
            while (found := (await live.receive(PATIENCE)).json())["kind"] != "refused":
                pass
            assert found["error"]
        assert await c.get("crafts")
        await c.get("openapi.yaml")


@pytest.mark.long("waits for limits of time")
@flown
async def test_a_browser_that_does_not_read_disturbs_no_other(tmp_path):
    async with console(tmp_path, '[[craft]]\nmission = "nadir_spin"\nspeed = 0\n') as c:
        await c.until("crafts/nadir_spin/slots", lambda rows: SIGMA in [row["name"] for row in rows])
        asleep = await c.client.ws_connect("/api/live", max_msg_size=0)
        asleep._conn.transport.pause_reading()      # its window fills up
        awake = await c.client.ws_connect("/api/live")
        for live in (asleep, awake):
            await live.send_json({"subscribe": {"craft": "nadir_spin", "slots": "all", "hz": 60}})
        frames = 0
        server = c.room.listeners[0].__self__
        while max(browser.skipped for browser in server.browsers) == 0:
            frames += (await awake.receive(PATIENCE)).type == WSMsgType.BINARY
        assert frames > 10 and min(browser.skipped for browser in server.browsers) < frames
        asleep._conn.transport.resume_reading()
        while True:
            message = await asleep.receive(PATIENCE)
            if message.type == WSMsgType.TEXT and message.json()["kind"] == "skipped":
                assert message.json()["count"] > 0
                break


@pytest.mark.parametrize("text, why", [
    ("", "a control room has spacecraft"),
    ("[[craft]]\n", "ground.toml:1: a spacecraft has a `mission` or a `database`; there are neither"),
    ('[[craft]]\nmission = "nadir_spin"\nlink = "udp://x"\n', "ground.toml:3: a link has an address"),
    ('[[craft]]\nmission = "nadir_spin"\nlink = "listen://1"\nspeed = 2\n', "`speed` is of a mission that the server"),
    ('[[craft]]\nmission = "nadir_spin"\n[[craft]]\nmission = "nadir_spin"\n', "names differ; nadir_spin is there"),
    ('[[craft]]\nmission = "nadir_spin"\nname = "a/b"\n', "a name is of letters"),
    ('[[craft]]\ndatabase = ["none.xml"]\nlink = "listen://1"\n', "files of a database are there"),
    ('[[craft]]\nmission = "nadir_spin"\nsped = 3\n', "did you mean `speed`?"),
    ('[[craft]]\nmission = "nadir_spin"\n[craft.derived.x]\nexpression = "1"\n', "`of` has names and their parameters"),
    ('port = 70000\n[[craft]]\nmission = "nadir_spin"\n', "ground.toml:1: "),
    ('host = "0.0.0.0"\n[[craft]]\nmission = "nadir_spin"\n', "opens the server to a network")])
def test_a_wrong_file_is_refused_with_its_line(tmp_path, text, why):
    from fledge.errors import SetupError

    (tmp_path / "ground.toml").write_text(text)
    with pytest.raises(SetupError) as error:
        read(tmp_path / "ground.toml")
    assert why in str(error.value)


LIMITED = """
[[craft]]
name = "imager"
mission = "earth_imager"
speed = 0
[craft.derived.angle]
of = { a = "flight.tracking.error.sigma_BR[0]", b = "flight.tracking.error.sigma_BR[1]" }
expression = "sqrt(a**2 + b**2)"
unit = "deg"
limits = { warning = [0.0, 0.001] }
[craft.derived.twice]
of = { a = "flight.tracking.error.sigma_BR[0]" }
function = "functions.py:twice"
[craft.derived.wrong]
of = { a = "flight.tracking.error.sigma_BR[0]" }
function = "functions.py:wrong"
"""


@pytest.mark.long("flies and replays")
@flown
async def test_history_derived_parameters_and_replays_agree(tmp_path):
    (tmp_path / "functions.py").write_text("def twice(a):\n    return 2 * a\ndef wrong(a):\n    return 1 // 0\n")
    async with console(tmp_path, LIMITED) as c:
        craft = "crafts/imager"
        sigmas = [f"flight.tracking.error.sigma_BR[{i}]" for i in (0, 1)]
        await c.until("crafts", lambda rows: int(rows[0]["t_ns"]) > 300 * 10**9)
        await c.post(f"{craft}/run", {"action": "pause"})
        series = await c.get(f"{craft}/history?names={','.join(sigmas)},angle,twice&points=0")
        a, b = (series[name]["value"] for name in sigmas)
        assert len(a) > 500 and series["angle"]["t_ns"] == series[sigmas[0]]["t_ns"]
        assert series["twice"]["value"] == [2 * x for x in a]
        assert series["angle"]["value"] == pytest.approx([(x * x + y * y)**0.5 for x, y in zip(a, b)], rel=1e-14)
        telemetry = c.room.crafts["imager"].telemetry
        newest = telemetry.monitor.newest(telemetry.slot_numbers["angle"])
        assert newest[3] == series["angle"]["value"][-1]
        few = (await c.get(f"{craft}/history?names=angle&points=20"))["angle"]
        assert len(few["t_ns"]) <= 20 and max(few["high"]) == max(series["angle"]["value"])
        data = await (await c.client.get(f"/api/{craft}/history?names=twice&points=0&format=binary")).read()
        magic, n_series, n, _ = struct.unpack_from("<IIII", data)
        assert (magic, n_series, n) == (0x32484C46, 1, len(a))
        assert list(struct.unpack_from(f"<{n}d", data, 16 + 8 * n)) == series["twice"]["value"]
        lines = (await c.get(f"{craft}/history?names=twice&points=0&format=csv")).splitlines()
        assert lines[0] == "t_ns,name,value,state" and [float(line.split(",")[2])
                                                        for line in lines[1:]] == series["twice"]["value"]
        for query, why in (("", "1 to 100"), ("names=none", "none"), ("names=angle&format=x", "json, csv or binary"),
                           ("names=angle&from_ns=x", "whole number")):
            assert why in (await c.get(f"{craft}/history?{query}", 400))["error"]
        assert any("wrong" in row["text"] and row["source"] == "derived" for row in await c.get(f"{craft}/events"))

        session, = await c.get(f"{craft}/sessions")
        packets = await c.get(f"{craft}/packets?limit=5")
        assert len(packets) == 5 and int(packets[0]["t_ns"]) == int(session["last_ns"]) and not session["gaps"]
        row = await c.get(f"{craft}/packets/{packets[0]['id']}")
        assert row["hex"] == packets[0]["hex"] and row["rows"] and row["reason"] == ""
        assert (await c.post(f"{craft}/inspect", {"hex": "0801" + packets[0]["hex"][4:]}))["container"] is None

        further = await c.post("crafts/imager/replay", {"from_ns": "0", "to_ns": "200000000000", "speed": 0})
        assert further["name"] == "imager@replay" and further["replay"] == "imager"
        await c.until("crafts", lambda rows: rows[-1]["link"]["state"] == "ended")
        replay = c.room.crafts["imager@replay"]
        for name in ("angle", *sigmas):
            t, _, _, value, *_ = replay.telemetry.monitor.newest(replay.telemetry.slot_numbers[name])
            assert t <= 200 * 10**9 and value == series[name]["value"][series[name]["t_ns"].index(str(t))]
        assert "command" not in next(row for row in await c.get("crafts") if row["replay"])["can"]
        await c.post("crafts/imager@replay/send", {"name": "flight.noop"}, 400)
        await c.post("crafts/imager@replay/replay", method="delete")
        assert len(await c.get("crafts")) == 1
        await c.post("crafts/imager/replay", method="delete", status=409)
        for body, why in (({"from_ns": "9" * 18}, "no packets there"), ({"from_ns": "x"}, "whole numbers"),
                          ({"speed": -1}, "speed"), ({"from_ns": 5, "to_ns": 3}, "comes before")):
            assert why in (await c.post("crafts/imager/replay", body, 400))["error"]


@flown
async def test_alarms_stay_until_somebody_has_seen_them(tmp_path):
    async with console(tmp_path, LIMITED.partition("[craft.derived.twice]")[0]) as c:
        path = "crafts/imager/alarms"
        alarm, = [alarm for alarm in await c.until(path, lambda rows: any(
            row["name"] == "angle" and row["concern"] == 0 for row in rows)) if alarm["name"] == "angle"]
        assert (alarm["worst"], alarm["acknowledged"]) == (2, None) and int(alarm["since_ns"]) < int(alarm["t_ns"])
        await c.post(f"{path}/{alarm['slot']}", {"shelve_s": 600})
        assert any(int(row["shelved_until_ns"]) > 0 for row in await c.get(path) if row["name"] == "angle")
        await c.post(f"{path}/{alarm['slot']}", {"shelve_s": -1}, 400)
        done = await c.post(f"{path}/{alarm['slot']}", {"acknowledge": True, "note": "the acquisition"})
        assert done["acknowledged"]["note"] == "the acquisition" and done["ended_ns"]
        assert "angle" not in [alarm["name"] for alarm in await c.get(path)]
        await c.post(f"{path}/{alarm['slot']}", {"acknowledge": True}, 400)

        slot = alarm["slot"]
        limits = f"crafts/imager/limits/{slot}"
        await c.post(limits, {"limits": {"critical": [5, 9]}}, method="put")
        again = [alarm for alarm in await c.until(path, len) if alarm["name"] == "angle"]
        assert again[0]["worst"] == 4 and again[0]["concern"] == 4
        for wrong in ({"critical": [9, 5]}, {"awful": [1, 2]}, {"critical": [1]}, {"critical": ["x", 1]}):
            await c.post(limits, {"limits": wrong}, 400, method="put")
    async with console(tmp_path, LIMITED.partition("[craft.derived.twice]")[0]) as c:      # the server starts again
        assert "angle" in [alarm["name"] for alarm in await c.get("crafts/imager/alarms")]


XTCE = """<?xml version="1.0"?>
<SpaceSystem name="Sat" xmlns="http://www.omg.org/spec/XTCE/20180204"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="u16" signed="false"><UnitSet><Unit>V</Unit></UnitSet>
<IntegerDataEncoding sizeInBits="16"/></IntegerParameterType></ParameterTypeSet><ParameterSet>
<Parameter name="head" parameterTypeRef="u16"/><Parameter name="count" parameterTypeRef="u16"/>
<Parameter name="size" parameterTypeRef="u16"/><Parameter name="NAME" parameterTypeRef="u16"/></ParameterSet>
<ContainerSet>
<SequenceContainer name="packet" abstract="true"><EntryList><ParameterRefEntry parameterRef="head"/>
<ParameterRefEntry parameterRef="count"/><ParameterRefEntry parameterRef="size"/></EntryList></SequenceContainer>
<SequenceContainer name="power"><EntryList><ParameterRefEntry parameterRef="NAME"/></EntryList>
<BaseContainer containerRef="packet"><RestrictionCriteria><Comparison parameterRef="head" value="2049"/>
</RestrictionCriteria></BaseContainer></SequenceContainer></ContainerSet></TelemetryMetaData></SpaceSystem>
"""


def power(i, head=2049):
    return struct.pack(">4H", head, 0xC000 | i & 0x3FFF, 1, i)


async def sending(address, packets):
    """A spacecraft that sends packets to each client that connects, once; then it is gone."""
    over = asyncio.Event()

    async def serve(_, writer):
        server.close()
        writer.write(b"".join(packets))
        await writer.drain()
        over.set()
        writer.close()

    server = await asyncio.start_server(serve, *address.split(":"), start_serving=False)
    await server.start_serving()
    await asyncio.wait_for(over.wait(), PATIENCE)


def own_address():
    """An address that refuses connections until the test serves there, by its server or another one: no other program
    takes a port of that host."""
    with socket.socket() as listener:
        listener.bind((f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}", 0))
        return "{}:{}".format(*listener.getsockname())


@pytest.mark.long("waits for a link to return")
@flown
async def test_a_link_that_breaks_comes_back_and_a_changed_database_is_read(tmp_path):
    address = own_address()
    file = tmp_path / "sat.xml"
    file.write_text(XTCE.replace("NAME", "battery"))
    double = tmp_path / "double.py"
    double.write_text("def f(a):\n    return 2 * a\n")
    text = f'[[craft]]\nname = "sat"\ndatabase = ["sat.xml"]\nroot = "/Sat/packet"\nlink = "tcp://{address}"\n' \
        'lenient = true\n[craft.derived.double]\nof = { a = "count" }\nfunction = "double.py:f"\n'
    async with console(tmp_path, text) as c:
        await c.until("crafts", lambda crafts: "refused" in crafts[0]["link"]["state"].lower())
        await c.post("crafts/sat/send", {"name": "x"}, 400)
        await sending(address, [power(i) for i in range(1, 101)] + [power(7, head=2050)])
        await c.until("crafts", lambda crafts: crafts[0]["packets"] == 101 and not crafts[0]["link"]["up"])
        craft, = await c.get("crafts")
        assert craft["undecoded"] == 1 and craft["clock"] == "utc" and int(craft["t_ns"]) > 17 * 10**17
        bad, = await c.get("crafts/sat/packets?undecoded=1")
        assert "2049" in bad["reason"] and bad["hex"] == power(7, head=2050).hex()

        for content, why in (("<SpaceSystem", "is refused, the old one stays"),
                             (XTCE.replace("NAME", "voltage").replace("</ParameterSet>", "<Odd/></ParameterSet>"),
                              "1 things of the database are left out: ")):
            file.write_text(content)
            await c.until("crafts/sat/events", lambda rows: any(why in row["text"] for row in rows))
        double.write_text("def f(a):\n    return 3 * a\n")
        await c.until("crafts/sat/events", lambda rows: sum("was read anew" in row["text"] for row in rows) == 2)
        await sending(address, [power(i) for i in range(101, 201)])
        await c.until("crafts", lambda crafts: crafts[0]["packets"] == 201 and not crafts[0]["link"]["up"])
        assert [entry["name"] for entry in await c.get("crafts/sat/slots")].count("voltage") == 1
        assert (await c.get("crafts/sat/history?names=double&points=0"))["double"]["value"][-1] == 3 * 0xC000 + 600
        assert (await c.get("crafts/sat/history?names=voltage&points=0"))["voltage"]["value"] == list(range(1, 201))
        texts = [entry["text"] for entry in await c.get("crafts/sat/events")]
        assert sum("the link is up" in text for text in texts) >= 2
        assert any("the other end of the link is gone" in text for text in texts)


@flown
async def test_a_mission_that_changes_is_reported(tmp_path):
    mission = tmp_path / "own"
    copytree(ROOT / "missions" / "nadir_spin", mission)
    async with console(tmp_path, NADIR.replace("nadir_spin", str(mission))) as c:
        await c.until("crafts", lambda crafts: crafts[0]["packets"])
        (mission / "nadir_spin_test.py").write_text("")
        (mission / "contact.py").write_text("")     # a script that the mission does not import
        (mission / "flight.py").write_text((mission / "flight.py").read_text() + "\n")
        await c.until("crafts/own/events", lambda rows: any(
            "the mission has changed (flight.py); the server has the old one until" in row["text"] for row in rows))


@flown
async def test_a_second_server_of_a_spacecraft_is_refused(tmp_path):
    from fledge.errors import SetupError

    async with console(tmp_path, NADIR):
        with pytest.raises(SetupError, match="another program|nadir_spin"):
            Room(read(tmp_path / "ground.toml"))


@flown
async def test_nothing_is_commanded_that_cannot_be_kept(tmp_path):
    async with console(tmp_path, NADIR) as c:
        craft, journal = c.room.crafts["nadir_spin"], c.room.journal
        await c.verified("nadir_spin", "flight.noop", {})
        pages = journal._db.execute("PRAGMA page_count").fetchone()[0]
        journal._db.execute(f"PRAGMA max_page_count = {pages}")        # as a full disk: SQLITE_FULL
        accepted = craft.simulation.flight.commands.counters.accepted
        for _ in range(200):
            answer = await c.client.post("/api/crafts/nadir_spin/send", headers={"X-Fledge-CSRF": c.csrf}, json={
                "name": "flight.write.control.K", "arguments": {"K": 7}})
            if answer.status != 200:
                break
        assert answer.status == 409 and "full" in (await answer.json())["error"]
        sent = await c.get("crafts/nadir_spin/sent?limit=500")
        journal._db.execute("PRAGMA max_page_count = 1000000")
        await c.verified("nadir_spin", "flight.noop", {})
        assert craft.simulation.flight.commands.counters.accepted - accepted == len(sent) - 2 + 1


@flown
async def test_what_was_refused_as_too_late_is_not_done_later(tmp_path):
    async with console(tmp_path, NADIR) as c:
        craft, goes_on = c.room.crafts["nadir_spin"], Event()
        await c.verified("nadir_spin", "flight.noop", {})
        try:
            with patch.object(common, "PATIENCE", 0.1):
                craft.call(goes_on.wait)
                refused = await c.post("crafts/nadir_spin/send", {"name": "flight.noop"}, 409)
        finally:
            goes_on.set()
        assert "did not answer" in refused["error"]
        await c.verified("nadir_spin", "flight.noop", {})
        assert len(await c.get("crafts/nadir_spin/sent")) == 3      # with the server's own, which turns telemetry on


def test_what_a_browser_has_seen_survives_a_kill(tmp_path):
    """kill -9 of the server while packets come: each packet whose value somebody has seen is in the archive, and each
    command whose number was answered in the journal."""
    (tmp_path / "ground.toml").write_text('port = 0\n[[craft]]\nmission = "nadir_spin"\nspeed = 200\n')
    serve = [sys.executable, "-c", "import sys; from fledge.cli import main; sys.exit(main())", "ground", "serve",
             "ground.toml"]
    with subprocess.Popen(serve, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as server:
        address = re.search(r"http://\S+/", server.stdout.readline())[0]

        async def read_live():
            async with ClientSession(address) as client:
                csrf = (await (await client.get("/api/session")).json())["csrf"]
                numbers = [(await (await client.post(
                    "/api/crafts/nadir_spin/send", headers={"X-Fledge-CSRF": csrf},
                    json={"name": "flight.noop"})).json())["id"] for _ in range(20)]
                async with client.ws_connect("/api/live") as live:
                    await live.send_json({"subscribe": {"craft": "nadir_spin", "slots": "all", "hz": 60}})
                    times = []
                    while len(times) < 20 or times[-1] < 200 * 10**9:
                        message = await live.receive(PATIENCE)
                        if message.type == WSMsgType.BINARY:
                            times.append(struct.unpack_from("<q", message.data, 16)[0])
                    server.kill()
                    while (message := await live.receive(PATIENCE)).type == WSMsgType.BINARY or (
                            message.type == WSMsgType.TEXT):
                        if message.type == WSMsgType.BINARY:
                            times.append(struct.unpack_from("<q", message.data, 16)[0])
                    return numbers, max(times)

        numbers, last = asyncio.run(read_live())
        server.wait()
    room = Room(read(tmp_path / "ground.toml"))
    try:
        session = room.crafts["nadir_spin"].past.sessions()[0]
        assert session["ended"] == "killed" and int(session["last_ns"]) >= last and not session["gaps"]
        assert {row["id"] for row in room.journal.rows("sent")} >= set(numbers)
        history = room.crafts["nadir_spin"].telemetry.history
        packets = history.packets(0, last, None, 10**6, False, session["session"])
        assert len(packets) > 1000        # from the first to what was seen, none is missing of any stream
        streams = {}
        for _, _, _, packet in packets:
            streams.setdefault(packet[:2], []).append(int.from_bytes(packet[2:4], "big") & 0x3FFF)
        assert len(streams) > 5 and all(numbers == [(numbers[0] + i) % 0x4000 for i in range(len(numbers))]
                                        for numbers in streams.values())
        room.start()        # the next session, whose time begins anew
        craft = room.crafts["nadir_spin"]
        wait_for(lambda: craft.telemetry.packets > 100)
        for t, _, _, packet in packets[::500]:
            assert craft.past.packet_of(number_of(t, packet))["hex"] == packet.hex()
        assert all({stage["stage"] for stage in row["stages"]} & {"completed",
                                                                  "unknown"}       # of a run that has ended
                   for row in room.journal.rows("sent") if row["id"] in numbers)
    finally:
        room.close()
