# SPDX-License-Identifier: Apache-2.0
"""Every route of the server without a user, with too low a role, from foreign pages, and with what is no request of it.
FLEDGE_CASES=100000 makes so many."""
import json
import os
import random
import re

from aiohttp import WSMsgType

from fledge.control_room.web_test import console, flown

CASES = int(os.environ.get("FLEDGE_CASES", 300))
FILE = """
folder = "kept"
[[craft]]
mission = "nadir_spin"
speed = 1
"""
WORDS = ["", "0", "-1", "1e999", "flight.write.control.K", "<img src=x onerror=alert(1)>", "../../etc/passwd", "\ud800",
         "\x00\x1b[2J", "%00", "n" * 5000, "nadir_spin", "99999999999999999999999", "NaN", "☃", "K=3", "a" * 100_000]
KEYS = ["name", "arguments", "confirmed", "hex", "action", "speed", "seconds", "fault", "limits", "persistence",
        "values", "read", "list", "step", "time_ns", "craft", "session", "from_ns", "to_ns", "acknowledge", "note",
        "shelve_s", "subscribe", "unsubscribe", "subscribe_packets", "slots", "hz", "truth"]


def routes(app):
    return sorted({(one.method, one.resource.canonical) for one in app.router.routes()
                   if one.method != "HEAD" and one.resource.canonical.startswith("/api/")})


def filled(path, craft="nadir_spin", word="0"):
    return re.sub(r"{\w+(:[^}]*)?}", word, path.replace("{c}", craft))


def content(draw, depth=0):
    """Something for JSON."""
    kind = draw.randrange(8 if depth < 3 else 5)
    if kind < 5:
        return draw.choice([*WORDS, None, True, False, 0, -1, 7, 2**63, 2**80, 1e308, 0.5])
    if kind == 5:
        return [content(draw, depth + 1) for _ in range(draw.randrange(4))]
    return {key: content(draw, depth + 1) for key in draw.sample(KEYS, draw.randrange(4))}


@flown
async def test_fuzzed_routes_and_messages_are_answered_with_words(folder):
    draw = random.Random(11)
    async with console(folder, FILE) as page:
        found = [one for one in routes(page.client.app) if one[1] != "/api/live"]
        for _ in range(CASES):
            method, path = draw.choice(found)
            word = draw.choice(WORDS[:-1]).encode(errors="replace").hex()
            path = filled(path, draw.choice(["nadir_spin"] * 5 + ["x"]), "%" + "%".join(re.findall("..", word))
                          if word and draw.random() < 0.5 else draw.choice(["0", "3", "flight.control", "x"]))
            query = {key: draw.choice(WORDS[:9]).encode(errors="replace").decode() for key in
                     draw.sample(["before", "limit", "first", "names", "from_ns", "to_ns", "points", "path"], 2)}
            data = json.dumps(content(draw)).encode() if draw.random() < 0.8 else draw.randbytes(20)
            answer = await page.client.request(method, path, params=query, data=None if method == "GET" else data,
                                               headers={"X-Fledge-CSRF": page.csrf})
            said = await answer.text(errors="replace")
            assert answer.status < 500, (method, path, query, data, said)
            assert answer.status == 200 or json.loads(said)["error"], (method, path, said)
            assert "html" not in answer.content_type
        live = await page.client.ws_connect("/api/live")
        for _ in range(CASES):
            if live.closed:
                live = await page.client.ws_connect("/api/live")
            if draw.random() < 0.2:
                await live.send_bytes(draw.randbytes(30))
            else:
                await live.send_str(json.dumps(content(draw) if draw.random() < 0.5 else {
                    draw.choice(KEYS[-7:]): content(draw)}))
        await live.send_str("{")
        while True:     # the answers come in order, this one last
            message = await live.receive(60)
            assert message.type in (WSMsgType.TEXT, WSMsgType.BINARY), message
            if message.type == WSMsgType.TEXT and "JSON" in message.data:
                break
        await page.verified("nadir_spin", "flight.write.control.K", {"K": 3})
