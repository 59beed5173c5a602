// SPDX-License-Identifier: Apache-2.0
// The spring of the tests: it reads where a mass is, writes the force on it, and prints what it saw.
//     spring ADDRESS LATENCY [HOW]
// HOW: `broken` fails at 0.3 s, `leaves` goes then, `reader` gives no definition of what it writes, `other`
// has another one of what it reads, `hangs` does not come back, `stops` is ended by another thread; `integral`
// pulls back by the integral too, `saves` does and makes snapshots, each with `dies` is killed at 10 s.
using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Linq;
using System.Threading;
using Fledge;
using static Fledge.Units;

static class Spring
{
    static int Main(string[] args)
    {
        string how = args.Length > 2 ? args[2] : "";
        var seen = new List<string>();
        double integral = 0;
        try
        {
            var node = new Node("spring", "spring", args[0], every: 10 * ms);
            node.Reads("/mass/state", (Latency)int.Parse(args[1]),
                       text: how == "other" ? "float64[2] x  # x [km] (2)" : "");
            node.Writes("/spring/force", "Force", how == "reader" ? "" : "float64[2] F  # F [N] (2) force");
            if (how.StartsWith("saves"))
            {
                node.Saves = () => BitConverter.GetBytes(integral);
                node.Restores = bytes =>
                {
                    integral = BitConverter.ToDouble(bytes, 0);
                    Console.WriteLine("goes on");
                };
            }
            node.Step = t =>
            {
                Message mass = node["/mass/state"];
                double[] x = mass["x"];
                integral += how.StartsWith("saves") || how.StartsWith("integral") ? 0.001 * x[0] : 0;
                node["/spring/force"] = new Message { ["F"] = x.Select(xi => -xi - integral).ToArray() };
                if (t == 10 * s && how.EndsWith("dies"))
                {
                    Process.GetCurrentProcess().Kill();
                }
                if (seen.Count < 200)
                {
                    seen.Add(t + " " + mass["head.t"] + " " + mass["head.sequence"] + " " +
                             BitConverter.DoubleToInt64Bits(x[0]));
                }
                if (t == 300 * ms && how == "broken")
                {
                    throw new DivideByZeroException("a pole");
                }
                if (t == 300 * ms && how == "leaves")
                {
                    node.Leave();
                }
                if (t == 300 * ms && how == "stops")
                {
                    new Thread(node.Stop).Start();
                }
                if (t == 300 * ms && how == "hangs")
                {
                    Thread.Sleep(Timeout.Infinite);
                }
            };
            Console.WriteLine("reason " + node.Run());
            Console.WriteLine("seed " + node.Seed + " end " + node.End);
        }
        catch (NodeError error)
        {
            Console.Error.WriteLine("spring: " + error.Message);
            return 1;
        }
        foreach (string line in seen)
        {
            Console.WriteLine(line);
        }
        return 0;
    }
}
