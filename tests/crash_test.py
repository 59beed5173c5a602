# SPDX-License-Identifier: Apache-2.0
"""A crash of a user's module is reported: which module, in which task, when, and the command of a debugger."""

import os
import re
import shlex
import signal
import subprocess

import pytest

from tests.needs import needs
from tests.project_test import fledge as fledge_within
from tests.tree import ROOT

HEADER = """/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_TRAP_H
#define FLIGHT_TRAP_H

#include "flight/msg/vehicle.h"

/** Does what it must not, at a time. */
typedef struct Trap {
    struct {
        BodyTorque torque; ///< none
    } out;
    struct {
        double after; ///< [s] when
        int64_t kind; ///< [-] what
    } par;
} Trap;

void trap_reset(Trap *m);
void trap_update(Trap *m, Tick t);

#endif
"""
SOURCE = """/* SPDX-License-Identifier: Apache-2.0 */
#include "flight/trap.h"

#include <string.h>

static int64_t deep(int64_t n)
{
    volatile char room[512];
    room[n % 512] = 1;
    return n > 0 ? deep(n - 1) + room[n % 512] : 0;
}

static int64_t large(int64_t n)
{
    volatile char room[1000000];
    room[n % 512] = 1;
    return n > 0 ? large(n - 1) + room[n % 512] : 0;
}

void trap_reset(Trap *m)
{
    memset(&m->out, 0, sizeof m->out);
    volatile double *volatile nowhere = NULL;
    if (m->par.kind == 9) {
        *nowhere = 1.0;
    }
}

void trap_update(Trap *m, Tick t)
{
    volatile int64_t zero = 0;
    volatile double *volatile nowhere = NULL;
    m->out.torque.head = head_next(m->out.torque.head, t.t, QUALITY_GOOD);
    if (tick_seconds(t.t) < m->par.after) {
        return;
    }
    switch (m->par.kind) {
    case 1: *nowhere = 1.0; break;
    case 2: m->out.torque.torque_B.v[0] = (double)(m->par.kind / zero); break;
    case 3: m->out.torque.torque_B.v[0] = (double)deep(INT64_MAX / 2); break;
    case 4: m->out.torque.torque_B.v[0] = (double)large(INT64_MAX / 2); break;
    case 5: __builtin_trap();
    case 6:
        while (zero == 0) {
        }
        break;
    default: break;
    }
}
"""
FLIGHT = """# SPDX-License-Identifier: Apache-2.0
from fledge import flight as fsw
from fledge.units import s


def build(f, kind=0):
    f.trap = fsw.Trap(after=2.125 * s, kind=kind)
    f.task("gnc", every=0.125 * s, run=[f.trap])
"""
DISPERSIONS = """# SPDX-License-Identifier: Apache-2.0
from fledge.units import s


def drawn(d):
    d.duration = 5 * s
    d.every = 1 * s
    d["flight.trap.kind"] = d.choice(0, 0, 0, 0, 0, 1)
    d.retain("flight.trap.torque.torque_B")
"""
WORLD = """# SPDX-License-Identifier: Apache-2.0
def build(w, f):
    w.at(3, lambda: None)
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A project with the module, and missions that fly it: `fall`; `python` calls Python too."""
    place = tmp_path_factory.mktemp("crash")
    fledge_within("new", "project", "sat", cwd=place)
    sat = place / "sat"
    fledge_within("new", "module", "Trap", cwd=sat)
    (sat / "flight/trap.h").write_text(HEADER)
    (sat / "flight/trap.c").write_text(SOURCE)
    (sat / "flight/trap_test.cpp").write_text("// SPDX-License-Identifier: Apache-2.0\n")
    for name in ("fall", "python"):
        mission = sat / "missions" / name
        mission.mkdir(parents=True)
        (mission / "flight.py").write_text(FLIGHT)
        (mission / "dispersions.py").write_text(DISPERSIONS)
    (sat / "missions/python/world.py").write_text(WORLD)
    fledge_within("list", cwd=sat)
    return sat


