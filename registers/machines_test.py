# SPDX-License-Identifier: Apache-2.0
"""One register file, two processes, machines of different byte order: the same answers bit for bit.

Flight is built for each machine and runs under its emulator, if both are there; the models' side is
native. Boards of both byte orders, so that at least one side has to swap.
"""
import struct
import subprocess
from pathlib import Path

import pytest

from registers.__main__ import main
from tests.circles import long_after
from tests.needs import skip_unless_on

ROOT = Path(__file__).resolve().parents[1]
FLAGS = ["-std=c99", "-D_POSIX_C_SOURCE=200809L", "-O1", "-pedantic", "-Wall", "-Wextra", "-Werror",
         "-ffp-contract=off", f"-I{ROOT}"]
MACHINES = {
    "native": ("gcc", []),
    "aarch64": ("aarch64-linux-gnu-gcc", ["qemu-aarch64"]),
    "sparc64": ("sparc64-linux-gnu-gcc", ["qemu-sparc64"]),     # big-endian
}


def build(folder: Path, program: str, compiler: str) -> Path:
    out = folder / f"{program}_{compiler}"
    library = [str(ROOT / f"registers/{name}.c")
               for name in ("lane", "field", "clock", "slave_clock", "message", "shared_file")]
    boards = [str(folder / f"{name}.c") for name in ("io_board_a", "single_board_computer")]
    subprocess.run([compiler, *FLAGS, f"-I{folder}", "-static",
                    str(ROOT / f"registers/testing/{program}.c"), *boards, *library, "-o",
                    str(out)], check=True)
    return out


@pytest.fixture(scope="module", params=["big", "little"])
def folder(tmp_path_factory, request):
    folder = tmp_path_factory.mktemp(request.param)
    for name in ("io_board_a", "single_board_computer"):
        text = (ROOT / f"registers/testing/boards/{name}.toml").read_text()
        text = text.replace('outside_order = "little"', 'outside_order = "%s"'
                            % {"big": "little", "little": "big"}[request.param])
        text = text.replace('\norder = "big"', f'\norder = "{request.param}"')
        (folder / f"{name}.toml").write_text(text)
    assert main([str(p) for p in sorted(folder.glob("*.toml"))] + ["--out", str(folder)]) == 0
    build(folder, "models", "gcc")
    return folder


@pytest.mark.parametrize("machine", long_after(2, MACHINES, "another machine"))
def test_flight_of_any_machine_gives_the_same_answers(folder, machine):
    if machine != "native":
        skip_unless_on(machine)
    compiler, runner = MACHINES[machine]
    flight = build(folder, "flight", compiler)
    file = folder / f"registers_{machine}"
    models = subprocess.Popen([str(folder / "models_gcc"), str(file)], stdout=subprocess.PIPE,
                              text=True)
    try:
        assert models.stdout.readline() == "ready\n"
        flown = subprocess.run([*runner, str(flight), str(file)])
        answers = models.stdout.read().splitlines()
        assert (flown.returncode, models.wait()) == (0, 0)
    finally:
        models.kill()
        models.wait()
    assert not file.exists()
    assert answers == [expected(k) for k in range(1, 21)]


def expected(k: int) -> str:
    """What flight answers to the models' k-th tick, worked out here once more."""
    sigma = [0.1 * k / (i + 1) for i in range(3)]
    sun = min(int(0.0005 * k / 2.44140625e-6 + 0.5), 4095) * 2.44140625e-6
    u = [*sigma, *[-1e-300 / k] * 3, sun, float(slave_time(0x0123456789 * k, 0x0123456789))]
    bits = " ".join(struct.pack(">d", v).hex() for v in u)
    return f"{0x0123456789 * k + 1000 + k} 2 7 {bits} {int(sigma[0] * 3276.8 + 0.5):08x}"


def slave_time(t: int, tick: int) -> int:
    """The slave clock [ns] at simulated time t: it starts at 1000 s, drifts by -3.75 ppm, is jammed to -5 s at the 5th
    tick, and gains 777777 ns from the 10th on, by 100 ppm."""
    if t <= 5 * tick:
        return 1000 * 10**9 + t + t * -3750 // 10**9
    s = min(t, 10 * tick) - 5 * tick
    time = -5 * 10**9 + s + s * -3750 // 10**9
    s = max(t - 10 * tick, 0)
    return time + s + s * -3750 // 10**9 + min(777777, s * 100_000 // 10**9)
