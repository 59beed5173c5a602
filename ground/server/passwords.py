# SPDX-License-Identifier: Apache-2.0
"""Passwords and tokens, as the server's file knows them: by what they are checked with (RFC 7914, SHA-256).

    line = hashed("correct horse")              # "scrypt:32768:8:3:...", of a [[user]]
    Password.read(line, "user ada").fits("correct horse")
    word, kept = token()                        # kept: "sha256:...", of a [[token]]
"""
from __future__ import annotations

import hashlib
import hmac
import secrets
from base64 import urlsafe_b64decode, urlsafe_b64encode
from binascii import Error as NotBase64
from dataclasses import dataclass
from typing import Any

from fledge.errors import SetupError

COST = (1 << 15, 8, 3)              # n, r, p of scrypt: 32 MiB, about 0.3 s
PASSWORD_LEAST, PASSWORD_MOST = 10, 1024            # characters


def hashed(password: str, cost: tuple[int, int, int] = COST) -> str:
    """The text by which the server's file knows a password (RFC 7914)."""
    salt = secrets.token_bytes(16)
    return ":".join(["scrypt", *map(str, cost), _text(salt), _text(scrypt(password, salt, *cost))])


def token() -> tuple[str, str]:
    """(a new token, its hash in the server's file)."""
    word = f"fledge_{secrets.token_urlsafe(32)}"
    return word, f"sha256:{digest(word)}"


def digest(text: str) -> str:
    return hashlib.sha256(text.encode(errors="replace")).hexdigest()


def _text(data: bytes) -> str:
    return urlsafe_b64encode(data).decode().rstrip("=")


def _bytes(text: str) -> bytes:
    return urlsafe_b64decode(text + "=" * (-len(text) % 4))


def scrypt(password: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(password.encode(errors="replace"), salt=salt, n=n, r=r, p=p, maxmem=256 * r * (n + p + 2))


@dataclass(frozen=True)
class Password:
    """What an entered password is compared with."""

    cost: tuple[int, int, int]
    salt: bytes
    key: bytes

    @classmethod
    def read(cls, text: Any, where: str) -> Password:
        try:
            kind, n, r, p, salt, key = text.split(":")
            password = cls((int(n), int(r), int(p)), _bytes(salt), _bytes(key))
            n, r, p = password.cost
            if kind == "scrypt" and n & n - 1 == 0 and 1 < n <= 1 << 20 and 0 < r * p <= 64 and len(password.key) == 64:
                return password
        except (AttributeError, ValueError, NotBase64):
            pass
        raise SetupError(f"{where}: password is no line of `fledge ground password`, which begins with \"scrypt:")

    def proof(self) -> str:
        """What a browser gets that has logged in by it: no other browser has it, and a new password ends it."""
        return hmac.digest(self.key, b"a browser of this user", "sha256").hex()

    def fits(self, password: str) -> bool:
        return hmac.compare_digest(scrypt(password, self.salt, *self.cost), self.key)
