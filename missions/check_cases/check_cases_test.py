# SPDX-License-Identifier: Apache-2.0
"""Each check case ends where it says; and the cases themselves are what their source says of their start."""

import os
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge.attitude import mrp_to_dcm
from tests.needs import needs

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data"))

pytestmark = needs("casacore-data-jpl-de405")


def fly(case, **parameters):
    sim = fledge.load("check_cases", case=case, **parameters)
    sim.plots = False
    sim.scenarios["compare"]()
    return sim


@pytest.mark.parametrize("case", ["RUN_2", "RUN_3A", "RUN_3B", "RUN_4", "RUN_6A", "RUN_6B", "RUN_6C", "RUN_7B",
                                  "RUN_7C", "RUN_7D", "RUN_10A"])
def test_it_ends_where_the_case_says(case):
    fly(case)


@pytest.mark.parametrize("case", ["RUN_3A", "RUN_3B", "RUN_7B"])
def test_an_older_field_of_the_earth_ends_decimetres_off(case):
    field = DATA / "earth-ggm02c-20.shadr.csv"
    if not field.exists():
        pytest.skip(f"not here: {field}")
    with pytest.raises(AssertionError, match=r"position is 0\.[01]"):
        fly(case, field=str(field))


def test_the_iss_begins_as_the_case_says():
    craft = fledge.load("check_cases").world.craft
    begin = [[0.1412307175854335, -0.9892782736897275, 0.03718039289432368],
             [-0.772691975098125, -0.1336331223242703, -0.6205556383087864],
             [0.6188707425862547, 0.05891252687959725, -0.7832804849780175]]
    np.testing.assert_allclose(mrp_to_dcm(craft.sigma_BN), begin, atol=1e-14)
    np.testing.assert_allclose(craft.omega_BN_B, [0, -0.001134454274550824, 0], atol=1e-17)


def test_a_case_that_is_not_published_is_refused():
    with pytest.raises(fledge.SetupError, match="case: expected one of RUN_2, RUN_3A, .*; found 'RUN_99'"):
        fledge.load("check_cases", case="RUN_99")
