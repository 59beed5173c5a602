# SPDX-License-Identifier: Apache-2.0
"""The files that a campaign writes into its folder, the same bytes for the same seed:

    summary.txt, summary.json   how many passed, percentiles, the drawn values, each failure with the
                                command that repeats that run
    runs.csv                    a line per run: its draws, its final values, its failure
    runs.h5                     the same, with the retained variables over time
    rows.npy                    in place of both where the runs retain too much to be kept one by one (store.EXACT): a
                                row per run; summary.json names the columns
    bands-*.png                 percentiles of a retained variable over time
    requirements.png            the value that each run reached, against the limit
    final.png, draws.png        histograms of the values at the end, and of the draws
    drivers.png                 the draws that a requirement depends on most
"""
from __future__ import annotations

import csv
import io
import itertools
import json
import math
from collections.abc import Callable, Container
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.columns import columns
from fledge.disk import Part
from fledge.montecarlo.counts import BOUND
from fledge.montecarlo.drivers import SIGNIFICANCE, drivers
from fledge.montecarlo.sweep import Sweep, text as text_of
from fledge.montecarlo.plots import PERCENTILES, figures, judged, percentiles
from fledge.objects.si import enumerator_names
from fledge.junit import ERROR, FAILURE, SKIPPED, Case, Suite, document

if TYPE_CHECKING:
    import numpy as np

    from fledge.montecarlo.requirements import Requirement, Variable
    from fledge.montecarlo.result import Result

FAILURES_MAX = 1000     # in a summary
CASES_MAX = 10000       # runs as test cases


def confidence(passed: int, n: int) -> tuple[float, float]:
    """The interval that holds the true rate with 95 % confidence, after Wilson (1927)."""
    if not n:
        return 0.0, 1.0
    z = 1.959963984540054
    rate, spread = passed / n, z * z / n
    middle = (rate + spread / 2) / (1 + spread)
    half = z / (1 + spread) * math.sqrt(rate * (1 - rate) / n + spread / (4 * n))
    return (0.0 if passed == 0 else middle - half), (1.0 if passed == n else middle + half)


# --- text ------------------------------------------------------------------------------------------

def summary(result: Result, command: Callable[[int], str]) -> dict[str, Any]:
    """The figures of a campaign as plain data. command: of a run's index, repeats that run."""
    import numpy as np

    campaign, d = result.campaign, result.campaign.dispersions
    flown, passed, complete = int(result.flown.sum()), int(result.passed.sum()), result.complete
    low, high = confidence(passed, flown)
    return {
        "mission": campaign.nominal.name, "campaign": campaign.name, "about": campaign.summary, "seed": result.seed,
        "runs": len(result), "flown": flown, "passed": passed, "failed": len(result.failures),
        "interrupted": result.interrupted, "pass_rate_95_percent": [low, high],
        "duration": d.duration, "every": d.every,
        "requirements": [_requirement(result, requirement) for requirement in d.requirements],
        "final": [_final(result, measure) for measure in d.measures()],
        "modes": [{"mode": name, "runs": int((~np.isnan(result.entered(name)[complete])).sum()),
                   "of": int(complete.sum()), "first": _percentiles(result, result.entered(name))} for name in d.modes],
        "declared": {path: repr(draw) for path, draw in d.draws.items() if draw.kind != "grid"},
        "draws": _draws(result),
        "health": [{"kind": finding.kind, "path": finding.path, "runs": n, "run": first, "text": finding.text}
                   for finding, n, first in result.unhealthy()],
        "axes": {path: {"values": [text_of(value) for value in values], "unit": campaign.unit(path)}
                 for path, values in campaign.axes.items()} if isinstance(campaign, Sweep) else {},
        "points": getattr(campaign, "points", 1),
        "drivers": [{"measure": variable.measure_text, "when": when,
                     "drivers": [driver._asdict() for driver in drivers(result, reached)]}
                    for variable, when, reached, _ in judged(result)],
        "significance": SIGNIFICANCE,
        "failures": [{"run": i, "text": result.failures[i], "command": command(i)}
                     for i in itertools.islice(result.failures, FAILURES_MAX)],
        "percentile_bound": 0.0 if result.exact else BOUND,
        **({} if result.exact else {"columns": result.store.names}),
    }


