# SPDX-License-Identifier: Apache-2.0
"""What an app is called, and which message ids it has."""
from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from fledge.export.names import KEYWORDS
from fledge.export.read import ExportError, Mission

CMD, TLM, HIGHEST = 0x1800, 0x0800, 0x7FF
ORDERS = ("little", "big")
TAKEN = ((0x00, 0x1F, "the core's services"), (0x80, 0x9F, "the apps that come with cFS: ci_lab, to_lab, sch_lab, "
                                               "sample_app"))
# What targets of a cFS build are called already.
MODULES = frozenset("""cfe core_api core_private config es evs fs msg resourceid sb sbr tbl time psp osal osal_bsp
    elf2cfetbl tblcrctool cfs_core core mission arch ci_lab to_lab sch_lab sample_app sample_lib test ut_assert
    all clean install help prep""".split())
LONGEST = 12        # of 19: child task, semaphores and pipe are named after it


@dataclass(frozen=True)
class App:
    """name: of folder and build target, in lower case; the prefix of its C is the same in upper case."""

    name: str
    topic: int = 0xC0
    order: str = "little"            # of the target's processor, for .tbl files

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", self.name) or len(self.name) > LONGEST:
            raise ExportError(f"--app {self.name}: an app's name has 1 to {LONGEST} letters, digits and underscores, "
                              "in lower case, and begins with a letter")
        if self.name in MODULES or self.name in KEYWORDS:
            raise ExportError(f"--app {self.name}: a cFS build has this name already; choose another one")
        if self.order not in ORDERS:
            raise ExportError(f"--order {self.order}: must be one of {', '.join(ORDERS)}")

    @property
    def prefix(self) -> str:
        return self.name.upper()

    def ids(self, mission: Mission) -> dict[str, int]:
        """Macro -> message id, of commands and requests, then of telemetry."""
        commands = {"CMD_MID": CMD, "SEND_HK_MID": CMD + 1, "WAKEUP_MID": CMD + 2}
        telemetry = {"HK_TLM_MID": TLM} | {f"{m.name.upper()}_TLM_MID": TLM + 1 + i
                                           for i, m in enumerate(mission.outputs)}
        return {f"{self.prefix}_{name}": value + self.topic for name, value in (commands | telemetry).items()}

    def check_topics(self, mission: Mission) -> None:
        last = self.topic + max(2, len(mission.outputs))
        if self.topic < 0 or last > HIGHEST:
            raise ExportError(f"--topic {self.topic:#x}: {mission.title} needs topics up to {last:#x}; the highest is "
                              f"{HIGHEST:#x}")
        for low, high, what in TAKEN:
            if self.topic <= high and last >= low:
                raise ExportError(f"--topic {self.topic:#x}: {mission.title} needs the topics {self.topic:#x} to "
                                  f"{last:#x}, and {low:#x} to {high:#x} are of {what}; choose from 0xa0 or 0xc0 on")


def check_taken(mission: Mission, app: App, folder: Path | str) -> None:
    """Refuse message ids that another app beside `folder` has, by the ids in its headers."""
    ours = {value: name for name, value in app.ids(mission).items()}
    folder = Path(folder)
    for header in sorted([*folder.parent.glob("*/fsw/**/*msgids*.h"), *folder.parent.glob("*/config/*msgids*.h")]):
        if folder.name == header.relative_to(folder.parent).parts[0]:
            continue
        text = header.read_text(encoding="utf-8", errors="replace")
        for name, value in re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+_MID)[ \t]+\(?(0[xX][0-9A-Fa-f]+)", text,
                                      re.MULTILINE):
            if int(value, 16) in ours:
                raise ExportError(f"--topic {app.topic:#x}: {ours[int(value, 16)]} would be {value}, which is {name} "
                                  f"in {header}; choose another topic to begin with")
