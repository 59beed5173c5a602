# SPDX-License-Identifier: Apache-2.0
"""Objects on C memory: values, shapes, lifetimes, and modules tried alone."""

import gc
import inspect
import os
import resource
import sys
import weakref

import numpy as np
import pytest

from fledge import SetupError, flight as fsw, objects, world
from fledge.objects.testing import kinds
from fledge.units import N, deg, kg, km, m, mm, s

AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


# --- values and shapes -----------------------------------------------------------------------------

def test_attributes_are_the_memory():
    c = fsw.MrpFeedback(K=2.5 * N * m, P=45.0)
    field = next(f for f in objects.struct(c).fields if f.name == "K")
    assert np.frombuffer(objects.memory(c)[field.offset:field.offset + 8])[0] == c.K == 2.5
    c.P[1, 2] = 7.0
    assert c.P[1, 2] == 7.0 and np.shares_memory(c.P, c.P)


@pytest.mark.parametrize(
    "given, matrix",
    [
        (45.0, 45 * np.eye(3)),
        (45, 45 * np.eye(3)),
        ([1, 2, 3], np.diag([1.0, 2, 3])),
        (np.array([1.0, 2, 3]), np.diag([1.0, 2, 3])),
        ([[1, 2, 3], (4, 5, 6), [7, 8, 9.5]], [[1, 2, 3], [4, 5, 6], [7, 8, 9.5]]),
        (np.arange(9.0).reshape(3, 3).T, np.arange(9.0).reshape(3, 3).T),
        (np.arange(9).reshape(3, 3), np.arange(9.0).reshape(3, 3)),
        (np.arange(9, dtype=np.float32).reshape(3, 3), np.arange(9.0).reshape(3, 3)),
        (np.arange(18.0).reshape(3, 6)[:, ::2], np.arange(18.0).reshape(3, 6)[:, ::2]),
        (np.float64(4.0), 4 * np.eye(3)),
        (np.float16(4.0), 4 * np.eye(3)),
        (np.longdouble(4.0), 4 * np.eye(3)),
        (np.array(4.0, np.longdouble), 4 * np.eye(3)),
        (np.array([1, 2, 3], np.longdouble) * N * m * s, np.diag([1.0, 2, 3])),
        (np.array([1, 2, 3], object), np.diag([1.0, 2, 3])),
        (np.array([1, 2, 3], ">f8"), np.diag([1.0, 2, 3])),
        (np.ma.array([1.0, 2, 3]), np.diag([1.0, 2, 3])),
        (np.array(4.0), 4 * np.eye(3)),
        (2.0 * N * m * s, 2 * np.eye(3)),
        ([1000, 2000, 3000] * N * mm * s, np.diag([1.0, 2, 3])),
        ([1 * N * m * s, 2000 * N * mm * s, 3], np.diag([1.0, 2, 3])),
        (np.eye(3) * N * m * s, np.eye(3)),
    ],
)
def test_a_matrix_is_given_in_many_ways(given, matrix):
    np.testing.assert_array_equal(fsw.MrpFeedback(K=1, P=given).P, matrix)


@pytest.mark.parametrize("given", [
    np.complex64(1), np.clongdouble(1), np.array([1, 2, 3], complex), np.datetime64("2026-01-01", "ns"),
    np.timedelta64(3, "ns"), np.array([1, 2, 3], "m8[ns]"), np.ma.masked, np.ma.array(1.0, mask=True),
    np.ma.array([1.0, 2, 3], mask=[0, 1, 0]), np.ma.array([1, 2, 3], mask=[0, 1, 0]), np.ma.masked * N * m * s,
    np.array([1, None, 3], object), np.zeros(3, [("a", float)]), np.str_("1"), np.array(["1", "2", "3"])], ids=repr)
def test_what_numpy_has_besides_numbers_is_refused(given):
    module = fsw.MrpFeedback(K=1, P=2)
    with pytest.raises(SetupError, match=r"MrpFeedback.P: expected shape \(3, 3\), or 3 numbers for the diagonal"):
        module.P = given
    np.testing.assert_array_equal(module.P, 2 * np.eye(3))


def test_units_are_converted():
    assert fsw.EulerRotation(rates=[0, 0, 0.3 * deg / s]).rates[2] == 0.3 * np.pi / 180
    assert world.Spacecraft(I_B=1, r_BN_N=[1, 2, 3] * km).r_BN_N.tolist() == [1000.0, 2000.0, 3000.0]
    assert world.Spacecraft(I_B=1, mass=500 * kg).mass == 500.0


