# SPDX-License-Identifier: Apache-2.0
"""A small message of each kind, written by hand; and how they are damaged."""

import random

_HEADER = "CREATION_DATE = 2026-01-02T03:04:05\nORIGINATOR = TEAM\n"
_OBJECT = "OBJECT_NAME = CRAFT\nOBJECT_ID = 2026-001A\n"


def _triangle(names: list[str], given: dict[str, str]) -> str:
    """The lines of a covariance, 0 but for those given."""
    keys = [f"C{a}_{b}" for i, a in enumerate(names) for b in names[:i + 1]]
    return "".join(f"{key} = {given.get(key, '0')}\n" for key in keys)


_COVARIANCE = _triangle(["X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"], {
    "CX_X": "4e-6", "CY_Y": "4e-6", "CZ_Z": "4e-6", "CX_DOT_X": "1e-9", "CX_DOT_X_DOT": "1e-12",
    "CY_DOT_Y_DOT": "1e-12", "CZ_DOT_Z_DOT": "1e-12"})
OPM = f"""CCSDS_OPM_VERS = 3.0
COMMENT of the header
{_HEADER}{_OBJECT}CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = TT
COMMENT of the state
EPOCH = 2000-001T12:00:01.000000001
X = 6878.137 [km]
Y = -1.5E+1
Z = 0
X_DOT = 0
Y_DOT = 7.6125 [km/s]
Z_DOT = 1e-3 [km/s]
MASS = 100 [kg]
COV_REF_FRAME = RTN
{_COVARIANCE}MAN_EPOCH_IGNITION = 2000-01-02T00:00:00
MAN_DURATION = 10 [s]
MAN_DELTA_MASS = -1 [kg]
MAN_REF_FRAME = RTN
MAN_DV_1 = 0
MAN_DV_2 = 0.01
MAN_DV_3 = 0
MAN_EPOCH_IGNITION = 2000-01-03T00:00:00
MAN_DURATION = 0
MAN_DELTA_MASS = 0
MAN_REF_FRAME = RTN
MAN_DV_1 = 0
MAN_DV_2 = -0.01
MAN_DV_3 = 0
USER_DEFINED_MODEL = A = [b]
"""
OEM = f"""CCSDS_OEM_VERS = 2.0
{_HEADER}
META_START
{_OBJECT}CENTER_NAME = EARTH
REF_FRAME = EME2000
TIME_SYSTEM = UTC
START_TIME = 2016-12-31T23:59:59
STOP_TIME = 2017-01-01T00:00:01
INTERPOLATION = LAGRANGE
INTERPOLATION_DEGREE = 1
META_STOP
COMMENT over a leap second
2016-12-31T23:59:59 7000 0 0 0 7.5 0
2016-12-31T23:59:60 7000 7.5 0 0 7.5 0
2017-01-01T00:00:00 7000 15 0 0 7.5 0
2017-01-01T00:00:01 7000 22.5 0 0 7.5 0

COVARIANCE_START
EPOCH = 2016-12-31T23:59:60
1e-6
0 1e-6
0 0 1e-6
0 0 0 1e-12
0 0 0 0 1e-12
0 0 0 0 0 1e-12
EPOCH = 2017-01-01T00:00:01
COV_REF_FRAME = RTN
1e-6
2e-6 1e-6
0 0 1e-6
0 0 0 1e-12
0 0 0 0 1e-12
0 0 0 0 0 1e-12
COVARIANCE_STOP
"""
AEM = f"""CCSDS_AEM_VERS = 1.0
{_HEADER}META_START
{_OBJECT}REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
ATTITUDE_DIR = A2B
TIME_SYSTEM = TAI
START_TIME = 2026-01-01T00:00:00
STOP_TIME = 2026-01-01T00:00:10
ATTITUDE_TYPE = QUATERNION
QUATERNION_TYPE = FIRST
META_STOP
DATA_START
2026-01-01T00:00:00 1 0 0 0
2026-01-01T00:00:10 -0.7071067811865476 0 0 -0.7071067811865476
DATA_STOP
"""
OCM = f"""CCSDS_OCM_VERS = 3.0
{_HEADER}META_START
TIME_SYSTEM = UTC
EPOCH_TZERO = 2016-12-31T23:59:59
META_STOP
TRAJ_START
TRAJ_TYPE = KEPLERIAN
TRAJ_UNITS = [km, n/a, deg, deg, deg, deg]
0 7000 0.001 90 0 0 180
2.5 7000 0.001 90 0 0 181
TRAJ_STOP
COV_START
COV_TYPE = CARTP
COV_ORDERING = UTMWCC
0 1e-6 5e-7 0 0.5 1e-6 0 0 0 1e-6
COV_STOP
MAN_START
MAN_ID = 1
MAN_DEVICE_ID = THR
MAN_COMPOSITION = TIME_RELATIVE, MAN_DURA, DV_X, DEPLOY_ID
MAN_UNITS = [s, km/s, n/a]
1 10 0.001 BEE
MAN_STOP
"""
CDM_OBJECT = """OBJECT = OBJECT{0}
OBJECT_DESIGNATOR = 1000{0}
CATALOG_NAME = SATCAT
OBJECT_NAME = CRAFT {0}
INTERNATIONAL_DESIGNATOR = 2026-001A
EPHEMERIS_NAME = NONE
COVARIANCE_METHOD = CALCULATED
MANEUVERABLE = N/A
REF_FRAME = EME2000
TIME_LASTOB_START = 2026-01-01T00:00:00
ACTUAL_OD_SPAN = 2.5 [d]
RESIDUALS_ACCEPTED = 97.5 [%]
MASS = 250 [kg]
X = 7000 [km]
Y = {0} [km]
Z = 0 [km]
X_DOT = 0 [km/s]
Y_DOT = 7.5 [km/s]
Z_DOT = 0 [km/s]
""" + _triangle(["R", "T", "N", "RDOT", "TDOT", "NDOT"], {
    "CR_R": "100 [m**2]", "CT_T": "400", "CN_N": "25", "CRDOT_R": "0 [m**2/s]", "CRDOT_T": "-0.3",
    "CRDOT_RDOT": "4e-4 [m**2/s**2]", "CTDOT_R": "-0.08", "CTDOT_TDOT": "1e-4", "CNDOT_NDOT": "1e-4"})
