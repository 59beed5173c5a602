# SPDX-License-Identifier: Apache-2.0
"""An FMU that others made as a model of the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from fledge import _core
from fledge.disk import shown
from fledge.errors import SetupError


def Fmu(path: str | PathLike[str], parameters: Mapping[str, Any] | None = None, *,
        messages: Mapping[str, tuple[Any, Mapping[str, str]]] | None = None,
        locals: Sequence[str] | bool = (), **named: Any) -> _core.Model:
    """A model by an FMU for co-simulation of FMI 2.0 or 3.0: `w.ball = world.Fmu("ball.fmu", g=-1.62 * m / s**2)`.

    In a task, it steps from each update to the next. Its inputs and outputs are the fields of two messages, `inputs`
    and `outputs`, in SI; der(h) is there as der_h. Inputs that no wire or feed gives keep their starts. Parameters, and
    the starts of outputs that may be given, are parameters of the model.

    parameters, named: values, with units, by the names of the FMU or as attributes.
    messages: further ports, of types that others have: name -> (type, field -> variable), as in
    {"torque": (fsw.BodyTorque, {"torque_B[0]": "tau1"})}. Elements count from 0. Those of an FMU that Fledge made are
    there by themselves, world.nav.attitude as world_nav_attitude.
    locals: names of local variables that are outputs, too; True: all.

    Raises SetupError, with the file, for what is no such FMU, not safe to unpack, or does not fit.
    """
    # Here, because they would delay each mission by their imports.
    from fledge.fmi.archive import opened
    from fledge.fmi.interface import Interface

    for name, message in (messages or {}).items():
        if not isinstance(message, tuple) or len(message) != 2 or not isinstance(message[1], Mapping):
            raise SetupError(
                f"{shown(path)}: messages: expected {name!r}: (type, {{field: variable}}); found {message!r}")
    interface = Interface(opened(path), messages or {}, locals)
    model = interface.type()
    _core.set_fmu(model, interface.plan)
    attributes = {name: attribute for attribute, name in interface.names.items() if "." not in attribute}
    values = {attributes.get(name, name): value for name, value in (parameters or {}).items()}
    for name in values.keys() & named.keys():
        raise SetupError(f"{interface.archive.where}: {name} is given twice")
    for name, value in {**values, **named}.items():
        setattr(model, name, value)
    return model
