# SPDX-License-Identifier: Apache-2.0
"""Each row of the routes and messages with each kind of user, and what is no request of the server. An hour of those:

    FLEDGE_MINUTES=60 FLEDGE_SEED=7 /usr/bin/python3 -m pytest -s -k fuzzed ground/server/attacked_test.py
"""
import asyncio
import json
import os
import random
import re
import time
from contextlib import suppress
from types import SimpleNamespace
from unittest.mock import patch

import pytest
from aiohttp import WSMsgType
from aiohttp.test_utils import TestClient, TestServer
from yarl import URL

from fledge.ground.server.access import ROLES
from fledge.ground.server.handlers import TOPICS
from fledge.ground.server.journal import Journal
from fledge.ground.server.live import MESSAGES
from fledge.ground.server.logins import Logins
from fledge.ground.server.passwords import hashed, token
from fledge.ground.server.room import Room
from fledge.ground.server.routes import rows
from fledge.ground.server.settings import read
from fledge.ground.server.web import Server
from fledge.ground.server.web_test import console, flown
from fledge.errors import SetupError
from tests.waiting import PATIENCE

CASES, SEED = int(os.environ.get("FLEDGE_CASES", 300)), int(os.environ.get("FLEDGE_SEED", 11))
UNTIL = time.monotonic() + 60 * float(os.environ.get("FLEDGE_MINUTES", 0))
FILE = """
folder = "kept"
[[craft]]
name = "a"
mission = "nadir_spin"
speed = 1
[[craft]]
name = "b"
mission = "nadir_spin"
speed = 1
"""
FILES = FILE.replace("nadir_spin", "flatsat", 1)
ROWS = [row for holder in (*TOPICS, Logins) for row, _ in rows(holder)]
WORDS = ["", "0", "-1", "1e999", "flight.write.control.K", "<img src=x onerror=alert(1)>", "../../etc/passwd", "\ud800",
         "\x00\x1b[2J", "%00", "n" * 5000, "nadir_spin", "99999999999999999999999", "NaN", "☃", "K=3", "a" * 100_000]
KEYS = ["name", "arguments", "confirmed", "hex", "action", "speed", "seconds", "fault", "limits", "persistence",
        "values", "read", "list", "step", "time_ns", "craft", "session", "from_ns", "to_ns", "acknowledge", "note",
        "shelve_s", "path", "text", "answer", "slots", "hz", "truth", *MESSAGES]


def filled(path, craft, word="0"):
    return re.sub(r"{\w+(:[^}]*)?}", word, path.replace("{c}", craft))


# --- who may what ----------------------------------------------------------------------------------------------------

def test_what_changes_something_is_no_get_and_needs_a_role():
    """By names, apart from the rows, so that none of them becomes laxer unseen."""
    of = {(row.method, row.path.removeprefix("/api/crafts/{c}")): row for row in ROWS}
    assert {what: row.role for what, row in of.items() if row.role not in ("view", "command")} == {
        ("GET", "/"): "anyone", ("GET", "/assets/{name:[a-z0-9._-]+}"): "anyone", ("GET", "/api/session"): "anyone",
        ("POST", "/api/login"): "anyone", ("POST", "/api/logout"): "user", ("GET", "/api/openapi.yaml"): "user",
        ("PUT", "/limits/{slot}"): "administer", ("GET", "/api/server"): "administer"}
    assert {what for what, row in of.items() if row.role == "view" and what[0] != "GET"} == {
        ("POST", "/preview"), ("POST", "/inspect"), ("POST", "/replay"), ("DELETE", "/replay")}
    assert {what for what, row in of.items() if row.role == "command" and what[0] == "GET"} == {
        ("GET", "/questions/{id}")}
    assert all((row.craft != "") == ("{c}" in row.path) for row in ROWS)
    assert {row.path for row in ROWS if row.method != "GET" and not row.logged} == {
        "/api/login", "/api/logout", "/api/crafts/{c}/preview", "/api/crafts/{c}/inspect"}
    assert {key: (row.role, row.craft) for key, (row, _) in MESSAGES.items()} == {
        "subscribe": ("view", "path"), "subscribe_packets": ("view", "path"), "unsubscribe": ("user", "")}


