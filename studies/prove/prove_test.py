# SPDX-License-Identifier: Apache-2.0
"""What a proof finds of faults that are planted into a small module of a project, and that it proves what has none."""

import dataclasses
from pathlib import Path

import pytest

from fledge import prove
from fledge.errors import Failure
from fledge.prove import loops
from tests.circles import long_after
from tests.needs import needs

pytestmark = [needs("frama-c-base"), pytest.mark.spread]

HEADER = """\
#ifndef FLIGHT_PROBE_H
#define FLIGHT_PROBE_H

#include "flight/msg/vehicle.h"

/** Scale a torque. */
typedef struct Probe {
    struct {
        BodyTorque torque;
    } in;
    struct {
        BodyTorque scaled;
    } out;
    struct {
        uint32_t n;      ///< [-] in [1, 4]: how many gains
        uint32_t spare;
        double gains[4]; ///< [-] count n: their product is the gain
    } par;
    struct {
        uint32_t next;  ///< [-] of the gains
        uint32_t calls; ///< [-] updates
    } mem;
} Probe;

void probe_reset(Probe *m);
void probe_update(Probe *m, Tick t);

#endif
"""

SOURCE = """\
#include "flight/probe.h"

#include <string.h>

static double gain(const Probe *m)
{
    double product = 1.0;
    for (uint32_t i = 0u; i < m->par.n; i++) {
        product *= m->par.gains[i];
    }
    return product;
}

void probe_reset(Probe *m)
{
    memset(&m->out, 0, sizeof m->out);
    memset(&m->mem, 0, sizeof m->mem);
}

void probe_update(Probe *m, Tick t)
{
    const BodyTorque *in = &m->in.torque;
    const Vec3 torque_B = vec_scale(gain(m), in->torque_B);
    m->mem.next = (m->mem.next + 1u) % m->par.n;
    if (head_written(in->head) && vec_finite(torque_B)) {
        m->out.scaled = (BodyTorque){head_next(m->out.scaled.head, t.t, quality_through(in->head)), torque_B};
    } else {
        m->out.scaled.head = head_held(m->out.scaled.head);
    }
}
"""

NEXT = "(m->mem.next + 1u) % m->par.n;"

# What is planted into one module: (text, text in its place, the kind of the alarm, a text of its line).
FAULTS = {
    "an index off by one": ("i < m->par.n", "i <= m->par.n", "index out of range", "product *="),
    "a division unguarded": (NEXT, f"{NEXT}\n    m->mem.next /= in->head.sequence;", "division by zero", "mem.next /="),
    "a NaN let through": (" && vec_finite(torque_B)", "", "not finite while GOOD", "probe_update"),
    "an infinity converted": (NEXT, f"{NEXT}\n    m->mem.next += (uint32_t)torque_B.v[0];",
                              "conversion of a number that is not finite", "(uint32_t)torque_B"),
    "a row that does not count": (NEXT, f"{NEXT}\n    m->mem.next += (uint32_t)m->par.gains[3];",
                                  "conversion of a number that is not finite", "gains[3]"),
    "a read before it is set": ("double product = 1.0",
                                "double product;\n    if (m->par.n > 1u)\n        product = 1.0",
                                "read before it is set", "product *="),
    "a shift too far": (NEXT, f"{NEXT}\n    m->mem.next += 1u << in->head.sequence;", "shift out of range", "1u <<"),
}


def project(folder: Path, *changes: tuple[str, str], header: str = HEADER) -> Path:
    """A project with the module, after changes of its source."""
    source = SOURCE
    for old, new in changes:
        assert old in source
        source = source.replace(old, new)
    (folder / "flight").mkdir()
    (folder / "flight/probe.h").write_text(header, encoding="utf-8")
    (folder / "flight/probe.c").write_text(source, encoding="utf-8")
    return folder


def proved(folder: Path, **options: bool) -> prove.Result:
    result, = prove.prove(["Probe"], folder, **options)
    return result


def test_a_module_is_proved_for_any_bits(tmp_path: Path) -> None:
    """Its loops have bounds, by parameters within theirs; the result is kept until a source changes."""
    folder = project(tmp_path)
    result = proved(folder)
    assert result.proved and result.inputs == "any bits" and not result.alarms
    assert [(loop.function, loop.bound, loop.how) for loop in result.loops if loop.file == "flight/probe.c"] == \
        [("gain", 4, "proved")]
    assert (folder / "build/prove/Probe.json").is_file() and proved(folder) == result
    assert prove.kept(folder) == [result]
    source = folder / "flight/probe.c"
    source.write_text(source.read_text().replace("1.0", "2.0"))
    assert prove.kept(folder) == []


def test_planted_faults_are_found(tmp_path: Path) -> None:
    folder = project(tmp_path, *((old, new) for old, new, _, _ in FAULTS.values()))
    result = proved(folder)
    lines = (folder / "flight/probe.c").read_text().splitlines()
    found = {(alarm.kind, lines[alarm.line - 1]) for alarm in result.left if alarm.file == "flight/probe.c"}
    missing = [fault for fault, (_, _, kind, place) in FAULTS.items()
               if not any(kind == of and place in line for of, line in found)]
    assert not missing and not result.proved
    places = [place for _, _, _, place in FAULTS.values()]
    assert [line for _, line in found if not any(place in line for place in places)] == []


