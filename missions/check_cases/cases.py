# SPDX-License-Identifier: Apache-2.0
"""The check cases as published: what flies, what acts on it, and how it stands after eight hours.

States are of the centre of mass, in J2000's axes about the Earth, in SI; `attitude` has the angles in degrees from LVLH
(axis 3 to nadir, axis 2 against the orbit's normal) to the body, with the axes about which it turns. Source: NASA,
JEOD, dynamics comparison set (docs/references.md).
"""
from dataclasses import dataclass

START = "2007-11-20T00:00:32 TAI"   # the cases count 32 s from UTC to TAI, where there were 33
UT1_TAI = -32.469                   # [s]
SPIN = 7.292115146706388e-5         # [rad/s] of the air, about axis 3 of N
MU = 3.986004415e14                 # [m^3/s^2]
DURATION = 28800                    # [s]

TYPICAL = [-4292653.41, 955168.47, 5139356.57], [109.649663, -7527.72649, 1484.521489]
ELLIPTIC = [-4315967.74, 960356.20, 5167269.53], [129.091037, -7491.513855, 1452.515654]

MET = 0.5    # [m] of 3 km that the air takes: here it turns about the pole of date, there about axis 3 of N

ISS = 400e3, [[1.02e8, -6.96e6, -5.48e6], [-6.96e6, 0.91e8, 5.90e5], [-5.48e6, 5.90e5, 1.64e8]]
CYLINDER = 1e3, [500.0, 12250.0, 12250.0]
SPHERE = 1.0, [0.4, 0.4, 0.4]


@dataclass
class Case:
    what: str
    r: list             # at the end [m]
    v: list             # [m/s]
    start: tuple = TYPICAL
    body: tuple = ISS
    degree: int = 0     # of the field; 0: a point mass
    others: bool = False    # Sun and Moon
    burn: tuple = ()    # from when to when the thruster is on [s]
    air: str = ""       # the law of the atmosphere
    gradient: bool = False  # the torque of gravity's gradient
    attitude: tuple = (-11.6, 0.0, 0.0), "213"
    rate: list | None = None    # at the start [rad/s]; None: that of LVLH
    T: list | None = None       # from N to the body, at the end
    omega: list | None = None   # [rad/s]
    within: float = 1e-3        # [m] of the position; [km/s] of the velocity


CASES = {
    "RUN_2": Case(
        "point mass, free rotation",
        [-1024262.411095882, -6151093.565368023, 2599975.06217899],
        [4736.659484718068, -3000.74587812336, -5251.712385533817],
        T=[[-0.1339788922977088, 0.04980207610342591, -0.9897319887901309],
           [-0.8654000972087016, -0.4924947721337001, 0.09236650460066564],
           [-0.4828377866010997, 0.8688893212813491, 0.109082625533986]],
        omega=[-0.0007963417068132182, -0.0007912816280812424, -0.0001860246400745597]),
    "RUN_3A": Case(
        "field of 4 x 4",
        [-1254745.169789463, -6089581.989971695, 2656347.933147136],
        [4624.218403911858, -3226.932484799621, -5216.021958054126], degree=4),
    "RUN_3B": Case(
        "field of 8 x 8",
        [-1255258.898965106, -6089431.814813276, 2656930.31767846],
        [4623.931132165054, -3227.66632063247, -5215.52402162707], degree=8),
    "RUN_4": Case(
        "Sun and Moon",
        [-1024255.954634924, -6151104.372408815, 2599951.9094198],
        [4736.657652762003, -3000.721494933466, -5251.727774086168], others=True),
    "RUN_6A": Case(
        "air of constant density, elliptic",
        [-1050804.04499561, -6116991.169519112, 2625679.545008392],
        [4747.834867748902, -3013.507407025143, -5262.878619425998], start=ELLIPTIC, body=SPHERE, air="CONSTANT"),
    "RUN_6B": Case(
        "air by MET, elliptic",
        [-1048196.405642499, -6118553.758058533, 2622766.894078463],
        [4748.579286441168, -3009.248418162813, -5264.719231865177], start=ELLIPTIC, body=SPHERE, air="MET",
        within=MET),
    "RUN_6C": Case(
        "a burn across the orbit, 93 s",
        [3766009.110556092, -5980521.854193008, -335362.4451965684],
        [5501.487294358964, 2875.542946668376, -4735.732522776072], body=CYLINDER, burn=(1000, 1093),
        attitude=((0.0, 0.0, 0.0), "213")),
    "RUN_7B": Case(
        "field of 8 x 8, Sun and Moon, elliptic",
        [-1279792.784675588, -6056088.385423499, 2681719.639229632],
        [4634.149010857281, -3237.890941350906, -5226.434165966192], start=ELLIPTIC, body=SPHERE, degree=8,
        others=True),
    "RUN_7C": Case(
        "field of 4 x 4, Sun and Moon, air by MET, elliptic",
        [-1276510.634876681, -6058053.56585724, 2677980.024411185],
        [4635.432463073936, -3232.579993186649, -5229.00237207733], start=ELLIPTIC, body=SPHERE, degree=4,
        others=True, air="MET", within=MET),
    "RUN_7D": Case(
        "field of 8 x 8, Sun and Moon, air by MET, elliptic",
        [-1277001.66542323, -6057919.01763647, 2678542.230031871],
        [4635.148743106563, -3233.274952226625, -5228.514839569732], start=ELLIPTIC, body=SPHERE, degree=8,
        others=True, air="MET", within=MET),
    "RUN_10A": Case(
        "torque of gravity's gradient",
        [-1024262.411095882, -6151093.565368023, 2599975.06217899],
        [4736.659484718068, -3000.74587812336, -5251.712385533817], body=CYLINDER, gradient=True,
        attitude=((0.0, 85.0, 1.0), "123"), rate=[-1.97989570839746e-05, -0.001134281491669957, 0.0],
        T=[[-0.1303977224153033, -0.9235551691194414, 0.3606137595567613],
           [-0.9835635249313684, 0.0746803593168579, -0.1643947576928366],
           [0.1248968631050554, -0.3761232424685627, -0.9181133263717784]],
        omega=[-1.97989570839746e-05, -0.001080027400090759, -0.0007098670173048437]),
}
