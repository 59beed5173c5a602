# SPDX-License-Identifier: Apache-2.0
"""`fledge load`: what goes into a board, by a stand-in of openocd and by the real one without a probe; and onto a host,
by a real server of ssh."""
import getpass
import os
import shlex
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from fledge import cli, elf
from fledge.errors import Failure
from fledge.targets import boards, probe
from tests.needs import needs, skip_without

BOARDS = sorted(boards())
SSHD = shutil.which("sshd") or shutil.which("sshd", path="/usr/sbin:/usr/local/sbin")


def program(path, board, size=256, machine=None, bits=None, flags=0, kind=elf.EXECUTABLE, at=None):
    """Write a program that a linker would have made for a board: `size` bytes where it loads, and as many of RAM."""
    numbers = {"ARM": {32: 40, 64: 183}, "RISC-V": {32: 243, 64: 243}, "SPARC": {32: 2, 64: 43}}
    machine, bits = machine or board.processor, bits or board.bits
    begin = next(area.begin for area in board.memory if area.loads) if at is None else at
    ram = board.memory[-1].begin + board.memory[-1].size - 256
    word, length = ("I", 32) if bits == 32 else ("Q", 56)
    head = 52 if bits == 32 else 64
    order = ">" if machine == "SPARC" else "<"

    def segment(offset, at, load, stored, wide):
        return struct.pack(f"{order}8I", 1, offset, at, load, stored, wide, 5, 4) if bits == 32 else \
            struct.pack(f"{order}2I6Q", 1, 5, offset, at, load, stored, wide, 4)

    note = struct.pack(f"{order}3I4s4s", 4, 4, 3, b"GNU\0", b"\x12\x34\xab\xcd")
    text = note + bytes(max(0, size - len(note)))
    data = b"\x7fELF" + bytes([bits // 32, 1 + (order == ">"), 1]) + bytes(9) + struct.pack(
        f"{order}HHI3{word}I6H", kind, numbers[machine][bits], 1, begin + 0x14, head, 0, flags, head, length, 2,
        0, 0, 0)
    data += segment(head + 2 * length, begin, begin, size, size) + segment(0, ram, ram, 0, 256)
    path.write_bytes(data + text)
    return path


@pytest.fixture
def openocd(tmp_path, monkeypatch):
    """A stand-in that prints `text` and returns `code`, by openocd(text, code); .words() are its arguments."""
    folder = tmp_path / "bin"
    folder.mkdir()
    log = tmp_path / "said"

    def make(text="** Verified OK **", code=0):
        (folder / "openocd").write_text(f"#!/bin/sh\nprintf '%s\\n' \"$@\" > {log}\necho {shlex.quote(text)}\n"
                                        f"exit {code}\n")
        (folder / "openocd").chmod(0o755)

    make()
    make.words = lambda: log.read_text().splitlines() if log.exists() else None
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    return make


@pytest.mark.parametrize("name", BOARDS)
def test_a_program_is_loaded_by_the_boards_own_commands(name, tmp_path, openocd, capsys):
    board = probe.board(name)
    file = program(tmp_path / "my sat.elf", board)
    assert cli.main(["load", name, str(file), "--probe", "0123"]) == 0
    words, shown = openocd.words(), capsys.readouterr().out
    assert words[:2] == ["-c", "adapter serial 0123"]
    options = list(zip(words[2::2], words[3::2]))
    assert options == [*(("-f", script) for script in board.scripts), *(("-c", command) for command in board.commands),
                       *(("-c", word.format(file="{" + str(file) + "}", entry=hex(elf.read(file).entry)))
                         for word in board.load)]
    assert shlex.join(["openocd", *words]) in shown and "build id 1234abcd" in shown and "loaded, and started" in shown


def test_a_dry_run_prints_the_command_alone(tmp_path, openocd, capsys):
    file = program(tmp_path / "a.elf", probe.board("nucleo-h743zi"))
    assert cli.main(["load", "nucleo-h743zi", str(file), "--dry-run"]) == 0
    assert openocd.words() is None
    assert capsys.readouterr().out.splitlines()[1].strip() == (
        f"openocd -f board/st_nucleo_h743zi.cfg -c 'program {{{file}}} verify reset exit'")


@pytest.mark.parametrize("how, reason", [
    (dict(machine="SPARC", bits=32), "for another processor: it is for SPARC, 32 bits, big-endian, nucleo-h743zi has "
     "ARM, 32 bits"),
    (dict(bits=64), "for another processor: it is for ARM, 64 bits"),
    (dict(kind=1), "no linked program"), (dict(kind=3), "no linked program"),
    (dict(size=0x200001), "larger than the flash of nucleo-h743zi: 2097153 bytes from 0x08000000 on, and 2097152 are"),
    (dict(at=0x81ffffc), "larger than the flash of nucleo-h743zi: 256 bytes from 0x081ffffc on, and 4 are"),
    (dict(at=0x8000), "256 bytes at 0x00008000, where nucleo-h743zi has no memory for them; link it for flash at "
     "0x08000000, 2048 KiB"),
    (dict(at=0x24000000), "256 bytes at 0x24000000, where nucleo-h743zi has no memory for them"),   # lost at a reset
])
def test_a_program_that_cannot_run_there_is_refused_before_anything_is_sent(how, reason, tmp_path, openocd, capsys):
    file = program(tmp_path / "a.elf", probe.board("nucleo-h743zi"), **how)
    assert cli.main(["load", "nucleo-h743zi", str(file)]) == 2
    error = capsys.readouterr().err
    assert reason in error and error.count("\n") == 1 and openocd.words() is None


def test_a_program_as_large_as_the_flash_is_loaded(tmp_path, openocd):
    file = program(tmp_path / "a.elf", probe.board("nucleo-h743zi"), size=0x200000)
    assert cli.main(["load", "nucleo-h743zi", str(file)]) == 0 and openocd.words()


def test_doubles_in_hardware_are_refused_where_there_are_none(tmp_path, openocd, capsys):
    file = program(tmp_path / "a.elf", probe.board("hifive1-revb"), flags=4)
    assert cli.main(["load", "hifive1-revb", str(file)]) == 2
    assert "built for 64-bit floating point in hardware, which hifive1-revb lacks" in capsys.readouterr().err
    file = program(tmp_path / "b.elf", probe.board("hifive-unmatched"), flags=5)
    assert cli.main(["load", "hifive-unmatched", str(file)]) == 0


@pytest.mark.parametrize("content, reason", [
    (None, "no such file or directory; name the program"), (b"", "is no ELF file"), (b":10000000", "is no ELF file"),
    (b"\x7fELF\x01\x01" + bytes(12), "is cut off"), (b"\x7fELF\x03\x01" + bytes(60), "is no ELF file"),
])
def test_what_is_no_program_is_refused(content, reason, tmp_path, capsys):
    file = tmp_path / "a.elf"
    if content is not None:
        file.write_bytes(content)
    assert cli.main(["load", "nucleo-h743zi", str(file)]) == 2
    error = capsys.readouterr().err
    assert str(file) in error and reason in error and error.count("\n") == 1


def test_a_program_is_refused_wherever_it_is_cut_off(tmp_path):
    data = program(tmp_path / "whole.elf", probe.board("nucleo-h743zi")).read_bytes()
    for n in range(len(data)):
        (tmp_path / "cut.elf").write_bytes(data[:n])
        with pytest.raises(Failure, match="is cut off|is no ELF file"):
            elf.read(tmp_path / "cut.elf")


@pytest.mark.parametrize("text, reason", [
    ("Error: open failed", "no debug probe of this board is found"),
    ("Error: libusb_open() failed with LIBUSB_ERROR_ACCESS", "join the group plugdev"),
    ("Error: libusb_claim_interface() failed with LIBUSB_ERROR_BUSY", "another program holds the debug probe"),
    ("** Verify Failed **", "is not the program"),
    ("Error: init mode failed (unable to connect to the target)", "but not this processor"),
    ("Error: JTAG tap: riscv.cpu UNEXPECTED: 0x1000563d", "but not this processor"),
    ("Error: the moon is full\nshutdown command invoked", "Error: the moon is full"), ("", "it gives no reason"),
])
def test_what_openocd_says_is_reported_with_a_remedy(text, reason, tmp_path, openocd, capsys):
    openocd(text, 1)
    file = program(tmp_path / "a.elf", probe.board("nucleo-h743zi"))
    assert cli.main(["load", "nucleo-h743zi", str(file)]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"fledge: load: openocd has not loaded {file}: ") and reason in error


@needs("openocd")
@pytest.mark.parametrize("name", BOARDS)
def test_the_real_openocd_takes_the_description_of_a_board(name, tmp_path):
    """All commands before it connects; a script that connects by itself is left out."""
    board = probe.board(name)
    command = board.command(elf.read(program(tmp_path / "a.elf", board)), "0123")
    if name == "hifive1-revb":
        assert (Path("/usr/share/openocd/scripts") / board.scripts[0]).is_file()
        return
    command = [*command[:len(command) - 2 * len(board.load)], "-c", "noinit", "-c", "shutdown"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and "Error" not in done.stderr, done.stderr


def test_a_wrong_description_of_a_board_is_refused_by_line(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "targets/mine/boards"
    folder.mkdir(parents=True)
    (folder / "my_board.toml").write_text('about = "mine"\nprocessor = "arm"\nbits = 16\nload = [1]\nscript = []\n'
                                          '[[memory]]\nname = "flash"\nbegin = 0\nsize = 0\n')
    monkeypatch.setattr("fledge.targets.PLACES", [tmp_path / "targets"])
    assert cli.main(["load", "my-board", "a.elf"]) == 2
    error = capsys.readouterr().err
    for line, what in ((2, "`processor` must say which"), (3, "`bits` must say which"),
                       (4, "`load` is a list of texts"), (5, "did you mean `scripts`?"), (6, "none has loads = true"),
                       (9, "`size` is from 1")):
        assert any(f"my_board.toml:{line}: " in text and what in text for text in error.splitlines()), (line, error)
    assert cli.main(["load", "my-bord", "a.elf"]) == 2
    assert "there is no board 'my-bord'; did you mean 'my-board'?" in capsys.readouterr().err


@pytest.mark.parametrize("words, reason", [
    (["nucleo-h743zi", "a.elf", "--ssh", "ssh"], "load: --ssh is for ssh:HOST"),
    (["nucleo-h743zi", "a.elf", "spin"], "load: scenario is for ssh:HOST"),
    (["nucleo-h743zi", "a.elf", "--set", "n=1"], "load: --set is for ssh:HOST"),
    (["ssh:pi", "nadir_spin", "--dry-run"], "load: --dry-run is for a board"),
    (["ssh:", "nadir_spin"], "expected ssh:HOST or ssh:USER@HOST; found 'ssh:'"),
    (["ssh:-oProxyCommand=x", "nadir_spin"], "expected ssh:HOST or ssh:USER@HOST"),
    (["ssh:pi", "nadir_spin", "--ssh", "no_such_ssh"], "there is no no_such_ssh"),
])
def test_wrong_words_are_refused(words, reason, capsys):
    assert cli.main(["load", *words]) == 2
    assert reason in capsys.readouterr().err


# --- ssh -------------------------------------------------------------------------------------------

@pytest.fixture
def server(tmp_path):
    """server(machine) returns how ssh is called to reach a real server, which begins with the connection: it has keys,
    files and a user of its own, and no port. machine: what `uname -m` says there; "": that of this machine."""
    skip_without("openssh-server", "openssh-client")
    for name in ("host", "user"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / name], check=True)
    if os.getuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)      # it wants this folder, which its service makes
    fake = tmp_path / "there"
    fake.mkdir()

    def make(machine="", home=None):
        if machine:
            (fake / "uname").write_text(f"#!/bin/sh\necho {machine}\n")
            (fake / "uname").chmod(0o755)
        (tmp_path / "sshd_config").write_text(
            f"HostKey {tmp_path}/host\nAuthorizedKeysFile {tmp_path}/user.pub\nStrictModes no\nUsePAM no\n"
            f"PermitRootLogin yes\nPasswordAuthentication no\nKbdInteractiveAuthentication no\nPidFile none\n"
            f"SetEnv PATH={fake}:/usr/local/bin:/usr/bin:/bin\n"
            + (f'ForceCommand cd {home} && eval "$SSH_ORIGINAL_COMMAND"\n' if home else ""))
        if home:
            home.mkdir()
        key = (tmp_path / "host.pub").read_text().split()
        (tmp_path / "known").write_text(f"board {key[0]} {key[1]}\n")
        return shlex.join(["ssh", "-F", "none", "-o", f"ProxyCommand={SSHD} -i -f {tmp_path}/sshd_config",
                           "-o", f"UserKnownHostsFile={tmp_path}/known", "-o", "BatchMode=yes", "-o",
                           "LogLevel=ERROR", "-i", f"{tmp_path}/user"])

    return make


def run_there(ssh, command):
    return subprocess.run([*shlex.split(ssh), f"{getpass.getuser()}@board", command], stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, check=True).stdout


def test_a_program_is_built_for_a_host_copied_and_flies_there(server, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ssh, there = server(), tmp_path / "on the board"
    words = ["load", f"ssh:{getpass.getuser()}@board", "nadir_spin", "--ssh", ssh, "--to", str(there)]
    assert cli.main(words) == 0, capsys.readouterr()
    shown = capsys.readouterr().out
    file = there / "nadir_spin"
    assert file.read_bytes() == (tmp_path / "runs/nadir_spin/fly/linux/nadir_spin").read_bytes()
    assert sorted(path.name for path in there.iterdir()) == ["nadir_spin", "nadir_spin-line"]
    by_clock = shlex.split(shown.splitlines()[1])
    assert by_clock[-2:] == [f"{getpass.getuser()}@board", f"{shlex.quote(str(file))} --clock --for 60"]
    figures = dict(line.split(maxsplit=1) for line in run_there(
        ssh, f"cd {shlex.quote(str(there))} && ./nadir_spin --clock --for 0.1 --record a.mcap").splitlines()
        if " " in line)
    assert int(figures["ticks"]) > 0 and (there / "a.mcap").stat().st_size > 0
    # One that flies stays as it is: the new one gets its name at the end.
    with subprocess.Popen([file, "--clock"], stdout=subprocess.DEVNULL, cwd=there) as flying:
        assert cli.main(words) == 0
        assert flying.poll() is None
        flying.terminate()


@needs("gcc-aarch64-linux-gnu", "libc6-dev-arm64-cross")
def test_a_raspberry_pi_gets_a_program_of_its_own(server, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    there = tmp_path / "there/fledge"
    assert cli.main(["load", f"ssh:{getpass.getuser()}@board", "nadir_spin", "--ssh", server("aarch64"), "--to",
                     str(there)]) == 0, capsys.readouterr()
    assert elf.read(there / "nadir_spin").processor == "ARM, 64 bits"


def test_a_host_that_cannot_fly_is_refused_before_anything_is_built(server, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    host = f"ssh:{getpass.getuser()}@board"
    assert cli.main(["load", host, "nadir_spin", "--ssh", server("armv7l")]) == 2
    assert f"{host[4:]} has armv7l" in (error := capsys.readouterr().err) and error.count("\n") == 1
    ssh = server()
    (tmp_path / "user.pub").write_text("")      # it does not know this user
    assert cli.main(["load", host, "nadir_spin", "--ssh", ssh]) == 1
    assert "Permission denied" in (error := capsys.readouterr().err) and "must work before" in error
    (tmp_path / "known").write_text("")         # the user has not confirmed the host
    assert cli.main(["load", host, "nadir_spin", "--ssh", ssh]) == 1
    assert "Host key verification failed" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


def test_what_a_host_cannot_keep_is_reported(server, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    assert cli.main(["load", f"ssh:{getpass.getuser()}@board", "nadir_spin", "--ssh", server(), "--to",
                     str(tmp_path / "taken")]) == 1
    assert "taken" in capsys.readouterr().err


def test_a_host_flies_in_the_loop_with_ssh_as_its_line(server, tmp_path, monkeypatch, capsys):
    """In a folder of the user's home there; without Fledge."""
    monkeypatch.chdir(tmp_path)
    host, ssh = f"ssh:{getpass.getuser()}@board", server(home=tmp_path / "home")
    assert cli.main(["fly", "nadir_spin", "--on", host, "--ssh", ssh, "--for", "10s"]) == 0, capsys.readouterr()
    assert f"passed   desktop, ssh-{getpass.getuser()}-board" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "home/fledge/nadir_spin").iterdir()] == ["nadir_spin-line"]
