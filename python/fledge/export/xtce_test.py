# SPDX-License-Identifier: Apache-2.0
"""The database of a mission: another reader, which knows nothing but the XTCE file, reads flight's packets and writes
its commands."""
import binascii
import math
import os
import re
import struct
import subprocess
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from random import Random
from xml.etree import ElementTree

import numpy as np
import pytest

import fledge
from fledge import cli, export
from fledge.archive import Archive
from fledge.commands import (DATA_MAX, Action, Code, Packets, checksummed, decoded, encoded, leaves, numbered, values)
from fledge.elements import ELEMENTS
from fledge.errors import SetupError
from fledge.export import ground, packets, stations
from fledge.export.page import page
from fledge.export.run_test import FLIGHT, WORLD
from fledge.export.xtce import xtce
from fledge.mission.folder import missions
from fledge.targets import services_test
from fledge.targets.services_test import STORED
from fledge.targets.testing import Draft
from tests.circles import long_after
from tests.needs import needs

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data"))
LONG = os.environ.get("FLEDGE_LONG", "") not in ("", "0")
SCENARIOS = '''
from fledge.units import s

def downlink(sim):
    f = sim.flight
    f.commands.telemetry()
    f.commands.telemetry("housekeeping", every=10)
    f.commands.read("control")
    f.commands.mode("point")
    sim.run(5 * s)
    f.commands.send(b"\\x18\\x80nonsense")
    sim.run(5 * s)
'''
GROUND = '''
completed_within = 20
[telemetry."flight.tracking.error.sigma_BR"]
polynomial = [0, 229.0]
unit       = "deg"
warning    = [-5, 5]
[telemetry."flight.wheels.wheels.n"]
critical = [1, inf]
[commands."flight.write.control"]
hazardous = "the loop may become \\"unstable\\""
'''


@pytest.fixture()
def folder(tmp_path):
    mission = tmp_path / "plays"
    mission.mkdir()
    for name, text in (("flight", FLIGHT), ("world", WORLD), ("scenarios", SCENARIOS)):
        (mission / f"{name}.py").write_text(text)
    return mission


def databases(sim):
    return [packets.database(mission) for mission in export.read_all(sim)]


def written(sim, station=""):
    all_ = databases(sim)
    return xtce(sim.name, all_, ground.read(sim.mission.folder, all_), station)


# --- a reader of its own ---------------------------------------------------------------------------

