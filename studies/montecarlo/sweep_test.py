# SPDX-License-Identifier: Apache-2.0
"""Sweeps: each point is the run that one gets by hand, in whatever way it is flown."""

import json
import shlex

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.montecarlo import Sweep, lin, log, plots
from fledge.montecarlo.dispersions_test import every_kind, mission  # noqa: F401 (a fixture)
from fledge.montecarlo.montecarlo_test import same
from fledge.plot import save
from fledge.report.report_test import Page
from fledge.units import N, deg, m, s

SETTLE = """
from fledge.units import deg, m, N, s
def settle(d):
    'Released slowly.'
    d.duration, d.every = 10 * s, 1 * s
    d["world.craft.omega_BN_B"] = d.normal(0, 1 * deg / s)
    error = d.retain("flight.tracking.error.sigma_BR")
    d.check(error.norm().final < 0.74, "far away")
"""


@pytest.fixture
def spin(tmp_path):
    """nadir_spin with a parameter of the mission, the mass."""
    mission(tmp_path, SETTLE)
    world = (tmp_path / "world.py").read_text().replace("def build(w, f):", "def build(w, f, mass=1.0):")
    (tmp_path / "world.py").write_text(world + "\n    w.craft.mass = mass\n")
    return tmp_path


def by_hand(folder, seed, **values):
    """The error over time of a run with these gains, and its simulation."""
    mass = values.pop("mass", 1.0)
    sim = fledge.load(folder, mass=mass)
    for name, value in values.items():
        setattr(sim.flight.control, name, value)
    sim = sim.clone()
    sim.seed = seed
    log_of = sim.record(sim.flight.tracking.error, every=1 * s)
    sim.run(10 * s)
    return log_of["error.sigma_BR"]


