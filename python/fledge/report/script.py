# SPDX-License-Identifier: Apache-2.0
"""A run of a script of the ground on one HTML page, as `fledge ground run` writes it: no other file, no script, no
network. It has the entries of the run alone (fledge.ground.scripts.script): nothing but its head names target and
date."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fledge import __version__
from fledge.disk import Part
from fledge.report.run import templates

Entry = dict[str, Any]


class Row(NamedTuple):
    """What happened at an instant."""

    t_ns: int
    kind: str
    text: str                   # of the script, or its effect
    results: list[tuple[str, bool | None]]      # in words, and whether it is good; None: it is neither
    values: dict[str, Any]
    packets: Sequence[str] = ()
    line: int = 0


class Group(NamedTuple):
    """A step, or what stands between two."""

    title: str
    begin_ns: int
    rows: list[Row]
    ends: list[Entry]           # how it ended: none yet, or one


def write(path: Path, entries: Sequence[Entry], command: str) -> Path:
    """Write the page; returns its path. command: repeats the run."""
    end = entries[-1] if entries[-1]["kind"] == "end" else None
    first = entries[0]
    with Part(path) as part:
        part.write_text(templates().get_template("script.html").render(
            run=first, about=first["about"].split("\n\n"), end=end, parts=_parts(entries), command=command,
            version=__version__, seconds=_seconds, counts={
                "commands": sum(entry["kind"] == "command" for entry in entries),
                "refused": sum(entry["kind"] == "stage" and not entry["good"] for entry in entries),
                "waits": sum(entry["kind"] == "wait" for entry in entries),
                "checks": sum(entry["kind"] == "check" for entry in entries)}), encoding="utf-8")
    return path


def _parts(entries: Sequence[Entry]) -> list[Group]:
    """The entries by steps, in the order of their beginnings. A stage stands with its command."""
    parts: list[Group] = []
    steps: dict[tuple[str, ...], Group] = {}
    rows: dict[int, Row] = {}
    for entry in entries:
        key = tuple(entry.get("step", ()))
        if entry["kind"] == "step":
            parts.append(Group(" / ".join(key), entry["t_ns"], [], []))
            steps[key] = parts[-1]
        elif entry["kind"] == "step ends":
            steps.pop(key).ends.append(entry)
        elif entry["kind"] == "stage":
            rows[entry["id"]].results.append((_stage(entry), None if entry["good"] else False))
        elif entry["kind"] not in ("run", "end"):
            if key in steps:
                part = steps[key]
            elif parts and not parts[-1].title:
                part = parts[-1]
            else:
                parts.append(part := Group("", entry["t_ns"], [], []))
            part.rows.append(row := _row(entry))
            if entry["kind"] == "command":
                rows[entry["id"]] = row
    return parts


def _row(entry: Entry) -> Row:
    kind, results = entry["kind"], []
    if kind == "wait":
        results = [f"after {_seconds(entry['took_ns'])} of {_seconds(entry['within_ns'])}", entry["why"]]
    elif kind == "hold":
        results = [_seconds(entry["took_ns"])]
    elif kind == "check":
        results = ["holds" if entry["good"] else "does not hold"]
    elif kind == "confirm":
        results = [("yes, " if entry["good"] else "no, ") + entry["why"]]
    elif kind == "exception":
        results = [entry["text"]]
    text = entry.get("text", "") if kind in ("command", "check", "confirm", "file") else ""
    values = entry.get("values", {})
    if kind == "command":
        text, values = f"{text} " + " ".join(f"{name}={value}" for name, value in values.items()), {}
    good = False if kind == "exception" else entry.get("good")
    return Row(entry["t_ns"], kind, (text or entry["source"]).strip(), [(result, good) for result in results if result],
               values, entry.get("packets", ()), entry["line"])


def _stage(entry: Entry) -> str:
    at = entry.get("on_board_ns", entry["t_ns"])
    data = f", {entry['data']}" if entry.get("data") else ""
    return "".join([entry["stage"], f" at {_seconds(at)}" if at >= 0 else "",
                    f": {entry['text']}" if entry["text"] else "", data])


def _seconds(ns: int) -> str:
    return f"{ns / 1e9:.3f}".rstrip("0").rstrip(".") + " s"
