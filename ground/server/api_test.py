# SPDX-License-Identifier: Apache-2.0
"""The document of the interface is what OpenAPI 3.0 asks for, and a server in a flight answers as it describes."""
import asyncio
import base64
import copy
import json
import re
import struct

import pytest
import yaml
from aiohttp import WSMsgType
from jsonschema import Draft4Validator

from fledge.ground.server.attacked_test import ROWS
from fledge.ground.server.openapi import document
from fledge.ground.server.web_test import console, flown
from tests.needs import needs
from tests.tree import ROOT

API = document(ROWS)
METHODS = ("get", "put", "post", "delete")
CRAFT = '[[craft]]\nname = "imager"\nmission = "earth_imager"\nspeed = 20\n'


# --- the rules of OpenAPI 3.0.3, as far as the document uses them ---------------------------------------------------

def thing(_must="", _known="", **properties):
    """An object with these fields alone; of those that are only known, the values are free."""
    schema = {"type": "object", "properties": {**{name: {} for name in _known.split()}, **properties},
              "additionalProperties": False}
    return {**schema, "required": _must.split()} if _must else schema


def many(kind, **more):
    return {"type": "object", "additionalProperties": {"$ref": f"#/definitions/{kind}"}, **more}


def either(kind):
    return {"oneOf": [{"$ref": "#/definitions/reference"}, {"$ref": f"#/definitions/{kind}"}]}


TEXT, FLAG, SIZE = {"type": "string"}, {"type": "boolean"}, {"type": "integer", "minimum": 0}
RULES = {
    "definitions": {
        "reference": thing("$ref", **{"$ref": {"type": "string", "pattern": "^#/components/"}}),
        "schemaOrReference": either("schema"),
        "schema": {**thing(
            "", "default enum minimum maximum",
            type={"enum": ["object", "array", "string", "number", "integer", "boolean"]},
            properties=many("schemaOrReference"), required={
                "type": "array", "minItems": 1, "items": TEXT, "uniqueItems": True},
            additionalProperties={"anyOf": [FLAG, {"$ref": "#/definitions/schemaOrReference"}]},
            items={"$ref": "#/definitions/schemaOrReference"}, nullable=FLAG, description=TEXT, format=TEXT,
            pattern={"type": "string", "format": "regex"}, minItems=SIZE, maxItems=SIZE),
            "dependencies": {"items": ["type"], "properties": ["type"], "minItems": ["items"]}},
        "media": thing("schema", schema={"$ref": "#/definitions/schemaOrReference"}),
        "response": thing("description", description=TEXT, content=many("media")),
        "body": thing("content", required=FLAG, description=TEXT, content=many("media", minProperties=1)),
        "parameter": {**thing("name in schema", name=TEXT, description=TEXT, required=FLAG, schema={
            "$ref": "#/definitions/schemaOrReference"}, **{"in": {"enum": ["path", "query"]}}),
            "anyOf": [{"properties": {"in": {"enum": ["query"]}}},
                      {"required": ["required"], "properties": {"required": {"enum": [True]}}}]},
        "operation": thing("summary responses", summary={"type": "string", "minLength": 1},
                           requestBody={"$ref": "#/definitions/body"},
                           parameters={"type": "array", "items": {"$ref": "#/definitions/parameter"}},
                           security={"type": "array"}, **{"x-role": TEXT, "x-craft": TEXT, "x-logged": FLAG},
                           responses={"type": "object", "minProperties": 1, "additionalProperties": False,
                                      "patternProperties": {"^([1-5][0-9][0-9]|default)$": {
                                          "$ref": "#/definitions/response"}}}),
        "path": thing(**{method: {"$ref": "#/definitions/operation"} for method in METHODS}),
        "scheme": thing("type", "scheme", type={"enum": ["http", "apiKey", "oauth2", "openIdConnect"]})},
    **thing("openapi info paths",
            openapi={"type": "string", "pattern": r"^3\.0\.\d$"},
            info=thing("title version", title=TEXT, version=TEXT, description=TEXT, license=thing("name", name=TEXT)),
            security={"type": "array", "items": {"type": "object"}},
            paths={"type": "object", "additionalProperties": False, "patternProperties": {
                "^/": {"$ref": "#/definitions/path"}}},
            components=thing(schemas=many("schemaOrReference"), securitySchemes=many("scheme")))}


