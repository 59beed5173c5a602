# SPDX-License-Identifier: Apache-2.0
"""The archive: read back from files that the C writer made and from files made here, byte by byte;
cut at every byte, wrong at every byte, in either byte order."""

import ctypes
import json
import math
import os
import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from fledge.archive import Archive, ArchiveError, rosmsg
from fledge.archive.compare import digest
from introspect.emit import schema
from introspect.model import Field, Type
from tests.circles import long_after
from tests.needs import flies_on, skip_without

ROOT = Path(__file__).resolve().parents[3]
SOURCES = [ROOT / "record" / name for name in ("mcap.c", "mcap_crc.c", "file_sink.c")]
MAGIC = b"\x89MCAP0\r\n"
RULE = "=" * 80

HEAD = f"""{RULE}
MSG: fledge/Head
int64 t  # t [ns] time of validity
uint32 quality  # quality [-] how far it may be trusted {{NONE=0, STALE=1, DEGRADED=2, GOOD=3}}
uint32 sequence  # sequence [-] counts the writings
"""
ERROR = f"""fledge/Head head
float64[3] sigma_br  # sigma_BR [-] (3) MRP of B relative to R
float64[3] omega_br_b  # omega_BR_B [rad/s] (3) angular rate of B relative to R
{HEAD}"""
GAINS = f"""fledge/Head head
float64 k_i  # K_I [N m/s] gain on the integrated error
float64[6] p  # P [N m s] (2, 3) gain on the rate error
{HEAD}"""
WHEELS = f"""fledge/Head head  # head
fledge/Wheel[2] wheels  # wheels (2)
uint8[8] label  # label [-] (8) a name
{RULE}
MSG: fledge/Wheel
float64[3] axis_b  # axis_B [-] (3) spin axis
float32 u_max  # u_max [N m] torque limit
uint32 available  # available [-] {{NO=0, YES=1}}
{HEAD}"""
ERROR_FORMAT, GAINS_FORMAT, WHEELS_FORMAT = "qII6d", "qII7d", "qII3dfI3dfI8s"


# ---- the C writer, behind a shim that ctypes can drive ----

SHIM = """
#include "record/file_sink.h"
#include "record/mcap.h"

static McapWriter w;
static FileSink sink;
static McapSchema schemas[8];
static McapChannel channels[8];
static uint8_t chunk[1 << 16], index_bytes[1 << 14];

int shim_open(const char *path, size_t chunk_size)
{
    McapConfig c = {.write = file_sink_write, .user = &sink, .schemas = schemas,
                    .channels = channels, .chunk = chunk, .index = index_bytes,
                    .chunk_size = chunk_size, .index_size = sizeof index_bytes,
                    .schemas_max = 8, .channels_max = 8};
    return file_sink_open(&sink, path) != 0 ? -1 : (int)mcap_open(&w, &c);
}

int shim_channel(const char *topic, const char *schema, const char *text, int order,
                 const McapPair *pairs, size_t n)
{
    uint16_t schema_id = 0, id = 0;
    McapStatus status = mcap_add_schema(&w, schema, text, &schema_id);
    if (status == MCAP_OK) {
        status = mcap_add_channel(&w, topic, schema_id, (McapOrder)order, pairs, n, &id);
    }
    return status == MCAP_OK ? id : -(int)status;
}

int shim_message(int channel, int64_t t, uint32_t sequence, const void *bytes, size_t n)
{
    return (int)mcap_message(&w, (uint16_t)channel, t, sequence, bytes, n);
}

int shim_metadata(const char *name, const McapPair *pairs, size_t n)
{
    return (int)mcap_metadata(&w, name, pairs, n);
}

int shim_close(void)
{
    McapStatus status = mcap_close(&w);
    return file_sink_close(&sink, status == MCAP_OK) != 0 ? -1 : (int)status;
}
"""


class Pair(ctypes.Structure):
    _fields_ = [("key", ctypes.c_char_p), ("value", ctypes.c_char_p)]


def pair_array(pairs):
    return (Pair * len(pairs))(*[(k.encode(), v.encode()) for k, v in pairs.items()])


class CWriter:
    """The writer in C, with the interface of Maker."""

    def __init__(self, library, path, chunk_size):
        self.library = library
        self.buffers = []  # to which the writer has pointers until it is closed
        assert library.shim_open(str(path).encode(), chunk_size) == 0

    def channel(self, topic, schema, text, pairs=None, big=False):
        args = [topic.encode(), schema.encode(), text.encode(), pair_array(pairs or {})]
        self.buffers.append(args)
        id = self.library.shim_channel(*args[:3], 2 if big else 1, args[3], len(pairs or {}))
        assert id > 0
        return id

    def message(self, channel, t, sequence, payload):
        assert self.library.shim_message(channel, ctypes.c_int64(t), sequence, payload,
                                         ctypes.c_size_t(len(payload))) == 0

    def metadata(self, name, pairs):
        assert self.library.shim_metadata(name.encode(), pair_array(pairs), len(pairs)) == 0

    def close(self):
        assert self.library.shim_close() == 0