CDM = f"""CCSDS_CDM_VERS = 1.0
{_HEADER}MESSAGE_FOR = CRAFT 1
MESSAGE_ID = 7
TCA = 2026-01-03T00:00:00.5
MISS_DISTANCE = 1000 [m]
COLLISION_PROBABILITY = 4.8e-5
""" + CDM_OBJECT.format(1) + CDM_OBJECT.format(2)
APM = f"""CCSDS_APM_VERS = 2.0
{_HEADER}META_START
{_OBJECT}TIME_SYSTEM = GPS
META_STOP
EPOCH = 2026-01-03T00:00:00
QUAT_START
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
Q1 = 0
Q2 = 0
Q3 = 0.6
QC = 0.8
QUAT_STOP
ANGVEL_START
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
ANGVEL_FRAME = SC_BODY_1
ANGVEL_X = 0
ANGVEL_Y = 0
ANGVEL_Z = 90 [deg/s]
ANGVEL_STOP
INERTIA_START
INERTIA_REF_FRAME = SC_BODY_1
IXX = 10 [kg*m**2]
IYY = 20
IZZ = 30
IXY = 0
IXZ = 0
IYZ = 0
INERTIA_STOP
"""
OMM = f"""CCSDS_OMM_VERS = 3.0
CREATION_DATE =
ORIGINATOR =
{_OBJECT}CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP4
EPOCH = 2026-01-01T00:00:00
MEAN_MOTION = 15 [rev/day]
ECCENTRICITY = 0.001
INCLINATION = 45 [deg]
RA_OF_ASC_NODE = 0
ARG_OF_PERICENTER = 0
MEAN_ANOMALY = 360
NORAD_CAT_ID = 99999
BSTAR = 1e-4 [1/ER]
"""


def replaced(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


def damaged(texts: list[str], count: int, seed: int) -> list[str]:
    """Texts, each of which has up to three characters that are others."""
    generator, found = random.Random(seed), []
    for _ in range(count):
        text = generator.choice(texts)
        for _ in range(generator.randint(1, 3)):
            at = generator.randrange(len(text))
            text = text[:at] + generator.choice("0123456789-+. \n\t\0ABCxyz<>[]{}/\",=é#") + text[at + 1:]
        found.append(text + "\n")
    return found
