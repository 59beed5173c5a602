# SPDX-License-Identifier: Apache-2.0
"""Values as the pages show them; NumPy's shortest texts are the second ones."""
import json
import math
import random
import struct

import numpy as np

from fledge.scene.testing.node import in_node, needs_node

STORE = "SOURCES/../../../ground/console/web/store.js"


def digits(text):
    """The significant digits of a number's text."""
    return text.lstrip("-").partition("e")[0].replace(".", "").strip("0")


@needs_node
def test_a_real_has_all_digits_that_read_back_as_the_same_number_and_no_more(tmp_path):
    chance = random.Random(1)
    doubles = [0.1, 1 / 3, -0.0, 5e-324, 1.7976931348623157e308, 2.0**-44, 1e7, 12345678.9, 1e22, 123456789012.125,
               0.0001, 0.00001, 1790000000.123456, *(struct.unpack("<d", chance.randbytes(8))[0] for _ in range(3000))]
    singles = [0.1, 3.3, 16777216, 1e-45, 3.4028235e38, 2.0**-103, 0.7, -0.0,
               *(struct.unpack("<f", chance.randbytes(4))[0] for _ in range(3000)),
               *(chance.randrange(-999, 1000) / 100 for _ in range(100))]
    pairs = [(float(np.float64(x)), False) for x in doubles if math.isfinite(x)] + \
        [(float(np.float32(x)), True) for x in singles if math.isfinite(x)]
    (tmp_path / "pairs.json").write_text(json.dumps(pairs))
    shown = in_node(f"""
        import {{readFileSync}} from "node:fs";
        import {{real}} from "{STORE}";
        const pairs = JSON.parse(readFileSync({json.dumps(str(tmp_path / "pairs.json"))}));
        console.log(JSON.stringify(pairs.map(([value, single]) => real(value, single))));
    """)
    for (value, single), text in zip(pairs, shown):
        text, kind = text.replace("\N{MINUS SIGN}", "-"), np.float32 if single else np.float64
        assert kind(text).tobytes() == kind(value).tobytes(), (value, single, text)
        assert len(digits(text)) <= len(digits(np.format_float_scientific(kind(value), unique=True))), (value, text)
        assert len(text) <= 24
    assert shown[:3] == ["0.1", "0.3333333333333333", "\N{MINUS SIGN}0"] and "12345678.9" in shown
    assert shown[pairs.index((float(np.float32(3.3)), True))] == "3.3"


@needs_node
def test_what_is_no_finite_number_is_in_words():
    assert in_node(f"""
        import {{real}} from "{STORE}";
        console.log(JSON.stringify([NaN, Infinity, -Infinity].map((value) => real(value, true))));
    """) == ["not a number", "+infinite", "\N{MINUS SIGN}infinite"]
