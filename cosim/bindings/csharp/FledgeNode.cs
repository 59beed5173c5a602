// SPDX-License-Identifier: Apache-2.0
// A C# program as a node of a co-simulation. Compile this file with the program. At run time, the program needs
// Fledge's C library, libfledge_node.so: beside the program, or in a folder of LD_LIBRARY_PATH.
//
//     using Fledge;
//     using static Fledge.Units;
//
//     var node = new Node("spin", "thermal", "tcp://127.0.0.1:7000", every: 1 * s);
//     node.Reads("/world/sun/direction");
//     node.Writes("/thermal/plate/state", "PlateState", "float64 T  # T [K] temperature");
//     node.Step = t =>
//     {
//         Message sun = node["/world/sun/direction"];
//         node["/thermal/plate/state"] = new Message { ["T"] = 300 + 10 * sun["s_B"][2] };
//     };
//     node.Run();
//
// Messages give values by the true names of their fields (nested ones with dots: "head.t",
// "wheels[2].axis_B"). Only one side needs to give a definition: a topic without one here takes that of the
// partner when the run begins, so a node knows all messages of a mission. Where a message begins with a Fledge
// head, the node fills in its time, quality and sequence unless the program gives them. Times are integers in
// nanoseconds.
using System;
using System.Collections;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Runtime.ExceptionServices;
using System.Runtime.InteropServices;
using System.Text;
using System.Text.RegularExpressions;

namespace Fledge
{

/// The controller refuses the node, is not there, or breaks the format; or the program uses a message wrongly.
public sealed class NodeError : Exception
{
    public NodeError(string text) : base(text) {}
}

/// Of time, in nanoseconds.
public static class Units
{
    public const long ns = 1, us = 1000, ms = 1000000, s = 1000000000;
}

/// When a reader sees what was written at t.
public enum Latency : byte
{
    SameInstant, ///< at t: the writer steps first
    NextInstant, ///< at its first instant after t
    NextExchange ///< after the exchange that follows; both step at once
}

// ---- messages

/// A number, an array of numbers, or a text; from a message that was read, or for one to be written. It
/// converts to a double or double[] by itself; a cast converts it to other types: (long)m["head.t"],
/// (string)m["mode"] for a text or the name of an enumeration's value, (Latency)(int)m["x"].
public struct Value
{
    internal readonly object x; // a number, an array of numbers, or a string
    readonly Field field;

    internal Value(object x, Field field = null)
    {
        this.x = x;
        this.field = field;
    }

    public static implicit operator Value(double x) { return new Value(x); }
    public static implicit operator Value(long x) { return new Value(x); }
    public static implicit operator Value(ulong x) { return new Value(x); }
    public static implicit operator Value(int x) { return new Value(x); }
    public static implicit operator Value(bool x) { return new Value(x ? 1 : 0); }
    public static implicit operator Value(string x) { return new Value(x); }
    public static implicit operator Value(double[] x) { return new Value(x.Clone()); }
    public static implicit operator Value(long[] x) { return new Value(x.Clone()); }
    public static implicit operator Value(ulong[] x) { return new Value(x.Clone()); }
    public static implicit operator Value(int[] x) { return new Value(x.Clone()); }
    public static implicit operator Value(byte[] x) { return new Value(x.Clone()); }

    public static implicit operator double(Value v) { return v.As<double>("a number"); }
    public static implicit operator double[](Value v) { return v.AsArray<double>("an array"); }
    public static explicit operator long(Value v) { return v.As<long>("an integer"); }
    public static explicit operator ulong(Value v) { return v.As<ulong>("an integer"); }
    public static explicit operator int(Value v) { return v.As<int>("an integer"); }
    public static explicit operator uint(Value v) { return v.As<uint>("an integer"); }
    public static explicit operator bool(Value v) { return (long)v != 0; }
    public static explicit operator long[](Value v) { return v.AsArray<long>("an array of integers"); }
    public static explicit operator ulong[](Value v) { return v.AsArray<ulong>("an array of integers"); }
    /// A text up to its end, or the name of an enumeration's value.
    public static explicit operator string(Value v)
    {
        var array = v.x as Array;
        if (v.x is string)
        {
            return (string)v.x;
        }
        if (array == null && v.field != null && v.field.Choices != null)
        {
            return v.field.Choices.Where(c => c.Value == (long)v).Select(c => c.Key).FirstOrDefault() ?? v.ToString();
        }
        if (array == null || Buffer.ByteLength(array) != array.Length)
        {
            throw v.Wrong("a text or an enumeration");
        }
        var bytes = new byte[array.Length];
        Buffer.BlockCopy(array, 0, bytes, 0, bytes.Length);
        return Encoding.UTF8.GetString(bytes.TakeWhile(b => b != 0).ToArray());
    }

