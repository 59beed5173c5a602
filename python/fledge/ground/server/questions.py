# SPDX-License-Identifier: Apache-2.0
"""What scripts ask the operators of the console. A question stays until an operator has answered, or its script does
not poll the answer any more."""
from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count
from typing import Any

from fledge.errors import SetupError

MOST = 50           # open questions
LONGEST = 1000      # characters of one
POLLED = 30.0       # [s] since its script polled, after which a question is withdrawn


class Questions:
    """Of all spacecraft. publish: sends browsers a question that is new, answered or withdrawn."""

    def __init__(self, publish: Callable[[str, str, dict[str, Any]], None]) -> None:
        self._publish = publish
        self._numbers = count(1)
        self._all: dict[int, tuple[dict[str, Any], float]] = {}     # and when its script has polled

    def ask(self, craft: str, user: str, text: str) -> dict[str, Any]:
        """Raises SetupError."""
        self._withdraw()
        if not 0 < len(text) <= LONGEST:
            raise SetupError(f"a question has 1 to {LONGEST} characters; found {len(text)}")
        if sum(question["answer"] is None for question, _ in self._all.values()) >= MOST:
            raise SetupError(f"{MOST} questions are open already: answer one")
        number = next(self._numbers)
        question = {"id": number, "craft": craft, "text": text, "user": user, "answer": None, "by": ""}
        self._all[number] = question, time.monotonic()
        self._publish("question", craft, question)
        return question

    def open(self, craft: str) -> list[dict[str, Any]]:
        """The questions that wait for an answer."""
        self._withdraw()
        return [question for question, _ in self._all.values()
                if question["craft"] == craft and question["answer"] is None]

    def poll(self, craft: str, number: int) -> dict[str, Any]:
        """One question, for its script. Raises SetupError if it is gone."""
        question = self._of(craft, number)
        if question["answer"] is None:
            self._all[number] = question, time.monotonic()
        return question

    def answer(self, craft: str, number: int, user: str, answer: bool) -> dict[str, Any]:
        """Raises SetupError if it is gone, or if it was answered."""
        question = self._of(craft, number)
        if question["answer"] is not None:
            raise SetupError(f"{question['by']} has answered already")
        question |= {"answer": answer, "by": user}
        self._publish("question", craft, question)
        return question

    def _of(self, craft: str, number: int) -> dict[str, Any]:
        self._withdraw()
        question, _ = self._all.get(number, ({"craft": ""}, 0.0))
        if question["craft"] != craft:
            raise SetupError(f"there is no question {number}: it was answered, or its script has ended")
        return question

    def _withdraw(self) -> None:
        for number, (question, polled) in list(self._all.items()):
            if time.monotonic() - polled > POLLED:
                del self._all[number]
                if question["answer"] is None:
                    self._publish("question", question["craft"], question | {"answer": False, "by": "its script's end"})