@pytest.fixture(scope="session")
def shim(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shim")
    (folder / "shim.c").write_text(SHIM)
    subprocess.run(["gcc", "-std=c99", "-O1", "-shared", "-fPIC", f"-I{ROOT}", "-o",
                    folder / "shim.so", folder / "shim.c", *SOURCES], check=True)
    return ctypes.CDLL(str(folder / "shim.so"))


# ---- a maker of files in Python, from the specification ----

def text(s):
    s = s.encode()
    return struct.pack("<I", len(s)) + s


def mapping(pairs):
    body = b"".join(text(k) + text(v) for k, v in pairs.items())
    return struct.pack("<I", len(body)) + body


def record(op, body):
    return struct.pack("<BQ", op, len(body)) + body


class Maker:
    """Makes a file without summary or index, a chunk of every `per_chunk` messages (0: none)."""

    def __init__(self, path, per_chunk=0, checksums=True, compression=""):
        self.path = path
        self.per_chunk = per_chunk
        self.checksums = checksums
        self.compression = compression
        self.file = MAGIC + record(0x01, text("ros2") + text("test"))
        self.chunk, self.in_chunk, self.channels = b"", 0, 0

    def crc(self, b):
        return struct.pack("<I", zlib.crc32(b) if self.checksums else 0)

    def put(self, b):
        if self.per_chunk:
            self.chunk += b
        else:
            self.file += b

    def end_chunk(self):
        n = struct.pack("<Q", len(self.chunk))
        self.file += record(0x06, bytes(16) + n + self.crc(self.chunk) + text(self.compression) + n
                            + self.chunk)
        self.chunk, self.in_chunk = b"", 0

    def channel(self, topic, schema, definition, pairs=None, big=False, schema_encoding="ros2msg",
                encoding="cdr"):
        self.channels += 1
        id = self.channels
        self.put(record(0x03, struct.pack("<H", id) + text(schema) + text(schema_encoding)
                        + text(definition)))
        self.put(record(0x04, struct.pack("<HH", id, id) + text(topic) + text(encoding)
                        + mapping(pairs or {})))
        self.big = getattr(self, "big", {}) | {id: big}
        return id

    def message(self, channel, t, sequence, payload, cdr=None):
        cdr = cdr or (b"\0\0\0\0" if self.big[channel] else b"\0\1\0\0")
        self.put(record(0x05, struct.pack("<HIQQ", channel, sequence, t, t) + cdr + payload))
        self.in_chunk += 1
        if self.in_chunk == self.per_chunk:
            self.end_chunk()

    def metadata(self, name, pairs):
        self.file += record(0x0C, text(name) + mapping(pairs))

    def close(self, footer=True):
        if self.chunk:
            self.end_chunk()
        if footer:
            self.file += record(0x0F, self.crc(self.file))
            self.file += record(0x02, bytes(20)) + MAGIC
        self.path.write_bytes(self.file)


# ---- one small run, written by either ----

def error_values(i):
    return [math.sin(i), -0.0, 1e-300 * i, i / 3, math.pi * i, -i]


def write_run(writer, n=12):
    """errors at 1 Hz, little-endian; gains every 3 s, big-endian; wheels once, 5 ns after."""
    writer.metadata("run", {"mission": "nadir_spin", "seed": "7", "Größe": "µ"})
    error = writer.channel("/flight/tracking/error", "fledge/msg/AttError", ERROR,
                           {"instance": "tracking"})
    gains = writer.channel("/flight/control/gains", "fledge/msg/Gains", GAINS, big=True)
    wheels = writer.channel("/world/wheels/wheels", "fledge/msg/Wheels", WHEELS)
    for i in range(n):
        t = i * 10**9
        writer.message(error, t, i, struct.pack("<" + ERROR_FORMAT, t, 3, i, *error_values(i)))
        if i % 3 == 0:
            writer.message(gains, t, i, struct.pack(">" + GAINS_FORMAT, t, 2, i, i + 0.5,
                                                    *range(i, i + 6)))
    writer.message(wheels, t + 5, 0, struct.pack("<" + WHEELS_FORMAT, t, 3, 1, 1, 2, 3, 0.5, 1,
                                                 4, 5, 6, 0.25, 0, b"pyramid"))
    writer.close()


def check_run(a, n=12):
    assert a.complete and a.problem is None
    assert a.metadata == {"run": {"mission": "nadir_spin", "seed": "7", "Größe": "µ"}}
    assert list(a.topics) == ["/flight/tracking/error", "/flight/control/gains",
                              "/world/wheels/wheels"]
    assert [c.count for c in a.topics.values()] == [n, (n + 2) // 3, 1]
    assert a.topics["/flight/tracking/error"].metadata == {"instance": "tracking"}
    i = np.arange(n)
    expected = np.array([error_values(k) for k in i])
    assert a["error.sigma_BR"].tobytes() == expected[:, :3].tobytes()  # -0.0 too
    assert a["error.omega_BR_B"].tobytes() == expected[:, 3:].tobytes()
    assert a.time_ns("error").tolist() == [k * 10**9 for k in i]
    assert a.time("gains").tolist() == [float(k) for k in i[::3]]
    assert a["gains.K_I"].tolist() == [k + 0.5 for k in i[::3]]
    assert a["gains.P"].tolist() == [np.arange(k, k + 6).reshape(2, 3).tolist() for k in i[::3]]
    assert a["gains.head.quality"].tolist() == [2] * len(i[::3])
    assert a["error.head.sequence"].tolist() == list(i)
    assert a["wheels.axis_B"].tolist() == [[[1, 2, 3], [4, 5, 6]]]
    assert a["u_max"].tolist() == [[0.5, 0.25]]
    assert a["available"].tolist() == [[1, 0]]
    assert bytes(a["label"][0]) == b"pyramid\0"
    assert a.good_until == n - 1 + 5e-9


@pytest.fixture(params=["C, unchunked", "C, chunks of 1 KiB", "C, one chunk", "Python, unchunked",
                        "Python, chunks"])
def run(request, tmp_path, shim):
    path = tmp_path / "run.mcap"
    kind, _, how = request.param.partition(", ")
    if kind == "C":
        write_run(CWriter(shim, path, {"unchunked": 0, "chunks of 1 KiB": 1024}.get(how, 1 << 16)))
    else:
        write_run(Maker(path, per_chunk=4 if how == "chunks" else 0))
    return path


def test_a_written_record_is_read(run):
    check_run(Archive(run))


def test_no_checksums_and_private_records_are_fine(tmp_path):
    path = tmp_path / "run.mcap"
    maker = Maker(path, per_chunk=5, checksums=False)
    maker.file += record(0x80, b"a private record") + record(0x09, b"an attachment")
    write_run(maker)
    check_run(Archive(path))


def test_arrays_are_read_only_and_outlive_the_archive(run):
    with Archive(run) as a:
        sigma = a["error.sigma_BR"]
        error = a["/flight/tracking/error"]
    assert error.dtype.names == ("head", "sigma_BR", "omega_BR_B")
    assert error["sigma_BR"].shape == (12, 3)
    assert sigma[1, 0] == math.sin(1)
    with pytest.raises(ValueError):
        sigma[0, 0] = 1


def test_opening_loads_neither_numpy_nor_pandas(run):
    code = ("import sys; from fledge.archive import Archive\n"
            f"a = Archive({str(run)!r}); list(a.topics['/flight/tracking/error'].fields)\n"
            "assert not {'numpy', 'pandas', 'h5py'} & set(sys.modules)\n"
            "a['error.sigma_BR']; assert not {'pandas', 'h5py'} & set(sys.modules)")
    paths = os.pathsep.join([str(ROOT / "python"), str(ROOT), os.environ.get("PYTHONPATH", "")])
    subprocess.run([sys.executable, "-c", code], check=True, env=os.environ | {"PYTHONPATH": paths})


# ---- names, units, shapes ----

def test_fields_have_true_names_units_shapes_and_meanings(run):
    a = Archive(run)
    fields = a.topics["/flight/tracking/error"].fields
    assert list(fields) == ["head.t", "head.quality", "head.sequence", "sigma_BR", "omega_BR_B"]
    sigma, rate = fields["sigma_BR"], fields["omega_BR_B"]
    assert (sigma.unit, sigma.shape, sigma.meaning) == ("-", (3,), "MRP of B relative to R")
    assert (rate.unit, rate.dtype) == ("rad/s", "f8")
    quality = fields["head.quality"]
    assert quality.values == {"NONE": 0, "STALE": 1, "DEGRADED": 2, "GOOD": 3}
    assert quality.meaning == "how far it may be trusted"
    gains = a.topics["/flight/control/gains"].fields
    assert (gains["K_I"].unit, gains["K_I"].shape) == ("N m/s", ())
    assert gains["P"].shape == (2, 3)
    assert gains["P"].columns() == [f"P[{i}][{j}]" for i in range(2) for j in range(3)]
    wheels = a.topics["/world/wheels/wheels"].fields
    assert wheels["wheels.axis_B"].shape == (2, 3)
    assert wheels["wheels.axis_B"].columns()[:4] == [
        "wheels[0].axis_B[0]", "wheels[0].axis_B[1]", "wheels[0].axis_B[2]", "wheels[1].axis_B[0]"]


@pytest.mark.parametrize("key", ["sigma_BR", "error.sigma_BR", "tracking.error.sigma_BR",
                                 "flight.tracking.error.sigma_BR",
                                 "/flight/tracking/error.sigma_BR", "tracking/error.sigma_BR"])
def test_a_name_may_be_as_short_as_it_is_unique(run, key):
    assert Archive(run)[key].shape == (12, 3)


@pytest.mark.parametrize("key, shape", [("error", (12,)), ("tracking.error", (12,)),
                                        ("error.head", (12,)), ("wheels.wheels", (1,)),
                                        ("error.sigma_BR[2]", (12,)), ("gains.P[1][2]", (4,)),
                                        ("gains.P[1]", (4, 3)), ("wheels[1].axis_B[0]", (1,))])
def test_topics_heads_and_elements_have_names_too(run, key, shape):
    assert Archive(run)[key].shape == shape


@pytest.mark.parametrize("key, why", [
    ("error.sigma_RB", r"no 'error.sigma_RB'; did you mean error.sigma_BR\?"),
    ("temperature", r"no 'temperature'; there are flight.tracking.error, flight.con"),
    ("control.sigma_br", r"did you mean flight.tracking.error.sigma_BR\?"),
    ("/error", r"did you mean flight.tracking.error\?"),
    ("head.t", r"'head.t' is ambiguous: it may be flight.tracking.error.head.t, flight.control"),
    ("sequence", r"there is no 'sequence'; did you mean flight.tracking.error.head.sequence"),
    ("error.sigma_BR[3]", r"out of range: flight.tracking.error.sigma_BR has the shape \(3,\)"),
    ("", r"there is no ''; there are"),
])
def test_a_wrong_name_lists_the_right_ones(run, key, why):
    with pytest.raises(ArchiveError, match=why):
        Archive(run)[key]


def test_a_topic_comes_before_a_field_of_its_name(run):
    assert Archive(run)["wheels"].dtype.names == ("head", "wheels", "label")


# ---- every type, both byte orders ----

TYPES = {"bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h",
         "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f",
         "float64": "d"}


@pytest.mark.parametrize("kind", TYPES)
def test_every_type_in_both_orders_and_mixed(tmp_path, kind):
    code = TYPES[kind]
    size = struct.calcsize(code)
    values = {"?": [False, True], "f": [1.5, -math.inf], "d": [0.1, math.nan]}.get(
        code, [1, 2**(8 * size - (2 if code.islower() else 1)) + 1])
    if code in "bhiq":
        values[0] = -values[1]
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    definition = f"{kind} a  # A [m] one\n{kind}[3] b  # B [-] (3) three\n"
    for topic, orders in (("/little", "<<"), ("/big", ">>"), ("/mixed", "<><")):
        channel = maker.channel(topic, "fledge/msg/X", definition)
        for i, order in enumerate(orders):
            row = [values[(i + k) % 2] for k in range(4)]
            maker.message(channel, i, i, struct.pack(order + "4" + code, *row),
                          b"\0\1\0\0" if order == "<" else b"\0\0\0\0")
    maker.close()
    a = Archive(path)
    for topic in a.topics:
        for i in range(a.topics[topic].count):
            found = [a[topic]["A"][i], *a[topic]["B"][i]]
            np.testing.assert_array_equal(found, [values[(i + k) % 2] for k in range(4)])
        assert a[topic]["A"].dtype.isnative


def test_definitions_of_other_origin_keep_their_ros_names(tmp_path):
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    channel = maker.channel("/x", "geometry_msgs/msg/Twist", f"# linear, then angular\n\n"
                            f"Vector3 linear # the velocity (m/s)\ngeometry_msgs/Vector3 angular\n"
                            f"{RULE}\nMSG: geometry_msgs/Vector3\n"
                            "float64 x\nfloat64 y\nfloat64 z\n")
    maker.message(channel, 0, 0, struct.pack("<6d", *range(6)))
    maker.close()
    a = Archive(path)
    assert list(a.topics["/x"].fields) == [f"{v}.{c}" for v in ("linear", "angular") for c in "xyz"]
    assert a["angular.y"].tolist() == [4]


@pytest.mark.parametrize("definition, why", [
    ("string s", "s has the type string, which is not of fixed size or not defined here"),
    ("float64[] x", r'line 1: expected "<type> <name>" of fixed size, found "float64\[\] x"'),
    ("uint8 a\nfloat64 b", "b needs padding before it"),
    (f"fledge/A a\n{RULE}\nMSG: fledge/A\nfledge/A again", "fledge/A contains itself"),
    ("float64[4294967295] x", "the message has at least 34359738360 bytes; up to 4194304 are read"),
    (f"uint8[{'9' * 5000}] x", "of fixed size, found"),
    ("\n".join(f"A{i + 1} x\nA{i + 1} y\n{RULE}\nMSG: A{i + 1}" for i in range(24)) + "\nuint8[0] z", "16384 are read"),
    ("\n".join(f"A{i + 1} x\n{RULE}\nMSG: A{i + 1}" for i in range(900)) + "\nuint8 z", "up to 32 are read"),
    (f"float64 a\n{RULE}\nfloat64 b", 'line 3: expected "MSG: <a new type>", found "float64 b"'),
    ("float64 x  # X [m] one\nfloat64 y  # X [m] two", "two members named X"),
    ("int32 ONE=1", 'of fixed size, found "int32 ONE=1"'),
])
def test_a_definition_that_is_not_a_plain_struct_is_refused_when_read(tmp_path, definition, why):
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    bad = maker.channel("/bad", "fledge/msg/Bad", definition)
    good = maker.channel("/good", "fledge/msg/Good", "float64 x  # x [m] fine")
    maker.message(bad, 0, 0, bytes(16))
    maker.message(good, 0, 0, bytes(8))
    maker.close()
    a = Archive(path)
    assert a.complete and a["good.x"].tolist() == [0]
    with pytest.raises(ArchiveError, match="/bad .fledge/msg/Bad. cannot be decoded: .*" + why):
        a["/bad"]


def test_other_encodings_are_named(tmp_path):
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    maker.channel("/x", "X", "{}", schema_encoding="jsonschema", encoding="json")
    maker.close()
    with pytest.raises(ArchiveError, match='encoding "jsonschema" and message encoding "json"'):
        Archive(path)["/x"]


def test_an_unknown_cdr_header_is_named(tmp_path):
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    channel = maker.channel("/x", "X", "float64 x")
    maker.message(channel, 0, 0, bytes(8))
    maker.message(channel, 1, 0, bytes(8), cdr=b"\0\x07\0\0")
    maker.close()
    with pytest.raises(ArchiveError, match="/x: message 1 at byte .* begins with 00 07 00 00, exp"):
        Archive(path)["x"]


# ---- files that are no archive, or only a part of one ----

@pytest.mark.parametrize("content, why", [
    (b"", "expected it to begin with 89 4d 43 41 50 30 0d 0a, found an empty file"),
    (b"time,x\n", r"not an MCAP file.*found 74 69 6d 65 2c 78 0a .b'time,x"),
    (MAGIC[:5], r"found 89 4d 43 41 50 "),
])
def test_files_that_are_not_mcap_are_refused(tmp_path, content, why):
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match=why) as error:
        Archive(path)
    assert str(path) in str(error.value)


def test_a_missing_file_a_folder_and_a_compressed_file_are_named(tmp_path):
    with pytest.raises(ArchiveError, match="none.mcap: cannot be opened: No such file"):
        Archive(tmp_path / "none.mcap")
    with pytest.raises(ArchiveError, match="cannot be opened: Is a directory"):
        Archive(tmp_path)
    path = tmp_path / "run.mcap"
    write_run(Maker(path, per_chunk=4, compression="zstd"))
    with pytest.raises(ArchiveError, match='run.mcap: .*chunks are compressed .zstd.'):
        Archive(path)


def messages_of(a):
    """topic -> [(time, payload bytes), ...]"""
    return {t: list(zip(a.time_ns(t).tolist(), (v.tobytes() for v in a[t]))) for t in a.topics}


def message_ends(data):
    """Where each message becomes readable, in order: the end of its record."""
    ends, at = [], len(MAGIC)
    while data[at] != 0x0F:
        op, n = struct.unpack_from("<BQ", data, at)
        end = at + 9 + n
        if op == 0x05:
            ends.append(end)
        inner = at + 9 + 40
        while op == 0x06 and inner < end:
            inner_op, n = struct.unpack_from("<BQ", data, inner)
            inner += 9 + n
            ends += [inner] if inner_op == 0x05 else []
        at = end
    return ends


def chunk_ends(data):
    ends, at = [], len(MAGIC)
    while data[at] != 0x0F:
        op, n = struct.unpack_from("<BQ", data, at)
        at += 9 + n
        ends += [at] if op == 0x06 else []
    return ends


def c_run(shim, path, chunk_size, n=12):
    write_run(CWriter(shim, path, chunk_size), n)
    return path.read_bytes()


def test_messages_larger_than_the_chunks_are_read(tmp_path, shim):
    path = tmp_path / "images.mcap"
    writer = CWriter(shim, path, 1 << 16)
    small = writer.channel("/small", "fledge/msg/X", "float64 x  # x [m] a place")
    large = writer.channel("/image", "fledge/msg/Image", "uint8[3000000] pixels  # pixels [-] (1000, 3000) of a camera")
    images = [bytes([i]) * 2_999_999 + b"." for i in range(3)]
    for i, image in enumerate(images):
        writer.message(small, i, i, struct.pack("<d", i))
        writer.message(large, i, i, image)
    writer.close()
    with Archive(path) as a:
        assert a.complete and a["small.x"].tolist() == [0, 1, 2]
        assert a["image.pixels"].shape == (3, 1000, 3000)
        assert [row.tobytes() for row in a["image.pixels"]] == images
    os.truncate(path, path.stat().st_size - 3_000_000)
    with Archive(path) as a:        # the last image and all that follows it
        assert [row.tobytes() for row in a["image.pixels"]] == images[:2] and a["small.x"].tolist() == [0, 1, 2]


EVERY = long_after(1, [(1024, 7), (1024, 1), (0, 1)], "every byte of a file")   # the first: each 7th


@pytest.mark.parametrize("chunk_size, step", EVERY)
def test_cut_at_any_byte_the_last_whole_message_is_readable(tmp_path, shim, chunk_size, step):
    path = tmp_path / "run.mcap"
    data = c_run(shim, path, chunk_size)
    whole = messages_of(Archive(path))
    ends = message_ends(data)
    assert sum(map(len, whole.values())) == len(ends) == 17
    sizes = {*range(len(MAGIC), len(data), step), *ends, *(end - 1 for end in ends)}
    for size in sorted(sizes, reverse=True):
        os.truncate(path, size)
        a = Archive(path)
        assert not a.complete and f"of {size}: " in a.problem
        found = messages_of(a)
        assert sum(map(len, found.values())) == sum(end <= size for end in ends)
        for topic, messages in found.items():
            assert messages == whole[topic][:len(messages)]
        assert (a.good_until is None) == (not any(found.values()))
        if a.good_until is not None:
            assert f"the data are good before t = {a.good_until!r} s" in a.problem
            for topic in whole:
                before = [m for m in whole[topic] if m[0] / 1e9 < a.good_until]
                assert found.get(topic, [])[:len(before)] == before


@pytest.mark.parametrize("chunk_size, step", EVERY)
def test_a_wrong_byte_is_never_silent(tmp_path, shim, chunk_size, step):
    """With chunks, no message is ever wrong, and what is missing is after good_until. Without,
    values may be wrong, but then the archive says so and gives no time."""
    path = tmp_path / "run.mcap"
    data = c_run(shim, path, chunk_size, n=5)
    whole = messages_of(Archive(path))
    rng = np.random.default_rng(1)
    for at in range(len(MAGIC), len(data), step):
        flip = int(rng.choice([1 << rng.integers(8), rng.integers(1, 256)]))
        with open(path, "r+b") as file:     # in place: to write a file anew takes longer than to read it
            file.seek(at - step)            # the last one is mended
            file.write(data[at - step:at] + bytes([data[at] ^ flip]))
        a = Archive(path)
        assert not a.complete and a.problem, at
        if chunk_size == 0 and a.good_until is None:
            continue
        found = messages_of(a)
        assert {t for t, messages in found.items() if messages} <= set(whole)
        for topic, messages in whole.items():
            there = found.get(topic, [])
            if a.good_until is None:
                assert set(there) <= set(messages), at
            else:
                assert there == messages[:len(there)], at
                assert len(there) >= sum(m[0] / 1e9 < a.good_until for m in messages), at


def test_a_damaged_file_says_what_where_and_until_when(tmp_path, shim):
    path = tmp_path / "run.mcap"
    data = c_run(shim, path, 1024, n=20)
    chunks = chunk_ends(data)
    assert len(chunks) >= 3
    last_good = sum(end <= chunks[-2] for end in message_ends(data))
    path.write_bytes(data[:chunks[-1] - 5] + b"\xff" + data[chunks[-1] - 4:])
    a = Archive(path)
    assert sum(c.count for c in a.topics.values()) == last_good
    assert f"{path}: damaged or cut off at byte " in a.problem
    assert "the checksum of this chunk is 0x" in a.problem

    path.write_bytes(data + b"more")
    a = Archive(path)
    assert not a.complete and a.good_until == 19.000000005
    assert f"at byte {len(data) - 8} of" in a.problem
    assert "all messages are there; the data are good before t = 19.000000005 s" in a.problem


# ---- frames and other formats ----

def test_a_frame_has_true_names_units_and_time(run):
    a = Archive(run)
    frame = a.frame("error")
    assert list(frame.columns) == [f"error.{f}[{i}]" for f in ("sigma_BR", "omega_BR_B")
                                   for i in range(3)] + ["error.valid_at", "error.quality"]
    assert frame.index.name == "time [s]" and frame.index.tolist() == [float(i) for i in range(12)]
    assert frame.attrs["units"]["error.omega_BR_B[2]"] == "rad/s"
    assert frame["error.sigma_BR[0]"].tolist() == [math.sin(i) for i in range(12)]
    for column in frame.columns[:-2]:
        assert frame[column].tolist() == a[column].tolist()
    assert frame["error.valid_at"].tolist() == (a["error.head.t"] / 1e9).tolist()
    assert frame.attrs["units"]["error.valid_at"] == "s" and "validity" in frame.attrs["meanings"]["error.valid_at"]
    quality = frame["error.quality"]
    assert quality.cat.ordered and quality.cat.categories.tolist() == ["none", "stale", "degraded", "good"]
    assert quality.tolist() == [["none", "stale", "degraded", "good"][q] for q in a["error.head.quality"].tolist()]
    assert (quality >= "good").any()
    assert list(a.frame("error.sigma_BR").columns) == [f"error.sigma_BR[{i}]" for i in range(3)]
    assert list(a.frame("error", head=False).columns) == list(frame.columns[:-2])
    assert list(a.frame("error.head").columns) == [f"error.head.{f}" for f in
                                                   ("t", "quality", "sequence")]


def test_tables_have_quaternions_on_request(run, tmp_path):
    from scipy.spatial.transform import Rotation

    a = Archive(run)
    names = [f"beta_BR[{i}]" for i in range(4)]
    frame = a.frame("error", quaternions=True)
    assert list(frame.columns)[2:8] == ["error.sigma_BR[2]", *(f"error.{n}" for n in names), "error.omega_BR_B[0]"]
    beta = frame[[f"error.{n}" for n in names]].to_numpy()
    turn = Rotation.from_quat(np.roll(beta, -1, axis=1)).inv() * Rotation.from_mrp(np.array(a["error.sigma_BR"]))
    assert np.abs(turn.magnitude()).max() < 1e-14 and (beta[:, 0] >= 0).all()
    assert frame.attrs["units"]["error.beta_BR[0]"] == "-"
    assert frame.attrs["meanings"]["error.beta_BR[0]"] == "quaternion, scalar first"
    a.to_csv(tmp_path / "error.csv", "error", quaternions=True)
    head, *rows = (tmp_path / "error.csv").read_text().splitlines()
    assert head.split(",")[4:8] == [f"{n} [-]" for n in names]
    assert [[float(x) for x in row.split(",")[4:8]] for row in rows] == beta.tolist()


def test_a_frame_of_several_rates_has_gaps(run):
    a = Archive(run)
    frame = a.frame("/flight/*")
    assert len(frame) == 12
    assert frame["gains.K_I"].dropna().index.tolist() == [0.0, 3.0, 6.0, 9.0]
    assert not frame["error.sigma_BR[0]"].isna().any()
    assert list(a.frame(["gains.K_I", "error.sigma_BR"]).columns)[-1] == "gains.K_I"
    assert len(a.frame()) == 13 and a.frame().index.is_monotonic_increasing
    with pytest.raises(ArchiveError, match=r"no topic matches '/cosim/\*'; there are"):
        a.frame("/cosim/*")


def test_spare_members_are_read_but_left_out_of_tables(tmp_path):
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    channel = maker.channel("/x", "X", "uint32 n  # n [-] a number\n"
                            "uint32[1] spare_1  # spare_1 (1)")
    maker.message(channel, 0, 0, struct.pack("<II", 7, 8))
    maker.close()
    a = Archive(path)
    assert a["x.spare_1"].tolist() == [[8]]
    assert list(a.frame().columns) == ["x.n"]
    assert list(a.frame("x.spare_1").columns) == ["x.spare_1[0]"]


def test_messages_of_one_instant_stay_apart(tmp_path):
    path = tmp_path / "x.mcap"
    maker = Maker(path)
    for topic in ("/a/x", "/b/x"):
        channel = maker.channel(topic, "X", "float64 x  # x [m] a place")
        for i, t in enumerate((0, 10**9, 10**9)):
            maker.message(channel, t, i, struct.pack("<d", i))
    maker.channel("/b/empty", "X", "float64 x  # x [m] a place")
    maker.close()
    a = Archive(path)
    frame = a.frame()
    assert list(frame.columns) == ["a.x.x", "b.x.x", "empty.x"]
    assert frame.index.tolist() == [0.0, 1.0, 1.0]
    assert frame["a.x.x"].tolist() == frame["b.x.x"].tolist() == [0, 1, 2]
    assert a["empty.x"].shape == (0,)


def test_csv_is_exact(run, tmp_path):
    import pandas
    a = Archive(run)
    written = a.to_csv(tmp_path / "csv")
    names = ["flight.control.gains.csv", "flight.tracking.error.csv", "world.wheels.wheels.csv"]
    assert sorted(p.name for p in written) == names
    assert sorted(p.name for p in (tmp_path / "csv").iterdir()) == names
    table = pandas.read_csv(tmp_path / "csv" / "flight.tracking.error.csv",
                            float_precision="round_trip")
    assert table.columns[:2].tolist() == ["time [s]", "sigma_BR[0] [-]"]
    assert table.to_numpy()[:, 1:4].astype(float).tobytes() == a["error.sigma_BR"].tobytes()
    wheels = (tmp_path / "csv" / "world.wheels.wheels.csv").read_text().splitlines()[1]
    assert wheels.startswith("11.000000005,1.0,2.0,3.0,4.0,5.0,6.0,0.5,0.25,1,0,112,")

    file = tmp_path / "gains.csv"
    assert a.to_csv(file, "gains") == [file]
    heading, first, *_ = file.read_text().splitlines()
    assert heading.startswith("time [s],K_I [N m/s],P[0][0] [N m s],") and heading.endswith(",valid_at [s],quality")
    assert first.split(",")[-2:] == [first.split(",")[0], "degraded"]
    assert a.to_csv(file, "gains", head=False) == [file] and "quality" not in file.read_text()
    with pytest.raises(ArchiveError, match="takes one topic, not 3 .*name one, or give a folder"):
        a.to_csv(tmp_path / "all.csv")
    assert not list(tmp_path.glob("**/*.part")) and not (tmp_path / "all.csv").exists()


def test_each_topic_has_a_csv_of_its_own(tmp_path):
    maker = Maker(tmp_path / "x.mcap")
    topics = ["/a b", "/a_b", "/a+b", "/A_b", "/c/d", "/c.d", "/a_b_2", "/" + "\u00e9" * 300, "/" + "\u00e9" * 301]
    for i, topic in enumerate(topics):
        maker.message(maker.channel(topic, "X", "float64 x  # x [m] a place"), 0, 0, struct.pack("<d", i))
    maker.close()
    written = Archive(tmp_path / "x.mcap").to_csv(tmp_path / "csv")
    assert len({path.name.lower() for path in written}) == len(topics)
    assert [float(path.read_text().split(",")[-1]) for path in written] == list(range(len(topics)))


@pytest.mark.parametrize("form", ["csv", "hdf5", "mat", "frame"])
def test_topics_whose_names_are_alike_keep_their_values(tmp_path, form):
    """Some differ in `.` and `/`, have no letter, have the name of another's field, or hold what a format does not."""
    import h5py
    import scipy.io
    maker = Maker(tmp_path / "x.mcap")
    topics = ["/imu.raw", "/imu/raw", "/", "", "//", "/a/x", "/a", "/b", "/b/x", "/b/x/c", "/b/x", "/end", "/1", "/\0",
              "/" + "long" * 30 + "1", "/" + "long" * 30 + "2", "/metadata", "/_metadata/run", "/time"]
    for i, topic in enumerate(topics):
        channel = maker.channel(topic, "X", "float64 x  # x [m] a \0 place", {"": "\0"})
        maker.message(channel, 0, 0, struct.pack("<d", i))
    maker.metadata("run", {"": "\0", "a\0": "b"})
    maker.close()
    a = Archive(tmp_path / "x.mcap")
    if form == "csv":
        found = [path.read_text().split(",")[-1] for path in a.to_csv(tmp_path / "csv")]
    elif form == "frame":
        found = [a.frame(topic).iloc[0, 0] for topic in a.topics]
    elif form == "hdf5":
        found = []
        with h5py.File(a.to_hdf5(tmp_path / "x.h5")) as file:
            file.visititems(lambda name, item: found.append(item["x"][0]) if "_time" in item else None)
    else:
        tables = scipy.io.loadmat(a.to_mat(tmp_path / "x.mat"), simplify_cells=True)
        assert all(re.fullmatch("[A-Za-z][A-Za-z0-9_]{0,62}", name) for name in tables if not name.startswith("__"))
        found = [table["x"] for table in tables.values() if isinstance(table, dict) and "x" in table]
    assert sorted(map(float, found)) == list(range(len(topics)))


def test_definitions_beyond_a_limit_are_refused_soon():
    begin = "=" * 80 + "\nMSG: x/A"
    nested = "".join(f"{begin}{i}\nA{i + 1}[1] a\n" for i in range(1, 30)) + f"{begin}30\nbyte a\n"
    for text, why in (("bool a\n" * 300_000, "two members named a"),
                      ("\n".join(f"bool a{i}" for i in range(100_000)), "at least 16385 fields; up to 16384 are read"),
                      ("float64[1] x  # x [m] (" + "1," * 39 + "1) foo", "has 40 dimensions; up to 24 are read"),
                      ("A1[1] a\n" + nested, "a field has 30 dimensions")):
        with pytest.raises(rosmsg.DefinitionError, match=why):
            rosmsg.parse(text)


def test_a_field_of_hdf5_may_be_called_as_the_times(tmp_path):
    import h5py
    maker = Maker(tmp_path / "x.mcap")
    maker.message(maker.channel("/a", "X", "float64 x  # _time [s] of its own"), 0, 0, struct.pack("<d", 7))
    maker.close()
    with Archive(tmp_path / "x.mcap") as a, h5py.File(a.to_hdf5(tmp_path / "x.h5")) as file:
        assert (file["a/_time"][0], file["a/_time_2"][0]) == (0, 7)


def test_the_hash_tells_messages_apart_that_cannot_be_decoded(tmp_path):
    hashes = set()
    for i, parts in enumerate(([b"ab", b"c"], [b"a", b"bc"])):
        maker = Maker(tmp_path / f"{i}.mcap")
        channel = maker.channel("/a", "X", "string x")
        for part in parts:
            maker.message(channel, 0, 0, part)
        maker.close()
        a = Archive(tmp_path / f"{i}.mcap")
        assert a.topics["/a"].problem
        hashes.add(digest(a, a.topics))
    assert len(hashes) == 2


def test_braces_in_a_meaning_are_no_values():
    line = schema._line(Field("n", Type.U32, "uint32_t", (), 0, 4, 1, doc="a number {k=2}"))
    n, = rosmsg.parse(line).members
    assert (n.name, n.meaning, n.values) == ("n", "a number {k=2}", {})
    x, n, mode, own = rosmsg.parse("float64 x  # x [-] a gain {k=2}\nuint32 n  # n [-] a number {k=2} {}\n"
                                   "uint32 mode  # mode [-] what it does {OFF=0, on=1}\nuint32 own  # own {}").members
    assert (x.meaning, x.values, n.meaning, n.values) == ("a gain {k=2}", {}, "a number {k=2}", {})
    assert (mode.meaning, mode.values, own.meaning) == ("what it does", {"OFF": 0, "on": 1}, "")


@pytest.mark.parametrize("time, fits", [(2**63 - 1, True), (2**63, False), (2**64 - 1, False)])
def test_a_time_that_64_bits_with_a_sign_do_not_hold_is_refused(tmp_path, time, fits):
    maker = Maker(tmp_path / "x.mcap")
    maker.message(maker.channel("/x", "X", "float64 x  # x [m] a place"), time, 0, struct.pack("<d", 1))
    maker.close()
    a = Archive(tmp_path / "x.mcap")
    if fits:
        assert a.time_ns("x").tolist() == [time]
        return
    for read in (lambda: a.time_ns("x"), a.frame, lambda: a.to_csv(tmp_path), lambda: a.to_hdf5(tmp_path / "x.h5")):
        with pytest.raises(ArchiveError, match=f"/x: message 0 has the time {time} ns; times up to {2**63 - 1} ns are"):
            read()


def test_hdf5_keeps_shapes_units_and_metadata(run, tmp_path):
    import h5py
    a = Archive(run)
    with h5py.File(a.to_hdf5(tmp_path / "run.h5"), "r") as f:
        group = f["flight/tracking/error"]
        assert group["sigma_BR"][:].tobytes() == a["error.sigma_BR"].tobytes()
        assert group["sigma_BR"].attrs["unit"] == "-"
        assert group["sigma_BR"].attrs["meaning"] == "MRP of B relative to R"
        assert group["_time_ns"][:].tolist() == a.time_ns("error").tolist()
        assert group["_time"].attrs["unit"] == "s"
        assert group.attrs["schema"] == "fledge/msg/AttError"
        assert "head.t" not in group
        assert group["valid_at"].attrs["unit"] == "s" and group["valid_at"][:].tolist() == a.frame("error")[
            "error.valid_at"].tolist()
        assert h5py.check_enum_dtype(group["quality"].dtype)["good"] == 3
        assert group["quality"][:].tolist() == a["error.head.quality"].tolist()
        assert f["world/wheels/wheels/wheels.axis_B"].shape == (1, 2, 3)
        assert f["_metadata/run"].attrs["mission"] == "nadir_spin"
    assert not list(tmp_path.glob("*.part"))


def test_matlab_reads_structs_with_times_units_and_metadata(run, tmp_path):
    import scipy.io
    a = Archive(run)
    tables = scipy.io.loadmat(a.to_mat(tmp_path / "run.mat"))
    error = tables["flight_tracking_error"][0, 0]
    assert error["sigma_BR"].tobytes("C") == a["error.sigma_BR"].tobytes()
    assert error["time"].shape == (a.topics["/flight/tracking/error"].count, 1)
    assert error["time_ns"][:, 0].tolist() == a.time_ns("error").tolist() and error["time_ns"].dtype == np.int64
    assert error["valid_at"][:, 0].tolist() == a.frame("error")["error.valid_at"].tolist()
    assert error["quality"][:, 0].tolist() == a["error.head.quality"].tolist() and "head_t" not in error.dtype.names
    assert tables["world_wheels_wheels"][0, 0]["wheels_axis_B"].shape == a["wheels.axis_B"].shape
    table = scipy.io.loadmat(tmp_path / "run.mat", simplify_cells=True)["flight_tracking_error"]
    assert table["units"]["time"] == "s" and table["units"]["valid_at"] == "s" and table["units"]["sigma_BR"] == "-"
    assert table["meanings"]["sigma_BR"] == "MRP of B relative to R" and "good=3" in table["values"]["quality"]
    assert tables["metadata"][0, 0]["run"][0, 0]["mission"][0] == "nadir_spin"


@pytest.mark.parametrize("write", ["to_csv", "to_hdf5", "to_mat"])
def test_a_full_disk_leaves_no_half_of_a_file(run, tmp_path, write):
    out = tmp_path / "out"
    out.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", "import resource, signal, sys; from fledge.archive import Archive\n"
         "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
         f"Archive(sys.argv[1]).{write}(sys.argv[2])", str(run), str(out if write == "to_csv" else out / "x")],
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    assert done.returncode == 1 and "cannot be written: File too large: '" + str(out) in done.stderr
    assert not list(out.iterdir())


