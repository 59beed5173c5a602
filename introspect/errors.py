# SPDX-License-Identifier: Apache-2.0
"""How a header is refused: where, by which rule, what was found, and what to do."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Problem:
    """One broken rule, at one line of one header."""
    file: str
    line: int
    rule: str
    found: str
    advice: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.rule}; {self.found}; {self.advice}"


class HeaderError(Exception):
    """All that is wrong with the headers of one read, in the order of file and line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = sorted(set(problems))
        super().__init__("\n".join(str(problem) for problem in self.problems))


class Refusal(Exception):
    """A broken rule: rule, found, advice. Only the caller knows the file and line."""

    def __init__(self, rule: str, found: str, advice: str):
        self.rule, self.found, self.advice = rule, found, advice
        super().__init__(f"{rule}; {found}; {advice}")

    def at(self, file: str, line: int) -> Problem:
        return Problem(file, line, self.rule, self.found, self.advice)
