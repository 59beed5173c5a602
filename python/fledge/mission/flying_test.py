# SPDX-License-Identifier: Apache-2.0
"""Python that flies: its arithmetic against 50 digits, and which files have it."""
import importlib.util
import math
import sys
import textwrap
from pathlib import Path
from random import Random

import numpy as np
import pytest

import fledge
from fledge.mission import flying, target_math
from fledge.units import m, s
from tests.needs import module

mpmath = module("mpmath")
mpmath.mp.dps = 50

REACH = {"sin": 1e3, "cos": 1e3, "tan": 1e3, "asin": 1, "acos": 1, "atan": 1e3, "exp": 700, "log": 1e3}


def run(text, **names):
    """What the names are after a file of this text, which flies."""
    flying.execute(textwrap.dedent(text), "script.py", names)
    return names


def ulps(found, exact):
    return abs(found - exact) / math.ulp(float(exact))


@pytest.mark.parametrize("name", REACH)
def test_functions_of_one_number_are_right_to_the_last_bit(name):
    random = Random(name)
    values = [random.uniform(0 if name == "log" else -1, 1) * REACH[name] for _ in range(300)]
    found = run(f"import math\nfrom math import {name} as other\nresults = [math.{name}(x) for x in values]\n"
                "same = results == [other(x) for x in values]", values=values)
    exact = getattr(mpmath, name)
    assert found["same"] and all(ulps(y, exact(mpmath.mpf(x))) < 1 for x, y in zip(values, found["results"]))


def test_functions_of_two_numbers_are_right_to_the_last_bit():
    random = Random(2)
    values = [(random.uniform(-9, 9), random.uniform(-9, 9)) for _ in range(300)]
    found = run("""
        import math
        angles = [math.atan2(x, y) for x, y in values]
        powers = [(abs(x) ** y, pow(abs(x), y), math.pow(abs(x), y)) for x, y in values]
        squares = [(x ** 2, x ** -3, abs(x) ** 0.5) for x, _ in values]
        logs = [math.log(abs(x), 10) for x, _ in values]
        """, values=values)
    for (x, y), angle, power, square, log in zip(values, found["angles"], found["powers"], found["squares"],
                                                 found["logs"]):
        exact = mpmath.mpf(x)
        assert ulps(angle, mpmath.atan2(x, y)) < 1
        assert power == (power[0],) * 3 and ulps(power[0], abs(exact) ** y) < 1
        assert ulps(square[0], exact**2) < 1 and ulps(square[1], exact**-3) < 1
        assert ulps(square[2], mpmath.sqrt(abs(exact))) < 1
        assert ulps(log, mpmath.log(abs(exact)) / mpmath.log(10)) < 3
    assert run("x = [3.0 ** 33, 0.5 ** 1074, 1e22 ** 1, (-2.0) ** 3, 6.25 ** 0.5, 2 ** -2]")["x"] == [
        5559060566555523.0, 5e-324, 1e22, -8.0, 2.5, 0.25]


def test_what_is_no_float_keeps_the_powers_of_python():
    found = run("""
        whole, large, shifted = 3**40, (-7)**3, True**2
        area = (2 * m)**2
        a = array**2
        b = array
        b **= 2
        modulo = pow(3, 4, 5)
        """, m=m, array=np.array([1.5, 2.5]))
    assert found["whole"] == 12157665459056928801 and found["large"] == -343 and found["shifted"] == 1
    assert found["area"] == 4 * m * m and found["modulo"] == 1
    assert found["a"].tolist() == [2.25, 6.25] and found["b"] is found["array"]


def test_powers_of_quantities_are_right_to_the_last_bit():
    random = Random(3)
    values = [random.uniform(0, 1e4) for _ in range(300)]
    found = run("""
        roots = [(x * m**2) ** 0.5 for x in values]
        rows = ([values[:2], values[2:4]] * m**2) ** 1.5
        t = 2 * m
        t **= 2
        """, values=values, m=m)
    assert all(ulps(root.to(m), mpmath.sqrt(x)) < 1 for root, x in zip(found["roots"], values))
    assert ulps(found["rows"].to(m**3)[1][0], mpmath.mpf(values[2]) ** 1.5) < 1 and found["t"] == 4 * m**2


def test_powers_in_place_compute_their_place_once():
    found = run("""
        calls = []


        class Box:
            x = 3.0
            rows = [[2.0, 3.0], [4.0, 5.0]]


        def box():
            calls.append("box")
            return Box


        def index(i):
            calls.append(i)
            return i


        t = 1.5
        t **= 2
        box().x **= 2
        box().rows[index(1)][index(0)] **= 0.5
        n = 3
        n **= 3
        array[0:1] **= 2


        def local(t):
            t **= t
            return t


        two = local(2.0)
        """, array=np.array([3.0, 3.0]))
    box = found["Box"]
    assert (found["t"], box.x, box.rows, found["n"], found["two"]) == (2.25, 9.0, [[2.0, 3.0], [2.0, 5.0]], 27, 4.0)
    assert found["calls"] == ["box", "box", 1, 0] and found["array"].tolist() == [9.0, 3.0]


