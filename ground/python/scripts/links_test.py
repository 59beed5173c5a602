# SPDX-License-Identifier: Apache-2.0
"""Links on loopback and on a pseudo-terminal: what goes in comes out, whole and in order, or is counted."""
import os
import random
import resource
import socket
import struct
import subprocess
import sys
import threading

import pytest

import fledge
from fledge.commands import Dictionary, Packets
from fledge.errors import SetupError
from fledge.ground import open_link
from fledge.ground.scripts import links
from fledge.ground.scripts.links import Splitter, split
from tests.waiting import PATIENCE

SECOND = 10**9


def packets(n, seed=1):
    """Packets of all lengths that flight sends and takes, with any content."""
    draw = random.Random(seed)
    batch = []
    for i in range(n):
        data = draw.randbytes(draw.choice([1, 2, 9, 100, 520]))
        batch.append((0x0880 + draw.randrange(9)).to_bytes(2, "big") + (0xC000 | i).to_bytes(2, "big")
                     + (len(data) - 1).to_bytes(2, "big") + data)
    return batch


def gathered(link, n, seconds=PATIENCE):
    """The next n packets, or as many as come in time."""
    packets, end = [], link.t + int(seconds * SECOND)
    while len(packets) < n and link.t < end:
        packets += [unit.packet for unit in link.receive(end)]
    return packets


