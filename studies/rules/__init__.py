# SPDX-License-Identifier: Apache-2.0
"""The rules of MISRA C:2012 that flight C keeps, by cppcheck and its addon; rules are numbers here, as their texts are
not free.

Example:

    from fledge import rules

    for row in rules.judge(rules.check(paths=["flight/control"])):      # without paths: all that is flight C
        print(row.rule, row.state, len(row.found), [reason.text for reason, _ in row.reasons])

flight/deviations.toml of Fledge or of a project has the reasons of findings: `"15.5" = "..."` for all files, or below
`["flight/math"]` for a file or folder. A reason that begins with `false: ` says that the finding is no violation.
What was found in a source is kept in build/rules of the tree until it, a header or cppcheck changes.
"""
from __future__ import annotations

import functools
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from typing import Any, NamedTuple

from fledge.disk import ROOT, keep
from fledge.errors import Failure, did_you_mean, listed
from fledge.prove.sources import Tree

DEVIATIONS = "flight/deviations.toml"
FOLDERS = ("flight", "ccsds", "record", "registers", "targets")
EXPORTED = "exported"       # the table of reasons for missions that `fledge export c` wrote
NOT_FLOWN = {"testing", "tools", "examples"}        # parts of paths
# Targets whose sources are macros and types of others' headers, which are not in this tree; named, they are checked.
OF_OTHERS = {"cfs", "micropython", "leon3_cfs", "leon3_rtems", "leon3_qemu"}
# The preprocessor's view: flight/math/strict.h refuses a compiler whose arithmetic is not that of IEEE 754.
DEFINED = ("FLT_EVAL_METHOD=0", "FLT_RADIX=2", "DBL_MANT_DIG=53", "DBL_MAX_EXP=1024")
ADDON = (Path("/usr/lib/x86_64-linux-gnu/cppcheck/addons/misra.py"), Path("/usr/share/cppcheck/addons/misra.py"))
MISSING = "rules: cppcheck is not installed; as root, run: apt-get install cppcheck"
# A deviation from these is not allowed; then those that are advice. All others are required.
REASONED = "2.10"   # the version of cppcheck, of Debian 12, whose findings flight/deviations.toml explains
MANDATORY = set("7.5 9.1 9.7 12.5 13.6 17.3 17.4 17.6 17.9 18.10 19.1 21.13 21.17 21.18 21.19 21.20 21.22 22.2 22.4 "
                "22.5 22.6 22.12 22.14 22.20".split())
ADVISORY = set("1.2 2.3 2.4 2.5 2.6 2.7 2.8 4.2 5.9 8.7 8.9 8.11 8.13 8.16 8.17 10.5 11.4 11.5 12.1 12.3 12.4 13.3 "
               "13.4 15.1 15.4 15.5 17.5 17.8 17.11 17.12 18.4 18.5 19.2 20.1 20.5 20.10 21.12 23.1 23.3 "
               "23.5 23.7".split())
# Rules that checks of cppcheck itself look at, by the names of these; its other errors are of 1.3.
CHECKS = {
    "2.1": "duplicateBreak unreachableCode", "2.2": "redundantCondition redundantAssignment redundantAssignInSwitch "
    "unreadVariable", "2.6": "unusedLabel", "5.3": "shadowVariable shadowFunction shadowArgument",
    "9.1": "uninitvar uninitdata uninitStructMember ctuuninitvar legacyUninitvar uninitMemberVar",
    "13.2": "unknownEvaluationOrder", "13.6": "sizeofCalculation", "14.3": "alwaysTrue alwaysFalse "
    "compareValueOutOfTypeRangeError", "17.4": "missingReturn", "17.5": "argumentSize",
    "18.1": "pointerOutOfBounds pointerOutOfBoundsCond arrayIndexOutOfBounds arrayIndexOutOfBoundsCond "
    "ctuArrayIndex ctuPointerArith negativeIndex", "18.2": "subtractPointers", "18.3": "comparePointers",
    "18.6": "danglingLifetime returnDanglingLifetime autoVariables danglingPointer",
    "19.1": "overlappingWriteUnion overlappingWriteFunction", "21.13": "invalidFunctionArg", "21.18":
    "bufferAccessOutOfBounds",
    "22.1": "memleak resourceLeak memleakOnRealloc leakReturnValNotUsed leakNoVarFunctionCall",
    "22.2": "autovarInvalidDeallocation", "22.3": "incompatibleFileOpen", "22.4": "writeReadOnlyFile",
    "22.6": "useClosedFile",
}
BY_CHECK = {check: rule for rule, checks in CHECKS.items() for check in checks.split()}
UNREADABLE = ("syntaxError", "unknownMacro", "preprocessorErrorDirective", "internalError", "internalAstError",
              "cppcheckError")