def test_a_pint_quantity_is_taken_without_importing_pint():
    class Pint:  # what is used of a pint quantity
        def __init__(self, magnitude, dimensions):
            self.magnitude, self.dimensionality = magnitude, dimensions

        def to_base_units(self):
            return Pint(self.magnitude * 1e-3, self.dimensionality)

    torque = {"[length]": 2, "[mass]": 1, "[time]": -2}
    assert fsw.MrpFeedback(K=Pint(2500.0, torque), P=1).K == 2.5
    with pytest.raises(SetupError, match="expected a quantity in N m; found 2.5 kg"):
        fsw.MrpFeedback(K=Pint(2500.0, {"[mass]": 1}), P=1)
    assert "pint" not in sys.modules


def test_arrays_that_count_rows():
    w = fsw.WheelConfig(axes_B=AXES, J=0.1, u_max=[0.1, 0.2, 0.3])
    assert (w.n, w.axes_B.shape, w.J.shape) == (3, (3, 3), (3,))
    np.testing.assert_array_equal(w.J, [0.1] * 3)
    w.J = 0.2 * kg * m**2
    np.testing.assert_array_equal(w.J, [0.2] * 3)
    w.n = 2
    assert w.axes_B.shape == (2, 3) and w.u_max.tolist() == [0.1, 0.2]
    w.axes_B = AXES[:2]
    # A number may come first among the keywords; rows may be the only thing that says how many.
    assert fsw.WheelConfig(J=0.1, axes_B=AXES).J.tolist() == [0.1] * 3
    alone = fsw.WheelConfig(axes_B=AXES)
    alone.axes_B = AXES[:1]
    assert alone.n == 1


def test_array_by_array_from_another_module():
    w = fsw.WheelConfig(axes_B=AXES, J=0.1)
    r = world.ReactionWheels(axes_B=w.axes_B, J=w.J)
    np.testing.assert_array_equal(r.axes_B, w.axes_B)
    assert not np.shares_memory(r.axes_B, w.axes_B)


def test_integers_enums_and_exact_nanoseconds():
    e = fsw.MrpFeedback().error
    e.head.t = 9_007_199_254_740_993  # not a double
    assert e.head.t == 9_007_199_254_740_993
    e.head.t = 1.5 * s
    assert e.head.t == 1_500_000_000
    e.head.quality = "GOOD"
    assert e.head.quality.name == "GOOD" and e.head.quality == 3
    e.head.quality = type(e.head.quality).STALE
    assert e.head.quality == 1
    for wrong in (-1, 2**32, 1.5):
        with pytest.raises(SetupError, match="expected a whole number"):
            e.head.sequence = wrong
    assert e.head.sequence == 0


def test_messages_by_themselves_and_as_a_whole():
    error = fsw.AttError(sigma_BR=[0.1, 0.2, 0.3])
    c = fsw.MrpFeedback(K=1, P=1)
    c.error = error
    np.testing.assert_array_equal(c.error.sigma_BR, [0.1, 0.2, 0.3])
    error.sigma_BR[0] = 9
    assert c.error.sigma_BR[0] == 0.1


def test_a_module_tried_alone():
    c = fsw.MrpFeedback(K=2.0, P=1.0, )
    c.vehicle = fsw.VehicleData(I_B=1.0)
    for port in (c.vehicle, c.error):
        port.head.quality = "GOOD"
    c.error.sigma_BR = [0.1, 0, 0]
    c.reset()
    c.update(t=1.0, dt=0.5)
    np.testing.assert_allclose(c.torque.torque_B, [-0.2, 0, 0], atol=1e-15)
    assert c.torque.head.t == 1_000_000_000 and c.torque.head.sequence == 1
    c.update(t_ns=1_500_000_001, dt_ns=500_000_001)
    assert c.torque.head.t == 1_500_000_001


def test_inputs_take_what_parameters_refuse():
    c = fsw.MrpFeedback(K=1, P=1)
    c.error.sigma_BR = [float("nan"), 0, 0]
    assert np.isnan(c.error.sigma_BR[0])
    with pytest.raises(SetupError, match="K must be finite"):
        c.K = float("nan")
    assert c.K == 1


def test_given_tells_what_the_user_set():
    w = fsw.WheelConfig(axes_B=AXES, J=0.1)
    assert objects.given(w) == ["axes_B", "J"]
    w.u_max = 0.0
    assert objects.given(w) == ["axes_B", "J", "u_max"]


# --- lifetimes -------------------------------------------------------------------------------------

def test_views_and_arrays_keep_their_owner():
    c = fsw.MrpFeedback(K=1, P=3.0)
    alive = weakref.ref(c)
    array, quality = c.P, c.error.head
    sigma = c.error.sigma_BR
    del c
    gc.collect()
    assert alive() is not None
    sigma[0] = 0.25
    quality.sequence = 7
    assert array[0, 0] == 3.0 and sigma[0] == 0.25 and quality.sequence == 7
    del array, sigma
    assert alive() is not None
    del quality
    assert alive() is None  # at once: no cycle holds it


