# SPDX-License-Identifier: Apache-2.0
# The extension's types that users meet. Everything else in it is for the package alone, and untyped.
from typing import Any

class SetupError(ValueError): ...
class CompositionError(SetupError): ...
class RunError(RuntimeError): ...

class Message:
    """A message: an input, an output, or one by itself. `output >> input` makes a wire."""
    def __rshift__(self, other: Any) -> Any: ...
    def __rrshift__(self, other: Any) -> Any: ...

class Module:
    """A flight module."""
    def reset(self) -> None:
        """Forget what was learnt from earlier updates, as at the start of a run."""
    def update(self, t: float = ..., dt: float = ..., *, t_ns: int | None = ..., dt_ns: int | None = ...) -> None:
        """Run the algorithm once: read the inputs, write the outputs."""
    def publish(self, output: Message, /, quality: Any = ...) -> None:
        """In an update in Python: the output was written, for the time of this update."""
    def held(self, output: Message, /) -> None:
        """In an update in Python: the output could not be computed anew, and keeps its last content."""

class Model:
    """A model of the world. Some have properties besides their parameters, such as `parts` and `gravity`."""
    def __getattr__(self, name: str) -> Any: ...
    def __setattr__(self, name: str, value: Any) -> None: ...

def __getattr__(name: str) -> Any: ...