    public int Length { get { return x is Array ? ((Array)x).Length : 1; } }

    /// Of an array, in memory order.
    public Value this[int i]
    {
        get
        {
            if (!(x is Array))
            {
                throw Wrong("an array");
            }
            return new Value(((Array)x).GetValue(i), field);
        }
    }

    public override string ToString()
    {
        var array = x as Array;
        return array == null ? Text(x) : "[" + string.Join(", ", array.Cast<object>().Select(Text)) + "]";
    }

    static string Text(object x)
    {
        return x is double ? ((double)x).ToString("R", CultureInfo.InvariantCulture)
                           : Convert.ToString(x, CultureInfo.InvariantCulture);
    }

    internal static bool IsReal(object x) { return x is double || x is float; }

    T As<T>(string wanted)
    {
        if (x == null || x is string || x is Array || IsReal(x) && typeof(T) != typeof(double))
        {
            throw Wrong(wanted);
        }
        return (T)Convert.ChangeType(x, typeof(T), CultureInfo.InvariantCulture);
    }

    T[] AsArray<T>(string wanted)
    {
        if (!(x is Array) || x is double[] && typeof(T) != typeof(double))
        {
            throw Wrong(wanted);
        }
        Value all = this;
        return Enumerable.Range(0, Length).Select(i => all[i].As<T>(wanted)).ToArray();
    }

    NodeError Wrong(string wanted)
    {
        string found = x is string ? "a text" : x is Array ? "an array of " + Length
                     : IsReal(x) ? "a real number" : "a number";
        return new NodeError((field != null ? field.Name : "a value") + " is " + found + ", not " + wanted);
    }
}

/// Values by the names of fields: new Message { ["T"] = 300, ["s_B"] = new[] { 0, 0.6, 0.8 } }.
public sealed class Message : Dictionary<string, Value>
{
    readonly string type = "the message";

    public Message() {}
    public Message(Message other) : base(other) { type = other.type; }
    internal Message(string type) { this.type = type; }

    public new Value this[string name]
    {
        get
        {
            if (!TryGetValue(name, out Value value))
            {
                throw new NodeError(type + " has no field " + name + "; it has " + string.Join(", ", Keys));
            }
            return value;
        }
        set { base[name] = value; }
    }
    public bool Has(string name) { return ContainsKey(name); }
    public IEnumerable<string> Names { get { return Keys; } }
}

/// A number, or an array of numbers, of a message.
public sealed class Field
{
    public string Name, Type, Shape; ///< shape: "" for one number
    public int Offset, Count;
    public Dictionary<string, long> Choices; ///< of an enumeration; else null

    static readonly Dictionary<string, Type> types = new Dictionary<string, Type> {
        { "float64", typeof(double) }, { "float32", typeof(float) }, { "int64", typeof(long) },
        { "uint64", typeof(ulong) }, { "int32", typeof(int) }, { "uint32", typeof(uint) }, { "int16", typeof(short) },
        { "uint16", typeof(ushort) }, { "int8", typeof(sbyte) } };

    public bool IsArray { get { return Shape != ""; } }

    /// An array for the numbers of the field: of bytes, unless `types` has its type.
    internal Array Numbers()
    {
        return Array.CreateInstance(types.TryGetValue(Type, out Type type) ? type : typeof(byte), Count);
    }
}

/// What a message looks like: its name and ros2msg text. Packs messages, and unpacks bytes.
public sealed class Schema
{
    public readonly string Name, Text;
    public readonly List<Field> Fields = new List<Field>();
    public readonly int Size;