class Finding(NamedTuple):
    """file: relative to the tree's root."""
    rule: str
    file: str
    line: int


class Reason(NamedTuple):
    """where: the file or folder that it is for, "" for all. file, line: where it is given. own: not inherited."""
    rule: str
    where: str
    text: str
    file: Path
    line: int
    own: bool

    @property
    def false(self) -> bool:
        return self.text.startswith("false: ")

    def covers(self, finding: Finding) -> bool:
        return finding.rule == self.rule and (
            self.where in ("", EXPORTED) or f"{finding.file}/".startswith(f"{self.where}/"))


@dataclass(frozen=True)
class Check:
    """What was found. version: of cppcheck; files: the sources with their SHA-256; checked: rules that it looks at;
    whole: over all sources of the tree, so that rules on several sources count."""
    root: Path
    version: str
    files: dict[str, str]
    checked: list[str]
    findings: list[Finding]
    whole: bool


@dataclass
class Row:
    """A rule. reasons: with how many findings each explains; left: the findings without one."""
    rule: str
    found: list[Finding] = field(default_factory=list)
    reasons: list[tuple[Reason, int]] = field(default_factory=list)
    left: list[Finding] = field(default_factory=list)

    @property
    def category(self) -> str:
        return "mandatory" if self.rule in MANDATORY else "advisory" if self.rule in ADVISORY else "required"

    @property
    def state(self) -> str:
        if self.left:
            return "broken"
        return "kept" if all(reason.false for reason, _ in self.reasons) else "deviation"

    def facts(self) -> dict[str, Any]:
        """For JSON."""
        return {"rule": self.rule, "category": self.category, "state": self.state, "findings": len(self.found),
                "reasons": [{"where": reason.where, "reason": reason.text, "findings": n}
                            for reason, n in self.reasons],
                "left": [f"{finding.file}:{finding.line}" for finding in self.left]}


def order(rule: str) -> tuple[int, ...]:
    return tuple(map(int, rule.split(".")))


def version() -> str:
    """Of cppcheck: "2.10". Raises Failure."""
    if not which("cppcheck"):
        raise Failure(MISSING)
    return subprocess.run(["cppcheck", "--version"], stdout=subprocess.PIPE, text=True, check=True).stdout.split()[-1]


def _addon() -> Path:
    for path in ADDON:
        if path.is_file():
            return path
    raise Failure(f"rules: cppcheck has no addon misra.py in {ADDON[0].parent} or {ADDON[1].parent}; as root, run: "
                  "apt-get install --reinstall cppcheck")


def known() -> list[str]:
    """The rules that the addon and cppcheck look at. Raises Failure."""
    table = subprocess.run([sys.executable, str(_addon()), "-generate-table"], stdout=subprocess.PIPE, text=True)
    rules = {*re.findall(r"^(\d+\.\d+) +X \(Addon\)", table.stdout, re.M), *CHECKS, "1.3"}
    return sorted(rules, key=order)


# --- Sources ---------------------------------------------------------------------------------------

def sources(tree: Tree, paths: Sequence[str] = ()) -> list[str]:
    """The C of the tree, or of files and folders in it; names are relative to its root. Raises Failure."""
    root = tree.roots[0]
    if not paths:
        return [name for folder in ([""] if _exported(root) else FOLDERS) for name in _below(root, root / folder)
                if not OF_OTHERS & set(Path(name).parts[1:2])]
    names: dict[str, None] = {}
    for given in paths:
        path = next((p for p in (Path(given).resolve(), (root / given).resolve()) if p.exists()
                     and p.is_relative_to(root)), None)
        if path is None:
            known_folders = [name for name in FOLDERS if (root / name).is_dir()]
            raise Failure(f"rules: there is no file or folder '{given}' in {root}{did_you_mean(given, known_folders)} "
                          f"there are {listed(known_folders)}")
        found = [path.relative_to(root).as_posix()] if path.is_file() else list(_below(root, path))
        if not found or any(not name.endswith(".c") for name in found):
            raise Failure(f"rules: {given} has no C; give sources (.c), or folders of them")
        names.update(dict.fromkeys(found))
    return list(names)


def _exported(root: Path) -> bool:
    """Whether a tree is that of an exported mission, whose files lie side by side."""
    return not any((root / folder).is_dir() for folder in FOLDERS)


def _below(root: Path, folder: Path) -> Iterator[str]:
    for path in sorted(folder.rglob("*.c")):
        inside = path.relative_to(root)
        if not (NOT_FLOWN & set(inside.parts) or path.stem.endswith(("_proof", "_test"))):
            yield inside.as_posix()


# --- The check -------------------------------------------------------------------------------------

