# SPDX-License-Identifier: Apache-2.0
"""The document of OpenAPI 3.0 that describes the server's interface: its paths follow from the rows of the routes
(routes.py), their docstrings, and the schemas of what they take and answer. The schemas of requests check them, too.

    object_of("note", name=TEXT, note=TEXT)     # an object with a name, and a note if need be
"""
from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from fledge.ground.server.access import ROLES
from fledge.ground.server.alarms import CONCERNS, SEVERITIES

if TYPE_CHECKING:
    from fledge.ground.server.routes import Row

Schema = dict[str, Any]
DESCRIPTION = """\
Spacecraft, their telemetry, commands, archive and files. Times are nanoseconds in texts of decimal digits, because they
exceed what a number of JavaScript holds; `t_ns` is the spacecraft's clock: UTC since 1970, or simulated time since the
run's start. A request that changes something carries the word `csrf` of /api/session in the header X-Fledge-CSRF, or a
token. `x-role` says which users may ask: those of a role, each, or anyone; `x-craft`, for which spacecraft the role
holds: of the path, or of all that its run flies; `x-logged`, whether the log has it before it is done. The others are
answered with 401 (no user has logged in), 404 (there is no such spacecraft among those that the user may see) or 403.
/api/live is a WebSocket; docs/control-room.md says what goes over it."""


def object_of(optional: str = "", /, closed: bool = False, **properties: Schema) -> Schema:
    """An object. optional: those of its properties that it may lack; closed: it has no others."""
    must = [name for name in properties if name not in optional.split()]
    return {"type": "object", "properties": properties} | ({"required": must} if must else {}) | (
        {"additionalProperties": False} if closed else {})


def ref(name: str) -> Schema:
    """A schema of SCHEMAS."""
    return {"$ref": f"#/components/schemas/{name}"}


def array(items: Schema | str) -> Schema:
    """An array. items: their schema, or its name."""
    return {"type": "array", "items": ref(items) if isinstance(items, str) else items}


def described(schema: Schema, text: str) -> Schema:
    """The schema with a description."""
    return schema | {"description": text}


def nullable(schema: Schema) -> Schema:
    """The schema of a value that may be null."""
    return schema | {"nullable": True}


def enum(*allowed: str) -> Schema:
    """The schema of a text that is one of these."""
    return TEXT | {"enum": list(allowed)}


ANY: Schema = {}
TEXT, FLAG, WHOLE, NUMBER, OBJECT = ({"type": kind} for kind in ("string", "boolean", "integer", "number", "object"))
NATURAL, FROM_ZERO, OFF, EMPTY = (
    WHOLE | {"minimum": 0}, NUMBER | {"minimum": 0}, FLAG | {"default": False}, TEXT | {"default": ""})
RAD, S, M = (described(NUMBER, f"[{unit}]") for unit in ("rad", "s", "m"))
TIME, MAYBE_TIME, BYTES, HEX, KIND, TEXTS, CONCERN, STAGE = map(ref, (
    "Time", "MaybeTime", "Bytes", "Hex", "Kind", "Texts", "Concern", "Stage"))
BAND = array(nullable(NUMBER)) | {"minItems": 2, "maxItems": 2}
LIMITS_OR_NULL = described(nullable(OBJECT) | {"additionalProperties": BAND},
                           "of `replaced`, those of the database if others are in force")
WAY = described(object_of("state lock", rate=NUMBER, state=TEXT, lock=FLAG),
                "what the world's RadioLink and RadioTraffic say, as far as they are known; rate [bit/s]")
BEFORE_NS, LIMIT = described(TIME, "up to this time"), WHOLE | {"minimum": 1, "default": 200}
LIST = object_of("before before_ns limit", before_ns=BEFORE_NS, limit=LIMIT,
                 before=described(WHOLE, "entries that are older than that of this id"))
ID = object_of(id=described(WHOLE, "of the list's entry"))
IDS = object_of(ids=described(array(WHOLE), "of the commands in the list sent"))
PATH = {"c": described(TEXT, "the name of a spacecraft"), "slot": NATURAL, "id": described(TEXT, "of a list's entry"),
        "name": TEXT}       # the parameters of paths

