# SPDX-License-Identifier: Apache-2.0
"""Commands and telemetry of FMUs of flight (FMI 3.0), and the lines of their log, by the library's functions."""

import ctypes as c
import platform
import zipfile
from xml.etree import ElementTree

import pytest

import fledge
from fledge.commands import Code, Reason
from fledge.export.fmu.build import export
from fledge.export.fmu.composition import simulation_fmu
from fledge.export.fmu.mission import flight_fmu

LOG = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)
TRUE = c.c_bool(True)
FALSE = c.c_bool(False)


class Instance:
    """An instance of an FMU of 3.0. Functions that fail are errors, but for those of `status`."""

    def __init__(self, system, folder):
        with zipfile.ZipFile(export(system, folder / "flight.fmu")) as archive:
            archive.extractall(folder)
        token = ElementTree.parse(folder / "modelDescription.xml").getroot().attrib["instantiationToken"]
        library = folder / f"binaries/{platform.machine()}-linux/{system.facts.identifier}.so"
        self.library, self.lines = c.CDLL(str(library)), []
        self.references = {v.name: v.reference for v in system.layout.variables}
        self.log = LOG(lambda _, status, category, text: self.lines.append((category.decode(), text.decode())))
        self.library.fmi3InstantiateCoSimulation.restype = c.c_void_p
        self.instance = c.c_void_p(self.library.fmi3InstantiateCoSimulation(
            b"flight", token.encode(), str(folder / "resources").encode() + b"/", FALSE, TRUE, FALSE, FALSE, None,
            c.c_size_t(0), None, self.log, None))
        assert self.instance
        self.call("EnterInitializationMode", FALSE, c.c_double(0), c.c_double(0), FALSE, c.c_double(0))
        self.call("ExitInitializationMode")

    def status(self, name, *arguments):
        return getattr(self.library, f"fmi3{name}")(self.instance, *arguments)

    def call(self, name, *arguments):
        assert self.status(name, *arguments) == 0, (name, self.lines)

    def reference(self, name):
        return c.byref(c.c_uint32(self.references[name]))

    def send(self, packets):
        content = (c.c_uint8 * len(packets)).from_buffer_copy(packets)
        self.call("SetBinary", self.reference("flight.uplink"), c.c_size_t(1), c.byref(c.c_size_t(len(packets))),
                  c.byref(c.cast(content, c.POINTER(c.c_uint8))), c.c_size_t(1))

    def sent(self):
        size, place = c.c_size_t(), c.POINTER(c.c_uint8)()
        self.call("GetBinary", self.reference("flight.downlink"), c.c_size_t(1), c.byref(size), c.byref(place),
                  c.c_size_t(1))
        return c.string_at(place, size.value) if size.value else b""

    def step(self, t, h):
        found = [c.c_bool(), c.c_bool(), c.c_bool()]
        reached = c.c_double()
        return self.status("DoStep", c.c_double(t), c.c_double(h), FALSE, *map(c.byref, found), c.byref(reached))

    def set(self, name, value):
        self.call("SetFloat64", self.reference(name), c.c_size_t(1), c.byref(c.c_double(value)), c.c_size_t(1))

    def number(self, name):
        value = c.c_double()
        self.call("GetFloat64", self.reference(name), c.c_size_t(1), c.byref(value), c.c_size_t(1))
        return value.value

    def free(self):
        self.library.fmi3FreeInstance(self.instance)


@pytest.mark.parametrize("make", [flight_fmu, simulation_fmu])
def test_commands_and_telemetry_are_those_of_the_desktop(make, tmp_path):
    """Of a link that sends commands between the instants 0 and 0.5 s: the packets have the same bytes."""
    sim, fmu = fledge.load("nadir_spin"), Instance(make(fledge.load("nadir_spin")), tmp_path)
    commands = sim.flight.commands
    packets = commands.packets
    script = [packets.noop(), packets.telemetry("housekeeping"), *packets.write("flight.control", K=-1.0),
              *packets.read("flight.wheels", "u_max"), *packets.write("flight.wheels", u_max=[0.1, *[0.2] * 7])]
    commands.script([(0, packet) for packet in script])
    commands.take_packets()
    fmu.send(b"".join(script))
    found = b""
    for step in range(8):
        assert fmu.step(0.5 * step, 0.5) == 0
        found += fmu.sent()
    sim.run(until=4.0)
    expected = [packet.packet for packet in commands.take_packets()]
    assert len(expected) > 12 and found == b"".join(expected)
    assert make is simulation_fmu or [text for category, text in fmu.lines if category == "commands"] == [
        f"the command 2 of code {Code.WRITE:d} is refused for reason {Reason.RULE:d}"]
    fmu.free()


def test_a_parameter_that_breaks_its_rule_is_refused_with_the_rule(tmp_path):
    """The step is discarded, and the old number is back."""
    fmu = Instance(flight_fmu(fledge.load("nadir_spin")), tmp_path)
    assert fmu.step(0.0, 0.5) == 0
    fmu.set("flight.control.K", -2.0)
    assert fmu.step(0.5, 0.5) == 2
    assert any(text == "flight.control.K must be 0 or of size 1e-100 to 1e100, > 0 N m; found -2"
               for _, text in fmu.lines)
    assert fmu.number("flight.control.K") == 2.531
    assert fmu.step(0.5, 0.5) == 0
    fmu.free()