def check(tree: Tree | None = None, paths: Sequence[str] = (), jobs: int | None = None,
          ended: Callable[[int, int], None] = lambda done, of: None) -> Check:
    """Check the sources of a tree, of Fledge without one. ended: is called as sources are checked. Raises Failure."""
    tree = tree or Tree.of(None)
    found_version, addon = version(), _addon()
    names = sources(tree, paths)
    if not names:
        raise Failure(f"rules: there is no C in {tree.roots[0]}", 1)
    root = tree.roots[0]
    units: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="fledge-rules-") as scratch:
        with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
            try:
                for unit in pool.map(functools.partial(_unit, tree, Path(scratch), addon, found_version), names):
                    units.append(unit)
                    ended(len(units), len(names))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
        found = {(rule, file, line) for unit in units for rule, file, line in unit["findings"]}
        if not paths:
            found |= _together(Path(scratch), addon, root, [unit["shared"] for unit in units])
    findings = [Finding(*of) for of in sorted(found, key=lambda of: (order(of[0]), *of[1:]))]
    files = {name: hashlib.sha256((root / name).read_bytes()).hexdigest() for name in names}
    return Check(root, found_version, files, known(), findings, not paths)


def _unit(tree: Tree, scratch: Path, addon: Path, found_version: str, name: str) -> dict[str, Any]:
    """What is found in a source and its headers, and what the addon compares with other sources; kept, or new."""
    texts = tree.closure(name, with_c=False)
    root = tree.roots[0]
    digest = hashlib.sha256("\0".join([found_version, Path(__file__).read_text(encoding="utf-8"), str(root),
                                       *(word for item in texts.items() for word in item)]).encode()).hexdigest()
    kept = root / "build/rules" / f"{name}.json"
    try:
        unit = json.loads(kept.read_text(encoding="utf-8"))
        if unit["digest"] == digest:
            return unit
    except (OSError, ValueError, KeyError, TypeError):
        pass
    link = scratch / name       # cppcheck writes its dump beside the source
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(root / name)
    own = subprocess.run(["cppcheck", "--dump", "--quiet", "--enable=warning,style", "--std=c99", "--platform=unix64",
                          "--template={file}\t{line}\t{severity}\t{id}\t{message}", "--template-location=",
                          *(f"-I{folder}" for folder in tree.roots), *(f"-D{text}" for text in DEFINED), name],
                         cwd=scratch, capture_output=True, text=True, errors="replace")
    findings = set(_own(own.stderr, root))
    dump = Path(f"{link}.dump")
    if not dump.is_file() or b"<tokenlist>" not in dump.read_bytes():
        raise Failure(f"rules: cppcheck cannot read {name}: an #error stops it, or a header is missing", 1)
    theirs = subprocess.run([sys.executable, str(addon), "--cli", f"{name}.dump"], cwd=scratch, capture_output=True,
                            text=True, errors="replace")
    if theirs.returncode or "Traceback" in theirs.stderr:
        raise Failure(f"rules: the addon of cppcheck {found_version} fails at {name}: "
                      f"{(theirs.stderr.strip() or theirs.stdout.strip() or 'no word').splitlines()[-1]}", 1)
    findings |= set(_theirs(theirs.stdout, root))
    shared = Path(f"{link}.ctu-info")
    unit = {"digest": digest, "findings": sorted(findings),
            "shared": shared.read_text(encoding="utf-8") if shared.is_file() else ""}
    dump.unlink()
    if (root / "build").is_dir():       # an export has none
        keep(kept, json.dumps(unit) + "\n")
    return unit


def _own(output: str, root: Path) -> Iterator[tuple[str, str, int]]:
    """(rule, file, line) of what cppcheck itself found. Raises Failure, of code that it cannot read."""
    for words in (line.split("\t") for line in output.splitlines()):
        if len(words) < 5:
            continue
        file, line, severity, check_id, message = words[:5]
        name = _inside(file, root)
        if check_id in UNREADABLE:
            raise Failure(f"rules: cppcheck cannot read {name or file}:{line}: {message}", 1)
        if name and (rule := BY_CHECK.get(check_id, "1.3" if severity == "error" else "")):
            yield rule, name, int(line)


def _theirs(output: str, root: Path) -> Iterator[tuple[str, str, int]]:
    """(rule, file, line) of what the addon found."""
    for line in output.splitlines():
        of = json.loads(line) if line.startswith("{") else {}
        if of.get("errorId", "").startswith("c2012-") and (name := _inside(of["file"], root)):
            yield of["errorId"].removeprefix("c2012-"), name, of["linenr"]


def _inside(file: str, root: Path) -> str:
    """The name of a file of the tree, "" of others."""
    path = Path(file)
    if not path.is_absolute():
        return path.as_posix()
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else ""


