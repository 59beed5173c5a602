# SPDX-License-Identifier: Apache-2.0
"""Keys for co-simulations beyond one machine: pairs in files, and the nodes that each key may take part as.

The files are ZeroMQ's certificates; cosim/security/keys.h describes their folders and their readers. And the keys of
radio links.
"""
from __future__ import annotations

import hashlib
import os
import re
import secrets
from collections.abc import Sequence
from pathlib import Path

from fledge.disk import Part

CONTROLLER = "controller"
_KEY = re.compile(r"[0-9a-zA-Z.\-:+=^!/*?&<>()\[\]{}@%$#]{40}")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


class KeysError(RuntimeError):
    """What is wrong with a key, with its file and what to do."""


class Key:
    """A file of a key: name (that its writer gave it), public, secret (None in a file that goes to others), nodes (of
    an allowed one)."""

    def __init__(self, path: Path | str) -> None:
        self.path = path = Path(path)
        values = {}
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeError) as error:
            raise KeysError(f"{path}: {getattr(error, 'strerror', None) or 'this is no file of a key'}") from None
        for number, line in enumerate(lines, 1):
            name, equals, value = (part.strip() for part in line.partition("="))
            if not equals or name.startswith("#"):
                continue
            if len(value) > 1 and value[0] in "\"'" and value[-1] == value[0]:
                value = value[1:-1]
            if name.endswith("-key") and not _KEY.fullmatch(value):
                raise KeysError(f"{path}, line {number}: a {name} is 40 characters of Z85")
            values[name] = value
        if "public-key" not in values:
            raise KeysError(f"{path}: it holds no public-key")
        self.name = values.get("name") or path.stem
        self.public, self.secret = values["public-key"], values.get("secret-key")
        self.nodes = values.get("nodes", "").split()

    @property
    def fingerprint(self) -> str:
        """Twenty digits by which two people compare a key."""
        digits = hashlib.sha256(self.public.encode()).hexdigest()
        return "-".join(digits[i:i + 4] for i in range(0, 20, 4))


def new(folder: Path | str, names: Sequence[str]) -> list[Path]:
    """Make a pair of keys for each name; returns the files. Nothing is written if one cannot be made."""
    import zmq

    folder = Path(folder)
    for name in names:
        if not _NAME.fullmatch(name):
            raise KeysError(f"'{name}' cannot be a file's name: letters, digits, _ . - can")
        for path in (folder / f"{name}.secret", folder / f"{name}.public"):
            if path.exists():
                raise KeysError(f"{path} exists already; a new key would shut out its owner. "
                                "Remove it first to replace it")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    _keep_out_of_git(folder, "*.secret")
    written = []
    for name in names:
        public, secret = (key.decode() for key in zmq.curve_keypair())
        public_part = f'metadata\n    name = "{name}"\ncurve\n    public-key = "{public}"\n'
        with Part(folder / f"{name}.secret") as part:
            _write_private(part, f"# The secret key of {name}. Keep it on its machine, and let no other user read it.\n"
                                 f'{public_part}    secret-key = "{secret}"\n')
        with Part(folder / f"{name}.public") as part:
            part.write_text(f"# The public key of {name}. It is no secret.\n{public_part}", encoding="utf-8")
        written += [folder / f"{name}.secret", folder / f"{name}.public"]
    return written


def find(folder: Path | str, given: Path | str) -> tuple[Key, bool]:
    """The public key in a file, or of a name in the folder, and whether it is a file. The key has the name that the
    user gave, by the name of the file or in the folder, not the one that its writer put into it."""
    folder, path = Path(folder), Path(given)
    is_file = path.is_file()
    if not is_file:
        path = folder / f"{given}.public"
    if not path.is_file():
        known = sorted(p.stem for p in folder.glob("*.public") if p.stem != CONTROLLER)
        raise KeysError(f"there is no public key {given}; in {folder} there are {', '.join(known) or 'none'}")
    key = Key(path)
    if key.secret:
        raise KeysError(f"{path} holds a secret key, which stays with its owner: allow the file with the public key")
    if not key.name.isprintable():
        raise KeysError(f"{path}: the name in it, {ascii(key.name)}, holds control characters")
    if not _NAME.fullmatch(path.stem):
        raise KeysError(f"{path}: a key is called as its file, by letters, digits, _ . -; rename it")
    return key, is_file


