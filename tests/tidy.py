# SPDX-License-Identifier: Apache-2.0
"""clang-tidy over the product's sources in C and C++, or over those of some folders:

    /usr/bin/python3 -m tests.tidy [SOURCE or FOLDER...]

clang-tidy searches for its patterns in every header that a source includes, which takes longer than the source. So it
reads generated files here that include many sources, and the headers once.
"""
import json
import os
import re
import shlex
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.tree import ROOT, files

FOLDER = ROOT / "build/tidy"
MOST = 30   # sources in a file: with more, a processor would have no work at the end
# Sources for other systems and of proofs, copies, tests and fuzzers, which no build for this machine compiles.
ELSEWHERE = {"testing", "templates", "examples", "guest", "cortex_m7", "leon3", "leon3_rtems", "micropython", "prove",
             "riscv64"}
Unit = tuple[list[str], list[Path]]     # (flags, sources)


def sources() -> list[Path]:
    """The product's; those of generated tables and of other machines are not among them."""
    return [path for path in files() if path.suffix in {".c", ".cpp"} and not ELSEWHERE & set(path.parts)
            and not path.stem.endswith(("_test", "_fuzz", "_proof"))]


def flags(command: str) -> list[str]:
    """The words of a compiler's command that change the meaning of a source."""
    words = shlex.split(command)
    return [word for word, before in zip(words, ["", *words])
            if word.startswith(("-I", "-D", "-std", "-isystem")) or before == "-isystem"]


def is_program(text: str) -> bool:
    """Whether it uses a namespace in all that follows it in a file."""
    return "\nusing namespace fledge" in text


def own_names(text: str) -> set[str]:
    """The names that only one source in a file may declare, by the layout of clang-format."""
    inner = re.findall(r"^namespace \{$.*?^\} // namespace$", text, re.M | re.S)
    inner += re.findall(r"^(?:static|extern|int main).*", text, re.M)
    declared = re.findall(r"^[A-Za-z].*?\b(\w+)(?=\(|\[| = |\{| \{|;| : )", "\n".join(inner), re.M)
    enumerators = re.findall(r"[A-Z]\w+", " ".join(re.findall(r"^enum[^;]*", text, re.M)))
    macros = re.findall(r"^#define (\w+)", text, re.M)
    return {*declared, *enumerators, *macros, *["using"] * is_program(text)}


def units(chosen: list[Path]) -> list[Unit]:
    """Sources that a file may include."""
    commands: dict[str, list[str]] = {}
    for entry in json.loads((ROOT / "build/release/compile_commands.json").read_text(encoding="utf-8")):
        together = Path(entry["file"])      # FLEDGE_UNITY: a file that includes the sources
        compiled = (re.findall(r'^#include "(.*)"', together.read_text(encoding="utf-8"), re.M)
                    if together.parent.name == "Unity" else [entry["file"]])
        for source in compiled:
            commands.setdefault(source.removeprefix(f"{ROOT}/"), flags(entry["command"]))
    texts = {source: (ROOT / source).read_text(encoding="utf-8") for source in chosen}
    groups: dict[tuple[str, ...], list[tuple[set[str], list[Path]]]] = defaultdict(list)
    for source, text in sorted(texts.items(), key=lambda item: is_program(item[1])):
        plain = [f"-I{ROOT}", f"-I{ROOT}/targets/cfs/inc", "-std=c++20" if source.suffix == ".cpp" else "-std=c99"]
        group = groups[source.suffix, *commands.get(str(source), plain)]
        names = own_names(text)
        for taken, unit in group:
            if len(unit) < MOST and not taken & names:
                taken |= names
                unit.append(source)
                break
        else:
            group.append((names, [source]))
    return sorted(((options, unit) for (_, *options), group in groups.items() for _, unit in group),
                  key=lambda unit: -sum(len(texts[source]) for source in unit[1]))


def tidy(unit: Unit) -> str:
    """The findings of clang-tidy in the sources of a unit."""
    options, chosen = unit
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / "_".join(chosen[0].parts[-3:])
    path.write_text("".join(f'#include "{ROOT / source}"\n' for source in chosen), encoding="utf-8")
    done = subprocess.run(["clang-tidy", "--quiet", f"--config-file={ROOT}/.clang-tidy", path,
                           "--checks=-bugprone-suspicious-include", "--", *options, "-D_GNU_SOURCE="],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    if len(chosen) > 1 and "clang-diagnostic-error" in done.stdout:     # they do not fit into a file
        half = len(chosen) // 2
        return tidy((options, chosen[:half])) + tidy((options, chosen[half:]))
    return done.stdout or done.stderr if done.returncode else ""


def findings(chosen: list[Path]) -> str:
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return "".join(pool.map(tidy, units(chosen)))


if __name__ == "__main__":
    text = findings([source for source in sources() if not sys.argv[1:]
                     or any(source.is_relative_to(given) for given in sys.argv[1:])])
    print(text, end="")
    sys.exit(bool(text))
