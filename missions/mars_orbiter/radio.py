# SPDX-License-Identifier: Apache-2.0
"""The radio in X band, and its station: Goldstone, with a dish of 70 m."""
from fledge import world
from fledge.units import K, MHz, deg, m, minute, ms, s

from .vehicle import LOADS

GOLDSTONE = dict(longitude=-116.89 * deg, latitude=35.43 * deg, altitude=1000 * m, mask=6 * deg)
LONGEST = 45 * minute       # there and back: 2.6 au each way


def build(w, f, sky):
    """A dish of 2 m along b1, 30 dB above a small antenna that looks everywhere: by that, commands reach the orbiter in
    any attitude, but its telemetry is heard only while b1 points at the Earth."""
    w.station = world.GroundStation(body=world.EARTH, sky=sky, **GOLDSTONE)
    w.radio = world.Radio(
        station=w.station, sky=sky, sun=world.SUN, shadows=[world.MARS], axis_B=[1, 0, 0], beam=1.2 * deg, floor_dB=30,
        down_frequency=8400 * MHz, down_eirp_dBW=60, down_g_t_dBK=60, down_rate=20e3 / s, down_code="BLOCK",
        down_required_dB=2.5, up_frequency=7200 * MHz, up_eirp_dBW=112, up_g_t_dBK=10, up_rate=1e3 / s,
        up_required_dB=9, station_beam=0.032 * deg, station_noise=25 * K, sun_brightness=23e3 * K, load=LOADS["radio"],
        down_room=1 << 22, up_room=1 << 20)     # ten minutes are on the way, and some wait
    w.connect(w.craft.state >> [w.station.truth, w.radio.truth], w.power.supply >> w.radio.power)
    w.task("radio", every=500 * ms, run=[w.station, w.radio])

    # Files wait for their answers as long as light takes.
    f.files.rate, f.files.ack_timer, f.files.nak_timer, f.files.inactivity = 1500 / s, LONGEST, LONGEST, 4 * LONGEST