    /// The text may be indented, as in a program. Without one, nothing is known yet.
    public Schema(string name, string text)
    {
        Name = name;
        Text = Plain(text);
        if (!Given)
        {
            return;
        }
        string fields = Native.Text(Native.fledge_fields(Text));
        if (fields == null)
        {
            throw new NodeError(Name + ": " + Native.Error);
        }
        foreach (string line in fields.TrimEnd('\n').Split('\n'))
        {
            string[] column = line.Split('\t');
            var field = new Field { Name = column[0], Type = column[1], Shape = column[2],
                                    Offset = int.Parse(column[3]), Count = int.Parse(column[4]) };
            Array numbers = field.Numbers();
            if (column[5] != "" && !(numbers is double[] || numbers is float[]))
            {
                field.Choices = new Dictionary<string, long>();
                foreach (Match choice in Regex.Matches(column[5], @"(\w+)\s*=\s*(-?\d+)"))
                {
                    field.Choices[choice.Groups[1].Value] =
                        long.Parse(choice.Groups[2].Value, CultureInfo.InvariantCulture);
                }
            }
            Fields.Add(field);
            Size = field.Offset + Buffer.ByteLength(numbers);
        }
    }

    public bool Given { get { return Text != ""; } }

    /// Without the indentation that all its lines have, and blank lines around it.
    static string Plain(string text)
    {
        var lines = text.Replace("\r\n", "\n").Split('\n').Select(l => l.Trim() == "" ? "" : l).ToList();
        int indent = lines.Where(l => l != "").Select(l => l.Length - l.TrimStart().Length).DefaultIfEmpty(0).Min();
        string plain = string.Join("\n", lines.Select(l => l == "" ? l : l.Substring(indent))).Trim('\n');
        return plain == "" ? "" : plain + "\n";
    }

    /// The struct. Fields that are not given are zero.
    public byte[] Pack(Message message)
    {
        var bytes = new byte[Size];
        var unknown = message.Names.Except(Fields.Select(f => f.Name)).ToList();
        if (unknown.Count > 0)
        {
            throw new NodeError(Name + " has no field " + string.Join(", ", unknown) + "; it has " +
                                string.Join(", ", Fields.Select(f => f.Name)));
        }
        foreach (Field field in Fields.Where(f => message.Has(f.Name)))
        {
            object x = message[field.Name].x;
            string where = Name + "." + field.Name;
            x = x is string ? FromText(field, (string)x, where) : x;
            var from = x as Array;
            if (from != null != field.IsArray || from != null && from.Length != field.Count)
            {
                throw new NodeError(where + " takes " + (field.IsArray ? field.Count + " numbers" : "one number") +
                                    ", found " + (from != null ? from.Length + " in an array" : "one"));
            }
            Array numbers = field.Numbers();
            for (int i = 0; i < field.Count; i++)
            {
                numbers.SetValue(Converted(from != null ? from.GetValue(i) : x, field, numbers, where), i);
            }
            Buffer.BlockCopy(numbers, 0, bytes, field.Offset, Buffer.ByteLength(numbers));
        }
        return bytes;
    }

    static object Converted(object x, Field field, Array numbers, string where)
    {
        if (Value.IsReal(x) && !(numbers is double[] || numbers is float[]))
        {
            throw new NodeError(where + " takes integers, found " + new Value(x));
        }
        try
        {
            object y = Convert.ChangeType(x, numbers.GetType().GetElementType(), CultureInfo.InvariantCulture);
            if (!(y is float) || !float.IsInfinity((float)y) || double.IsInfinity(Convert.ToDouble(x)))
            {
                return y;
            }
        }
        catch (OverflowException)
        {
        }
        throw new NodeError(where + ": " + new Value(x) + " does not fit a " + field.Type);
    }

    static object FromText(Field field, string text, string where)
    {
        if (field.Choices != null && !field.IsArray)
        {
            if (!field.Choices.TryGetValue(text, out long choice))
            {
                throw new NodeError(where + " has no value " + text + "; it has " +
                                    string.Join(", ", field.Choices.Keys));
            }
            return choice;
        }
        Array numbers = field.Numbers();
        if (!field.IsArray || Buffer.ByteLength(numbers) != field.Count)
        {
            throw new NodeError(where + " takes numbers, found \"" + text + "\"");
        }
        byte[] bytes = Encoding.UTF8.GetBytes(text);
        if (bytes.Length > field.Count)
        {
            throw new NodeError(where + " takes " + field.Count + " bytes of text, found " + bytes.Length);
        }
        Buffer.BlockCopy(bytes, 0, numbers, 0, bytes.Length);
        return numbers;
    }

