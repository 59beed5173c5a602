# SPDX-License-Identifier: Apache-2.0
"""The radio of a spacecraft at Mars, a node in Python: it sends to Earth while the antenna, b1, points there, Mars does
not hide Earth, and the battery is full enough."""
from math import sqrt

AU = 149597870700.0                 # [m]
MARS_RADIUS = 3396.2e3              # [m]
BEAM = 0.99996192306417131          # cosine of half the width, 0.5 deg
ENOUGH, TOO_LITTLE = 0.45, 0.40     # of the battery: to begin, and to end
RATE = 250e3                        # [bit/s] at 1 AU
WARM_UP = 120                       # steps
H = 0.5                             # [s]
OFF, WARMING, SENDING = range(3)
POWERS = [0.0, 60.0, 120.0]         # [W] in each mode

STATE = """
    int32 mode         # mode {OFF=0, WARMING=1, SENDING=2}
    int32 spare        # spare
    float64 P          # P [W] what it takes
    float64 off_earth  # off_earth [-] cosine of the angle from the antenna to Earth
    float64 rate       # rate [-] bits per second
    float64 sent       # sent [-] bits in all
"""


def along(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def axis_1(sigma):
    """b1 in components of N, from the attitude as MRP."""
    x, y, z = sigma
    s2 = along(sigma, sigma)
    d = (1.0 + s2) * (1.0 + s2)
    return [1.0 - 8.0 * (y * y + z * z) / d, (8.0 * x * y + 4.0 * z * (1.0 - s2)) / d,
            (8.0 * x * z - 4.0 * y * (1.0 - s2)) / d]


class Radio:
    """The model, for the node and for its test."""

    def __init__(self):
        self.mode, self.warm, self.sent = OFF, 0, 0.0

    def step(self, craft, earth, power):
        """The state at an instant, from the messages that the node sees at it."""
        r, to_earth = craft["r_BN_N"], [e - b for e, b in zip(earth["r_PN_N"], craft["r_BN_N"])]
        distance = sqrt(along(to_earth, to_earth))
        earth_N = [x / distance for x in to_earth]
        ahead = along(r, earth_N)
        seen = ahead >= 0.0 or along(r, r) - ahead * ahead >= MARS_RADIUS * MARS_RADIUS
        cosine = along(axis_1(craft["sigma_BN"]), earth_N)
        may_send = seen and cosine >= BEAM and power["fill"] >= (ENOUGH if self.mode == OFF else TOO_LITTLE)
        self.warm = min(self.warm + 1, WARM_UP) if may_send else 0
        self.mode = OFF if not may_send else WARMING if self.warm < WARM_UP else SENDING
        far = AU / distance
        rate = RATE * far * far if self.mode == SENDING else 0.0
        self.sent += H * rate
        return {"mode": self.mode, "P": POWERS[self.mode], "off_earth": cosine, "rate": rate, "sent": self.sent}


def main():
    from fledge_node import Node, ms

    model = Radio()
    node = Node(name="radio", every=500 * ms)
    node.reads("/world/craft/state")
    node.reads("/world/earth/state")
    node.reads("/power/state", "next_instant")
    node.writes("/radio/state", "RadioState", STATE)

    @node.step
    def step(t):
        node["/radio/state"] = model.step(node["/world/craft/state"], node["/world/earth/state"], node["/power/state"])

    node.run()
    print(f"sent {int(model.sent)} bits")


if __name__ == "__main__":
    main()
