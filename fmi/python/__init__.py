# SPDX-License-Identifier: Apache-2.0
"""FMUs that others made (FMI 2.0 and 3.0, co-simulation): the archive, unpacked with care, and its model description.

Example:

    from fledge.fmi import Archive

    def outputs(path):
        ball = Archive(path).description
        return [variable.name for variable in ball.variables.values() if variable.causality == "output"]
"""
from fledge.fmi.archive import Archive
from fledge.fmi.description import Description, Unit, Variable

__all__ = ["Archive", "Description", "Unit", "Variable"]
