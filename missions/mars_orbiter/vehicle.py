# SPDX-License-Identifier: Apache-2.0
"""The data sheets of the orbiter, which flight and the world both have.

Axes of B: the instrument and the antenna look along b1, the Sun is kept on the side of -b1, the solar arrays turn about
b2, and all thrusters push along b3.
"""
from math import cos, pi, sin, tan

from fledge import flight as fsw
from fledge.units import A, N, V, deg, kg, km, m, mA, minute, ms, ohm, rad, s

DRY, ATTITUDE_FUEL, MAIN_FUEL, SLOSH = 550 * kg, 60 * kg, 700 * kg, [20, 20] * kg
INERTIA = [700, 700, 800] * kg * m**2                      # as in the thesis, with half of the propellant

WHEELS     = dict(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)
MOTOR      = dict(bits=16, volts=28 * V, torque_constant=0.05 * N * m / A, resistance=2 * ohm, back_emf=0.05 * V * s)
TACHOMETER = dict(marks=1024, window=500 * ms)

# Two star trackers look to either side, square to the Sun and to the instrument. [SB] of each case is a turn about b1.
TRACKER    = dict(bits=31, residual=1e-6 * rad, tick=1 * ms)
TRACKERS   = [dict(sigma_SB=[tan(side * pi * 70 / 180 / 4), 0, 0]) for side in (1, -1)]
BORESIGHTS = [[0, -side * sin(pi * 70 / 180), cos(pi * 70 / 180)] for side in (1, -1)]
GYROS      = dict(bits=24, scale=1e-7 * rad, tick=1 * ms)

SUN_SENSORS = dict(axes_B=fsw.SUN_PYRAMIDS, current=[5] * 8 * mA)
CONVERTERS  = dict(scale=[2e-6, 2.5e-6] * A, offset=[0, -1e-5] * A)     # of pyramid A, about b3, and of B, about -b3

ARRAYS     = dict(step=1e-3 * rad, count=5e-4 * rad)
TURNED     = dict(axes_B=[[0, 1, 0]] * 2, normals_B=[[-1, 0, 0]] * 2)

# Attitude thrusters: two at each corner of the lower deck, canted so that they also turn the body about b3. All push
# along b3, so that while engines burn, they are shut for what the torque needs.
_CORNERS   = [(x, y, way) for x in (-1, 1) for y in (-1, 1) for way in (-1, 1)]
RCS        = dict(r_TB_B=[[0.9 * x, 0.9 * y, -1.2] for x, y, _ in _CORNERS] * m,
                  axes_B=[[-0.25 * y * way, 0.25 * x * way, 0.9354] for x, y, way in _CORNERS])
RCS_THRUST = 5 * N
ENGINES    = dict(r_TB_B=[[0.35 * cos(k * pi / 3), 0.35 * sin(k * pi / 3), -1.3] for k in range(6)] * m,
                  axes_B=[[0, 0, 1]] * 6)
ENGINE_THRUST, ISP = 120 * N, 230 * s

# Loads of the power unit: eight of each switch card.
LOADS = {"wheels": 0, "stars a": 1, "stars b": 2, "gyro a": 3, "gyro b": 4, "converters": 5,
         "accelerometer": 6,
         "propulsion a": 8, "propulsion b": 9, "arrays": 10,
         "recorder": 16, "radio": 17,
         "instrument": 24}

# The units that the fault protection holds: name, state at the start, kind, its load if it has one of its own.
UNITS = [("stars a", "PRIMARY", 0), ("stars b", "REDUNDANT", 0), ("gyro a", "PRIMARY", 1), ("gyro b", "REDUNDANT", 1),
         ("converter a", "PRIMARY", 2), ("converter b", "PRIMARY", 2)]
UNITS += [(f"wheel {k}", "PRIMARY", 3) for k in range(1, 5)]
UNITS += [(f"thruster {k}", "PRIMARY", 4) for k in range(1, 9)]
UNITS += [(f"engine {k}", "PRIMARY", 5) for k in range(1, 7)]
UNITS += [("propulsion a", "PRIMARY", 6), ("propulsion b", "PRIMARY", 7), ("array 1", "PRIMARY", 8),
          ("array 2", "PRIMARY", 8), ("recorder", "PRIMARY", 9)]
PLACE = {unit[0]: place for place, unit in enumerate(UNITS)}

# The science orbit, and the vehicle's time at its epoch, the run's begin.
SCIENCE = dict(a=20000 * km, e=0.6, i=30 * deg, Omega=130 * deg, omega=60 * deg, f=150 * deg)
EPOCH   = 660_000_000 * s

# Non-volatile memory: the computer's starts, the states of units, the burn, the stored commands that are over.
BOOTS_SLOT, UNITS_SLOT, BURN_SLOT, COMMANDS_SLOT = 0, 1, 2, 3
STORED     = dict(clocked=1, late=3 * minute, slot=COMMANDS_SLOT + 1)      # stored commands
BURN_ERROR = 4 * deg
