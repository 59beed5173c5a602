# SPDX-License-Identifier: Apache-2.0
"""The CubeSat's data sheets, which flight and world share: a 12U of 16 kg, 500 km up, whose orbit passes the equator
northwards at half past ten in the morning."""
from fledge import flight as fsw
from fledge.units import A, N, T, day, deg, hour, kg, km, m, mA, ms, rad, s

# Flight's time 0: 2026-03-20T10:00:00 UTC, since 2000-01-01T12:00:00.
EPOCH   = 827272800 * s

# Camera and antenna look along b3, the solar panels along -b3; b1 is the long axis.
MASS    = 16 * kg
INERTIA = [0.13, 0.21, 0.23] * kg * m**2
CAMERA  = [0, 0, 1]
PANELS  = [0, 0, -1]

# Wheels: one along each axis, and a fourth askew, which may be left out.
AXES    = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.577350269189626, 0.577350269189626, 0.577350269189626]]
WHEEL   = dict(J=5e-5 * kg * m**2, u_max=4e-3 * N * m)
SPEED   = 650 * rad / s
RODS    = dict(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], m_max=0.4 * A * m**2)

# Sensors.
SUN_SENSORS = dict(axes_B=fsw.SUN_PYRAMIDS, current=[5] * 8 * mA)
CONVERTERS  = dict(scale=[2e-6, 2.5e-6] * A, offset=[0, -1e-5] * A)
GYRO        = dict(noise=(0.15 * deg)**2 / hour, walk=(5 * deg / hour)**2 / hour, bias=20 * deg / hour)
FIELD       = dict(noise=2e-7 * T, bias=2e-6 * T)
TRACKER     = dict(bits=31, residual=1e-6 * rad, tick=1 * ms)
CASES       = [dict(sigma_SB=[-0.520567, 0, 0]), dict(sigma_SB=[0.520567, 0, 0])]   # of the two star trackers
BORESIGHTS  = [[0, 0.939693, -0.34202], [0, -0.939693, -0.34202]]                   # where these look

# The loads of the power unit.
LOADS   = {"computer": 0, "wheels": 1, "radio": 2, "gps": 3, "stars a": 8, "stars b": 9, "camera": 10}

# Mean elements, as the ground would send them.
ELEMENTS = dict(epoch=EPOCH, n=95.6301138 * rad / day, e=0.0012, i=97.4 * deg, node=337.5 * deg,
                periapsis=90 * deg, M=270 * deg, bstar=5e-5, age_max=7 * day)

# Places on the ground: a station on Svalbard, and Toulouse, the camera's target, with what they see of the sky.
EARTH   = dict(radius=6378.137 * km, flattening=1 / 298.257223563)
MU      = 3.986004418e14 * m**3 / s**2
ZONAL   = dict(mu=MU, radius=6378.137 * km, J2=1.08263e-3, J3=-2.532e-6, J4=-1.611e-6)
STATION = dict(longitude=15.39 * deg, latitude=78.23 * deg, altitude=450 * m, mask=8 * deg)
TARGET  = dict(longitude=1.44 * deg, latitude=43.6 * deg, altitude=150 * m, mask=30 * deg)
