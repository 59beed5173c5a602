# SPDX-License-Identifier: Apache-2.0
"""The loops of C, and how often each goes round.

`watched` adds to each loop what shows the analyser's values of its counter. A `for` whose counter has at least 32 bits,
which nothing else changes, and steps by a constant has that counter; another loop is given one. The lines of the source
stay. Loops in macros are not seen.
"""
from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass

STATED = re.compile(r"/\*\s*at most (\d+):\s*(.*?)\s*\*/", re.S)
_NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*',
                       re.S | re.M)
_LOOP = re.compile(r"\b(for|while|do)\b")
_FUNCTION = re.compile(r"^\w[\w \t*]*?\b(\w+)\([^;{}]*\)\s*\{", re.M)
_COUNTED = re.compile(r"^(\w+)\s*(\+\+|--|[+-]=\s*\d+u?)$|^(?:\+\+|--)(\w+)$")


@dataclass(frozen=True)
class Loop:
    id: str             # of the values that the analyser shows
    file: str
    line: int
    function: str
    step: int           # the least change of the counter
    stated: int | None  # the bound in a comment at the loop, and the reason
    reason: str = ""

    def bound(self, values: list[tuple[int, int]]) -> int | None:
        """The most rounds, by the least and largest value of the counter at each time that it was shown; None: none."""
        rounds = (max(high for _, high in values) - min(low for low, _ in values)) // self.step + 1
        return rounds if rounds < 2**31 - 1 else None


def blank(text: str) -> str:
    """The text with blanks for comments, strings and lines of the preprocessor; each line keeps its place."""
    return _NOT_CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def watched(text: str, file: str, number: int) -> tuple[str, list[Loop]]:
    """The source with what shows the counters, and its loops. number: of the file among those of a program."""
    code = blank(text)
    narrow = set(re.findall(r"\bu?int(?:8|16)_t\s+(\w+)", code))
    lines = [0, *(match.end() for match in re.finditer("\n", text))]
    functions = [(match.start(), match[1]) for match in _FUNCTION.finditer(code)]
    inserted: list[tuple[int, int, str]] = []       # from, to, text
    loops: list[Loop] = []
    whiles_of_do: set[int] = set()
    for match in _LOOP.finditer(code):
        if match.start() in whiles_of_do:
            continue
        begin = _annotated(text, match.start())
        id_, line, step = f"L{number}_{len(loops)}", bisect_right(lines, match.start()), 1
        counter = f"prove_{id_}"
        # A loop around it that goes once declares the counter, whatever the loop itself declares.
        around = f"for (unsigned {counter}_once = 0u, {counter} = 0u; {counter}_once == 0u; {counter}_once++) "
        given = _show(id_, counter) + f" {counter}++;"
        opened = code.index("(", match.end())
        closed = match.end() - 1 if match[1] == "do" else _close(code, opened)
        body = _after(code, closed + 1, "{")
        if body is None:
            continue
        if match[1] == "do":
            whiles_of_do.add(code.find("while", _close(code, body)))
            inserted += [(begin, begin, around), (body + 1, body + 1, given)]
        elif match[1] == "while":
            inserted += [(match.start(), opened + 1, f"for (unsigned {counter} = 0u; "),
                         (closed, closed, f"; {counter}++"), (body + 1, body + 1, _show(id_, counter))]
        else:
            last = code.index(";", code.index(";", opened) + 1, closed + 1)
            found = _COUNTED.match(code[last + 1:closed].strip())
            variable = found and (found[1] or found[3])
            if found and variable and variable not in narrow and not _changes(variable, code[body:_close(code, body)]):
                step = int(re.sub(r"\D", "", found[2] or "") or 1)
                inserted.append((body + 1, body + 1, _show(id_, variable)))
            else:
                inserted += [(begin, begin, around), (body + 1, body + 1, given)]
        above = text[lines[max(0, line - 2)]:text.find("\n", match.start())]
        stated = STATED.search(above)
        function = functions[bisect_right(functions, (match.start(), "\x7f")) - 1][1] if functions else ""
        loops.append(Loop(id_, file, line, function, step, int(stated[1]) if stated else None,
                          " ".join(stated[2].split()) if stated else ""))
    for begin, end, more in sorted(inserted, reverse=True):
        text = text[:begin] + more + text[end:]
    return text, loops


def _annotated(text: str, place: int) -> int:
    """The place of the annotation before a loop, else that of the loop."""
    begin = text.rfind("/*", 0, place)
    return begin if text.startswith("/*@", begin) and text[:place].rstrip().endswith("*/") and \
        text.find("*/", begin) + 2 == len(text[:place].rstrip()) else place


def _show(id_: str, counter: str) -> str:
    return f" Frama_C_show_each_{id_}({counter});"


def _after(code: str, place: int, mark: str) -> int | None:
    """The place of a mark that comes next; None if another word does."""
    found = re.compile(r"\s*").match(code, place)
    assert found
    return found.end() if code.startswith(mark, found.end()) else None


def _close(code: str, opened: int) -> int:
    """The place of the bracket that closes the one at `opened`."""
    depth, pair = 0, {"(": ")", "{": "}"}[code[opened]]
    for match in re.compile(rf"[{re.escape(code[opened] + pair)}]").finditer(code, opened):
        depth += 1 if match[0] == code[opened] else -1
        if depth == 0:
            return match.start()
    return len(code)


def _changes(variable: str, body: str) -> bool:
    """Whether the body may change the variable."""
    name = rf"\b{variable}\b"
    return bool(re.search(rf"{name}\s*(?:[-+*/%&|^]|<<|>>)?=(?!=)|{name}\s*(?:\+\+|--)|(?:\+\+|--)\s*{name}|"
                          rf"(?<![\w)\]&])\s&\s*{name}|\(&{name}|, &{name}", body))
