// SPDX-License-Identifier: Apache-2.0
// What a C# program may do with the values of messages, and which errors it gets. A failed expectation ends it.
using System;
using System.Linq;
using Fledge;

static class Values
{
    static string Hex(byte[] bytes) { return string.Concat(bytes.Select(b => b.ToString("x2"))); }

    static void Expect(string expected, object found)
    {
        if (expected != found.ToString())
        {
            throw new Exception("expected " + expected + ", found " + found);
        }
    }

    static void Refused(string why, Action action)
    {
        try
        {
            action();
        }
        catch (NodeError error)
        {
            Expect(why, error.Message);
            return;
        }
        throw new Exception("not refused: " + why);
    }

    static void Main()
    {
        var schema = new Schema("M", @"
            int64 t  # t
            float32[2] s_bn  # s_BN [-] (2)
            char[6] label  # label
            uint8 on  # on {OFF=0, ON=1}
            int8 i  # i
            ");
        Expect("24", schema.Size);
        var sent = new Message { ["t"] = -3, ["s_BN"] = new[] { 0.5, -2 }, ["label"] = "h\u00e9", ["on"] = "ON",
                                 ["i"] = -128 };
        byte[] payload = schema.Pack(sent);
        Expect("fdffffffffffffff0000003f000000c068c3a90000000180", Hex(payload));
        Message got = schema.Unpack(payload);
        double[] s_BN = got["s_BN"];
        Expect("-2", s_BN[1]);
        Expect("-1.5", got["s_BN"][0] + got["s_BN"][1]);
        Expect("-6", 2 * got["t"]);
        Expect("-3", (long)got["t"]);
        Expect("h\u00e9", (string)got["label"]);
        Expect("ON", (string)got["on"]);
        Expect("1", (int)got["on"]);
        Expect("True", (bool)got["on"]);
        Expect("[0.5, -2]", got["s_BN"]);
        Expect("6", got["label"].Length);
        Expect("t, s_BN, label, on, i", string.Join(", ", got.Names));
        Expect(Hex(payload), Hex(schema.Pack(got)));
        got["i"] = 127; // a message that was read may be changed and sent on
        Expect("7f", Hex(schema.Pack(got)).Substring(46));
        Expect(new string('0', 48), Hex(schema.Pack(new Message())));

        Refused("M has no field s; it has t, s_BN, label, on, i", () => schema.Pack(new Message { ["s"] = 1 }));
        Refused("M has no field s; it has t, s_BN, label, on, i", () => schema.Unpack(payload)["s"].ToString());
        Refused("M.s_BN takes 2 numbers, found 3 in an array",
                () => schema.Pack(new Message { ["s_BN"] = new double[3] }));
        Refused("M.s_BN takes 2 numbers, found one", () => schema.Pack(new Message { ["s_BN"] = 1 }));
        Refused("M.t takes integers, found 0.5", () => schema.Pack(new Message { ["t"] = 0.5 }));
        Refused("M.i: 128 does not fit a int8", () => schema.Pack(new Message { ["i"] = 128 }));
        Refused("M.i: -129 does not fit a int8", () => schema.Pack(new Message { ["i"] = -129 }));
        Refused("M.on: -1 does not fit a uint8", () => schema.Pack(new Message { ["on"] = -1 }));
        Refused("M.t: 18446744073709551615 does not fit a int64",
                () => schema.Pack(new Message { ["t"] = ulong.MaxValue }));
        Refused("M.s_BN: 1E+300 does not fit a float32",
                () => schema.Pack(new Message { ["s_BN"] = new[] { 1e300, 0 } }));
        Refused("M.on has no value ONN; it has OFF, ON", () => schema.Pack(new Message { ["on"] = "ONN" }));
        Refused("M.t takes numbers, found \"now\"", () => schema.Pack(new Message { ["t"] = "now" }));
        Refused("M.label takes 6 bytes of text, found 7", () => schema.Pack(new Message { ["label"] = "1234567" }));
        Refused("a M of 5 bytes, expected 24", () => schema.Unpack(new byte[5]));
        Refused("M: line 2: padding would be needed before this field, found \"b\"",
                () => new Schema("M", "int32 a\nfloat64 b\n"));
        Refused("s_BN is an array of 2, not an integer", () => ((long)got["s_BN"]).ToString());
        Refused("t is a number, not an array", () => ((double[])got["t"]).ToString());

        var node = new Node("spring", "mass", "ipc://@x", every: 1);
        node.Reads("/a");
        Refused("mass does not read /b; it reads /a", () => node["/b"].ToString());
        Refused("mass does not write /a; it writes nothing", () => node["/a"] = new Message());
        Refused("a node needs its address, given here or by FLEDGE_ADDRESS", () => new Node("s", "n", "", every: 1));
        const string steps = "mass: it steps at offset + k every, with every > 0 and offset >= 0, both up to 31 years"
                             + "; ";
        Refused(steps + "found 0 and 0 ns", () => new Node("spring", "mass", "ipc://@x"));
        Refused(steps + "found -1 and 5 ns", () => new Node("spring", "mass", "ipc://@x", every: 5, offset: -1));
        Refused(steps + "found 0 and " + long.MaxValue + " ns", () => node.AlsoSteps(long.MaxValue));
        Refused(steps + "found 0 and -1 ns", () => node.AlsoSteps(-1));
    }
}
