# SPDX-License-Identifier: Apache-2.0
"""Who may use the server, against a server on its sockets. FLEDGE_CASES=100000 fuzzes so many requests and messages."""
import asyncio
import json
import os
import random
import re
import socket
import ssl
import subprocess
import sys
import tomllib
import zlib
from contextlib import AsyncExitStack, nullcontext, suppress
from hashlib import sha256
from io import StringIO

import pytest
from aiohttp import (ClientError, ClientSession, CookieJar, StreamReader, WSMsgType, WSServerHandshakeError,
                     web)

from fledge import cli
from fledge.ground.server.access import PLAIN, ROLES, Access
from fledge.ground.server.guard import HEADERS, LOGGED, Guard
from fledge.ground.server.nothing_lost_test import DATABASE
from fledge.ground.server.passwords import hashed, scrypt, token
from fledge.ground.server.settings import read
from fledge.errors import SetupError
from fledge.ground.scripts.served import Served
from tests.waiting import PATIENCE

CASES = int(os.environ.get("FLEDGE_CASES", 300))
CHEAP = (16, 8, 1)      # of scrypt
TOKEN, TOKEN_HASH = token()
USERS = {"user": [
    {"name": "ada", "password": hashed("correct horse", CHEAP), "roles": ["view", "command"], "crafts": ["imager"]},
    {"name": "bob", "password": hashed("battery staple", CHEAP), "roles": ["view"]}],
    "token": [{"name": "night", "hash": TOKEN_HASH, "roles": ["view", "command"]}]}


class Server:
    """A small server behind a guard, a client of it, and the operators' log."""

    def __init__(self, table, folder):
        self._log, self.now = [], 0.0
        self.access = Access.read({"port": 0, **table}, folder)
        self.guard = Guard(self.access, lambda *entry: self._log.append(entry), lambda: self.now)
        self.received = []

    @property
    def log(self):
        self.guard.log.thread.submit(bool).result()    # what is written before
        return self._log

    async def __aenter__(self):
        app = web.Application(middlewares=[self.guard.middleware])
        self.guard.attach(app)
        app.router.add_get("/", self.page)
        app.router.add_get("/api/crafts", self.crafts)
        app.router.add_post("/api/crafts/{c}/send", self.send)
        app.router.add_get("/api/live", self.live)
        self.runner = await self.guard.listen(app)
        self.port = self.guard.connections.addresses[0][1]
        self.url = f"http{'s' if self.access.certificate else ''}://127.0.0.1:{self.port}"
        self.client = ClientSession(cookie_jar=CookieJar(unsafe=True))
        return self

    async def __aexit__(self, *_):
        await self.client.close()
        await self.runner.cleanup()

    async def page(self, request):
        return web.Response(text="<p>page", content_type="text/html")

    async def crafts(self, request):
        return web.json_response(["imager"])

    async def send(self, request):
        self.guard.require(request, request.match_info["c"], "command")
        self.received.append(await request.json())
        return web.json_response({"id": len(self.received)})

    async def live(self, request):
        socket = web.WebSocketResponse(max_msg_size=1 << 16)
        await socket.prepare(request)
        async for message in socket:
            if message.type not in (WSMsgType.TEXT, WSMsgType.BINARY):
                break
            try:
                await socket.send_json({"heard": json.loads(message.data)})
            except (ValueError, RecursionError):
                await socket.send_json({"error": "no JSON"})
        return socket

    async def ask(self, method, path, code=200, **given):
        async with self.client.request(method, self.url + path, **given) as answer:
            text = await answer.text()
            assert answer.status == code, text
            assert HEADERS.items() <= dict(answer.headers).items()
            return json.loads(text) if "json" in answer.content_type else text

    async def login(self, user, password, code=200):
        session = await self.ask("POST", "/api/login", code, json={"user": user, "password": password})
        return {"X-Fledge-CSRF": session.get("csrf", "")}

    def refusals(self):
        return [(user, details["why"]) for user, action, details in self.log if action == "refused"]


def served(tmp_path, table=USERS):
    """A decorator: run a coroutine with a server."""
    def decorate(does):
        async def run():
            async with Server(table, tmp_path) as server:
                await does(server)

        asyncio.run(asyncio.wait_for(run(), PATIENCE))

    return decorate


def test_without_users_this_machine_alone_is_the_operator(tmp_path):
    @served(tmp_path, {})
    async def _(server):
        session = await server.ask("GET", "/api/session")
        assert session["user"] == "operator" and session["roles"] == list(ROLES)
        csrf = {"X-Fledge-CSRF": session["csrf"]}
        assert await server.ask("POST", "/api/crafts/imager/send", json={"name": "noop"}, headers=csrf) == {"id": 1}
        assert ("operator", "POST /api/crafts/imager/send", {"body": {"name": "noop"}}) in server.log
        for headers, why in (({}, "X-Fledge-CSRF is missing"), ({"X-Fledge-CSRF": "\xff"}, "missing or old"),
                             ({**csrf, "Origin": "https://example.org"}, "a page of https://example.org"),
                             ({**csrf, "Origin": "null"}, "a page of null"),
                             ({**csrf, "Origin": f"http://127.0.0.1:{server.port + 1}"}, "may not do this"),
                             ({**csrf, "Host": f"example.org:{server.port}"}, "this server is localhost")):
            error = await server.ask("POST", "/api/crafts/imager/send", 403, json={}, headers=headers)
            assert why in error["error"]
        await server.ask("GET", "/api/crafts", 403, headers={"Sec-Fetch-Site": "cross-site"})       # as by an <img>
        await server.ask("GET", "/", headers={"Sec-Fetch-Site": "cross-site"})                      # a link to here
        await server.ask("GET", "/", 403, headers={"Host": "example.org"})      # a name that was made to lead here
        assert len(server.received) == 1 and len(server.refusals()) == 3        # at the 1st and the 10th of strangers
        await server.ask("POST", "/api/login", 400, json={"user": "a", "password": "b"}, headers=csrf)


