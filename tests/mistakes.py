# SPDX-License-Identifier: Apache-2.0
"""Mistakes of users, and Fledge's answers: tests/mistakes.txt, which a review reads.

    == A gain is negative
    flight.py
    - K=0.2 * N * m
    + K=-0.2 * N * m
    $ fledge run first_light
        fledge: ...
        exit 2

A mistake has edits of the mission that `fledge new mission` makes: the text after `- ` stands once in the file, and the
text after `+ ` takes its place; without `- `, the lines are added at the end of the file. Then come the inputs:
a command, a request to a control room of the mission (`$ curl -X POST localhost:8080/...`), or Python (`>>> `) with
`sim`, a simulation of the mission. Each answer follows its input, indented.

`/usr/bin/python3 -m tests.mistakes` writes the answers anew, after one has changed or a mistake was added; with words,
it prints those of the mistakes whose title contains them, and writes nothing.
"""
from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.tree import ROOT

FILE = Path(__file__).with_suffix(".txt")
MISSION = "first_light"
OF_LAUNCHER = ("runn",)      # words that the launcher answers itself
TEMPLATE = ROOT / "python/fledge/templates/missions" / MISSION


@dataclass
class Edit:
    file: str
    old: str = ""
    new: list[str] = field(default_factory=list)


@dataclass
class Mistake:
    title: str
    edits: list[Edit] = field(default_factory=list)
    typed: list[str] = field(default_factory=list)


def read(text: str) -> tuple[str, list[Mistake]]:
    """(the text before the first, the mistakes) of the file, without the answers."""
    head, *parts = re.split(r"(?m)^== ", text)
    return head, [_mistake(*part.split("\n", 1)) for part in parts]


def _mistake(title: str, body: str) -> Mistake:
    mistake, file = Mistake(title), ""
    for line in body.splitlines():
        if line.startswith(("$ ", ">>> ")):
            mistake.typed.append(line)
        elif line.startswith("- "):
            mistake.edits.append(Edit(file, line[2:]))
        elif line.startswith("+"):
            if not mistake.edits or mistake.edits[-1].file != file:
                mistake.edits.append(Edit(file))
            mistake.edits[-1].new.append(line[2:])
        elif line and not line.startswith(" "):
            file = line
    return mistake


def written(head: str, mistakes: list[Mistake], answers: list[list[str]]) -> str:
    """The file's text; answers: of each mistake, to each thing that is typed."""
    parts = []
    for mistake, answer in zip(mistakes, answers):
        lines, file = [f"== {mistake.title}"], ""
        for edit in mistake.edits:
            lines += [edit.file] * (edit.file != file) + [f"- {edit.old}"] * bool(edit.old)
            lines += [f"+ {line}".rstrip() for line in edit.new]
            file = edit.file
        for typed, text in zip(mistake.typed, answer):
            lines += [typed, *(f"    {line}".rstrip() for line in text.splitlines())]
        parts.append("\n".join(lines) + "\n")
    return head + "\n".join(parts)


# --- to make them ----------------------------------------------------------------------------------

def answers(mistakes: list[Mistake]) -> list[list[str]]:
    """All that is answered, normalised. Each mistake has a folder and a process of its own, forked from this one, which
    has imported what many of them need."""
    import fledge.cli
    import fledge.export
    import fledge.montecarlo
    import fledge.plot
    import fledge.prove
    import fledge.requirements
    import fledge.targets.leon3
    import fledge.verify

    fledge.cli.parser()
    fledge.load(TEMPLATE)
    with fledge.plot.drawn((1.0, 1.0), "none"):
        pass    # it has imported matplotlib
    with tempfile.TemporaryDirectory() as folder:
        folders = [Path(folder).resolve() / str(i) for i in range(len(mistakes))]
        free = os.cpu_count() or 1
        for mistake, place in zip(mistakes, folders):
            if free == 0:
                os.wait()
                free += 1
            free -= 1
            _forked(place.with_suffix(".log"), lambda: _make(mistake, place))
        while free < (os.cpu_count() or 1):
            os.wait()
            free += 1
        for place in folders:
            if wrong := place.with_suffix(".log").read_text(encoding="utf-8"):
                raise RuntimeError(wrong)
        return [[_normal((place / f"{i}.txt").read_text(encoding="utf-8"), place) for i in range(len(mistake.typed))]
                for mistake, place in zip(mistakes, folders)]