def _percentiles(result: Result, values: np.ndarray, names: Container[float] = ()) -> dict[str, float]:
    """Percentile -> number, over the complete runs that have (runs,) values. names: of enumerators"""
    import numpy as np

    values = values[result.complete & ~np.isnan(values)]
    shown = percentiles(len(values))
    if not shown:
        return {}
    quantiles = (np.percentile(values, shown, method="inverted_cdf") if names else  # none between two names
                 np.percentile(values, shown))
    return {str(p): float(x) for p, x in zip(shown, quantiles)}


def _requirement(result: Result, requirement: Requirement) -> dict[str, Any]:
    """How many runs fulfil it, and the worst of them."""
    import numpy as np

    complete = result.complete
    values, times, holds = result.reached(requirement)
    row = {"requirement": repr(requirement), "message": requirement.message, "unit": requirement.variable.unit,
           "limit": requirement.limit, "held": int(holds[complete].sum()), "of": int(complete.sum())}
    if (n := int(np.isnan(values[complete]).sum())):
        row.update(not_judged=n)
    if len(known := np.flatnonzero(complete & ~np.isnan(values))):
        i = int(known[np.argmax(values[known] if requirement.comparison in ("<", "<=") else -values[known])])
        shown, time = requirement._shown(values[i], ".4g"), float(times[i])
        row.update(worst=float(values[i]) if shown else None, shown=shown, worst_run=i,
                   worst_time=None if math.isnan(time) else time)     # JSON has no infinity
    return row


def _final(result: Result, measure: Variable) -> dict[str, Any]:
    """A measure at the end of the runs."""
    words = enumerator_names(measure.field_path.field)
    found = _percentiles(result, result.final(measure), words)
    return {"measure": measure.measure_text, "unit": measure.unit, "percentiles": found,
            "names": {p: words[int(x)] for p, x in found.items() if x in words}}


def _draws(result: Result) -> list[dict[str, Any]]:
    """What was drawn for each dispersed number."""
    import numpy as np

    campaign = result.campaign
    nominal = campaign.drawn(campaign.nominal)
    draws = []
    for path, values in result.draws.items():
        values = values[np.isfinite(values)]
        row = {"path": path, "unit": campaign.dispersions.columns[path], "nominal": nominal[path]}
        if names := campaign.enumerators(path):     # which have no mean
            row.update(nominal=names.get(nominal[path], nominal[path]),
                       counts={name: int((values == number).sum()) for number, name in names.items()})
        elif len(values):
            row.update(min=float(values.min()), mean=float(values.mean()), max=float(values.max()),
                       deviation=float(values.std(ddof=1)) if len(values) > 1 else 0.0)
        draws.append(row)
    return draws


def text(data: dict[str, Any], failures: int | None = None) -> str:
    """A summary in words. failures: how many to show; None: all."""
    return "\n".join([*_runs_text(data), *_requirements_text(data), *_ends_text(data), *_draws_text(data),
                      *_health_text(data), *_failures_text(data, failures)])


def _runs_text(data: dict[str, Any]) -> list[str]:
    flown, passed = data["flown"], data["passed"]
    lines = [f"{data['mission']}, {data['campaign']}" + (f": {data['about']}" if data["about"] else ""),
             f"  runs     {flown} of {data['duration']:g} s, seed {data['seed']}"
             + (f"; stopped before {data['runs'] - flown} more" if flown < data["runs"] else "")]
    if not data["requirements"]:
        lines.append(f"  ended    {passed} of {flown} without an error; nothing is required of them")
    elif data["axes"]:
        lines.append(f"  passed   {passed} of {flown}")
    elif flown:
        low, high = data["pass_rate_95_percent"]
        lines.append(f"  passed   {passed} of {flown}, {100 * passed / flown:.4g} %; "
                     f"the true rate is {100 * low:.4g} to {100 * high:.4g} % (95 % confidence)")
    return lines