SCHEMAS: dict[str, Schema] = {
    "Error": object_of("argument", error=TEXT, argument=TEXT),
    "Unconfirmed": object_of(
        "hazardous constraint suspendable error", hazardous=TEXT, constraint=TEXT, suspendable=FLAG, error=TEXT),
    "Session": object_of(
        "crafts", closed=True, user=nullable(TEXT), roles=array(enum(*ROLES)), csrf=nullable(TEXT), version=TEXT,
        login=described(FLAG, "whether the server has users"), crafts=nullable(array(TEXT))),
    "Server": object_of(
        limits=array(object_of(
            name=TEXT, most=NUMBER, unit=TEXT, used=nullable(NUMBER), peak=NUMBER, refused=WHOLE, refusal=TEXT)),
        loop=described(
            object_of("longest_ms recent_ms computed_ms", longest_ms=NUMBER, recent_ms=NUMBER, computed_ms=NUMBER),
            "the longest block [ms] since the start, and of the last minute; computed_ms, the longest that its thread "
            "computed at once in the last minute, has no waits for a processor"),
        memory=described(WHOLE, "[bytes]")),
    "Time": described(TEXT | {"pattern": "^-?[0-9]+$"}, "ns"),
    "MaybeTime": nullable(TEXT) | {"pattern": "^(-?[0-9]+)?$"},
    "Question": object_of(
        id=WHOLE, craft=TEXT, text=TEXT, user=TEXT, answer=described(nullable(FLAG), "null: no answer yet"), by=TEXT),
    "Bytes": TEXT | {"format": "binary"}, "Hex": TEXT | {"pattern": "^[0-9a-f]*$"}, "Texts": array(TEXT),
    "Kind": enum("natural", "integer", "real", "boolean", "label", "text", "binary", "time", "duration"),
    "Concern": described(NATURAL | {"maximum": len(CONCERNS) - 1}, ", ".join(CONCERNS)),
    "Stage": enum("released", "transferred", "sent", "received", "delivered", "accepted", "queued", "started",
                  "progress", "completed", "unknown", "failed"),
    "Limits": described(OBJECT | {"additionalProperties": BAND},
                        "a band of each level, beyond which it begins; null where open"),
    "LimitsOrNull": LIMITS_OR_NULL,
    "Craft": object_of(
        "replay stations radios bytes failed problem picture", name=TEXT, mission=TEXT,
        index=described(WHOLE, "its number over the WebSocket"), clock=enum("utc", "simulated"), epoch_ns=MAYBE_TIME,
        simulated=FLAG, replay=described(TEXT, "of which spacecraft"),
        link=object_of("cop1", state=TEXT, cop1=described(
            OBJECT, "state, why it last ended, and the flags of the last CLCW")),
        stations=described(array("Station"), "that its mission has"),
        radios=described(array("Radio"), "of a simulated spacecraft"),
        packets=WHOLE, undecoded=WHOLE, bytes=described(WHOLE, "of packets"), t_ns=TIME,
        failed=described(TEXT, "why the server itself failed at this spacecraft; empty if it works"),
        archive=described(TEXT, "what is wrong with it"), can=TEXTS, problem=TEXT,
        picture=described(FLAG, "whether its mission has one")),
    "Station": object_of(closed=True, name=TEXT, elevation=RAD, mask=RAD, range=M, seen=FLAG, light_time=S),
    "Radio": object_of(closed=True, name=TEXT, station=TEXT, down=WAY, up=WAY,
                       carries=described(FLAG, "the server's packets pass by it")),
    "Pass": object_of(closed=True, station=TEXT, elevation=described(NUMBER, "[rad], the highest"), rise_ns=MAYBE_TIME,
                      highest_ns=TIME, set_ns=MAYBE_TIME),
    "Slot": object_of(
        "container header stale single persistence replaced", slot=WHOLE, name=TEXT, path=TEXT,
        container=nullable(TEXT), header=described(FLAG, "of the packet, or of a message: its head, its padding"),
        stale=described(nullable(NUMBER), "[s], the age of a stale value; null: unknown"), kind=KIND,
        single=described(FLAG, "whether a real has at most 32 bits"), unit=TEXT, labels=TEXTS, description=TEXT,
        limits=ref("Limits"), persistence=WHOLE | {"minimum": 1}, replaced=ref("LimitsOrNull")),
    "Stretch": object_of(
        closed=True, session=WHOLE, first_ns=TIME, last_ns=TIME, packets=WHOLE,
        ended=described(TEXT, "why; empty: it goes on"), gaps=array(array(TEXT) | {"minItems": 3, "maxItems": 3})),
    "Series": described(object_of(
        "text", closed=True, t_ns=array("Time"), value=array({"nullable": True, "description": "a number or a text"}),
        text=described(array(nullable(TEXT)), "the words of labels, times [s] since 1970 UTC and durations [s] with "
                       "all digits, and integers if one of them is beyond 2^53"),
        concern=described(array(WHOLE), "of the value, 0..5, by the limits in force"),
        worst=described(array(WHOLE), "the worst concern of its stretch"),
        low=array(nullable(NUMBER)), high=array(nullable(NUMBER))),
        "`value` has integers with all digits, raw values of labels, seconds of times, texts, and bytes in hex; null "
        "where there is none. `low` and `high` are empty for texts and bytes."),
    "Packet": object_of(
        closed=True, id=TEXT, t_ns=TIME, received_ns=TIME, container=nullable(TEXT), size=WHOLE,
        reason=described(TEXT, "why it was not decoded"), hex=HEX),
    "Inspection": object_of(
        "id t_ns received_ns", container=nullable(TEXT), nearest=nullable(TEXT), reason=TEXT,
        bit=described(nullable(WHOLE), "where decoding stopped"), rows=described(
            array(array(ANY) | {"minItems": 6, "maxItems": 6}), "name, raw value, value, status, first bit, bits"),
        hex=TEXT, size=WHOLE, id=TEXT, t_ns=TIME, received_ns=TIME),
    "Form": object_of(
        "path verifiers", name=TEXT, path=TEXT, group=TEXT, description=TEXT,
        hazardous=described(TEXT, "why; empty: it is not"),
        constraints=described(array(TEXT), "what must hold before it leaves"),
        arguments=array("Argument"), verifiers=array("Verifier")),
    "Argument": object_of(
        name=TEXT, type=KIND, unit=TEXT, low=nullable(ANY), high=nullable(ANY), labels=TEXTS, initial=nullable(ANY),
        description=TEXT, size=described(nullable(WHOLE), "bits; of text and binary: bytes at most")),
    "Verifier": object_of(
        stage=STAGE, text=described(TEXT, "what must hold"), start=S,
        stop=described(nullable(NUMBER), "[s]; null: the database has no window"),
        from_release=described(FLAG, "false: the window is from the last verifier that passed on"),
        percent=nullable(NUMBER), own=described(FLAG, "it compares arguments of the command"),
        problem=described(TEXT, "why it is not watched; empty: it is")),
    "Preview": object_of(hex=HEX, fields=array(object_of(name=ANY, value=ANY, raw=ANY, unit=ANY, bit=WHOLE, bits=WHOLE,
                                                         argument=FLAG))),
    "Sent": object_of(
        "craft data hazardous open", id=WHOLE, craft=TEXT, t_ns=TIME, user=TEXT, name=TEXT, arguments=OBJECT, hex=TEXT,
        data=TEXT, hazardous=described(TEXT, "why; absent if it is not"),
        open=described(OBJECT, "what a server that starts waits for; absent when no more will be known"),
        stages=array(object_of("percent", stage=STAGE, t_ns=TIME, good=nullable(FLAG), text=TEXT, percent=NUMBER))),
    "Event": object_of("craft received_ns", id=WHOLE, craft=TEXT, t_ns=TIME, received_ns=TIME,
                       severity=enum(*SEVERITIES), source=TEXT, text=TEXT),
    "Alarm": object_of(
        "id craft t_ns ended_ns", id=WHOLE, craft=TEXT, slot=nullable(WHOLE), name=TEXT, concern=CONCERN, worst=CONCERN,
        since_ns=TIME, t_ns=TIME, acknowledged=ANY, shelved_until_ns=MAYBE_TIME, ended_ns=MAYBE_TIME),
    "Transfer": object_of(
        "craft", id=WHOLE, craft=TEXT, up=FLAG, name=described(TEXT, "on board"), done=WHOLE, size=WHOLE,
        state=enum("active", "suspended", "completed", "failed", "cancelled"), text=described(TEXT, "why"), t_ns=TIME),
    "Field": object_of(closed=True, name=TEXT, type=TEXT, unit=TEXT, shape=array(WHOLE), meaning=TEXT, rule=TEXT,
                       enumerators=OBJECT | {"additionalProperties": WHOLE}, fields=array("Field")),
    "Table": object_of(name=TEXT, meaning=TEXT, fields=array("Field"), values=nullable(OBJECT), read_ns=MAYBE_TIME),
    "Stored": object_of(
        list=described(WHOLE, "0 has absolute times"), state=TEXT, t_ns=MAYBE_TIME, read_ns=MAYBE_TIME,
        commands=array(object_of(step=ANY, time_ns=ANY, due_ns=ANY, size=ANY, crc=ANY, code=ANY, name=ANY))),
    "Run": object_of(
        "rewinds", closed=True, t_ns=TIME, state=enum("running", "paused", "ended"),
        speed=described(NUMBER, "times real time; 0: as fast as possible"), real_speed=nullable(NUMBER), text=TEXT,
        rewinds=described(FLAG, "it can go back to an earlier instant"), faults=array(object_of(
            "example", closed=True, path=TEXT, value=ANY, unit=TEXT, meaning=TEXT,
            example={"description": "a value, of lists of faults"}))),
    "Display": object_of(name=TEXT, title=TEXT, problems=TEXTS, panels=array(object_of(kind=ANY, title=ANY))),
    "Entry": object_of(closed=True, id=WHOLE, time_ns=TIME, user=TEXT, craft=nullable(TEXT), action=TEXT, text=TEXT,
                       good=FLAG)}


