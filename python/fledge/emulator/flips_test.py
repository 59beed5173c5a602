# SPDX-License-Identifier: Apache-2.0
"""Campaigns of bit flips: known flips have their known effects, and a seed says all."""

import pytest

import fledge
from fledge import cli
from fledge.emulator import flips
from fledge.emulator.flips import Campaign, Flip


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "edac"])
def campaign(request):
    return Campaign("nadir_spin", at=4, duration=3, after=11, edac=request.param)


def of_memory(campaign, place, bit, instruction=0):
    return campaign.one(Flip("data", campaign.board.address(place), bit, instruction))


def test_known_flips_have_their_effects(campaign):
    gain = of_memory(campaign, "flight.control.K", 4)       # of the upper byte: the exponent
    code = of_memory(campaign, "mrp_feedback_update", 7)
    unused = campaign.one(Flip("integer register", "%g7", 3, 1000))
    lost = campaign.one(Flip("control register", "%pc", 31, campaign.instructions // 2))
    late = campaign.one(Flip("control register", "%pc", 31, campaign.instructions - 1))
    assert (unused.effect, unused.first, unused.missed) == ("no effect", None, 0)
    assert lost.effect == "recovered by watchdog" and lost.resets == 1 and 18 <= lost.missed <= 22
    assert 4 < lost.first < 7 and late.first == 7.0
    if campaign.edac:
        assert (gain.effect, code.effect) == ("no effect", "no effect") and min(gain.corrected, code.corrected) > 0
    else:
        assert (gain.effect, gain.first, gain.missed) == ("wrong output", 4.5, 0)
        assert code.effect == "recovered by watchdog" and gain.corrected == 0


def test_without_time_for_the_watchdog_the_processor_stands():
    campaign = Campaign("nadir_spin", at=2, duration=1, after=1)
    assert campaign.one(Flip("control register", "%pc", 31, 1000)).effect == "trap"


def test_a_seed_says_all_and_the_processes_do_not_matter(campaign, tmp_path):
    first = campaign.fly(10, seed=5, workers=1)
    assert campaign.fly(10, seed=5, workers=3) == first
    assert campaign.fly(4, seed=5) == first[:4]
    assert [one.flip for one in campaign.fly(4, seed=6)] != [one.flip for one in first[:4]]
    lines = flips.table(first)
    assert lines[0].split() == "no effect wrong output recovered by watchdog hang trap all".split()
    assert lines[-1].split()[-1] == "10" and sum(int(line.split()[-1]) for line in lines[1:-1]) == 10
    assert len(flips.csv(first).splitlines()) == 11


def test_all_engines_agree_on_every_outcome():
    translated, interpreted = (Campaign("nadir_spin", at=2, duration=2, after=1, engine=engine)
                               for engine in ("translator", "interpreter"))
    assert translated.fly(12, seed=2) == interpreted.fly(12, seed=2)


def test_the_draw_covers_registers_and_memory(campaign):
    drawn = [campaign.flip(1, i) for i in range(4000)]
    places = {place: [one for one in drawn if one.place == place] for place in flips.PLACES}
    registers = sum(len(places[place]) for place in flips.PLACES[:3])
    assert abs(registers - 2000) < 150 and all(places.values())
    assert len(places["code"]) > len(places["data"]) > len(places["stack"])
    assert {one.bit for one in places["integer register"]} == set(range(32))
    assert {one.bit for one in places["code"]} == set(range(8))
    assert all(0 <= one.instruction < campaign.instructions for one in drawn)


def test_the_command_writes_tables_and_a_plot(tmp_path, capsys):
    words = ["flips", "nadir_spin", "--count", "6", "--seed", "3", "--at", "2s", "--for", "1s", "--after", "0s"]
    assert cli.main([*words, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "nadir_spin, without EDAC, 6 flips from 2 s to 3 s, seed 3" in said and "nadir_spin, with EDAC" in said
    plain, edac = ((tmp_path / name).read_text().splitlines() for name in ("plain.csv", "edac.csv"))
    assert [one.split(",")[:4] for one in plain] == [one.split(",")[:4] for one in edac] and len(plain) == 7
    assert (tmp_path / "flips.png").stat().st_size > 10_000
    assert cli.main([*words[:2], "--count", "0", "--out", str(tmp_path)]) == 2
    assert "expected at least 1, found 0" in capsys.readouterr().err


def test_no_time_for_flips_is_refused():
    with pytest.raises(fledge.SetupError, match="at and duration must be more than 0 s"):
        Campaign("nadir_spin", at=4, duration=0)