class Reader:
    """Reads packets and writes commands by an XTCE file: by its elements, and by nothing of Fledge."""

    def __init__(self, text):
        self.root = ElementTree.fromstring(re.sub(r' xmlns="[^"]*"', "", text, count=1))
        self.types = {kind.get("name"): kind for kind in self.root.iterfind(".//ParameterTypeSet/*")}
        self.argument_types = {kind.get("name"): kind for kind in self.root.iterfind(".//ArgumentTypeSet/*")}
        self.parameters = {parameter.get(
            "name"): parameter for parameter in self.root.iterfind(".//ParameterSet/Parameter")}
        self.containers = {container.get("name"): container for container in self.root.iterfind(".//SequenceContainer")}
        self.commands = {command.get("name"): command for command in self.root.iterfind(".//MetaCommand")}
        self.children = {}
        for container in self.containers.values():
            if (base := container.find("BaseContainer")) is not None:
                self.children.setdefault(base.get("containerRef"), []).append(container)

    @staticmethod
    def alias(element):
        return element.find("AliasSet/Alias[@nameSpace='Fledge']").get("alias")

    def decode(self, packet, container):
        """(alias of the container, alias of a parameter -> raw value) of a packet; all of its bits are read."""
        values, at = {}, 0
        node = self.containers[container]
        while node is not None:
            for entry in node.iterfind("EntryList/ParameterRefEntry"):
                parameter = self.parameters[entry.get("parameterRef")]
                value, at = self.read(self.types[parameter.get("parameterTypeRef")], packet, at, values)
                values[parameter.get("name")] = value
            last, node = node, next((each for each in self.children.get(node.get("name"), []) if all(
                values[c.get("parameterRef")] == int(c.get("value")) for c in each.iter("Comparison"))), None)
        assert at == 8 * len(packet), last.get("name")
        return self.alias(last), {self.alias(self.parameters[name]): value for name, value in values.items()}

    def read(self, kind, packet, at, values):
        encoding = next(part for part in kind if part.tag.endswith("DataEncoding"))
        bits = self.bits(encoding, values)
        assert at % 8 == 0 or encoding.tag == "IntegerDataEncoding"
        whole = packet[at // 8:-(-(at + bits) // 8)]
        if encoding.tag in ("StringDataEncoding", "BinaryDataEncoding"):
            assert len(whole) * 8 == bits
            if encoding.find("SizeInBits/TerminationChar") is not None:
                whole = whole.partition(b"\0")[0]
            return (whole.decode() if encoding.tag[0] == "S" else whole), at + bits
        if encoding.get("byteOrder") == "leastSignificantByteFirst":
            whole = whole[::-1]
        number = int.from_bytes(whole, "big") >> (-(at + bits) % 8) & ((1 << bits) - 1)
        if encoding.tag == "FloatDataEncoding":
            number = struct.unpack({32: ">f", 64: ">d"}[bits], number.to_bytes(bits // 8, "big"))[0]
        elif encoding.get("encoding") == "twosComplement" and number >> (bits - 1):
            number -= 1 << bits
        return number, at + bits

    @staticmethod
    def bits(encoding, values):
        if encoding.get("sizeInBits"):
            return int(encoding.get("sizeInBits"))
        ref = next((node for node in encoding.iter() if node.tag.endswith("InstanceRef")), None)
        if ref is None:
            return int(next(encoding.iter("FixedValue")).text)
        slope = float(next(encoding.iter("LinearAdjustment")).get("slope"))
        return int(values[ref.get("parameterRef") or ref.get("argumentRef")] * slope)

    def chain(self, name):
        command = self.commands[name]
        base = command.find("BaseMetaCommand")
        return [*(self.chain(base.get("metaCommandRef")) if base is not None else []), command]

    def encode(self, name, sequence, **given):
        """A command with the header's fields that its sender sets."""
        given = dict(given)
        for command in self.chain(name):
            for assigned in command.iter("ArgumentAssignment"):
                given[assigned.get("argumentName")] = int(assigned.get("argumentValue"))
        kinds = {a.get("name"): self.argument_types[a.get("argumentTypeRef")] for command in self.chain(name)
                 for a in command.iterfind("ArgumentList/Argument")}
        bits = ""
        for entry in (entry for command in self.chain(name) for entry in command.find("CommandContainer/EntryList")):
            if entry.tag == "ParameterRefEntry":
                kind = self.types[self.parameters[entry.get("parameterRef")].get("parameterTypeRef")]
                bits += self.written(kind, int(kind.get("initialValue")), given)
            else:
                kind = kinds[entry.get("argumentRef")]
                bits += self.written(kind, given.get(entry.get("argumentRef"), kind.get("initialValue")), given)
        packet = bytearray(int(bits, 2).to_bytes(len(bits) // 8, "big"))
        packet[2:6] = struct.pack(">HH", packet[2] << 8 | packet[3] | sequence, len(packet) - 7)
        checksum = 0xFF
        for byte in packet:
            checksum ^= byte
        packet[7] = checksum
        return bytes(packet)

    def written(self, kind, value, given):
        """The binary digits of a value: of an enumeration also by its label."""
        encoding = next(part for part in kind if part.tag.endswith("DataEncoding"))
        bits = self.bits(encoding, given)
        if encoding.tag in ("StringDataEncoding", "BinaryDataEncoding"):
            raw = (value.encode() if isinstance(value, str) else value).ljust(bits // 8, b"\0")
            assert len(raw) * 8 == bits
        elif encoding.tag == "FloatDataEncoding":
            raw = struct.pack({32: ">f", 64: ">d"}[bits], value)
        else:
            labels = {label.get("label"): int(label.get("value")) for label in kind.iter("Enumeration")}
            number = labels[value] if value in labels else int(value)
            return f"{number & (1 << bits) - 1:0{bits}b}"
        return f"{int.from_bytes(raw, 'big'):0{bits}b}" if bits else ""


def name_of(path):
    return re.sub(r"[^A-Za-z0-9]+", "_", path).strip("_")


# --- the file --------------------------------------------------------------------------------------

@pytest.mark.long("xmllint reads the files of all missions")
@needs("libxml2-utils")
@pytest.mark.skipif(not (DATA / "xtce").exists(), reason=f"not here: {DATA}/xtce/SpaceSystemV1.2.xsd")
def test_the_files_of_all_missions_are_valid(tmp_path):
    schema = (DATA / "xtce/SpaceSystemV1.2.xsd").read_text(encoding="utf-8")
    (tmp_path / "xtce.xsd").write_text(re.sub('schemaLocation="http[^"]*xml.xsd"', 'schemaLocation="xml.xsd"', schema))
    (tmp_path / "xml.xsd").write_text('<schema xmlns="http://www.w3.org/2001/XMLSchema" targetNamespace='
                                      '"http://www.w3.org/XML/1998/namespace"><attribute name="base" type="anyURI"/>'
                                      "</schema>")
    files = []
    for name in missions():
        sim = fledge.load(name)
        if sim.flights:
            for station in ("", "yamcs", "cosmos"):
                files.append(tmp_path / f"{name}{station}.xml")
                files[-1].write_text(written(sim, station))
    assert len(files) > 30
    done = subprocess.run(["xmllint", "--noout", "--nonet", "--schema", tmp_path / "xtce.xsd", *files],
                          capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr.count(" validates") == len(files), done.stderr[:4000]


@pytest.mark.parametrize("name", ["plays", "earth_imager", "formation"])
def test_packets_of_flight_are_read_to_the_values_of_the_record(name, folder, tmp_path):
    sim = fledge.load(folder if name == "plays" else name)
    reader = Reader(written(fledge.load(sim.mission.folder)))
    sim.archive_outputs(tmp_path / "outputs.mcap")
    for flight in sim.flights:
        flight.commands.take_packets()          # they are kept from now on
        if name != "plays":
            flight.commands.telemetry()
    sim.scenarios["downlink"]() if name == "plays" else sim.run(10)
    sim.close_outputs()
    record = Archive(tmp_path / "outputs.mcap")
    column, times = lru_cache(None)(record.__getitem__), lru_cache(None)(record.time_ns)
    for flight in sim.flights:
        dictionary, seen = flight.commands.dictionary, {}
        for t, raw in flight.commands.take_packets():
            path, content = reader.decode(raw, f"{flight.name}_packet")
            ours = decoded(dictionary, raw)
            seen[path] = seen.get(path, 0) + 1
            header = f"{flight.name}.packet"
            assert content[f"{header}.ccsds_length"] == len(raw) - 7
            assert abs(content[f"{header}.header_seconds"] + content[f"{header}.header_fraction"] / 65536
                       - ours.time) < 1e-9
            content = {key.removeprefix(f"{path}."): value for key, value in content.items()
                       if key.startswith(f"{path}.")}
            if path == f"{flight.name}.reports":
                assert (content["t"], content["sequence"], content["code"], content["executed"], content["reason"],
                        content["detail"], content["data"]) == ours.content[:7] and content["from"] == 0
            elif path == f"{flight.name}.housekeeping":
                assert [content[key] for key in ("t", "mode", "accepted", "executed", "refused", "last")] == [
                    ours.content[key] for key in ("t", "mode", "accepted", "executed", "refused", "last")]
                assert {key: n for key, n in content.items() if n and key.startswith("reasons.")} == {
                    f"reasons.{key.name.lower()}": n for key, n in ours.content["reasons"].items()}
            else:
                row = int(np.searchsorted(times(export.host.topic(path)), t, side="right")) - 1
                for key, value in content.items():
                    index = tuple(map(int, re.findall(r"\[(\d+)\]", key)))
                    assert column(f"{path}.{key.partition('[')[0]}")[(row, *index)] == value, key
        of_flight = {f"{flight.name}.reports", f"{flight.name}.housekeeping"}
        assert of_flight <= set(seen) <= of_flight | {output.path for output in dictionary.outputs}
        assert len(seen) > 0.6 * len(dictionary.outputs) and max(seen.values()) > 10
        assert name != "plays" or seen["flight.reports"] == 9


@pytest.mark.parametrize("number", long_after(1, range(50) if LONG else [3, 5], "more draws"))
def test_any_packets_of_random_missions_are_read_alike(number, tmp_path):
    """By the file and by fledge.commands: of any bytes, in both byte orders."""
    (tmp_path / "mission.py").write_text(Draft(number).text)
    dice = Random(number)
    for mission in export.read_all(fledge.load(tmp_path)):
        for order, mark in (("big", ">"), ("little", "<")):
            dictionary = export.dictionary(mission, 0x18C0, 0x08C0, order)
            reader = Reader(xtce("random", [packets.database(mission, dictionary)], ground.Ground()))
            for output in dictionary.outputs:
                for _ in range(100 if LONG else 3):
                    body = dice.randbytes(output.size)
                    header = struct.pack(">3H", output.stream, 0xC000 | dice.getrandbits(14), 16 + len(body) - 7)
                    texts = [(f, at) for _, f, at in leaves(output.fields) if f.type == "char"]
                    for f, at in texts:
                        body = body[:at] + b"text".ljust(f.size, b"\0") + body[at + f.size:]
                    path, content = reader.decode(header + bytes(10) + body, f"{mission.process}_packet")
                    assert path == output.path
                    expected = dict(flat(values(raw_fields(output.fields), body, mark)))
                    content = {key.removeprefix(f"{path}."): value for key, value in content.items()
                               if key.startswith(f"{path}.")}
                    assert content.keys() == expected.keys()
                    assert [key for key, value in content.items() if value != expected[key] and not (
                        math.isnan(value) and math.isnan(expected[key]))] == []


@pytest.mark.parametrize("order", ["big", "little"])
def test_what_services_send_is_read_alike(order, tmp_path):
    """On the software bus of cFS, too, it is big-endian."""
    sim = fledge.load(services_test.written(tmp_path / "served", services_test.SERVED, services_test.WATCHES))
    mission = export.read(fledge.load(sim.mission.folder))
    dictionary = export.dictionary(mission, order=order)
    database = packets.database(mission, dictionary)
    reader = Reader(xtce("served", [database], ground.Ground()))
    sim.flight.commands.take_packets()
    sim.scenarios["services"]()
    seen = set()
    for _, raw in sim.flight.commands.take_packets():
        if int.from_bytes(raw[:2], "big") <= dictionary.texts:
            continue
        ours = decoded(sim.flight.commands.dictionary, raw).content
        path, content = reader.decode(raw, "flight_packet")
        seen.add(path)
        if path == "flight.selected":
            assert content[f"{path}.numbers"] == ours.data and content[f"{path}.t"] == ours.t
            assert content[f"{path}.report"] == ours.report and content[f"{path}.left_out"] == 0 == len(ours.left_out)
            continue
        assert path == f"{ours.output}.{ours.name}"
        assert {key.removeprefix(f"{path}."): value for key, value in content.items()
                if key.startswith(f"{path}.") and "spare" not in key} == ours.arguments
        head = {key: content[f"flight.events.{key}"] for key in ("t", "number", "before", "severity")}
        assert head == {"t": ours.t, "number": ours.number, "before": ours.before,
                        "severity": ["", "info", "low", "medium", "high"].index(ours.severity)}
    assert seen >= {"flight.selected", "flight.monitors.event.FIRED", "flight.stored.event.LATE"}
    texts = stations.cosmos("served", [database], ground.Ground())
    assert "FLIGHT_SELECTED BIG_ENDIAN" in texts["targets/FLIGHT/cmd_tlm/1_open.txt"]
    cosmos = Reader(texts["targets/FLIGHT/cmd_tlm/2_database.xtce"])
    assert [name for name in cosmos.containers if "event" in name] == [
        "flight_stored_event", "flight_monitors_event", "flight_events"]
    text = page("served", [mission], [database], ground.Ground())
    assert "| `flight.stored.event.LATE` | `list`, `step`, `late` s |" in text


def raw_fields(fields):
    """The same, with numbers of enumerations."""
    return [replace(f, type="i32" if f.type == "enum" else f.type, fields=raw_fields(f.fields)) for f in fields]


def flat(value, path=""):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from flat(item, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from flat(item, f"{path}[{i}]")
    else:
        yield path, value


# --- commands --------------------------------------------------------------------------------------

def test_every_command_has_the_bytes_that_fledge_sends(folder):
    sim = fledge.load(folder)
    dictionary = sim.flight.commands.dictionary
    reader, ours, dice = Reader(written(sim)), Packets(dictionary), Random(1)
    control = dictionary.block("flight.control")[0]
    expected = {
        "noop": ({}, ours.noop), "reset_counters": ({}, ours.reset_counters), "reset_flight": ({}, ours.reset),
        "mode": ({"mode": "rest"}, lambda: ours.mode("rest")),
        "publish": ({"module": "flight.wheels"}, lambda: ours.publish("flight.wheels")),
        "arm": ({"event": "wide", "on": "off"}, lambda: ours.arm("wide", False)),
        "read": ({"module": "flight.control", "offset": 8, "n": 72}, lambda: ours.read("flight.control", "P")[0]),
        "check": ({"module": "flight.control"}, lambda: ours.check("flight.control")),
        "telemetry": ({"output": "flight.spin.reference", "every": 3},
                      lambda: ours.telemetry("flight.spin.reference", every=3)),
        "stage": ({"module": "flight.control", "offset": 0, "n": 8, "bytes": b"12345678"},
                  lambda: ours.packet(Code.STAGE, struct.pack(">HI8s", control, 0, b"12345678"))),
        "commit": ({"module": "flight.control", "crc": binascii.crc_hqx(b"1234", 0xFFFF)}, lambda: ours.packet(
            Code.COMMIT, struct.pack(">HH", control, binascii.crc_hqx(b"1234", 0xFFFF)))),
        "stage_procedure": ({"slot": 1, "offset": 0, "n": 3, "bytes": b"abc"}, lambda: ours.procedure(b"abc", 9, 1)[0]),
        "start_procedure": ({"slot": 1, "length": 3, "crc": binascii.crc_hqx(b"abc", 0xFFFF), "turns": 9},
                            lambda: ours.procedure(b"abc", 9, 1)[1]),
        "stop_procedure": ({"slot": 1}, lambda: ours.stop(1)),
        "evaluate": ({"n": 3, "bytes": "f.K"}, lambda: ours.evaluate("f.K"))}
    for block in dictionary.blocks:
        for path, field, at in leaves(block.fields):
            if field.name.startswith("spare"):
                continue
            n = math.prod(field.shape)
            raw = b"".join(encoded(field, dice.choice([*field.enumerators.values()] or [dice.randrange(100)]), [])
                           for _ in range(n))
            names = [path + "".join(f"[{i}]" for i in index) for index in np.ndindex(*field.shape)]
            numbers = [number for number in struct.unpack(f">{n}{'d' if field.type == 'f64' else 'i'}", raw)]
            expected[f"write_{name_of(block.path.partition('.')[2] + '.' + path)}"] = (
                {name_of(name): number for name, number in zip(names, numbers)},
                lambda block=block, at=at, raw=raw: ours.write_bytes(block.path, {at: raw})[0])
    concrete = [name for name, command in reader.commands.items() if command.get("abstract") != "true"]
    assert sorted(concrete) == sorted(f"flight_{name}" for name in expected)
    for name, (arguments, send) in expected.items():
        sent = send()
        assert reader.encode(f"flight_{name}", int.from_bytes(sent[2:4], "big") & 0x3FFF, **arguments) == sent, name
    k = reader.argument_types["flight_write_control_K_K"]
    assert k.find("UnitSet/Unit").text == "N m" and k.find("ValidRangeSet/ValidRange").attrib == {"minExclusive": "0.0"}


def argument(form, dice):
    """A value of an argument, within its range."""
    kind, bits, low, high = form["type"], form["size"], form["low"], form["high"]
    if form["labels"]:
        return dice.choice(form["labels"])
    if kind == "binary":
        return dice.randbytes(dice.randint(1, 40))
    if kind == "text":
        return "".join(dice.choice("ab/x>") for _ in range(dice.randint(1, bits or 30)))
    if kind == "real":
        low, high = -1e3 if low is None else low, 1e3 + abs(low or 0) if high is None else high
        return dice.uniform(low, high)
    least, most = (0, 2**bits - 1) if kind == "natural" else (-2**(bits - 1), 2**(bits - 1) - 1)
    return dice.randint(least if low is None else math.floor(low) + form["low_open"],
                        most if high is None else math.ceil(high) - form["high_open"])


def writers(dictionary):
    """Name of a command that writes -> (maker of packets, block, field, offset) of what it writes."""
    for block in dictionary.blocks:
        process, _, module = block.path.partition(".")
        for path, field, at in leaves(block.fields):
            yield f"{process}.write.{module}.{path}", (Packets(dictionary), block, field, at)


def by_packets(writer, first, given):
    """The packet of the same values by fledge.commands."""
    maker, block, field, at = writer
    inner = field.shape[-1:] if field.type == "char" else []
    raw = b"".join(encoded(field, value, inner) for value in given)
    packet, = maker.write_bytes(block.path, {at + int(first or 0) * ELEMENTS[field.type].size: raw})
    return packet


def check_telemetry(database, dictionary, dice):
    """Random outputs of a mission have the same values by its database and by fledge.commands, in the same order."""
    for output in dictionary.outputs:
        body = bytearray(dice.randbytes(output.size))
        for _, field, at in leaves(output.fields):
            if field.type == "char":
                body[at:at + field.size] = b"text".ljust(field.shape[-1], b"\0") * (field.size // field.shape[-1])
            elif field.type == "enum" and dice.random() < 0.7:
                body[at:at + 4] = encoded(field, dice.choice([*field.enumerators.values()]), [])
        packet = struct.pack(">3HIH4x", output.stream, 0xC000, 16 + len(body) - 7, 0, 0) + body
        decoded_, ours = database.decode(packet), [value for _, value in flat(decoded(dictionary, packet).content)]
        rows = [value if isinstance(value, str) else raw for _, raw, value in decoded_.rows[len(packets.HEADER):]]
        assert decoded_.reason == "" and len(rows) == len(ours) > 0, output.path
        assert all(a == b or a != a and b != b for a, b in zip(rows, ours)), output.path


def check_database(sim, path):
    """Every command of a mission, with random arguments, is decoded to itself and to these. Parameters are written, and
    outputs read, as by fledge.commands."""
    path.write_text(written(sim), encoding="utf-8")
    database, dice, seen = fledge.ground.Database.load(path), Random(3), set()
    known = {name: command for flight in sim.flights for name, command in writers(flight.commands.dictionary)}
    streams = [flight.commands.dictionary.outputs[0].stream for flight in sim.flights]
    for flight in sim.flights if len(set(streams)) == len(streams) else ():     # else the database knows the first
        check_telemetry(database, flight.commands.dictionary, dice)
    for form in database.forms():
        arguments = form["arguments"]
        given = {a["name"]: argument(a, dice) for a in arguments}
        for a in arguments:
            if a["counted_by"]:
                raw = given[a["name"]]
                given[a["counted_by"]] = len(raw.encode() if isinstance(raw, str) else raw)
        bare = database.encode(form["path"], **given)
        name, _, first = form["name"].partition(".from_")
        if name in known:
            ours = by_packets(known[name], first, [given[a["name"]] for a in arguments])
            assert (ours[:2], ours[6], ours[8:]) == (bare[:2], bare[6], bare[8:]), form["name"]
        sent = checksummed(numbered(bare, dice.getrandbits(14)))
        command = database.decode_command(sent, "cfs")
        assert command.reason == "" and command.bits == 8 * len(sent) and command.arguments == given, form["name"]
        assert command.command == form["path"] or bare in seen, form["name"]    # as of another process with its stream
        assert database.encode(command.command, **command.arguments) == bare
        seen.add(bare)
        assert database.decode_command(sent[:6] + bytes([sent[6] ^ 0x40]) + sent[7:], "cfs").command is None
        assert database.decode_command(sent + b"\0", "cfs").command in (None, *(
            [form["path"]] if any(a["counted_by"] for a in arguments) else []))
        assert database.decode_command(sent[:-1], "cfs").command != form["path"] or any(
            a["counted_by"] for a in arguments), form["name"]
    return database


def test_every_command_is_decoded_to_what_was_commanded(folder, tmp_path):
    sim = fledge.load(folder)
    database, ours = check_database(sim, tmp_path / "plays.xml"), Packets(sim.flight.commands.dictionary)
    for sent, name, arguments in (
            (ours.mode("rest"), "mode", {"mode": "rest"}), (ours.evaluate("f.K", 9), "evaluate",
                                                            {"zero": 0, "turns": 9, "bytes": "f.K", "n": 3}),
            (ours.write("flight.control", K=2)[0], "write_control_K", {"K": 2.0})):
        command = database.decode_command(sent, "cfs")
        assert command.command == f"/plays/flight_{name}" and command.arguments == arguments
    both, = ours.write("flight.control", K=2, P=np.eye(3).tolist())
    command = database.decode_command(both, "cfs")
    assert command.command is None and "the packet is longer than a /plays/flight_write_control_K" in command.reason
    assert database.decode_command(sent, "ccsds").command is None       # for the checksum is compared
    with pytest.raises(SetupError, match="a header is none, ccsds or cfs; found aos"):
        database.decode_command(sent, "aos")


@pytest.mark.long("writes and reads the databases of all missions")
@pytest.mark.parametrize("name", sorted(missions()))
def test_packets_of_all_missions_are_the_same_by_their_databases(name, tmp_path):
    sim = fledge.load(name)
    if sim.flights:
        check_database(sim, tmp_path / "mission.xml")


def test_a_long_array_is_several_commands_each_within_the_longest():
    sim = fledge.load("orbit_raising")
    for database in databases(sim):
        for command in database.commands:
            assert sum(item.bits for item in command.items) <= 8 * DATA_MAX
        writes = [command for command in database.commands if ".write." in command.path]
        size = sum(item.bits for command in writes for item in command.items) // 8
        spare = sum(f.size for block in database.dictionary.blocks for _, f, _ in leaves(block.fields)
                    if f.name.startswith("spare"))
        assert size + spare == sum(block.size for block in database.dictionary.blocks)


def test_a_parameter_may_have_the_name_of_an_argument_of_all_commands(folder):
    database, = databases(fledge.load(folder))
    more = packets.Command("flight.write.control.offset", "", [packets.number("offset", "u16")], "flight.write",
                           {"module": 5, "offset": 8})
    reader = Reader(xtce("plays", [replace(database, commands=[*database.commands, more])], ground.Ground()))
    assert reader.encode("flight_write_control_offset", 0, offset_2=7)[10:] == struct.pack(">HIH", 5, 8, 7)


def test_reports_verify_a_command(folder):
    root = Reader(written(fledge.load(folder), "yamcs")).commands["flight_mode"]
    reasons = {}
    for verifier in root.find("VerifierSet"):
        reasons[verifier.tag] = [[(node.get("parameterRef") or node.text) for node in condition]
                                 for condition in verifier.iter("Condition")]
    sent = ["flight_reports_sequence", "==", "/yamcs/cmdHist/ccsds-seqcount"]
    of = [["flight_reports_code", "==", "2"]]
    assert reasons == {
        "AcceptedVerifier": [*of, ["flight_reports_executed", "==", "0"], ["flight_reports_reason", "==", "0"], sent],
        "CompleteVerifier": [*of, ["flight_reports_executed", "==", "1"], ["flight_reports_reason", "==", "0"], sent],
        "FailedVerifier": [*of, ["flight_reports_reason", "!=", "0"], sent]}


# --- ground.toml -----------------------------------------------------------------------------------

def test_the_file_of_the_ground_adds_calibrations_limits_and_hazards(folder):
    (folder / "ground.toml").write_text(GROUND)
    sim = fledge.load(folder)
    reader = Reader(written(sim))
    for i in range(3):
        kind = reader.types[f"flight_tracking_error_sigma_BR_{i}"]
        assert kind.find("UnitSet/Unit").text == "deg"
        assert [term.attrib for term in kind.iter("Term")] == [{"coefficient": "0.0", "exponent": "0"},
                                                               {"coefficient": "229.0", "exponent": "1"}]
        ranges = kind.find("DefaultAlarm/StaticAlarmRanges")
        assert ranges.find("WarningRange").attrib == {"minInclusive": "-5.0", "maxInclusive": "5.0"}
        assert float(ranges.find("CriticalRange").get("minInclusive")) < -1e300
    both = reader.types["flight_wheels_wheels_n"].find("DefaultAlarm/StaticAlarmRanges")
    assert [(range_.tag, float(range_.get("minInclusive")))
            for range_ in both] == [("WarningRange", 1), ("CriticalRange", 1)]
    hazardous = [name for name, command in reader.commands.items() if command.find("DefaultSignificance") is not None]
    assert hazardous and all(name.startswith("flight_write_control_") for name in hazardous)
    assert next(reader.root.iter("CompleteVerifier")).find("CheckWindow").get("timeToStopChecking") == "PT20S"
    database = databases(sim)
    texts = stations.cosmos(sim.name, database, ground.read(folder, database))
    assert '  HAZARDOUS "the loop may become unstable "' in texts["targets/FLIGHT/cmd_tlm/3_commands.txt"]


@pytest.mark.parametrize("text, complaint", [
    ("limits = 3", "only known keys count"), ("completed_within = -1", "`completed_within` is > 0 s"),
    ('[telemetry."flight.tracking.eror.sigma_BR"]', "did you mean flight.tracking.error.sigma_BR?"),
    ('[telemetry."flight.housekeeping.mode"]\nwarning = [0, 1]', "only numbers have calibrations and limits"),
    ('[telemetry."flight.tracking.error.sigma_BR"]\nwarn = [0, 1]', "did you mean `warning`?"),
    ('[telemetry."flight.tracking.error.sigma_BR"]\nwarning = [1, 0]', "give the lower one first"),
    ('[telemetry."flight.tracking.error.sigma_BR"]\nwarning = [1]', "`warning` has 2 numbers; it is [1]"),
    ('[telemetry."flight.tracking.error.sigma_BR"]\npolynomial = [inf]', "`polynomial` has finite numbers"),
    ('[commands."flight.mod"]\nhazardous = "x"', "did you mean flight.mode?"),
    ('[commands."flight.mode"]', "`hazardous` must be given")])
def test_a_wrong_file_of_the_ground_is_refused_with_its_line(folder, text, complaint):
    (folder / "ground.toml").write_text(text)
    with pytest.raises(SetupError) as error:
        written(fledge.load(folder))
    assert complaint in str(error.value) and re.match(r"\S*ground.toml:[12]: ", str(error.value))


# --- ground stations -------------------------------------------------------------------------------

def test_several_flight_processes_have_a_file_links_and_targets_of_their_own(tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["export", "xtce", "formation", "--yamcs", "--cosmos", "--out", str(out)]) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert cli.main(["export", "xtce", "formation", "--yamcs", "--cosmos", "--out", str(out)]) == 0
    assert before == {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    reader = Reader((out / "yamcs/mdb/formation.xml").read_text())
    lines = (out / "yamcs/etc/yamcs.formation.yaml").read_text().splitlines()
    roots = [line.rpartition("/")[2] for line in lines if "rootContainer" in line]
    assert roots == ["chief_guidance_packet", "chief_packet", "deputy_packet"]
    assert all(reader.containers[root].get("abstract") == "true" for root in roots)
    patterns = [re.compile(line.partition('"')[2].partition('"')[0]) for line in lines if "tcPatterns" in line]
    for name in reader.commands:
        first = next(pattern.pattern for pattern in patterns if pattern.fullmatch(f"/formation/{name}"))
        process = max((root[:-6] for root in roots if name.startswith(root[:-6])), key=len)
        assert first == f"/formation/{process}.*"
    plugin = (out / "cosmos/plugin.txt").read_text()
    for i, target in enumerate(("CHIEF_GUIDANCE", "CHIEF", "DEPUTY")):
        assert f"TARGET {target} {target}\n" in plugin and f"{target.lower()}_telemetry_port {10015 + i}\n" in plugin
        text = (out / f"cosmos/targets/{target}/cmd_tlm/2_database.xtce").read_text()
        assert "InstanceRef" not in text and "Verifier" not in text
    assert cli.main(["export", "c", "nadir_spin", "--yamcs"]) == 2
    assert "--yamcs is for `export xtce`" in capsys.readouterr().err


RUBY = """
module OpenC3
  class Protocol
    def initialize(allow_empty_data) end
    def read_data(data, extra = nil) return data, extra end
  end
end
$LOADED_FEATURES << File.expand_path('openc3/interfaces/protocols/protocol.rb', '.')
$LOAD_PATH.unshift '.'
load 'flight_link_protocol.rb'
link = OpenC3::FlightLinkProtocol.new('129', 'big')
ARGV.each do |digits|
  raw = [digits].pack('H*')
  if raw.getbyte(0) == 0x18 then puts link.write_data(raw)[0].unpack1('H*') else link.read_data(raw) end
end
"""


@needs("ruby")
def test_the_link_of_cosmos_gives_a_command_what_is_missing(folder, tmp_path):
    sim = fledge.load(folder)
    all_ = databases(sim)
    (tmp_path / "openc3/interfaces/protocols").mkdir(parents=True)
    (tmp_path / "openc3/interfaces/protocols/protocol.rb").write_text("")
    (tmp_path / "flight_link_protocol.rb").write_text(
        stations.cosmos(sim.name, all_, ground.Ground())["lib/flight_link_protocol.rb"])
    (tmp_path / "run.rb").write_text(RUBY)
    ours = Packets(all_[0].dictionary)
    bare = [bytes([*packet[:2], 0xC0, 0, 0, 0, packet[6], 0, *packet[8:]])
            for packet in (ours.mode("rest"), ours.noop())]
    refusal = struct.pack(">HHHIHI", 0x0881, 0xC000, 33, 0, 0, 0) + struct.pack(">qHHHHHH4x", 0, 1, 0, 0, 17, 0x3FFF, 0)
    done = subprocess.run(["ruby", "run.rb", *(packet.hex() for packet in (*bare, refusal, *bare))], cwd=tmp_path,
                          capture_output=True, text=True, check=True)
    ours = Packets(all_[0].dictionary)
    expected = [ours.mode("rest"), ours.noop()] * 2
    expected[2:] = [Packets(all_[0].dictionary, 0x4000).mode("rest"), Packets(all_[0].dictionary, 1).noop()]
    assert [bytes.fromhex(line) for line in done.stdout.split()] == expected


def test_the_database_of_the_ground_reads_flights_packets_by_this_file(tmp_path):
    sim = fledge.load("nadir_spin")
    text = written(sim)
    path = tmp_path / "nadir_spin.xml"
    path.write_text(text, encoding="utf-8")
    database, reader = fledge.ground.Database.load(path), Reader(text)
    assert database.notes == []
    commands = sim.flight.commands
    commands.take_packets()
    commands.telemetry()
    commands.telemetry("housekeeping", every=2)
    sim.run(5 * fledge.units.s)
    all_ = commands.take_packets()
    assert len(all_) > 50
    for piece in all_:
        packet = database.decode(piece.packet)
        alias, values_ = reader.decode(piece.packet, "flight_packet")
        assert packet.reason == "" and packet.bits == 8 * len(piece.packet)
        assert reader.alias(reader.containers[packet.container.rpartition("/")[2]]) == alias
        assert {reader.alias(reader.parameters[name]): raw for name, raw, _ in packet.rows} == pytest.approx(
            values_, rel=0, abs=0, nan_ok=True)
    raw = bytearray(database.encode("flight_write_control_K", K=3.0))     # its link fills in what follows
    raw[4:6] = (len(raw) - 7).to_bytes(2, "big")
    ours, = commands.packets.write("flight.control", K=3.0)
    raw[2:4], raw[7] = ours[2:4], ours[7]
    assert bytes(raw) == ours


def test_pdus_of_files_have_their_header_in_words(folder, tmp_path):
    (folder / "flight.py").write_text(FLIGHT + "    f.files = fsw.Files(entity=2, ground=1, rate=4000 / s)\n"
                                      "    f.task('files', every=100 * ms, run=[f.files])\n")
    sim = fledge.load(folder)
    text = written(sim)
    (tmp_path / "craft.xml").write_text(text, encoding="utf-8")
    database, reader = fledge.ground.Database.load(tmp_path / "craft.xml"), Reader(text)
    commands, packets = sim.flight.commands, sim.flight.commands.packets
    commands.take_packets()
    commands.send(packets.dump_table("flight.control", "table"))
    commands.send(packets.send_file("table"))
    sim.run(3 * fledge.units.s)
    sent = [packet for packet in map(lambda report: report.packet, commands.take_packets())
            if decoded(commands.dictionary, packet).path == "files"]
    size = len(commands.table(sim.flight.control))
    assert [packet[28] if packet[16] & 0x10 == 0 else "data" for packet in sent] == [7, "data", 4]     # METADATA, EOF
    for packet in sent:
        file = database.decode(packet)
        assert file.reason == "" and file.bits == 8 * len(packet) and file.container.endswith("/flight_files")
        values_ = {name.removeprefix("flight_files_"): value for name, _, value in file.rows}
        number = int.from_bytes(packet[22:26], "big")
        assert {name: values_[name] for name in ("pdu_version", "pdu_type", "direction", "mode", "crc", "large", "n",
                                                 "source", "transaction", "destination")} == {
            "pdu_version": 1, "pdu_type": "file_data" if packet[16] & 0x10 else "directive", "direction": "to_receiver",
            "mode": "acknowledged", "crc": "none", "large": "places_of_32_bits", "n": len(packet) - 28, "source": 2,
            "transaction": number, "destination": 1}
        assert bytes(values_["data"]) == packet[28:]
        assert reader.decode(packet, "flight_packet")[1]["flight.files.source"] == 2
    assert len(sent[1]) == 28 + 4 + size


def test_stored_commands_are_commanded_alike(folder):
    (folder / "flight.py").write_text(STORED)
    sim = fledge.load(folder)
    reader, ours = Reader(written(sim)), Packets(sim.flight.commands.dictionary)
    step = ours.mode("rest")
    for name, sent, given in (
            ("store", ours.store(2, 7, 1_500_000_000, step), {"list": 2, "step": 7, "time": 1_500_000_000,
                                                              "n": len(step), "bytes": step}),
            ("delete", ours.delete(2), {"list": 2, "step": 65535}), ("list", ours.stored(2), {"list": 2}),
            ("control", ours.control(Action.HOLD, 2), {"list": 2, "action": "hold", "crc": 0})):
        crc = int.from_bytes(sent[10:12], "big") if name == "store" else 0
        given |= {"crc": crc} if name == "store" else {}
        assert reader.encode(f"flight_{name}", int.from_bytes(sent[2:4], "big") & 0x3FFF, **given) == sent, name
    assert [name for name in reader.commands if name.startswith("flight_write_stored_")] == [
        f"flight_write_stored_{name}" for name in ("late", "clocked", "inhibited", "slot")]
