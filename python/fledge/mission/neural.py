# SPDX-License-Identifier: Apache-2.0
"""The layers of a network that was trained elsewhere, as parameters of the flight module NeuralFeedback, and back.

Example:

    import numpy as np
    from fledge import flight as fsw
    from fledge.mission import neural

    control = fsw.NeuralFeedback(sigma_unit=1, omega_unit=0.1, torque_max=1)
    layers = [(np.ones((8, 6)), np.zeros(8)), (np.ones((3, 8)), np.zeros(3))]      # (W, b) of each
    neural.give(control, layers)
    assert np.array_equal(neural.layers(control)[0][0], np.ones((8, 6)))

A file has a row for each number: its name, "W0[2, 5]", and its value.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from fledge.errors import SetupError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

INPUTS, OUTPUTS, HIDDEN, NEURONS = 6, 3, 2, 32      # of flight/control/neural_feedback.h

Layers: TypeAlias = "list[tuple[NDArray[Any], NDArray[Any]]]"


def checked(given: Iterable[tuple[ArrayLike, ArrayLike]]) -> Layers:
    """The layers (W, b) as arrays. W: (outputs, inputs), b: (outputs,). Raises SetupError that names the layer."""
    import numpy as np

    found: Layers = [(np.asarray(W, float), np.asarray(b, float)) for W, b in given]
    if not 1 <= len(found) <= HIDDEN + 1:
        raise SetupError(f"network: expected 1 to {HIDDEN + 1} layers, found {len(found)}")
    inputs = INPUTS
    for k, (W, b) in enumerate(found):
        last = k == len(found) - 1
        outputs = OUTPUTS if last else W.shape[0] if W.ndim == 2 else 0
        if W.shape != (outputs, inputs) or not 0 < outputs <= NEURONS:
            most = OUTPUTS if last else f"1 to {NEURONS}"
            raise SetupError(f"network: W{k}: expected the shape ({most}, {inputs}), found {W.shape}")
        if b.shape != (outputs,):
            raise SetupError(f"network: b{k}: expected the shape {(outputs,)}, found {b.shape}")
        if not (np.isfinite(W).all() and np.isfinite(b).all()):
            raise SetupError(f"network: layer {k} has a number that is not finite")
        inputs = outputs
    return found


def flat(given: Iterable[tuple[ArrayLike, ArrayLike]]) -> NDArray[Any]:
    """(n,) the weights in the order of the module's: of each layer W by rows, then b."""
    import numpy as np

    return np.concatenate([part.ravel() for layer in checked(given) for part in layer])


def unflat(numbers: ArrayLike, neurons: Sequence[int]) -> Layers:
    """The layers of n numbers. neurons: of each hidden layer."""
    import numpy as np

    rest, inputs, found = np.asarray(numbers, float), INPUTS, []
    sizes = [*neurons, OUTPUTS]
    expected = sum(n * (m + 1) for m, n in zip([INPUTS, *sizes], sizes))
    if rest.shape != (expected,):
        raise SetupError(f"network: expected {expected} numbers for layers of {sizes} neurons, found {rest.shape}")
    for outputs in sizes:
        W, b, rest = np.split(rest, [outputs * inputs, outputs * (inputs + 1)])
        found.append((W.reshape(outputs, inputs), b))
        inputs = outputs
    return checked(found)


def give(module: Any, given: Iterable[tuple[ArrayLike, ArrayLike]], activation: str | None = None) -> None:
    """Make these layers (W, b) the network of a NeuralFeedback.

    activation: of hidden layers, "TANH" or "RELU"; not given: the module keeps its own
    """
    import numpy as np

    found = checked(given)
    numbers, weights = flat(found), np.zeros(len(module.weights))
    weights[:len(numbers)] = numbers
    module.hidden = len(found) - 1
    if activation is not None:
        module.activation = activation
    if found[:-1]:
        module.neurons = [len(b) for _, b in found[:-1]]
    module.weights = weights


def layers(module: Any) -> Layers:
    """The layers (W, b) of a NeuralFeedback."""
    import numpy as np

    neurons = [int(n) for n in module.neurons]
    sizes = [*neurons, OUTPUTS]
    return unflat(np.array(module.weights)[:sum(n * (m + 1) for m, n in zip([INPUTS, *sizes], sizes))], neurons)


def write(path: str | os.PathLike[str], given: Iterable[tuple[ArrayLike, ArrayLike]], digits: int = 17) -> None:
    """Write layers (W, b) as a table: a row "name,value" for each number. digits: significant ones."""
    import numpy as np

    with open(path, "w", encoding="ascii") as file:
        file.write("# SPDX-License-Identifier: Apache-2.0\nname,value\n")
        for k, layer in enumerate(checked(given)):
            for letter, part in zip("Wb", layer):
                file.writelines(f'"{letter}{k}[{", ".join(map(str, at))}]",{x:.{digits}g}\n'
                                for at, x in np.ndenumerate(part))


def read(path: str | os.PathLike[str]) -> Layers:
    """The layers (W, b) of such a table. Raises SetupError with the row that is none, missing, or there twice."""
    import csv
    import re

    import numpy as np

    numbers: dict[str, dict[tuple[int, ...], float]] = {}
    with open(path, encoding="utf-8", newline="") as file:
        for line, row in enumerate(csv.reader(file), 1):
            if not row or row[0].startswith("#") or row == ["name", "value"]:
                continue
            name = re.fullmatch(r"([Wb]\d)\[(\d+(?:, ?\d+)?)\]", row[0])
            try:
                value = float(row[1])
            except (IndexError, ValueError):
                name = None
            at = tuple(map(int, name[2].split(","))) if name else ()
            if not name or len(at) != "bW".index(name[1][0]) + 1:
                raise SetupError(f'{path}, line {line}: expected a row as "W0[2, 5]",0.25; found {",".join(row):.60}')
            if at in numbers.setdefault(name[1], {}):
                raise SetupError(f"{path}, line {line}: {row[0]} is there twice")
            numbers[name[1]][at] = value
    parts = {}
    for name_, values in numbers.items():
        parts[name_] = np.full(np.max(list(values), axis=0) + 1, np.nan)
        for at, value in values.items():
            parts[name_][at] = value
        if np.isnan(parts[name_]).any():
            missing = [int(i) for i in np.argwhere(np.isnan(parts[name_]))[0]]
            raise SetupError(f"{path}: {name_}{missing} is missing, or no number")
    expected = [f"{letter}{k}" for k in range(max(1, len(parts) // 2)) for letter in "Wb"]
    if sorted(parts) != sorted(expected):
        raise SetupError(f"{path}: expected {', '.join(expected)}; found {', '.join(parts) or 'no numbers'}")
    return checked(zip(*[[parts[f"{letter}{k}"] for k in range(len(parts) // 2)] for letter in "Wb"]))
