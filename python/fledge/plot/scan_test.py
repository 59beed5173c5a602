# SPDX-License-Identifier: Apache-2.0
"""Scan patterns: the plane's angles against the rotations they stand for, and what is drawn."""

import numpy as np
import pytest

from fledge import SetupError, attitude, scan
from fledge.mission.simulation_test import spinner
from fledge.units import s

RANDOM = np.random.default_rng(11)


@pytest.mark.parametrize("centre", [1, 2, 3, -1, -2, -3])
def test_the_angles_turn_the_centre_to_the_boresight(centre):
    angles = RANDOM.uniform([-3.1, -1.5], [3.1, 1.5], (50, 2))
    k = abs(centre) - 1
    axis = np.sign(centre) * np.eye(3)[k]
    # First about the axis before it in the cycle, then about the new axis after it.
    first = attitude.axis_rotation((k + 2) % 3 + 1, angles[:, 0])
    turned = attitude.axis_rotation((k + 1) % 3 + 1, angles[:, 1]) @ first
    path = scan.Path(np.arange(50), np.einsum("nji,j->ni", turned, axis))
    np.testing.assert_allclose(path.angles(centre), angles, atol=1e-13)


def test_about_axis_1_they_are_yaw_and_pitch():
    euler = RANDOM.uniform(-1, 1, (20, 3))
    b1 = attitude.euler_to_dcm(euler)[:, 0]
    np.testing.assert_allclose(scan.Path(np.arange(20), b1).angles(), euler[:, :2], atol=1e-14)


def test_parts_and_distances():
    angle = np.linspace(0, 1, 11)
    great_circle = scan.Path(np.arange(11), np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1))
    np.testing.assert_allclose(great_circle.off([1, 0, 0]), angle, atol=1e-16)
    part = great_circle.during(3, 6)
    np.testing.assert_array_equal(part.time, [3, 4, 5, 6])
    np.testing.assert_allclose(part.off(great_circle.during(4, 7)), 0.1, rtol=1e-13)
    assert "4 samples, 3 s to 6 s" in repr(part)
    with pytest.raises(SetupError, match="the paths have 4 and 11 samples"):
        part.off(great_circle)


@pytest.fixture(scope="module")
def log():
    sim = spinner(rate=0.2)
    log = sim.record(sim.world.craft.state, sim.flight.target.reference, every=1 * s)
    sim.run(30 * s)
    return log


def test_paths_of_a_log(log):
    # It turns about b3 at 0.2 rad/s: b3 rests, b1 runs along the equator of N, and in the body all rest.
    assert scan.path(log, "state.sigma_BN", boresight=3).off([0, 0, 1]).max() < 1e-12
    yaw, pitch = scan.path(log, "state.sigma_BN").during(0, 15).angles().T
    np.testing.assert_allclose(np.unwrap(yaw), 0.2 * np.arange(16), atol=1e-9)
    assert abs(pitch).max() < 1e-12
    forward, backward = (scan.path(log, "state.sigma_BN", boresight=b) for b in ([2, 0, 0], -1))
    np.testing.assert_allclose(backward.direction, -forward.direction)
    still = scan.path(log, "state.sigma_BN", base="state.sigma_BN", boresight=[1, 2, 3])
    assert still.off(np.array([1, 2, 3]) / np.sqrt(14)).max() < 1e-14


def test_wrong_paths_are_refused(log):
    with pytest.raises(SetupError, match="did you mean state.sigma_BN"):
        scan.path(log, "state.sigmaBN")
    with pytest.raises(SetupError, match="expected an axis 1, 2, 3, -1, -2 or -3; found 4"):
        scan.path(log, "state.sigma_BN", boresight=4)
    with pytest.raises(SetupError, match="not all zero"):
        scan.path(log, "state.sigma_BN", boresight=[0, 0, 0])
    with pytest.raises(SetupError, match="nothing to draw"):
        scan.plane(log, {})


def test_lines_arrows_and_labels(tmp_path):
    from fledge.plot import save

    time = np.arange(101)
    angle = np.radians(np.linspace(-10, 10, 101))
    line = scan.Path(time, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1))
    figure = scan.plane(None, {"wanted": line, "flown": [line]}, numbered="wanted", marks={"home": (0, 0)})
    (axis,) = figure.axes
    assert axis.get_xlabel() == "yaw $\\psi$  [deg]" and axis.get_ylabel() == "pitch $\\theta$  [deg]"
    assert [t.get_text() for t in axis.texts if t.get_text()] == ["1a", "1b"]
    assert [t.get_text() for t in axis.get_legend().get_texts()] == ["wanted", "flown", "home"]
    np.testing.assert_allclose(axis.lines[0].get_xdata(), np.degrees(angle), atol=1e-12)
    assert save(figure, tmp_path).read_bytes()[:4] == b"\x89PNG"

    other = scan.Path(time, line.direction[:, [2, 0, 1]])
    assert scan.plane(None, {"b": other}, centre=2).axes[0].get_xlabel() == "roll $\\phi$  [deg]"

    figure = scan.sphere(None, {"wanted": line}, rays="wanted", view=(0.0, 0.0), name="b")
    # Seen along axis 1: yaw runs to the right, and lines behind are not drawn in front.
    drawn = next(line_ for line_ in figure.axes[0].lines if line_.get_label() == "wanted")
    np.testing.assert_allclose(drawn.get_xdata(), np.sin(angle), atol=1e-15)
    behind = scan.sphere(None, {"wanted": scan.Path(time, -line.direction)}, view=(0.0, 0.0))
    assert np.isnan(next(line_ for line_ in behind.axes[0].lines if line_.get_label() == "wanted").get_xdata()).all()
