# SPDX-License-Identifier: Apache-2.0
"""The monitor of telemetry, against the decoder, limits in a few lines of Python and a second reader of its frames."""
import os
import struct

from fledge import _ground
from fledge.ground.testing.databases import Random, same

CASES = int(os.environ.get("FLEDGE_CASES", 1500))
HEAD = struct.Struct("<IIQqII")
ROW = struct.Struct("<IBBHqQ")


def read(tmp_path, text):
    path = tmp_path / "s.xml"
    path.write_text(text, encoding="utf-8")
    return _ground.Database.read([(str(path), "")])


def values_of(monitor, frame):
    """A frame's values by slot: (t, concern, status, value)."""
    magic, craft, version, t, n, texts = HEAD.unpack_from(frame)
    assert magic == 0x31444C46 and craft == 0 and len(frame) == 32 + 24 * n + texts
    slots = monitor.slots()
    made = {}
    for i in range(n):
        slot, concern, status, zero, when, word = ROW.unpack_from(frame, 32 + 24 * i)
        assert zero == 0 and slot not in made
        kind, labels = slots[slot]["kind"], slots[slot]["labels"]
        signed = word - (word >> 63 << 64)
        if status in (1, 3):
            value = None
        elif kind == "real":
            value = struct.unpack("<d", struct.pack("<Q", word))[0]
        elif kind in ("integer", "time"):
            value = signed
        elif kind == "boolean":
            value = word == 1
        elif kind == "label":
            value = signed if status == 2 else labels[word]
        elif kind in ("text", "binary"):
            start = 32 + 24 * n + (word >> 32)
            value = frame[start:start + (word & 0xFFFFFFFF)]
            value = value.decode("utf-8", "replace") if kind == "text" else value
        else:
            value = word
        made[slot] = (when, concern, status, value)
    return version, t, made


def test_newest_values_and_frames_of_random_packets_are_what_the_decoder_gives(tmp_path):
    seen = undecoded = grown = 0
    for seed in range(CASES // 50):
        made = Random(seed)
        database = read(tmp_path, made.text)
        monitor = _ground.Monitor(database, "Root")
        newest, known, t = {}, len(monitor.slots()), 0
        for _ in range(25):
            batch = [(t := t + 1, 10 * t, made.packet()) for _ in range(2)]
            since = monitor.version
            notes = monitor.take(batch)
            before = dict(newest)
            for when, received, packet in batch:
                found = database.decode(packet, "Root")
                bad = [note for note in notes if note[:3] == ("undecoded", when, received)]
                assert [note[3:] for note in bad] == ([] if not found.reason else [(packet, found.reason)])
                undecoded += len(bad)
                if not found.reason:
                    newest.update({name: (when, received, raw, value) for name, raw, value in found.rows})
            first = [note[1] for note in notes if note[0] == "slots"]
            assert first[:1] == ([known] if len(monitor.slots()) > known else [])
            grown += len(first)
            known = len(monitor.slots())
            _, last, frame = values_of(monitor, monitor.changes(since)[1])
            for name, (when, received, raw, value) in newest.items():
                slot = monitor.slot(name)
                row = monitor.newest(slot)
                assert row[:2] == (when, received) and same(row[2], raw) and same(row[3], value), (seed, name)
                if before.get(name) != newest[name]:
                    assert frame[slot][0] == when and (same(frame[slot][3], value) or row[4] == "unlabelled"), name
                seen += 1
            assert not newest or last == t
    assert seen > 3 * CASES and undecoded > CASES / 20 and grown > 5
