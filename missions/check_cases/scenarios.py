# SPDX-License-Identifier: Apache-2.0
"""Eight hours of a check case, and how far its end is from the published one."""
from fledge.attitude import dcm_to_prv, mrp_to_dcm
from fledge.units import minute, s
from numpy import array
from numpy.linalg import norm

from .cases import CASES, DURATION

LIMITS = {"attitude": 1e-9, "rate": 1e-12}    # [rad] [rad/s]


def compare(sim):
    """The spacecraft ends where the case says, within a millimetre, half a metre with MET's air, and a nanoradian."""
    case = CASES[str(sim.mission.parameters.get("case", "RUN_2"))]
    craft = sim.world.craft
    log = sim.record(craft.state, every=1 * minute)
    sim.run(until=DURATION * s)

    log.plot("state.r_BN_N", "state.v_BN_N", "state.omega_BN_B", name="check_case", title=case.what)
    found = differences(case, craft.state)
    print(case.what + ":", ", ".join(f"{what} {value:.2g}" for what, value in found.items()))
    limits = {"position": case.within, "velocity": 1e-3 * case.within, **LIMITS}
    for what, value in found.items():
        assert value < limits[what], f"{what} is {value:.3g} off"
    return found


def differences(case, state):
    """What the case says of its end, and how far the state is from it, in SI."""
    found = {"position": norm(state.r_BN_N - array(case.r)), "velocity": norm(state.v_BN_N - array(case.v))}
    if case.T is not None:
        found["attitude"] = norm(dcm_to_prv(mrp_to_dcm(state.sigma_BN) @ array(case.T).T))
        found["rate"] = norm(state.omega_BN_B - array(case.omega))
    return found