def complaints(document):
    """What is wrong with a document of OpenAPI: its form, references that lead nowhere, parts that nothing uses, words
    of a path without a parameter, required properties that are not there."""
    problems = [f"{'/'.join(map(str, error.absolute_path))}: {error.message[:200]}"
                for error in Draft4Validator(RULES).iter_errors(document)]
    used = set()

    def walk(part):
        if isinstance(part, dict):
            if isinstance(ref := part.get("$ref"), str):
                used.add(ref)
                if resolved(document, ref) is None:
                    problems.append(f"{ref} leads nowhere")
            elif part.get("type") == "object" and isinstance(part.get("required"), list) and \
                    part.get("additionalProperties") is False:
                problems.extend(f"{key} is required and no property" for key in part["required"]
                                if key not in part["properties"])
            for value in part.values():
                walk(value)
        elif isinstance(part, list):
            for value in part:
                walk(value)

    walk(document)
    problems += [f"schemas/{name} is not used" for name in document.get("components", {}).get("schemas", {})
                 if f"#/components/schemas/{name}" not in used]
    for path, item in document.get("paths", {}).items():
        for method in METHODS:
            if method in item:
                names = [row.get("name") for row in item[method].get("parameters", []) if row.get("in") == "path"]
                if sorted(names) != sorted(re.findall(r"{(\w+)}", path)):
                    problems.append(f"{path} has the parameters {names}")
    return problems


def resolved(document, ref):
    for word in ref.split("/")[1:]:
        document = document.get(word) if isinstance(document, dict) else None
    return document


def as_json_schema(part):
    """A schema of OpenAPI 3.0 as one of JSON Schema: the same but for `nullable`."""
    if isinstance(part, list):
        return [as_json_schema(item) for item in part]
    if not isinstance(part, dict):
        return part
    schema = {key: as_json_schema(item) for key, item in part.items() if key != "nullable"}
    return {"anyOf": [schema, {"type": "null"}]} if part.get("nullable") is True else schema


SCHEMAS = as_json_schema(API["components"])


def conforms(path, method, status, content, kind="application/json"):
    """An answer is as the document describes it."""
    responses = API["paths"][path][method]["responses"]
    response = responses.get(str(status)) or responses["default"]
    assert kind in response["content"], f"{path} answers {kind}"
    schema = {**as_json_schema(response["content"][kind]["schema"]), "components": SCHEMAS}
    wrong = [f"{path} {'/'.join(map(str, error.absolute_path))}: {error.message[:300]}"
             for error in Draft4Validator(schema).iter_errors(content)]
    assert not wrong, wrong[:5]


def test_the_document_is_valid():
    assert complaints(API) == []


def test_an_operation_has_the_role_that_its_row_demands():
    run, login = API["paths"]["/api/crafts/{c}/run"]["post"], API["paths"]["/api/login"]["post"]
    assert [run["x-role"], run["x-craft"], run["x-logged"], "security" in run] == ["command", "run", True, False]
    assert [login["x-role"], login["x-logged"], login["security"], "x-craft" in login] == ["anyone", False, [], False]


