# SPDX-License-Identifier: Apache-2.0
"""A prototype beside the module that takes its place, on the recorded inputs of a mission."""
import re

import pytest

from fledge import SetupError, flight as fsw, prototype
from fledge.flight_math import mat_vec, mrp_compose, mrp_relative, mrp_to_dcm, vec_neg, vec_sub
from fledge.prototype import Vec3, compare, input, mem, out, par
from fledge.units import s


class TrackingError(prototype.Module):
    """flight/guidance/tracking_error.c in Python."""
    attitude  = input(fsw.NavAttitude)
    reference = input(fsw.AttReference, "Ri: what the control frame shall follow")
    error     = out(fsw.AttError)
    sigma_BcB = par(Vec3, "[-] attitude of the control frame Bc relative to B")
    hold      = par(float, "[s] >= 0: how long an old attitude counts; 0: ten updates")

    def update(self, t, dt):
        body, reference, error = self.attitude, self.reference, self.error
        quality = prototype.quality(body, reference)
        if not quality:
            return self.held(error)
        sigma_RN = mrp_compose(vec_neg(self.sigma_BcB), reference.sigma_RN)
        dcm_BN = mrp_to_dcm(body.sigma_BN)
        error.sigma_BR = mrp_relative(body.sigma_BN, sigma_RN)
        error.omega_RN_B = mat_vec(dcm_BN, reference.omega_RN_N)
        error.omega_BR_B = vec_sub(body.omega_BN_B, error.omega_RN_B)
        error.domega_RN_B = mat_vec(dcm_BN, reference.domega_RN_N)
        self.publish(error, quality=quality)


def test_python_and_c_agree_to_the_last_bit_where_they_call_the_same_functions():
    assert compare("nadir_spin", TrackingError, fsw.TrackingError, 120 * s) == 0.0


def otherwise(change):
    class Other(TrackingError):
        """With an error."""

        def update(self, t, dt):
            super().update(t, dt)
            change(self, t)
    Other.__name__ = "Other"
    return Other


def test_the_first_difference_is_reported():
    def a_bit(self, t):
        if t >= 2:
            self.error.sigma_BR[1] *= 1 + 2**-52

    with pytest.raises(AssertionError, match=re.escape("error.sigma_BR[1] at 2 s: ")) as error:
        compare("nadir_spin", otherwise(a_bit), fsw.TrackingError, 10 * s)
    assert "17 of 21 samples differ; numbers lie up to " in str(error.value)
    assert 0 < compare("nadir_spin", otherwise(a_bit), fsw.TrackingError, 10 * s, within=1e-15) <= 2**-52


def test_a_head_that_differs_is_reported_whatever_the_bound():
    def degrade(self, t):
        self.publish(self.error, quality="DEGRADED")

    with pytest.raises(AssertionError, match=r"error.head.quality at 0 s: 2 of the first, 3 of the second; 21 of 21"):
        compare("nadir_spin", otherwise(degrade), fsw.TrackingError, 10 * s, within=1)


def test_c_that_was_not_translated_differs():
    """What `fledge new --from` writes puts nothing out."""
    class Silent(TrackingError):
        """Puts nothing out."""

        def update(self, t, dt):
            pass

    with pytest.raises(AssertionError, match="error.head.t at 0.5 s"):
        compare("nadir_spin", TrackingError, Silent, 5 * s, within=1)


def test_a_mission_that_flies_none_of_both_is_refused():
    class Lonely(prototype.Module):
        """Flies nowhere."""
        value = mem(float, "[-] a number")

        def update(self, t, dt):
            pass

    with pytest.raises(SetupError, match="the mission nadir_spin flies no Lonely"):
        compare("nadir_spin", Lonely, Lonely, 5 * s)