def test_a_craft_keeps_its_parts():
    wheels = world.ReactionWheels(axes_B=AXES, J=0.1)
    alive = weakref.ref(wheels)
    craft = world.Spacecraft(I_B=1, parts=[wheels])
    del wheels
    assert alive() is not None and craft.parts == (alive(),)
    del craft
    assert alive() is None


def test_no_reference_is_lost_or_gained():
    c = fsw.MrpFeedback(K=1, P=1)
    value, types = [0.1, 0.2, 0.3], (type(c), type(c.error), type(c.error.head))
    before = [sys.getrefcount(x) for x in (c, value, *types)]
    for _ in range(1000):
        c.error.sigma_BR = value
        c.error.sigma_BR, c.P, c.error.head.t
        c.K = 2.0
        fsw.AttError(sigma_BR=value)
        repr(c.error)
        for wrong in ({"K": "x"}, {"nothing": 1}, {"P": [[1], [2, 3]]}):
            with pytest.raises((SetupError, TypeError)):
                fsw.MrpFeedback(**wrong)
    assert [sys.getrefcount(x) for x in (c, value, *types)] == before


@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET") == "asan", reason="the sanitizer holds back freed memory")
def test_no_memory_is_lost():
    def churn(n):
        for _ in range(n):
            c = fsw.MrpFeedback(K=2.5 * N * m, P=np.eye(3))
            c.error, c.error.sigma_BR, c.P
            w = world.ReactionWheels(axes_B=AXES, J=0.1)
            world.Spacecraft(I_B=1, parts=[w], gravity=[world.MARS])

    churn(2000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    churn(20000)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2000  # kB; a lost object costs 20 MB


# --- help ------------------------------------------------------------------------------------------

def test_help_shows_units_shapes_rules_and_meaning():
    doc = inspect.getdoc(fsw.MrpFeedback)
    assert doc.startswith("Track a moving attitude reference")
    assert "K: float [N m], required, > 0\n        gain on the MRP error" in doc
    assert "P: float [N m s], shape (3, 3), required" in doc
    assert "speeds: WheelSpeeds, optional" in doc
    assert inspect.getdoc(fsw.WheelConfig.axes_B) == "float, shape (n <= 8, 3), required, non-zero\n\nspin axes"
    assert str(inspect.signature(fsw.MrpFeedback)) == (
        "(*, K, P, K_I=0, u_I_max=0, hold=0, update=None, reset=None, turns=None)")


def test_completion_offers_every_field():
    c = fsw.MrpFeedback(K=1, P=1)
    assert {"K", "P", "error", "torque", "z", "reset", "update"} <= set(dir(c))
    assert {"parts", "gravity", "orbit", "I_B"} <= set(dir(world.Spacecraft))
    assert {"MrpFeedback", "AttError"} <= set(dir(fsw))
    assert {"MARS", "Spacecraft", "Orbit"} <= set(dir(world))


def test_every_type_of_both_libraries_can_be_made_shown_and_read():
    for types in (fsw.TYPES, world.TYPES):
        for name, kind in types.items():
            instance = kind()
            assert repr(instance).startswith(name) and kind.__doc__ and kind.__name__ == name
            for field in objects.struct(instance).fields:
                if not field.spare:
                    value = getattr(instance, field.name)
                    if field.shape and field.type == "f64" and not field.count:
                        assert value.shape == field.shape and value.flags.aligned


def test_repr_is_a_table():
    assert repr(fsw.MrpFeedback(K=2.5, P=45)).split("\n")[:5] == [
        "MrpFeedback",
        "  parameters",
        "    K        2.5          N m",
        "    P        45 identity  N m s",
        "    K_I      0            N m / s",
    ]
    assert repr(fsw.MrpFeedback()).split("\n")[2].split() == ["K", "0", "N", "m", "required"]


def test_types_cannot_be_subclassed_and_bases_not_made():
    with pytest.raises(TypeError, match="not an acceptable base type"):
        class Mine(fsw.MrpFeedback):
            pass
    for base in (objects.Module, objects.Model, objects.Message):
        with pytest.raises(TypeError, match="make an object of one of its types instead"):
            base()


# --- structs, enumerations and whole numbers of all widths -----------------------------------------

@pytest.fixture
def noise():
    return kinds()[1]["Noise"]


def test_structs_are_set_from_dicts_and_lists_of_them(noise):
    n = noise(part={"phase": "SCIENCE", "pairs": [{"x": 2 * km, "count": 2**63 - 1}, {}], "steps": [1, 2, 3, 4]},
              parts=[{}, {"share": 0.5}, {"phase": "PHASE_DRAIN"}], phases=["SAFE", "DRAIN", -7])
    assert n.part.phase.name == "SCIENCE" and n.part.pairs[0].x == 2000 and n.part.pairs[0].count == 2**63 - 1
    assert [p.share for p in n.parts] == [0, 0.5, 0] and n.parts[2].phase.name == "DRAIN"
    assert n.phases.tolist() == [0, 100, -7] and "[SAFE, DRAIN, NOT_SAFE]" in repr(n)
    n.part = {"share": 0.25, "steps": n.part.steps, "pairs": n.part.pairs[::-1]}   # views of what is replaced
    assert n.part.steps.tolist() == [1, 2, 3, 4] and n.part.pairs[1].x == 2000
    assert n.part.phase.name == "SAFE"                                              # left out: zero
    n.parts = n.parts[::-1]
    assert [p.share for p in n.parts] == [0, 0.5, 0] and n.parts[0].phase.name == "DRAIN"
    n.parts = [n.part, n.parts[0], {}]
    assert n.parts[0].share == 0.25 and n.parts[1].phase.name == "DRAIN"
    n.hint = {"x": 3, "parts": [{}, {}, {"steps": [0, 0, 0, -1]}]}
    assert n.hint.x == 3 and n.hint.parts[2].steps[3] == -1


def test_whole_numbers_of_64_bits_in_arrays_are_exact(noise):
    n = noise(wide=[2**63 - 1, -2**63])
    assert n.wide.tolist() == [2**63 - 1, -2**63]
    n.wide = np.array([2**53 + 1, -2**53 - 1])
    assert n.wide.tolist() == [2**53 + 1, -2**53 - 1]


@pytest.mark.parametrize("name, value, text", [
    ("parts", [{}], ": expected a list of 3, each a Part or dict of its fields; found 1"),
    ("parts", {}, ": expected a list of 3, each a Part or dict of its fields; found {}"),
    ("parts", [{}, {}, 3], ": expected a list of 3, each a Part or dict of its fields; found 3"),
    ("parts", [{"share": 1}, {}, {"fase": 1}],
     "[2] (Part) has no attribute 'fase'; did you mean 'phase'? fields: phase, share, pairs, steps"),
    ("parts", [{}, {1: 2}, {}], "[1] (Part) has no attribute '1'; fields: phase, share, pairs, steps"),
    ("parts", [{"share": 1}, {}, {"pairs": [{"x": 1}, {"x": "a"}]}],
     "[2].pairs[1].x: expected a number, in m; found 'a'"),
    ("parts", [{}, {}, {"pairs": [{}, {"x": 1 * s}]}],
     "[2].pairs[1].x: expected a quantity in m; found 1.0 s"),
    ("part", [], ": expected Part or dict of its fields; found []"),
    ("part", {"phase": "SCEINCE"},
     ".phase: expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found 'SCEINCE'; did you mean 'SCIENCE'?"),
    ("phase", 7, ": expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found 7"),
    ("phase", True, ": expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found True"),
    ("phase", None, ": expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found None"),
    ("phases", ["SAFE", 0, "OFF"], ": expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found 'OFF'"),
    ("phases", ["SAFE"], ": expected shape (3); found shape (1)"),
    ("wide", [0, 2**63], f": expected shape (2) of whole numbers from {-2**63} to {2**63 - 1}; found [0, {2**63}]"),
    ("counts", [1.5, 0], ": expected shape (2) of whole numbers from 0 to 65535; found [1.5, 0]"),
    ("level", 256, ": expected a whole number from 0 to 255; found 256"),
    ("level", 11, " must be in [0, 10], found 11"),
])
def test_a_wrong_struct_enumeration_or_whole_number_changes_nothing(noise, name, value, text):
    n = noise(part={"share": 1}, level=3)
    before = objects.memory(n)
    with pytest.raises(SetupError) as error:
        setattr(n, name, value)
    assert str(error.value) == f"Noise.{name}{text}" and objects.memory(n) == before


def test_numbers_inside_structs_must_be_finite_to_run(noise):
    n = noise()
    n.parts[1].pairs[0].x = float("nan")
    with pytest.raises(SetupError, match=r"^Noise\.parts\[1\]\.pairs\[0\]\.x must be finite, found nan m$"):
        n.reset()


def test_an_attribute_of_a_module_that_has_few(noise):
    sink = kinds()[1]["Sink"]()
    with pytest.raises(AttributeError, match="^Sink has no attribute 'hint'; inputs: kinds$"):
        sink.hint
