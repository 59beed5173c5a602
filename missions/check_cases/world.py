# SPDX-License-Identifier: Apache-2.0
"""The truth of a check case: a rigid body about the Earth, and what the case adds."""
from pathlib import Path

from fledge import SetupError, world
from fledge.attitude import dcm_to_mrp, euler_to_dcm
from fledge.units import N, deg, kg, m, rad, s
from numpy import array, cross
from numpy.linalg import norm

from .cases import CASES, MU, SPIN, START, UT1_TAI

GGM05C = Path(__file__).with_name("ggm05c-8.shadr.csv")    # the field of the published ends, to degree 8


def build(w, name, field):
    """name: of the case; field: the path of the Earth's field (SHADR), for cases with one."""
    case = CASES.get(str(name))
    if case is None:
        raise SetupError(f"case: expected one of {', '.join(CASES)}; found {name!r}")
    earth = world.EARTH.with_mu(MU * m**3 / s**2)
    if case.degree:
        earth = earth.harmonics(field, degree=case.degree)

    # The cases come from a tool with the older theories, and without polar motion.
    sky = world.Sky(START, center=world.EARTH,
                    earth=world.EarthOrientation(theory="IAU 1976/1980", ut1_tai=UT1_TAI * s))
    mass, inertia = case.body
    r, v = case.start
    to_body, rate = rotation(array(r), array(v), *case.attitude)
    parts = []
    if case.air:
        if case.air == "MET":
            w.air = world.EarthAtmosphere(law="MET", F107=128.8, ap=15.7, sky=sky)
        else:
            w.air = world.Atmosphere(body=earth, law="CONSTANT", density=1.4e-12 * kg / m**3, spin=SPIN * rad / s)
        w.drag = world.Drag(air=w.air, Cd=0.02, area=1 * m**2)
        parts.append(w.drag)
    if case.gradient:
        w.gradient = world.GravityGradient()
        parts.append(w.gradient)
    if case.burn:
        w.thruster = world.Thrusters(axes_B=[[0, -1, 0]], F=29000 * N)
        parts.append(w.thruster)
        times = w.thruster.times
        times.on[0], times.off[0] = (1e9 * t for t in case.burn)
        times.head.quality = "GOOD"
    w.craft = world.Spacecraft(
        mass=mass * kg, I_B=inertia * kg * m**2, sky=sky, parts=parts,
        gravity=[earth, world.SUN, world.MOON] if case.others else [earth],
        r_BN_N=r * m, v_BN_N=v * m / s, sigma_BN=dcm_to_mrp(to_body), omega_BN_B=case.rate or rate)
    w.integrator = world.RK4()
    w.task("dynamics", every=s / 4, run=[w.craft])
    if case.air:
        w.connect(w.craft.state >> w.air.truth)
        w.task("air", every=s / 4, run=[w.air])


def rotation(r, v, angles, axes):
    """[BN] of a body that turns with LVLH, and its rate in body axes."""
    h = cross(r, v)
    down, side = -r / norm(r), -h / norm(h)
    to_lvlh = array([cross(side, down), side, down])
    to_body = euler_to_dcm(angles * deg, axes) @ to_lvlh
    return to_body, to_body @ (h / (r @ r))