def test_a_session_begins_and_ends(tmp_path):
    @served(tmp_path)
    async def _(server):
        assert "<p>page" in await server.ask("GET", "/")
        assert (await server.ask("GET", "/api/session"))["user"] is None
        await server.ask("GET", "/api/crafts", 401)
        csrf = await server.login("ada", "correct horse")
        assert await server.ask("GET", "/api/crafts") == ["imager"]
        assert (await server.ask("GET", "/api/session"))["crafts"] == ["imager"]
        await server.ask("POST", "/api/crafts/imager/send", json={}, headers=csrf)
        error = await server.ask("POST", "/api/crafts/other/send", 403, json={}, headers=csrf)
        assert error == {"error": "ada lacks the role 'command' for other"}
        stolen = {cookie.key: cookie.value for cookie in server.client.cookie_jar}
        assert len(stolen) == 2     # the session, and that this browser was ada
        for cookie in server.client.cookie_jar:
            assert cookie["httponly"] and cookie["samesite"] == "Strict" and cookie["path"] == "/"
        thief = {"Cookie": "; ".join(f"{name}={value}" for name, value in stolen.items())}
        async with ClientSession() as other:
            live = await other.ws_connect(f"{server.url}/api/live", headers=thief)
            await server.ask("POST", "/api/logout", 403)
            await server.ask("POST", "/api/logout", headers=csrf)
            assert (await asyncio.wait_for(live.receive(), PATIENCE)).type in (WSMsgType.CLOSED, WSMsgType.CLOSE)
            async with other.get(f"{server.url}/api/crafts", headers=thief) as answer:
                assert answer.status == 401
            with pytest.raises(WSServerHandshakeError, match="401"):
                await other.ws_connect(f"{server.url}/api/live", headers=thief)
        await server.ask("POST", "/api/crafts/imager/send", 401, json={}, headers={**thief, **csrf})
        csrf = await server.login("bob", "battery staple")
        await server.ask("POST", "/api/crafts/imager/send", 403, json={}, headers=csrf)
        assert ("bob", "bob lacks the role 'command' for imager") in server.refusals()
        assert [entry[:2] for entry in server.log if entry[1] != "refused"] == [
            ("ada", "logged in"), ("ada", "POST /api/crafts/imager/send"), ("ada", "POST /api/crafts/other/send"),
            ("ada", "session ended"), ("bob", "logged in"), ("bob", "POST /api/crafts/imager/send")]
        assert not any(word in str(server.log) for word in (*stolen.values(), "correct horse"))


@pytest.mark.long("waits for the end of a session")
def test_a_session_ends_by_itself(tmp_path):
    @served(tmp_path, {**USERS, "idle_min": 30})
    async def _(server):
        await server.login("ada", "correct horse")
        server.now += 29 * 60
        await server.ask("GET", "/api/crafts")
        live = await server.client.ws_connect(f"{server.url}/api/live")
        server.now += 31 * 60       # a page is open
        await server.ask("GET", "/api/crafts")
        await live.close()
        status = 0
        while status != 401:        # the server learns of it a little later
            server.now += 31 * 60
            async with server.client.get(f"{server.url}/api/crafts") as answer:
                status = answer.status
        assert server.log[-2][1:] == ("session ended", {"why": "it was idle"})

    @served(tmp_path, {**USERS, "session_h": 3 / 3600})
    async def _(server):
        live = None
        while not live:
            await server.login("ada", "correct horse")
            with suppress(WSServerHandshakeError):      # its time was over already
                live = await server.client.ws_connect(f"{server.url}/api/live")
        assert (await live.receive(PATIENCE)).type in (WSMsgType.CLOSED, WSMsgType.CLOSE)
        await server.ask("GET", "/api/crafts", 401)
        assert ("ada", "session ended", {"why": "its time was over"}) in server.log