@flown
async def test_a_route_without_a_row_does_not_start(folder):
    async def secret(request):
        raise AssertionError

    (folder / "ground.toml").write_text(FILE)
    room = Room(read(folder / "ground.toml"))
    try:
        server = Server(room)
        server.app.router.add_get("/api/secret", secret)
        with pytest.raises(SetupError, match="/api/secret has no row that says who may ask it"):
            await TestClient(TestServer(server.app)).start_server()
    finally:
        room.close()


def people(word):
    """Who asks, and the server's tables of them: roles None: no user; crafts None: all; csrf: with the word."""
    tables, users = [], {"no user": SimpleNamespace(roles=None, crafts=None, headers={}, csrf=True)}
    for name, roles, crafts in (("viewer", ROLES[:1], None), ("commander", ROLES[:2], None), ("all", ROLES, None),
                                ("blind", ROLES[1:], None), ("own", ROLES, ["a"]), ("stranger", ROLES, ["b", "ghost"])):
        token_word, digest = token()
        tables.append({"token": name, "hash": digest, "roles": list(roles), "crafts": crafts})
        users[name] = SimpleNamespace(roles=roles, crafts=crafts, csrf=True,
                                      headers={"Authorization": f"Bearer {token_word}"})
    tables.append({"user": "ada", "password": hashed(word, (16, 8, 1)), "roles": list(ROLES), "crafts": None})
    text = "".join(f"\n[[{kind}]]\nname = \"{table.pop(kind)}\"\n" + "".join(
        f"{key} = {json.dumps(value)}\n" for key, value in table.items() if value is not None)
        for table in tables for kind in [next(iter(table))])
    return users, text


def right(row, craft, user, status, reply, changes):
    """Whether an answer is as the row demands, from what it says to a person."""
    if row.role == "anyone":
        return status not in (401, 403)
    if user.roles is None:
        return status == 401 and "log in first" in reply
    if changes and not user.csrf:
        return status == 403 and "X-Fledge-CSRF" in reply
    if "{c}" in row.path and (craft not in "ab" or user.crafts and craft not in user.crafts):
        return status == 404 and "there is no spacecraft" in reply
    if row.role != "user" and row.role not in user.roles:
        return status == 403 and "lacks the role" in reply
    return status < 500 and status not in (401, 403) and not (
        "{c}" in row.path and "there is no spacecraft" in reply)


@flown
async def test_every_row_checks_the_user_and_the_role(folder):
    """With each role, without a session, with ended ones, without the CSRF word, with the roles of another spacecraft;
    for a spacecraft, one that there is not, and a replay that has ended."""
    users, text = people("correct horse")
    async with console(folder, FILE + text) as page:
        async def login(name):
            answer = await page.client.post("/api/login", json={"user": "ada", "password": "correct horse"})
            cookie = "; ".join(f"{cooky.key}={cooky.value}" for cooky in answer.cookies.values())
            page.client.session.cookie_jar.clear()
            csrf = {"X-Fledge-CSRF": (await answer.json())["csrf"]}
            users[name] = SimpleNamespace(roles=ROLES, crafts=None, csrf=True, headers={"Cookie": cookie, **csrf})
            return {"Cookie": cookie}, csrf

        cookie, csrf = await login("logged out")
        assert (await page.client.post("/api/logout", headers={**cookie, **csrf})).status == 200
        await login("idle")
        page.server.guard.sessions.clock = lambda: time.monotonic() + 31 * 60
        assert (await page.client.get("/api/crafts", headers=users["idle"].headers)).status == 401
        users["logged out"].roles = users["idle"].roles = None
        users["without the word"] = SimpleNamespace(roles=ROLES, crafts=None, csrf=False)
        users["without the word"].headers, _ = await login("session")

        requests, wrong, known = 0, [], {user: {} for user in users}
        for row in sorted(ROWS, key=lambda row: row.path == "/api/logout"):
            body = {"from_ns": "9" * 18} if row.path.endswith("/replay") else {}
            for craft in ("a", "b", "zz", "a@replay7") if "{c}" in row.path else ("",):
                for name, user in users.items():
                    for method in (row.method, "HEAD")[:1 + (row.method == "GET" and name in ("no user", "stranger"))]:
                        answer = await page.client.request(method, filled(row.path, craft), headers=user.headers,
                                                           json=None if row.method == "GET" else body)
                        reply = (await answer.content.read(500)).decode(errors="replace")
                        page.client.session.cookie_jar.clear()
                        requests += 1
                        if not (answer.status == known[name][row.path, craft][0] if method == "HEAD" else
                                right(row, craft, user, answer.status, reply, row.method != "GET")):
                            wrong.append((name, method, filled(row.path, craft), answer.status, reply))
                        if method != "HEAD":
                            known[name][row.path, craft] = answer.status, reply.replace(f"'{craft}'", "?"), {
                                **answer.headers, "Date": "", "Content-Length": ""}
        print(f"{requests} requests, {requests - len(wrong)} right")
        assert not wrong, wrong[:10]
        assert requests > 2000 and len(ROWS) > 45
        there = [path for path, craft in known["stranger"] if craft == "a"]
        assert len(there) > 30 and all(     # as if it were not there
            known["stranger"][path, "a"] == known["stranger"][path, "zz"] for path in there)
        log = page.room.journal.rows("log", limit=500)
        assert not [user for user in log if user["action"] != "refused" and user["user"] == "viewer" and
                    "replay" not in user["action"]]