    /// A message, from a struct.
    public Message Unpack(byte[] bytes)
    {
        if (bytes.Length != Size)
        {
            throw new NodeError("a " + Name + " of " + bytes.Length + " bytes, expected " + Size);
        }
        var message = new Message(Name);
        foreach (Field field in Fields)
        {
            Array numbers = field.Numbers();
            Buffer.BlockCopy(bytes, field.Offset, numbers, 0, Buffer.ByteLength(numbers));
            message[field.Name] = new Value(field.IsArray ? numbers : numbers.GetValue(0), field);
        }
        return message;
    }

    /// The struct. Where it begins with a head, this fills in the fields of the head that the message does not give.
    internal byte[] PackWithHead(Message message, long t, uint sequence)
    {
        if (Fields[0].Name == "head.t")
        {
            var whole = new Message { ["head.t"] = t, ["head.quality"] = 3, ["head.sequence"] = (long)sequence };
            foreach (var field in message)
            {
                whole[field.Key] = field.Value;
            }
            message = whole;
        }
        return Pack(message);
    }
}

// ---- the node

/// One program's part in a run. Not for several threads.
public sealed class Node
{
    /// simulation, name, address: null: what FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS say
    /// every, offset: [ns] it steps at offset + k every
    /// timeout: [s] in which the controller must answer
    /// keys: a folder or file of `fledge keys`, for a controller that asks for them; null: FLEDGE_KEYS
    public Node(string simulation = null, string name = null, string address = null, long every = 0, long offset = 0,
                double timeout = 60, string keys = null)
    {
        node = Native.fledge_node_create(simulation, name, address, every, offset);
        Check(node == IntPtr.Zero ? -1 : Native.fledge_node_set(node, keys, timeout));
    }
    ~Node() { Native.fledge_node_destroy(node); }

    public string Simulation { get { return Native.Text(Native.fledge_node_simulation(node)); } }
    public string Name { get { return Native.Text(Native.fledge_node_name(node)); } }
    public ulong Seed { get { return Native.fledge_node_seed(node); } } ///< of the run, once it has begun
    public long End { get { return Native.fledge_node_end(node); } }    ///< [ns] of the run
    public string Reason { get; private set; }                          ///< of its end; "" at the regular one
    public Action<long> Step;                                           ///< called with each instant [ns]

    /// `Saves` returns all that the next steps depend on, besides the messages. `Restores` takes that before the
    /// first step of another program of this name. With both, a node that was lost goes on from a snapshot;
    /// without them, from the beginning.
    public Func<byte[]> Saves;
    public Action<byte[]> Restores;

    /// Step at these instants, too.
    public void AlsoSteps(long every, long offset = 0) { Check(Native.fledge_node_also_steps(node, every, offset)); }

    /// Read a topic. Without a definition, it is as its writer says.
    public void Reads(string topic, Latency latency = Latency.SameInstant, bool optional = false, string name = "",
                      string text = "")
    {
        inputs.Add(topic, new Schema(name, text));
        Check(Native.fledge_node_reads(node, topic, (int)latency + (optional ? 4 : 0), name, inputs[topic].Text,
                                       IntPtr.Zero, UIntPtr.Zero));
    }

    /// Write a topic. `initial` is its value before the first step; fields without a value are zero. Without a
    /// definition, it is as its reader says.
    public void Writes(string topic, string name = "", string text = "", Message initial = null)
    {
        var output = new Output { schema = new Schema(name, text), latest = initial ?? new Message() };
        outputs.Add(topic, output);
        Check(Native.fledge_node_writes(node, topic, name, output.schema.Text, IntPtr.Zero, UIntPtr.Zero));
        Put(topic, output);
    }

    /// The last message of a topic; null where no node writes an optional one. Or write a message, now.
    public Message this[string topic]
    {
        get
        {
            if (!inputs.TryGetValue(topic, out Schema schema))
            {
                throw new NodeError(Name + " does not read " + topic + "; it reads " + List(inputs.Keys));
            }
            IntPtr message = Native.fledge_node_message(node, topic, out UIntPtr size);
            return message == IntPtr.Zero ? null : schema.Unpack(Native.Bytes(message, size));
        }
        set
        {
            if (!outputs.TryGetValue(topic, out Output output))
            {
                throw new NodeError(Name + " does not write " + topic + "; it writes " + List(outputs.Keys));
            }
            output.latest = new Message(value);
            output.t = now;
            output.sequence++;
            Put(topic, output);
        }
    }

