// SPDX-License-Identifier: Apache-2.0
// The radio of a spacecraft at Mars, a node in C#: it sends to Earth while the antenna, b1, points there,
// Mars does not hide Earth, and the battery is full enough.
using System;
using Fledge;
using static Fledge.Units;

static class Radio
{
    const double AU = 149597870700.0, MarsRadius = 3396.2e3;  // [m]
    const double Beam = 0.99996192306417131;                  // cosine of half the width, 0.5 deg
    const double Enough = 0.45, TooLittle = 0.40;             // of the battery: to begin, and to end
    const double Warming = 60.0, Sending = 120.0;             // [W]
    const double Rate = 250e3;                                // [bit/s] at 1 AU
    const int WarmUp = 120;                                   // steps
    const double h = 0.5;                                     // [s]

    enum Mode { Off, Warming, Sending }

    static double Along(double[] a, double[] b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

    /// b1 in components of N, from the attitude as MRP.
    static double[] Axis1(double[] sigma)
    {
        double x = sigma[0], y = sigma[1], z = sigma[2], s2 = Along(sigma, sigma), d = (1.0 + s2) * (1.0 + s2);
        return new[] { 1.0 - 8.0 * (y * y + z * z) / d, (8.0 * x * y + 4.0 * z * (1.0 - s2)) / d,
                       (8.0 * x * z - 4.0 * y * (1.0 - s2)) / d };
    }

    static int Main()
    {
        Mode mode = Mode.Off;
        int warm = 0;
        double sent = 0;

        var node = new Node(name: "radio", every: 500 * ms);
        node.Reads("/world/craft/state");
        node.Reads("/world/earth/state");
        node.Reads("/power/state", Latency.NextInstant);
        node.Writes("/radio/state", "RadioState", @"
            int32 mode         # mode {OFF=0, WARMING=1, SENDING=2}
            int32 spare        # spare
            float64 P          # P [W] what it takes
            float64 off_earth  # off_earth [-] cosine of the angle from the antenna to Earth
            float64 rate       # rate [-] bits per second
            float64 sent       # sent [-] bits in all
            ");
        node.Step = t =>
        {
            Message craft = node["/world/craft/state"];
            double[] r = craft["r_BN_N"], earth = node["/world/earth/state"]["r_PN_N"];
            double[] to = { earth[0] - r[0], earth[1] - r[1], earth[2] - r[2] };
            double distance = Math.Sqrt(Along(to, to));
            double[] earth_N = { to[0] / distance, to[1] / distance, to[2] / distance };
            double ahead = Along(r, earth_N), aside = Along(r, r) - ahead * ahead;
            bool seen = ahead >= 0.0 || aside >= MarsRadius * MarsRadius;
            double cosine = Along(Axis1(craft["sigma_BN"]), earth_N);

            double fill = node["/power/state"]["fill"];
            bool may = seen && cosine >= Beam && fill >= (mode == Mode.Off ? Enough : TooLittle);
            warm = may ? Math.Min(warm + 1, WarmUp) : 0;
            mode = !may ? Mode.Off : warm < WarmUp ? Mode.Warming : Mode.Sending;
            double far = AU / distance, rate = mode == Mode.Sending ? Rate * far * far : 0.0;
            sent += h * rate;
            node["/radio/state"] = new Message {
                ["mode"] = (int)mode,
                ["P"] = mode == Mode.Sending ? Sending : mode == Mode.Warming ? Warming : 0.0,
                ["off_earth"] = cosine,
                ["rate"] = rate,
                ["sent"] = sent,
            };
        };
        try
        {
            node.Run();
        }
        catch (NodeError error)
        {
            Console.Error.WriteLine("radio: " + error.Message);
            return 1;
        }
        Console.WriteLine("sent " + (long)sent + " bits");
        return 0;
    }
}