def test_a_fault_that_needs_more_than_the_header_allows_is_beyond_but_for_nan(tmp_path: Path) -> None:
    """The index is a number of the input, which the header bounds. No header keeps NaN away."""
    header = HEADER.replace("typedef struct Probe {", "typedef struct Choice {\n    Head head;\n    uint32_t of;    "
                            "///< [-] in [0, 3]: which gain\n    uint32_t spare;\n} Choice;\n\n/** Choose. */\n"
                            "typedef struct Probe {").replace("torque;\n    } in;", "torque;\n        Choice choice;\n"
                                                              "    } in;")
    folder = project(tmp_path, ("return product", "return product * m->par.gains[m->in.choice.of]"),
                     ("vec_finite(torque_B)", "gain(m) > 0.0"), ("torque_B};", "in->torque_B};"), header=header)
    result = proved(folder)
    assert not result.proved and result.inputs == "as declared"
    assert {(alarm.kind, alarm.state) for alarm in result.alarms} == {
        ("index out of range", "beyond"), ("not finite while GOOD", "alarm")}


def test_an_alarm_is_named_open_beside_it(tmp_path: Path) -> None:
    folder = project(tmp_path, (NEXT, "100u / (4u - m->par.n); /* open: n is never 4 */"))
    result = proved(folder)
    assert result.proved and [(a.state, a.reason) for a in result.alarms] == [("open", "n is never 4")]


def test_a_loop_without_a_bound(tmp_path: Path) -> None:
    """It is no proof; with a bound in a comment it is a bound that is stated."""
    loop = "while (product < gain_of(product)) {\n        product += 1.0;\n    }\n    return product;"
    other = "static double gain_of(double x)\n{\n    return x * 2.0;\n}\n\nstatic double gain("
    folder = project(tmp_path, ("    return product;", "    " + loop), ("static double gain(", other))
    result = proved(folder)
    assert not result.proved and [loop.function for loop in result.endless] == ["gain"]
    source = folder / "flight/probe.c"
    source.write_text(source.read_text().replace("    while", "    /* at most 1100: it doubles */\n    while"))
    assert [(loop.bound, loop.how, loop.reason) for loop in proved(folder).loops if "it" in loop.reason] == \
        [(1100, "stated", "it doubles")]


def test_a_call_that_does_not_return_is_an_alarm(tmp_path: Path) -> None:
    folder = project(tmp_path, ("    if (head_written", "    for (;;) {\n        m->mem.calls = 1u;\n    }\n"
                                "    if (head_written"))
    result = proved(folder)
    assert "each call returns" in [alarm.text for alarm in result.left] and not result.proved


def test_recursion_is_refused(tmp_path: Path) -> None:
    folder = project(tmp_path, ("return product;", "return product > 2.0 ? product : gain(m);"))
    with pytest.raises(Failure, match=r"Probe: .*gain calls itself; .*write a loop"):
        proved(folder)


def test_what_cannot_be_read_says_where(tmp_path: Path) -> None:
    folder = project(tmp_path, ("double product = 1.0", "double product = missing(m)"))
    with pytest.raises(Failure, match="Probe: no source of missing was found"):
        proved(folder)
    with pytest.raises(Failure, match="no module, folder or driver 'Prob'; did you mean 'Probe'"):
        prove.prove(["Prob"], folder)


def test_without_frama_c_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(Failure, match="Frama-C is not installed; as root, run: apt-get install frama-c-base"):
        prove.prove(["MrpSteering"])


@pytest.mark.parametrize("name", long_after(1, ["RateDamping", "VehicleConfig", "MrpFeedback"], "an analysis"))
def test_modules_of_fledge_are_proved(name: str) -> None:
    result, = prove.prove([name])
    assert result.proved and result.inputs == "any bits" and result.reached > 0.8 * result.statements


PROVED = """
ArrayDriveCommandChoice ArrayPointing AttitudeMekf AttitudeMiscompare AttitudeUkf BDot BaseReference BodyDirection
BootCount BurnExecution BurnMemory BurnPlan BurnPointing BurnSchedule ChebyshevEphemeris DeltaVAccumulation
EarthOnBoard EclipseOnBoard ElementEphemeris EulerRotation FieldDirection FieldOnBoard FormationKeeping FormationRoll
GimbalRatesChoice GimbalSteering GimbalTorquesChoice GroundPass GroundTarget GyroRates GyroSelect HillPointing
InertialPointing InertialSpin KeepOut MagneticPointing MomentumDump MoonOnBoard MrpSteering NeuralFeedback NvmShare
OrbitBeacon OrbitFilter OrbitOnBoard OrbitPropagator PanelCommandChoice PowerManager PropulsionManager Quest RateServo
RodCommandChoice RodConfig RodTorques RodWindow SeenTarget SlewProfile StarSelect StarTrackerAttitude SunDirection
SunLine SunOnBoard SunPyramids SunSafe TachometerSpeeds ThrusterConfig ThrusterFiring ThrusterTimesChoice
ThrusterValvesChoice TimeCorrelation TrackingError Triad TwoBodyPointing UtcCorrelation VectorFilter VehicleTime
VelocityPointing
WheelBalance WheelCommandChoice WheelConfig WheelDriveChoice WheelDriveCounts WheelMonitor WheelTorques
flight/math/elementary flight/math/vec ccsds/space_packet ccsds/sync ccsds/tc_frame ccsds/tm_frame
flight/exec/exec""".split()
SLOW = {"SunLine"}      # 15 minutes; the others take one at most


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.long("an analysis", share=name not in SLOW))
                                  for name in PROVED])
def test_what_is_proved_stays_proved(name: str) -> None:
    """An alarm that is left names its place."""
    for result in prove.prove([name]):
        assert [*result.left, *result.endless] == []
