# SPDX-License-Identifier: Apache-2.0
"""The nodes of docs/cosim.md, as they stand there: of at most 50 lines, and in any pair of languages they give
the same bits, which are those of the closed form."""

import math
import os
import shutil
import subprocess
import sys
from itertools import count

import pytest

from fledge import archive
from fledge.disk import build_folder
from tests.docs_test import BLOCK
from tests.tree import ROOT

BUILT = build_folder()
CONTROLLER = BUILT / "cosim" / "fledge_controller"
pytestmark = pytest.mark.skipif(not CONTROLLER.exists(), reason="the controller is not built")

LANGUAGES = {"python": [sys.executable, "mass.py"], "c": ["build/mass_c"],
             "cpp": ["build/mass_cpp"]}
H, STIFFNESS, STEPS = 0.01, 4.0, 1001     # as in the programs, until 10 s
LEFT, RIGHT = 1.0, -0.5                   # [m] at first
numbers = count()


def clean():
    return {name: value for name, value in os.environ.items()
            if name != "LD_PRELOAD" and not name.startswith("FLEDGE_")}


def run(*command, folder):
    done = subprocess.run(command, cwd=folder, env=clean(), text=True, capture_output=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def nodes(tmp_path_factory):
    """A folder with the programs of the document, built by its commands."""
    folder = tmp_path_factory.mktemp("nodes")
    for _, file, text in BLOCK.findall((ROOT / "docs/cosim.md").read_text(encoding="utf-8")):
        if file:
            folder.joinpath(file).write_text(text)
    shutil.copy(ROOT / "cosim/bindings/python/fledge_node.py", folder)
    run("cmake", "-G", "Ninja", "-B", "build", f"-DFledge_DIR={BUILT}", folder=folder)
    run("cmake", "--build", "build", folder=folder)
    return folder


@pytest.fixture(scope="module")
def flown(nodes):
    """(record, output of left and right), by the languages of left and right; each pair runs once."""
    done = {}

    def fly(left, right):
        if (left, right) not in done:
            done[left, right] = pair(nodes, LANGUAGES[left], LANGUAGES[right])
        return done[left, right]

    return fly


def pair(folder, left, right):
    number = next(numbers)
    record, address = folder / f"{number}.mcap", f"ipc://@fledge-nodes-{os.getpid()}-{number}"
    programs = []

    def start(*command):
        programs.append(subprocess.Popen(command, cwd=folder, text=True, stdout=subprocess.PIPE,
                                         stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
                                         env=clean() | {"FLEDGE_SIMULATION": "masses", "FLEDGE_ADDRESS": address}))

    try:
        start(CONTROLLER, "--simulation", "masses", "--until", "10", "--address", address, "--record", record,
              "--node", "left", "--node", "right")
        start(*left, "left", "right", str(LEFT))
        start(*right, "right", "left", str(RIGHT))
        outputs = [program.communicate() for program in programs]
        assert [program.returncode for program in programs] == [0, 0, 0], outputs
    finally:
        for program in programs:
            program.kill()
            program.wait()
    return record, outputs[1][0] + outputs[2][0]


def messages(record):
    """By topic: times and values, as bytes."""
    with archive.Archive(record) as file:
        return {topic: [file.time_ns(topic).tobytes(), *(file[f"{topic}.{name}"].tobytes() for name in "xv")]
                for topic in ("/left/state", "/right/state")}


def closed_form(n):
    """Positions after n steps. The middle rests; the distance d follows d[n+1] - 2 d[n] + d[n-1] = -2 h^2 k d[n],
    which cos(n a) and sin(n a) with cos(a) = 1 - h^2 k solve, from d[0] and a speed of zero."""
    a = 2 * math.asin(H * math.sqrt(STIFFNESS / 2))
    d = (RIGHT - LEFT) * (math.cos(n * a) - math.tan(a / 2) * math.sin(n * a))
    middle = (LEFT + RIGHT) / 2
    return middle - d / 2, middle + d / 2


def test_the_masses_move_as_the_closed_form_says(flown):
    record, output = flown("python", "python")
    with archive.Archive(record) as file:
        for name, side in [("left", 0), ("right", 1)]:
            x = file[f"/{name}/state.x"]
            assert len(x) == STEPS and list(file.time_ns(f"/{name}/state")) == [10_000_000 * k for k in range(STEPS)]
            for k in range(STEPS):
                assert x[k] == pytest.approx(closed_form(k + 1)[side], abs=1e-12)
            assert f"{name} ends at {x[-1]:.17g} m" in output
    # and the discrete one the true one: two masses that swing against one another at sqrt(2 k)
    assert closed_form(STEPS)[0] == pytest.approx(0.25 + 0.75 * math.cos(math.sqrt(2 * STIFFNESS) * 10), abs=0.05)


@pytest.mark.parametrize("right", LANGUAGES)
@pytest.mark.parametrize("left", LANGUAGES)
def test_any_pair_of_languages_gives_the_same_bits(flown, left, right):
    record, printed = flown(left, right)
    expected, expected_print = flown("python", "python")
    assert printed == expected_print
    assert messages(record) == messages(expected)


@pytest.mark.parametrize("file", ["mass.py", "mass.c", "mass.cpp"])
def test_a_node_has_at_most_fifty_lines(nodes, file):
    assert len((nodes / file).read_text().splitlines()) <= 50