def flown(own, *arguments):
    """(the negative signal or exit code, stderr) of a command. Other tests may build meanwhile."""
    environment = {name: value for name, value in os.environ.items() if name != "FLEDGE_PROJECT"}
    done = subprocess.run([ROOT / "fledge", *map(str, arguments)], cwd=own, capture_output=True, text=True,
                          env=environment)
    return done.returncode, re.sub(r"^fledge: waiting for another fledge.*\n", "", done.stderr, flags=re.MULTILINE)


KINDS = [(1, signal.SIGSEGV, "segmentation fault (SIGSEGV)"),
         (2, signal.SIGFPE, "division of a whole number by zero (SIGFPE)"),
         (3, signal.SIGSEGV, "stack overflow"), (4, signal.SIGSEGV, "stack overflow"),
         (5, signal.SIGILL, "illegal instruction (SIGILL)")]


@pytest.mark.parametrize("kind, number, words", KINDS)
def test_a_crash_names_module_task_time_and_debugger(own, kind, number, words):
    code, stderr = flown(own, "run", "fall", "--for", "5s", "--set", f"kind={kind}")
    first, second = stderr.splitlines()
    assert code == -number
    assert first == f"fledge: {words} in flight.trap (Trap), task gnc, at t = 2.125 s"
    assert re.fullmatch(rf"fledge: a debugger shows where: ./fledge exec gdb -ex run --args .* run fall .*kind={kind}",
                        second)


@needs("gdb")
def test_the_debugger_stops_there(own):
    _, stderr = flown(own, "run", "fall", "--for", "5s", "--set", "kind=2")
    words = shlex.split(stderr.splitlines()[1].partition("where: ")[2])
    words[words.index("-ex")] = "-batch -ex"
    at = words.index("--args")
    shown = fledge_within(*" ".join(words[1:at]).split(), "-ex", "bt 1", *words[at:], cwd=own)
    assert "SIGFPE" in shown and "trap_update" in shown and "trap.c" in shown


@pytest.mark.long("waits for a limit of time")
def test_an_endless_loop_ends_at_the_limit(own):
    code, stderr = flown(own, "run", "fall", "--for", "5s", "--set", "kind=6", "--update-limit", "250ms")
    assert code == -signal.SIGXCPU
    first, second = stderr.splitlines()
    assert first == ("fledge: no end of the update in flight.trap (Trap), task gnc, at t = 2.125 s: it has taken "
                     "longer than 0.25 s")
    assert "--update-limit" in second
    # The sum of many updates is not one of them; nor is a pause between two.
    code, stderr = flown(own, "run", "fall", "--for", "3s", "--pace", "2", "--update-limit", "100ms")
    assert (code, stderr) == (0, "")
    code, stderr = flown(own, "run", "fall", "--for", "5s", "--update-limit", "soon")
    assert code == 2 and "--update-limit: expected a duration" in stderr


def test_a_crash_of_a_reset_has_no_task(own):
    code, stderr = flown(own, "run", "fall", "--for", "5s", "--set", "kind=9")
    assert code == -signal.SIGSEGV
    assert stderr.splitlines()[0] == "fledge: segmentation fault (SIGSEGV) in flight.trap (Trap)"


def test_a_campaign_names_the_run_and_the_command_for_it_alone(own):
    code, stderr = flown(own, "montecarlo", "fall", "--runs", 40, "--jobs", 2, "--seed", 3)
    match = re.search(r"segmentation fault \(SIGSEGV\) in flight.trap \(Trap\), task gnc, at t = 2.125 s, in run "
                      r"(\d+) of a campaign\n.*(montecarlo fall --seed 3 --only \d+)", stderr)
    assert code == -signal.SIGSEGV and match and match[2].endswith(f" {match[1]}")
    code, again = flown(own, *match[2].split())
    assert code == -signal.SIGSEGV and "flight.trap (Trap), task gnc, at t = 2.125 s" in again


@pytest.mark.long("a campaign that crashes")
def test_processes_of_a_campaign_tell_it_and_the_others_go_on(own):
    code, stderr = flown(own, "montecarlo", "python", "--runs", 12, "--jobs", 2, "--seed", 3)
    assert code == 1 and "in flight.trap (Trap), task gnc, at t = 2.125 s, in run " in stderr


