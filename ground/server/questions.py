# SPDX-License-Identifier: Apache-2.0
"""What scripts ask the operators of the console. A question stays until an operator has answered, or its script does
not poll the answer any more."""
from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count
from typing import TypedDict

from fledge.errors import SetupError

MOST = 50           # open questions
LONGEST = 1000      # characters of one
POLLED = 30.0       # [s] since its script polled, after which a question is withdrawn


class Question(TypedDict):
    """answer: None while there is none; by: the operator."""
    id: int
    craft: str
    text: str
    user: str
    answer: bool | None
    by: str


class Questions:
    """Of all spacecraft. publish: sends browsers a question that is new, answered or withdrawn."""

    def __init__(self, publish: Callable[[str, str, Question], None]) -> None:
        self._publish = publish
        self._numbers = count(1)
        self._all: dict[int, tuple[Question, float]] = {}     # and when its script has polled

    def ask(self, craft: str, user: str, text: str) -> Question:
        """Raises SetupError."""
        self._withdraw()
        if not 0 < len(text) <= LONGEST:
            raise SetupError(f"a question has 1 to {LONGEST} characters; found {len(text)}")
        if sum(question["answer"] is None for question, _ in self._all.values()) >= MOST:
            raise SetupError(f"{MOST} questions are open already: answer one")
        number = next(self._numbers)
        question: Question = {"id": number, "craft": craft, "text": text, "user": user, "answer": None, "by": ""}
        self._all[number] = question, time.monotonic()
        self._publish("question", craft, question)
        return question

    def open(self, craft: str) -> list[Question]:
        """The questions that wait for an answer."""
        self._withdraw()
        return [question for question, _ in self._all.values()
                if question["craft"] == craft and question["answer"] is None]

    def poll(self, craft: str, number: int) -> Question:
        """One question, for its script. Raises SetupError if it is gone."""
        question = self._of(craft, number)
        if question["answer"] is None:
            self._all[number] = question, time.monotonic()
        return question

    def answer(self, craft: str, number: int, user: str, answer: bool) -> Question:
        """Raises SetupError if it is gone, or if it was answered."""
        question = self._of(craft, number)
        if question["answer"] is not None:
            raise SetupError(f"{question['by']} has answered already")
        question["answer"], question["by"] = answer, user
        self._publish("question", craft, question)
        return question

    def _of(self, craft: str, number: int) -> Question:
        self._withdraw()
        if number not in self._all or self._all[number][0]["craft"] != craft:
            raise SetupError(f"there is no question {number}: it was answered, or its script has ended")
        return self._all[number][0]

    def _withdraw(self) -> None:
        for number, (question, polled) in list(self._all.items()):
            if time.monotonic() - polled > POLLED:
                del self._all[number]
                if question["answer"] is None:
                    question["answer"], question["by"] = False, "its script's end"
                    self._publish("question", question["craft"], question)
