# SPDX-License-Identifier: Apache-2.0
"""Mistakes in a board's file and the messages for them; where lanes lie."""
import itertools
import random
import re
from pathlib import Path

import pytest

from registers.__main__ import main
from registers.checked_toml import TomlError
from registers.description import Number, parse, read, read_all

BOARDS = sorted((Path(__file__).parent / "testing/boards").glob("*.toml"))

HEAD = 'name = "b"\nbase = 0x1000\nsize = 0x1000\norder = "big"\n'       # lines 1 to 4
LINES = '[interrupts]\naddress = 0\nlines = ["a", "b"]\n'
WORD = '[[snorkel]]\nname = "w"\nform = "word"\ndirection = "read"\naddress = 0x100\n'
PACKET = '[[snorkel]]\nname = "p"\nform = "packet"\ndirection = "read"\naddress = 0x200\nsize = 8\n'
BOTH = PACKET.replace('"read"', '"both"') + "write_address = 0x300\n"
FIELD = '[[snorkel.field]]\nname = "f"\nbits = [0, 8]\n'
PLACED = '[[snorkel.field]]\nname = "x"\nat = 4\ntype = "f32"\n'
MESSAGE = PACKET.replace('"packet"', '"message"') + 'message = "M"\nheader = "m.h"\n'