@pytest.mark.parametrize("change, says", [
    (lambda api: api.pop("info"), "'info' is a required property"),
    (lambda api: api.update(openapi="2.0"), "does not match"),
    (lambda api: api["paths"].update({"api": {}}), "does not match any"),
    (lambda api: api["paths"]["/api/crafts"]["get"].pop("responses"), "'responses'"),
    (lambda api: api["paths"]["/api/crafts"]["get"]["responses"].update(ok={}), "ok"),
    (lambda api: api["components"]["schemas"].pop("Slot"), "schemas/Slot leads nowhere"),
    (lambda api: api["components"]["schemas"].update(New={"type": "object"}), "New is not used"),
    (lambda api: api["paths"]["/api/crafts/{c}/slots"]["get"]["parameters"][0].pop("required"),
     "is not valid under any"),
    (lambda api: api["paths"].update({"/api/x/{y}": {"get": {"summary": "", "responses": {
        "200": {"description": ""}}}}}), "/api/x/{y} has the parameters []"),
    (lambda api: api["components"]["schemas"]["Time"].update(type="text"), "is not valid under any"),
    (lambda api: api["components"]["schemas"]["Run"]["required"].append("x"), "x is required and no property")])
def test_the_validator_finds_what_is_wrong(change, says):
    broken = copy.deepcopy(API)
    change(broken)
    assert says in "\n".join(complaints(broken))


@flown
async def test_a_server_in_flight_answers_as_it_is_described(tmp_path):
    """All GETs, with what they list in paths; each route of a spacecraft that is not there."""
    async with console(tmp_path, CRAFT) as c:
        await c.verified("imager", "flight.noop", {})
        await c.post("crafts/imager/preview", {"name": "flight.noop", "arguments": {}})
        await c.post("crafts/imager/run", {"action": "pause"})
        packets = await c.get("crafts/imager/packets?limit=1")
        words = {"c": "imager", "id": packets[0]["id"] if packets else "", "name": "nothing"}
        responses = set()
        for path, item in API["paths"].items():
            if "get" not in item:
                continue
            query = {"/api/crafts/{c}/history": "?names=flight.tracking.error.sigma_BR[0]"}.get(path, "")
            for craft in ("imager", "ghost"):
                response = await c.client.get(path.format(**{**words, "c": craft}) + query)
                if response.content_type == "application/json":
                    content = json.loads(await response.text(), parse_constant=lambda word: pytest.fail(word))
                else:
                    content = await response.text(errors="replace")
                if "{c}" in path and craft == "ghost":
                    assert response.status == 404, path
                responses.add((path, response.status))
                if response.content_type != "application/octet-stream":
                    conforms(path, "get", response.status, content,
                             "application/yaml" if path.endswith("yaml") else response.content_type)
        good = {path for path, status in responses if status == 200}
        assert {path for path, item in API["paths"].items() if "get" in item} - good <= {
            "/api/crafts/{c}/files/{name}", "/api/crafts/{c}/scene", "/api/crafts/{c}/questions/{id}"}
        served = yaml.safe_load(await c.get("openapi.yaml"))
        assert complaints(served) == []
        assert served == API
        for path, body, method in (
                ("preview", {"name": "flight.noop"}, "post"), ("send", {"name": "flight.noop"}, "post"),
                ("send", {"name": "flight.reset_flight"}, "post"), ("inspect", {"hex": "08"}, "post"),
                ("run", {"action": "go"}, "post"), ("tables/flight.steering", {"read": True}, "post"),
                ("limits/0", {"limits": {"warning": [None, 3]}}, "put"), ("alarms/0", {"acknowledge": True}, "post"),
                ("transfers/1", {"action": "cancel"}, "post"), ("fetch", {"name": "x"}, "post"),
                ("stored", {"list": 0, "action": "report"}, "post"), ("questions", {"text": "go?"}, "post"),
                ("questions/1", {"answer": True}, "post")):
            response = await getattr(c.client, method)(f"/api/crafts/imager/{path}", json=body,
                                                       headers={"X-Fledge-CSRF": c.csrf})
            described = next(key for key in API["paths"] if re.fullmatch(
                re.sub(r"{\w+}", "[^/]+", key), f"/api/crafts/imager/{path}") and method in API["paths"][key])
            conforms(described, method, response.status, await response.json())