    /// Take no further part in the run. The node still sends what this step writes, and Run() returns.
    public void Leave() { Native.fledge_node_leave(node); }

    /// From any thread: end the part in the run with an error, instead of the next step. Ctrl-C ends a program
    /// that does not handle it at once, which the controller notices. (Under Mono, Console.CancelKeyPress changes
    /// the settings of the terminal, which stops programs that run in the background.)
    public void Stop() { Native.fledge_node_stop(node); }

    /// Take part in a run, to its end. Returns its reason, "" at the regular one. Throws NodeError, and
    /// what the step throws.
    public string Run()
    {
        if (Step == null)
        {
            throw new NodeError("there is no step function");
        }
        // Variables keep the functions alive while the library calls them.
        Native.Step step = (user, t) => Guarded(() => Step(now = t));
        Native.Define define = (user, topic, type, text) =>
            Guarded(() => Define(Native.Text(topic), new Schema(Native.Text(type), Native.Text(text))));
        Native.Save save = user => Guarded(Save);
        Native.Restore restore = (user, saved, size) => Guarded(() => Restore(Native.Bytes(saved, size)));
        bool saves = Saves != null && Restores != null;
        Check(Native.fledge_node_on(node, define, saves ? save : null, saves ? restore : null, IntPtr.Zero));
        int result = Native.fledge_node_run(node, step, IntPtr.Zero);
        GC.KeepAlive(define);
        GC.KeepAlive(save);
        GC.KeepAlive(restore);
        if (failure != null)
        {
            ExceptionDispatchInfo.Capture(failure).Throw();
        }
        Check(Math.Min(result, 0));
        Reason = Native.Error;
        return Reason;
    }

    sealed class Output
    {
        public Schema schema;
        public Message latest; // the last one, written at t; the initial value; or null: it is in a snapshot
        public long t;
        public uint sequence;
    }

    readonly IntPtr node;
    readonly Dictionary<string, Schema> inputs = new Dictionary<string, Schema>();  // by topic
    readonly Dictionary<string, Output> outputs = new Dictionary<string, Output>(); // by topic
    long now = -1;
    Exception failure;

    static string List(IEnumerable<string> names) { return names.Any() ? string.Join(", ", names) : "nothing"; }

    internal static void Check(int result)
    {
        if (result < 0)
        {
            throw new NodeError(Native.Error);
        }
    }

    /// The C library cannot pass exceptions on: it gets the text, and Run() throws the exception.
    int Guarded(Action action)
    {
        try
        {
            action();
            return 0;
        }
        catch (Exception error)
        {
            failure = error;
            return Native.fledge_fail((error.GetType().Name + ": " + error.Message).Replace("\0", ""));
        }
    }

    void Put(string topic, Output output)
    {
        if (output.schema.Given && output.latest != null)
        {
            byte[] bytes = output.sequence == 0 ? output.schema.Pack(output.latest)
                                                : output.schema.PackWithHead(output.latest, output.t, output.sequence);
            Check(Native.fledge_node_put(node, topic, bytes, (UIntPtr)bytes.Length));
        }
    }

    void Define(string topic, Schema schema)
    {
        if (inputs.ContainsKey(topic))
        {
            inputs[topic] = schema;
        }
        if (outputs.TryGetValue(topic, out Output output))
        {
            output.schema = schema;
            Put(topic, output);
        }
    }

    /// The library saves the messages; the counts in their heads are here.
    void Save()
    {
        if (outputs.Values.Any(o => o.sequence > 0 && !o.schema.Given))
        {
            return; // a message that has no bytes yet
        }
        var stream = new MemoryStream();
        using (var writer = new BinaryWriter(stream))
        {
            foreach (Output output in outputs.Values)
            {
                writer.Write(output.sequence);
            }
            writer.Write(Saves());
        }
        byte[] saved = stream.ToArray();
        Check(Native.fledge_node_saved(node, saved, (UIntPtr)saved.Length));
    }