def test_a_node_of_a_co_simulation_tells_it(own):
    code, stderr = flown(own, "node", "fall", "flight", "--until", "5s", "--set", "kind=2")
    assert code == 1, stderr
    assert stderr.count("by zero (SIGFPE) in flight.trap (Trap), task gnc, at t = 2.125 s") == 1
    code, stderr = flown(own, "node", "fall", "flight", "--until", "5s", "--set", "kind=6", "--update-limit", "200ms")
    assert code == 1 and "no end of the update in flight.trap (Trap), task gnc, at t = 2.125 s" in stderr


SCRIPT = """
import ctypes, faulthandler, os, signal, sys
import fledge
from fledge import Orbit, flight as fsw, world
from fledge.units import s

def trap(m, t, dt):
    if t >= 1.5:
        {inside}
    m.publish(m.reference)

def after():
    {after}

{before}
sim = fledge.Simulation("script")
sim.flight.slew = fsw.InertialPointing(update=trap)
sim.flight.task("gnc", every=0.5 * s, run=[sim.flight.slew])
sim.world.craft = world.Spacecraft(I_B=3, gravity=[world.EARTH], orbit=Orbit(world.EARTH, altitude=500e3))
sim.world.task("dynamics", every=0.5 * s, run=[sim.world.craft])
sim.world.at(3 * s, after) if {event} else None
sim.run(2 * s)
sim.run(2 * s)
after()
"""


def script(own, inside="pass", after="pass", before="pass", event=False):
    text = SCRIPT.format(inside=inside, after=after, before=before, event=event)
    return flown(own, "exec", "/usr/bin/python3", "-c", text)


CRASH = "ctypes.string_at(0)"


@pytest.mark.parametrize("before", ["pass", "faulthandler.enable()"])
@pytest.mark.parametrize("later", ["", "faulthandler.enable(); "])
def test_other_handlers_do_what_they_did(own, before, later):
    code, stderr = script(own, later + CRASH, before=before)
    assert code == -signal.SIGSEGV
    assert stderr.count("in flight.slew (InertialPointing), task gnc, at t = 1.5 s\n") == 1
    assert stderr.count("Fatal Python error: Segmentation fault") == ("faulthandler" in later + before), stderr


def test_signals_that_are_sent_are_reported_too(own):
    for name in ("SIGBUS", "SIGABRT"):
        code, stderr = script(own, f"os.kill(os.getpid(), signal.{name})")
        assert code == -getattr(signal, name)
        assert f"({name}) in flight.slew (InertialPointing), task gnc, at t = 1.5 s\n" in stderr


def test_a_crash_of_an_event_is_between_updates(own):
    code, stderr = script(own, after=CRASH, event=True)
    assert code == -signal.SIGSEGV
    assert stderr.splitlines()[0] == "fledge: segmentation fault (SIGSEGV) between updates, at t = 3 s"


def test_what_crashes_outside_of_a_run_is_not_of_a_module(own):
    assert script(own, after=CRASH) == (-signal.SIGSEGV, "")


CALLER = r"""
#include "targets/linux/crash.h"

#include <stdlib.h>

int main(int n, char **words)
{
    static volatile int64_t t = -1;
    crash_report("probe", words, &t);
    if (n > 2) {
        t = INT64_C(1012345678901);
    }
    volatile int *zero = NULL;
    words[1][0] == 's' ? (void)*zero : abort();
    return 0;
}
"""


def test_an_exported_program_tells_it(tmp_path):
    (tmp_path / "probe.c").write_text(CALLER)
    subprocess.run(["gcc", "-std=c99", "-O1", "-I", ROOT, tmp_path / "probe.c", ROOT / "targets/linux/crash.c", "-o",
                    tmp_path / "probe"], check=True)

    def run(*words):
        done = subprocess.run([tmp_path / "probe", *words], capture_output=True, text=True)
        return done.returncode, done.stderr.splitlines()

    debug = f"probe: a debugger shows where: gdb --args {tmp_path}/probe"
    assert run("segv", "--inputs") == (-signal.SIGSEGV, [
        "probe: segmentation fault, or stack overflow (SIGSEGV) in flight at t = 1012.345678901 s",
        f"{debug} segv --inputs"])
    assert run("abort") == (-signal.SIGABRT, ["probe: abort (SIGABRT)", f"{debug} abort"])
