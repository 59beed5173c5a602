# SPDX-License-Identifier: Apache-2.0
"""Each flight service has a page beside its header, whose ports, events and commands are those of the headers."""

import re
from functools import cache

import pytest

from introspect.model import Group, Kind, Struct
from introspect.reader import read
from introspect.sources import Source
from tests.tree import ROOT

FOLDER = ROOT / "flight/services"
HEADINGS = ["Ports", "States", "Commands", "Events", "Limits", "Failures"]


@cache
def model():
    return read([Source(ROOT, "flight", Kind.MODULE, "flight")])


SERVICES = sorted((struct for struct in model().structs.values() if struct.service), key=lambda service: service.name)


def chapter(text: str, heading: str) -> str:
    """The text below a heading."""
    return re.split(r"^## ", text, flags=re.M)[1 + titles(text).index(heading)]


def titles(text: str) -> list[str]:
    return re.findall(r"^## (.+)$", text, re.M)


def rows(text: str) -> list[list[str]]:
    """The rows of the tables in a chapter, without their heads."""
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in text.split("\n")
            if line.startswith("|") and not re.match(r"\|(-|[a-z ]+\|[a-z ]+\|)", line)]


def ports(service: Struct) -> list[tuple[str, str]]:
    return [(f"{field.group.value} `{field.name}", field.ctype) for field in service.fields
            if field.group in (Group.IN, Group.OUT)]


@pytest.mark.parametrize("service", SERVICES, ids=lambda service: service.name)
def test_the_page_of_a_service_says_what_its_header_says(service):
    text = (FOLDER / f"{service.snake_name}.md").read_text(encoding="utf-8")
    assert text.startswith(f"# {service.name}\n") and f"]({service.snake_name}.h)" in text
    assert [title for title in titles(text) if title in HEADINGS] == HEADINGS
    assert [(port, message) for port, message, _ in rows(chapter(text, "Ports"))] == ports(service)
    assert re.search(r"^```\n.*?^```$", chapter(text, "States"), re.M | re.S), "a diagram of the states"
    events = [(event.value, name, event.doc.partition(",")[0])
              for event, name in zip(service.events.values, service.events.short_names)] if service.events else []
    assert [(int(id), name, severity) for id, name, severity, _ in rows(chapter(text, "Events"))] == events
    codes = {value.value for value in model().enums["CommandCode"].values}
    assert {int(code) for code, *_ in rows(chapter(text, "Commands"))} <= codes


def test_the_document_of_services_names_each_page():
    assert len(SERVICES) > 5
    text = (ROOT / "docs/services.md").read_text(encoding="utf-8")
    pages = sorted(re.findall(r"^\| \[`(\w+)`\]\(\.\./flight/services/(\w+)\.md\)", text, re.M))
    assert pages == [(service.name, service.snake_name) for service in SERVICES]
    assert sorted(path.stem for path in FOLDER.glob("*.md")) == sorted(service.snake_name for service in SERVICES)
