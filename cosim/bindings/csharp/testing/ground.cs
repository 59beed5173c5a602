// SPDX-License-Identifier: Apache-2.0
// A ground system: it looks on, sets the spring's stiffness once the run goes, and tells what it sees of it.
//     ground ADDRESS
using System;
using System.Linq;
using System.Threading;
using Fledge;

static class Ground
{
    static int Main(string[] args)
    {
        try
        {
            using (var observer = new Observer("spring", "ground", args[0]))
            {
                Console.WriteLine("topics " + string.Join(" ", observer.Topics.Keys.OrderBy(t => t)));
                observer.Subscribe("/spring/", "/ground/");
                long written = 0;
                foreach (Seen seen in observer)
                {
                    if (seen.Topic == "/spring/force" && seen.Count > 10 && written == 0)
                    {
                        Expect((double)seen["F"][0] == 0 && seen.Node == "spring", "no force before");
                        var other = new Thread(() => observer.Write("/ground/stiffness", new Message { ["k"] = 2 }));
                        other.Start(); // any thread may
                        written = -1;
                    }
                    if (seen.Topic == "/ground/stiffness" && seen.Count > 0 && written == -1)
                    {
                        Expect(seen["k"] == 2 && seen.Count == 1 && seen.Node == "ground", "what was said");
                        written = seen.T;
                    }
                    if (seen.Topic == "/spring/force" && seen["F"][0] != 0)
                    {
                        Expect(written > 0 && seen.T >= written, "a force after");
                        Console.WriteLine("pulls");
                        break;
                    }
                }
                try
                {
                    observer.Write("/ground/x", new Message());
                }
                catch (NodeError error)
                {
                    Console.WriteLine(error.Message);
                }
                Expect(observer.Next(0) == null || observer.Next(0.01) == null || observer.T > 0, "time passes");
                Console.WriteLine("ready");
                foreach (Seen seen in observer)
                {
                }
                Console.WriteLine("reason " + observer.Reason);
            }
        }
        catch (NodeError error)
        {
            Console.Error.WriteLine("ground: " + error.Message);
            return 1;
        }
        return 0;
    }

    static void Expect(bool what, string name)
    {
        if (!what)
        {
            throw new NodeError("not so: " + name);
        }
    }
}
