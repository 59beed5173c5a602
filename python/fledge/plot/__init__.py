# SPDX-License-Identifier: Apache-2.0
"""Figures of matplotlib, and the wiring as a picture.

    fields.py      recorded fields against time, and what all figures share: style, units, files
    scan.py        the path of a boresight
    trajectory.py  an orbit with the axes of the body
    wiring.py      the instances of a simulation and their wires, laid out by graphviz

Example:

    from fledge import Archive
    from fledge.plot import plot, save

    figure = plot(Archive("run.mcap"), "error.sigma_BR", "error.omega_BR_B", units={"error.omega_BR_B": "deg/s"})
    save(figure, "figures")
"""

from fledge.plot.fields import (
    STYLE, TITLE, axis_label, component_labels, deliver, drawn, file_name, label_time, plot, save, silent, symbol,
    time_unit, unit_label, used)

__all__ = ["STYLE", "TITLE", "axis_label", "component_labels", "deliver", "drawn", "file_name", "label_time", "plot",
           "save", "silent", "symbol", "time_unit", "unit_label", "used"]
