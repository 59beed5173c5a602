# SPDX-License-Identifier: Apache-2.0
"""Where a spacecraft is and how it stands over time, by a run or by a file of others, in N of one sky: to write a run
in the forms of others, and to compare it with their files.

    run = motion.of_run(Archive("run.mcap"))
    motion.write(run, "oem", "craft.oem")
    motion.differences(run, motion.of_file("precise.oem", run.sky))
"""
from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fledge import files
from fledge.attitude import dcm_to_quaternion, mrp_to_quaternion, quaternion_product, quaternion_to_dcm
from fledge.errors import SetupError, listed
from fledge.files import spk
from fledge.files.ephemeris import AemSegment, OemSegment
from fledge.files.sections import Message, Section
from fledge.world import reference_frames
from fledge.world.bodies import BODIES
from fledge.world.file_motion import FileMotion, Motion, of_file
from fledge.world.sky import Sky

if TYPE_CHECKING:
    import os

    from fledge.archive import Archive

__all__ = ["FileMotion", "Motion", "differences", "of_file", "of_run", "write", "write_spk"]

UNITS = {"t": "s", "radial": "m", "along": "m", "cross": "m", "distance": "m", "velocity": "m/s", "attitude": "deg"}


def of_run(archive: Archive, craft: str = "", sky: Sky | None = None) -> Motion:
    """The motion of a spacecraft by a record.

    craft: the name of one of several, "craft" or "world.craft". sky: of a run whose spacecraft has none. Raises
    SetupError if there is no such spacecraft, or no sky.
    """
    ports = {c.name.rpartition(".")[0]: c for c in archive.topics.values() if c.type == "CraftState" and c.count}
    chosen = [path for path in ports if craft in ("", path, path.rpartition(".")[2])]
    if len(chosen) != 1:
        raise SetupError(f"{archive.path}: " + (
            f"expected the name of one spacecraft of {listed(list(ports))}; found {craft or 'none'}: name it, "
            "--craft NAME" if ports else
            "no CraftState is recorded, so there is no motion; let the scenario say sim.record(sim.world.craft.state, "
            "every=10 * s)"))
    path, state = chosen[0], ports[chosen[0]].name
    if sky is None:
        sky = Sky.of_text(str(archive.parameters.get(f"{path}.sky", "")))
        if not sky:
            raise SetupError(f"{archive.path}: {path} has no sky, so that its times have no date; give that of time 0 "
                             "and the center of N")
    return Motion(archive.metadata.get("run", {}).get("mission", path), sky, archive.time_ns(ports[path].topic),
                  archive[f"{state}.r_BN_N"], archive[f"{state}.v_BN_N"],
                  mrp_to_quaternion(archive[f"{state}.sigma_BN"]), archive[f"{state}.omega_BN_B"])


# --- differences -----------------------------------------------------------------------------------

def differences(run: Motion, other: FileMotion) -> dict[str, np.ndarray]:
    """How far a run is from a file, at the run's instants of which the file says something.

    "t" [s] (n,) of the run; "radial", "along", "cross" [m]: position, run less file, along the axes of the file's orbit
    about its center: outwards, along the way, normal to the plane; "distance" [m]; "velocity" [m/s], the size of the
    difference; "attitude" [deg], the angle between both. Those that only one has are left out. Raises SetupError if no
    instant is common.
    """
    begin, end = other.span
    inside = (run.times >= begin) & (run.times <= end)
    theirs = other.at(run.times[inside])
    table = {"t": run.times[inside] / 1e9}
    if run.r_N is not None and run.v_N is not None and theirs.r_N is not None and theirs.v_N is not None:
        r, v = theirs.r_N, theirs.v_N
        about = reference_frames.origins(run.sky, other.center, theirs.times)
        radial = _unit(r - about[:, 0])
        cross = _unit(np.cross(r - about[:, 0], v - about[:, 1]))
        d = run.r_N[inside] - r
        for name, axis in (("radial", radial), ("along", np.cross(cross, radial)), ("cross", cross)):
            table[name] = np.sum(d * axis, axis=1)
        table["distance"] = np.linalg.norm(d, axis=1)
        table["velocity"] = np.linalg.norm(run.v_N[inside] - v, axis=1)
    if run.beta_BN is not None and theirs.beta_BN is not None:
        turn = quaternion_product(run.beta_BN[inside], theirs.beta_BN * [1, -1, -1, -1])
        table["attitude"] = np.degrees(2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0])))
    if len(table) == 1:
        raise SetupError(f"{other.name}: has neither an orbit nor an attitude that the run has, too")
    known = np.isfinite(np.array([table[name] for name in table])).all(axis=0)
    if not known.any():
        text = [run.sky.utc(int(t) / 1e9) for t in (run.times[0], run.times[-1], begin, end)]
        raise SetupError(f"{other.name}: no instant is common: the run is from {text[0]} to {text[1]}, the file from "
                         f"{text[2]} to {text[3]}")
    return {name: values[known] for name, values in table.items()}


