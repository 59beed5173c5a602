# SPDX-License-Identifier: Apache-2.0
"""The mission as numbers, for few and for many; and with a node for each of its processes."""

import os
import threading

import numpy as np
import pytest

import fledge
from fledge import cosim
from fledge.units import minute, s
from tests.circles import long_after
from tests.needs import skip_without


@pytest.mark.parametrize("spacecraft", long_after(2, [2, 3, 16], "flies 16 spacecraft"))
def test_the_scenario_passes(spacecraft):
    sim = fledge.load("constellation", spacecraft=spacecraft)
    sim.plots = False
    sim.scenarios["link"]()
    assert len(sim.processes) == 2 * spacecraft and len(sim.flights) == spacecraft


def test_no_two_are_alike():
    sim = fledge.load("constellation", spacecraft=40)
    crafts = [sim.process(f"sat{i}_world").craft for i in range(40)]
    for name in ("I_B", "r_BN_N", "sigma_BN", "omega_BN_B"):
        values = np.array([getattr(craft, name).ravel() for craft in crafts])
        apart = np.abs(values[:, None] - values[None]).max(axis=2) + 1e9 * np.eye(40)
        assert apart.min() > 1e-4 * np.abs(values).max(), name


def test_a_beacon_is_half_a_second_old_and_still_true():
    # The beacon leads by as much as the radio takes: what remains of 1.1 km is the noise of the fix.
    sim = fledge.load("constellation", spacecraft=2)
    for i in range(2):
        sim.process(f"sat{i}_world").nav.position_noise = [0] * 3
    sim.run(5 * s)
    beacon, state = sim.process("sat0_flight").guidance.primary, sim.process("sat1_world").craft.state
    assert beacon.head.t == 4_500_000_000 and state.head.t == 5_000_000_000
    assert np.linalg.norm(beacon.r_PN_N - state.r_BN_N) < 1e-3
    assert np.linalg.norm(state.v_BN_N) * 0.5 > 1000


@pytest.mark.parametrize("wrong", [1, 1000, 2.5, "four"])
def test_a_number_that_makes_no_ring_is_refused(wrong):
    with pytest.raises(fledge.SetupError, match="spacecraft(: expected .* from 2 to 999;| is a number, as 4;) found"):
        fledge.load("constellation", spacecraft=wrong)
    with pytest.raises(fledge.SetupError, match="no parameter 'craft'; it has spacecraft=4"):
        fledge.load("constellation", craft=4)


def test_the_record_and_the_report_say_how_many(tmp_path):
    from fledge import cli
    from fledge.archive import Archive

    assert cli.main(["run", "constellation", "--set", "spacecraft=2", "--no-plots", "--report", "--for", "2s", "--out",
                     str(tmp_path)]) == 0
    assert Archive(tmp_path / "run.mcap").metadata["run"]["parameters"] == "spacecraft=2"
    assert "./fledge run constellation --for 2s --set spacecraft=2" in (tmp_path / "report.html").read_text()


def test_its_parts_are_named_where_one_is_meant():
    sim = fledge.load("constellation")
    with pytest.raises(fledge.SetupError, match=r"several of the kind flight; take one by process\(\): sat0_flight"):
        sim.flight
    assert sim.process("sat1_flight").beacon.lead == 0.5
    clone = sim.clone()
    clone.run(2 * minute)
    assert sim.time == 0 and clone.process("sat3_world").craft.state.head.t == 120_000_000_000


def test_it_can_be_drawn_whatever_their_number(tmp_path):
    from fledge.mission.wiring import Wiring
    from fledge.plot.wiring import save

    skip_without("graphviz")
    for spacecraft in (2, 3, 8):
        wiring = Wiring(fledge.load("constellation", spacecraft=spacecraft))
        picture = save(wiring, tmp_path / "wiring.svg").read_text()
        assert picture.count("one exchange late") >= 2 * spacecraft
        assert "primary    << sat1_flight.beacon.body, one exchange late" in wiring.outline() or spacecraft == 2


def _record(sim):
    for process in sim.processes:
        sim.record(*process, every=0.1 if process.name.endswith("world") else 0.5)


def _records(sim):
    return {log.path: (log.times(), log.bytes()) for log in sim.records}


def test_a_node_for_each_process_gives_the_same_bits():
    whole = fledge.load("constellation", seed=3, spacecraft=3)
    _record(whole)
    whole.run(20 * s)
    together = _records(whole)
    names = [process.name for process in whole.processes]
    assert len(names) == 6 and len(cosim.crossing_wires(whole)) == 3 * (4 + 1 + 2)

    controller = cosim.Controller("constellation", names, 20 * s, seed=3, join=20, reply=20,
                                  address=f"ipc://@fledge-constellation-{os.getpid()}")
    apart, ends, threads = {}, [], []
    for name in names:
        def serve(name=name):
            sim = fledge.load("constellation", spacecraft=3)
            node = cosim.split(sim, name)
            _record(sim)
            try:
                ends.append(node.serve(controller.address))
            except Exception as error:
                ends.append(str(error))
            apart.update(_records(sim))

        threads.append(threading.Thread(target=serve))
        threads[-1].start()
    ends.append(controller.run())
    for thread in threads:
        thread.join()
    assert ends == [""] * 7
    assert [path for path in together if apart[path] != together[path]] == []
