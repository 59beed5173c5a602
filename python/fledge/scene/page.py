# SPDX-License-Identifier: Apache-2.0
"""A scene as a page: the viewer that was built from web/, and the data of the scene, in one HTML file.

The data are the bytes of pack(), deflated and in base64: the length of a JSON text (4 bytes), the text, zeros up to a
multiple of 8, and arrays, all little-endian. In the text an array is
{"at": byte from the first array, "n": rows, "k": columns, "as": "f8" or "f4"}. A track that grows has a number, "id";
"written" has the times when stale values were written, NaN for others.
"""

from __future__ import annotations

import json
import re
import struct
import zlib
from base64 import b64encode
from html import escape
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.disk import Part as PartFile
from fledge.scene import bundle
from fledge.scene.tracks import ATTITUDE, POSITION, SHARE

if TYPE_CHECKING:
    from os import PathLike

    from fledge.scene.scene import Craft, Part, Scene
    from fledge.scene.tracks import Motion, Signal, Turning


class _Arrays:
    """Collects arrays, each at a multiple of 8 bytes."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.growing: list[Any] = []    # the tracks that grow, by their numbers

    def add(self, values: Any, kind: str = "f8") -> dict[str, Any]:
        import numpy as np

        table = np.ascontiguousarray(values, dtype=f"<{kind}")
        at = len(self.bytes)
        self.bytes += table.tobytes() + bytes(-table.nbytes % 8)
        return {"at": at, "n": len(table), "k": prod(table.shape[1:]), "as": kind}

    def _track(self, track: Any, thin: Any, kind: str, *names: str) -> dict[str, Any]:
        columns: dict[str, Any] = {name: self.add(getattr(thin, name), kind) for name in names}
        if thin.written is not None:
            columns["written"] = self.add(thin.written)
        if track.source:
            columns["id"] = len(self.growing)
            self.growing.append(track)
        return {"time": self.add(thin.time), **columns}

    def motion(self, motion: Motion | None) -> dict[str, Any] | None:
        if motion is None:
            return None
        return self._track(motion, motion.thinned(), "f8", "r", "v")

    def turning(self, turning: Turning | None) -> dict[str, Any] | None:
        if turning is None:
            return None
        return self._track(turning, turning.thinned(), "f4", "q")

    def signal(self, signal: Signal | None) -> dict[str, Any] | None:
        if signal is None:
            return None
        return self._track(signal, signal.thinned(), "f4", "values")


def pack(scene: Scene) -> bytes:
    """The data of a scene, as the viewer reads them."""
    return pack_growing(scene)[0]


def pack_growing(scene: Scene) -> tuple[bytes, list[Any]]:
    """The data of a scene, and its tracks that grow; a track's index is its number in the data."""
    arrays = _Arrays()
    text = {
        "title": scene.title, "about": scene.about, "begin": scene.begin, "end": scene.end, "epoch": scene.epoch,
        "bounds": {"position": POSITION, "attitude": ATTITUDE, "share": SHARE}, "notes": scene.notes,
        "sun": arrays.motion(scene.sun), "sun_N": None if scene.sun_N is None else list(scene.sun_N),
        "planets": [{"name": planet.name, "radius": planet.radius, "flattening": planet.flattening, "mu": planet.mu,
                     "motion": arrays.motion(planet.motion), "turning": arrays.turning(planet.turning)}
                    for planet in scene.planets],
        "crafts": [_craft(craft, arrays) for craft in scene.crafts],
        "stations": [{"name": station.name, "planet": station.planet, "place": list(station.r_P),
                      "up": list(station.up_P),
                      "mask": station.mask, "links": [{"name": link.name, "craft": link.craft,
                                                       "down": arrays.signal(link.down), "up": arrays.signal(link.up)}
                                                      for link in station.links]} for station in scene.stations],
        "modes": [{"process": name, "began": list(began)} for name, began in scene.modes.items()],
        "happened": [{"t": event.t, "text": f"{event.process}: {event.kind} {event.name}"
                      + f", {event.text}" * bool(event.text)} for event in scene.happened],
        "plots": [{"name": plot.name, "unit": plot.unit, "meaning": plot.meaning, "labels": plot.labels,
                   "signal": arrays.signal(plot.signal)} for plot in scene.plots],
    }
    head = json.dumps(text, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    head = struct.pack("<I", len(head)) + head
    return bytes(head + bytes(-len(head) % 8) + arrays.bytes), arrays.growing


def _craft(craft: Craft, arrays: _Arrays) -> dict[str, Any]:
    return {"name": craft.name, "label": craft.label, "extent": craft.extent, "motion": arrays.motion(craft.motion),
            "turning": arrays.turning(craft.turning), "parts": [_part(part, arrays) for part in craft.parts],
            "poses": [{"kind": pose.kind, "name": pose.name, "turning": arrays.turning(pose.turning),
                       "motion": arrays.motion(pose.motion)} for pose in craft.poses],
            "directions": [{"name": direction.name, "signal": arrays.signal(direction.signal)}
                           for direction in craft.directions],
            "signals": {name: arrays.signal(signal) for name, signal in craft.signals.items()}}


def _part(part: Part, arrays: _Arrays) -> dict[str, Any]:
    packed: dict[str, Any] = {
        "kind": part.kind, "name": part.name, "at": list(part.at_B), "axis": list(part.axis_B), "size": list(part.size),
        "half_angle": part.half_angle, "length": part.length, "keep_out": part.keep_out, "color": part.color,
        "level": arrays.signal(part.level), "full": part.full, "scale": part.scale}
    if part.hinge_B is not None and part.hinge_axis_B is not None:
        packed |= {"hinge": list(part.hinge_B), "hinge_axis": list(part.hinge_axis_B)}
    if part.data:
        packed["data"] = arrays.add(list(part.data), "u1")
    return packed


def data_of(scene: Scene) -> str:
    """The data of a scene as text for a page."""
    packer = zlib.compressobj(6, zlib.DEFLATED, -15)
    return b64encode(packer.compress(pack(scene)) + packer.flush()).decode()


def fragment(scene: Scene, page: bool = False) -> str:
    """The elements of an HTML page that show a scene: its data, the viewer and its style.

    page: the viewer fills the page; else it has the page's width, with the plots below
    Raises SetupError where the viewer was not built.
    """
    script, style = bundle.built()
    script = re.sub("</(?=script)", r"<\\/", script, flags=re.IGNORECASE)     # it would end there
    return (f'<style>{style}</style>\n<div id="fledge-view" class="fledge-view{" page" if page else ""}"></div>\n'
            f'<script type="text/plain" id="fledge-data">{data_of(scene)}</script>\n'
            f'<script type="module">{script}</script>')


def write(scene: Scene, path: str | PathLike[str]) -> Path:
    """Write a page that shows a scene and needs nothing else; returns its path."""
    shown = fragment(scene, page=True)
    with PartFile(path) as part:
        part.write_text(
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<meta name="color-scheme" content="light dark">\n<title>{escape(scene.title)}</title>\n</head>\n'
            f"<body>\n{shown}\n</body>\n</html>\n", encoding="utf-8")
    return Path(path)