def test_each_point_is_the_run_by_hand(spin):
    K, P = [2 * N * m, 3 * N * m, 5 * N * m], lin(30, 60, 2)
    sweep = Sweep(spin, {"flight.control.K": K, "flight.control.P": P})
    result = sweep.fly(seed=3, threads=2)
    assert len(result) == 6 and list(result.draws) == [
        "flight.control.K", *(f"flight.control.P[{i}, {i}]" for i in range(3))]
    error = result.retained["flight.tracking.error.sigma_BR"]
    for index in range(6):
        at = sweep.at(index)
        assert at == {"flight.control.K": K[index % 3], "flight.control.P": P[index // 3]}
        seed = sweep.simulation(index, seed=3).seed
        assert seed == sweep.simulation(0, seed=3).seed
        assert (by_hand(spin, seed, K=K[index % 3], P=P[index // 3]) == error[index]).all()
    grid = sweep.on_grid(result.draws["flight.control.K"])
    assert grid.shape == (1, 2, 3) and (grid[0] == [[2, 3, 5]] * 2).all()
    assert same(sweep.fly(seed=3, processes=True), result)


def test_a_parameter_of_the_mission_is_an_axis(spin):
    sweep = Sweep(spin, {"mass": [1.0, 2.0], "flight.control.K": log(1, 4, 3)})
    result = sweep.fly(seed=3, threads=2)
    assert result.draws["mass"].tolist() == [1, 2] * 3
    assert result.draws["flight.control.K"] == pytest.approx([1, 1, 2, 2, 4, 4], rel=1e-14)
    sim = sweep.simulation(3, seed=3)
    assert sim.world.craft.mass == 2 and sweep.drawn(sim) == {"mass": 2, "flight.control.K": pytest.approx(2)}
    error = result.retained["flight.tracking.error.sigma_BR"]
    assert (by_hand(spin, sim.seed, mass=2.0, K=log(1, 4, 3)[1]) == error[3]).all()


def test_a_dispersed_sweep_has_the_same_draws_at_each_point(spin):
    sweep = Sweep(spin, {"flight.control.K": [1, 2, 3]}, dispersed=True)
    result = sweep.fly(4, seed=1)
    rates = sweep.on_grid(result.draws["world.craft.omega_BN_B[0]"])
    assert rates.shape == (4, 3) and (rates == rates[:, :1]).all() and len(np.unique(rates)) == 4
    plain = fledge.montecarlo.Campaign(spin).fly(4, seed=1)
    assert (rates[:, 0] == plain.draws["world.craft.omega_BN_B[0]"]).all()


def test_enumerations_and_whole_numbers_are_axes(every_kind):  # noqa: F811
    def declare(d):
        d.duration = 2
        d.retain("flight.noise.kinds.phase")

    result = Sweep(every_kind, {"flight.noise.phase": ["SAFE", "DRAIN"], "flight.noise.parts[1].pairs[1].count": [3, 4],
                                "flight.noise.phases": [["SAFE"] * 3, ["SCIENCE"] * 3]}, declare).fly()
    assert result.draws["flight.noise.phase"].tolist() == [0, 100] * 4
    assert result.draws["flight.noise.parts[1].pairs[1].count"].tolist() == [3, 3, 4, 4] * 2
    assert result.draws["flight.noise.phases[2]"].tolist() == [0] * 4 + [3] * 4


def test_ranges():
    assert lin(1 * m, 2 * m, 3)[1].value == 1.5 and lin(0.1, 1, 10)[-1] == 1
    assert log(1, 100, 3) == pytest.approx([1, 10, 100]) and log(0.1 * m, 10 * m, 3)[1].value == pytest.approx(1)


@pytest.mark.parametrize("words, error", [
    ([], "a sweep needs an axis, as in stiffness=0.1:1:10"),
    (["mas=1,2"], "has no parameter 'mas'; it has mass=1.0"),
    (["flight.control.k=1,2"], "flight.control has no 'k'; did you mean 'K'?"),
    (["flight.control.K=1:2"], "expected FIRST:LAST:COUNT or FIRST:LAST:COUNT:log, as in 0.1:1:10"),
    (["flight.control.K=1:2:3:cubic"], "expected FIRST:LAST:COUNT"),
    (["flight.control.K=1:2:1"], "a range of values needs at least 2, found 1"),
    (["flight.control.K=-1:2:3:log"], "log: the ends must be > 0, found -1.0 and 2.0"),
    (["flight.control.K=0:2:3"], "flight.control.K must be > 0 N m, found 0 N m"),
    (["flight.control.K=1,1"], "the axis flight.control.K has a value twice"),
    (["flight.control.K=1,2", "flight.control.K=3,4"], "an axis is given twice"),
    (["flight.control.K"], "expected NAME=VALUES"),
    (["world.craft.I_B=1,-2"], "world.craft.I_B"),
    (["flight.tracking.error.sigma_BR=1,2"], "is no parameter"),
])
def test_wrong_axes(spin, words, error, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["sweep", str(spin), *(word for value in words for word in ("--set", value))]) == 2
    assert error in capsys.readouterr().err and not (tmp_path / "runs").exists()


@pytest.mark.long("flies a sweep, draws its page")
def test_the_command_and_the_page(spin, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["sweep", str(spin), "--set", "flight.control.K=1:20:3:log", "--set", "mass=1,2"]) == 1
    out, err = capsys.readouterr()
    assert "flight.control.K  = 1, 4.47214, 20  N m" in out and "the mission takes mass, so" in err
    folder = tmp_path / "runs" / spin.name / "sweep" / "settle"
    data = json.loads((folder / "summary.json").read_text())
    assert data["points"] == 6 and 0 < data["failed"] < 6 and (folder / "axes.png").exists()
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert page.says("Each of the 6 points is one run") and page.says("1, 4.47214, 20")
    failure = data["failures"][0]
    assert page.says(failure["command"])
    assert cli.main(shlex.split(failure["command"])[1:]) == 1
    out, err = capsys.readouterr()
    assert failure["text"] in err
    drawn = {line.split()[1]: line for line in out.splitlines() if line.startswith("  drawn")}
    assert "nominal" in drawn["flight.control.K"] and "nominal" not in drawn["mass"]
    assert cli.main(["sweep", str(spin), "--set", "mass=1,2", "--runs",
                    "3", "--jobs", "1", "--out", "more"]) in (0, 1)
    assert "runs     6 of 10 s" in capsys.readouterr().out


@pytest.mark.parametrize("values, edges", [
    ([1, 2, 3], [0.5, 1.5, 2.5, 3.5]), ([2, 4], [1, 3, 5]), ([5], [4.5, 5.5]),
    ([1, 100, 1e4], [0.1, 10, 1e3, 1e5]),       # on a logarithmic axis
])
def test_cells_of_a_map_are_about_their_points(values, edges):
    np.testing.assert_allclose(plots._edges(np.array(values, float)), edges, rtol=1e-12)


def test_three_axes_have_a_panel_each(spin, tmp_path):
    axes = {"flight.control.K": [1, 2], "flight.control.P": [30, 40], "world.craft.mass": [1, 2]}
    figure, = plots._axes(Sweep(spin, axes).fly())
    assert [axis.get_xlabel() for axis in figure.axes] == ["flight.control.K  [N m]", "flight.control.P  [N m s]",
                                                           "world.craft.mass  [kg]"]
    assert save(figure, tmp_path).stat().st_size > 1000