def _make(mistake: Mistake, folder: Path) -> int:
    mission = folder / "missions" / MISSION
    shutil.copytree(TEMPLATE, mission)
    for edit in mistake.edits:
        _edit(mistake.title, mission / edit.file, edit.old, "\n".join(edit.new))
    os.chdir(folder)
    os.environ.pop("FLEDGE_PROJECT", None)
    for i, typed in enumerate(mistake.typed):
        out = folder / f"{i}.txt"
        child = _forked(out, lambda: _python(typed[4:]) if typed.startswith(">>> ") else
                        _command(shlex.split(typed[2:])))
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if typed.startswith("$ fledge"):
            out.write_text(out.read_text(encoding="utf-8") + f"exit {code}", encoding="utf-8")
    return 0


def _forked(out: Path, function: Callable[[], int]) -> int:
    """The number of a new process that calls a function, with the file as its output, and ends."""
    child = os.fork()
    if child:
        return child
    code: Any = 70
    try:
        sink = os.open(out, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        for standard, name in ((1, "stdout"), (2, "stderr")):
            os.dup2(sink, standard)
            setattr(sys, name, open(standard, "w", encoding="utf-8", buffering=1, closefd=False))
        code = function()
    except SystemExit as ended:
        code = ended.code
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code if isinstance(code, int) else 1)


def _edit(title: str, path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    path.parent.mkdir(exist_ok=True)
    if old and text.count(old) != 1:
        raise ValueError(f"{title}: {path.name} has {text.count(old)} times, not once: {old}")
    if not old:
        path.write_text(text + new + "\n", encoding="utf-8")
        return
    indent = re.match(" *", text[text.rfind("\n", 0, text.index(old)) + 1:])
    path.write_text(text.replace(old, new.replace("\n", "\n" + (indent[0] if indent else ""))), encoding="utf-8")


def _command(words: list[str]) -> int:
    if words[0] == "curl":
        return _request(words[1:])
    if words[1] in OF_LAUNCHER:
        os.execv("/bin/sh", ["/bin/sh", str(ROOT / "fledge"), *words[1:]])
    from fledge import cli

    return cli.main(words[1:])


def _python(text: str) -> int:
    import fledge
    from fledge import units

    names = {"fledge": fledge, "world": fledge.world, "fsw": fledge.flight, **vars(units)}
    try:
        sim = names["sim"] = fledge.load(MISSION)
        sim.plots = False
        exec(text, names)
    except Exception as error:
        print("".join(traceback.format_exception_only(error)), end="")
    return 0


def _request(words: list[str]) -> int:
    """curl -X POST localhost:8080/PATH -d TEXT, to a room of the mission whose flight stands."""
    from fledge.ground.server.testing import response_of

    method, address, text = words[1], words[2], words[words.index("-d") + 1]
    Path("ground.toml").write_text(f'[[craft]]\nmission = "{MISSION}"\n', encoding="utf-8")
    print("HTTP {}: {}".format(*response_of(Path("ground.toml"), method, address.removeprefix("localhost:8080"), text)))
    return 0


def _normal(text: str, folder: Path) -> str:
    """The text without the parts that differ from run to run or between machines."""
    text = text.replace(f"{folder.resolve()}/", "").replace(str(folder.resolve()), ".").replace(f"{ROOT}/", "")
    text = re.sub(rf"{re.escape(str(ROOT))}\b", ".", text)
    text = re.sub(r"flown    (\S+ s) in \S+ s(, [\d,]+ times real time)?", r"flown    \1 in ... s, ... times real time",
                  text)
    text = re.sub(r"\(\d[\d.]* [kM]B\)", "(... kB)", text)
    text = re.sub(r"\bBDot and \d+ more\b", "BDot and ... more", text)     # all modules of Fledge
    text = re.sub(r"(?m)^(fledge: building .* once|the server's loop was blocked .*)\n", "", text)
    return re.sub(r"\b0x[0-9a-f]{8,}", "0x...", text)


def main(words: list[str]) -> int:
    head, mistakes = read(FILE.read_text(encoding="utf-8"))
    if words and words != ["--print"]:
        head, mistakes = "", [mistake for mistake in mistakes if " ".join(words).lower() in mistake.title.lower()]
    text = written(head, mistakes, answers(mistakes))
    if words:
        print(text, end="")
    else:
        FILE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