def allow(folder: Path | str, keys: Sequence[Path | str],
          nodes: Sequence[str] | None = None) -> list[tuple[Key, list[str]]]:
    """Admit the owners of these public keys (files, or names in the folder) as `nodes`; default: as the name of the
    file. Returns (key, nodes) of each."""
    folder = Path(folder)
    entries = [(key, list(nodes or [key.path.stem])) for key in (find(folder, given)[0] for given in keys)]
    if any(re.search(r'[\s"]', node) or not node.isprintable() or not node for node in nodes or []):
        raise KeysError("the name of a node that has a key holds neither spaces nor quotes nor control characters")
    for i, (key, _) in enumerate(entries):
        for other in [*allowed(folder), *(key for key, _ in entries[:i])]:
            if other.public == key.public and other.path.stem != key.path.stem:
                raise KeysError(f"{key.path}: this key is allowed already, as {other.path.stem}")
            if other.public != key.public and other.path.stem == key.path.stem:
                raise KeysError(f"{key.path}: {key.path.stem} is another key already, {other.fingerprint}; ./fledge "
                                f"keys deny {key.path.stem} removes that, or rename the file")
    (folder / "allowed").mkdir(parents=True, exist_ok=True, mode=0o700)
    for key, names in entries:
        with Part(folder / "allowed" / f"{key.path.stem}.public") as part:
            part.write_text(f'metadata\n    name = "{key.path.stem}"\n    nodes = "{" ".join(names)}"\n'
                            f'curve\n    public-key = "{key.public}"\n', encoding="utf-8")
    return entries


def deny(folder: Path | str, names: Sequence[str]) -> list[Path]:
    """Admit these keys no longer. Returns the deleted files."""
    paths = [Path(folder) / "allowed" / f"{name}.public" for name in names]
    for name, path in zip(names, paths):
        if not path.is_file():
            known = ", ".join(key.path.stem for key in allowed(folder))
            raise KeysError(f"{name} is not allowed in {folder}; allowed are {known or 'none'}")
    for path in paths:
        path.unlink()
    return paths


def allowed(folder: Path | str) -> list[Key]:
    """The admitted keys."""
    return [Key(path) for path in sorted((Path(folder) / "allowed").glob("*.public"))]


def pairs(folder: Path | str) -> list[tuple[str, Key | None, bool, str | None]]:
    """(name, Key of its public file or None, whether its secret is here, what is wrong with it or None)"""
    folder = Path(folder)
    names = sorted({path.stem for end in ("public", "secret") for path in folder.glob(f"*.{end}")},
                   key=lambda name: (name != CONTROLLER, name))
    keys = []
    for name in names:
        public, secret = folder / f"{name}.public", folder / f"{name}.secret"
        problem = None
        if secret.exists():
            mine = Key(secret)
            if os.stat(secret).st_mode & 0o77:
                problem = f"others may read {secret}: chmod 600 keeps it yours; if they might have, make a new pair"
            elif public.exists() and Key(public).public != mine.public:
                problem = f"{public} and {secret} are no pair"
        keys.append((name, Key(public) if public.exists() else None, secret.exists(), problem))
    return keys


def link(path: Path | str) -> int:
    """Add a random key of 256 bits to the keys of a radio link, in a file that ccsds/security/key_file.h describes. The
    first makes the file. Returns the key's id."""
    path = Path(path)
    text, ids = "# Keys of a radio link: id, and the key in hex. Let no other user read them.\n", [0]
    try:
        if path.exists():
            if path.stat().st_mode & 0o77:
                raise KeysError(f"{path}: others may read these secret keys; chmod 600 keeps them yours, and if they "
                                "might have, make new ones")
            text = path.read_text(encoding="utf-8")
            ids += [int(line.split()[0]) for line in text.splitlines() if line.strip() and line[0] != "#"]
        _keep_out_of_git(path.parent, "*" + (path.suffix or path.name))
        with Part(path) as part:
            _write_private(part, f"{text.rstrip()}\n{max(ids) + 1} {secrets.token_hex(32)}\n")
    except OSError as error:
        raise KeysError(f"{path}: {error.strerror}") from None
    except ValueError:
        raise KeysError(f"{path}: this is no file of keys of a link") from None
    return max(ids) + 1


def _keep_out_of_git(folder: Path, pattern: str) -> None:
    ignore = folder / ".gitignore"
    known = ignore.read_text(encoding="utf-8") if ignore.exists() else ""
    if pattern not in known.splitlines():
        with Part(ignore) as part:
            part.write_text(f"{known}{'' if not known or known.endswith(chr(10)) else chr(10)}{pattern}\n",
                            encoding="utf-8")


def _write_private(path: Path, text: str) -> None:
    path.unlink(missing_ok=True)
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(text)
