# SPDX-License-Identifier: Apache-2.0
"""The first difference between what a target describes and what the desktop composed is found and named."""

import pytest

import fledge
from fledge import export, objects
from fledge.targets.micropython.export.check import LISTED, expected, first_difference
from fledge.export.run_test import FLIGHT, WORLD

MORE = '''
    f.mode("looks", [], when=f.watch(f.tracking.error).sigma_BR[1] < 0.5, after=["wait"])
    f.event("more", when=f.watch(f.tracking.error).sigma_BR[1] > 0.5, until=f.watch(f.switch).rates.norm() > 1,
            modes=["wait"], arm="off", disarm=["late"], set=[(f.watch(f.switch).rates, [0, 0, 1e-3] * rad / s)])
'''


@pytest.fixture(scope="module")
def composed(tmp_path_factory):
    """A mission with four rates, modes and five events: it, its process, and what a target says that agrees."""
    folder = tmp_path_factory.mktemp("check") / "modes"
    folder.mkdir()
    (folder / "flight.py").write_text(FLIGHT.replace("import N,", "import N, rad,") + MORE)
    (folder / "world.py").write_text(WORLD)
    sim = fledge.load(folder)
    mission = export.read(sim)
    flight = sim.flight
    lines = []
    for name, module in flight.instances.items():
        raw = objects.memory(module)
        lines.append(f"module {name} {objects.struct(module).name}")
        lines += [f"bytes {name} {at} {raw[at:at + 32].hex()}" for at in range(0, len(raw), 32) if any(raw[at:at + 32])]
    lines += [f"{kind} {line}" for kind, lines in expected(mission, flight).items() for line in lines]
    return sim, mission, flight, lines


def difference(composed, change):
    _, mission, flight, lines = composed
    return first_difference(mission, flight, change(list(lines)))


def test_what_agrees_has_no_difference(composed):
    assert difference(composed, lambda lines: lines) == ""
    kinds = {line.partition(" ")[0] for line in composed[3]}
    assert {"wire", *LISTED} - {"reset"} <= kinds


def test_the_order_of_wires_and_the_splitting_of_settings_do_not_count(composed):
    def change(lines):
        sets = [line for line in lines if line.startswith("sets ")]
        rest = [line for line in lines if not line.startswith("sets ")]
        joined = {}
        for line in sets:
            _, event, place, raw = line.split()
            module, _, offset = place.partition("+")
            start, so_far = joined.get((event, module), (offset, ""))
            joined[event, module] = start, so_far + raw
        return [*sorted(rest, key=lambda line: line.startswith("wire "), reverse=True),
                *(f"sets {event} {module}+{start} {raw}" for (event, module), (start, raw) in joined.items())]

    assert difference(composed, change) == ""


@pytest.mark.parametrize("kind, old, new, message", [
    ("bytes control", "", "ff", "flight.control.par.K has other bits: here "),
    ("module control", "MrpFeedback", "TrackingError", "the script there makes no control, a MrpFeedback"),
    ("task ", " 0", " 1", "the task "),
    ("event ", " 1 ", " 2 ", "the event "),
    ("when ", "0x", "0x0", "the condition of the event "),
])
def test_each_difference_is_named(composed, kind, old, new, message):
    def change(lines):
        at = next(i for i, line in enumerate(lines) if line.startswith(kind) and old in line[len(kind):])
        if kind == "bytes control":
            place = next(f.offset for f in objects.struct(composed[2].control).fields if f.name == "K")
            lines.append(f"bytes control {place} {new}")
        else:
            head, rest = lines[at][:len(kind)], lines[at][len(kind):]
            lines[at] = head + rest.replace(old, new, 1)
        return lines

    assert message in difference(composed, change)


@pytest.mark.parametrize("kind", ["module", "wire", *(kind for kind in LISTED if kind != "reset")])
def test_what_one_of_them_lacks_is_a_difference(composed, kind):
    def without(lines):
        lines.remove(next(line for line in lines[::-1] if line.startswith(f"{kind} ")))
        return lines

    assert difference(composed, without)


def test_a_wire_is_named_with_its_ends(composed):
    text = difference(composed, lambda lines: [*lines, "wire a.out b.in 2000000000"])
    assert text == "the wire a.out >> b.in, stale after 2 s, is only there"
    text = difference(composed, lambda lines: [*lines, "wire a.out b.in 0 newest 1"])
    assert text == "the wire a.out >> b.in, newest 1, is only there"
