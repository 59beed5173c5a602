# SPDX-License-Identifier: Apache-2.0
"""The ground sends the plan of the orbit insertion: tables of the start, which outlive resets, and the sequence of
commands, which flight executes by itself, for the Earth is 11 minutes away.

    ./fledge ground run missions/mars_orbiter/uplink.py --to mars_orbiter --yes
"""
from math import hypot
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fledge import flight as fsw
from fledge import world
from fledge.commands import Action, Packets, table
from fledge.mission.commands import block_bytes, fill_store
from fledge.units import day, km, m, minute, rad, s

from .mission import DATE
from .plan import Plan, elements, plan
from .preset import STOP
from .vehicle import EPOCH, STORED

# Before the burn, and after its start.
WAKES, TURNS, RESETS, AGAIN, SETTLES = 50 * minute, 35 * minute, 25 * minute, 18 * minute, 1 * minute
IN_ORBIT, TO_MARS = 60 * minute, 61 * minute


def run(craft, script):
    """Send tables and sequence, and let flight sleep."""
    planned = plan()
    with script.step("telemetry"):
        for output in ("flight.line.heading", "flight.filter.attitude", "flight.files.state", "flight.burn.state",
                       "flight.burned.kept", "flight.stored.state"):
            craft.command("telemetry", output, every=2).completed(within=10 * s)
    with script.step("the store is back"):
        craft.wait(lambda t: t.flight.files.state.booted, within=2 * minute)
    with script.step("tables"), TemporaryDirectory() as folder:
        for name, (module, start) in tables(planned, craft.dictionary).items():
            path = Path(folder) / name
            path.write_bytes(table(craft.dictionary, f"flight.{name}", block_bytes(module)))
            to = f"boot/{name}" if start else name
            craft.put(path, to=to, within=1 * minute)
            if start:
                craft.command("load_table", f"flight.{name}", to).completed(within=10 * s)
        craft.command("write", "flight.engines", armed=1).completed(within=10 * s)
        craft.command("dump_table", "flight.engines", "boot/engines").completed(within=10 * s)
    with script.step("the recorder has them"):
        craft.wait(lambda t: not t.flight.files.state.waiting, within=1 * minute)
    with script.step("it points at the Sun, and navigation locks"):
        craft.wait(lambda t: hypot(*t.flight.line.heading.s_B[1:]) < 0.01, within=20 * minute)
        craft.wait(lambda t: t.flight.filter.attitude.head.quality == "QUALITY_GOOD", within=5 * minute)
        craft.command("mode", "sleep").completed(within=10 * s)


def tables(planned: Plan, dictionary: Any) -> dict[str, tuple[Any, bool]]:
    """name of a module -> the module with what the ground wants, and whether it counts from now and at each start."""
    sky = world.Sky(DATE, center=world.MARS)
    near = {body: world.fit_ephemeris(sky, body, within=1 * km, duration=4 * day) for body in (world.SUN, world.EARTH)}
    return {
        "epoch": (fsw.TimeCorrelation(clock_0=EPOCH, time_0=0 * s), True),
        "sun_at": (fsw.ChebyshevEphemeris(**near[world.SUN]), True),
        "earth_at": (fsw.ChebyshevEphemeris(**near[world.EARTH]), True),
        "orbit": (elements(planned.capture, planned.ends), False),
        "plan": (fsw.BurnPlan(n=1, start=[planned.start] * s, dv_N=[planned.dv_N] * m / s,
                              rate_N=[planned.rate_N] * rad / s), True),
        "stored": (fill_store(fsw.StoredCommands(**STORED), sequence(planned, dictionary)), True)}


def sequence(planned: Plan, dictionary: Any) -> list[bytes]:
    """The commands, by the vehicle's clock; and the list that a burn which was aborted starts."""
    p = Packets(dictionary)
    steps = [(-WAKES, p.mode("sun")), (-TURNS, p.mode("delta_v")),
             (-RESETS, p.write("flight.power", reset_computer=1)[0]), (-AGAIN, p.mode("delta_v")),
             (-SETTLES, p.write("flight.mapping", off_pulse=1)[0]),
             (IN_ORBIT, p.load_table("flight.orbit", "orbit")), (TO_MARS, p.mode("mars"))]
    return [*(p.store(0, step, round((EPOCH.value + planned.start + time.value) * 1e9), command)
              for step, (time, command) in enumerate(steps)),
            *p.store_sequence(STOP, [(0, p.control(Action.INHIBIT, 0))])]
