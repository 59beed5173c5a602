# SPDX-License-Identifier: Apache-2.0
"""Clocks of spacecraft, against what NAIF publishes of them."""

import numpy as np
import pytest

from fledge.errors import SetupError
from fledge.files import sclk, text_kernel
from fledge.files.values import Clock

# Voyager 2. NAIF's examples of SCFMT say where its first partition begins and ends, 00011:00:001 and 04011:21:784, and
# those of SCS2E readings, ticks and ephemeris times, of which the first is here, and the rate to the second.
VOYAGER = r"""KPL/SCLK
SCLK_DATA_TYPE_32 = ( 7 ) in a comment
\begindata
SCLK_KERNEL_ID           = ( @2000-NOV-21/12:00 )
SCLK_DATA_TYPE_32        = ( 1 )
SCLK01_N_FIELDS_32       = ( 3 )
SCLK01_MODULI_32         = ( 65536 60 800 )
SCLK01_OFFSETS_32        = ( 0, 0, 1 )
SCLK01_OUTPUT_DELIM_32   = ( 2 )
SCLK_PARTITION_START_32  = ( 5.28D5
                             192545600 )
SCLK_PARTITION_END_32    = 192545583
SCLK_PARTITION_END_32   += 3145728000
SCLK01_COEFFICIENTS_32   = ( 9.8532795E8 -646668528.58222842 2879.9979 )
\begintext
The end
"""
# BepiColombo, as bc_mpo_sclk_20150124_fake.tsc of ESA says.
BEPI = r"""\begindata
SCLK_DATA_TYPE_69 = 1   SCLK01_TIME_SYSTEM_69 = 2   SCLK01_N_FIELDS_69 = 2   SCLK01_MODULI_69 = (4294967296 65536)
SCLK01_OFFSETS_69 = (0 0)   SCLK01_OUTPUT_DELIM_69 = 1
SCLK_PARTITION_START_69 = 0   SCLK_PARTITION_END_69 = 1.0995116277750E+18
SCLK01_COEFFICIENTS_69 = ( 0.0 @2016-07-12T00:01:08.184 1.0 )
"""


@pytest.fixture
def clock(tmp_path):
    def read(text, spacecraft=None):
        (tmp_path / "a.tsc").write_text(text)
        return sclk.read(tmp_path / "a.tsc", spacecraft)
    return read


def test_voyagers_clock_is_as_naif_prints_it(clock):
    voyager = clock(VOYAGER, -32)
    assert voyager.text(0) == "1/00011:00:001"
    assert voyager.text(192545583 - 528000 - 1) == "1/04011:21:783"
    assert voyager.text(192545583 - 528000) == "2/04011:22:001"
    for reading, ticks, et, whole in (
            ("2/20538:39:768", 985327950, -646668528.58222842, "2/20538:39:768"),
            ("2/20543:21:768", 985553550, -646654992.59209847, "2/20543:21:768"),
            ("2/20550:37", 985901583, -646634110.62732494, "2/20550:37:001"),
            ("2/20561:59", 986447183, -646601374.65119493, "2/20561:59:001")):
        assert voyager.ticks_of(reading) == ticks
        assert voyager.text(ticks) == whole
        assert abs(voyager.ns(ticks)[0] / 1e9 - et) < 1e-6
        assert abs(voyager.ticks(round(et * 1e9) + 1000)[0] - ticks) < 1e-4
    assert voyager.ticks_of(" 2 / 20538.39-768 ") == voyager.ticks_of("20538 39 768") == 985327950
    assert voyager.ticks_of("1/11:0:1") == 0
    assert voyager.ticks_of("11:0:2401") == 2400        # a field may pass its modulus


