# SPDX-License-Identifier: Apache-2.0
"""Values of the past by HTTP: exact, and with the states that they had; by struct, csv, Decimal and a few lines."""
import csv
import json
import math
import random
import struct
from decimal import Decimal

import pytest

from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.ground.server.web_test import console, flown, own_address, sending
from fledge.errors import SetupError
from fledge.ground.history_test import ALL_KINDS

DATABASE = ALL_KINDS.replace("</ParameterTypeSet><ParameterSet>", """<BinaryParameterType name="head">
    <BinaryDataEncoding><SizeInBits><FixedValue>48</FixedValue></SizeInBits></BinaryDataEncoding></BinaryParameterType>
    </ParameterTypeSet>
    <ParameterSet><Parameter name="head" parameterTypeRef="head"/>""").replace(
    'abstract="true"><EntryList>', 'abstract="true"><EntryList><ParameterRefEntry parameterRef="head"/>')
FILE = """
[[craft]]
name = "craft"
database = "craft.xml"
link = "tcp://ADDRESS"
[craft.derived.last]
of = { a = "middle", b = "real" }
expression = "a + b"
limits = { warning = [-2, 2] }
[craft.derived.middle]
of = { x = "first", y = "real" }
expression = "x * y"
[craft.derived.first]
of = { x = "label" }
expression = "x - 3"
"""
LABELS = {1: "OFF", 7: "ON"}
LEVELS = ("normal", "watch", "warning", "distress", "critical", "severe")


def drawn(chance):
    """Values of a packet."""
    return [chance.choice([2**64 - 1, 2**53 + 1, 5]), chance.choice([-2**63, 12, -2**53 - 1]),
            chance.choice([0.1, -0.7, 3.0, 0.4]), chance.choice([1, 7, 9]), chance.choice([b"=1+1", b'a,"b', b"Abcd"]),
            chance.randbytes(3)]


@flown
async def test_what_was_is_exact_and_has_its_states_in_every_format(tmp_path):
    (tmp_path / "craft.xml").write_text(DATABASE)
    address, chance = own_address(), random.Random(1)
    values = [drawn(chance) for _ in range(60)]
    packets = [struct.pack(">HHHB QqdB4s3s", 0x0801, 0xC000 + i, 32, 2, *item) for i, item in enumerate(values)]
    async with console(tmp_path, FILE.replace("ADDRESS", address)) as c:
        names = ["natural", "integer", "real", "label", "text", "bytes", "last"]
        await sending(address, packets[:30])
        slots = {item["name"]: item["slot"] for item in await c.until("crafts/craft/slots", lambda _: (
            c.room.crafts["craft"].telemetry.packets == 30))}
        then = int((await c.get("crafts"))[0]["t_ns"])
        for name, limits in (("real", {"critical": [-0.5, 0.5]}), ("last", {"severe": [None, 1.5]})):
            await c.post(f"crafts/craft/limits/{slots[name]}", {"limits": limits}, method="put")
        await sending(address, packets[30:])
        await c.until("crafts", lambda rows: rows[0]["packets"] == 60)
        path = f"crafts/craft/history?names={','.join(names)}&points=0"
        series = json.loads(await (await c.client.get(f"/api/{path}")).text(), parse_int=Decimal)
        rows = list(csv.DictReader((await c.get(f"{path}&format=csv")).splitlines()))
        few = await c.get("crafts/craft/history?names=text,integer&points=1")
        data = await (await c.client.get(f"/api/{path.replace('text,bytes,', '')}&format=binary")).read()
        for begin, end, limits in ((0, then, {"warning": [-1, 1]}), (0, 2**63 - 1, {"critical": [-0.5, 0.5]}),
                                   (then + 1, 2**63 - 1, {"critical": [-0.5, 0.5]})):
            again = await c.post("crafts/craft/replay", {"from_ns": str(begin), "to_ns": str(end), "speed": 0})
            await c.until("crafts", lambda rows: rows[-1]["link"]["state"] == "ended")
            assert (await c.get(f"crafts/{again['name']}/slots"))[slots["real"]]["limits"] == limits
            await c.post(f"crafts/{again['name']}/replay", method="delete")

    last = [(label - 3) * real + real for _, _, real, label, _, _ in values]
    assert [int(row) for row in series["natural"]["value"]] == [row[0] for row in values]
    assert [int(row) for row in series["natural"]["text"]] == [row[0] for row in values]
    assert [int(row) for row in series["integer"]["value"]] == [row[1] for row in values]
    assert series["real"]["value"] == [row[2] for row in values] and "text" not in series["real"]
    assert series["label"]["value"] == [row[3] for row in values]
    assert series["label"]["text"] == [LABELS.get(row[3], "9") for row in values]
    assert series["text"]["value"] == [row[4].decode() for row in values] and series["text"]["low"] == []
    assert series["bytes"]["value"] == [row[5].hex() for row in values]
    assert series["last"]["value"] == pytest.approx(last, rel=1e-15)
    beyond = [abs(row[2]) > 1 for row in values]
    states = {
        "real": [2 * (beyond[i] and i > 0 and beyond[i - 1]) if i < 30 else 4 * (abs(values[i][2]) > 0.5)
                 for i in range(60)],
        "label": [3 * (item[3] == 7) for item in values], "text": [2 * (item[4][:1] == b"A") for item in values],
        "last": [2 * (abs(item) > 2) if i < 30 else 5 * (item > 1.5) for i, item in enumerate(last)],
        "bytes": [0] * 60}
    for name, concern in states.items():
        assert series[name]["concern"] == series[name]["worst"] == concern and (name == "bytes" or any(concern)), name

    texts = {name: [row["value"] for row in rows if row["name"] == name] for name in names}
    assert [int(item) for item in texts["natural"]] == [item[0] for item in values]
    assert [int(item) for item in texts["integer"]] == [item[1] for item in values]
    assert [float(item) for item in texts["real"]] == [item[2] for item in values]
    assert texts["label"] == series["label"]["text"] and texts["bytes"] == series["bytes"]["value"]
    assert texts["text"] == [("'" * (item[4][:1] == b"=")) + item[4].decode() for item in values]   # a table's formula
    for name, concern in states.items():
        assert [row["state"] for row in rows if row["name"] == name] == [LEVELS[item] for item in concern]

    assert few["text"]["value"] == [values[-1][4].decode()] and few["integer"]["value"] == [values[-1][1]]
    assert few["text"]["concern"] == states["text"][-1:] and few["text"]["worst"] == [max(states["text"])]
    magic, n = struct.unpack_from("<II", data)
    assert (magic, n) == (0x32484C46, 5)
    at = 8
    for name in ("natural", "integer", "real", "label", "last"):
        assert struct.unpack_from("<II", data, at) == (60, 0)
        value = struct.unpack_from("<60d", data, at + 8 + 480)
        assert value == pytest.approx([float(item) for item in series[name]["value"]], rel=1e-15)
        assert list(data[at + 8 + 4 * 480:][:60]) == series[name]["worst"]
        at += 8 + 4 * 480 + math.ceil(60 / 8) * 8
    assert at == len(data)


def test_derived_parameters_in_a_circle_are_refused(tmp_path):
    (tmp_path / "craft.xml").write_text(DATABASE)
    (tmp_path / "ground.toml").write_text(FILE.replace("ADDRESS", "127.0.0.1:1").replace('x = "label"', 'x = "last"'))
    with pytest.raises(SetupError, match="in a circle: last -> middle -> first -> last"):
        Room(read(tmp_path / "ground.toml"))
