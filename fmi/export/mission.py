# SPDX-License-Identifier: Apache-2.0
"""An exported mission as the system of an FMU: the variables of its messages and parameters, and MISSION_fmu.c, by
which fmi/fmu/mission.c flies it."""
from __future__ import annotations

from collections.abc import Sequence
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import __version__
from fledge.commands import parameters
from fledge.disk import ROOT
from fledge.export.c_source import emit as emit_c, refuse_scripts, written
from fledge.export.c_text import string, wrap
from fledge.export.commands import dictionary, emit_commands
from fledge.export.fmu.build import FUNCTIONS, System
from fledge.export.fmu.description import Facts
from fledge.export.fmu.variables import Event, Layout, Message, Parameters, Process, listed
from fledge.export.names import identifier
from fledge.export.packets import UNWRITTEN
from fledge.export.read import ExportError, read
from fledge.targets.build import COMMAND, math_sources, module_sources

if TYPE_CHECKING:
    from fledge.export.read import Mission

# What flies a mission in an FMU.
SYSTEM = [*FUNCTIONS, "fmi/fmu/mission.c", *COMMAND]


def flight_fmu(sim: Any, process: str | None = None, roots: Sequence[Path] = (), heads: bool = True) -> System:
    """The system of a flight process of a simulation which has not run. roots: of projects whose modules it has; heads:
    see variables.listed(). Raises SetupError."""
    mission = read(sim, process)
    mission.form = "fmu"
    refuse_scripts(mission)
    if (frames := dictionary(mission).frames) is not None and frames.secured:
        raise ExportError(f"{mission.title}: its link secures frames, and an FMU has no keys: export it without")
    variables, roots = layout(mission, heads), [*(root.resolve() for root in roots), ROOT]
    sources = [*module_sources(mission, roots), *math_sources(), *(ROOT / path for path in SYSTEM)]
    named = {next(path.relative_to(root).as_posix() for root in roots if path.is_relative_to(root)): path
             for path in sources}
    commands = emit_commands(mission)
    packets = {name: commands.pop(name) for name in list(commands) if name.endswith(".json")}
    return System(facts(mission), variables, lambda token: emit_c(mission) | commands | emit(mission, variables, token),
                  named, roots, packets)


def facts(mission: Mission, on: str = "") -> Facts:
    """Its step is the longest at whose multiples its tasks run. on: a target, which flies it in the FMU."""
    times = [time for task in mission.tasks for time in (task.period, task.offset) if time]
    name = f"{mission.folder} {mission.process}" + (f" {on}" if on else "")
    return Facts(name, identifier(name), mission.about, f"Fledge {__version__}", gcd(*times) / 1e9)


def layout(mission: Mission, heads: bool = True) -> Layout:
    """Its variables. Blocks of memory are those of the parameters, then the messages."""
    owners = [m for m in mission.modules if m.fields("par")]
    blocks = [Parameters(m.path, m.struct, i, -parameters(m.struct)[1], m.memory, left_out=UNWRITTEN.get(m.type, ()))
              for i, m in enumerate(owners)]
    roles = {"in": "input", "out": "output", "inside": "local"}
    messages = [Message(m.path, m.struct, roles[m.direction], i, 0, latency=m.latency)
                for i, m in enumerate((*mission.inputs, *mission.outputs), len(owners))]
    modes = [Process(mission.process, [mission.mode_titles[mode] for mode in mission.modes])] if mission.modes else []
    return listed(messages, blocks, modes, [Event(mission.process, e.title, e.when) for e in mission.events],
                  {mission.process: dictionary(mission).room}, heads)


def emit(mission: Mission, variables: Layout, token: str) -> dict[str, str]:
    """MISSION_fmu.c"""
    name, struct, facts = mission.name, mission.struct(), dictionary(mission)
    lines = [*written(mission), f'#include "{name}_commands.h"', '#include "fmi/fmu/mission.h"', "",
             *variables.c_table(), ""]
    for function, result, parameter in (("init", "void", "void *"), ("restart", "void", "void *"),
                                        ("next", "int64_t", "const void *"), ("tick", "void", "void *")):
        more = ", int64_t t" if function in ("restart", "tick") else ""
        back = "return " if result != "void" else ""
        lines += [f"static {result} {function}({parameter}mission{more})", "{",
                  f"    {back}{name}_{function}(mission{', t' if more else ''});", "}", ""]
    for names, titles in (("modes", [mission.mode_titles[mode] for mode in mission.modes]),
                          ("event_names", [event.title for event in mission.events])):
        if titles:
            lines += wrap([f"{string(title.encode())}," for title in titles],
                          f"static const char *const {names}[] = {{", "    ", "};")
    if mission.events:
        lines += wrap([f"offsetof({struct}, event.{event.name})," for event in mission.events],
                      "static const size_t events[] = {", "    ", "};")
    reset = None if mission.reset is None else mission.inputs[mission.reset].member
    lines += ["", f"const char fmu_token[] = {string(token.encode())};", "const FmuMission fmu_mission = {"]
    lines += [f"    .{key} = {value}," for key, value in (
        ("layout", "&layout"), ("size", f"sizeof({struct})"),
        *[("inputs", f"offsetof({struct}, in)"), ("inputs_size", f"sizeof({struct}In)")] * bool(mission.inputs),
        ("init", "init"), ("restart", "restart"), ("next", "next"), ("tick", "tick"),
        ("commands", f"&{name}_commands"), ("telemetry", f"&{name}_telemetry"),
        *[("services", f"&{name}_services")] * bool(mission.services),
        ("staged", f"{max((block.size for block in facts.blocks), default=1)}u"), ("packet", f"{facts.longest}u"),
        *[("modes", "modes")] * bool(mission.modes),
        *[("event_names", "event_names"), ("events", "events")] * bool(mission.events),
        ("messages", f"{name}_messages"), *[("parameters", f"{name}_parameters")] * bool(facts.blocks),
        ("reset", f"(int64_t)offsetof({struct}, {reset})" if reset else "FMU_NO_RESET"), ("down", mission.down))]
    return {f"{name}_fmu.c": "\n".join([*lines, "};", ""])}