@flown
async def test_every_message_checks_the_role(folder):
    users, text = people("correct horse")
    async with console(folder, FILE + text) as page:
        messages, wrong, errors_of = 0, [], {}
        for name, user in users.items():
            if not user.roles or "view" not in user.roles:
                assert (await page.client.get("/api/live", headers=user.headers)).status == (403 if user.roles else 401)
                continue
            live = await page.client.ws_connect("/api/live", headers=user.headers)
            for key, (row, _) in MESSAGES.items():
                for craft in ("a", "b", "zz", "a@replay7"):
                    await live.send_json({key: {"craft": craft, "slots": []} if key == "subscribe" else craft})
                    await live.send_str("{")
                    errors = []
                    while not errors or "JSON" not in errors[-1]:
                        message = await live.receive(PATIENCE)
                        if message.type == WSMsgType.TEXT and message.json()["kind"] == "refused":
                            errors.append(message.json()["error"])
                    messages += 1
                    hidden = row.craft and (craft not in "ab" or user.crafts and craft not in user.crafts)
                    errors_of[name, key, craft] = [user.replace(f"'{craft}'", "?") for user in errors[:-1]]
                    if len(errors) != 1 + bool(hidden) or hidden and "there is no spacecraft" not in errors[0]:
                        wrong.append((name, key, craft, errors))
            await live.close()
        print(f"{messages} messages, {messages - len(wrong)} right")
        assert not wrong and messages >= 5 * 3 * 4, wrong
        assert all(errors_of["stranger", key, "a"] == errors_of["stranger", key, "zz"] for key in MESSAGES)
        assert "there is b" in errors_of["stranger", "subscribe", "a"][0]


@flown
async def test_a_user_without_a_role_for_a_spacecraft_receives_nothing_of_it(folder):
    """By the log, old and live; by the list; of what others do, and of a run that several spacecraft share."""
    users, text = people("correct horse")
    async with console(folder, FILE + text) as page:
        async def ask(name, method, path, status=200, **given):
            answer = await page.client.request(method, f"/api/{path}", headers=users[name].headers, **given)
            reply = await answer.text()
            assert answer.status == status, reply
            return json.loads(reply)

        sockets = {}
        for name in ("stranger", "all"):
            sockets[name] = await page.client.ws_connect("/api/live", headers=users[name].headers)
        while not all(craft.control and craft.connection.craft for craft in page.room.crafts.values()):
            await asyncio.sleep(0.05)
        await ask("all", "POST", "crafts/a/send", json={"name": "flight.noop", "arguments": {}})
        await ask("all", "POST", "crafts/a/questions", json={"text": "does it go?"})
        await ask("all", "PUT", "crafts/a/limits/0", json={"limits": {}})
        await ask("viewer", "POST", "crafts/a/send", 403, json={})
        await ask("stranger", "POST", "crafts/a/send", 404, json={})
        await ask("stranger", "POST", "crafts/b/send", json={"name": "flight.noop", "arguments": {}})
        page.room.report("b", "info", "test", "the end")
        texts = {name: [] for name in sockets}
        for name, live in sockets.items():
            while not texts[name] or texts[name][-1].get("text") != "the end":
                if (message := await live.receive(PATIENCE)).type == WSMsgType.TEXT:
                    texts[name].append(message.json())
        assert {"log", "sent", "question", "slots"} <= {row["kind"] for row in texts["all"] if row.get("craft") == "a"}
        assert not [row for row in texts["stranger"] if row.get("craft") not in ("b", None, "")]
        assert {row["user"] for row in texts["stranger"] if row["kind"] == "log"} == {"stranger"}
        log = await ask("stranger", "GET", "log")
        assert {row["user"] for row in log} == {"stranger"}
        assert [row["craft"] for row in log] == ["b", None]     # the other one was refused
        assert {row["user"] for row in await ask("all", "GET", "log")} >= {"all", "viewer", "stranger"}
        assert [row["name"] for row in await ask("stranger", "GET", "crafts")] == ["b"]
        assert {row["craft"] for row in await ask("own", "GET", "log")} == {"a"}
        crafts = page.room.crafts
        crafts["b"].control = crafts["a"].control       # as of one co-simulation
        for name, status in (("stranger", 403), ("own", 403), ("viewer", 403), ("commander", 200)):
            await ask(name, "POST", "crafts/b/run" if name != "own" else "crafts/a/run", status, json={})


