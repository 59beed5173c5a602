# SPDX-License-Identifier: Apache-2.0
"""The scene in a record, decoded by the definitions in the file itself."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import SetupError, cli, scene
from fledge.archive import mcap
from fledge.archive.compare import digest
from fledge.attitude import mrp_to_dcm
from fledge.scene import foxglove, tracks
from fledge.scene.scene import Part
from fledge.units import s

SIZES = {"bool": "?", "uint8": "B", "int32": "i", "uint32": "I", "float64": "d"}


class Reader:
    """Messages of a topic as dicts, by the text of its definition and the rules of CDR."""

    def __init__(self, path, topic):
        with fledge.Archive(path) as archive:
            channel = archive.topics[topic]
            raw, data = channel._raw, bytes(archive._data)
            name, *parts = re.split(r"\n={80}\nMSG: (\S+)\n", channel.schema_text)
            self.types = {"": name} | dict(zip(parts[::2], parts[1::2]))
            self.name, self.messages = channel.schema, []
            assert (raw.schema_encoding, raw.encoding) == ("ros2msg", "cdr")
        for at in raw.offsets:
            length, = struct.unpack_from("<Q", data, at + 1)
            self.bytes, self.at = data[at + mcap.PAYLOAD_AT:at + 9 + length], 0
            assert data[at + mcap.CDR_AT:at + mcap.PAYLOAD_AT] == b"\0\1\0\0"
            time, = struct.unpack_from("<Q", data, at + mcap.TIME_AT)
            self.messages.append((time / 1e9, self.read("")))
            assert self.at == len(self.bytes), "bytes are left"

    def number(self, code):
        size = struct.calcsize(code)
        self.at += -self.at % size
        self.at += size
        return struct.unpack_from(f"<{code}", self.bytes, self.at - size)[0]

    def read(self, kind):
        if kind in SIZES:
            return self.number(SIZES[kind])
        if kind == "string":
            size = self.number("I")
            self.at += size
            assert self.bytes[self.at - 1] == 0
            return self.bytes[self.at - size:self.at - 1].decode()
        members = {}
        for line in self.types[kind].split("\n"):
            if line:
                inner, name = line.split()
                members[name] = [self.read(inner[:-2]) for _ in range(self.number("I"))] if inner.endswith("[]") \
                    else self.read(inner)
        return members


def vector(of):
    return np.array([of["x"], of["y"], of["z"]])


def axes(q):
    """The axes of a child frame as columns, in those of its parent."""
    x, y, z, w = q["x"], q["y"], q["z"], q["w"]
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


@pytest.fixture(scope="module")
def formation(tmp_path_factory):
    """(record, the same with its scene)"""
    folder = tmp_path_factory.mktemp("foxglove")
    sim = fledge.load("formation")
    for name in ("chief_world", "deputy_world"):
        process = sim.process(name)
        sim.record(process.craft.state, process.nav.attitude, every=1 * s)
    sim.archive(folder / "run.mcap", mission="formation")
    sim.run(30 * s)
    sim.close_archive()
    return folder / "run.mcap", foxglove.write(scene.of(folder / "run.mcap"), folder / "run.mcap",
                                               folder / "run.scene.mcap")


def test_the_record_is_still_the_same_and_the_file_whole(formation):
    record, both = formation
    with fledge.Archive(record) as old, fledge.Archive(both) as new:
        assert new.problem is None and new.metadata == old.metadata
        assert [topic for topic in new.topics if topic not in old.topics] == list(foxglove.TOPICS)
        assert digest(new, old.topics) == digest(old, old.topics)
    with pytest.raises(SetupError, match="it has a scene already"):
        foxglove.write(scene.of(both), both, both.with_name("again.mcap"))
    cut = record.with_name("cut.mcap")
    cut.write_bytes(record.read_bytes()[:-100])
    with pytest.raises(SetupError, match="damaged or cut off"):
        foxglove.write(scene.of(record), cut, both.with_name("again.mcap"))


def test_the_file_is_compared_without_its_scene(formation, capsys):
    record, both = formation
    with fledge.Archive(record) as archive:
        same = f"identical: {len(archive.topics)} topics, .* hash {digest(archive, archive.topics)}\n"
    for pair in ((record, both), (both, record), (both, both)):
        assert cli.main(["compare", *map(str, pair)]) == 0
        printed = capsys.readouterr()
        assert re.fullmatch(same, printed.out) and printed.err.count("without /scene/") == 2 * pair.count(both)
    assert cli.main(["compare", str(both), str(both), "--topics", "scene"]) == 2


@pytest.mark.long("flies and writes a scene")
def test_the_command_writes_it_beside_the_record_and_hides_nothing(formation, tmp_path, monkeypatch, capsys):
    (tmp_path / "runs/formation/free").mkdir(parents=True)
    (tmp_path / "runs/formation/free/run.mcap").write_bytes(formation[0].read_bytes())
    monkeypatch.chdir(tmp_path)
    for _ in range(2):      # the copy is not listed as a run
        assert cli.main(["view", "formation", "--foxglove"]) == 0
        assert capsys.readouterr().out.startswith("runs/formation/free/run.scene.mcap (")
    with fledge.Archive("runs/formation/free/run.scene.mcap") as archive:
        assert archive.problem is None
    # Topics without plain structs are named, and the others converted and plotted.
    for name in ("run", "run.scene"):
        assert cli.main(["convert", "--csv", f"runs/formation/free/{name}.mcap", "--out", name]) == 0
    without = [f"fledge: without {topic} ({schema}), which cannot be decoded: " for topic, schema in
               (("/scene/transforms", "foxglove_msgs/msg/FrameTransforms"),
                ("/scene/entities", "foxglove_msgs/msg/SceneUpdate"))]
    assert [line[:line.index("line ")] for line in capsys.readouterr().err.splitlines()] == without
    files = [{path.name: path.read_bytes() for path in Path(name).iterdir()} for name in ("run", "run.scene")]
    assert files[0] == files[1] and len(files[0]) >= 4
    assert cli.main(["plot", "runs/formation/free/run.scene.mcap"]) == 0
    assert [line[:line.index("line ")] for line in capsys.readouterr().err.splitlines()] == without


def test_the_transforms_are_the_recorded_motion(formation):
    record, both = formation
    reader = Reader(both, "/scene/transforms")
    assert reader.name == "foxglove_msgs/msg/FrameTransforms"
    with fledge.Archive(record) as archive:
        times = archive.time("chief_world.craft.state")
        r = {name: archive[f"{name}.craft.state.r_BN_N"] for name in ("chief_world", "deputy_world")}
        sigma = {name: archive[f"{name}.craft.state.sigma_BN"] for name in r}
    assert [t for t, _ in reader.messages] == times.tolist()
    for i, (t, message) in enumerate(reader.messages):
        frames = {transform["child_frame_id"]: transform for transform in message["transforms"]}
        assert len(frames) == len(message["transforms"])
        assert all(frame["timestamp"]["sec"] + frame["timestamp"]["nanosec"] / 1e9 == t for frame in frames.values())
        assert all(frame["parent_frame_id"] in {"inertial", *frames} for frame in frames.values())
        assert (vector(frames["N"]["translation"]) == -r["chief_world"][i]).all()
        assert (vector(frames["deputy_world"]["translation"]) == r["deputy_world"][i] - r["chief_world"][i]).all()
        for name in r:
            np.testing.assert_allclose(axes(frames[name]["rotation"]), mrp_to_dcm(sigma[name][i]).T, atol=1e-14)
        down = axes(frames["deputy_world/nadir"]["rotation"])[:, 0]
        np.testing.assert_allclose(down, -r["deputy_world"][i] / np.linalg.norm(r["deputy_world"][i]), atol=1e-12)


def test_each_entity_follows_an_existing_frame(formation):
    reader = Reader(formation[1], "/scene/entities")
    (t, update), = reader.messages
    frames = {transform["child_frame_id"]
              for transform in Reader(formation[1], "/scene/transforms").messages[0][1]["transforms"]}
    entities = {entity["id"]: entity for entity in update["entities"]}
    assert t == 0 and len(entities) == len(update["entities"]) and not update["deletions"]
    assert {entity["frame_id"] for entity in entities.values()} <= frames and all(
        entity["frame_locked"] for entity in entities.values())
    mars, = entities["MARS"]["spheres"]
    assert mars["size"]["x"] == pytest.approx(2 * 3397e3)
    assert entities["chief_world/0 hub"]["cubes"][0]["size"]["x"] > 0.5
    assert "chief_world/estimate chief_world.nav.attitude" in entities
    way, = entities["deputy_world/way"]["lines"]
    assert way["type"] == 0 and len(way["points"]) == 1000


def test_a_stale_estimate_is_grey_until_it_is_written_again(formation):
    shown = scene.of(formation[0])
    [pose] = shown.crafts[0].poses
    time = pose.turning.time
    pose.turning.written = np.where((time >= 10) & (time < 20), 4.0, np.nan)
    changes = [(t, message["entities"][0]["arrows"][0]["color"]) for t, topic, message in foxglove.messages(shown)
               if topic == "/scene/entities" and t > 0]
    assert [t for t, _ in changes] == [10, 20]
    grey, again = (color for _, color in changes)
    assert np.ptp([grey[channel] for channel in "rgb"]) < 0.1 and (again["r"], again["b"]) == (1.0, 0.18)


def test_cones_and_plumes():
    """A cone's apex is where it begins; a plume is there while its thruster burns, and deleted after."""
    t = np.arange(5.0)
    still = tracks.Motion(t, np.zeros((5, 3)), np.zeros((5, 3)))
    craft = scene.Craft("craft", "world.craft", still, tracks.Turning(t, np.tile([0.0, 0, 0, 1], (5, 1))), None)
    craft.cone("camera", [0, -1, 0], half_angle=0.25, at_B=[0, 1, 0], length=8)
    craft.parts.append(Part("thruster", "rcs 1", (0, 0, -1), (0, 0, 1), full=2.0,
                            level=tracks.Signal(t, np.array([[0.0], [2.0], [1.0], [0.0], [0.0]]))))
    updates = list(foxglove.messages(scene.Scene("test", crafts=[craft], end=4.0)))
    first = {entity["id"]: entity for entity in updates[0][2]["entities"]}
    cone, = first["craft/0 camera"]["cylinders"]
    assert (cone["bottom_scale"], cone["top_scale"]) == (0, 1) and cone["size"]["x"] == pytest.approx(16 * np.tan(0.25))
    along = axes(cone["pose"]["orientation"])[:, 2]
    np.testing.assert_allclose(along, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(vector(cone["pose"]["position"]) - 4 * along, [0, 1, 0], atol=1e-12)
    plumes = [(time, len(update["entities"]), [deletion["id"] for deletion in update["deletions"]])
              for time, topic, update in updates[1:] if topic == "/scene/entities"]
    assert plumes == [(1.0, 1, []), (2.0, 1, []), (3.0, 0, ["craft/rcs 1, plume"])]