def test_guesses_are_counted_by_address_and_by_name(tmp_path, monkeypatch):
    """The name's limit is the sum over addresses; monkeypatched, for a loopback has few."""
    here = ["192.0.2.1"]
    monkeypatch.setattr("fledge.ground.server.logins.network_of", lambda _: here[0])

    @served(tmp_path)
    async def _(server):
        for i in range(10):     # one's own login between them changes nothing
            if i % 3 == 2:
                await server.login("ada", "wrong", 401)
                await server.login("ada", "correct horse")
            await server.login("bob" if i % 2 else "carol", "wrong", 401)
        error = await server.ask("POST", "/api/login", 429, json={"user": "bob", "password": "battery staple"})
        assert error == {"error": "10 attempts have failed; try again in 601 s"}
        await server.ask("GET", "/api/crafts", 401, headers={"Authorization": f"Bearer {TOKEN}x"})
        await server.ask("GET", "/api/crafts", headers={"Authorization": f"Bearer {TOKEN}"})
        await server.login("ada", "correct horse")      # this browser was ada before
        server.now += 601
        await server.login("bob", "battery staple")

    @served(tmp_path)
    async def _(server):
        await server.login("ada", "correct horse")
        async with ClientSession() as thief:
            for i in range(40):
                here[0] = f"192.0.2.{i % 8}"
                async with thief.post(f"{server.url}/api/login", json={"user": "ada", "password": str(i)},
                                      headers={"Cookie": f"fledge-x-{server.port}=1"}) as answer:
                    assert answer.status == (401 if i < 30 else 429)
            here[0] = "192.0.2.99"
            given = {"user": "ada", "password": "correct horse"}
            async with thief.post(f"{server.url}/api/login", json=given) as response:
                assert response.status == 429 and "as 'ada'; a browser that was this user" in await response.text()
            here[0] = "127.0.0.1"       # by a tunnel
            async with thief.post(f"{server.url}/api/login", json=given) as response:
                assert response.status == 200
        await server.login("bob", "battery staple")
        await server.login("ada", "correct horse")      # not locked out by strangers
        for _ in range(10):
            await server.login("ada", "wrong", 401)     # yet a thief of the browser does not guess on
        await server.login("ada", "correct horse", 429)

    @served(tmp_path)
    async def _(server):        # a login of one's own frees no guesses of another's name, nor on the server's machine
        here[0] = "127.0.0.1"
        for i in range(10):
            await server.login("ada", f"wrong {i}", 401)
            if i % 4 == 3:
                await server.login("bob", "battery staple")
        await server.login("ada", "correct horse", 429)

    @served(tmp_path)
    async def _(server):        # all at once
        answers = await asyncio.gather(*[server.client.post(f"{server.url}/api/login", json={
            "user": "bob", "password": str(i)}) for i in range(20)])
        assert sum(answer.status == 401 for answer in answers) <= 10


@pytest.mark.parametrize("path", ["/", "/api/session", "/api/login"])
def test_no_body_is_decompressed(path, tmp_path):
    """Strangers would make gigabytes of 600 bytes."""
    @served(tmp_path)
    async def _(server):
        bomb = zlib.compress(bytes(1 << 20))
        method = "POST" if path.endswith("login") else "GET"
        taken = []
        whole = StreamReader.feed_data
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(StreamReader, "feed_data", lambda *given: taken.append(len(given[1])) or whole(*given))
            async with server.client.request(method, server.url + path, data=bomb, headers={
                    "Content-Encoding": "deflate"}) as answer:
                assert answer.status == 415 and "Content-Encoding" in await answer.text()
        assert max(taken) <= len(bomb)


@pytest.mark.parametrize("ends", ["logout", "removed", "token"])
def test_a_request_whose_body_comes_after_its_session_is_not_done(ends, tmp_path):
    @served(tmp_path)
    async def _(server):
        csrf = await server.login("ada", "correct horse")
        cookies = "; ".join(f"{cookie.key}={cookie.value}" for cookie in server.client.cookie_jar)
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write("\r\n".join([
            "POST /api/crafts/imager/send HTTP/1.1", f"Host: 127.0.0.1:{server.port}", "Content-Length: 2",
            *([f"Authorization: Bearer {TOKEN}"] if ends == "token" else
              [f"Cookie: {cookies}", f"X-Fledge-CSRF: {csrf['X-Fledge-CSRF']}"]), "", "{"]).encode())
        while not server.guard.bodies:     # it waits for the rest
            await asyncio.sleep(0.01)
        if ends == "logout":
            await server.ask("POST", "/api/logout", headers=csrf)
        else:
            server.guard.take(Access.read({"port": 0, "user": USERS["user"][1:]}, tmp_path))
        writer.write(b"}")
        assert (await asyncio.wait_for(reader.readline(), PATIENCE)).split()[1] == b"401"
        assert not server.received
        writer.close()


def test_scripts_have_tokens(tmp_path):
    @served(tmp_path)
    async def _(server):
        bearer = {"Authorization": f"Bearer {TOKEN}"}
        assert (await server.ask("GET", "/api/session", headers=bearer))["user"] == "night"
        await server.ask("POST", "/api/crafts/imager/send", json={}, headers=bearer)
        await server.ask("POST", "/api/crafts/imager/send", 403, json={},
                         headers={**bearer, "Origin": "https://example.org"})
        async with server.client.ws_connect(f"{server.url}/api/live", headers=bearer) as live:
            await live.send_str("[1]")
            assert await live.receive_json() == {"heard": [1]}
        await server.ask("GET", "/api/crafts", 401, headers={"Authorization": f"Basic {TOKEN}"})


def test_a_forged_origin_opens_no_websocket(tmp_path):
    @served(tmp_path)
    async def _(server):
        await server.login("ada", "correct horse")
        for origin in ("https://example.org", "null", f"https://127.0.0.1:{server.port}"):
            with pytest.raises(WSServerHandshakeError, match="403"):
                await server.client.ws_connect(f"{server.url}/api/live", headers={"Origin": origin})
        async with server.client.ws_connect(f"{server.url}/api/live", headers={"Origin": server.url}) as live:
            await live.send_str("2")
            assert await live.receive_json() == {"heard": 2}