def test_a_part_of_the_log_is_what_a_filter_leaves(tmp_path):
    draw, journal, all_ = random.Random(3), Journal(tmp_path), []
    for i in range(400):
        craft, user = draw.choice(["a", "b", "c", ""]), draw.choice(["ada", "bob", "", 'a"da'])
        row = {"craft": craft or None, "time_ns": str(i // 2), "user": user, "text": '"user": "ada"'}
        journal.save("log", craft, row)
        all_.insert(0, (craft, row))
    for _ in range(100):
        crafts, user = draw.sample(["a", "b", "c"], draw.randrange(4)), draw.choice(["ada", "bob", 'a"da', "eve"])
        before, limit, until = draw.choice([None, 90, 300]), draw.choice([1, 7, 500]), draw.choice([None, 20, 150])
        assert journal.rows("log", None, before, limit, until, (crafts, user)) == [
            row for craft, row in all_ if (craft in crafts or row["user"] == user) and
            (before is None or row["id"] < before) and (until is None or int(row["time_ns"]) <= until)][:limit]
    journal.close()


# --- what is no request of it ----------------------------------------------------------------------------------------

WRONG = [b'{"name": "\\ud800"}', b'{"\\udfff": 1}', b'{"name": "\xed\xa0\x80"}', b'{"name": "\xff"}', b'{"a": NaN}',
         b'{"seconds": 1e999}', b'{"seconds": -Infinity}', b'{"seconds": ' + b"9" * 400 + b"}", b"[" * 100_000,
         b"\xff\xfe{\0}\0", b"[]", b'"\\ud83d\\ude00"', b'{"name": 1}{}']


@flown
async def test_texts_and_numbers_that_are_none_are_refused(folder):
    """In the body of each route, in a path, a query, a header and a message, with words and nothing on the terminal."""
    async with console(folder, FILES) as page:
        for row in ROWS:
            if row.method == "GET" or row.path in ("/api/crafts/{c}/files", "/api/logout"):
                continue
            for body in WRONG:
                answer = await page.client.request(row.method, filled(row.path, "a"), data=body,
                                                   headers={"X-Fledge-CSRF": page.csrf})
                reply = await answer.json()
                # Some take no body, or say first what else is wrong.
                assert answer.status in (400, 404, 409), (row, body, answer.status)
                assert answer.status != 400 or len(reply["error"]) > 10
        live = await page.client.ws_connect("/api/live")
        for body in WRONG:
            if not {b"\xff"[0], b"\xed"[0]} & set(body):
                await live.send_str(body.decode())
                while (message := await live.receive(PATIENCE)).type != WSMsgType.TEXT or \
                        message.json()["kind"] != "refused":
                    assert message.type in (WSMsgType.TEXT, WSMsgType.BINARY)
        for target in (b"/api/crafts/\xff/slots", b"/api/crafts/a/packets?container=\xff",
                       b"/api/crafts/a/history?names=%ff", b"/api/crafts/a/files/%ED%A0%80",
                       b"/api/crafts/%c0%af/slots"):
            for method in (b"GET", b"POST"):
                reader, writer = await asyncio.open_connection("127.0.0.1", page.client.server.port)
                writer.write(method + b" " + target + b" HTTP/1.1\r\nHost: localhost\r\nX-Fledge-CSRF: \xff\r\n"
                             b"Connection: close\r\nContent-Length: 2\r\n\r\n{}")
                assert b" 400 " in (reply := await reader.read())[:20], (target, reply)
                assert b"UTF-8" in reply or b"Invalid char" in reply, (target, reply)   # by aiohttp itself: 3.11
                writer.close()
        assert not [entry for entry in page.room.journal.rows("log") if "made an error" in entry["text"]]
        emoji = await page.client.post("/api/crafts/a/questions", data=b'{"text": "\\ud83d\\ude00?"}',
                                       headers={"X-Fledge-CSRF": page.csrf})
        assert (await emoji.json())["text"] == "\U0001f600?"


def content(draw, depth=0):
    """Something for JSON."""
    kind = draw.randrange(8 if depth < 3 else 5)
    if kind < 5:
        return draw.choice([*WORDS, None, True, False, 0, -1, 7, 2**63, 2**80, 1e308, 0.5])
    if kind == 5:
        return [content(draw, depth + 1) for _ in range(draw.randrange(4))]
    return {key: content(draw, depth + 1) for key in draw.sample(KEYS, draw.randrange(4))}


async def fuzzed(folder):
    draw, begun, requests, sent = random.Random(SEED), time.monotonic(), 0, 0
    routes = [entry for entry in ROWS if entry.path != "/api/live"]
    async with console(folder, FILES, 1.0) as page:      # of spacecraft that stand still
        for bound in ("changes of a user", "messages"):
            page.room.bounds[bound] = 1e9
        live = await page.client.ws_connect("/api/live")
        while requests < CASES or time.monotonic() < UNTIL:
            requests += 1
            row = draw.choice(routes)
            word = draw.choice(WORDS[:-1]).encode(errors="surrogatepass").hex()
            path = filled(row.path, draw.choice("aaabbbx"), "".join(f"%{entry}" for entry in re.findall("..", word))
                          if 0 < len(word) < 200 and draw.random() < 0.5 else
                          draw.choice(["0", "3", "flight.control", "x"]))
            query = {key: draw.choice(WORDS[:9]).encode(errors="replace").decode() for key in
                     draw.sample(["before", "limit", "first", "names", "from_ns", "to_ns", "points", "name"], 2)}
            data = json.dumps(content(draw)).encode() if draw.random() < 0.8 else draw.randbytes(20)
            answer = await page.client.request(
                row.method, URL(path, encoded=True), params=query if draw.random() < 0.5 else {},
                data=None if row.method == "GET" else data, headers={
                    "X-Fledge-CSRF": page.csrf,     # aiohttp's client does not send the rest of a body that is refused
                    "Connection": "close" if len(data) > 200_000 else "keep-alive"})
            reply = await answer.text(errors="replace")
            assert answer.status < 500, (row, path, query, data, reply)
            assert answer.status == 200 or json.loads(reply)["error"], (row, path, reply)
            assert "html" not in answer.content_type or row.path == "/"
            text = json.dumps(content(draw) if draw.random() < 0.3 else {
                draw.choice([*MESSAGES]): draw.choice([content(draw), "b", {"craft": "b", **dict.fromkeys(
                    draw.sample(["slots", "hz", "truth"], 2), content(draw))}])})
            with suppress(ConnectionError):     # it has ended, as the answers say
                await (live.send_bytes(draw.randbytes(30)) if draw.random() < 0.2 else live.send_str(text))
                await live.send_str("{" if requests % 100 == 0 else "")
                sent += 1
            while requests % 100 == 0:     # the answers come in order, this one last
                message = await live.receive(PATIENCE)
                if message.type in (WSMsgType.CLOSE, WSMsgType.CLOSED):
                    assert live.close_code in (1008, 1009), (live.close_code, message)  # too many, or too large
                    live = await page.client.ws_connect("/api/live")
                    break
                assert message.type in (WSMsgType.TEXT, WSMsgType.BINARY), message
                if message.type == WSMsgType.TEXT and "a message is JSON" in message.data:
                    break
        print(f"{requests} requests, {sent} messages in {time.monotonic() - begun:.0f} s, seed {SEED}")
        with patch("fledge.ground.server.handlers.common.PATIENCE", PATIENCE):
            await page.client.post("/api/crafts/b/run", json={"action": "go", "speed": 1},
                                   headers={"X-Fledge-CSRF": page.csrf})
            await page.verified("b", "flight.write.control.K", {"K": 3})


def test_fuzzed_routes_and_messages_are_answered_with_words(tmp_path):
    asyncio.run(fuzzed(tmp_path))