def _unit(x: np.ndarray) -> np.ndarray:
    return x / np.linalg.norm(x, axis=1, keepdims=True)


# --- a run as files --------------------------------------------------------------------------------

def oem_of(run: Motion, frame: str = "ICRF", center: int | None = None) -> Message:
    """The orbit of a run as an OEM. frame: of reference_frames; center: a NAIF number, else that of N."""
    if run.r_N is None or run.v_N is None:
        raise SetupError(f"{run.name}: has no positions")
    center = run.sky.center if center is None else center
    r, v = reference_frames.from_N(run.sky, frame, center, run.times, run.r_N, run.v_N)
    meta = _meta(run, CENTER_NAME=_center_name(center), REF_FRAME=frame, TIME_SYSTEM="UTC", INTERPOLATION="HERMITE",
                 INTERPOLATION_DEGREE=7)
    return _message("OEM", OemSegment.of(meta, run.epochs, r, v), "2.0")


def aem_of(run: Motion, frame: str = "ICRF", rates: bool = False) -> Message:
    """The attitude of a run as an AEM: quaternions of the body, SC_BODY_1, relative to a frame; with angular velocities
    where rates says so, and the run has them."""
    if run.beta_BN is None:
        raise SetupError(f"{run.name}: has no attitudes")
    dcm_FN, omega_FN_F = reference_frames.turning(run.sky, frame, run.times)
    beta_BF = quaternion_product(run.beta_BN, dcm_to_quaternion(dcm_FN) * [1, -1, -1, -1])
    meta = _meta(run, REF_FRAME_A=frame, REF_FRAME_B="SC_BODY_1", TIME_SYSTEM="UTC", INTERPOLATION_METHOD="LINEAR",
                 INTERPOLATION_DEGREE=1)
    if rates and run.omega_BN_B is not None:
        meta |= {"INTERPOLATION_METHOD": "HERMITE", "INTERPOLATION_DEGREE": 3}
        omega_FN_B = np.einsum("nij,nj->ni", quaternion_to_dcm(beta_BF), omega_FN_F)
        return _message("AEM", AemSegment.of(meta, run.epochs, beta_BF, run.omega_BN_B - omega_FN_B), "2.0")
    meta |= {"ATTITUDE_DIR": "A2B", "QUATERNION_TYPE": "LAST"}
    return _message("AEM", AemSegment.of(meta, run.epochs, beta_BF), "1.0")


def write_spk(run: Motion, path: str | os.PathLike[str], target: int, frame: str = "ICRF") -> Path:
    """Write the orbit of a run as a kernel of SPICE; returns the path, as write() does. target: the spacecraft's number
    there, < 0, of NAIF or any that is free; frame: one with the axes of N, which a kernel names J2000."""
    if run.r_N is None or run.v_N is None:
        raise SetupError(f"{run.name}: has no positions")
    if target >= 0:
        raise SetupError(f"{run.name}: expected a negative number, as spacecraft have in SPICE; found {target}")
    if not reference_frames.is_inertial(frame):
        raise SetupError(f"{run.name}: expected a frame of {', '.join(reference_frames.OF_N)}, which a kernel of SPICE "
                         f"names J2000; found {frame}: leave it out, or write an OEM")
    out = Path(path)
    out = out.with_suffix(".bsp") if out.suffix in ("", ".mcap") else out
    spk.write(out, target=target, center=run.sky.center, times=run.epochs, r=run.r_N, v=run.v_N, name=run.name[:40])
    return out


def _center_name(center: int) -> str:
    for name, body in BODIES.items():
        if body.naif == center:
            return name
    raise SetupError(f"expected a center of {listed(list(BODIES))}; found the NAIF number {center}")


def _meta(run: Motion, **values: Any) -> dict[str, Any]:
    return {"OBJECT_NAME": run.name.upper(), "OBJECT_ID": "UNKNOWN", **values}


def _message(kind: str, segment: OemSegment | AemSegment, version: str) -> Message:
    now = datetime.now(timezone.utc).isoformat(timespec="seconds").partition("+")[0]
    return Message(kind, version, [Section("HEADER", {"CREATION_DATE": now, "ORIGINATOR": "FLEDGE"})], [segment])


def write(run: Motion, form: str, path: str | os.PathLike[str], frame: str = "ICRF", xml: bool = False) -> Path:
    """Write the motion of a run: "oem" or "aem", or "e" or "a" of STK; returns the path. One without a suffix, or that
    is a record's, gets that of the form, as any path does for STK."""
    out, stk = Path(path), form in ("e", "a")
    out = out.with_suffix(f".{form}") if stk or out.suffix in ("", ".mcap") else out
    files.write(oem_of(run, frame) if form in ("oem", "e") else aem_of(run, frame, rates=stk), out,
                "stk" if stk else "xml" if xml else "kvn")
    return out