@pytest.mark.parametrize("text, error", [
    ("(-8.0) ** 0.5", ValueError), ("pow(-8, 0.5)", ValueError), ("0.0 ** -1", ZeroDivisionError),
    ("0 ** -1", ZeroDivisionError), ("1e200 ** 2", OverflowError), ("(-1e200) ** 3", OverflowError),
    ("math.pow(1e200, 2)", OverflowError), ("math.pow(-1e200, 3)", OverflowError), ("math.pow(0, -1)", ValueError),
    ("math.pow(-1, 0.5)", ValueError), ("math.sin(math.inf)", ValueError), ("math.asin(1.5)", ValueError),
    ("math.log(0)", ValueError), ("math.log(-1)", ValueError), ("math.log(2, 1)", ZeroDivisionError),
    ("math.exp(710)", OverflowError), ("math.sqrt(-1)", ValueError), ("math.sin('1')", TypeError),
    ("'a' ** 2", TypeError)])
def test_what_has_no_result_raises_as_python(text, error):
    with pytest.raises(error):
        run(f"import math\nx = {text}")
    if "** 0.5" not in text and "pow(-8" not in text:       # where Python has complex numbers
        with pytest.raises(error):
            eval(text)


@pytest.mark.parametrize("text", [
    "math.exp(-math.inf)", "math.exp(math.inf)", "math.log(math.inf)", "math.atan(-math.inf)", "math.exp(-800)",
    "math.pow(-math.inf, 0.5)", "math.pow(0.5, math.inf)", "0.5 ** math.inf", "math.nan ** 0", "math.inf ** -1",
    "(-math.inf) ** 3", "1 ** math.nan", "math.atan2(-0.0, -1)", "math.sin(-0.0)", "math.sin(True)", "math.hypot(3, 4)",
    "0.0 ** math.inf", "0.0 ** -math.inf", "math.tau", "math.floor(2.5)", "math.isnan(math.sin(math.nan))"])
def test_ends_and_what_no_target_has_are_those_of_python(text):
    found = run(f"import math\nx = {text}")["x"]
    assert repr(found) == repr(eval(text))


def test_a_sum_is_added_from_left_to_right():
    found = run("a, b, c = sum([0.1] * 10), sum((x for x in [1e16, 1.0, 1.0, -1e16]), 0.5), sum([[1], [2]], [])")
    assert (found["a"], found["b"], found["c"]) == (0.9999999999999999, 0.0, [1, 2])


UNITS = "from fledge.units import kg, m, s\n"


@pytest.mark.parametrize("text, needed", [
    ("x = 2 * kg * m**2 / s ** -2", False), ("x = dict(**{'a': 1}, ** {})", False), ("x = f'{m**2}'", False),
    ("x = (3.0)**2", True), ("x = m**2.0", True), ("x = m**k", True), ("x = 2**m", True), ("x = J**2", True),
    ("m = 3.0\nx = m**2", True), ("def f(m): return m**2", True), ("f = [s**2 for s in (1.5,)]", True),
    ("for s in (1.5,):\n    s**2", True), ("def f():\n    global s\n    s = 2.0\ns**2", True), ("x = m_s**2", True),
    ("from fledge.units import kg as m\nm**2", True), ("import math as s\nx = s**2", True),
    ("x = p.m**3", True), ("x = (p.  m ** 3, m**2)", True), ("class P:\n    m = 3.0\n    x = m**2", True),
    ("x = (3.0,  # (\n     2.0  # (\n     ** 2)", True), ("try: f()\nexcept E as s: pass\ns**2", True),
    ("from numbers import *\nm**2", True), ("x = '3.0 ** 2'", False), ("x = f(m=3.0) / m**2", False),
    ("x = {**{}, 'a': m**2}\ndef f(*, a, b=1): pass", False), ("match x:\n    case [*m]: m**2", True),
    ("f = lambda s: m**2", True), ("def f():\n    m = 2.0\n    return lambda: m**2", True)])
def test_only_what_may_be_a_power_of_floats_is_rewritten(text, needed):
    source = UNITS + text
    rewrites = [name for code in [flying._compiled(source, "x.py")] for name in str([code.co_names, *(
        [inner.co_names, [deep.co_names for deep in inner.co_consts if hasattr(deep, "co_names")]]
        for inner in code.co_consts if hasattr(inner, "co_names"))]).split("'") if name == "__power__"]
    assert bool(rewrites) == needed


def test_a_unit_that_the_file_does_not_import_is_a_number():
    assert "__power__" in flying._compiled('"""\nfrom fledge.units import m\n"""\nm = 3.0\nx = m**2', "x.py").co_names
    assert "__power__" in flying._compiled("m = 3.0\nx = m**2", "x.py").co_names


# --- which files fly ---------------------------------------------------------------------------------