@pytest.mark.parametrize("upgrade", ["websocket", "WebSocket\u00a0", "\u3000websocket", "websocket\x85"])
def test_every_socket_that_opens_ends_with_its_session(upgrade, tmp_path):
    @served(tmp_path)
    async def _(server):
        async def open_it(*more):
            reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            writer.write("\r\n".join([
                "GET /api/live HTTP/1.1", f"Host: 127.0.0.1:{server.port}", f"Upgrade: {upgrade}",
                "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
                *more, "", ""]).encode())
            return (await reader.readline()).split()[1], reader, writer

        csrf = await server.login("ada", "correct horse")
        cookies = "Cookie: " + "; ".join(f"{cookie.key}={cookie.value}" for cookie in server.client.cookie_jar)
        status, *_ = await open_it(cookies, "Origin: https://example.org")
        assert status == b"403"
        status, reader, writer = await open_it(cookies)
        assert status == b"101"
        await server.ask("POST", "/api/logout", headers=csrf)
        await asyncio.wait_for(reader.read(), PATIENCE)       # it ends
        writer.close()


def test_a_user_that_changes_in_the_file_is_logged_out(tmp_path):
    @served(tmp_path)
    async def _(server):
        def take(change):
            users = {kind: [dict(row) for row in USERS[kind]] for kind in USERS}
            change(users)
            return server.guard.take(Access.read({"port": 0, **users}, tmp_path))

        bearer = {"Authorization": f"Bearer {TOKEN}"}
        passwords = {"ada": "correct horse", "bob": "battery staple"}
        for change, gone, why in (
                (lambda users: users["user"][0].update(roles=["view"]), "ada", "its password, roles or spacecraft"),
                (lambda users: users["user"][0].update(crafts=["other"]), "ada", "its password, roles or spacecraft"),
                (lambda users: users["user"][0].update(password=hashed("correct horse", CHEAP)), "ada", "its password"),
                (lambda users: users["user"].pop(1), "bob", "the user was removed"),
                (lambda users: users["token"][0].update(roles=["view"]), "night", "its name, roles or spacecraft"),
                (lambda users: users["token"].clear(), "night", "the token was removed")):
            sockets, clients = {}, {}
            async with AsyncExitStack() as stack:
                for name, password in passwords.items():
                    client = clients[name] = await stack.enter_async_context(ClientSession(cookie_jar=CookieJar(
                        unsafe=True)))
                    async with client.post(f"{server.url}/api/login", json={"user": name, "password": password}) as ok:
                        assert ok.status == 200
                    sockets[name] = await client.ws_connect(f"{server.url}/api/live")
                clients["night"] = await stack.enter_async_context(ClientSession(headers=bearer))
                sockets["night"] = await clients["night"].ws_connect(f"{server.url}/api/live")
                assert take(change) is False
                assert (await sockets[gone].receive(PATIENCE)).type in (WSMsgType.CLOSED, WSMsgType.CLOSE)
                assert server.log[-1][0] == gone and server.log[-1][2]["why"].startswith(why), server.log
                for name, client in clients.items():
                    async with client.get(f"{server.url}/api/crafts") as answer:
                        assert answer.status == (401 if name == gone and not why.startswith("its name") else 200)
                    if name != gone:
                        await sockets[name].send_str("1")
                        assert await sockets[name].receive_json(timeout=PATIENCE) == {"heard": 1}
                take(lambda users: None)
        more = {"port": 0, **USERS, "host": "::1"}
        assert server.guard.take(Access.read(more, tmp_path)) and server.guard.access.host == "127.0.0.1"

    @served(tmp_path, {})
    async def _(server):        # open to this machine until it has users
        live = await server.client.ws_connect(f"{server.url}/api/live")
        server.guard.take(Access.read(USERS, tmp_path))
        assert (await live.receive(PATIENCE)).type in (WSMsgType.CLOSED, WSMsgType.CLOSE)
        await server.ask("GET", "/api/crafts", 401)