def content(kind: Schema | str) -> dict[str, Any]:
    """The content of a request or an answer. kind: its schema in JSON, or its name; or schemas by types of media."""
    schema = ref(kind) if isinstance(kind, str) else kind
    media = schema if all("/" in key for key in schema) else {"application/json": schema}
    return {name: {"schema": of} for name, of in media.items()}


def document(rows: Iterable[Row]) -> dict[str, Any]:
    """The document, with an operation for each row of a path below /api/."""
    paths: dict[str, Any] = {}
    for row in rows:
        if not row.path.startswith("/api/") or row.path == "/api/live":     # which becomes a WebSocket
            continue
        parameters = [(name, "path", True, PATH[name]) for name in re.findall(r"{(\w+)}", row.path)] + [
            (name, "query", name in row.query.get("required", ()), schema)
            for name, schema in row.query.get("properties", {}).items()]
        refusals = {"default": {"description": "why not", "content": content("Error")}}
        if "confirmed" in row.takes.get("properties", {}):
            refusals["409"] = {"description": "it is hazardous and was not confirmed; or a constraint does not hold or "
                               "cannot be judged", "content": content("Unconfirmed")}
        paths.setdefault(row.path, {})[row.method.lower()] = {
            "summary": row.summary, "x-role": row.role, **({"x-craft": row.craft} if row.craft else {}),
            "x-logged": row.logged, **({"security": []} if row.role == "anyone" else {}),
            "parameters": [{    # a reference has no description of its own
                "name": name, "in": place, "required": required,
                "schema": {key: value for key, value in schema.items() if key != "description"},
                **{key: value for key, value in schema.items() if key == "description"}}
                for name, place, required, schema in parameters],
            **({"requestBody": {"required": True, "content": content(row.takes)}} if row.takes else {}),
            "responses": {"200": {"description": "done", "content": content(row.answers)}} | refusals}
    return {"openapi": "3.0.3", "security": [{}, {"token": []}], "paths": paths,
            "info": {"title": "Fledge's control room", "version": "1", "license": {"name": "Apache-2.0"},
                     "description": DESCRIPTION},
            "components": {"securitySchemes": {"token": {"type": "http", "scheme": "bearer"}}, "schemas": SCHEMAS}}
