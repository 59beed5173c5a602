# SPDX-License-Identifier: Apache-2.0
"""Power of a spacecraft at Mars, a node in Python: panels along b2, a battery, the bus and its radio.

It reads the positions of the spacecraft and the Sun, and the power of the radio; the radio reads how full the
battery is. The model uses only arithmetic and square roots, so that its bits are the same in any language.
"""
from math import sqrt

AU = 149597870700.0         # [m]
MARS_RADIUS = 3396.2e3      # [m]
PANELS = 2400.0             # [W] at 1 AU, face on
BUS = 200.0                 # [W] of all but the radio
BATTERY = 1.2e6             # [J] when full
H = 1.0                     # [s]

STATE = """
    float64 E        # E [J] energy in the battery
    float64 fill     # fill [-] share of what it holds when full
    float64 P_solar  # P_solar [W] from the panels
    float64 P_load   # P_load [W] to bus and radio
    int32 light      # light {SHADOW=0, SUNLIT=1}
    int32 spare      # spare
"""


def along(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def axis_2(sigma):
    """b2 in components of N, from the attitude as MRP."""
    x, y, z = sigma
    s2 = along(sigma, sigma)
    d = (1.0 + s2) * (1.0 + s2)
    return [(8.0 * x * y - 4.0 * z * (1.0 - s2)) / d, 1.0 - 8.0 * (x * x + z * z) / d,
            (8.0 * y * z + 4.0 * x * (1.0 - s2)) / d]


class Power:
    """The model, for the node and for its test."""

    def __init__(self):
        self.energy = 0.5 * BATTERY

    def step(self, craft, sun, radio):
        """The state at an instant, from the messages that the node sees at it."""
        r, to_sun = craft["r_BN_N"], [s - b for s, b in zip(sun["r_PN_N"], craft["r_BN_N"])]
        distance = sqrt(along(to_sun, to_sun))
        sun_N = [x / distance for x in to_sun]
        ahead = along(r, sun_N)
        aside = along(r, r) - ahead * ahead
        sunlit = ahead >= 0.0 or aside >= MARS_RADIUS * MARS_RADIUS
        far = AU / distance
        solar = PANELS * far * far * max(0.0, along(axis_2(craft["sigma_BN"]), sun_N)) if sunlit else 0.0
        load = BUS + radio["P"]
        self.energy = min(BATTERY, max(0.0, self.energy + H * (solar - load)))
        return {"E": self.energy, "fill": self.energy / BATTERY, "P_solar": solar, "P_load": load,
                "light": "SUNLIT" if sunlit else "SHADOW"}


def main():
    from fledge_node import Node, s

    model = Power()
    node = Node(name="power", every=1 * s)
    node.reads("/world/craft/state")
    node.reads("/world/sun/state")
    node.reads("/radio/state")
    node.writes("/power/state", "PowerState", STATE, initial={"E": model.energy, "fill": model.energy / BATTERY})

    @node.step
    def step(t):
        node["/power/state"] = model.step(node["/world/craft/state"], node["/world/sun/state"], node["/radio/state"])

    node.run()


if __name__ == "__main__":
    main()
