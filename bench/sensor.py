# SPDX-License-Identifier: Apache-2.0
"""The sensor example of the thesis' listing 9, for CPython and MicroPython: what `init` makes is all that it needs;
`loop` takes nothing from the heap."""


class Sensor:
    def __init__(self, value, step):
        self.value = value
        self.step = step

    def sample(self):
        self.value = (self.value + self.step) % 50
        return self.value


class Indicator:
    def __init__(self):
        self.on = False

    def toggle(self):
        self.on = not self.on


sensors = indicators = None


def init():
    global sensors, indicators
    sensors = {"sensor_1": Sensor(3, 7), "sensor_2": Sensor(20, 11)}
    indicators = {"indicator_1": Indicator(), "indicator_2": Indicator()}


def loop():
    for _ in range(2000):
        number = sensors["sensor_1"].sample() + sensors["sensor_2"].sample()
        if number > 50:
            indicators["indicator_1"].toggle()
        else:
            indicators["indicator_2"].toggle()
