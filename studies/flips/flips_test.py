# SPDX-License-Identifier: Apache-2.0
"""Campaigns of bit flips: known flips have their known effects, and a seed determines all."""

import struct

import numpy as np
import pytest

import fledge
from fledge import attitude, cli
from fledge.emulator import flips
from fledge.emulator.flips import Campaign, Flip, Measure
from tests.needs import flies_on

pytestmark = flies_on("leon3")


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "edac"])
def campaign(request):
    return Campaign("nadir_spin", at=4, duration=3, after=11, edac=request.param)


def of_memory(campaign, place, bit, instruction=0):
    return campaign.outcome(Flip("data", campaign.board.address(place), bit, instruction))


def test_known_flips_have_their_effects(campaign):
    gain = of_memory(campaign, "flight.control.K", 4)       # of the upper byte: the exponent
    code = of_memory(campaign, "mrp_feedback_update", 7)
    unused = campaign.outcome(Flip("integer register", "%g7", 3, 1000))
    lost = campaign.outcome(Flip("control register", "%pc", 31, campaign.instructions // 2))
    late = campaign.outcome(Flip("control register", "%pc", 31, campaign.instructions - 1))
    assert (unused.effect, unused.first, unused.missed) == ("no effect", None, 0)
    assert lost.effect == "recovered by watchdog" and lost.resets == 1 and 18 <= lost.missed <= 22
    assert 4 < lost.first < 7 and late.first == 7.0
    if campaign.edac:
        assert (gain.effect, code.effect) == ("no effect", "no effect") and min(gain.corrected, code.corrected) > 0
    else:
        assert (gain.effect, gain.first, gain.missed) == ("wrong output", 4.5, 0)
        assert code.effect == "recovered by watchdog" and gain.corrected == 0


def test_a_wrong_output_is_as_wrong_as_on_the_desktop(campaign):
    """A flip of the gain in the computer, and a desktop that is given the gain which it makes."""
    gain = campaign.outcome(Flip("data", campaign.board.address("flight.control.K") + 1, 6, 0))    # of the exponent
    flown = {}
    for factor in (1, 16):
        sim = fledge.load("nadir_spin")
        log = sim.record(sim.world.craft.state, sim.flight.motor.command)
        sim.run(until=4, progress=False)
        sim.flight.control.K *= factor
        sim.run(until=18, progress=False)
        flown[factor] = [attitude.mrp_to_dcm(log["state.sigma_BN"]), log["command.u"]]
    (there, torques), (here, others) = flown[1], flown[16]
    cosine = (np.einsum("nij,nij->n", here, there) - 1) / 2
    turned = np.degrees(np.arccos(cosine.min()))
    expected = [turned, turned, None, np.abs(torques - others).max()]
    assert [measure.path.split(".")[1] for measure in campaign.measures] == ["craft", "tracking", "tracking", "motor"]
    assert [measure.unit for measure in campaign.measures] == ["deg", "deg", "rad/s", "N m"]
    for found, wanted in zip(gain.deviations, expected):
        if campaign.edac:
            assert found == 0.0
        elif wanted is not None:
            assert found == pytest.approx(wanted, rel=1e-6) and wanted > 0.1


def test_a_deviation_is_the_angle_of_attitudes_and_the_largest_of_other_numbers():
    sigma = np.array([[0.1, 0.2, -0.3], [0, 0, 0]])
    turned = np.array([[0.1, 0.2, -0.3], [0, 0, np.tan(np.radians(30) / 4)]])
    measure = Measure("world.craft.state.sigma_BN", "deg")
    assert flips.deviation(measure, turned, sigma) == pytest.approx(30)
    assert flips.deviation(measure, attitude.shadow(sigma[:1]), sigma[:1]) == pytest.approx(0, abs=1e-6)
    plain = Measure("flight.motor.command.u", "N m")
    nan = np.array([[np.nan, 0.0]])
    assert flips.deviation(plain, np.array([[1.0, -3.0]]), np.array([[1.0, 2.0]])) == 5.0
    assert flips.deviation(plain, nan, np.array([[1.0, 0.0]])) == np.inf and flips.deviation(plain, nan, nan) == 0.0


@pytest.mark.parametrize("byte, bit, bits, mask", [(0, 7, 1, 1 << 31), (3, 0, 32, 0xFFFFFFFF), (3, 7, 2, 0x180),
                                                   (2, 6, 5, 0x7C000)])
def test_several_bits_are_neighbours_in_one_word(campaign, byte, bit, bits, mask):
    board = campaign.board
    word = board.address("flight.control.K")
    before = struct.unpack(">3I", board.peek(word - 4, 12))
    flip = Flip("data", word + byte, bit, 0, bits=bits)
    for single in flip.single:
        board.flip(*single)
    after = struct.unpack(">3I", board.peek(word - 4, 12))
    for single in flip.single:
        board.flip(*single)
    assert [a ^ b for a, b in zip(before, after)] == [0, mask, 0]
    assert Flip("float register", "%f3", 4, bits=3).single == [("%f3", 4), ("%f3", 5), ("%f3", 6)]


def test_edac_finds_two_bits_of_a_word_and_corrects_none(campaign):
    two = campaign.outcome(Flip("data", campaign.board.address("flight.control.K"), 4, 0, bits=2))
    assert two.effect == ("recovered by watchdog" if campaign.edac else "wrong output") and two.corrected == 0


def test_a_flip_at_a_time_acts_from_the_next_instant_on(campaign):
    gain = Flip("data", campaign.board.address("flight.control.K"), 4, time=5_600_000_000)
    assert campaign.outcome(gain).first == (None if campaign.edac else 6.0)


@pytest.mark.long("waits for the watchdog")
def test_without_time_for_the_watchdog_the_processor_stands():
    campaign = Campaign("nadir_spin", at=2, duration=1, after=1)
    assert campaign.outcome(Flip("control register", "%pc", 31, 1000)).effect == "trap"


def test_a_seed_says_all_and_the_processes_do_not_matter(campaign, tmp_path):
    first = campaign.fly(10, seed=5, workers=1)
    assert campaign.fly(10, seed=5, workers=3) == first
    assert campaign.fly(4, seed=5) == first[:4]
    assert [outcome.flip for outcome in campaign.fly(4, seed=6)] != [outcome.flip for outcome in first[:4]]
    lines = flips.table(first)
    assert lines[0].split() == "no effect wrong output recovered by watchdog hang trap all".split()
    assert lines[-1].split()[-1] == "10" and sum(int(line.split()[-1]) for line in lines[1:-1]) == 10
    table = [line.split(",") for line in flips.csv(first, campaign.measures).splitlines()]
    assert len(table) == 11 and {len(row) for row in table} == {11 + len(campaign.measures)}
    shown = flips.severity(first, campaign.measures)
    assert len(shown) == 5 * len({outcome.effect for outcome in first} - {"no effect"})


@pytest.mark.long("a campaign on each engine")
def test_all_engines_agree_on_every_outcome():
    translated, interpreted = (Campaign("nadir_spin", at=2, duration=2, after=1, engine=engine)
                               for engine in ("translator", "interpreter"))
    assert translated.fly(12, seed=2) == interpreted.fly(12, seed=2)


def drawn(campaign, bits=1, rates=None, n=4000):
    campaign.bits, campaign.rates = bits, rates
    try:
        campaign.survey()
        return [campaign.flip(1, i) for i in range(n)]
    finally:
        campaign.bits, campaign.rates = 1, None
        campaign.survey()


def share_of_registers(flips_):
    return sum(flip.place in flips.PLACES[:3] for flip in flips_) / len(flips_)


def test_each_bit_that_exists_is_as_likely(campaign):
    program = campaign.board.core
    memory = 8 * (campaign.board.address("leon3_data_load") - program.entry + 4096
                  + campaign.board.address("leon3_bss_end") - campaign.board.address("leon3_data"))
    # Windows, globals, floats, Y, WIM, PC, nPC; and PSR, TBR, FSR, some of whose bits are constants.
    registers = 32 * (8 * 16 + 7 + 32) + 32 + 8 + 30 + 30
    assert campaign.n_memory == memory and registers < campaign.n_registers < registers + 3 * 32
    found = drawn(campaign)
    assert share_of_registers(found) == pytest.approx(registers / memory, abs=0.006)
    in_memory = [flip for flip in found if flip.place in ("code", "data", "stack")]
    on_stack = sum(flip.place == "stack" for flip in in_memory) / len(in_memory)
    assert on_stack == pytest.approx(8 * 4096 / memory, abs=0.015)
    assert all(0 <= flip.instruction < campaign.instructions and flip.time is None for flip in found)
    assert {flip.bit for flip in in_memory} == set(range(8)) and {flip.where % 4 for flip in in_memory} == set(range(4))


def test_rates_weigh_registers_and_memory(campaign):
    even = drawn(campaign, rates=(1 / campaign.n_registers, 1 / campaign.n_memory))
    assert share_of_registers(even) == pytest.approx(0.5, abs=0.04)
    assert {flip.place for flip in even} == set(flips.PLACES)
    assert all(campaign.at <= flip.time < campaign.middle and flip.instruction is None for flip in even)
    only = drawn(campaign, rates=(1e-7, 0.0), bits=3)
    assert share_of_registers(only) == 1.0 and share_of_registers(drawn(campaign, rates=(0.0, 2e-7), n=50)) == 0.0
    assert {flip.bit for flip in only if flip.place == "integer register"} == set(range(30))
    pc = {flip.bit for flip in drawn(campaign, rates=(1, 0), n=20000) if flip.where in ("%pc", "%npc")}
    assert pc and not pc & {0, 1}                   # which do not exist


def test_rates_make_effects_per_day(campaign, monkeypatch):
    monkeypatch.setattr(campaign, "rates", (1e-6, 1e-7))
    assert campaign.per_day == pytest.approx(1e-6 * campaign.n_registers + 1e-7 * campaign.n_memory)
    some = [flips.Outcome(Flip("code", 0, 0), effect, None, 0, 0, 0, ()) for effect in ("no effect", "hang")]
    rows = {line.rsplit(None, 8)[0].strip(): line.split() for line in flips.shares(some * 5, 10.0)[1:]}
    assert rows["hang"][-7:] == "50.0 23.7 to 76.3 5 2.4 to 7.6".split()[-7:]


@pytest.mark.long("a campaign on the emulator")
def test_the_command_writes_tables_and_a_plot(tmp_path, capsys):
    words = ["flips", "nadir_spin", "--count", "6", "--seed", "3", "--at", "2s", "--for", "1s", "--after", "0s"]
    assert cli.main([*words, "--out", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert "nadir_spin, without EDAC, 6 flips from 2 s to 3 s, seed 3" in output and "nadir_spin, with EDAC" in output
    plain, edac = ((tmp_path / name).read_text().splitlines() for name in ("plain.csv", "edac.csv"))
    assert [line.split(",")[:4] for line in plain] == [line.split(",")[:4] for line in edac] and len(plain) == 7
    assert (tmp_path / "flips.png").stat().st_size > 10_000
    assert cli.main([*words, "--out", str(tmp_path), "--rates", "1e-7", "2e-8", "--bits", "2", "--edac", "on"]) == 0
    assert "flips per day" in capsys.readouterr().out
    assert cli.main([*words[:2], "--count", "0", "--out", str(tmp_path)]) == 2
    assert "expected at least 1, found 0" in capsys.readouterr().err


@pytest.mark.parametrize("wrong, message", [
    ({"duration": 0}, "at and duration must be more than 0 s"),
    ({"bits": 0}, "a flip inverts 1 to 32 bits of a word; found 0"),
    ({"bits": 33}, "found 33"),
    ({"rates": (0, 0)}, "expected the rates of registers and of memory"),
    ({"rates": (-1, 1)}, "found -1, 1"),
    ({"rates": (float("nan"), 1)}, "found nan, 1"),
])
def test_what_cannot_be_drawn_is_refused(wrong, message):
    with pytest.raises(fledge.SetupError, match=message):
        Campaign("nadir_spin", at=4, **wrong)