# text, line, and what the complaint must hold: rule, finding or advice
REFUSED = [
    (HEAD[:-2], 4, "must be TOML"),
    (HEAD + HEAD, 5, "must be TOML"),
    (HEAD.replace("big", "middle"), 4, 'it is "middle"; choose "big", "little"'),
    (HEAD.replace("base = 0x1000\n", "base = 0x1000\nlevel = 3\n"), 3, "there is `level`; choose name, doc, base"),
    (HEAD + LINES + "level = 16\n", 8, "`level` is from 0x1 to 0xf; it is 0x10"),
    (HEAD.replace("0x1000\ns", "0x1004\ns"), 2, "a multiple of 8"),
    (HEAD.replace("base = 0x1000\n", ""), 1, "`base` must be given"),
    (HEAD.replace("size = 0x1000", "size = true"), 3, "`size` is a whole number"),
    (HEAD + "speed = 1\n", 5, "there is `speed`; choose name, doc, base"),
    (HEAD + "snorkel = 1\n", 5, "write [[snorkel]]"),
    (HEAD + "[clock]\nadress = 8\n", 6, "there is `adress`"),
    (HEAD + "[clock]\naddress = 0x40\ninterrupt = \"a\"\n", 7, "add [interrupts]"),
    (HEAD + LINES.replace('"b"', '"a"'), 7, "1 to 32 different names"),
    (HEAD + LINES + WORD + 'interrupt = "c"\n', 13, 'choose "a", "b"'),
    (HEAD + LINES + WORD + 'interrupt = "a"\n' + PACKET.replace("read", "write")
     + 'interrupt = "a"\n', 20, "raised by one side"),
    (HEAD + WORD.replace('"w"', '"Sun"'), 6, "lower case"),
    (HEAD + WORD.replace('"w"', '"w__x"'), 6, "lower case"),
    (HEAD + WORD.replace('"w"', '"int"'), 6, "no keyword"),
    (HEAD + WORD + PACKET.replace('"p"', '"w"'), 11, "stands in line 6 too"),
    (HEAD + WORD.replace("word", "wrod"), 7, 'choose "word", "packet", "message"'),
    (HEAD + WORD.replace('direction = "read"\n', ""), 5, 'choose "read", "write", "both"'),
    (HEAD + WORD.replace("0x100", "0x102"), 9, "a multiple of 4; it is 0x102"),
    (HEAD + PACKET.replace("0x200", "0x204"), 9, "a multiple of 8"),
    (HEAD + WORD.replace("0x100", "0x1000"), 9, "`w` ends at 0x1004, the board at 0x1000"),
    (HEAD + WORD.replace("0x100", "0x210") + PACKET, 9, "move it to 0x260 or beyond"),
    (HEAD + LINES + WORD.replace("0x100", "0xC"), 12, "overlaps the interrupts [0x0, 0x10)"),
    (HEAD + BOTH.replace("0x300", "0x238"), 11, "`p_write` [0x238, 0x298) overlaps `p_read`"),
    (HEAD.replace("0x1000\no", "0x240\no") + PACKET + PACKET.replace('"p"', '"q"').replace("address = 0x200\n", ""), 11,
     "`q` ends at 0x2c0, the board at 0x240"),
    (HEAD + PACKET + 'carries = ["world.a.b", 3]\n', 11, "names a message, a part of it, or a list of parts"),
    (HEAD + PACKET + 'carries = ["world.a.b"]\n', 11, "a list names numbers of a mission; world.a.b is none"),
    (HEAD + PACKET + "write_remove = 2\n", 11, "write `remove`"),
    (HEAD + WORD + "queue = 12\n", 10, "choose 8 or 16"),
    (HEAD + WORD + 'overflow = "refuse"\n', 10, "`overflow` is of queues"),
    (HEAD + WORD + 'queue = 4\noverflow = "drop"\n', 11, 'choose "refuse", "overwrite"'),
    (HEAD + WORD + "queue = 4\ncount = 2\n", 11, "`count` is of words that are not queued"),
    (HEAD + WORD + "remove = 4\n", 10, "`remove` is for packet; `w` is a word"),
    (HEAD + PACKET + "capacity = 9\n", 11, "both are given"),
    (HEAD + PACKET.replace("size = 8\n", ""), 5, "neither is given"),
    (HEAD + PACKET + "add = [256]\n", 11, "each 0 to 255"),
    (HEAD + PACKET + "add = [1, 2, 3, 4, 5, 6, 7, 8, 9]\n", 11, "9 bytes of 8"),
    (HEAD + PACKET + 'outside_order = "little"\n', 11, "give `unit` = 2, 4 or 8"),
    (HEAD + PACKET + 'outside_order = "little"\nunit = 3\n', 12, "choose 1, 2, 4, 8"),
    (HEAD + PACKET + 'outside_order = "little"\nunit = 4\nadd = [1]\n', 12, "whole units"),
    (HEAD + PACKET + "descriptor = {address = 0x208}\n", 11, "the descriptors of `p`"),
    (HEAD + PACKET + "descriptor = {address = 0x100, tag = [20, 8]}\n", 11, "do not overlap"),
    (HEAD + PACKET + "descriptor = {address = 0x100, valid = [30, 2]}\n", 11, "one bit or none"),
    (HEAD + PACKET.replace("size = 8", "capacity = 16")
     + "descriptor = {address = 0x100, length = [0, 4]}\n", 11, "4 bits do not hold 16"),
    (HEAD + WORD + FIELD.replace("[0, 8]", "[28, 8]"), 12, "within 32 bits; it is [28, 8]"),
    (HEAD + WORD + FIELD + FIELD.replace('"f"', '"g"'), 15, "`g` overlaps another one"),
    (HEAD + WORD + FIELD + "scale = 0\n", 13, "`scale` is not 0"),
    (HEAD + WORD + FIELD + "offset = inf\n", 13, "`offset` is finite"),
    (HEAD + WORD + FIELD + 'signed = "no"\n', 13, "true or false"),
    (HEAD + MESSAGE + FIELD, 13, "`field` is for word and packet"),
    (HEAD + PACKET + PLACED + "tag = 3\n", 15, "a tag is from 0 to 0, as the descriptor holds it; it is 3; choose"),
    (HEAD + PACKET + PLACED + "count = 2\n", 13, "numbers stand within the packet; `x` ends at 12 of 8 bytes"),
    (HEAD + PACKET + "add = [1, 2, 3, 4, 5]\n" + PLACED, 14, "5 bytes in front are the header, `x` is at 4; move it"),
    (HEAD + PACKET + PLACED.replace("f32", "f31"), 14, '`type` must say which; it is "f31"; choose'),
    (HEAD + PACKET + PLACED + "bits = [0, 8]\n", 15, "there is `bits`; choose name, doc, at"),
    (HEAD + PACKET + PLACED * 2, 16, "field names differ"),
    (HEAD + PACKET + PLACED + PLACED.replace("x", "y"), 17, "do not overlap; `y` [4, 8) overlaps `x` [4, 8)"),
    (HEAD + PACKET + 'sees = "newest"\n', 11, "`sees` is of queues"),
    (HEAD + PACKET + 'queue = 4\nsees = "last"\n', 12, "`sees` must say which"),
    (HEAD + "[slave_clock]\naddress = 0x40\nrate = 1\n", 7, "there is `rate`; choose address, interrupt, start"),
    (HEAD + "[slave_clock]\naddress = 0x40\ndrift = 2e6\n", 7, "`drift` is from -1e+06 to 1e+06 ppm; it is 2e+06"),
    (HEAD + "[slave_clock]\naddress = 0x40\npulse = 0\n", 7, "`pulse` is from 1e-06 to 9e+09 s; it is 0"),
    (HEAD + "[slave_clock]\naddress = 0xFF0\n", 6, "all lies within the board's size; the slave clock ends at 0x1020"),
    (HEAD + "[clock]\naddress = 0x40\n[slave_clock]\naddress = 0x50\n", 8, "the slave clock [0x50, 0x80) overlaps"),
    (HEAD + "[[bound]]\nfield = 7\n", 6, "`field` is a text"),
    (HEAD + "[[bound]]\nfield = \"f\"\n", 5, "`at_most` must be given"),
    (HEAD + "[[bound]]\nfield = \"f\"\nat_most = inf\n", 7, "`at_most` is finite"),
    (HEAD + MESSAGE.replace("size", "capacity"), 10, "a snorkel of one message type"),
    (HEAD + MESSAGE.replace('header = "m.h"\n', ""), 5, "`header` must be given"),
    (HEAD + MESSAGE.replace('"M"', '"m m"'), 11, "the name of a type"),
]


