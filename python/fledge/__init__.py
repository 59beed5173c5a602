# SPDX-License-Identifier: Apache-2.0
"""Fledge: flight software in C, composed and flown in closed loop from Python.

Example:

    import fledge
    from fledge.units import N, m, minute

    sim = fledge.load("nadir_spin")
    sim.flight.control.K = 3 * N * m
    log = sim.record(sim.flight.tracking.error)
    sim.run(10 * minute)
    print(log.last("error.sigma_BR"))

Everything is imported when it is first used: numpy by the first array that is read, pandas and
matplotlib by the first frame or plot.
"""

import _imp
import os
import sys

__version__ = "1.0.0"

if sys.flags.optimize:      # then a scenario, a script or a test would pass whatever it asserts
    _why = ("Python leaves out asserts, and asserts judge scenarios: start Python without -O, and unset the variable "
            "PYTHONOPTIMIZE")
    raise SystemExit(f"fledge: {_why}") if sys.argv[0] == "-m" else ImportError(_why)

if os.path.isfile(os.path.join(os.path.dirname(os.path.abspath(__file__)), "ground")):
    raise ImportError("this clone has files in the place of symbolic links; on a file system that has links: "
                      "git config core.symlinks true; git ls-files -s | sed -n 's/^120000.*\\t//p' | "
                      "xargs git checkout --")

# Where Fledge is installed, its extensions lie beside it: for one Python.
_BESIDE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_made = [name for name in os.listdir(_BESIDE) if name.startswith("_core.") and name.endswith(".so")]
if _made and f"_core{_imp.extension_suffixes()[0]}" not in _made:
    raise ImportError(f"the Fledge in {_BESIDE} is for {_made[0][6:-3]}, this Python is "
                      f"{_imp.extension_suffixes()[0][1:-3]}: install a package that was made on such a system")

# Name -> where it is. A module of the package, or an attribute of one.
_LAZY = {
    "Archive": ("archive", "Archive"),
    "ArchiveError": ("archive", "ArchiveError"),
    "CompositionError": ("errors", "CompositionError"),
    "MissionError": ("mission", "MissionError"),
    "Orbit": ("world", "Orbit"),
    "Quantity": ("units", "Quantity"),
    "RunError": ("errors", "RunError"),
    "SetupError": ("errors", "SetupError"),
    "Simulation": ("mission.simulation", "Simulation"),
    "archive": ("archive", None),
    "attitude": ("attitude", None),
    "cosim": ("cosim", None),
    "emulator": ("emulator", None),
    "files": ("files", None),
    "flight": ("flight", None),
    "flight_math": ("flight_math", None),
    "ground": ("ground", None),
    "learning": ("mission.learning", None),
    "limit_updates": ("mission.simulation", "limit_updates"),
    "linear": ("mission.linear", None),
    "load": ("mission", "load"),
    "mean_elements": ("files.mean_elements", None),
    "missions": ("mission", "missions"),
    "montecarlo": ("montecarlo", None),
    "plot": ("plot", None),
    "prototype": ("prototype", None),
    "scan": ("plot.scan", None),
    "scene": ("scene", None),
    "sim": ("mission", None),
    "_core": ("_core", None),
    "_cosim": ("_cosim", None),
    "_emulator": ("_emulator", None),
    "_ground": ("_ground", None),
    "trajectory": ("plot.trajectory", None),
    "units": ("units", None),
    "view": ("scene", "view"),
    "world": ("world", None),
}
__all__ = sorted(n for n in _LAZY if not n.startswith("_"))

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:       # the same for editors
    import _core as _core
    import _cosim as _cosim
    import _emulator as _emulator
    import _ground as _ground
    from fledge import (archive, attitude, cosim, emulator, files, flight, flight_math, ground, mission as sim,
                        montecarlo, plot, prototype, scene, units, world)
    from fledge.archive import Archive, ArchiveError
    from fledge.errors import CompositionError, RunError, SetupError
    from fledge.files import mean_elements
    from fledge.mission import MissionError, learning, linear, load, missions
    from fledge.mission.simulation import Simulation, limit_updates
    from fledge.plot import scan, trajectory
    from fledge.scene import view
    from fledge.units import Quantity
    from fledge.world import Orbit


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        if any(os.path.exists(f"{_BESIDE}/fledge/{name}{end}") for end in ("", ".py")):
            raise AttributeError(name)      # then `from fledge import cli` imports the part
        from fledge.basilisk import WORDS
        from fledge.errors import instead

        # `from fledge import macros` replaces the text of an AttributeError.
        kind = ImportError if name in WORDS else AttributeError
        raise kind(f"fledge has no '{name}'{instead(name, __all__)} there are {', '.join(__all__)}")
    from importlib import import_module

    module, attribute = _LAZY[name]
    try:
        module_ = import_module(module if module.startswith("_") else f"fledge.{module}")
    except ModuleNotFoundError as error:
        if error.name not in ("_core", "_cosim", "_emulator", "_ground"):
            raise
        raise ImportError(f"the extension {error.name} is not built, or not on PYTHONPATH; ./fledge setup builds it"
                          ) from None
    if module.startswith("_"):
        place = os.path.dirname(os.path.abspath(str(module_.__file__)))
        if place != _BESIDE and os.path.exists(f"{place}/fledge/__init__.py"):
            raise ImportError(f"Fledge is that of {_BESIDE}, and its extension that of another one, {place}: start "
                              "Python by './fledge exec' of the one you mean, or mend PYTHONPATH")
    value = module_ if attribute is None else getattr(module_, attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_LAZY])