def free(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_udp_carries_both_ways_and_takes_several_packets_in_a_datagram():
    a, b = free(socket.SOCK_DGRAM), free(socket.SOCK_DGRAM)
    with open_link(f"udp://127.0.0.1:{a}?listen={b}") as ground, \
            open_link(f"udp://127.0.0.1:{b}?listen=127.0.0.1:{a}") as craft:
        sent = packets(40)
        for packet in sent[:20]:
            ground.send(packet)
        assert gathered(craft, 20) == sent[:20]
        craft.send(b"".join(sent[20:]) + b"\x08\x80\xc0\0\0\x09cut")
        assert gathered(ground, 20) == sent[20:]
        assert ground.skipped == 9 and craft.skipped == 0
        size = len(b"".join(sent[20:])) + 9
        assert ground.damages() == [f"9 bytes at the end of a datagram of {size} are no whole packet"]
        assert ground.damages() == []
        begin = ground.t
        assert ground.receive(begin + 30_000_000) == [] and ground.t >= begin + 30_000_000


def test_udp_outlives_that_no_program_listens():
    with open_link(f"udp://127.0.0.1:{free(socket.SOCK_DGRAM)}?listen={free(socket.SOCK_DGRAM)}") as link:
        for packet in packets(5):
            link.send(packet)
            link.receive(link.t + 1_000_000)


def test_a_server_sends_to_all_clients_and_takes_from_each():
    port, name = free(), "localhost"
    try:
        socket.getaddrinfo(name, port)
    except socket.gaierror:     # a bare container knows no names
        name = "127.0.0.1"
    with open_link(f"listen://{port}") as server, open_link(f"tcp://127.0.0.1:{port}") as first, \
            open_link(f"tcp://{name}:{port}") as second:
        sent = packets(300)
        for packet in sent[:100]:
            first.send(packet)
        for packet in sent[100:200]:
            second.send(packet)
        got = gathered(server, 200)
        assert [p for p in got if p in sent[:100]] == sent[:100] and sorted(got) == sorted(sent[:200])
        for packet in sent[200:]:
            server.send(packet)
        assert gathered(first, 100) == gathered(second, 100) == sent[200:]
        second.close()
        server.receive(server.t + 100_000_000)
        server.send(sent[0])
        assert gathered(first, 1) == [sent[0]]


def test_a_slow_reader_costs_packets_of_its_own_and_sees_no_half_one(monkeypatch):
    monkeypatch.setattr(links, "OUTBOX", 1 << 16)
    monkeypatch.setattr(links, "UNREAD", int(PATIENCE))
    port = free()
    with open_link(f"listen://{port}") as server, socket.create_connection(("127.0.0.1", port)) as slow, \
            open_link(f"tcp://127.0.0.1:{port}") as quick:
        server.receive(server.t + 100_000_000)
        sent = [bytes([8, 0x80, 0xC0 | i >> 8 & 0x3F, i & 255, 3, 255]) + bytes(1024) for i in range(16000)]
        got, stop = [], threading.Event()

        def read():
            while not stop.is_set():
                got.extend(packet.packet for packet in quick.receive(quick.t + SECOND // 10))
        reader = threading.Thread(target=read)
        reader.start()
        for i, packet in enumerate(sent):
            while i > len(got) + 50:    # the quick one keeps up
                server.receive(server.t + SECOND // 1000)
            server.send(packet)
        assert server.dropped > 0
        while len(got) < len(sent):
            server.receive(server.t + SECOND // 1000)
        slow.settimeout(2)
        stream = Splitter()
        seen = []
        try:
            while True:
                seen += stream.feed(slow.recv(1 << 20))
                server.receive(server.t)
        except TimeoutError:
            pass
        stop.set()
        reader.join()
        assert set(seen) <= set(sent) and seen == sorted(seen) and len(seen) < len(sent) and stream.skipped == 0
        assert got == sent


def test_a_server_has_few_clients_and_cuts_off_one_that_does_not_read(monkeypatch):
    monkeypatch.setattr(links, "CLIENTS", 2)
    monkeypatch.setattr(links, "UNREAD", 3)
    port = free()
    with open_link(f"listen://{port}") as server, open_link(f"tcp://127.0.0.1:{port}") as reader, \
            socket.create_connection(("127.0.0.1", port)) as deaf, \
            socket.create_connection(("127.0.0.1", port)) as third:
        while not server.refused:
            server.receive(server.t + SECOND // 100)
        third.settimeout(PATIENCE)
        assert third.recv(1) == b"" and server.refused == 1 and len(server._streams) == 2
        sent = packets(1)[0][:6] + bytes(100_000)
        while len(server._streams) == 2:
            server.send(sent)
            while reader.receive(reader.t + SECOND // 100):
                pass
            server.receive(server.t + SECOND // 100)
        assert len(server._streams) == 1 and deaf.fileno() >= 0
        with socket.create_connection(("127.0.0.1", port)):
            while len(server._streams) < 2:
                server.receive(server.t + SECOND // 100)


def test_descriptors_beyond_1023_work():
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(max(soft, 1200), hard), hard))
    held = []
    try:
        while not held or held[-1] < 1030:
            held.append(os.dup(0))
        a, b = free(socket.SOCK_DGRAM), free(socket.SOCK_DGRAM)
        port = free()
        with open_link(f"listen://{port}") as server, open_link(f"tcp://127.0.0.1:{port}") as client, \
                open_link(f"udp://127.0.0.1:{a}?listen={b}") as link, \
                open_link(f"udp://127.0.0.1:{b}?listen={a}") as two:
            sent = packets(20)
            for packet in sent:
                client.send(packet)
                link.send(packet)
            assert gathered(server, 20) == gathered(two, 20) == sent
    finally:
        for number in held:
            os.close(number)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_the_end_of_a_connection_is_an_error_of_a_client_alone():
    port = free()
    with open_link(f"listen://{port}") as server:
        client = open_link(f"tcp://127.0.0.1:{port}")
        server.receive(server.t + 100_000_000)
        server.close()
        with pytest.raises(ConnectionError, match="gone"):
            client.receive(client.t + SECOND)


def test_two_threads_share_a_link():
    port = free()
    with open_link(f"listen://{port}") as server, open_link(f"tcp://127.0.0.1:{port}") as client:
        sent = packets(4000)
        got = []
        receiver = threading.Thread(target=lambda: got.extend(gathered(client, len(sent))))
        echo = threading.Thread(target=lambda: [server.send(packet) for packet in sent])
        server.receive(server.t + 100_000_000)
        receiver.start()
        echo.start()
        while receiver.is_alive():
            server.receive(server.t + 20_000_000)
        echo.join()
        assert got == sent


def test_a_serial_device_carries_packets():
    craft, device = os.openpty()
    path = os.ttyname(device)
    with open_link(f"serial:{path}?baud=115200") as link:
        sent = packets(20)
        os.write(craft, b"\xff\xee" + b"".join(sent))
        assert gathered(link, 20) == sent and link.skipped == 2
        for packet in sent:
            link.send(packet)
        stream, got = Splitter(), []
        while len(got) < len(sent):
            got += stream.feed(os.read(craft, 4096))
        assert got == sent
        os.close(craft)
        os.close(device)
        with pytest.raises(ConnectionError, match="gone"):
            link.receive(link.t + SECOND)


def test_a_stream_is_found_again_after_damage():
    """Bytes are lost and changed in between; packets that lie whole behind the damage come out, none is invented."""
    dictionary = fledge.load("nadir_spin").flight.commands.dictionary
    accepts = fledge.ground.scripts.craft.accepts(dictionary)
    draw = random.Random(7)
    for _ in range(30):
        sent = [(dictionary.telemetry + draw.randrange(5)).to_bytes(2, "big") + (0xC000 | i).to_bytes(2, "big")
                + b"\0\x63" + bytes([i]) * 100 for i in range(60)]
        whole = b"".join(sent)
        cut = draw.randrange(1000, 3000)
        damaged = whole[:cut] + draw.randbytes(5) + whole[cut + draw.randrange(1, 90):]
        stream, got, at = Splitter(accepts), [], 0
        while at < len(damaged):
            n = draw.randrange(1, 200)
            got += stream.feed(damaged[at:at + n])
            at += n
        strange = [packet for packet in got if packet not in sent]
        assert len(strange) <= 1        # the one that was hit
        assert got[-20:] == sent[-20:] and len(got) >= 56


def telemetry(draw, n, applications=3, first=0):
    """Packets of some applications by turns, each with counts of its own, most with one size."""
    counts, made = [first] * applications, []
    for _ in range(n):
        which = draw.randrange(applications)
        size = 100 + 20 * which if draw.random() < 0.8 else draw.randrange(1, 600)
        made.append((0x0123 + which).to_bytes(2, "big") + (0xC000 | counts[which] % 0x4000).to_bytes(2, "big")
                    + (size - 1).to_bytes(2, "big") + draw.randbytes(size))
        counts[which] += 1
    return made


def fed(draw, stream, data, most):
    got, at = [], 0
    while at < len(data):
        n = draw.randrange(1, most)
        got += stream.feed(data[at:at + n])
        at += n
    return got


@pytest.mark.parametrize("most", [200, 5000, 100_000])
def test_a_damaged_length_loses_its_packet_alone_and_is_reported(most):
    """The length is greater than the packet, up to 64 KiB; the stream comes in pieces."""
    draw = random.Random(most)
    for _ in range(25):
        sent = telemetry(draw, 60, first=draw.randrange(0x4000))
        hit = draw.randrange(12, 40)
        begin, size = sum(map(len, sent[:hit])), len(sent[hit])
        wrong = draw.choice([0xFFFF, 0x7FFF, draw.randrange(size + 2000, 60000)])
        changed = sent[hit][:4] + wrong.to_bytes(2, "big") + sent[hit][6:]
        damaged = b"".join([*sent[:hit], changed, *sent[hit + 1:]])
        stream = Splitter()
        assert fed(draw, stream, damaged, most) == sent[:hit] + sent[hit + 1:]
        assert stream.skipped == size
        assert stream.damages == [
            f"{size} bytes of the stream from byte {begin} on are no packet: a packet of {wrong + 7} bytes would begin "
            "there, but others that continue those before stand inside of it"]


def test_a_stream_is_found_from_any_byte_on():
    draw = random.Random(3)
    for _ in range(25):
        sent = telemetry(draw, 60)
        cut = draw.randrange(1, len(sent[0]))
        stream = Splitter()
        got = fed(draw, stream, b"".join(sent)[cut:], 300)
        assert got[-40:] == sent[-40:] and [packet for packet in got if packet not in sent] == got[:len(got) - 59][:1]


@pytest.mark.parametrize("seed", range(100))
def test_a_stream_without_damage_loses_nothing_whatever_its_packets_hold(seed):
    """Short packets, whose data could be the headers of others."""
    draw = random.Random(seed)
    apps = range(1, 4) if seed % 3 == 0 else draw.sample(range(1, 2047), draw.randrange(1, 4))
    size, count = {app: draw.randrange(1, 13) for app in apps}, dict.fromkeys(apps, draw.choice([0, 1, 0x2000]))
    sent = []
    for i in range(draw.randrange(3, 150)):
        app = draw.choice(apps)
        data = (i.to_bytes(2, "big") * 6, b"\x01" * 12, draw.randbytes(12), bytes(12))[seed % 4]
        sent.append(struct.pack(">3H", app, 0xC000 | count[app], size[app] - 1) + data[:size[app]])
        count[app] += 1
    stream = Splitter()
    assert fed(draw, stream, b"".join(sent), draw.choice([4, 60, 100_000])) == sent and not stream.damages


def test_a_packet_may_hold_packets():
    """A dump of what a recorder kept before: it is one packet, however it arrives."""
    draw = random.Random(4)
    for most in (200, 100_000):
        sent = telemetry(draw, 40, first=500)
        kept = b"".join(telemetry(draw, 20, first=300))
        dump = b"\x01\x99\xc0\0" + (len(kept) - 1).to_bytes(2, "big") + kept
        stream = Splitter()
        sent.insert(20, dump)
        assert fed(draw, stream, b"".join(sent), most) == sent and not stream.damages


def test_packets_are_split_by_their_lengths():
    sent = packets(30)
    assert split(b"".join(sent)) == (sent, b"")
    assert split(sent[0] + sent[1][:-1]) == ([sent[0]], sent[1][:-1])
    assert split(b"\x08") == ([], b"\x08")


@pytest.mark.parametrize("address, says", [
    ("nonsense", "is no address of a link; an address is udp"),
    ("udp://127.0.0.1:10025", "is no address of a link"),
    ("udp://127.0.0.1:99999?listen=1", "out of range"),
    ("udp://127.0.0.1:10025?listen=abc", "a port is a whole number from 1 to 65535; found 'abc'"),
    ("udp://127.0.0.1:10025?listn=1", "there is no option listn; there is frames, listen"),
    ("tcp://127.0.0.1", "is no address of a link"),
    ("tcp://127.0.0.1:1", "Connection refused"),
    ("listen://", "found ''"),
    ("serial:/dev/nothing", "/dev/nothing"),
    ("serial:/dev/null?baud=fast", "baud is a whole number"),
    ("cosim:", "is no address of a link"),
])
def test_what_is_no_address_is_refused(address, says):
    with pytest.raises(SetupError, match=says.replace("(", r"\(")):
        open_link(address)


def test_a_port_that_is_taken_is_refused():
    port = free()
    with open_link(f"listen://{port}"), pytest.raises(SetupError, match="in use"):
        open_link(f"listen://{port}")


PLAIN = """
import sys
for name in ("aiohttp", "serial", "h5py", "scipy", "matplotlib", "jinja2"):
    sys.modules[name] = None
from fledge import ground
with ground.connect(*sys.argv[1:]) as craft:
    craft.command("noop")
    try:
        ground.connect("http://127.0.0.1:9/craft")
    except ModuleNotFoundError as error:
        print(error.name)
    import threading
    print(threading.active_count())
"""


def test_a_script_with_a_plain_link_needs_no_package_of_other_links(tmp_path):
    """That of a server names what is missing, and leaves no thread."""
    dictionary = fledge.load("nadir_spin").flight.commands.dictionary
    (tmp_path / "packets.json").write_text(dictionary.text())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flight:
        flight.bind(("127.0.0.1", 0))
        flight.settimeout(PATIENCE)
        address = f"udp://127.0.0.1:{flight.getsockname()[1]}?listen={free(socket.SOCK_DGRAM)}"
        done = subprocess.run([sys.executable, "-c", PLAIN, address, tmp_path / "packets.json"], capture_output=True,
                              text=True, timeout=PATIENCE)
        assert done.stdout.split() == ["aiohttp", "1"], done.stderr
        assert flight.recv(1000) == Packets(dictionary).noop()


def test_commands_are_made_of_names_and_quantities():
    from fledge.ground import packets as packets_of
    from fledge.units import N, kg, m

    dictionary = fledge.load("nadir_spin").flight.commands.dictionary
    assert isinstance(dictionary, Dictionary)
    assert packets_of(Packets(dictionary), "write", "flight.control", K=3 * N * m) \
        == Packets(dictionary).write("flight.control", K=3.0)
    for words, says in [(("wirte", "flight.control"), "did you mean 'write'"), (("mode",), "mode takes mode: missing"),
                        (("write", "flight.control"), "give parameters")]:
        with pytest.raises(SetupError, match=says):
            packets_of(Packets(dictionary), *words)
    with pytest.raises(SetupError, match="flight.control.K: expected a quantity in N m"):
        packets_of(Packets(dictionary), "write", "flight.control", K=3 * kg)
