# SPDX-License-Identifier: Apache-2.0
"""./fledge keys: files that others can read, secrets that others cannot."""

import os
import re
import stat
from types import SimpleNamespace

import pytest
import zmq
import zmq.auth

from fledge import cli
from fledge.cosim import keys


def fledge(capsys, *arguments):
    """(exit code, output)"""
    code = cli.main(["keys", *map(str, arguments)])
    printed = capsys.readouterr()
    return code, printed.out + printed.err


def test_a_team_makes_keys_and_lets_one_another_in(tmp_path, capsys):
    here, lab = tmp_path / "here", tmp_path / "lab"
    assert fledge(capsys, "new", "controller", "world", "--keys", here)[0] == 0
    code, printed = fledge(capsys, "new", "lab1", "--keys", lab)
    assert code == 0 and "lab1.public goes to the machine of the controller" in printed
    assert fledge(capsys, "allow", lab / "lab1.public", "--as", "flight", "viewer", "--keys", here)[0] == 0
    assert fledge(capsys, "allow", "world", "--keys", here)[0] == 0
    code, printed = fledge(capsys, "list", "--keys", here)
    lines = printed.splitlines()
    lab1 = keys.Key(lab / "lab1.public").public
    digits = keys.Key(lab / "lab1.public").fingerprint
    assert re.fullmatch(r"([0-9a-f]{4}-){4}[0-9a-f]{4}", digits)
    assert ["lab1", lab1, digits, "as", "flight,", "viewer"] in [line.split() for line in lines]
    assert any(line.startswith("  world ") and line.endswith("with its secret") for line in lines)
    assert any(line.endswith("  as world") for line in lines)
    code, printed = fledge(capsys, "deny", "lab1", "--keys", here)
    assert code == 0 and [key.name for key in keys.allowed(here)] == ["world"]


def test_the_files_are_those_of_zeromq(tmp_path):
    keys.new(tmp_path, ["controller", "world"])
    keys.allow(tmp_path, ["world"], ["world", "flight"])
    public, secret = zmq.auth.load_certificate(tmp_path / "world.secret")
    assert zmq.curve_public(secret) == public
    assert zmq.auth.load_certificate(tmp_path / "world.public") == (public, None)
    assert zmq.auth.load_certificate(tmp_path / "allowed" / "world.public") == (public, None)
    assert keys.Key(tmp_path / "allowed" / "world.public").nodes == ["world", "flight"]


def test_only_the_owner_reads_a_secret(tmp_path):
    before = os.umask(0)
    try:
        keys.new(tmp_path / "k", ["world"])
    finally:
        os.umask(before)
    mode = {path.name: stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "k").iterdir()}
    assert mode["world.secret"] == 0o600 and stat.S_IMODE((tmp_path / "k").stat().st_mode) == 0o700
    assert (tmp_path / "k" / ".gitignore").read_text() == "*.secret\n"
    secret = keys.Key(tmp_path / "k" / "world.secret").secret
    assert all(secret not in path.read_text() for path in (tmp_path / "k").iterdir() if path.suffix != ".secret")
    os.chmod(tmp_path / "k" / "world.secret", 0o644)
    assert "chmod 600" in keys.pairs(tmp_path / "k")[0][3]


def test_a_link_gets_keys_that_only_the_owner_reads(tmp_path, capsys):
    file = tmp_path / "link.keys"
    (tmp_path / ".gitignore").write_text("runs")
    before = os.umask(0)
    try:
        assert [fledge(capsys, "link", file) for _ in range(2)] == [
            (0, f"  wrote  the key {id} into {file}\n") for id in (1, 2)]
    finally:
        os.umask(before)
    comment, first, second = file.read_text().splitlines()
    assert comment.startswith("#") and re.fullmatch("1 [0-9a-f]{64}", first) and re.fullmatch("2 [0-9a-f]{64}", second)
    assert first[2:] != second[2:] and stat.S_IMODE(file.stat().st_mode) == 0o600
    assert (tmp_path / ".gitignore").read_text() == "runs\n*.keys\n"
    file.chmod(0o640)
    code, printed = fledge(capsys, "link", file)
    assert code == 2 and "others may read these secret keys; chmod 600" in printed
    file.chmod(0o600)
    file.write_text("a key\n")
    assert fledge(capsys, "link", file) == (2, f"fledge: keys: {file}: this is no file of keys of a link\n")
    assert file.read_text() == "a key\n"
    assert fledge(capsys, "link", tmp_path / "none/link.keys")[0] == 2


