# SPDX-License-Identifier: Apache-2.0
"""Plots: their words, and what is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from fledge import SetupError
from fledge.plot import component_labels, plot, save, symbol, time_unit, unit_label
from fledge.mission.simulation_test import spinner
from fledge.units import s


@pytest.mark.parametrize(
    "name, text",
    [
        ("sigma_BR", r"\sigma_{B/R}"),
        ("omega_BN_B", r"{}^{B}\omega_{B/N}"),
        ("domega_RN_N", r"{}^{N}\dot{\omega}_{R/N}"),
        ("sigma_BcB", r"\sigma_{B_{c}/B}"),
        ("r_BN_N", r"{}^{N}r_{B/N}"),
        ("Omega", r"\Omega"),
        ("u", "u"),
        ("u_max", r"u_{\mathrm{max}}"),
        ("torque_B", r"\mathrm{torque\ B}"),
        ("delta", r"\delta"),
    ],
)
def test_symbols(name, text):
    assert symbol(name) == text


def test_units_and_components():
    assert unit_label("N m") == "N·m" and unit_label("rad/s^2") == "rad/s$^{2}$" and unit_label("-") == ""
    assert unit_label("N m / s") == "N·m/s"
    assert component_labels("angles", "psi, theta, phi", (3,)) == [r"$\psi$", r"$\theta$", r"$\phi$"]
    assert component_labels("sigma_BR", "attitude of B relative to R", (3,))[2] == r"$\sigma_{3}$"
    assert [time_unit(t) for t in (0, 179.9)] == 2 * [("s", 1.0)]
    assert [time_unit(t) for t in (180, 7199.9)] == 2 * [("min", 60.0)]
    assert [time_unit(t) for t in (7200, 345599.9)] == 2 * [("h", 3600.0)]
    assert [time_unit(t) for t in (345600, 1e9)] == 2 * [("d", 86400.0)]


@pytest.fixture(scope="module")
def log():
    sim = spinner(rate=0.2)
    log = sim.record(sim.flight.tracking, sim.world.craft.state, sim.flight.target.reference, every=1 * s)
    sim.run(300 * s)
    return log


def test_lines_labels_and_units(log, tmp_path):
    figure = plot(log, "craft.state.sigma_BN", ["omega_BN_B[2]", "error.omega_BR_B[2]"], titles=["attitude"],
                  units={"omega_BN_B[2]": "rpm"})
    first, second = figure.axes
    assert first.get_title(loc="left") == "attitude" and first.get_ylabel() == r"$\sigma_{B/N}$"
    assert second.get_xlabel() == "time [min]" and len(first.lines) == 3 and len(second.lines) == 2
    np.testing.assert_allclose(second.lines[0].get_ydata(), 0.2 * 30 / np.pi, rtol=1e-9)
    np.testing.assert_allclose(first.lines[0].get_xdata()[-1], 5.0)
    # The body turns: no stroke is drawn where its MRPs go over to the shadow set.
    third = first.lines[2].get_ydata()
    assert 8 <= np.isnan(third).sum() <= 12
    second.set_xlim(0, 20)
    assert not (first.get_xticks() % 1).any()  # never 2.5 minutes
    path = save(figure, tmp_path / "new")
    assert path.name == "craft_state_sigma_BN-omega_BN_B_2-error_omega_BR_B_2.png"
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 10000


def test_names_that_cannot_be_drawn(log):
    with pytest.raises(SetupError, match="'error' is a whole message; name one of its fields: sigma_BR"):
        plot(log, "error")
    with pytest.raises(SetupError, match="did you mean omega_BN_B"):
        plot(log, "omega_BNB")
    with pytest.raises(SetupError, match="name at least one field"):
        plot(log)


@pytest.mark.parametrize(
    "units, text",
    [
        ({"error.omega_BR_B": "deg"}, "omega_BR_B is in rad/s, which cannot be shown in deg; did you mean deg/s?"),
        ({"error.omega_BR_B": "Hz"}, "error.omega_BR_B is in rad/s, which cannot be shown in Hz"),
        ({"sigma_BN": "deg"}, "craft.state.sigma_BN is in no unit, which cannot be shown in deg"),
        ({"sigma_BN": "m"}, "craft.state.sigma_BN is in no unit, which cannot be shown in m"),
        ({"error.omega_BR_B": "degrees"}, "'degrees' is no unit; the units are m, km, cm"),
        ({"omega": "deg/s"}, "units names 'omega', which is not plotted; there are error.omega_BR_B, craft"),
    ],
)
def test_a_unit_of_another_dimension_is_refused(log, units, text):
    with pytest.raises(SetupError) as error:
        plot(log, "error.omega_BR_B", "craft.state.sigma_BN", units=units)
    assert text in str(error.value)


def test_a_rate_is_shown_in_degrees_per_second(log):
    axis = plot(log, "craft.state.omega_BN_B[2]", units={"omega_BN_B[2]": "deg/s"}).axes[0]
    assert axis.get_ylabel() == r"${}^{B}\omega_{B/N}$  [deg/s]"
    np.testing.assert_allclose(axis.lines[0].get_ydata(), np.degrees(0.2), rtol=1e-9)


@pytest.mark.parametrize("value, ends", [(0.0, (-1, 1)), (-4e-7, (-4.4e-7, -3.6e-7)), (5.0, (4.5, 5.5))])
def test_the_axis_of_a_constant_has_it_in_the_middle(log, value, ends):
    series = log.series("error.omega_BR_B[2]")
    axis, = plot(log, replace(series, values=np.full_like(series.values, value))).axes
    assert axis.get_ylim() == pytest.approx(ends)


def test_an_enumeration_has_its_names_on_the_axis(log, tmp_path):
    figure = plot(log, "tracking.error.head.quality")
    axis = figure.axes[0]
    assert [label.get_text() for label in axis.get_yticklabels()] == ["none", "stale", "degraded", "good"]
    assert axis.lines[0].get_drawstyle() == "steps-post" and axis.get_ylabel() == "quality"
    assert set(axis.lines[0].get_ydata()) <= {0, 1, 2, 3}
    assert axis.get_title(loc="left") == "tracking.error: how far the content may be trusted"
    assert save(figure, tmp_path).stat().st_size > 5000
    both = plot(log, ["tracking.error.head.quality", "craft.state.head.quality"]).axes[0]
    quality, truth = (line.get_ydata()[-1] for line in both.lines)
    assert quality < 3 < truth      # neither hides the other
    assert both.get_title(loc="left") == "tracking.error, craft.state"


def test_names_of_files_stay_in_their_folder(log, tmp_path):
    for name, file in (("../up", "_up.png"), ("a/b", "a_b.png"), ("a\nb", "a_b.png"), ("...", "figure.png")):
        assert save(plot(log, "error.sigma_BR", name=name), tmp_path) == tmp_path / file
