# SPDX-License-Identifier: Apache-2.0
"""What an app is called, and which message ids it has."""
from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fledge.commands import SERVICES
from fledge.export.read import ExportError, Mission
from introspect.keywords import C

CMD, TLM, HIGHEST = 0x1800, 0x0800, 0x7FF
ORDERS = ("little", "big")
TAKEN = ((0x00, 0x1F, "the core's services"), (0x60, 0x63, "the core's time service"),
         (0x80, 0xBF, "the apps that come with cFS: the labs, CF, CS, DS, FM, HK, HS, LC, MD, MM, SC"))
# What targets of a cFS build are called already.
MODULES = frozenset("""cfe core_api core_private config es evs fs msg resourceid sb sbr tbl time psp osal osal_bsp
    elf2cfetbl tblcrctool cfs_core core mission arch ci_lab to_lab sch_lab sample_app sample_lib test ut_assert
    all clean install help prep""".split())
LONGEST = 12        # of 19: child task, semaphores and pipe are named after it


def services(mission: Mission) -> list[str]:
    """What services tell, as names of streams, in their order."""
    return [name.upper() for name in SERVICES] if mission.services else []


def has_files(mission: Mission) -> bool:
    """Whether flight has the service of files."""
    return any(module.type == "Files" for module in mission.modules)


@dataclass(frozen=True)
class App:
    """name: of folder and build target, in lower case; the prefix of its C is the same in upper case."""

    name: str
    topic: int = 0xC0
    order: str = "little"            # of the target's processor, for .tbl files
    wakeup: int | None = None        # message id of the scheduler; None: a topic of its own
    timer: bool = False              # it wakes itself
    keep: Sequence[str] = ()         # in a critical data store: "parameters", or paths of modules
    wires: Mapping[str, int] = field(default_factory=dict)  # path of an input -> message id of another app's packets

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", self.name) or len(self.name) > LONGEST:
            raise ExportError(f"--app {self.name}: an app's name has 1 to {LONGEST} letters, digits and underscores, "
                              "in lower case, and begins with a letter")
        if self.name in MODULES or self.name in C:
            raise ExportError(f"--app {self.name}: a cFS build has this name already; choose another one")
        if self.order not in ORDERS:
            raise ExportError(f"--order {self.order}: must be one of {', '.join(ORDERS)}")

    @property
    def prefix(self) -> str:
        return self.name.upper()

    def topics(self, mission: Mission) -> dict[str, int]:
        """Macro -> topic, of commands and requests, then of telemetry, then of inputs."""
        commands = {"CMD": 0, "SEND_HK": 1, "WAKEUP": 2}
        streams = ["FLIGHT", "REPORT", *(m.name.upper() for m in mission.outputs), "HK", *services(mission)]
        telemetry = {f"{name}_TLM": i for i, name in enumerate(streams)}
        inputs = {f"{m.name.upper()}_IN": len(telemetry) + i for i, m in enumerate(mission.inputs)}
        return {f"{self.prefix}_MISSION_{name}_TOPICID": value + self.topic
                for name, value in (commands | telemetry | inputs).items()}

    def ids(self, mission: Mission) -> dict[str, int]:
        """Macro -> message id, in the same order. A base of another processor is added in its build."""
        given = {f"{m.name.upper()}_IN": self.wires[m.path] for m in mission.inputs if m.path in self.wires}
        if self.wakeup is not None:
            given["WAKEUP"] = self.wakeup
        topics = {}
        for macro, topic in self.topics(mission).items():
            name = macro.removeprefix(f"{self.prefix}_MISSION_").removesuffix("_TOPICID")
            base = CMD if name in ("CMD", "SEND_HK", "WAKEUP") else TLM
            topics[f"{self.prefix}_{name}_MID"] = given.get(name, base + topic)
        return topics

    def check_topics(self, mission: Mission) -> None:
        last = max(self.topics(mission).values())
        if self.topic < 0 or last > HIGHEST:
            raise ExportError(f"--topic {self.topic:#x}: {mission.title} needs topics up to {last:#x}; the highest is "
                              f"{HIGHEST:#x}")
        for low, high, what in TAKEN:
            if self.topic <= high and last >= low:
                raise ExportError(f"--topic {self.topic:#x}: {mission.title} needs the topics {self.topic:#x} to "
                                  f"{last:#x}, and {low:#x} to {high:#x} are of {what}; choose from 0xc0 on")
        unknown = [path for path in self.wires if path not in [m.path for m in mission.inputs]]
        if unknown:
            raise ExportError(f"--input {unknown[0]}: {mission.title} has no such input from outside; it has "
                              f"{', '.join(m.path for m in mission.inputs) or 'none'}")
        for what, mid in (("--wakeup", self.wakeup), *((f"--input {path}", mid) for path, mid in self.wires.items())):
            if mid is None:
                continue
            base, kind = (CMD, "command") if what == "--wakeup" else (TLM, "telemetry")
            if not base <= mid <= base + HIGHEST:
                raise ExportError(f"{what}: the message id of a {kind} is {base:#06x} to {base + HIGHEST:#06x}; found "
                                  f"{mid:#06x}")
        by_id: dict[int, str] = {}
        for name, mid in self.ids(mission).items():
            if mid in by_id:
                raise ExportError(f"--app {self.name}: {by_id[mid]} and {name} would both be {mid:#06x}; one message "
                                  "id has one writer, and is one input")
            by_id[mid] = name


def check_taken(mission: Mission, app: App, folder: Path | str, others: Sequence[Path | str] = ()) -> None:
    """Refuse message ids that another app writes or is commanded by, by the ids in its headers: apps beside
    `folder`, and those of the folders `others`."""
    ours = {value: name for name, value in app.ids(mission).items()
            if not name.endswith("_IN_MID") and (app.wakeup is None or not name.endswith("_WAKEUP_MID"))}
    folder = Path(folder).resolve()
    missing = [other for other in others if not Path(other).is_dir()]
    if missing:
        raise ExportError(f"--beside {missing[0]}: there is no such folder; name that of an app")
    apps = {*folder.parent.glob("*"), *(Path(other).resolve() for other in others)} - {folder}
    for header in sorted(header for other in apps for place in ("fsw/**", "config") for kind in ("msgids", "topicids")
                         for header in other.glob(f"{place}/*{kind}*.h")):
        text = header.read_text(encoding="utf-8", errors="replace")
        for name, value in re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+_(?:MID|TOPICID))[ \t]+"
                                      r"\(?(0[xX][0-9A-Fa-f]+|\d+)", text, re.MULTILINE):
            mid = int(value, 0 if "x" in value.lower() else 10)
            if name.endswith("_TOPICID"):
                mid += TLM if name.endswith("_TLM_TOPICID") else CMD
            if mid in ours and not name.endswith(("_IN_TOPICID", "_IN_MID")):
                raise ExportError(f"--topic {app.topic:#x}: {ours[mid]} would be {mid:#06x}, which is {name} "
                                  f"in {header}; choose another topic to begin with")
