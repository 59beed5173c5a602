# SPDX-License-Identifier: Apache-2.0
"""Four programs give what one program gives, bit for bit."""

import os
import shutil
import subprocess
import sys
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge.archive import Archive
from fledge.attitude import mrp_to_dcm
from fledge.disk import build_folder
from fledge.units import s

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILT = build_folder()
UNTIL = 1000    # [s]: tumble, warm up, send, and Mars before Earth
sys.path.insert(0, str(HERE))
import power  # noqa: E402
import radio  # noqa: E402

WORLD = {"craft.state": ("r_BN_N", "sigma_BN"), "sun.state": ("r_PN_N",), "earth.state": ("r_PN_N",)}
POWER = ("E", "fill", "P_solar", "P_load", "light")
RADIO = ("mode", "P", "off_earth", "rate", "sent")


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """A folder with the description and the programs."""
    folder = tmp_path_factory.mktemp("downlink")
    for program in ("power.py", "radio.py"):
        shutil.copy(HERE / program, folder)
    text, there = (HERE / "downlink.toml").read_text(), "../../cosim/bindings/python"
    assert text.count(there) == 2
    (folder / "downlink.toml").write_text(text.replace(there, str(ROOT / "cosim/bindings/python")))
    return folder


@pytest.fixture(scope="module")
def flown(programs):
    """The records of an exchange, by transport."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(
        [str(ROOT / "python"), str(ROOT), str(BUILT / "python")])}

    def fly(*options):
        out = programs / "-".join(["run", *options])
        done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", programs / "downlink.toml", "--exchange",
                               "--logs", "--until", f"{UNTIL}s", "--out", out, *options], env=environment,
                              text=True, capture_output=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return Archive(out / "exchange.mcap")

    return {"ipc": fly(), "tcp": fly("--tcp")}


@pytest.fixture(scope="module")
def alone():
    """The mission in one program, and the two models called by hand: {topic: {field: values}}."""
    sim = fledge.load("two_body_pointing")
    w = sim.world
    log = sim.record(w.craft.state, every=0.1 * s)
    bodies = sim.record(w.sun.state, w.earth.state, every=0.5 * s)
    sim.run(UNTIL * s)
    written = {}
    for name, fields in WORLD.items():
        of = log if "craft" in name else bodies
        written["/world/" + name.replace(".", "/")] = {f: of[f"{name}.{f}"] for f in fields}
    r, sigma = (log[f"craft.state.{f}"].tolist() for f in WORLD["craft.state"])
    sun, earth = (bodies[f"{body}.state.r_PN_N"].tolist() for body in ("sun", "earth"))
    battery, sender = power.Power(), radio.Radio()
    powers, radios = [], []
    seen = {"fill": 0.5}
    for k in range(2 * UNTIL + 1):
        craft = {"r_BN_N": r[5 * k], "sigma_BN": sigma[5 * k]}
        radios.append(sender.step(craft, {"r_PN_N": earth[k]}, seen))
        if k % 2 == 0:
            powers.append(battery.step(craft, {"r_PN_N": sun[k]}, radios[-1]))
            powers[-1]["light"] = ["SHADOW", "SUNLIT"].index(powers[-1]["light"])
            seen = powers[-1]
    written["/power/state"] = {f: np.array([m[f] for m in powers]) for f in POWER}
    written["/radio/state"] = {f: np.array([m[f] for m in radios]) for f in RADIO}
    return written


@pytest.mark.long("a co-simulation of all programs")
@pytest.mark.parametrize("transport", ["ipc", "tcp"])
def test_many_programs_give_the_bits_of_one(flown, alone, transport):
    assert len(alone) == 5
    for topic, fields in alone.items():
        for field, values in fields.items():
            found = flown[transport][f"{topic}.{field}"]
            assert found.shape == values.shape and np.array_equal(found, values), f"{topic}.{field}"


def test_ipc_and_tcp_give_the_same_exchange(flown):
    ipc, tcp = flown["ipc"], flown["tcp"]
    topics = {"/flight/motor/command", "/world/nav/attitude", "/power/state", "/radio/state"}
    for topic in topics:
        assert ipc.time_ns(topic).tolist() == tcp.time_ns(topic).tolist()
    assert np.array_equal(ipc["/flight/motor/command.u"], tcp["/flight/motor/command.u"])


def test_the_radio_sends_while_the_antenna_points_to_earth(flown):
    file = flown["ipc"]
    mode, t = file["/radio/state.mode"], file.time_ns("/radio/state") / 1e9
    changes = [(t[i + 1], int(mode[i + 1])) for i in np.flatnonzero(np.diff(mode))]
    assert [m for _, m in changes] == [1, 2, 0] and changes[1][0] - changes[0][0] == 59.5
    # It sends with the antenna on Earth, and stops where Mars' limb crosses the line to Earth.
    craft = file["/world/craft/state.sigma_BN"][::5]
    to = file["/world/earth/state.r_PN_N"] - file["/world/craft/state.r_BN_N"][::5]
    to /= np.linalg.norm(to, axis=1, keepdims=True)
    off = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", mrp_to_dcm(craft)[:, 0], to), -1, 1)))
    assert off[mode > 0].max() <= 0.5 and off[0] > 10
    lost = np.flatnonzero(t == changes[2][0])[0]
    r = file["/world/craft/state.r_BN_N"][::5][lost - 1:lost + 1]
    aside = np.linalg.norm(np.cross(r, to[lost - 1:lost + 1]), axis=1)
    assert aside[0] >= power.MARS_RADIUS > aside[1]


def test_the_battery_stores_what_the_panels_give_less_the_load(flown):
    file = flown["ipc"]
    E, solar, load = (file[f"/power/state.{f}"] for f in ("E", "P_solar", "P_load"))
    assert np.allclose(E, 0.5 * power.BATTERY + np.cumsum(solar - load), rtol=1e-12)
    assert load.min() == 200 and load.max() == 320 and solar.max() > 300