    void Restore(byte[] saved)
    {
        using (var reader = new BinaryReader(new MemoryStream(saved)))
        {
            foreach (Output output in outputs.Values)
            {
                output.latest = null;
                output.sequence = reader.ReadUInt32();
            }
            Restores(reader.ReadBytes(saved.Length));
        }
    }
}

// ---- the observer

/// A message of some node, as it was written.
public sealed class Seen
{
    public string Topic, Node;
    public long T;             ///< [ns] of writing; -1: before the first step
    public uint Count, Missed; ///< on its topic (0: the initial value); since the one seen before
    public Message Message;
    public Value this[string field] { get { return Message[field]; } }
}

/// A program that takes no steps: a viewer, a ground system. It comes and goes at any time, sees what nodes write,
/// and may write topics that the controller's configuration assigns to it. The run never waits for it: it misses
/// the messages that it does not read in time, and counts them.
///
///     using (var observer = new Observer("spring", "ground", "tcp://127.0.0.1:7000"))
///     {
///         observer.Subscribe("/mass/");
///         foreach (Seen mass in observer) // until the run is over
///             observer.Write("/ground/stiffness", new Message { ["k"] = 2 });
///     }
///
/// One thread uses it, but other threads may call Write().
public sealed class Observer : IEnumerable<Seen>, IDisposable
{
    /// As for a node; timeout [s] is also the time for all nodes to have joined.
    public Observer(string simulation = null, string name = null, string address = null, double timeout = 60,
                    string keys = null)
    {
        observer = Native.fledge_observer_create(simulation, name, address, keys, timeout);
        Node.Check(observer == IntPtr.Zero ? -1 : 0);
        FindTopics();
    }

    public readonly Dictionary<string, Schema> Topics = new Dictionary<string, Schema>(); ///< all that there are
    public ulong Missed { get; private set; } ///< messages, of all topics
    /// Of the end of the run, once it is over; "" at the regular one.
    public string Reason { get { return Native.Text(Native.fledge_observer_reason(observer)); } }
    public long T { get; private set; } ///< [ns] of the newest message

    /// Subscribe to all topics with one of these prefixes; "": all. The last message of each comes at once.
    public void Subscribe(params string[] topics)
    {
        foreach (string topic in topics)
        {
            Node.Check(Native.fledge_observer_subscribe(observer, topic));
        }
    }

    /// The next message. Null if none comes in time [s] (negative: any), or the run is over. Throws NodeError
    /// if the controller is gone.
    public Seen Next(double most = -1)
    {
        int found = Native.fledge_observer_next(observer, most, out Native.Seen seen);
        Node.Check(found);
        if (found == 0)
        {
            return null;
        }
        Missed += seen.missed;
        T = Math.Max(T, seen.t);
        string topic = Native.Text(seen.topic);
        lock (counts)
        {
            return new Seen { Topic = topic, Node = Native.Text(seen.node), T = seen.t, Count = seen.count,
                              Missed = seen.missed,
                              Message = SchemaOf(topic).Unpack(Native.Bytes(seen.message, seen.size)) };
        }
    }

    public IEnumerator<Seen> GetEnumerator()
    {
        for (Seen seen; (seen = Next()) != null;)
        {
            yield return seen;
        }
    }
    IEnumerator IEnumerable.GetEnumerator() { return GetEnumerator(); }

    /// Write a message. Where it begins with a Fledge head, the observer fills in what the program does not give.
    public void Write(string topic, Message message)
    {
        lock (counts)
        {
            Schema schema = SchemaOf(topic);
            counts.TryGetValue(topic, out uint count);
            byte[] bytes = schema.PackWithHead(message, T, ++count);
            Node.Check(Native.fledge_observer_write(observer, topic, bytes, (UIntPtr)bytes.Length));
            counts[topic] = count;
        }
    }

    public void Dispose()
    {
        Native.fledge_observer_destroy(observer);
        observer = IntPtr.Zero;
    }

    readonly Dictionary<string, uint> counts = new Dictionary<string, uint>(); // of messages written, by topic
    IntPtr observer;

    void FindTopics()
    {
        foreach (string topic in Native.Text(Native.fledge_observer_topics(observer))
                     .Split(new[] { '\n' }, StringSplitOptions.RemoveEmptyEntries).Except(Topics.Keys))
        {
            Topics[topic] = new Schema(Native.Text(Native.fledge_observer_type(observer, topic)),
                                       Native.Text(Native.fledge_observer_definition(observer, topic)));
        }
    }

    Schema SchemaOf(string topic)
    {
        if (!Topics.ContainsKey(topic) && Native.fledge_observer_definition(observer, topic) != IntPtr.Zero)
        {
            FindTopics(); // nodes have joined
        }
        if (!Topics.TryGetValue(topic, out Schema schema))
        {
            throw new NodeError("there is no topic " + topic + "; there are " +
                                (Topics.Count == 0 ? "none" : string.Join(", ", Topics.Keys)));
        }
        return schema;
    }
}

// ---- the C library

/// cosim/bindings/c/fledge_node.h.
static class Native
{
    const string library = "fledge_node";

