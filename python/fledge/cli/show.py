# SPDX-License-Identifier: Apache-2.0
"""`fledge show MISSION`: the wiring of a mission; `fledge list`: missions, modules, models, bodies and kept runs."""
from __future__ import annotations

import argparse
from pathlib import Path

from fledge.cli.arguments import add_mission, add_parameters, given_parameters
from fledge.cli.console import complain, itemized, placed, say
from fledge.cli.runs import kept_runs

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable


def add(command: Callable) -> None:
    """Add the subcommands, by the function of cli.parser() that adds one."""
    sub = command("show", show, "show nadir_spin --out nadir_spin.png")
    add_mission(sub)
    sub.add_argument("--out", metavar="FILE", help="draw only into this .svg, .png, .pdf or .dot; "
                     "default: an outline, and runs/MISSION/wiring.svg")
    sub.add_argument("--text", action="store_true", help="only the outline")
    sub.add_argument("--flight-only", action="store_true", help="leave out the world")
    add_parameters(sub)

    sub = command("list", list_, "list --ports")
    sub.add_argument("--ports", action="store_true", help="with the inputs and outputs of each")


def show(options: argparse.Namespace) -> int:
    import fledge
    from fledge.mission.wiring import Wiring
    from fledge.plot.wiring import save

    sim = fledge.load(options.mission, **given_parameters(options))
    if problems := sim.problems:
        complain(itemized("without what a scenario may give, the mission cannot fly", placed(problems)))
    wiring = Wiring(sim, options.flight_only)
    if options.out:
        say(str(save(wiring, options.out)))
        return 0
    say(wiring.outline())
    if not options.text:
        say(f"\ndrawn in {save(wiring, Path('runs') / wiring.name / 'wiring.svg')}")
    return 0


def list_(options: argparse.Namespace) -> int:
    from fledge import flight, mission, objects, world
    from fledge.objects.words import first_sentence

    say("missions")
    summaries = {name: folder.summaries() for name, folder in mission.missions().items()}
    width = max((len(name) for about in summaries.values() for name in about), default=0) + 2
    for name, about in summaries.items():
        say(f"  {name:{width}} {about.pop('')}")
        for scenario, text in about.items():
            say(f"    {scenario:{width - 2}} {text}")
    if not summaries:
        say("  none")
    for title, types, kind in (
            ("flight modules (from fledge import flight as fsw)", getattr(flight, "TYPES"), "module"),
            ("world models (from fledge import world)", world.TYPES, "model")):
        say("\n" + title)
        for name in sorted(types):
            struct = objects.struct(types[name])
            if struct.kind == kind:
                say(f"  {name:18} {first_sentence(struct.doc)}")
                if options.ports:
                    for group, arrow in (("in", "<<"), ("out", ">>")):
                        for f in struct.fields:
                            if f.group == group:
                                note = "  (optional)" if f.optional else ""
                                say(f"    {arrow} {f.name:13} {f.struct.name}{note}")
    say("\nbodies\n  " + ", ".join(f"world.{name}" for name in world.BODIES))
    if runs := kept_runs():
        from fledge.archive.mcap import metadata

        say("\nkept runs (each is a RUN for plot, compare and convert)")
        for name, (record, *_) in runs.items():
            facts = {key: text for pairs in metadata(record).values() for key, text in pairs.items()}
            facts.setdefault("outcome", "has not ended")
            say(f"  {name:{width}} " + ", ".join(facts[key] for key in ("mission", "scenario", "outcome")
                                                 if key in facts))
    return 0
