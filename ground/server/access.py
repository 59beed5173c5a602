# SPDX-License-Identifier: Apache-2.0
"""Where the server listens, and its users and tokens: the keys of its file for both.

    host = "0.0.0.0"                # without it, this machine alone
    certificate = "server.pem"      # PEM, with its chain; and its key, which only its owner may read
    key = "server.key"              # instead of both: plain_http = "everybody on this network may read what passes"
    session_h = 12                  # after which a user logs in again; idle_min = 30 without a request or a live page
    [[user]]
    name = "ada"
    password = "scrypt:..."         # `fledge ground password` prints the line
    roles = ["view", "command"]     # of view, command, administer
    crafts = ["imager"]             # the roles hold for these alone; without it, for all
    [[token]]                       # `fledge ground token NAME` prints both; a script sends "Authorization: Bearer ..."
    name = "night pass"
    hash = "sha256:..."
    roles = ["view"]

Without users and tokens everybody on this machine is "operator" with all roles.
"""
from __future__ import annotations

import os
import ssl
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fledge.errors import SetupError, did_you_mean, listed
from fledge.ground.server.passwords import Password
from fledge.loopback import is_loopback

ROLES = ("view", "command", "administer")
KEYS = {"host", "port", "certificate", "key", "plain_http", "session_h", "idle_min", "user", "token"}  # of its file
PLAIN = "everybody on this network may read what passes"
PORT = 8080
NAMES = ("localhost", "127.0.0.1", "::1")


@dataclass(frozen=True)
class User:
    """A person or a script."""

    name: str
    roles: frozenset[str]
    crafts: frozenset[str] | None = None            #: None: all
    password: Password | None = field(default=None, repr=False)

    def may(self, craft: str | None, role: str) -> bool:
        """Whether a role holds for a craft; for None, for any."""
        return role in self.roles and (craft is None or self.knows(craft))

    def knows(self, craft: str) -> bool:
        """Whether its roles hold for a craft."""
        return self.crafts is None or craft in self.crafts


OPERATOR = User("operator", frozenset(ROLES))


