# SPDX-License-Identifier: Apache-2.0
"""The keywords of the CCSDS navigation data messages: blocks, units, types, and what is required. The facts stand here
once; both readers and both writers follow them.

A field is KEYWORD[!][:type]: "!" where the message must have it; the type is a unit of the file, "time", "int", "date"
(kept as text) or, without, a text.

Source: CCSDS 502.0-B-3 (orbits), 504.0-B-2 and 504.0-B-1 (attitudes), 508.0-B-1 (conjunctions), 505.0-B-3 (XML); SANA's
registry of orbital elements.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Field(NamedTuple):
    """A keyword of a block."""
    name: str
    type: str           # a unit, "time", "int", "date" or "text"
    required: bool


def fields(text: str) -> dict[str, Field]:
    """Those of a text, by keyword."""
    found = {}
    for word in text.split():
        name, _, kind = word.partition(":")
        found[name.rstrip("!")] = Field(name.rstrip("!"), kind or "text", name.endswith("!"))
    return found


@dataclass(frozen=True)
class Block:
    """A block of a message. mark: of META_START and META_STOP in KVN, "" without marks, "?" before what may be absent.
    element: in XML. many: may stand several times. rows: has lines of a table; row: the element of a line in XML.
    versions: first digits of those of the message that have it."""
    name: str
    fields: dict[str, Field]
    mark: str = ""
    element: str = ""
    many: bool = False
    required: bool = False
    rows: bool = False
    row: str = ""
    versions: str = "123"
    either: tuple[str, ...] = ()        # of which there must be exactly one

    @property
    def marked(self) -> bool:
        """Whether it has marks in any KVN."""
        return bool(self.mark) and self.mark[0] != "?"


@dataclass(frozen=True)
class Form:
    """A kind of message: what stands once in front, and what stands in each segment, in this order."""
    name: str
    versions: tuple[str, ...]
    blocks: tuple[Block, ...]
    segments: bool = False      # may have several
    front: tuple[Block, ...] = ()
    some: tuple[str, ...] = ()  # blocks of which each segment has at least one

    def of(self, version: str) -> list[Block]:
        """The blocks of a version, HEADER first."""
        header = HEADER if version == self.versions[-1] else FIRST_HEADER
        return [header, *self.front, *(block for block in self.blocks if version[0] in block.versions)]


def _triangle(names: str, length: str, dot: str = "DOT") -> str:
    """The fields of the lower triangle of a covariance of positions and rates, "XDOT". length: the unit, "km"."""
    parts = names.split()
    return " ".join(f"C{a}_{b}!:{length}**2{('', '/s', '/s**2')[(a + b).count('DOT')]}".replace("DOT", dot)
                    for i, a in enumerate(parts) for b in parts[:i + 1])


# Of all versions but the last, and of that.
FIRST_HEADER = Block("HEADER", fields("CREATION_DATE!:date ORIGINATOR!"), "", "header")
HEADER = Block("HEADER", fields("CLASSIFICATION CREATION_DATE!:date ORIGINATOR! MESSAGE_FOR MESSAGE_ID"), "", "header")
USER = Block("USER", {}, "", "userDefinedParameters")
STATE = "EPOCH!:time X!:km Y!:km Z!:km X_DOT!:km/s Y_DOT!:km/s Z_DOT!:km/s"
COVARIANCE = "COV_REF_FRAME " + _triangle("X Y Z XDOT YDOT ZDOT", "km", "_DOT")
ELEMENTS = "ECCENTRICITY!:1 INCLINATION!:deg RA_OF_ASC_NODE!:deg ARG_OF_PERICENTER!:deg "
SPACECRAFT = Block("SPACECRAFT", fields("MASS:kg SOLAR_RAD_AREA:m**2 SOLAR_RAD_COEFF:1 DRAG_AREA:m**2 DRAG_COEFF:1"),
                   "", "spacecraftParameters")
META = "OBJECT_NAME! OBJECT_ID! CENTER_NAME! REF_FRAME! REF_FRAME_EPOCH:time TIME_SYSTEM! "
SPAN = "START_TIME!:time USEABLE_START_TIME:time USEABLE_STOP_TIME:time STOP_TIME!:time "

OPM = Form("OPM", ("1.0", "2.0", "3.0"), (
    Block("META", fields(META), "?META", "metadata", required=True),
    Block("STATE", fields(STATE), "", "stateVector", required=True),
    Block("KEPLERIAN", fields(f"SEMI_MAJOR_AXIS!:km {ELEMENTS} TRUE_ANOMALY:deg MEAN_ANOMALY:deg GM!:km**3/s**2"), "",
          "keplerianElements", either=("TRUE_ANOMALY", "MEAN_ANOMALY")),
    SPACECRAFT,
    Block("COVARIANCE", fields(COVARIANCE), "", "covarianceMatrix"),
    Block("MANEUVER", fields("MAN_EPOCH_IGNITION!:time MAN_DURATION:s MAN_DELTA_MASS:kg MAN_REF_FRAME MAN_DV_1:km/s "
                             "MAN_DV_2:km/s MAN_DV_3:km/s"), "", "maneuverParameters", many=True),
    USER))

OMM = Form("OMM", ("2.0", "3.0"), (
    Block("META", fields(META + "MEAN_ELEMENT_THEORY!"), "?META", "metadata", required=True),
    Block("ELEMENTS", fields(f"EPOCH!:time SEMI_MAJOR_AXIS:km MEAN_MOTION:rev/day {ELEMENTS} MEAN_ANOMALY!:deg "
                             "GM:km**3/s**2"), "", "meanElements", required=True,
          either=("SEMI_MAJOR_AXIS", "MEAN_MOTION")),
    SPACECRAFT,
    Block("TLE", fields("EPHEMERIS_TYPE:int CLASSIFICATION_TYPE NORAD_CAT_ID ELEMENT_SET_NO:int REV_AT_EPOCH:int "
                        "BSTAR:1/ER BTERM:m**2/kg MEAN_MOTION_DOT:rev/day**2 MEAN_MOTION_DDOT:rev/day**3 "
                        "AGOM:m**2/kg"), "", "tleParameters"),
    Block("COVARIANCE", fields(COVARIANCE), "", "covarianceMatrix"),
    USER))

OEM = Form("OEM", ("1.0", "2.0", "3.0"), (
    Block("META", fields(META.replace("REF_FRAME_EPOCH:time", "") + SPAN + "INTERPOLATION INTERPOLATION_DEGREE:int"),
          "META", "metadata", required=True, versions="1"),
    Block("META", fields(META + SPAN + "INTERPOLATION INTERPOLATION_DEGREE:int"), "META", "metadata", required=True,
          versions="23"),
    Block("STATE", fields(STATE + " X_DDOT:km/s**2 Y_DDOT:km/s**2 Z_DDOT:km/s**2"), "", "", required=True, rows=True,
          row="stateVector"),
    Block("COVARIANCE", fields("EPOCH!:time " + COVARIANCE), "COVARIANCE", "covarianceMatrix", many=True, rows=True,
          versions="23")),
    segments=True)

_AEM_META = ("OBJECT_NAME! OBJECT_ID! CENTER_NAME REF_FRAME_A! REF_FRAME_B! ATTITUDE_DIR TIME_SYSTEM! " + SPAN +
             "ATTITUDE_TYPE! QUATERNION_TYPE EULER_ROT_SEQ RATE_FRAME ANGVEL_FRAME INTERPOLATION_METHOD "
             "INTERPOLATION_DEGREE:int")

AEM = Form("AEM", ("1.0", "2.0"), (
    Block("META", fields(_AEM_META.replace("_DIR", "_DIR!")), "META", "metadata", required=True, versions="1"),
    Block("META", fields(_AEM_META), "META", "metadata", required=True, versions="2"),
    Block("DATA", {}, "DATA", "", required=True, rows=True, row="attitudeState")), segments=True)

_QUATERNION = "Q1!:1 Q2!:1 Q3!:1 QC!:1 Q1_DOT:1/s Q2_DOT:1/s Q3_DOT:1/s QC_DOT:1/s"
_SPIN = ("SPIN_ALPHA!:deg SPIN_DELTA!:deg SPIN_ANGLE!:deg SPIN_ANGLE_VEL!:deg/s NUTATION:deg NUTATION_PER:s "
         "NUTATION_PHASE:deg MOMENTUM_ALPHA:deg MOMENTUM_DELTA:deg NUTATION_VEL:deg/s")
_FRAMES = "REF_FRAME_A! REF_FRAME_B! "

APM = Form("APM", ("1.0", "2.0"), (
    Block("META", fields("OBJECT_NAME! OBJECT_ID! CENTER_NAME TIME_SYSTEM!"), "?META", "metadata", required=True),
    Block("TIME", fields("EPOCH!:time"), versions="2", required=True),
    Block("QUATERNION", fields("EPOCH!:time Q_FRAME_A! Q_FRAME_B! Q_DIR! " + _QUATERNION), "", "quaternionState",
          versions="1", required=True),
    Block("EULER", fields("EULER_FRAME_A! EULER_FRAME_B! EULER_DIR! EULER_ROT_SEQ! RATE_FRAME X_ANGLE:deg Y_ANGLE:deg "
                          "Z_ANGLE:deg X_RATE:deg/s Y_RATE:deg/s Z_RATE:deg/s"), "", "eulerElementsThree",
          versions="1"),
    Block("SPIN", fields("SPIN_FRAME_A! SPIN_FRAME_B! SPIN_DIR! " + _SPIN), "", "eulerElementsSpin", versions="1"),
    Block("SPACECRAFT", fields("INERTIA_REF_FRAME I11:kg*m**2 I22:kg*m**2 I33:kg*m**2 I12:kg*m**2 I13:kg*m**2 "
                               "I23:kg*m**2"), "", "spacecraftParameters", versions="1"),
    Block("MANEUVER", fields("MAN_EPOCH_START!:time MAN_DURATION!:s MAN_REF_FRAME! MAN_TOR_1!:N*m MAN_TOR_2!:N*m "
                             "MAN_TOR_3!:N*m"), "", "maneuverParameters", many=True, versions="1"),
    Block("QUATERNION", fields(_FRAMES + _QUATERNION), "QUAT", "quaternionState", many=True, versions="2"),
    Block("EULER", fields(_FRAMES + "EULER_ROT_SEQ! ANGLE_1!:deg ANGLE_2!:deg ANGLE_3!:deg ANGLE_1_DOT:deg/s "
                          "ANGLE_2_DOT:deg/s ANGLE_3_DOT:deg/s"), "EULER", "eulerAngleState", many=True, versions="2"),
    Block("RATE", fields(_FRAMES + "ANGVEL_FRAME! ANGVEL_X!:deg/s ANGVEL_Y!:deg/s ANGVEL_Z!:deg/s"), "ANGVEL",
          "angularVelocity", many=True, versions="2"),
    Block("SPIN", fields(_FRAMES + _SPIN), "SPIN", "spin", many=True, versions="2"),
    Block("INERTIA", fields("INERTIA_REF_FRAME! IXX!:kg*m**2 IYY!:kg*m**2 IZZ!:kg*m**2 IXY!:kg*m**2 IXZ!:kg*m**2 "
                            "IYZ!:kg*m**2"), "INERTIA", "inertia", versions="2"),
    Block("MANEUVER", fields("MAN_EPOCH_START!:time MAN_DURATION!:s MAN_REF_FRAME! MAN_TOR_X!:N*m MAN_TOR_Y!:N*m "
                             "MAN_TOR_Z!:N*m MAN_DELTA_MASS:kg"), "MAN", "maneuverParameters", many=True,
          versions="2")), some=("QUATERNION", "EULER", "RATE", "SPIN", "INERTIA"))

# The lines of an AEM, after their epoch, by ATTITUDE_TYPE: those of version 1, then those of version 2.
_Q, _ANGLES = "Q1:1 Q2:1 Q3:1 QC:1", "ANGLE_1:deg ANGLE_2:deg ANGLE_3:deg"
_ANGLE_RATES = " ANGLE_1_DOT:deg/s ANGLE_2_DOT:deg/s ANGLE_3_DOT:deg/s"
_ANGVEL = " ANGVEL_X:deg/s ANGVEL_Y:deg/s ANGVEL_Z:deg/s"
_SPINNING, _NUTATION = ("SPIN_ALPHA:deg SPIN_DELTA:deg SPIN_ANGLE:deg SPIN_ANGLE_VEL:deg/s",
                        " NUTATION:deg NUTATION_PER:s NUTATION_PHASE:deg")
_ANY = {"QUATERNION": _Q, "QUATERNION/DERIVATIVE": _Q + " Q1_DOT:1/s Q2_DOT:1/s Q3_DOT:1/s QC_DOT:1/s",
        "EULER_ANGLE": _ANGLES, "SPIN": _SPINNING, "SPIN/NUTATION": _SPINNING + _NUTATION}
ATTITUDES = {
    "1": {**_ANY, "QUATERNION/RATE": _Q + _ANGLE_RATES, "EULER_ANGLE/RATE": _ANGLES + _ANGLE_RATES},
    "2": {**_ANY, "QUATERNION/ANGVEL": _Q + _ANGVEL, "EULER_ANGLE/DERIVATIVE": _ANGLES + _ANGLE_RATES,
          "EULER_ANGLE/ANGVEL": _ANGLES + _ANGVEL,
          "SPIN/NUTATION_MOM": _SPINNING + " MOMENTUM_ALPHA:deg MOMENTUM_DELTA:deg NUTATION_VEL:deg/s"}}
ATTITUDE_ELEMENTS = {
    "QUATERNION": "quaternionEphemeris", "QUATERNION/DERIVATIVE": "quaternionDerivative", "EULER_ANGLE": "eulerAngle",
    "QUATERNION/RATE": "quaternionEulerRate", "QUATERNION/ANGVEL": "quaternionAngVel",
    "EULER_ANGLE/RATE": "eulerAngleRate", "EULER_ANGLE/DERIVATIVE": "eulerAngleDerivative",
    "EULER_ANGLE/ANGVEL": "eulerAngleAngVel", "SPIN": "spin", "SPIN/NUTATION": "spinNutation",
    "SPIN/NUTATION_MOM": "spinNutationMom"}
# Elements of XML around fields.
AROUND = {**dict.fromkeys([f"RELATIVE_{name}_{axis}" for name in ("POSITION", "VELOCITY") for axis in "RTN"],
                          "relativeStateVector"),
          **dict.fromkeys(("X_ANGLE", "Y_ANGLE", "Z_ANGLE"), "rotationAngles"),
          **dict.fromkeys(("X_RATE", "Y_RATE", "Z_RATE"), "rotationRates"),
          **dict.fromkeys(("Q1", "Q2", "Q3", "QC"), "quaternion"),
          **dict.fromkeys(("Q1_DOT", "Q2_DOT", "Q3_DOT", "QC_DOT"), "quaternionDot")}
AROUND_ROW = {**AROUND, **dict.fromkeys(("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z"), "angVel")}

OCM = Form("OCM", ("3.0",), (
    Block("META", fields("""OBJECT_NAME INTERNATIONAL_DESIGNATOR CATALOG_NAME OBJECT_DESIGNATOR ALTERNATE_NAMES
        ORIGINATOR_POC ORIGINATOR_POSITION ORIGINATOR_PHONE ORIGINATOR_EMAIL ORIGINATOR_ADDRESS TECH_ORG TECH_POC
        TECH_POSITION TECH_PHONE TECH_EMAIL TECH_ADDRESS PREVIOUS_MESSAGE_ID NEXT_MESSAGE_ID ADM_MSG_LINK CDM_MSG_LINK
        PRM_MSG_LINK RDM_MSG_LINK TDM_MSG_LINK OPERATOR OWNER COUNTRY CONSTELLATION OBJECT_TYPE TIME_SYSTEM!
        EPOCH_TZERO!:date OPS_STATUS ORBIT_CATEGORY OCM_DATA_ELEMENTS SCLK_OFFSET_AT_EPOCH:s SCLK_SEC_PER_SI_SEC:s
        PREVIOUS_MESSAGE_EPOCH:date NEXT_MESSAGE_EPOCH:date START_TIME:time STOP_TIME:time TIME_SPAN:d
        TAIMUTC_AT_TZERO:s NEXT_LEAP_EPOCH:date NEXT_LEAP_TAIMUTC:s UT1MUTC_AT_TZERO:s EOP_SOURCE INTERP_METHOD_EOP
        CELESTIAL_SOURCE"""), "META", "metadata", required=True),
    Block("TRAJ", fields("""TRAJ_ID TRAJ_PREV_ID TRAJ_NEXT_ID TRAJ_BASIS TRAJ_BASIS_ID INTERPOLATION
        INTERPOLATION_DEGREE:int PROPAGATOR CENTER_NAME TRAJ_REF_FRAME TRAJ_FRAME_EPOCH:time USEABLE_START_TIME:time
        USEABLE_STOP_TIME:time ORB_REVNUM:1 ORB_REVNUM_BASIS:int TRAJ_TYPE ORB_AVERAGING TRAJ_UNITS"""), "TRAJ", "traj",
          many=True, rows=True, row="trajLine"),
    Block("PHYS", fields("""MANUFACTURER BUS_MODEL DOCKED_WITH DRAG_CONST_AREA:m**2 DRAG_COEFF_NOM:1 DRAG_UNCERTAINTY:%
        INITIAL_WET_MASS:kg WET_MASS:kg DRY_MASS:kg OEB_PARENT_FRAME OEB_PARENT_FRAME_EPOCH:time OEB_Q1:1 OEB_Q2:1
        OEB_Q3:1 OEB_QC:1 OEB_MAX:m OEB_INT:m OEB_MIN:m AREA_ALONG_OEB_MAX:m**2 AREA_ALONG_OEB_INT:m**2
        AREA_ALONG_OEB_MIN:m**2 AREA_MIN_FOR_PC:m**2 AREA_MAX_FOR_PC:m**2 AREA_TYP_FOR_PC:m**2 RCS:m**2 RCS_MIN:m**2
        RCS_MAX:m**2 SRP_CONST_AREA:m**2 SOLAR_RAD_COEFF:1 SOLAR_RAD_UNCERTAINTY:% VM_ABSOLUTE:1 VM_APPARENT_MIN:1
        VM_APPARENT:1 VM_APPARENT_MAX:1 REFLECTANCE:1 ATT_CONTROL_MODE ATT_ACTUATOR_TYPE ATT_KNOWLEDGE:deg
        ATT_CONTROL:deg ATT_POINTING:deg AVG_MANEUVER_FREQ:#/yr MAX_THRUST:N DV_BOL:km/s DV_REMAINING:km/s
        IXX:kg*m**2 IYY:kg*m**2 IZZ:kg*m**2 IXY:kg*m**2 IXZ:kg*m**2 IYZ:kg*m**2"""), "PHYS", "phys"),
    Block("COV", fields("""COV_ID COV_PREV_ID COV_NEXT_ID COV_BASIS COV_BASIS_ID COV_REF_FRAME COV_FRAME_EPOCH:time
        COV_SCALE_MIN:1 COV_SCALE_MAX:1 COV_CONFIDENCE:% COV_TYPE COV_ORDERING COV_UNITS"""), "COV", "cov", many=True,
          rows=True, row="covLine"),
    Block("MAN", fields("""MAN_ID! MAN_PREV_ID MAN_NEXT_ID MAN_BASIS MAN_BASIS_ID MAN_DEVICE_ID! MAN_PREV_EPOCH:time
        MAN_NEXT_EPOCH:time MAN_PURPOSE MAN_PRED_SOURCE MAN_REF_FRAME MAN_FRAME_EPOCH:time GRAV_ASSIST_NAME DC_TYPE
        DC_WIN_OPEN:time DC_WIN_CLOSE:time DC_MIN_CYCLES:int DC_MAX_CYCLES:int DC_EXEC_START:time DC_EXEC_STOP:time
        DC_REF_TIME:time DC_TIME_PULSE_DURATION:s DC_TIME_PULSE_PERIOD:s DC_REF_DIR DC_BODY_FRAME DC_BODY_TRIGGER
        DC_PA_START_ANGLE:deg DC_PA_STOP_ANGLE:deg MAN_COMPOSITION! MAN_UNITS"""), "MAN", "man", many=True, rows=True,
          row="manLine"),
    Block("PERT", fields("""ATMOSPHERIC_MODEL GRAVITY_MODEL EQUATORIAL_RADIUS:km GM:km**3/s**2 N_BODY_PERTURBATIONS
        CENTRAL_BODY_ROTATION:deg/s OBLATE_FLATTENING:1 OCEAN_TIDES_MODEL SOLID_TIDES_MODEL REDUCTION_THEORY
        ALBEDO_MODEL ALBEDO_GRID_SIZE:int SHADOW_MODEL SHADOW_BODIES SRP_MODEL SW_DATA_SOURCE SW_DATA_EPOCH:date
        SW_INTERP_METHOD FIXED_GEOMAG_KP:nT FIXED_GEOMAG_AP:nT FIXED_GEOMAG_DST:nT FIXED_F10P7:SFU
        FIXED_F10P7_MEAN:SFU FIXED_M10P7:SFU FIXED_M10P7_MEAN:SFU FIXED_S10P7:SFU FIXED_S10P7_MEAN:SFU
        FIXED_Y10P7:SFU FIXED_Y10P7_MEAN:SFU"""), "PERT", "pert"),
    Block("OD", fields("""OD_ID! OD_PREV_ID OD_METHOD! OD_EPOCH!:time DAYS_SINCE_FIRST_OBS:d DAYS_SINCE_LAST_OBS:d
        RECOMMENDED_OD_SPAN:d ACTUAL_OD_SPAN:d OBS_AVAILABLE:int OBS_USED:int TRACKS_AVAILABLE:int TRACKS_USED:int
        MAXIMUM_OBS_GAP:d OD_EPOCH_EIGMAJ:m OD_EPOCH_EIGINT:m OD_EPOCH_EIGMIN:m OD_MAX_PRED_EIGMAJ:m
        OD_MIN_PRED_EIGMIN:m OD_CONFIDENCE:% GDOP:1 SOLVE_N:int SOLVE_STATES CONSIDER_N:int CONSIDER_PARAMS SEDR:W/kg
        SENSORS_N:int SENSORS WEIGHTED_RMS:1 DATA_TYPES"""), "OD", "od"),
    Block("USER", {}, "USER", "user")))

# The units of the elements of a line of TRAJ and COV, by TRAJ_TYPE and COV_TYPE; "1" has none.
_SPHERE, _KEPLER = "deg deg deg deg km km/s", "km 1 deg deg deg deg"
ORBITS = {name: text.split() for name, text in {
    "CARTP": "km km km", "CARTPV": "km km km km/s km/s km/s",
    "CARTPVA": "km km km km/s km/s km/s km/s**2 km/s**2 km/s**2", "ADBARV": _SPHERE, "LDBARV": _SPHERE,
    "GEODETIC": _SPHERE, "KEPLERIAN": _KEPLER, "KEPLERIANMEAN": _KEPLER, "EQUINOCTIAL": "km 1 1 deg 1 1 1",
    "EQUINOCTIALMOD": "km 1 1 deg 1 1 1", "ONSTATION": "km 1 1 1 1 deg",
    "DELAUNAY": "km**2/s km**2/s km**2/s deg deg deg",
    "DELAUNAYMOD": "km**0.5 km**0.5 km**0.5 deg deg deg", "EIGVAL3EIGVEC3": "km km km 1 1 1 1 1 1 1 1 1",
    "POINCARE": "deg km/s**0.5 km/s**0.5 km**2/s km/s**0.5 km/s**0.5"}.items()}
DEFAULTS = {"TRAJ_TYPE": "CARTPV", "COV_TYPE": "CARTPV", "COV_ORDERING": "LTM", "COV_REF_FRAME": "TNW_INERTIAL"}
MANEUVERS = {name: kind.type for name, kind in fields("""TIME_ABSOLUTE:time TIME_RELATIVE:time MAN_DURA:s DELTA_MASS:kg
    ACC_X:km/s**2 ACC_Y:km/s**2 ACC_Z:km/s**2 ACC_INTERP ACC_MAG_SIGMA:% ACC_DIR_SIGMA:deg DV_X:km/s DV_Y:km/s DV_Z:km/s
    DV_MAG_SIGMA:% DV_DIR_SIGMA:deg THR_X:N THR_Y:N THR_Z:N THR_EFFIC:1 THR_INTERP THR_ISP:s THR_MAG_SIGMA:%
    THR_DIR_SIGMA:deg DEPLOY_ID DEPLOY_DV_X:km/s DEPLOY_DV_Y:km/s DEPLOY_DV_Z:km/s DEPLOY_MASS:kg DEPLOY_DV_SIGMA:%
    DEPLOY_DIR_SIGMA:deg DEPLOY_DV_RATIO:1 DEPLOY_DV_CDA:m**2""").items()}

# The components of a conjunction's covariance: the last three may be absent, each with its whole row.
_RTN = _triangle("R T N RDOT TDOT NDOT", "m")
OPTIONAL_ROWS = ("CDRG", "CSRP", "CTHR")
_BALLISTIC = """ CDRG_R!:m**3/kg CDRG_T!:m**3/kg CDRG_N!:m**3/kg CDRG_RDOT!:m**3/(kg*s) CDRG_TDOT!:m**3/(kg*s)
    CDRG_NDOT!:m**3/(kg*s) CDRG_DRG!:m**4/kg**2 CSRP_R!:m**3/kg CSRP_T!:m**3/kg CSRP_N!:m**3/kg CSRP_RDOT!:m**3/(kg*s)
    CSRP_TDOT!:m**3/(kg*s) CSRP_NDOT!:m**3/(kg*s) CSRP_DRG!:m**4/kg**2 CSRP_SRP!:m**4/kg**2 CTHR_R!:m**2/s**2
    CTHR_T!:m**2/s**2 CTHR_N!:m**2/s**2 CTHR_RDOT!:m**2/s**3 CTHR_TDOT!:m**2/s**3 CTHR_NDOT!:m**2/s**3
    CTHR_DRG!:m**3/(kg*s**2) CTHR_SRP!:m**3/(kg*s**2) CTHR_THR!:m**2/s**4"""
# All entries, row by row.
TRIANGLE = [name for name in fields(COVARIANCE + " " + _RTN + _BALLISTIC) if name != "COV_REF_FRAME"]

CDM = Form("CDM", ("1.0",), (
    Block("META", fields("""OBJECT! OBJECT_DESIGNATOR! CATALOG_NAME! OBJECT_NAME! INTERNATIONAL_DESIGNATOR! OBJECT_TYPE
        OPERATOR_CONTACT_POSITION OPERATOR_ORGANIZATION OPERATOR_PHONE OPERATOR_EMAIL EPHEMERIS_NAME! COVARIANCE_METHOD!
        MANEUVERABLE! ORBIT_CENTER REF_FRAME! GRAVITY_MODEL ATMOSPHERIC_MODEL N_BODY_PERTURBATIONS SOLAR_RAD_PRESSURE
        EARTH_TIDES INTRACK_THRUST"""), "", "metadata", required=True),
    Block("OD", fields("""TIME_LASTOB_START:time TIME_LASTOB_END:time RECOMMENDED_OD_SPAN:d ACTUAL_OD_SPAN:d
        OBS_AVAILABLE:int OBS_USED:int TRACKS_AVAILABLE:int TRACKS_USED:int RESIDUALS_ACCEPTED:% WEIGHTED_RMS:1"""), "",
          "odParameters"),
    Block("ADDITIONAL", fields("""AREA_PC:m**2 AREA_DRG:m**2 AREA_SRP:m**2 MASS:kg CD_AREA_OVER_MASS:m**2/kg
        CR_AREA_OVER_MASS:m**2/kg THRUST_ACCELERATION:m/s**2 SEDR:W/kg"""), "", "additionalParameters"),
    Block("STATE", fields(STATE.removeprefix("EPOCH!:time ")), "", "stateVector", required=True),
    Block("COVARIANCE", fields(_RTN + _BALLISTIC), "", "covarianceMatrix", required=True),
    Block("USER", {}, "", "userDefinedParameters")), segments=True, front=(
    Block("RELATIVE", fields("""TCA!:time MISS_DISTANCE!:m RELATIVE_SPEED:m/s RELATIVE_POSITION_R:m
        RELATIVE_POSITION_T:m RELATIVE_POSITION_N:m RELATIVE_VELOCITY_R:m/s RELATIVE_VELOCITY_T:m/s
        RELATIVE_VELOCITY_N:m/s START_SCREEN_PERIOD:time STOP_SCREEN_PERIOD:time SCREEN_VOLUME_FRAME
        SCREEN_VOLUME_SHAPE SCREEN_VOLUME_X:m SCREEN_VOLUME_Y:m SCREEN_VOLUME_Z:m SCREEN_ENTRY_TIME:time
        SCREEN_EXIT_TIME:time COLLISION_PROBABILITY:1 COLLISION_PROBABILITY_METHOD"""), "",
          "relativeMetadataData", required=True),))

# The values that some keywords may have, and keywords that need another beside them.
_DIRECTIONS = ("A2B", "B2A")
CHOICES = {"ATTITUDE_DIR": _DIRECTIONS, "Q_DIR": _DIRECTIONS, "EULER_DIR": _DIRECTIONS, "SPIN_DIR": _DIRECTIONS,
           "QUATERNION_TYPE": ("FIRST", "LAST"), "OBJECT": ("OBJECT1", "OBJECT2")}
# Masses, principal moments of inertia, areas and other sizes.
NOT_NEGATIVE = frozenset("""MASS INITIAL_WET_MASS WET_MASS DRY_MASS I11 I22 I33 IXX IYY IZZ GM ECCENTRICITY MAN_DURATION
    SOLAR_RAD_AREA DRAG_AREA DRAG_CONST_AREA SRP_CONST_AREA AREA_PC AREA_DRG AREA_SRP AREA_ALONG_OEB_MAX
    AREA_ALONG_OEB_INT AREA_ALONG_OEB_MIN AREA_MIN_FOR_PC AREA_MAX_FOR_PC AREA_TYP_FOR_PC MISS_DISTANCE""".split())
# What theories of mean elements need, and of which an OMM has at most one.
_SGP4 = ("MEAN_MOTION", "NORAD_CAT_ID", "BSTAR")
THEORIES = {"SGP": (*_SGP4[:2], "MEAN_MOTION_DOT", "MEAN_MOTION_DDOT"), "SGP4": _SGP4, "SGP/SGP4": _SGP4,
            "PPT3": ("MEAN_MOTION_DOT", "MEAN_MOTION_DDOT"), "SGP4-XP": ("BTERM", "AGOM")}
RIVALS = (("BSTAR", "BTERM"), ("MEAN_MOTION_DDOT", "AGOM"))
PAIRS = {"INTERPOLATION": "INTERPOLATION_DEGREE", "INTERPOLATION_METHOD": "INTERPOLATION_DEGREE",
         "ORB_REVNUM": "ORB_REVNUM_BASIS"}

OTHERS = {"ACM": "a comprehensive attitude", "RDM": "a re-entry", "TDM": "tracking data"}      # which are not read
FORMS = {form.name: form for form in (OPM, OMM, OEM, OCM, AEM, APM, CDM)}