def test_tokens_and_passwords_of_other_machines(tmp_path):
    """This machine's address on a network stands for another machine: the server sees where a request comes from."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))     # sends nothing
            address = probe.getsockname()[0]
        except OSError:
            pytest.skip("this machine has no network")

    @served(tmp_path, {**USERS, "host": "0.0.0.0", "plain_http": PLAIN})
    async def _(server):
        bearer = {"Authorization": f"Bearer {TOKEN}"}
        await server.ask("GET", "/api/crafts", headers=bearer)
        server.url = f"http://{address}:{server.port}"
        error = await server.ask("GET", "/api/crafts", 403, headers=bearer)
        assert error["error"].startswith("a token does not come over plain HTTP from another machine")
        for target in (f"https://localhost:{server.port}/api/crafts", "https:///api/crafts", "wss://localhost/x"):
            reader, writer = await asyncio.open_connection(address, server.port)
            writer.write("\r\n".join([f"GET {target} HTTP/1.1", f"Host: {address}",
                                      f"Authorization: Bearer {TOKEN}", "", ""]).encode())
            assert (await reader.readline()).split()[1] in (b"400", b"403"), target
            writer.close()
        await server.login("ada", "correct horse")
        await server.ask("GET", "/api/crafts")
        assert all(cookie["httponly"] and cookie["samesite"] == "Strict" and not cookie["secure"]
                   for cookie in server.client.cookie_jar)
        with pytest.raises(SetupError, match=r"open to a network, at 0.0.0.0, and needs \[\[user\]\]"):
            server.guard.take(Access.read({}, tmp_path))
        await server.ask("GET", "/api/crafts")
        for sent, where in (("http", address), ("http", "room.example"), ("ws", address)):
            with pytest.raises(SetupError, match="a token passes there so that others may read it; use"):
                Served(f"{sent}://{where}:{server.port}/imager", TOKEN)


def certificate(folder):
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", folder / "key.pem", "-out",
                    folder / "server.pem", "-days", "2", "-subj", "/CN=localhost", "-addext",
                    "subjectAltName=IP:127.0.0.1"], check=True, capture_output=True)
    return {"certificate": "server.pem", "key": "key.pem"}


def test_handshakes_count_as_connections_and_end(tmp_path):
    files = certificate(tmp_path)

    @served(tmp_path, {**USERS, **files})
    async def _(server):
        trust = {"ssl": ssl.create_default_context(cafile=tmp_path / "server.pem")}
        bounds = server.guard.bounds
        bounds["connections of an address"], bounds["first request"] = 20, PATIENCE
        opened = [await asyncio.open_connection("127.0.0.1", server.port) for _ in range(40)]
        opened[0][1].write(b"\x16\x03\x01\x02\x00\x01")       # the begin of a handshake
        ended = await asyncio.gather(*[asyncio.wait_for(reader.read(), PATIENCE) for reader, _ in opened[20:]],
                                     return_exceptions=True)
        assert all(end == b"" or isinstance(end, ConnectionError) for end in ended)
        assert len(server.guard.connections.handshakes) == 20
        with pytest.raises(ClientError):
            await server.client.get(f"{server.url}/api/session", **trust)
        for _, writer in opened:
            writer.close()
        while server.guard.connections.handshakes:
            await asyncio.sleep(0.01)
        bounds["first request"] = 0.2
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(b"\x16\x03\x01\x02\x00\x01")
        with suppress(ConnectionError):
            assert await reader.read() == b""       # it ends
        writer.close()
        assert not server.guard.connections.handshakes
        bounds["first request"] = PATIENCE
        async with server.client.get(f"{server.url}/api/session", **trust) as answer:
            assert answer.status == 200


def test_a_renewed_certificate_counts_at_once(tmp_path):
    files = certificate(tmp_path)

    @served(tmp_path, {**USERS, **files})
    async def _(server):
        old = ssl.create_default_context(cafile=tmp_path / "server.pem")
        await server.ask("GET", "/api/session", ssl=old)
        certificate(tmp_path)
        assert not server.guard.take(Access.read({"port": 0, **USERS, **files}, tmp_path))
        async with ClientSession() as other:
            async with other.get(f"{server.url}/api/session",
                                 ssl=ssl.create_default_context(cafile=tmp_path / "server.pem")) as answer:
                assert answer.status == 200
            with pytest.raises(ClientError, match="certificate verify failed"):
                await other.get(f"{server.url}/api/session", ssl=old)
        assert server.guard.take(Access.read({"port": 0, **USERS}, tmp_path))   # TLS goes on
        assert server.guard.access.certificate == tmp_path / "server.pem"


def test_a_key_that_others_may_read_is_refused(tmp_path):
    files = certificate(tmp_path)
    for mode in (0o640, 0o604, 0o602, 0o644):
        (tmp_path / "key.pem").chmod(mode)
        with pytest.raises(SetupError, match=r"others may read or change .*key\.pem: chmod 600 .*key\.pem keeps"):
            Access.read({**files, **USERS}, tmp_path)
    for mode in (0o600, 0o400):
        (tmp_path / "key.pem").chmod(mode)
        Access.read({**files, **USERS}, tmp_path)


def test_tls(tmp_path):
    files = certificate(tmp_path)

    @served(tmp_path, {**USERS, **files, "host": "0.0.0.0"})
    async def _(server):
        trust = {"ssl": ssl.create_default_context(cafile=tmp_path / "server.pem")}
        async with server.client.post(f"{server.url}/api/login", **trust,
                                      json={"user": "ada", "password": "correct horse"}) as answer:
            cookies = answer.headers.getall("Set-Cookie")
        assert len(cookies) == 2 and "Strict-Transport-Security" in answer.headers
        assert all(cookie.startswith("__Host-fledge-") and "Secure" in cookie for cookie in cookies)
        async with server.client.get(f"{server.url}/api/crafts", **trust) as answer:
            assert answer.status == 200
        for cipher in ("ECDHE-RSA-AES128-GCM-SHA256", "ECDHE-RSA-CHACHA20-POLY1305", "AES128-SHA", "AES128-GCM-SHA256",
                       "DHE-RSA-AES128-GCM-SHA256", "ECDHE-RSA-AES128-SHA"):
            old = ssl.create_default_context(cafile=tmp_path / "server.pem")
            old.maximum_version = ssl.TLSVersion.TLSv1_2
            old.set_ciphers(cipher)
            with nullcontext() if cipher.startswith("ECDHE") and cipher[-3:] != "SHA" else \
                    pytest.raises(ClientError, match="handshake failure|Cannot connect"):
                async with server.client.get(f"{server.url}/api/session", ssl=old):
                    pass

    for table, says in (({"host": "0.0.0.0"}, r"needs certificate and key, for TLS \(or plain_http = \"everybody"),
                        ({"host": "0.0.0.0", "plain_http": PLAIN}, r"needs \[\[user\]\] or"),
                        ({"plain_http": "yes"}, f"plain_http is \"{PLAIN}\", and instead .*found 'yes'"),
                        ({"plain_http": PLAIN, **files}, "beside them"),
                        ({"host": "::", **files}, r"needs \[\[user\]\] or \[\[token\]\]"),
                        ({"host": "0.0.0.0", **USERS}, "needs certificate and key, for TLS .*; without"),
                        ({"certificate": "key.pem", "key": "key.pem"}, "cannot be used"),
                        ({"certificate": "none.pem", "key": "key.pem"}, "No such file"),
                        ({"certificate": "server.pem"}, "belong together")):
        with pytest.raises(SetupError, match=says):
            Access.read(table, tmp_path)


def test_hundreds_of_connections_are_refused_beyond_the_limit(tmp_path):
    @served(tmp_path)
    async def _(server):
        server.guard.bounds["connections"], server.guard.bounds["connections of an address"] = 60, 40
        server.guard.bounds["first request"] = 300
        served, opened = 0, []
        for _ in range(4):      # below 1024 files, which a process may open, with both of their ends
            opened += await asyncio.gather(*[asyncio.open_connection("127.0.0.1", server.port) for _ in range(100)])
        for reader, writer in opened:
            writer.write(b"GET /api/session HTTP/1.1\r\nHost: localhost\r\n\r\n")
            with suppress(ConnectionError):
                served += b" 200 " in await reader.readline()
        for _, writer in opened:
            writer.close()
        assert served == 40
        assert [entry[2]["times"] for entry in server.log] == [1, 10, 100]
        await server.ask("GET", "/api/session")


def test_a_client_that_reads_nothing_or_does_not_log_in_loses_its_place(tmp_path):
    """Connections that ask again and again and read nothing, and those that only look at the login."""
    @served(tmp_path)
    async def _(server):
        bounds = server.guard.bounds
        bounds["connections of an address"], bounds["first request"] = 8, 300
        ask = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
        deaf = []
        for bounds["requests at once"], bounds["unread"] in ((10**9, 0.3), (64, 4)):
            for _ in range(8):
                deaf.append(await asyncio.open_connection("127.0.0.1", server.port, limit=1))
            while len(server.guard.connections.all()) < 8:
                await asyncio.sleep(0.02)
            with pytest.raises(ClientError):
                await server.ask("GET", "/api/session")
            for _, writer in deaf[-8:]:
                writer.write(ask * 5_000)
            while server.guard.connections.all():
                await asyncio.sleep(0.02)
        assert bounds.all["requests at once"].refused > 4       # or they were deaf for too long already
        bounds["connection without a login"] = 0.5
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        with suppress(ConnectionError):
            while True:
                writer.write(ask)
                if not await reader.readline():
                    break
                await asyncio.sleep(0.05)
        assert bounds.all["connection without a login"].refused == 1
        for _, writer in deaf:
            writer.close()


def test_a_user_fills_neither_journal_nor_memory(tmp_path):
    @served(tmp_path, {})
    async def _(server):
        csrf = {"X-Fledge-CSRF": (await server.ask("GET", "/api/session"))["csrf"]}
        for _ in range(100):
            await server.ask("POST", "/api/none", 404, data=b"x" * 1000, headers=csrf)
        bounds, there = server.guard.bounds, len(server.log)
        assert there == bounds["refusals of a user"] + 2 and server.log[-1][2]["times"] == 10
        bounds["changes of a user"] = 5
        for i in range(8):
            await server.ask("POST", "/api/crafts/imager/send", 200 if i < 5 else 429, json={}, headers=csrf)
        assert len(server.log) == there + 5 + 1     # the 1st of those beyond
        server.now += 61
        await server.ask("POST", "/api/crafts/imager/send", json={}, headers=csrf)
        bounds["bodies at once"] = 100
        await server.ask("POST", "/api/crafts/imager/send", 429, data=b" " * 101, headers=csrf)
        assert server.guard.bodies == 0


def test_slow_and_large_requests_end(tmp_path):
    @served(tmp_path, {})
    async def _(server):
        bounds = server.guard.bounds
        bounds["first request"] = 0.2
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(b"GET / HTTP/1.1\r\n")
        with pytest.raises(ConnectionError):
            assert await reader.read() == b""
            raise ConnectionError
        bounds["first request"], bounds["time of a body"] = 60, 0.2
        session = await server.ask("GET", "/api/session")
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(b"POST /api/crafts/imager/send HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n"
                     b"X-Fledge-CSRF: " + session["csrf"].encode() + b"\r\n\r\n{")
        assert b" 408 " in await reader.readline()
        writer.close()
        bounds["time of a body"] = 60
        csrf = {"X-Fledge-CSRF": session["csrf"]}
        await server.ask("POST", "/api/crafts/imager/send", 413, data=b" " * (int(bounds["body"]) + 1), headers=csrf)
        for path, headers in (("/", {"A": "x" * 9000}), ("/" + "x" * 9000, {}),
                              ("/", {f"A{i}": "x" for i in range(200)})):
            async with server.client.get(server.url + path, headers=headers) as answer:
                assert answer.status == 400
        assert not server.received

    @served(tmp_path)
    async def _(server):
        await server.ask("POST", "/api/login", 413, data=b" " * (LOGGED + 1))
        await server.ask("POST", "/api/login", 400, json={"user": "ada", "password": "\ud800"})
        for wrong in (b"", b"[]", b"{}", b"[" * LOGGED, b'{"user": 1, "password": []}', b"\xff"):
            await server.ask("POST", "/api/login", 400, data=wrong)


def test_fuzzed_requests_and_messages(tmp_path):
    """Whatever comes, the server answers the next one, no user gets further than allowed, and nothing ends in a 500."""
    draw = random.Random(5)
    lines = [b"GET /api/crafts HTTP/1.1", b"POST /api/login HTTP/1.1", b"POST /api/crafts/imager/send HTTP/1.1",
             b"GET /api/live HTTP/1.1", b"Host: localhost", b"Host: [::1", b"Host: localhost:x", b"Content-Length: 3",
             b"Content-Length: -1", b"Transfer-Encoding: chunked", b"Upgrade: websocket", b"Connection: Upgrade",
             b"Sec-WebSocket-Version: 13", b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==", b"Origin: http://[",
             b"Authorization: Bearer \xff", b"Cookie: fledge-0=\xff; ;=;", b"Content-Encoding: gzip",
             b"Expect: 100-continue", b"X-Fledge-CSRF: x", b"Content-Type: application/json; charset=\xff"]

    def mutated(data):
        for _ in range(draw.randrange(4)):
            at = draw.randrange(len(data) + 1)
            data = data[:at] + draw.randbytes(draw.randrange(4)) + data[at + draw.randrange(3):]
        return data

    @served(tmp_path)
    async def _(server):
        for _ in range(CASES):
            server.now += 601
            head = b"\r\n".join([draw.choice(lines[:4]), *draw.sample(lines[4:], draw.randrange(8))])
            reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            writer.write(mutated(head + b"\r\n\r\n" + draw.choice([b"", b"{}", b"3\r\n{}\n\r\n0\r\n\r\n"])))
            writer.write_eof()
            try:
                answer = await reader.read(1 << 16)
            except ConnectionError:
                answer = b""
            writer.close()
            assert b'["imager"]' not in answer and b" 101 " not in answer[:20] and b" 500 " not in answer[:20], answer
        assert not server.received
        await server.login("ada", "correct horse")
        live = await server.client.ws_connect(f"{server.url}/api/live")
        for _ in range(CASES):
            if live.closed:
                live = await server.client.ws_connect(f"{server.url}/api/live")
            data = mutated(b'{"subscribe": {"craft": "imager", "slots": [1, 2]}}')
            try:
                if draw.randrange(8) == 0:
                    live._writer.transport.write(data)      # no frames at all
                    live._writer.transport.write_eof()
                    await live.receive(PATIENCE)
                    await live.close()
                elif draw.randrange(2):
                    await live.send_bytes(data)
                    await live.receive(PATIENCE)
                else:
                    await live.send_str(data.decode(errors="replace"))
                    await live.receive(PATIENCE)
            except ConnectionError:
                await live.close()
        await server.ask("GET", "/api/crafts")


@pytest.mark.parametrize("table, says", [
    ({"host": 5}, "host is an address"), ({"port": "80"}, "port is a number"), ({"port": 70000}, "found 70000"),
    ({"session_h": 0}, "session_h is a number above 0"), ({"idle_min": float("nan")}, "idle_min"),
    ({"user": {}}, r"user is a table \[\[user\]\]"), ({"user": [{"name": ""}]}, "user 1: name is a text"),
    ({"user": [{**USERS["user"][0], "role": 1}]}, "user ada: there is no 'role'; did you mean 'roles'?"),
    ({"user": [{**USERS["user"][0], "roles": ["fly"]}]}, "roles is a list of view, command, administer; found"),
    ({"user": [{**USERS["user"][0], "crafts": "imager"}]}, "crafts is a list of names"),
    ({"user": [{**USERS["user"][0], "password": "correct horse"}]}, "no line of `fledge ground password`"),
    ({"user": [{**USERS["user"][0], "password": "scrypt:3:8:1:AA:AA"}]}, "no line of `fledge ground password`"),
    ({"user": [USERS["user"][0]] * 2}, "two of this name"), ({"user": [5]}, "user 1: name"),
    ({"token": [{**USERS["token"][0], "hash": TOKEN}]}, "token night: hash is no line of `fledge ground token`")])
def test_a_wrong_file_is_refused(table, says, tmp_path):
    with pytest.raises(SetupError, match=says):
        Access.read(table, tmp_path)


def test_a_password_is_not_in_its_line():
    line = hashed("correct horse", CHEAP)
    assert "horse" not in line and line != hashed("correct horse", CHEAP)
    # RFC 7914, chapter 12
    assert scrypt("pleaseletmein", b"SodiumChloride", 1 << 14, 8, 1).hex().startswith("7023bdcb3afd7348461c06cd81fd38")


def test_the_lines_of_the_command_are_what_the_file_takes(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.stdin", StringIO("correct horse\n"))
    assert cli.main(["ground", "password"]) == 0
    line = capsys.readouterr().out
    assert cli.main(["ground", "token", 'a "script"']) == 0
    comment, tables = capsys.readouterr().out.split("\n", 1)
    access = Access.read(tomllib.loads(f'{tables}\n[[user]]\nname = "ada"\nroles = ["view"]\n{line}'), tmp_path)
    assert access.users["ada"].password.fits("correct horse") and not access.users["ada"].password.fits("battery")
    assert access.tokens[sha256(comment.split()[-1].encode()).hexdigest()].name == 'a "script"'
    monkeypatch.setattr("sys.stdin", StringIO("short\n"))
    assert cli.main(["ground", "password"]) == 2 and "10 to 1024 characters; found 5" in capsys.readouterr().err


class Program:
    """`fledge ground serve` of a file with users, which others of this machine may read by the umask, if they may."""

    def __init__(self, folder, users=USERS, mode=0o600):
        self.file = folder / "ground.toml"
        (folder / "craft.xml").write_text(DATABASE)
        self.write(users, mode)
        self.process = subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", "ground", "serve", self.file],
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, umask=0o022)
        self.output = []
        for line in self.process.stdout:
            self.output.append(line)
            if address := re.search(r"http://[\w.:]+", line):
                self.url = address[0]
                break

    def write(self, users, mode=0o600, more=""):
        craft = '[[craft]]\nname = "imager"\ndatabase = "craft.xml"\nlink = "tcp://127.0.0.1:9"\n'
        tables = "".join(f"[[{kind}]]\n" + "".join(f"{key} = {json.dumps(user[key])}\n" for key in user)
                         for kind in users for user in users[kind])
        new = self.file.with_suffix(".new")
        new.write_text(f'port = 0\nfolder = "out/of/it"\n{more}\n{craft}{tables}')
        new.chmod(mode)
        new.replace(self.file)

    def end(self):
        self.process.terminate()
        self.output += self.process.stdout.read().splitlines()
        return self.process.wait()


def test_a_server_follows_its_file_and_keeps_what_it_writes(tmp_path):
    program = Program(tmp_path)
    rows = [tmp_path / "out", *(tmp_path / "out").rglob("*")]
    assert len(rows) > 5 and not [path for path in rows if path.stat().st_mode & 0o77], rows

    async def run():
        async with ClientSession(program.url, cookie_jar=CookieJar(unsafe=True)) as ada, \
                ClientSession(program.url, headers={"Authorization": f"Bearer {TOKEN}"}) as night:
            async def logged(words):
                while True:
                    async with night.get("/api/log") as answer:
                        if rows := [row for row in await answer.json() if words in row["text"]]:
                            return rows[0]
                    await asyncio.sleep(0.1)

            async with ada.post("/api/login", json={"user": "ada", "password": "correct horse"}) as answer:
                assert answer.status == 200
            live = await ada.ws_connect("/api/live")
            program.write(USERS, more="session_h = true")
            assert "refused, users and tokens stay: " in (await logged("session_h is a number"))["text"]
            program.write(USERS, mode=0o644)
            await logged("others may read or change")
            async with ada.get("/api/crafts") as answer:
                assert answer.status == 200
            program.write({**USERS, "user": USERS["user"][1:]}, more="idle_min = 5")
            while (await live.receive(PATIENCE)).type not in (WSMsgType.CLOSED, WSMsgType.CLOSE):
                pass
            async with ada.get("/api/crafts") as answer:
                assert answer.status == 401
            assert (await logged("the user was removed"))["user"] == "ada"
            assert "as it says now" in (await logged("ground.toml has changed, users"))["text"]
            program.write(USERS, more='[postgres]\nurl = "postgresql://nowhere/x"')
            await logged("counts when the server starts again")
            async with night.get("/api/crafts/imager/events") as answer:
                events = await answer.json()
            sources = [(event["severity"], event["source"]) for event in events]
            assert "session_h" not in str(events), "it may name what not all may see"
            assert sources.count(("critical", "users")) == 2 and sources.count(("info", "users")) == 2

    try:
        asyncio.run(asyncio.wait_for(run(), PATIENCE))
    finally:
        assert program.end() == 0, program.output


def test_files_that_others_may_read_are_refused_or_named(tmp_path):
    def guarded(users=USERS, mode=0o600):
        program.write(users, mode)
        return read(program.file).guarded()

    program = Program(tmp_path, mode=0o640)
    assert program.end() == 2 and f"chmod 600 {program.file}" in program.output[-1], program.output
    inner = tmp_path / "out/of/it"
    assert guarded() == []
    inner.mkdir(parents=True)
    (inner / "journal.sqlite").touch(0o666)
    readable = [f"others may read {inner}: chmod -R go= {inner} keeps it its owner's"]
    for mode, of_journal, says in ((0o755, 0o644, readable), (0o700, 0o666, []), (0o770, 0o600, None),
                                   (0o757, 0o600, None), (0o755, 0o664, None)):
        inner.chmod(mode)
        (inner / "journal.sqlite").chmod(of_journal)
        if says is None:
            with pytest.raises(SetupError, match=f"others may change {inner}.*, where .*: chmod -R go-w {inner}"):
                guarded()
        else:
            assert guarded() == says
        assert guarded({}, 0o644) == []     # open to all of this machine anyway
    for url, open_to in (("postgresql://fledge@db/x", []), ("postgresql://fledge:word@db/x", None),
                         ("host=db password=word", None)):
        program.write({}, 0o644, f'[postgres]\nurl = "{url}"')
        with nullcontext() if open_to == [] else pytest.raises(SetupError, match="for it has passwords"):
            assert read(program.file).guarded() == open_to
