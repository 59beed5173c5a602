# SPDX-License-Identifier: Apache-2.0
"""What `fledge new --from` writes: the header has the table of the class, and the C compiles."""
import enum
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fledge import cli, flight as fsw, prototype, world
from fledge.prototype import Mat3, Vec3, field, input, mem, out, par
from introspect.reader import read
from introspect.sources import Source

ROOT = Path(__file__).resolve().parents[3]


class Part(enum.IntEnum):
    """Which part works."""
    NONE = 0
    LEFT = 3
    RIGHT = -2


class Own(prototype.Message):
    """A message that has no header."""
    part  = field(Part, "which")
    small = field(np.uint16, "[-] a number", shape=3)
    last  = field(fsw.AttError)


class Everything(prototype.Module):
    """All kinds of fields: numbers, arrays, texts, structs and enumerations.

    With a second paragraph, */ in it, and
        lines that are indented.
    """
    wanted   = input(fsw.AttReference, "optional, distinct base: what to follow")
    base     = input(fsw.AttReference)
    torque   = out(fsw.BodyTorque, "Lr: the torque, in a comment that is long enough to need a second line of "
                   "the header, because headers have 120 columns")
    error    = out(fsw.AttError)
    own      = out(Own)
    flag     = par(bool, "[-] in [0, 1]: whether it works")
    gain     = par(float, "[N m] required, > 0, <= 1e-3: a gain")
    small    = par(np.float32, "[-] a small number")
    inertia  = par(Mat3, "[kg m^2] required, inertia: of the body")
    axes     = par(Vec3, "[-] count n, non-zero: of the wheels", shape=4)
    n        = par(np.uint8, "[-] <= 4: number of wheels")
    label    = par(str, "of it", shape=13)
    part     = par(Part, "initial: which")
    least    = par("Quality", "assumed: the least that counts")
    matrix   = par(np.int16, "[-] numbers", shape=(2, 3))
    start    = mem(int, "[ns] when it began")
    seen     = mem(np.uint8, "[-] once")
    last     = mem(fsw.AttError, "two of them", shape=2)
    end      = mem(np.uint16, "[-] at an odd end")

    def helper(self):
        return 2    # a comment */ with an end of comment

    def reset(self):
        self.start = -1

    def update(self, t, dt):
        self.seen = self.helper()


class Disturbance(prototype.Model):
    """A torque."""
    truth = input(world.CraftState)
    load  = out(world.ForceTorque)
    noise = par(float, "[N m] >= 0: standard deviation")
    last  = mem(Vec3, "[N m] of the last update")

    def prepare(self):
        pass

    def update(self, t, dt):
        pass


def written(cls, tmp_path):
    """The project with the files of a prototype, and the struct that introspect reads from the header."""
    kind = cls._kind.value
    assert cli.main(["new", "project", str(tmp_path / "mine")]) == 0
    assert cli.main(["new", kind, cls.__name__, "--from", f"{__file__}:{cls.__name__}",
                     "--project", str(tmp_path / "mine")]) == 0
    folder = {"module": "flight", "model": "world"}[kind]
    model = read([Source(tmp_path / "mine", folder, cls._kind, "mine")], [ROOT])
    return tmp_path / "mine", model.structs[cls.__name__]


def plain(struct):
    """Without what tells a header from a class: places of declarations."""
    def field(f):
        e = f.enum and replace(f.enum, header="", library="", values=tuple(replace(v, doc="") for v in f.enum.values))
        inner = f.struct and f.struct.hash
        return replace(f, line=0, enum=e, struct=inner)
    return replace(struct, header="", path="", line=0, library="", fields=tuple(map(field, struct.fields)))


@pytest.mark.parametrize("cls", [Everything, Disturbance])
def test_the_header_has_the_table_of_the_class(cls, tmp_path):
    folder, read_back = written(cls, tmp_path)
    assert plain(read_back) == plain(cls._struct)
    assert read_back.hash == cls._struct.hash
    header = next(folder.rglob(f"{'everything' if cls is Everything else 'disturbance'}.h")).read_text()
    assert max(map(len, header.splitlines())) <= 120


def test_a_second_module_includes_the_message_that_the_first_declares(tmp_path):
    folder, _ = written(Everything, tmp_path)
    assert cli.main(["new", "module", "Second", "--from", f"{__file__}:Everything", "--project", str(folder)]) == 0
    text = (folder / "flight/second.h").read_text()
    assert '#include "flight/everything.h"\n' in text and "typedef struct Own" not in text and "enum Part" not in text


@pytest.mark.parametrize("cls", [Everything, Disturbance])
def test_what_it_writes_is_formatted(cls, tmp_path):
    folder, _ = written(cls, tmp_path)
    for file in [*(folder / "flight").iterdir(), *(folder / "world").iterdir()]:
        if file.suffix in (".h", ".c", ".cpp"):
            command = ["clang-format", f"--style=file:{ROOT}/.clang-format", file]
            formatted = subprocess.run(command, check=True, text=True, capture_output=True).stdout
            assert formatted == file.read_text(), file.name


@pytest.mark.long("compiles each")
@pytest.mark.parametrize("cls", [Everything, Disturbance])
def test_what_it_writes_compiles_without_a_warning(cls, tmp_path):
    folder, _ = written(cls, tmp_path)
    if cls is Everything:
        command = ["cc", "-std=c99", "-pedantic", folder / "flight/everything.c"]
    else:
        command = ["c++", "-std=c++20", folder / "world/disturbance_model.cpp"]
    subprocess.run([*command, "-Wall", "-Wextra", "-Werror", "-I", folder, "-I", ROOT, "-fsyntax-only"], check=True)


def test_the_c_has_the_python_to_translate(tmp_path):
    folder, _ = written(Everything, tmp_path)
    text = (folder / "flight/everything.c").read_text()
    for line in ("     *         self.start = -1 */\n", " *     def helper(self):\n", "     *     def update(",
                 "a comment * / with"):
        assert line in text
    assert "flight/everything\n" in (folder / "CMakeLists.txt").read_text()


@pytest.mark.parametrize("words, complaint", [
    (["module", "Mine", "--from", "nothing.py:Mine"], "there is no nothing.py"),
    (["module", "Mine", "--from", "nothing"], "a prototype is FILE:CLASS"),
    (["module", "Mine", "--from", f"{__file__}:Everyting"], "has no prototype 'Everyting'; did you mean 'Everything'"),
    (["model", "Mine", "--from", f"{__file__}:Everything"], "it is a module: ./fledge new module Mine"),
    (["module", "MrpFeedback", "--from", f"{__file__}:Everything"], "MrpFeedback is declared in"),
    (["mission", "mine", "--from", f"{__file__}:Everything"], "Everything: there is no such mission"),
])
def test_what_is_no_prototype_is_refused(words, complaint, tmp_path, capsys):
    (tmp_path / "CMakeLists.txt").write_text("fledge_project(mine\n    FLIGHT\n    WORLD\n)\n")
    assert cli.main(["new", *words, "--project", str(tmp_path)]) == 2
    assert complaint in capsys.readouterr().err
    assert [path.name for path in tmp_path.rglob("*")] == ["CMakeLists.txt"]