@pytest.mark.parametrize("text, line, words", REFUSED, ids=[words for _, _, words in REFUSED])
def test_a_bad_board_is_refused_with_line_rule_finding_and_advice(tmp_path, capsys, text, line,
                                                                  words):
    file = tmp_path / "b.toml"
    file.write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    assert main([str(file), "--out", str(out)]) == 1
    complaints = capsys.readouterr().err.splitlines()
    assert any(c.startswith(f"{file}:{line}: ") and words in c for c in complaints), complaints
    assert not out.exists()


def test_the_pieces_of_the_refusals_are_right_when_together(tmp_path):
    file = tmp_path / "b.toml"
    for text in (HEAD + LINES + WORD + FIELD + PACKET, HEAD + BOTH, HEAD + MESSAGE):
        file.write_text(text, encoding="utf-8")
        read(file)


def test_values_at_the_limits_are_taken(tmp_path):
    file = tmp_path / "b.toml"
    add = PACKET + "add = [0, 1, 2, 3, 4, 5, 6, 255]\n"
    for text in (HEAD + WORD + FIELD.replace("[0, 8]", "[0, 32]"), HEAD + WORD + FIELD.replace("[0, 8]", "[31, 1]"),
                 HEAD + WORD + "queue = 8\n", HEAD + WORD.replace("0x100", "0xFFC"), HEAD + add):
        file.write_text(text, encoding="utf-8")
        read(file)
    file.write_text(HEAD + PACKET.replace("size = 8", "capacity = 15")
                    + "descriptor = {address = 0x100, length = [0, 4], tag = [4, 0], valid = [0, 0]}\n")
    descriptor = read(file).lanes[0].descriptor
    assert (descriptor.length, descriptor.tag, descriptor.valid) == ((0, 4), (4, 0), (0, 0))


def test_all_complaints_come_at_once_in_the_order_of_lines(tmp_path):
    file = tmp_path / "b.toml"
    file.write_text(HEAD + WORD.replace("0x100", "0x101") + "queue = 3\n" + PACKET + "speed = 1\n")
    with pytest.raises(TomlError) as error:
        read(file)
    lines = [int(c.split(":")[1]) for c in str(error.value).splitlines()]
    assert lines == [9, 10, 17]


def test_two_boards_neither_overlap_nor_share_a_name(tmp_path, capsys):
    for name, base in (("a", 0), ("b", 0x2000), ("c", 0x2FF8)):
        (tmp_path / f"{name}.toml").write_text(
            HEAD.replace('"b"', f'"{name}"').replace("base = 0x1000", f"base = {base}"))
    files = [str(tmp_path / f"{name}.toml") for name in "abc"]
    assert main([*files[:2], "--out", str(tmp_path)]) == 0
    assert main([*files[1:], "--out", str(tmp_path)]) == 1
    assert "boards do not overlap; c [0x2ff8, 0x3ff8) overlaps b" in capsys.readouterr().err
    assert main([files[0], files[0], "--out", str(tmp_path)]) == 1
    assert "boards' names differ" in capsys.readouterr().err