def _requirements_text(data: dict[str, Any]) -> list[str]:
    lines = []
    if data["requirements"]:
        rows = [(requirement["requirement"], f"{requirement['held']} of {requirement['of']}",
                 ", ".join([*([f"worst {requirement['shown']} in run {requirement['worst_run']}"]
                              if requirement.get("shown") else []),
                            *([f"no good data in {requirement['not_judged']}"]
                              if "not_judged" in requirement else [])]))
                for requirement in data["requirements"]]
        lines += ["", "required", *columns(rows, indent="  ")]
    if data["modes"]:
        rows = [(mode["mode"], f"begun in {mode['runs']} of {mode['of']}",
                 "first at " + ", ".join(f"{t:.4g} s ({p} %)" for p, t in mode["first"].items())
                 if mode["first"] else "") for mode in data["modes"]]
        lines += ["", "modes", *columns(rows, indent="  ")]
    return lines


def _ends_text(data: dict[str, Any]) -> list[str]:
    shown: list[str] = next((list(measure["percentiles"]) for measure in data["final"] if measure["percentiles"]), [])
    if not shown:
        return []
    ends: list[tuple[str, ...]] = [("at the end", "", *(f"{p} %" for p in shown))]
    ends += [(measure["measure"], measure["unit"], *(
        measure["names"].get(p) or f"{measure['percentiles'][p]:.3g}" if p in measure["percentiles"] else "-"
        for p in shown)) for measure in data["final"]]
    left = [str(p) for p in PERCENTILES if str(p) not in shown]
    table = columns(ends, range(2, 2 + len(shown)), "  ")
    return ["", table[0][2:], *table[1:],
            *([f"  too few runs for the percentiles {', '.join(left)}"] if left else [])]


def _draws_text(data: dict[str, Any]) -> list[str]:
    lines = []
    if data["axes"]:
        lines += ["", "swept", *columns([(path, "= " + ", ".join(axis["values"]), axis["unit"])
                                         for path, axis in data["axes"].items()], indent="  ")]
    if data["declared"]:
        lines += ["", "dispersed", *columns([(path, "= " + how) for path, how in data["declared"].items()],
                                            indent="  ")]
    return lines


def _health_text(data: dict[str, Any]) -> list[str]:
    return ["", "health", *(f"  in {finding['runs']} of {data['flown']} runs, as in run {finding['run']}: "
                            f"{finding['text']}" for finding in data["health"])] if data["health"] else []


def _failures_text(data: dict[str, Any], most: int | None) -> list[str]:
    """At most so many failures, each with the command that repeats its run."""
    lines = ["", "failed"] if data["failures"] else []
    shown = data["failures"][:most]
    for failure in shown:
        first, *more = failure["text"].split("\n")
        lines += [f"  run {failure['run']}: {first}", *(f"    {line}" for line in more), f"    {failure['command']}"]
    if data["failures"] and len(shown) < data["failed"]:
        lines.append(f"  and {data['failed'] - len(shown)} more")
    return lines


# --- files -----------------------------------------------------------------------------------------

def write(result: Result, folder: Path | str, command: Callable[[int], str]) -> tuple[dict, list[Path]]:
    """Write all files; returns (the summary's data, the paths)."""
    from fledge.plot import save

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for old in [*folder.glob("bands-*.png"), *(folder / name for name in (
            "axes.png", "requirements.png", "final.png", "drivers.png", "draws.png", "runs.csv", "runs.h5",
            "rows.npy"))]:
        old.unlink(missing_ok=True)     # of a campaign that retained or required something else
    data = summary(result, command)
    contents = {"summary.txt": text(data) + "\n", "summary.json": json.dumps(data, indent=1) + "\n"}
    if result.exact:
        contents["runs.csv"] = as_csv(result)
    for name, content in contents.items():
        with Part(folder / name) as part:
            part.write_text(content, encoding="utf-8")
    paths = [folder / name for name in contents]
    if result.exact:
        with Part(folder / "runs.h5") as part:
            part.write_bytes(_hdf5(result))
        paths.append(folder / "runs.h5")
    return data, [*paths, *(save(figure, folder) for figure in figures(result))]