def test_a_clock_on_tt_counts_from_its_date(clock):
    bepi = clock(BEPI)
    zero = Clock("UTC").ns("2016-07-12T00:00:00")       # 36 leap seconds and 32.184 s
    assert bepi.ns([0, 65536 * 10])[0] == zero
    assert abs(bepi.ns(65536 * 10)[0] - zero - 10**10) <= 10        # TDB gains less than 1e-9
    times = zero + np.array([0, 10**9 // 4, 12_345_678_901_234_567], dtype=np.int64)
    assert np.allclose(bepi.ns(bepi.ticks(times)), times, rtol=0, atol=10)
    assert bepi.text(bepi.ticks(zero + 10**9 // 4)[0]) == "1/0000000000.16384"


def test_a_rate_holds_up_to_the_next_knot(clock):
    late = clock(BEPI.replace("SYSTEM_69 = 2", "SYSTEM_69 = 1").replace(
        "1.0 )", "1.0   655360 @12-JUL-2016-00:01:20 1.0 )"))       # after 10 s, 11.816 s have passed
    begin = late.parallel[0]
    assert list(late.ticks(begin + np.array([5, 10, 11, 12]) * 10**9) / 65536) == pytest.approx([5, 10, 11, 10.184])
    assert list(late.ns([655359.999, 655360]) - begin) == [9999999985, 11816000000]


def test_knots_out_of_order_are_taken_as_spices_bisection_does(clock):
    # The third of five is late, as the 35th of 23,133 of LRO's. Bisected: 1, 3, then to its left or right.
    ticks, seconds = [0, 10, 35, 20, 30], [0, 10, 36, 21, 32]
    knots = " ".join(f"{65536 * n} {-1e8 + t} 1.0" for n, t in zip(ticks, seconds))
    odd = clock(BEPI.replace("SYSTEM_69 = 2", "SYSTEM_69 = 1").replace("0.0 @2016-07-12T00:01:08.184 1.0", knots))
    found = odd.ns(65536 * np.array([5, 12, 22, 25, 29, 30, 36]))
    assert list(found / 1e9 + 1e8) == pytest.approx([5, 12, 22, 25, 29, 32, 38])
    assert odd.ticks(found[[0, 1, 5, 6]]) / 65536 == pytest.approx([5, 12, 30, 36])


def test_what_a_clock_does_not_show_is_refused(clock):
    voyager = clock(VOYAGER)
    for use, text in ((lambda: voyager.ticks_of("3/20538:39:768"), r"1/00011:00:001 to 1/04011:21:784.*found '3/20538"),
                      (lambda: voyager.ticks_of("1/20538:39:768"), "within a partition"),
                      (lambda: voyager.ticks_of("1:2:3:4"), "up to 3 fields, 1/00011:00:001; found '1:2:3:4'"),
                      (lambda: voyager.ticks_of("noon"), "found 'noon'"),
                      (lambda: voyager.text(1e12), "ticks from 0 to 3145199983; found 1000000000000"),
                      (lambda: voyager.ns(10), "ticks from 985327950"),
                      (lambda: clock(BEPI).ns(2.0**59), "up to 73 years past those of the kernel; found 5.7646"),
                      (lambda: voyager.ticks(-7 * 10**17), "known from 1979-07-05T21:51:11.41777158 TDB on")):
        with pytest.raises(SetupError, match=text):
            use()


def test_damaged_kernels_are_refused_with_their_line(clock, tmp_path):
    for old, new, text in (("( 65536 60 800 )", "( 65536 60 )", "line 7: SCLK01_MODULI_32: expected 3 numbers; found"),
                           ("65536 60 800 )", "65536 60 800", "line 8: SCLK01_MODULI_32: expected values and"),
                           ("65536 60", "65536 60.5", "line 7: SCLK01_MODULI_32: expected whole numbers > 0"),
                           ("65536 60", "65536 sixty", "line 7: SCLK01_MODULI_32: expected a number.*found 'sixty'"),
                           ("TYPE_32        = ( 1 )", "TYPE_32 = 2", "SCLK_DATA_TYPE_32: expected 1; found 2"),
                           ("SCLK01_MODULI_32  ", "SCLK01_MODULI_33 ", "has no SCLK01_MODULI_32"),
                           ("DELIM_32   = ( 2 )", "DELIM_32 = 6", "line 9: SCLK01_OUTPUT_DELIM_32: expected a number"),
                           ("2879.9979", "-2879.9979", "line 14: SCLK01_COEFFICIENTS_32: expected triplets"),
                           ("3145728000", "1", "line 12: SCLK_PARTITION_END_32: expected an end after"),
                           ("N_FIELDS_32       = ( 3 )", "N_FIELDS_32 = 0", "line 6: SCLK01_N_FIELDS_32: expected the"),
                           ("-646668528.58222842", "1D10", "line 14: SCLK01_COEFFICIENTS_32: expected .*146 years of"),
                           ("-646668528.58222842", "1D301", "line 14: .*found '1D301'"),
                           ("-646668528.58222842", "1D-9999999999", "line 14: .*found '1D-9999999999'"),
                           ("SCLK01_OFFSETS_32        =", "SCLK01_OFFSETS_32", "expected NAME = or NAME"),
                           ("-646668528.58222842", "@2000-NOE-01", "found '@2000-NOE-01'")):
        with pytest.raises(SetupError, match=text):
            clock(VOYAGER.replace(old, new))
    with pytest.raises(SetupError, match="whose clock the kernel has, -32; found -31"):
        clock(VOYAGER, -31)
    with pytest.raises(SetupError, match="whose clock the kernel has, -32, -69; found None"):
        clock(VOYAGER + BEPI)
    assert clock(VOYAGER + BEPI, -69).number == 69
    with pytest.raises(SetupError, match="none.tsc: cannot be read"):
        sclk.read(tmp_path / "none.tsc")


def test_text_kernels_have_strings_lists_and_comments(tmp_path):
    path = tmp_path / "a.tf"
    path.write_text("A = 1\n\\begindata\nA = 'it''s' B=(1D1,\n -.5e-1 'x')\nB += @1980-JAN-01\n\\begintext\nC = 1\n")
    kernel = text_kernel.read(path)
    assert {name: [value.text for value in values] for name, values in kernel.values.items()} == {
        "A": ["it's"], "B": ["1D1", "-.5e-1", "x", "@1980-JAN-01"]}
    assert [value.line for value in kernel.values["B"]] == [3, 4, 4, 5]
    path.write_text("\\begindata\nB = (1D1, -.5e-1 @1980-JAN-01 @1999-12-31T12:00:00.5 @01-FEB-2000/13:00)")
    assert [float(x) for x in text_kernel.read(path).numbers("B")] == [
        10, -0.05, -7305 * 86400 + 43200 - 43200 - 43200, -86400 + 0.5, 31 * 86400 + 3600]