# ---- the writer where it is used ----

def test_the_writer_needs_nothing_but_string_h(tmp_path):
    """A target must provide four functions, and no heap, I/O or static data."""
    for source in SOURCES[:2]:
        subprocess.run(["gcc", "-std=c99", "-ffreestanding", "-O2", "-c", f"-I{ROOT}", source, "-o",
                        tmp_path / (source.stem + ".o")], check=True)
    subprocess.run(["ld", "-r", "-o", tmp_path / "all.o", *tmp_path.glob("mcap*.o")], check=True)
    out = subprocess.run(["nm", tmp_path / "all.o"], check=True, capture_output=True, text=True)
    symbols = [line.split()[-2:] for line in out.stdout.splitlines()]
    needed = {name for kind, name in symbols if kind == "U"}
    assert needed <= {"memcpy", "memset", "strlen", "strcmp"}
    assert not [name for kind, name in symbols if kind in "dDbBC"]


BIG_ENDIAN_PROGRAM = """
#include "record/file_sink.h"
#include "record/mcap.h"

typedef struct Error {
    int64_t t;
    uint32_t quality, sequence;
    double sigma[3], omega[3];
} Error;

int main(int argc, char **argv)
{
    static McapWriter w;
    static FileSink sink;
    static McapSchema schemas[1];
    static McapChannel channels[1];
    static uint8_t chunk[1024], index_bytes[4096];
    McapConfig c = {.write = file_sink_write, .user = &sink, .schemas = schemas,
                    .channels = channels, .chunk = chunk, .index = index_bytes,
                    .chunk_size = sizeof chunk, .index_size = sizeof index_bytes,
                    .schemas_max = 1, .channels_max = 1};
    uint16_t schema, channel;
    if (argc != 3 || file_sink_open(&sink, argv[1]) != 0 || mcap_open(&w, &c) != MCAP_OK ||
        mcap_add_schema(&w, "fledge/msg/AttError", argv[2], &schema) != MCAP_OK ||
        mcap_add_channel(&w, "/error", schema, MCAP_ORDER_NATIVE, NULL, 0, &channel) != MCAP_OK) {
        return 1;
    }
    for (uint32_t i = 0; i < 50; i++) {
        Error e = {i, 3, i, {0.1 * i, 1, 2}, {3, 4, -0.5 * i}};
        mcap_message(&w, channel, 1000000000 * (int64_t)i, i, &e, sizeof e);
    }
    return (int)mcap_close(&w) + file_sink_close(&sink, true);
}
"""