# --- Open MCT, by the plugin of the document -------------------------------------------------------------------------

STAND_IN = """
import {readFileSync} from "node:fs";
const [, , origin, frame, name] = process.argv;
globalThis.location = {origin};
const ask = globalThis.fetch;
globalThis.fetch = (path) => ask(origin + path);
const sent = [];
globalThis.WebSocket = class {
    constructor(url) {
        sent.push(url);
        setTimeout(() => {
            this.onopen();
            const data = Buffer.from(frame, "base64");
            this.onmessage({data: data.buffer.slice(data.byteOffset, data.byteOffset + data.length)});
        }, 0);
    }
    send(text) { sent.push(text); }
    close() { sent.push("closed"); }
};
const has = {};
const plugin = (await import("./plugin.mjs")).default;
await plugin("imager")({
    types: {addType: () => {}},
    objects: {addRoot: (one) => { has.root = one; }, addProvider: (_, one) => { has.objects = one; }},
    composition: {addProvider: (one) => { has.composition = one; }},
    telemetry: {addProvider: (one) => { has.telemetry = one; }}});
const folder = await has.objects.get(has.root);
const keys = await has.composition.load(folder);
const parameter = await has.objects.get(keys.find((one) => one.key === name));
const history = await has.telemetry.request(parameter, {start: 0, end: 1e9, size: 50});
const live = [];
const end = has.telemetry.subscribe(parameter, (one) => live.push(one));
await new Promise((done) => setTimeout(done, 50));
end();
console.log(JSON.stringify({keys: keys.length, parameter, history, live, sent}));
"""


@pytest.mark.long("node beside a server")
@needs("nodejs")
@flown
async def test_the_plugin_for_open_mct_asks_a_flying_server_and_reads_its_frames(tmp_path):
    """Where Open MCT would call it, a few lines do; it asks the server, and the frame is one of the server's."""
    text = (ROOT / "docs/control-room.md").read_text(encoding="utf-8")
    (tmp_path / "plugin.mjs").write_text(text.partition("```js\n")[2].partition("```")[0])
    (tmp_path / "run.mjs").write_text(STAND_IN)
    name = "flight.tracking.error.sigma_BR[1]"
    async with console(tmp_path, CRAFT) as c:
        await c.until("crafts", lambda output: int(output[0]["t_ns"]) > 60 * 10**9)
        await c.post("crafts/imager/run", {"action": "pause"})
        slot = next(row for row in await c.get("crafts/imager/slots") if row["name"] == name)
        live = await c.client.ws_connect("/api/live")
        await live.send_json({"subscribe": {"craft": "imager", "slots": [slot["slot"]], "hz": 10}})
        while (message := await live.receive()).type != WSMsgType.BINARY:
            pass
        node = await asyncio.create_subprocess_exec(
            "node", tmp_path / "run.mjs", f"http://{c.client.host}:{c.client.port}",
            base64.b64encode(message.data).decode(), name, stdout=asyncio.subprocess.PIPE)
        output = json.loads((await node.communicate())[0])
        expected = (await c.get(f"crafts/imager/history?names={name}&points=50"))[name]
    assert output["keys"] > 100 and output["parameter"]["telemetry"]["values"][1]["unit"] == slot["unit"]
    assert [row["value"] for row in output["history"]] == expected["value"] and len(expected["value"]) > 10
    assert [row["timestamp"] for row in output["history"]] == [int(t) // 10**6 for t in expected["t_ns"]]
    t, value = struct.unpack_from("<qd", message.data, 32 + 8)
    assert output["live"] == [{"timestamp": t // 10**6, "value": value}]
    assert re.fullmatch("ws://.*/api/live", output["sent"][0]) and output["sent"][2] == "closed"
    assert json.loads(output["sent"][1]) == {"subscribe": {"craft": "imager", "slots": [slot["slot"]], "hz": 10}}