def junit(result: Result, data: dict[str, Any], wall: float, command: Callable[[int], str]) -> str:
    """The runs as test cases, beyond CASES_MAX only those that have failed; then the requirements. data: of summary();
    wall: [s] that the runs took; command: of a run's index, repeats that run"""
    title = f"{data['mission']}.{data['campaign']}"
    runs = range(len(result)) if len(result) <= CASES_MAX else itertools.islice(result.failures, CASES_MAX)
    cases = [Case(f"run {i}", (FAILURE if result.complete[i] else ERROR) if i in result.failures else
                  "" if result.flown[i] else SKIPPED,
                  f"{result.failures[i]}\n{command(i)}" if i in result.failures else
                  "" if result.flown[i] else "it was not flown") for i in runs]
    required = [Case(row["requirement"], FAILURE if row["held"] < row["of"] else "",
                     f"{row['message']}: held in {row['held']} of {row['of']} runs".removeprefix(": "))
                for row in data["requirements"]]
    suites = [Suite(title, wall, cases), Suite(f"{title}.requirements", 0.0, required)]
    return document(f"{title}, seed {data['seed']}", suites if required else suites[:1])


def as_csv(result: Result) -> str:
    """A line for each run, of a result that is exact."""
    d = result.campaign.dispersions

    def head(name: str, unit: str) -> str:
        return f"{name} [{unit}]" if unit else name

    # Of two requirements on one number, which are furthest from their limits at other samples, the second has its own.
    reached: dict[str, Any] = {}
    for r in d.requirements:
        reached[repr(r) if repr(r.variable) in reached else repr(r.variable)] = result.reached(r)[0], r.variable.unit
    final = {repr(measure.final): (result.final(measure), measure.unit) for measure in d.measures()}
    draws = [*result.draws.values()]
    columns = {**{name: (result.entered(name), "s") for name in d.modes}, **final, **reached}
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["run", "outcome", *(head(p, u) for p, u in d.columns.items()),
                     *(head(name, unit) for name, (_, unit) in columns.items()), "failure"])
    for i in range(len(result)):
        outcome = "passed" if result.passed[i] else "failed" if result.flown[i] else "not flown"
        numbers = [*(values[i] for values in draws), *(values[i] for values, _ in columns.values())]
        writer.writerow([i, outcome, *("" if math.isnan(x) else repr(float(x)) for x in numbers),
                         result.failures.get(i, "")])
    return out.getvalue()


def _hdf5(result: Result) -> bytes:
    import h5py

    campaign, d = result.campaign, result.campaign.dispersions
    # Made in memory: where a disk is full, HDF5 ends the process.
    with h5py.File("runs.h5", "w", driver="core", backing_store=False) as out:
        out.attrs.update(mission=campaign.nominal.name, campaign=campaign.name)
        out.attrs["seed"] = str(result.seed)  # HDF5 readers disagree on 64 unsigned bits
        out["time"] = result.time
        out["time"].attrs["unit"] = "s"
        out["flown"], out["passed"] = result.flown, result.passed
        for path, values in result.draws.items():
            out[f"draws/{path}"] = values
            out[f"draws/{path}"].attrs["unit"] = d.columns[path] or "-"
        for name in d.modes:
            out[f"entered/{name}"] = result.entered(name)
            out[f"entered/{name}"].attrs["unit"] = "s"
        for path, values in result.retained.items():
            out[f"retained/{path}"] = values
            field = d.retained[path].field_path.field
            out[f"retained/{path}"].attrs.update(unit=field.unit or "-", meaning=field.doc)
        out.flush()
        return out.id.get_file_image()