@dataclass(frozen=True)
class Access:
    """Where the server listens, and the users and tokens that it accepts."""

    host: str = NAMES[1]
    port: int = PORT
    certificate: Path | None = None
    key: Path | None = None
    plain: bool = False             #: plain HTTP: the file accepts that others may read it
    session_s: float = 12 * 3600.0
    idle_s: float = 30 * 60.0
    users: dict[str, User] = field(default_factory=dict)
    tokens: dict[str, User] = field(default_factory=dict)       #: by the token's hash

    @classmethod
    def read(cls, table: dict[str, Any], folder: Path) -> Access:
        """Read the server's file; its other keys are ignored. folder: of its relative paths. Raises SetupError."""
        def given(name: str, kinds: type | tuple[type, ...], default: Any, expected: str) -> Any:
            value = table.get(name, default)
            if name in table and (not isinstance(value, kinds) or isinstance(value, bool)):
                raise SetupError(f"{name} is {expected}; found {value!r}")
            return value

        host = given("host", str, NAMES[1], "an address of this machine, as \"127.0.0.1\"")
        port = given("port", int, PORT, "a number from 0 to 65535")
        if not 0 <= port < 1 << 16:
            raise SetupError(f"port is a number from 0 to 65535; found {port}")
        times = [given(name, (int, float), default, "a number above 0")
                 for name, default in (("session_h", 12), ("idle_min", 30))]
        for name, value in zip(("session_h", "idle_min"), times):
            if not 0 < value < 1e5:
                raise SetupError(f"{name} is a number above 0; found {value}")
        files = [given(name, str, None, "the path of a PEM file") for name in ("certificate", "key")]
        if (files[0] is None) != (files[1] is None):
            raise SetupError("certificate and key belong together; found one of them")
        plain = given("plain_http", str, None, f"\"{PLAIN}\"")
        if plain not in (None, PLAIN) or plain and files[0]:
            raise SetupError(f"plain_http is \"{PLAIN}\", and instead of certificate and key; found {plain!r}"
                             + " beside them" * bool(files[0]))
        users = {user.name: user for user in _people(given("user", list, [], "a table [[user]]"), "user")}
        tokens: dict[str, User] = {}
        for entry, user in zip(table.get("token", []), _people(given("token", list, [], "a table [[token]]"), "token")):
            kind, _, digest = str(entry.get("hash")).partition(":")
            if kind != "sha256" or len(digest) != 64 or set(digest) - set("0123456789abcdef"):
                raise SetupError(f"token {user.name}: hash is no line of `fledge ground token`, which begins with "
                                 "\"sha256:")
            tokens[digest] = user
        if not is_loopback(host) and not ((files[0] or plain) and (users or tokens)):
            lacks = [what for what, there in ((f"certificate and key, for TLS (or plain_http = \"{PLAIN}\")",
                                               files[0] or plain),
                                              ("[[user]] or [[token]]", users or tokens)) if not there]
            raise SetupError(f"host = \"{host}\" opens the server to a network, which needs {' and '.join(lacks)}; "
                             "without host it is open to this machine alone")
        certificate, key = [folder / file if file else None for file in files]
        access = cls(host, port, certificate, key, bool(plain), times[0] * 3600.0, times[1] * 60.0, users, tokens)
        access.tls()
        return access

    @property
    def closed(self) -> bool:
        """Whether the server asks for a login or a token."""
        return bool(self.users or self.tokens)

    def tls(self) -> ssl.SSLContext | None:
        """The context of TLS, if the server has a certificate. Raises SetupError."""
        if not self.certificate or not self.key:
            return None
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.set_ciphers("ECDHE+AESGCM:ECDHE+CHACHA20")      # of TLS 1.2: who learns the key reads nothing older
        try:
            context.load_cert_chain(self.certificate, self.key, password=lambda: "")
        except OSError as error:
            raise SetupError(f"certificate {self.certificate} and key {self.key} cannot be used: "
                             f"{error.strerror or error}") from None
        own(self.key, "it is a secret key; if they might have, make a new one")
        return context


def own(path: Path, why: str) -> None:
    """Refuse a file of secrets that others may read. As ssh has it, a file of another owner, as root's, may be read by
    a group. Raises SetupError."""
    status = path.stat()
    if status.st_mode & (0o77 if status.st_uid == os.geteuid() else 0o37):
        raise SetupError(f"others may read or change {path}: chmod 600 {path} keeps it its owner's, for {why}")


def _people(entries: list[Any], kind: str) -> list[User]:
    known = {"name", "roles", "crafts", "password" if kind == "user" else "hash"}
    users: list[User] = []
    for place, entry in enumerate(entries, 1):
        name = entry.get("name") if isinstance(entry, dict) else None
        if not isinstance(name, str) or not 0 < len(name) <= 100 or not name.isprintable():
            raise SetupError(f"{kind} {place}: name is a text of 1 to 100 characters; found {name!r}")
        where = f"{kind} {name}"
        for key in entry:
            if key not in known:
                raise SetupError(f"{where}: there is no '{key}'{did_you_mean(key, known)} there is "
                                 + listed(sorted(known)))
        roles, crafts = entry.get("roles"), entry.get("crafts")
        if not isinstance(roles, list) or not roles or not set(map(str, roles)) <= set(ROLES):
            raise SetupError(f"{where}: roles is a list of {listed(ROLES)}; found {roles!r}")
        if crafts is not None and (not isinstance(crafts, list) or not all(isinstance(craft, str) for craft in crafts)):
            raise SetupError(f"{where}: crafts is a list of names; found {crafts!r}")
        if any(user.name == name for user in users):
            raise SetupError(f"{where}: there are two of this name")
        users.append(User(name, frozenset(roles), None if crafts is None else frozenset(crafts),
                          Password.read(entry.get("password"), where) if kind == "user" else None))
    return users
