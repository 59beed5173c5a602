# SPDX-License-Identifier: Apache-2.0
"""The folders for ground stations have the words that the documents of Yamcs 5.13 and COSMOS 7 have, and no other."""
import re
import shlex

import pytest
import yaml

from fledge import cli

# COSMOS: what each word belongs to, and what stands behind it; what begins with ? may be left out.
NUMBER, NAME, TYPE, ORDER = r"\d+", r"\D\S*", "(U?INT|FLOAT|STRING|BLOCK|DERIVED)", "(BIG|LITTLE)_ENDIAN"
COSMOS = {
    "VARIABLE": ("", ["[a-z_]+", ".+"]), "TARGET": ("", [NAME, NAME]),
    "INTERFACE": ("", [NAME, r"udp_interface\.rb", ".+", NUMBER, NUMBER]), "MAP_TARGET": ("INTERFACE", [NAME]),
    "PROTOCOL": ("INTERFACE", ["(READ|WRITE|READ_WRITE)", r"\S+\.rb", NUMBER, "(big|little)"]),
    "PORT": ("INTERFACE", [r"\d+(/(tcp|udp))?"]),
    "LANGUAGE": ("", ["(ruby|python)"]), "IGNORE_PARAMETER": ("", [NAME]), "IGNORE_ITEM": ("", [NAME]),
    "TELEMETRY": ("", [NAME, NAME, ORDER, "?.*"]),
    "APPEND_ITEM": ("TELEMETRY", [NAME, NUMBER, TYPE, "?.*", f"?{ORDER}"]),
    "APPEND_ID_ITEM": ("TELEMETRY", [NAME, NUMBER, TYPE, NUMBER, "?.*", f"?{ORDER}"]),
    "STATE": ("APPEND_ITEM", [".+", NUMBER]), "SELECT_COMMAND": ("", [NAME, NAME]),
    "PARAMETER": ("SELECT_COMMAND", [NAME, r"-?\d+", NUMBER, "(STRING|BLOCK)", ".*", "?.*"]),
    "HAZARDOUS": ("SELECT_COMMAND", ["?.*"])}

# Yamcs: the keys of each kind of link, those that it must have first
LINK = {"name", "class", "stream", "port"}
YAMCS = {"org.yamcs.tctm.UdpTmDataLink": (LINK, {
    "maxLength", "packetPreprocessorClassName", "packetPreprocessorArgs", "enabledAtStartup", "invalidPackets",
    "invalidPacketsStream"}),
    "org.yamcs.tctm.UdpTcDataLink": (LINK | {"host"}, {
        "tcQueueSize", "tcMaxRate", "commandPostprocessorClassName", "commandPostprocessorArgs", "enabledAtStartup"})}


@pytest.fixture(scope="module", params=["earth_imager", "formation", "nadir_spin"])
def folder(request, tmp_path_factory):
    out = tmp_path_factory.mktemp(request.param)
    assert cli.main(["export", "xtce", request.param, "--yamcs", "--cosmos", "--out", str(out)]) == 0
    return out


def complaints(text, variables):
    """What COSMOS would not know in a file of its words."""
    top = item = ""
    for number, line in enumerate(text.splitlines(), 1):
        line = re.sub("<%= *(\\w+) *%>", lambda match: variables[match[1]], line)
        if not line.strip() or line.startswith("#"):
            continue
        word, *given = shlex.split(line)
        of, patterns = COSMOS.get(word, (None, []))
        least = sum(not pattern.startswith("?") for pattern in patterns)
        if of is None:
            yield f"{number}: {word} is no word"
        elif of not in ("", top, item):
            yield f"{number}: {word} follows {top}"
        elif not least <= len(given) <= len(patterns) or not all(
                re.fullmatch(pattern.lstrip("?"), text) for pattern, text in zip(patterns, given)):
            yield f"{number}: {line.strip()}"
        if of == "":
            top, item = word, ""
        elif word.startswith("APPEND"):
            item = word


def test_cosmos_knows_each_word(folder):
    plugin = (folder / "cosmos/plugin.txt").read_text()
    variables = dict(re.findall(r"^VARIABLE (\w+) (\S+)$", plugin, re.MULTILINE))
    files = [path for path in (folder / "cosmos").rglob("*.txt")]
    assert len(files) >= 4
    for file in files:
        assert list(complaints(file.read_text(), variables)) == [], file
    targets = re.findall(r"^TARGET (\S+) ", plugin, re.MULTILINE)
    assert sorted(path.name for path in (folder / "cosmos/targets").iterdir()) == sorted(targets)
    wrong = "TARGETS A A\nTARGET A\n  PORT 1\nTELEMETRY T P BIG_ENDIAN\n  APPEND_ITEM 3X 8 UINT"
    assert list(complaints(wrong, {})) == [
        "1: TARGETS is no word", "2: TARGET A", "3: PORT follows TARGET", "5: APPEND_ITEM 3X 8 UINT"]


def test_yamcs_knows_each_key(folder):
    instance = yaml.safe_load((folder / "yamcs/etc/yamcs.yaml").read_text())["instances"]
    assert [path.name for path in (folder / "yamcs/etc").iterdir() if path.name != "yamcs.yaml"] == [
        f"yamcs.{name}.yaml" for name in instance]
    settings = yaml.safe_load((folder / f"yamcs/etc/yamcs.{instance[0]}.yaml").read_text())
    assert set(settings) == {"services", "dataLinks", "mdb", "streamConfig"}
    ports, streams = [], {"tm": [], "tc": []}
    for link in settings["dataLinks"]:
        must, may = YAMCS[link["class"]]
        assert must <= set(link) <= must | may
        ports.append(link["port"])
        streams["tm" if "Tm" in link["class"] else "tc"].append(link["stream"])
    assert len(set(ports)) == len(ports)
    for kind in streams:
        assert sorted(link["name"] for link in settings["streamConfig"][kind]) == sorted(streams[kind])
        assert {stream["processor"] for stream in settings["streamConfig"][kind]} == {"realtime"}
    assert all((folder / "yamcs" / file["spec"]).is_file() and file["type"] == "xtce" for file in settings["mdb"])