def test_mistakes_change_nothing(tmp_path, capsys):
    keys.new(tmp_path, ["controller", "world"])
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    (tmp_path / "cut.public").write_text('curve\n    public-key = "abc"\n')
    before[tmp_path / "cut.public"] = (tmp_path / "cut.public").read_bytes()
    for arguments, text in (
            (("new", "flight", "world"), "world.secret exists already; a new key would shut out its owner"),
            (("new", "../flight"), "'../flight' cannot be a file's name"),
            (("allow", "flight"), "there is no public key flight; in .* there are cut, world"),
            (("allow", tmp_path / "world.secret"), "holds a secret key, which stays with its owner"),
            (("allow", "world", "cut"), "cut.public, line 2: a public-key is 40 characters of Z85"),
            (("allow", "world", "--as", "a b"), "holds neither spaces nor quotes"),
            (("allow", "world", "--as", "a\x1b[2J"), "holds neither spaces nor quotes nor control characters"),
            (("allow", tmp_path / "world.public"), r"world.public holds the key ([0-9a-f]{4}-){4}[0-9a-f]{4}; say as "
             "which nodes its owner may take part: --as world"),
            (("deny", "world"), "world is not allowed in .*; allowed are none")):
        code, printed = fledge(capsys, *arguments, "--keys", tmp_path)
        assert code == 2 and re.search(text, printed), printed
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_one_key_has_one_name(tmp_path):
    keys.new(tmp_path / "a", ["world"])
    keys.allow(tmp_path, [tmp_path / "a" / "world.public"])
    other = tmp_path / "other.public"
    other.write_text((tmp_path / "a" / "world.public").read_text().replace('"world"', '"flight"'))
    with pytest.raises(keys.KeysError, match="this key is allowed already, as world"):
        keys.allow(tmp_path, [other])
    keys.allow(tmp_path, [tmp_path / "a" / "world.public"], ["*"])  # the same one anew, for more
    assert [key.nodes for key in keys.allowed(tmp_path)] == [["*"]]


def mailed(folder, file, name):
    """A public key in a file that calls itself `name`."""
    keys.new(folder / "theirs", ["own"])
    path = folder / file
    path.write_text((folder / "theirs/own.public").read_text().replace('"own"', f'"{name}"'))
    return path


def test_a_mailed_file_does_not_choose_its_name(tmp_path, capsys, monkeypatch):
    path = mailed(tmp_path, "lab1.public", "flight")
    here, fingerprint = tmp_path / "here", keys.Key(path).fingerprint
    code, printed = fledge(capsys, "allow", path, "--keys", here)
    assert code == 2 and not here.exists()
    assert f"holds the key {fingerprint}, which calls itself flight; say as which nodes" in printed
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    for answer, expected in (("", []), ("n", []), ("y", ["lab1"])):
        questions = []
        monkeypatch.setattr("builtins.input", lambda question, answer=answer: questions.append(question) or answer)
        fledge(capsys, "allow", path, "--keys", here)
        assert [node for key in keys.allowed(here) for node in key.nodes] == expected
        assert f"holds the key {fingerprint}, which calls itself flight. " in questions[0]
        assert "as the node lab1?" in questions[0]
    monkeypatch.setattr("builtins.input", lambda question: pytest.fail("it asked"))
    code, printed = fledge(capsys, "allow", path, "--as", "nav", "--keys", here)
    assert code == 0 and f"lab1 ({fingerprint}) may take part as nav\n" in printed
    assert [key.path.stem for key in keys.allowed(here)] == ["lab1"]


def test_the_name_in_a_file_does_not_drive_the_terminal(tmp_path, capsys):
    path = mailed(tmp_path, "lab1.public", "\x1b[2Jflight")
    code, printed = fledge(capsys, "allow", path, "--as", "lab1", "--keys", tmp_path / "here")
    assert code == 2 and "the name in it, '\\x1b[2Jflight', holds control characters" in printed
    assert not (tmp_path / "here").exists()


def test_a_name_that_is_allowed_is_not_replaced(tmp_path, capsys):
    keys.new(tmp_path, ["controller", "lab1"])
    keys.allow(tmp_path, ["lab1"])
    first = keys.allowed(tmp_path)[0]
    path = mailed(tmp_path / "mail", "lab1.public", "lab1")
    code, printed = fledge(capsys, "allow", path, "--as", "lab1", "--keys", tmp_path)
    assert code == 2 and f"lab1 is another key already, {first.fingerprint}; ./fledge keys deny lab1 removes" in printed
    assert [key.public for key in keys.allowed(tmp_path)] == [first.public]
    other = tmp_path / "other/lab1.public"
    other.parent.mkdir()
    other.write_text((tmp_path / "lab1.public").read_text())
    with pytest.raises(keys.KeysError, match="lab1 is another key already"):    # two of one name at once
        keys.allow(tmp_path / "new", [other, path])
    assert not (tmp_path / "new").exists()