FLIGHT = """
from math import sin
from fledge import flight as fsw
from fledge.units import s
from . import shared_math
from .shared import POWER, update

MATH = shared_math.math


def build(f):
    from . import late
    f.a = fsw.InertialPointing(update=update)
    f.late = fsw.InertialPointing(update=late.update)
    f.task("gnc", every=1 * s, run=[f.a, f.late])
"""
WORLD = """
import math
from . import shared, worldly


def build(w, f):
    assert math is worldly.math and shared.math is not math
"""
UPDATE = """
import math

POWER = (lambda x: x ** 0.3).__code__.co_names


def update(m, t, dt):
    m.reference.sigma_RN[0] = math.sin(t) ** 2
    m.publish(m.reference)
"""


@pytest.fixture
def files(tmp_path):
    folder = tmp_path / "flies"
    folder.mkdir()
    for name, text in {"flight": FLIGHT, "world": WORLD, "shared_math": "import math\n", "shared": UPDATE,
                       "late": UPDATE, "worldly": "import math\n",
                       "scenarios": "import math\n\n\ndef fly(sim):\n    pass\n"}.items():
        (folder / f"{name}.py").write_text(text)
    return folder


def test_flight_and_what_it_imports_fly_and_no_other_file(files):
    sim = fledge.load(files)
    package = type(sim).__module__ and next(
        name for name in reversed(sys.modules) if name.startswith("_mission_flies_")).rpartition(".")[0]
    found = {name.rpartition(".")[2]: module for name, module in sys.modules.items() if name.startswith(f"{package}.")}
    assert found["flight"].MATH is found["shared"].math is found["late"].math is target_math
    assert found["world"].math is found["worldly"].math is found["scenarios"].math is math
    assert found["flight"].sin is target_math.sin and found["shared"].POWER == ("__power__",)
    kept = [Path(importlib.util.cache_from_source(files / f"{name}.py")).exists() for name in ("shared", "worldly")]
    assert kept == [False, not sys.dont_write_bytecode]
    sim.run(3 * s)
    exact = mpmath.sin(3) ** 2
    assert sim.flight.a.reference.sigma_RN[0] == sim.flight.late.reference.sigma_RN[0]
    assert ulps(float(sim.flight.a.reference.sigma_RN[0]), exact) < 2


def test_files_of_the_project_that_flight_imports_fly(files, tmp_path, monkeypatch):
    (tmp_path / "gains_of_mine").mkdir()
    (tmp_path / "gains_of_mine/__init__.py").write_text("import math\nfrom .inner import K\n")
    (tmp_path / "gains_of_mine/inner.py").write_text("import json\nimport math\nK = 2.0 ** 0.5\n")
    (files / "flight.py").write_text("from gains_of_mine import inner\n" + FLIGHT)
    monkeypatch.setenv("FLEDGE_PROJECT", str(tmp_path))
    monkeypatch.syspath_prepend(str(tmp_path))
    fledge.load(files)
    found = [sys.modules.pop(name) for name in ("gains_of_mine", "gains_of_mine.inner")]
    assert found[0].math is found[1].math is target_math and found[1].K == math.sqrt(2)


# --- numbers of arrays -------------------------------------------------------------------------------

ARRAYS = """
from fledge import flight as fsw
from fledge.units import s

SEEN, WRONG = [], []


def update(m, t, dt):
    a = m.reference.sigma_RN
    a[0] = 0.25
    x, y, z = a
    SEEN.extend([a[0], *a, sum(a), max(a), list(a)[1], a.tolist()[2], a[-1], a[0:2][0], (2 * a)[0], z])
    try:
        x / y
    except ZeroDivisionError:
        SEEN.append(1.5)
    m.publish(m.reference)


def count(m, t, dt):
    n = m.times.burns
    n[0], n[1] = 2, 5.0
    SEEN.extend([n[0] - n[1], n[1] * 2**40, -sum(n)])
    wide = n.astype('q')
    wide[0] = 2**40
    SEEN.append(wide[0])
    for wrong in WRONG:
        n[1] = wrong
    m.publish(m.times)


def build(f):
    f.a = fsw.InertialPointing(update=update)
    f.b = fsw.BurnSchedule(update=count, n=2, start=[1, 2] * s, duration=1 * s, thruster=[0, 7])
    f.task("gnc", every=1 * s, run=[f.a, f.b])
"""


def test_an_update_sees_numbers_of_python_in_arrays(tmp_path):
    (tmp_path / "flight.py").write_text(ARRAYS)
    sim = fledge.load(tmp_path)
    flight = sys.modules[next(name for name in reversed(sys.modules) if name.endswith(".flight")
                              and name.startswith("_mission_"))]
    sim.run(0.5 * s)
    assert flight.SEEN == [0.25, 0.25, 0, 0, 0.25, 0.25, 0, 0, 0, 0.25, 0.5, 0, 1.5, -3, 5 * 2**40, -7, 2**40]
    assert {type(x) for x in flight.SEEN} == {float, int}
    assert type(sim.flight.a.reference.sigma_RN) is np.ndarray
    for wrong in (0.5, 2**32, -1, -1.0, float("nan")):
        flight.WRONG[:] = [wrong]
        with pytest.raises(fledge.RunError, match="expected a whole number that an element of 32 bits holds; found"):
            sim.run(1 * s)