@flies_on("sparc64")
def test_a_big_endian_machine_writes_the_same_run(tmp_path):
    (tmp_path / "main.c").write_text(BIG_ENDIAN_PROGRAM)
    archives = []
    for name, compiler, runner in (("here", "gcc", []), ("sparc", "sparc64-linux-gnu-gcc", ["qemu-sparc64"])):
        subprocess.run([compiler, "-std=c99", "-O1", "-static", f"-I{ROOT}", "-o", tmp_path / name,
                        tmp_path / "main.c", *SOURCES], check=True)
        path = tmp_path / f"{name}.mcap"
        subprocess.run([*runner, tmp_path / name, path, ERROR], check=True)
        archives.append(Archive(path))
    here, sparc = archives
    assert here.complete and sparc.complete
    assert here["error"].tobytes() == sparc["error"].tobytes()
    assert sparc["omega_BR_B"][:, 2].tolist() == [-0.5 * i for i in range(50)]
    assert (tmp_path / "here.mcap").read_bytes() != (tmp_path / "sparc.mcap").read_bytes()


@pytest.mark.parametrize("chunk_size", [0, 1024, 1 << 16])
def test_other_readers_read_the_same(tmp_path, shim, chunk_size):
    """Foxglove's own libraries: see record/oracle/README.md."""
    skip_without("nodejs")
    if not os.environ.get("FLEDGE_MCAP_ORACLE"):
        pytest.skip("FLEDGE_MCAP_ORACLE names no folder of record/oracle's modules")
    path = tmp_path / "run.mcap"
    c_run(shim, path, chunk_size)
    a = Archive(path)
    out = subprocess.run(["node", ROOT / "record/oracle/check.mjs", path], check=True,
                         capture_output=True, text=True)
    assert out.stderr == ""
    oracle = json.loads(out.stdout)
    assert oracle["indexed"] == (chunk_size > 0)
    assert oracle["profile"] == "ros2" and oracle["metadata"] == a.metadata
    assert list(oracle["topics"]) == list(a.topics)
    for topic, found in oracle["topics"].items():
        assert found["schema"] == a.topics[topic].schema
        assert [int(t) for t in found["t"]] == a.time_ns(topic).tolist()
        leaves = [np.array([leaf for leaf in flat(message)]) for message in found["messages"]]
        for ours, theirs in zip(a[topic], leaves):
            mine = np.concatenate([np.ravel(np.asarray(x, float)) for x in numbers(ours)])
            assert mine.tobytes() == theirs.tobytes()


def numbers(value):
    """The numbers of a numpy record in memory order."""
    if value.dtype.names:
        for name in value.dtype.names:
            for item in np.ravel(value[name]):
                yield from numbers(item)
    else:
        yield value


def flat(value):
    """The numbers of a decoded JSON message in order."""
    if isinstance(value, (dict, list)):
        for item in value.values() if isinstance(value, dict) else value:
            yield from flat(item)
    else:
        yield float(value)  # 64-bit integers and -0 come as text