    public delegate int Step(IntPtr user, long t);
    public delegate int Define(IntPtr user, IntPtr topic, IntPtr type, IntPtr definition);
    public delegate int Save(IntPtr user);
    public delegate int Restore(IntPtr user, IntPtr saved, UIntPtr size);

    [StructLayout(LayoutKind.Sequential)]
    public struct Seen
    {
        public IntPtr topic, node, message;
        public UIntPtr size;
        public long t;
        public uint count, missed;
    }

    [DllImport(library)] static extern IntPtr fledge_error();
    [DllImport(library)] public static extern int fledge_fail(string why);
    [DllImport(library)] public static extern IntPtr fledge_fields(string definition);

    [DllImport(library)] public static extern IntPtr fledge_node_create(string simulation, string node, string address,
                                                                        long every, long offset);
    [DllImport(library)] public static extern void fledge_node_destroy(IntPtr node);
    [DllImport(library)] public static extern IntPtr fledge_node_simulation(IntPtr node);
    [DllImport(library)] public static extern IntPtr fledge_node_name(IntPtr node);
    [DllImport(library)] public static extern int fledge_node_set(IntPtr node, string keys, double timeout);
    [DllImport(library)] public static extern int fledge_node_also_steps(IntPtr node, long every, long offset);
    [DllImport(library)] public static extern int fledge_node_reads(IntPtr node, string topic, int latency, string type,
                                                                    string definition, IntPtr message, UIntPtr size);
    [DllImport(library)] public static extern int fledge_node_writes(IntPtr node, string topic, string type,
                                                                     string definition, IntPtr message, UIntPtr size);
    [DllImport(library)] public static extern int fledge_node_on(IntPtr node, Define define, Save save, Restore restore,
                                                                 IntPtr user);
    [DllImport(library)] public static extern int fledge_node_saved(IntPtr node, byte[] saved, UIntPtr size);
    [DllImport(library)] public static extern IntPtr fledge_node_message(IntPtr node, string topic, out UIntPtr size);
    [DllImport(library)] public static extern int fledge_node_put(IntPtr node, string topic, byte[] message,
                                                                  UIntPtr size);
    [DllImport(library)] public static extern int fledge_node_run(IntPtr node, Step step, IntPtr user);
    [DllImport(library)] public static extern void fledge_node_leave(IntPtr node);
    [DllImport(library)] public static extern void fledge_node_stop(IntPtr node);
    [DllImport(library)] public static extern ulong fledge_node_seed(IntPtr node);
    [DllImport(library)] public static extern long fledge_node_end(IntPtr node);

    [DllImport(library)] public static extern IntPtr fledge_observer_create(string simulation, string name,
                                                                            string address, string keys,
                                                                            double timeout);
    [DllImport(library)] public static extern void fledge_observer_destroy(IntPtr observer);
    [DllImport(library)] public static extern int fledge_observer_subscribe(IntPtr observer, string prefix);
    [DllImport(library)] public static extern int fledge_observer_next(IntPtr observer, double timeout, out Seen seen);
    [DllImport(library)] public static extern int fledge_observer_write(IntPtr observer, string topic, byte[] message,
                                                                        UIntPtr size);
    [DllImport(library)] public static extern IntPtr fledge_observer_topics(IntPtr observer);
    [DllImport(library)] public static extern IntPtr fledge_observer_type(IntPtr observer, string topic);
    [DllImport(library)] public static extern IntPtr fledge_observer_definition(IntPtr observer, string topic);
    [DllImport(library)] public static extern IntPtr fledge_observer_reason(IntPtr observer);

    /// Why the last function failed; "" if it did not.
    public static string Error { get { return Text(fledge_error()); } }

    public static string Text(IntPtr text) { return Marshal.PtrToStringAnsi(text); } // UTF-8, under Mono

    public static byte[] Bytes(IntPtr memory, UIntPtr size)
    {
        var bytes = new byte[(int)size];
        if (bytes.Length > 0)
        {
            Marshal.Copy(memory, bytes, 0, bytes.Length);
        }
        return bytes;
    }
}

} // namespace Fledge