def test_a_folder_stands_for_its_files(tmp_path, capsys):
    for name, base in (("b", 0x2000), ("a", 0)):
        (tmp_path / f"{name}.toml").write_text(
            HEAD.replace('"b"', f'"{name}"').replace("base = 0x1000", f"base = {base}"))
    assert [board.name for board in read_all([tmp_path])] == ["a", "b"]
    assert main([str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {f"{a}.{b}" for a in "ab" for b in ("h", "c", "md")}
    capsys.readouterr()
    assert main([str(tmp_path / "out"), "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"{tmp_path}/out: the folder of boards has no file *.toml\n"


def test_what_has_no_address_lies_behind_all_before(tmp_path):
    bare = 'name = "b"\nbase = 0x1000\n'
    nowhere = [re.sub("(write_)?address = .*\n", "", text) for text in (LINES, WORD, BOTH + "queue = 2\n")]
    file = tmp_path / "b.toml"
    file.write_text(bare + "[clock]\n" + "".join(nowhere) + "descriptor = {}\nwrite_descriptor = {}\n")
    board = read(file)
    assert (board.order, board.clock, board.interrupts) == ("big", 0, 0x20)
    w, read_, write = board.lanes
    places = [w.address, read_.address, read_.descriptor.address, write.address, write.descriptor.address, board.size]
    assert places == [0x40, 0x60, 0xA0, 0xC0, 0x100, 0x120]
    # A written address counts, and what follows lies behind it.
    file.write_text(bare + WORD + nowhere[2])
    assert [lane.address for lane in read(file).lanes] == [0x100, 0x120, 0x160]


MESSAGES = {"world.unit.state": [Number("world.unit.state.on", "u8", 3, "-", "switches"),
                                 Number("world.unit.state.cards[0].volts", "u16", 1, "-", "of the bus"),
                                 Number("world.unit.state.cards[0].time", "i64", 1, "ns", "of the report")],
            "flight.unit.command": [Number("flight.unit.command.on", "u8", 1, "-", "")]}


def carried(path):
    if path == "commands":
        return None
    if path not in MESSAGES:
        raise LookupError(f"there is no message {path}")
    return MESSAGES[path]


def test_a_packet_carries_the_numbers_of_a_message_in_their_order(tmp_path):
    text = HEAD + BOTH.replace("size = 8\n", "") + 'add = [1, 2, 3, 4]\n' \
        'carries = ["world.unit.state"]\nwrite_carries = "flight.unit.command"\n'
    down, up = parse(text, tmp_path / "b.toml", carried).lanes
    assert [(f.name, f.at, f.type, f.count, f.unit, f.doc) for f in down.fields] == [
        ("on", 4, "u8", 3, "-", "switches"), ("cards_0_volts", 8, "u16", 1, "-", "of the bus"),
        ("cards_0_time", 12, "i64", 1, "ns", "of the report")]
    assert (down.capacity, down.variable, down.carries) == (20, False, None)
    assert [(f.name, f.at, f.carries) for f in up.fields] == [("write_on", 0, "flight.unit.command.on")]
    assert up.capacity == 4
    for wrong, complaint in ((text.replace("unit.state", "unit.stat"), "there is no message world.unit.stat; name one"),
                             (text + "size = 8\n", "they end at 20 of 8 bytes"),
                             (text + PLACED, "a packet has fields, or `carries` that names its numbers"),
                             (text.replace("flight.unit.command", "commands"), "neither is given")):
        with pytest.raises(TomlError, match=re.escape(complaint)):
            parse(wrong, tmp_path / "b.toml", carried)


def test_random_layouts_are_taken_exactly_if_nothing_overlaps(tmp_path):
    """The oracle marks each byte: a board is refused if and only if a byte is taken twice."""
    rng = random.Random(8)
    outcomes = set()
    for _ in range(200):
        text, taken, twice = HEAD, set(), False
        for i in range(rng.randint(1, 4)):
            address, n = 8 * rng.randrange(60), rng.randint(1, 20)
            text += (f'[[snorkel]]\nname = "s_{i}"\ndirection = "read"\naddress = {address}\n')
            if rng.random() < 0.5:
                text += f'form = "word"\ncount = {n}\n'
                size = 4 * n
            else:
                text += f'form = "packet"\nsize = {n}\nqueue = 2\n'
                size = 32 + 2 * (8 + (n + 7) // 8 * 8)
            own = set(range(address, address + size))
            twice |= bool(own & taken)
            taken |= own
        file = tmp_path / "b.toml"
        file.write_text(text)
        try:
            read(file)
            refused = False
        except TomlError:
            refused = True
        assert refused == twice, text
        outcomes.add(refused)
    assert outcomes == {False, True}


@pytest.mark.parametrize("bits", [1, 8, 32])
def test_a_field_holds_what_so_many_bits_can(tmp_path, bits):
    file = tmp_path / "b.toml"
    for signed, low in ((False, 0), (True, -2**bits // 2)):
        file.write_text(HEAD + WORD + FIELD.replace("[0, 8]", f"[0, {bits}]") + f"signed = {str(signed).lower()}\n")
        field, = read(file).snorkels[0].fields
        assert (field.low, field.high) == (low, low + 2**bits - 1)


@pytest.mark.parametrize("file", BOARDS, ids=lambda p: p.stem)
def test_the_shipped_boards_are_right_and_named_as_their_files(file):
    assert read(file).name == file.stem


def test_the_shipped_boards_show_every_kind_of_snorkel():
    lanes = [lane for file in BOARDS for lane in read(file).lanes]
    for kind in itertools.product(("word",), (False, True)):
        assert kind in {(lane.form, lane.queued) for lane in lanes}
    for form in ("packet", "message"):
        assert {lane.variable for lane in lanes if lane.form == form} == {False, True}
        assert {lane.queued for lane in lanes if lane.form == form} == {False, True}
    assert any(lane.descriptor.address is not None for lane in lanes)
    assert any(lane.add for lane in lanes) and any(lane.remove for lane in lanes)
    assert any(lane.swap for lane in lanes) and any(lane.interrupt for lane in lanes)
    directions = {s.direction for file in BOARDS for s in read(file).snorkels}
    assert directions == {"read", "write", "both"}


def test_the_hash_tells_what_both_sides_must_agree_on(tmp_path):
    file = tmp_path / "b.toml"
    hashes = set()
    for text in (HEAD + WORD, HEAD + WORD.replace("0x100", "0x104"), HEAD + WORD + "count = 2\n",
                 HEAD + WORD + FIELD, (HEAD + WORD).replace("big", "little")):
        file.write_text(text)
        hashes.add(read(file).hash)
    assert len(hashes) == 5
    file.write_text(HEAD + 'doc = "other words"\n' + WORD)
    assert read(file).hash in hashes


def test_any_junk_in_a_value_is_a_complaint_with_a_line(tmp_path):
    """Whatever stands behind a `=`, the answer is a board or complaints, never a crash."""
    rng = random.Random(9)
    junk = ["0", "-1", "7", "1e300", "nan", "true", '""', '"x y"', '"big"', "[]", "[1]", "[-1, 99]",
            '["a"]', "{}", "{a = 1}", "99999999999999999999", "1979-05-27", "[[1], {b = 2}]"]
    file = tmp_path / "b.toml"
    refused = 0
    for _ in range(400):
        lines = rng.choice(BOARDS).read_text().split("\n")
        for _ in range(rng.randint(1, 3)):
            i = rng.choice([i for i, line in enumerate(lines) if "=" in line])
            lines[i] = lines[i].split("=")[0] + "= " + rng.choice(junk)
        file.write_text("\n".join(lines))
        try:
            read(file)
        except TomlError as error:
            refused += 1
            for complaint in str(error).splitlines():
                assert re.match(re.escape(f"{file}:") + r"\d+: .+; .+", complaint), complaint
    assert 200 < refused < 400


@pytest.mark.parametrize("n", [31, 32, 2_000, 100_000])
@pytest.mark.parametrize("text", ["{} = 1", "[{}]", "x = [1, {{y = 1.5, {} = 1}}]"])
def test_keys_and_values_too_deep_are_one_complaint(tmp_path, n, text):
    file = tmp_path / "b.toml"
    key = ".".join(["a", '"b.c"', "'d'"][i % 3] for i in range(n + 1))
    file.write_text(HEAD + WORD + text.format(key) + "\n")
    with pytest.raises(TomlError) as error:
        read(file)
    (line,) = str(error.value).splitlines()
    assert line.startswith(f"{file}:") and ("a key has at most 32 parts" in line) == (n > 31), line[:200]
    file.write_text(HEAD + WORD + "x = " + "[" * n + "]" * n + "\n")
    with pytest.raises(TomlError) as error:
        read(file)
    (line,) = str(error.value).splitlines()
    assert ("nested too deeply" in line) == (n > 1_000), line[:200]


def test_a_file_that_is_no_text_is_one_complaint(tmp_path):
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(TomlError, match="b.toml:1: the file must be TOML; it is no text in UTF-8"):
        read(tmp_path / "b.toml")
