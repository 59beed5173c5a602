# SPDX-License-Identifier: Apache-2.0
"""What the CubeSat must do: `fledge verify cubesat`. The truth judges."""
from fledge import SetupError
from fledge.requirements import always, angle, begins, eventually, implies, settles, turned, until, within
from fledge.units import deg, hour, m, minute, s

from .vehicle import CAMERA, PANELS, SPEED

POINTS = ["imaging", "blinded", "without_gps"]
ALL = ["release", *POINTS, "crippled"]
GOOD = "GOOD"


def release(r):
    """After the release."""
    r.every = 2 * s
    mode    = r.mode()
    rate    = r.signal("world.craft.state.omega_BN_B").norm()
    r.require("REL-1", "The CubeSat shall turn slower than 0.6 deg/s within three hours of its release, and stay so.",
              settles(rate < 0.6 * deg / s, within=3 * hour),
              rationale="The battery lasts for four hours of a tumble.", shown_by="release")
    r.require("REL-2", "The CubeSat shall point its panels at the Sun up to 8 degrees within five minutes of the mode "
              "sun, and until that ends.", _holds(mode == "sun", _off_sun(r) < 8 * deg, 5 * minute),
              rationale="The panels lose less than a hundredth there.", shown_by="release")
    r.require("REL-3", "The CubeSat shall have half of its battery's charge at all times.",
              always((1 / 65535 * r.signal("world.power.telemetry.battery")).named("the battery's charge") > 0.5),
              rationale="A battery that is discharged no deeper than this lasts the mission.", shown_by=ALL)


def knowledge(r):
    """What it knows."""
    r.every  = 2 * s
    true     = r.signal("world.craft.state.sigma_BN")
    place    = r.signal("world.craft.state.r_BN_N")
    vectors, orbit = "flight.vectors.attitude", "flight.orbit.orbit"
    good     = r.signal(f"{vectors}.head.quality") == GOOD
    wrong    = [angle(turned(r.signal(f"{vectors}.sigma_BN"), axis), turned(true, axis)).named(f"the error of {name}")
                for name, axis in (("the Sun's direction", r.signal("world.light.light.s_N")), ("nadir", place))]
    r.require("KNO-1", "The CubeSat shall know its attitude by Sun and field within ten minutes of its release, and "
              "from then on.", settles(good, within=10 * minute),
              rationale="Pointing waits for it; star trackers see nothing in a tumble.", shown_by=ALL)
    r.require("KNO-2", "The CubeSat shall see Sun and Earth within 3 degrees of where they are while it says that it "
              "knows its attitude by Sun and field.",
              always(implies(good, (wrong[0] < 3 * deg) & (wrong[1] < 3 * deg))),
              rationale="Three times the error of the Sun sensors.", shown_by=ALL)
    away = (r.signal(f"{orbit}.r_BN_N") - place).norm().named("the error of the position")
    r.require("KNO-3", "The CubeSat shall know its position up to 100 m while it says that it does.",
              always(implies(r.signal(f"{orbit}.head.quality") == GOOD, away < 100 * m)),
              rationale="From 500 km, 100 m are 0.01 degrees.", shown_by=ALL)
    dark, known = (r.signal(path) < 0.5 for path in ("world.light.light.visible", "flight.shadow.shadow.lit"))
    r.require("KNO-4", "The CubeSat shall know within 20 s whether it is in the shadow of the Earth.",
              always(implies(always(dark, 0 * s, 20 * s), within(20 * s, known))
                     & implies(always(~dark, 0 * s, 20 * s), within(20 * s, ~known))),
              rationale="The camera waits for light.", shown_by=ALL)


def pointing(r):
    """Pointing."""
    r.every = 2 * s
    mode    = r.mode()
    there   = r.signal("flight.slew.status.phase") == "TRACKING"
    stars   = _stars(r)
    true, place = (r.signal(f"world.craft.state.{name}") for name in ("sigma_BN", "r_BN_N"))
    to      = {"nadir": -1 * place, "contact": r.signal("world.station.state.r_PN_N") - place,
               "image": r.signal("flight.target.target.r_PN_N") - place}
    for number, (name, what) in enumerate((("nadir", "straight down"), ("contact", "at the station"),
                                           ("image", "at its target")), 1):
        off = angle(turned(true, to[name]), CAMERA).named(f"the camera's angle {what}")
        r.require(f"PNT-{number}", f"The CubeSat shall point its camera {what} up to 0.2 degrees in the mode {name}, "
                  "once a slew has ended, while star trackers see stars, and up to 2 degrees without these.",
                  always(implies((mode == name) & there, off < 2 * deg if stars is None else
                                 (off < 2 * deg) & ((off < 0.2 * deg) | ~stars))),
                  rationale="The camera's field of view is 1 degree wide; the antenna's beam 75 degrees.",
                  shown_by=POINTS)
    r.require("PNT-4", "The CubeSat shall keep its wheels slower than nine tenths of what they can.",
              always(r.signal("world.wheels.speeds.Omega").max_abs() < 0.9 * SPEED),
              rationale="A wheel at its limit gives no torque.", shown_by=ALL)
    r.require("PNT-5", "The CubeSat shall point its camera down up to 10 degrees with two wheels that have seized, "
              "within five hours, and stay so.",
              eventually(mode == "hover") & settles(angle(turned(true, to["nadir"]), CAMERA) < 10 * deg,
                                                    within=5 * hour),
              rationale="The antenna's beam sees the station then.", shown_by="crippled")


def _stars(r):
    """Whether star trackers see stars; None without any."""
    try:
        return r.signal("flight.stars.attitude.head.quality") == GOOD
    except SetupError:
        return None


def _off_sun(r):
    return angle(turned(r.signal("world.craft.state.sigma_BN"), r.signal("world.light.light.s_N")), PANELS).named(
        "the panels' angle to the Sun")


def _holds(while_, what, after):
    """So long after `while_` has begun, `what` holds, and does until `while_` or the run ends."""
    return always(implies(begins(while_), within(after, until(what, ~while_) | always(what))))
