# SPDX-License-Identifier: Apache-2.0
"""`fledge run --check-replay`: fly the same again, and compare all outputs.

A run depends on its seed and parameters alone. So the second flight is in another process, which has other addresses
and another order of sets, at another time, and without the user's own environment variables: what read one of these
differs.
"""
from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.cli.console import counted

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

# The variables by which a program finds its files; the others are not there the second time.
_NEEDED = re.compile(r"(PATH|HOME|TMPDIR|LANG|VIRTUAL_ENV|ASAN_OPTIONS|(FLEDGE|LC|LD|PYTHON|XDG|MPL)_?[A-Z_]*)$")


class Replay:
    """The two flights, whose records stay in the run's folder only if they differ."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "replay"
        self.give_up()
        self.first, self.second = (self._folder / name / "outputs.mcap" for name in ("first", "second"))
        for record in (self.first, self.second):
            record.parent.mkdir(parents=True)

    def give_up(self) -> None:
        """There is no flight to compare: leave nothing."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def fly(self, options: argparse.Namespace, sim: Simulation, code: int) -> tuple[str, str]:
        """Fly what has been flown with this exit code once more. Returns (how it differs, "" if it does not; what is
        the same, in words)."""
        if code == 130:
            self.give_up()
            return "", ""
        words = ["run", options.mission, *([options.scenario] if options.scenario else []),
                 *(["--for", options.duration] if options.duration else []), "--seed", str(options.seed),
                 *(word for text in options.parameters for word in ("--set", text)), "--no-plots",
                 "--out", str(self.second.parent), "--outputs", str(self.second)]
        variables = {name: value for name, value in os.environ.items() if _NEEDED.match(name)}
        order = "2" if variables.get("PYTHONHASHSEED") == "1" else "1"
        flown = subprocess.run([sys.executable, "-P", "-m", "fledge.cli", *words], capture_output=True, text=True,
                               env={**variables, "PYTHONHASHSEED": order, "FLEDGE_REPLAY": "1"})
        difference, same = self._compare(sim)
        if not difference and flown.returncode != code:
            message = (flown.stderr.strip().splitlines() or ["nothing"])[-1].removeprefix("fledge: ")
            difference = f"it ended with code {code} the first time, and with {flown.returncode} the second: {message}"
        if not difference:
            shutil.rmtree(self._folder)
            return "", same
        return (f"a second flight differs: {difference}; a run depends on its seed and parameters alone, so look there "
                "for a clock, os.urandom, id(), an environment variable, the order of a set, or a file; both are in "
                f"{self._folder}"), ""

    def _compare(self, sim: Simulation) -> tuple[str, str]:
        """(the first difference or "", what is the same)"""
        from fledge.archive import Archive
        from fledge.archive.compare import compare
        from fledge.objects.script import python_text

        if not self.first.exists() or not self.second.exists():     # an error before the first instant
            return "", "nothing was flown"
        with Archive(self.first) as a, Archive(self.second) as b:
            differences = compare(a, b)
            if not differences:
                messages = sum(channel.count for channel in a.topics.values())
                return "", f"the same bits again: {counted(len(a.topics), 'output')}, {messages} messages"
            first = differences[0]
            process, instance, _ = first.topic.split(".")
            python = python_text(sim.process(process).instances[instance])
            return f"{first}" + (f" ({python})" if python else ""), ""