def _together(scratch: Path, addon: Path, root: Path, shared: Iterable[str]) -> set[tuple[str, str, int]]:
    """What the addon finds in all sources together."""
    names = []
    for i, text in enumerate(shared):
        names.append(f"{i}.ctu-info")
        (scratch / names[-1]).write_text(text, encoding="utf-8")
    done = subprocess.run([sys.executable, str(addon), "--cli", *names], cwd=scratch, stdout=subprocess.PIPE, text=True)
    return set(_theirs(done.stdout, root))


# --- Reasons ---------------------------------------------------------------------------------------

def reasons(tree: Tree) -> list[Reason]:
    """Those of the tree, then those that it inherits. Raises Failure that names file and line."""
    return [reason for root in tree.roots if (root / DEVIATIONS).is_file()
            for reason in _reasons(root / DEVIATIONS, root, root == tree.roots[0])
            if reason.where != EXPORTED or _exported(tree.roots[0])]


def _reasons(path: Path, root: Path, own: bool) -> Iterator[Reason]:
    text = path.read_text(encoding="utf-8")
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise Failure(f"{path}: {error}") from None
    lines = text.splitlines()
    for where, rules in [("", {k: v for k, v in table.items() if not isinstance(v, dict)}),
                         *((k, v) for k, v in table.items() if isinstance(v, dict))]:
        head = next((n for n, words in enumerate(lines, 1) if where and words.startswith(f'["{where}"]')), 0)
        if where not in ("", EXPORTED) and not (root / where).exists():
            raise Failure(f"{path}:{head}: there is no file or folder '{where}' in {root}")
        for rule, reason in rules.items():
            at = (n for n, words in enumerate(lines[head:], head + 1) if words.startswith(f'"{rule}"'))
            line = next(at, head)
            if not re.fullmatch(r"\d+\.\d+", rule):
                raise Failure(f"{path}:{line}: '{rule}' is no rule; write \"15.5\" = \"the reason\"")
            if not isinstance(reason, str) or len(reason.split()) < 3:
                raise Failure(f"{path}:{line}: rule {rule} needs a reason, a sentence")
            if rule in MANDATORY and not reason.startswith("false: "):
                raise Failure(f"{path}:{line}: rule {rule} is mandatory, which allows no deviation; mend the code, or "
                              "say \"false: ...\" why the finding is none")
            yield Reason(rule, where.rstrip("/"), reason, path, line, own)


def judge(of: Check, given: Sequence[Reason] | None = None) -> list[Row]:
    """All rules that are checked. given: reasons, the nearest counts; default: those of the tree.
    Raises Failure, of a reason of the tree itself that no finding needs any more."""
    if given is None:
        given = reasons(Tree.of(of.root))
    given = sorted(given, key=lambda reason: (not reason.own, -len(reason.where)))
    rows = {rule: Row(rule) for rule in sorted({*of.checked, *(f.rule for f in of.findings)}, key=order)}
    counts: dict[Reason, int] = {}
    for finding in of.findings:
        row = rows[finding.rule]
        row.found.append(finding)
        reason = next((reason for reason in given if reason.covers(finding)), None)
        if reason is None:
            row.left.append(finding)
        else:
            counts[reason] = counts.get(reason, 0) + 1
    for reason, n in counts.items():
        rows[reason.rule].reasons.append((reason, n))
    for reason in given:
        if reason.file == ROOT / DEVIATIONS and of.version != REASONED:
            continue        # what that version found, others may not find
        if of.whole and reason.own and reason not in counts and reason.rule in of.checked:
            raise Failure(f"{reason.file}:{reason.line}: nothing breaks rule {reason.rule} "
                          f"{f'in {reason.where} ' if reason.where else ''}any more; delete its reason", 1)
    return list(rows.values())


def facts(of: Check, rows: Sequence[Row]) -> dict[str, Any]:
    """For JSON."""
    return {"cppcheck": of.version, "standard": "MISRA C:2012", "whole": of.whole, "files": of.files,
            "rules": [row.facts() for row in rows]}


def table(rows: Sequence[Row]) -> str:
    """Markdown: the rules that are kept, and a row for each reason of the others."""
    lines = ["| rule | category | where | found | reason |", "|---|---|---|---:|---|"]
    for row in rows:
        for reason, n in sorted(row.reasons, key=lambda pair: pair[0].where):
            lines.append(f"| {row.rule} | {row.category} | {f'`{reason.where}`' if reason.where else 'all'} | {n} | "
                         f"{reason.text} |")
        if row.left:
            lines.append(f"| {row.rule} | {row.category} | `{row.left[0].file}`, ... | {len(row.left)} | none |")
    kept = [row.rule for row in rows if not row.found]
    return "\n".join([*textwrap.wrap(f"No finding: {', '.join(kept)}.", 120), "", *lines, ""])
