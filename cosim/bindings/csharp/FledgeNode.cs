// SPDX-License-Identifier: Apache-2.0
// A C# program as a node of a co-simulation. This file is all that is needed, with libzmq (libzmq.so.5).
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
// "wheels[2].axis_B"). A definition is needed on one side only: without one here, that of the partner
// comes when the run begins, so that all messages of a mission are known. Where it begins with a Fledge
// head, its time, quality and sequence are filled in unless they are given. Times are integers in
// nanoseconds.
//
// The format is described in cosim/protocol.h; names here follow it.
using System;
using System.Collections;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Runtime.InteropServices;
using System.Text;
using System.Text.RegularExpressions;
using System.Threading;

namespace Fledge
{

/// The controller refuses the node, is not there, or breaks the format; or a message is used wrongly.
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

/// A number, an array of numbers, or a text; of a message that was read, or for one to be written. As
/// a double or double[] it is taken as it is; other types are asked for: (long)m["head.t"],
/// (string)m["mode"] for a text or the name of an enumeration's value, (Latency)(int)m["x"].
public struct Value
{
    internal readonly object list; // double[], long[], ulong[]; string; or null
    internal readonly double real;
    internal readonly long whole;
    internal readonly Field field;
    internal readonly Form form;

    internal enum Form : byte { None, Real, Whole, Unsigned, Reals, Wholes, Unsigneds, Text }

    internal Value(Form form, object list, double real, long whole, Field field)
    {
        this.form = form;
        this.list = list;
        this.real = real;
        this.whole = whole;
        this.field = field;
    }

    public static implicit operator Value(double x) { return new Value(Form.Real, null, x, 0, null); }
    public static implicit operator Value(long x) { return new Value(Form.Whole, null, 0, x, null); }
    public static implicit operator Value(ulong x) { return new Value(Form.Unsigned, null, 0, (long)x, null); }
    public static implicit operator Value(int x) { return (long)x; }
    public static implicit operator Value(bool x) { return x ? 1L : 0L; }
    public static implicit operator Value(string x) { return new Value(Form.Text, x, 0, 0, null); }
    public static implicit operator Value(double[] x) { return new Value(Form.Reals, x.Clone(), 0, 0, null); }
    public static implicit operator Value(long[] x) { return new Value(Form.Wholes, x.Clone(), 0, 0, null); }
    public static implicit operator Value(ulong[] x) { return new Value(Form.Unsigneds, x.Clone(), 0, 0, null); }
    public static implicit operator Value(int[] x)
    {
        return new Value(Form.Wholes, Array.ConvertAll(x, i => (long)i), 0, 0, null);
    }
    public static implicit operator Value(byte[] x)
    {
        return new Value(Form.Wholes, Array.ConvertAll(x, i => (long)i), 0, 0, null);
    }

    public static implicit operator double(Value v)
    {
        return v.form == Form.Real ? v.real : v.form == Form.Unsigned ? (ulong)v.whole : (double)v.Whole();
    }
    public static implicit operator double[](Value v)
    {
        switch (v.form)
        {
        case Form.Reals: return (double[])((double[])v.list).Clone();
        case Form.Wholes: return Array.ConvertAll((long[])v.list, x => (double)x);
        case Form.Unsigneds: return Array.ConvertAll((ulong[])v.list, x => (double)x);
        }
        throw v.Wrong("an array");
    }
    public static explicit operator long(Value v)
    {
        return v.form == Form.Unsigned ? checked((long)(ulong)v.whole) : v.Whole();
    }
    public static explicit operator ulong(Value v)
    {
        return v.form == Form.Unsigned ? (ulong)v.whole : checked((ulong)v.Whole());
    }
    public static explicit operator int(Value v) { return checked((int)(long)v); }
    public static explicit operator uint(Value v) { return checked((uint)(long)v); }
    public static explicit operator bool(Value v) { return (long)v != 0; }
    public static explicit operator long[](Value v)
    {
        return v.form == Form.Unsigneds ? Array.ConvertAll((ulong[])v.list, x => checked((long)x)) : v.Wholes();
    }
    public static explicit operator ulong[](Value v)
    {
        return v.form == Form.Unsigneds ? (ulong[])((ulong[])v.list).Clone()
                                        : Array.ConvertAll(v.Wholes(), x => checked((ulong)x));
    }
    /// A text up to its end, or the name of an enumeration's value.
    public static explicit operator string(Value v)
    {
        if (v.form == Form.Text)
        {
            return (string)v.list;
        }
        if (v.form == Form.Whole && v.field != null && v.field.Choices != null)
        {
            foreach (var choice in v.field.Choices)
            {
                if (choice.Value == v.whole)
                {
                    return choice.Key;
                }
            }
            return v.ToString();
        }
        if (v.form == Form.Wholes && v.field != null && v.field.Item == 1)
        {
            byte[] bytes = Array.ConvertAll((long[])v.list, x => (byte)x);
            int end = Array.IndexOf(bytes, (byte)0);
            return Encoding.UTF8.GetString(bytes, 0, end < 0 ? bytes.Length : end);
        }
        throw v.Wrong("a text or an enumeration");
    }

    public int Length { get { return list is Array ? ((Array)list).Length : 1; } }

    /// Of an array, in memory order.
    public Value this[int i]
    {
        get
        {
            switch (form)
            {
            case Form.Reals: return ((double[])list)[i];
            case Form.Wholes: return ((long[])list)[i];
            case Form.Unsigneds: return ((ulong[])list)[i];
            }
            throw Wrong("an array");
        }
    }

    public override string ToString()
    {
        switch (form)
        {
        case Form.Text: return (string)list;
        case Form.Real: return real.ToString("R", CultureInfo.InvariantCulture);
        case Form.Whole: return whole.ToString(CultureInfo.InvariantCulture);
        case Form.Unsigned: return ((ulong)whole).ToString(CultureInfo.InvariantCulture);
        case Form.None: return "";
        }
        var numbers = new string[Length];
        for (int i = 0; i < numbers.Length; i++)
        {
            numbers[i] = this[i].ToString();
        }
        return "[" + string.Join(", ", numbers) + "]";
    }

    long Whole()
    {
        if (form != Form.Whole)
        {
            throw Wrong("an integer");
        }
        return whole;
    }

    long[] Wholes()
    {
        if (form != Form.Wholes)
        {
            throw Wrong("an array of integers");
        }
        return (long[])((long[])list).Clone();
    }

    NodeError Wrong(string wanted)
    {
        string found = form == Form.Text ? "a text" : list is Array ? "an array of " + Length : "a number";
        return new NodeError((field != null ? field.Name : "a value") + " is " +
                             (form == Form.Real ? "a real number" : found) + ", not " + wanted);
    }
}

/// Values by the names of fields: new Message { ["T"] = 300, ["s_B"] = new[] { 0, 0.6, 0.8 } }.
public sealed class Message : IEnumerable<KeyValuePair<string, Value>>
{
    readonly Dictionary<string, Value> values;
    readonly string type;

    public Message() : this("the message") {}
    public Message(Message other)
    {
        type = other.type;
        values = new Dictionary<string, Value>(other.values);
    }
    internal Message(string type)
    {
        this.type = type;
        values = new Dictionary<string, Value>();
    }

    public Value this[string name]
    {
        get
        {
            Value value;
            if (!values.TryGetValue(name, out value))
            {
                throw new NodeError(type + " has no field " + name + "; it has " + string.Join(", ", values.Keys));
            }
            return value;
        }
        set { values[name] = value; }
    }
    public bool Has(string name) { return values.ContainsKey(name); }
    public IEnumerable<string> Names { get { return values.Keys; } }
    public void Add(string name, Value value) { values.Add(name, value); }
    internal bool Get(string name, out Value value) { return values.TryGetValue(name, out value); }
    IEnumerator IEnumerable.GetEnumerator() { return values.GetEnumerator(); }
    public IEnumerator<KeyValuePair<string, Value>> GetEnumerator() { return values.GetEnumerator(); }
}

/// A number, or an array of numbers, of a message.
public sealed class Field
{
    public string Name, Type, Unit = "", Shape = "";
    public int Offset, Item, Count = 1;
    public bool IsArray;
    public Dictionary<string, long> Choices; ///< of an enumeration; else null
}

/// What a message looks like: its name and ros2msg text. Packs messages, and unpacks bytes.
public sealed class Schema
{
    public readonly string Name, Text;
    public readonly List<Field> Fields = new List<Field>();
    public readonly int Size;
    public readonly ulong Hash;

    const int SizeMax = 1 << 24, FieldsMax = 1 << 16;
    static readonly Dictionary<string, int> primitives = new Dictionary<string, int> {
        { "float64", 8 }, { "float32", 4 }, { "int64", 8 }, { "uint64", 8 }, { "int32", 4 }, { "uint32", 4 },
        { "int16", 2 }, { "uint16", 2 }, { "int8", 1 }, { "uint8", 1 }, { "bool", 1 }, { "byte", 1 }, { "char", 1 } };
    static readonly char[] space = { ' ', '\t', '\r' };
    static readonly Regex identifier = new Regex(@"^[A-Za-z_][A-Za-z0-9_]*\z");
    static readonly Regex choices = new Regex(@"\{([^{}]*)\}\s*$");
    readonly Dictionary<string, List<KeyValuePair<int, string>>> sections =
        new Dictionary<string, List<KeyValuePair<int, string>>>();

    /// The text may be indented, as in a program. Without one, nothing is known yet.
    public Schema(string name, string text) : this(name, text, true) {}

    /// The text is as it was sent, with all its blanks.
    public static Schema AsSent(string name, string text) { return new Schema(name, text, false); }

    Schema(string name, string text, bool indented)
    {
        Name = name;
        Text = indented ? Plain(text) : text;
        if (Text == "")
        {
            return;
        }
        Read();
        int at = 0;
        Walk("", "", 0, ref at);
        if (Fields.Count == 0)
        {
            throw new NodeError(Name + ": the definition has no fields");
        }
        Size = at;
        Hash = 0xcbf29ce484222325;
        foreach (byte b in Encoding.UTF8.GetBytes(Text))
        {
            Hash = unchecked((Hash ^ b) * 0x100000001b3);
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

    NodeError Wrong(int line, string why, string found)
    {
        return new NodeError(Name + ": line " + line + ": " + why + ", found \"" +
                             found.Substring(0, Math.Min(80, found.Length)) + "\"");
    }

    /// Sections are the nested types.
    void Read()
    {
        string section = "";
        sections[section] = new List<KeyValuePair<int, string>>();
        bool afterRule = false;
        string[] lines = Text.Split('\n');
        int n = Text.EndsWith("\n", StringComparison.Ordinal) ? lines.Length - 1 : lines.Length;
        for (int i = 0; i < n; i++)
        {
            string line = lines[i];
            if (afterRule)
            {
                section = line.StartsWith("MSG:", StringComparison.Ordinal) ? Short(line.Substring(4).Trim(space)) : "";
                if (section == "" || sections.ContainsKey(section))
                {
                    throw Wrong(i + 1, "expected \"MSG: <a new type>\"", line);
                }
                sections[section] = new List<KeyValuePair<int, string>>();
                afterRule = false;
            }
            else if (line.Length == 80 && line.Trim('=') == "")
            {
                afterRule = true;
            }
            else if (line.Split('#')[0].Trim(space) != "")
            {
                sections[section].Add(new KeyValuePair<int, string>(i + 1, line));
            }
        }
    }

    static string Short(string type) { return type.Substring(type.LastIndexOf('/') + 1); }

    /// The leading word, which is taken off.
    static string TakeWord(ref string text)
    {
        text = text.Trim(space);
        int end = text.IndexOfAny(space);
        string word = end < 0 ? text : text.Substring(0, end);
        text = text.Substring(word.Length);
        return word;
    }

    /// What is between these at the beginning, which is taken off; null if the text begins otherwise.
    static string TakeBetween(char open, char close, ref string text)
    {
        text = text.Trim(space);
        if (text == "" || text[0] != open)
        {
            return null;
        }
        int end = text.IndexOf(close);
        string inside = end < 0 ? text.Substring(1) : text.Substring(1, end - 1);
        text = end < 0 ? "" : text.Substring(end + 1);
        return inside;
    }

    static bool Number(string text, out uint n)
    {
        return uint.TryParse(text, NumberStyles.None, CultureInfo.InvariantCulture, out n);
    }

    void Walk(string section, string prefix, int depth, ref int at)
    {
        var names = new HashSet<string>();
        foreach (var line in sections[section])
        {
            int hash = line.Value.IndexOf('#');
            string code = hash < 0 ? line.Value : line.Value.Substring(0, hash);
            string comment = hash < 0 ? "" : line.Value.Substring(hash + 1), meaning = comment;
            string type = TakeWord(ref code), name = TakeWord(ref code);
            var field = new Field();
            uint count = 1;
            int bracket = type.IndexOf('[');
            if (bracket >= 0)
            {
                if (type[type.Length - 1] != ']' ||
                    !Number(type.Substring(bracket + 1, type.Length - bracket - 2), out count) || count == 0)
                {
                    throw Wrong(line.Key, "expected an array of fixed size", line.Value);
                }
                field.IsArray = true;
                field.Shape = count.ToString(CultureInfo.InvariantCulture);
                type = type.Substring(0, bracket);
            }
            if (!identifier.IsMatch(name) || code.Trim(space) != "")
            {
                throw Wrong(line.Key, "expected \"<type> <name>\" of fixed size", line.Value);
            }
            if (!names.Add(name))
            {
                throw Wrong(line.Key, "this name is there twice", name);
            }
            string told = TakeWord(ref comment);
            if (string.Equals(told, name, StringComparison.OrdinalIgnoreCase))
            {
                name = told;
                field.Unit = TakeBetween('[', ']', ref comment) ?? "";
                field.Shape = field.IsArray ? Told(TakeBetween('(', ')', ref comment), count) ?? field.Shape : "";
            }
            field.Name = prefix + name;
            field.Type = type;
            if (primitives.TryGetValue(type, out field.Item))
            {
                Add(line.Key, field, count, meaning, ref at);
            }
            else if (Short(type) == "" || !sections.ContainsKey(Short(type)))
            {
                throw Wrong(line.Key, "this type is not of fixed size or not defined here", type);
            }
            else if (depth >= 16)
            {
                throw Wrong(line.Key, "types are nested too deeply, or contain themselves", type);
            }
            else
            {
                for (uint i = 0; i < count; i++)
                {
                    int before = Fields.Count;
                    Walk(Short(type), field.Name + (field.IsArray ? "[" + i + "]." : "."), depth + 1, ref at);
                    if (Fields.Count == before)
                    {
                        throw Wrong(line.Key, "this type has no fields", type);
                    }
                }
            }
        }
    }

    /// "3, 3" tells the dimensions of what ROS has as one, if their product is the same; else null.
    static string Told(string shape, uint count)
    {
        ulong product = 1;
        var dimensions = new List<uint>();
        foreach (string dimension in (shape ?? "").Split(','))
        {
            uint n;
            if (!Number(dimension.Trim(space), out n) || n == 0 || product > count)
            {
                return null;
            }
            product *= n;
            dimensions.Add(n);
        }
        return product == count ? string.Join(", ", dimensions) : null;
    }

    void Add(int line, Field field, uint count, string comment, ref int at)
    {
        if (at + (long)field.Item * count > SizeMax || Fields.Count >= FieldsMax)
        {
            throw Wrong(line, "the message is too large", field.Name);
        }
        if (at % field.Item != 0)
        {
            throw Wrong(line, "padding would be needed before this field", field.Name);
        }
        Match match = choices.Match(comment);
        if (match.Success && !field.Type.StartsWith("float", StringComparison.Ordinal))
        {
            field.Choices = new Dictionary<string, long>();
            foreach (string choice in match.Groups[1].Value.Split(','))
            {
                string[] parts = choice.Split('=');
                long number;
                if (parts.Length == 2 && long.TryParse(parts[1].Trim(), NumberStyles.AllowLeadingSign,
                                                       CultureInfo.InvariantCulture, out number))
                {
                    field.Choices[parts[0].Trim()] = number;
                }
            }
        }
        field.Offset = at;
        field.Count = (int)count;
        at += field.Item * field.Count;
        Fields.Add(field);
    }

    /// A payload: CDR header and struct, little-endian unless asked otherwise. Fields that are not given
    /// are zero.
    public byte[] Pack(Message message, bool little = true)
    {
        var payload = new byte[4 + Size];
        payload[1] = (byte)(little ? 1 : 0);
        int given = 0;
        foreach (Field field in Fields)
        {
            Value value;
            if (message.Get(field.Name, out value))
            {
                Put(payload, field, value, little);
                given++;
            }
        }
        if (given != message.Names.Count())
        {
            var names = Fields.Select(f => f.Name).ToList();
            throw new NodeError(Name + " has no field " + string.Join(", ", message.Names.Except(names)) + "; it has " +
                                string.Join(", ", names));
        }
        return payload;
    }

    void Put(byte[] payload, Field field, Value value, bool little)
    {
        string where = Name + "." + field.Name;
        bool real = field.Type.StartsWith("float", StringComparison.Ordinal);
        if (value.form == Value.Form.Text)
        {
            value = FromText(field, (string)value.list, where);
        }
        if (value.Length != field.Count || value.list is Array != field.IsArray)
        {
            throw new NodeError(where + " takes " + (field.IsArray ? field.Count + " numbers" : "one number") +
                                ", found " + (value.list is Array ? value.Length + " in an array" : "one"));
        }
        for (int i = 0; i < field.Count; i++)
        {
            Value x = field.IsArray ? value[i] : value;
            ulong bits;
            if (real)
            {
                double d = x;
                bits = field.Item == 8 ? (ulong)BitConverter.DoubleToInt64Bits(d)
                                       : BitConverter.ToUInt32(BitConverter.GetBytes((float)d), 0);
                if (field.Item == 4 && float.IsInfinity((float)d) && !double.IsInfinity(d))
                {
                    throw new NodeError(where + ": " + x + " does not fit a " + field.Type);
                }
            }
            else
            {
                if (x.form == Value.Form.Real)
                {
                    throw new NodeError(where + " takes integers, found " + x);
                }
                bits = (ulong)x.whole;
                bool unsigned = field.Type[0] == 'u' || field.Item == 1 && field.Type != "int8";
                bool negative = x.form == Value.Form.Whole && x.whole < 0;
                int room = 8 * field.Item - (unsigned ? 0 : 1);
                if (negative ? unsigned || room < 63 && x.whole < -(1L << room) : room < 64 && bits >> room != 0)
                {
                    throw new NodeError(where + ": " + x + " does not fit a " + field.Type);
                }
            }
            Raw.Put(payload, 4 + field.Offset + i * field.Item, bits, field.Item, little);
        }
    }

    static Value FromText(Field field, string text, string where)
    {
        if (field.Choices != null && !field.IsArray)
        {
            long choice;
            if (!field.Choices.TryGetValue(text, out choice))
            {
                throw new NodeError(where + " has no value " + text + "; it has " +
                                    string.Join(", ", field.Choices.Keys));
            }
            return choice;
        }
        if (!field.IsArray || field.Item != 1)
        {
            throw new NodeError(where + " takes numbers, found \"" + text + "\"");
        }
        byte[] bytes = Encoding.UTF8.GetBytes(text);
        if (bytes.Length > field.Count)
        {
            throw new NodeError(where + " takes " + field.Count + " bytes of text, found " + bytes.Length);
        }
        Array.Resize(ref bytes, field.Count);
        return field.Type == "int8" ? Array.ConvertAll(bytes, b => (long)(sbyte)b) : (Value)bytes;
    }

    /// A message, from a payload.
    public Message Unpack(byte[] payload)
    {
        if (payload.Length != Size + 4 || payload[0] != 0 || payload[1] > 1 || payload[2] != 0 || payload[3] != 0)
        {
            throw new NodeError("a " + Name + " of " + payload.Length + " bytes, expected a CDR header and " + Size);
        }
        bool little = payload[1] == 1;
        var message = new Message(Name);
        foreach (Field field in Fields)
        {
            message[field.Name] = Get(payload, field, little);
        }
        return message;
    }

    static Value Get(byte[] payload, Field field, bool little)
    {
        int at = 4 + field.Offset, n = field.Count, item = field.Item;
        bool array = field.IsArray;
        switch (field.Type)
        {
        case "float64":
        case "float32":
            var reals = new double[n];
            for (int i = 0; i < n; i++)
            {
                ulong bits = Raw.Get(payload, at + i * item, item, little);
                reals[i] = item == 8 ? BitConverter.Int64BitsToDouble((long)bits)
                                     : BitConverter.ToSingle(BitConverter.GetBytes((uint)bits), 0);
            }
            return new Value(array ? Value.Form.Reals : Value.Form.Real, array ? reals : null, reals[0], 0, field);
        case "uint64":
            var unsigneds = new ulong[n];
            for (int i = 0; i < n; i++)
            {
                unsigneds[i] = Raw.Get(payload, at + i * item, item, little);
            }
            return new Value(array ? Value.Form.Unsigneds : Value.Form.Unsigned, array ? unsigneds : null, 0,
                             (long)unsigneds[0], field);
        }
        var wholes = new long[n];
        int spare = field.Type.StartsWith("int", StringComparison.Ordinal) ? 64 - 8 * item : 0;
        for (int i = 0; i < n; i++)
        {
            wholes[i] = (long)Raw.Get(payload, at + i * item, item, little) << spare >> spare;
        }
        return new Value(array ? Value.Form.Wholes : Value.Form.Whole, array ? wholes : null, 0, wholes[0], field);
    }
}

/// Numbers in bytes, in either order.
static class Raw
{
    public static void Put(byte[] to, int at, ulong x, int size, bool little)
    {
        for (int i = 0; i < size; i++, x >>= 8)
        {
            to[little ? at + i : at + size - 1 - i] = (byte)x;
        }
    }

    public static ulong Get(byte[] from, int at, int size, bool little)
    {
        ulong x = 0;
        for (int i = 0; i < size; i++)
        {
            x = x << 8 | from[little ? at + size - 1 - i : at + i];
        }
        return x;
    }
}

// ---- frames

/// A frame, as cosim/protocol.h describes it: its kind, number, and what its body holds, in order.
public sealed class Frame
{
    public const int Version = 1, HeaderSize = 24;
    public const int Largest = 64 << 20; ///< bytes of a frame
    const int name_max = 255, text_max = 1 << 20, items_max = 65536;

    public readonly string Kind;
    public readonly uint Number;
    public readonly List<object> Body;

    // Of each kind, what its body holds: B I Q q integers (u8, u32, u64, i64), ? 0 or 1, l a latency,
    // r a role, n a name, t a text, p bytes, S a schema (name, text, size, hash), R a record, [] a list.
    static readonly string[] forms = {
        "Hello BBr?nn", "Welcome ttQ", "Refused t", "Initialize Qqqttp", "Initialized [qq]??", "ProvideDesired",
        "Desired [nl?S]", "Match [InS]", "Matched [ISp]", "Start [InS]", "Ready", "Tick q[R]", "Tock qq?[R]",
        "Finish t", "Finished", "Failed t", "Attached tt[InS]", "Published Rn", "Save q", "Saved p" };
    static readonly string[] kinds = Array.ConvertAll(forms, f => f.Split(' ')[0]);
    static readonly string[] bodies = Array.ConvertAll(
        forms, f => (f + " ").Split(' ')[1].Replace("S", "ntIQ").Replace("R", "qIIp"));
    static readonly uint[] crcTable = MakeCrcTable();

    public Frame(string kind, uint number, params object[] body) : this(kind, number, new List<object>(body)) {}
    public Frame(string kind, uint number, List<object> body)
    {
        Kind = kind;
        Number = number;
        Body = body;
    }

    public byte[] Encode(bool little = true)
    {
        int kind = Array.IndexOf(kinds, Kind), at = 0;
        var writer = new Writer { little = little };
        Write(writer, Body, bodies[kind], ref at);
        byte[] frame = writer.bytes;
        Array.Resize(ref frame, writer.size);
        Encoding.ASCII.GetBytes("FLCS").CopyTo(frame, 0);
        frame[4] = (byte)(little ? 1 : 0);
        frame[5] = Version;
        Raw.Put(frame, 6, (ulong)kind + 1, 2, little);
        Raw.Put(frame, 8, (ulong)(frame.Length - HeaderSize), 4, little);
        Raw.Put(frame, 12, Crc(frame), 4, little);
        Raw.Put(frame, 16, Number, 4, little);
        return frame;
    }

    /// A frame is read whole or refused, with the byte and the reason.
    public static Frame Decode(byte[] frame)
    {
        if (frame.Length > Largest)
        {
            throw new NodeError("a frame of " + frame.Length + " bytes; " + Largest + " are the most");
        }
        if (frame.Length < HeaderSize || Encoding.ASCII.GetString(frame, 0, 4) != "FLCS")
        {
            throw new NodeError("this is no frame of a co-simulation");
        }
        if (frame[4] > 1)
        {
            throw new NodeError("there is no byte order " + frame[4]);
        }
        if (frame[5] != Version)
        {
            throw new NodeError("version " + frame[5] + " of the format, while this program speaks version " + Version);
        }
        bool little = frame[4] == 1;
        ulong kind = Raw.Get(frame, 6, 2, little), size = Raw.Get(frame, 8, 4, little);
        if (size != (ulong)(frame.Length - HeaderSize))
        {
            throw new NodeError("a body of " + (frame.Length - HeaderSize) + " bytes, while the header says " + size);
        }
        if (Raw.Get(frame, 12, 4, little) != Crc(frame))
        {
            throw new NodeError("the checksum of the body is wrong");
        }
        if (Raw.Get(frame, 20, 4, little) != 0)
        {
            throw new NodeError("bytes 20 to 23 of the header are not zero");
        }
        if (kind < 1 || kind > (ulong)kinds.Length)
        {
            throw new NodeError("there is no frame of kind " + kind);
        }
        var reader = new Reader { frame = frame, little = little, kind = kinds[kind - 1] };
        return new Frame(reader.kind, (uint)Raw.Get(frame, 16, 4, little), ReadAll(reader, bodies[kind - 1]));
    }

    /// The bytes of a body without a header, little-endian.
    internal static byte[] Pack(string form, params object[] values)
    {
        var writer = new Writer { little = true };
        int at = 0;
        Write(writer, new List<object>(values), form, ref at);
        var body = new byte[writer.size - HeaderSize];
        Array.Copy(writer.bytes, HeaderSize, body, 0, body.Length);
        return body;
    }

    internal static List<object> Unpack(string form, byte[] body)
    {
        var frame = new byte[HeaderSize + body.Length];
        body.CopyTo(frame, HeaderSize);
        return ReadAll(new Reader { frame = frame, little = true, kind = "snapshot" }, form);
    }

    static List<object> ReadAll(Reader reader, string form)
    {
        var body = new List<object>();
        int at = 0;
        Read(reader, body, form, ref at);
        if (reader.at != reader.frame.Length)
        {
            throw reader.Wrong(reader.frame.Length - reader.at + " bytes are left over");
        }
        return body;
    }

    static int SizeOf(char code)
    {
        return code == 'q' || code == 'Q' ? 8 : "B?lr".IndexOf(code) >= 0 ? 1 : 4;
    }

    /// The form goes on at `at`, up to the end of it or of the list.
    static void Write(Writer writer, List<object> body, string form, ref int at)
    {
        foreach (object item in body)
        {
            char code = form[at++];
            if (code == '[')
            {
                var list = (List<List<object>>)item;
                writer.Number((ulong)list.Count, 4);
                int begin = at;
                foreach (List<object> inner in list)
                {
                    at = begin;
                    Write(writer, inner, form, ref at);
                }
                at = form.IndexOf(']', begin) + 1;
            }
            else if (code == 'n' || code == 't')
            {
                writer.Bytes(Encoding.UTF8.GetBytes((string)item));
            }
            else if (code == 'p')
            {
                writer.Bytes((byte[])item);
            }
            else
            {
                writer.Number(item is long ? (ulong)(long)item : Convert.ToUInt64(item), SizeOf(code));
            }
        }
    }

    static void Read(Reader reader, List<object> body, string form, ref int at)
    {
        while (at < form.Length && form[at] != ']')
        {
            char code = form[at++];
            if (code == '[')
            {
                int end = form.IndexOf(']', at), least = 0;
                for (int i = at; i < end; i++)
                {
                    least += SizeOf(form[i]);
                }
                ulong n = reader.Number(4);
                if (n > items_max)
                {
                    throw reader.Wrong("a list of " + n + " items; " + items_max + " are the most");
                }
                if (n > (ulong)((reader.frame.Length - reader.at) / least))
                {
                    throw reader.Wrong("a list of " + n + " items does not fit into what is left");
                }
                var list = new List<List<object>>();
                for (ulong i = 0; i < n; i++)
                {
                    var inner = new List<object>();
                    int begin = at;
                    Read(reader, inner, form, ref begin);
                    list.Add(inner);
                }
                body.Add(list);
                at = end + 1;
                continue;
            }
            if (code == 'n' || code == 't')
            {
                body.Add(reader.Text(code == 'n' ? name_max : text_max));
                continue;
            }
            if (code == 'p')
            {
                body.Add(reader.Bytes(Largest));
                continue;
            }
            ulong number = reader.Number(SizeOf(code));
            if (code == '?' && number > 1)
            {
                throw reader.Wrong("expected 0 or 1, found " + number);
            }
            if (code == 'l' && number > (ulong)Latency.NextExchange)
            {
                throw reader.Wrong("there is no latency " + number);
            }
            if (code == 'r' && number > 1)
            {
                throw reader.Wrong("there is no role " + number);
            }
            body.Add(code == 'q' ? (object)(long)number : code == 'I' ? (object)(uint)number : number);
        }
    }

    /// Numbers at multiples of their size, from the start of the body.
    sealed class Writer
    {
        public byte[] bytes = new byte[256];
        public int size = HeaderSize;
        public bool little;

        public void Number(ulong x, int n)
        {
            size += (HeaderSize - size % n) % n;
            int at = Room(n);
            Raw.Put(bytes, at, x, n, little);
        }
        public void Bytes(byte[] data)
        {
            Number((ulong)data.Length, 4);
            int at = Room(data.Length);
            data.CopyTo(bytes, at);
        }
        int Room(int n)
        {
            size += n;
            if (size > bytes.Length)
            {
                Array.Resize(ref bytes, 2 * size);
            }
            return size - n;
        }
    }

    sealed class Reader
    {
        public byte[] frame;
        public int at = HeaderSize;
        public bool little;
        public string kind;

        public ulong Number(int n)
        {
            while ((at - HeaderSize) % n != 0)
            {
                if (frame[Take(1)] != 0)
                {
                    throw Wrong("a gap is not zero");
                }
            }
            return Raw.Get(frame, Take(n), n, little);
        }
        public byte[] Bytes(int most)
        {
            var bytes = new byte[Counted(most)];
            Array.Copy(frame, at - bytes.Length, bytes, 0, bytes.Length);
            return bytes;
        }
        public string Text(int most)
        {
            int n = Counted(most);
            if (Array.IndexOf(frame, (byte)0, at - n, n) >= 0)
            {
                throw Wrong("a text holds a zero byte");
            }
            try
            {
                return utf8.GetString(frame, at - n, n);
            }
            catch (ArgumentException)
            {
                throw Wrong("a text is not UTF-8");
            }
        }
        int Counted(int most)
        {
            ulong n = Number(4);
            if (n > (ulong)most)
            {
                throw Wrong("a length of " + n + "; " + most + " is the most");
            }
            Take((int)n);
            return (int)n;
        }
        int Take(int n)
        {
            if (n > frame.Length - at)
            {
                throw Wrong("it ends here, " + (n - (frame.Length - at)) + " bytes too early");
            }
            at += n;
            return at - n;
        }
        public NodeError Wrong(string why)
        {
            return new NodeError(kind + ": byte " + (at - HeaderSize) + " of the body: " + why);
        }
        static readonly Encoding utf8 = new UTF8Encoding(false, true);
    }

    static uint[] MakeCrcTable()
    {
        var table = new uint[256];
        for (uint i = 0; i < 256; i++)
        {
            uint x = i;
            for (int k = 0; k < 8; k++)
            {
                x = x >> 1 ^ ((x & 1) != 0 ? 0xedb88320 : 0);
            }
            table[i] = x;
        }
        return table;
    }

    /// CRC-32 of the body.
    static uint Crc(byte[] frame)
    {
        uint crc = 0xffffffff;
        for (int i = HeaderSize; i < frame.Length; i++)
        {
            crc = crc >> 8 ^ crcTable[(byte)(crc ^ frame[i])];
        }
        return ~crc;
    }
}

// ---- sockets

/// A socket of libzmq.
sealed class Socket : IDisposable
{
    public const int Pair = 0, Subscriber = 2, Dealer = 5, Publisher = 9; // the last as XPUB
    const short readable = 1, writable = 2;
    const int linger_ = 17, largest_ = 22, heartbeat = 75, silence = 77; // options
    const int publicKey = 48, secretKey = 49, serverKey = 50, subscribe = 6, noDrop = 69;
    const int dontWait = 1, sendMore = 2, interrupted = 4;

    public readonly IntPtr handle;
    readonly IntPtr message = Marshal.AllocHGlobal(64); // a zmq_msg_t

    public Socket(IntPtr context, int type, int linger, Keys keys = null)
    {
        handle = zmq_socket(context, type);
        if (handle == IntPtr.Zero)
        {
            throw Error("cannot open a socket");
        }
        Set(linger_, BitConverter.GetBytes(linger));
        Set(heartbeat, BitConverter.GetBytes(1000));
        Set(silence, BitConverter.GetBytes(5000));
        Set(largest_, BitConverter.GetBytes((long)Frame.Largest));
        if (keys != null)
        {
            Set(publicKey, Encoding.ASCII.GetBytes(keys.Own + "\0"));
            Set(secretKey, Encoding.ASCII.GetBytes(keys.Secret + "\0"));
            Set(serverKey, Encoding.ASCII.GetBytes(keys.Controller + "\0"));
        }
        if (type == Publisher)
        {
            Set(noDrop, BitConverter.GetBytes(1));
        }
    }

    public void Subscribe(string topic) { Set(subscribe, Encoding.UTF8.GetBytes(topic)); }

    public void Dispose()
    {
        zmq_close(handle);
        Marshal.FreeHGlobal(message);
    }

    void Set(int option, byte[] value)
    {
        if (zmq_setsockopt(handle, option, value, (UIntPtr)value.Length) != 0)
        {
            throw Error("cannot set up a socket");
        }
    }

    public void Connect(string address)
    {
        if (zmq_connect(handle, address) != 0)
        {
            throw Error("cannot connect to " + address);
        }
    }

    /// To a side that is gone it does nothing; in lock step only a few frames are ever on their way.
    public void Send(params byte[][] parts)
    {
        for (int i = 0; i < parts.Length; i++)
        {
            int flags = dontWait | (i + 1 < parts.Length ? sendMore : 0);
            while (zmq_send(handle, parts[i], (UIntPtr)parts[i].Length, flags) < 0 &&
                   Marshal.GetLastWin32Error() == interrupted)
            {
            }
        }
    }

    /// The parts of what has come.
    public List<byte[]> Receive()
    {
        var parts = new List<byte[]>();
        for (bool more = true; more;)
        {
            zmq_msg_init(message);
            while (zmq_msg_recv(message, handle, 0) < 0)
            {
                if (Marshal.GetLastWin32Error() != interrupted)
                {
                    throw Error("cannot receive");
                }
            }
            var part = new byte[(int)zmq_msg_size(message)];
            Marshal.Copy(zmq_msg_data(message), part, 0, part.Length);
            parts.Add(part);
            more = zmq_msg_more(message) != 0;
            zmq_msg_close(message);
        }
        return parts;
    }

    [StructLayout(LayoutKind.Sequential)]
    struct Item
    {
        public IntPtr socket;
        public int fd;
        public short events, found;
    }

    /// The first of these to which something has come; null if none has after so many seconds (negative:
    /// for ever) on a clock. `look` is called ten times a second.
    public static Socket First(Stopwatch clock, double most, Action look, params Socket[] sockets)
    {
        var items = Array.ConvertAll(sockets, x => new Item { socket = x.handle, events = readable });
        for (;;)
        {
            look();
            double rest = most < 0 ? 0.1 : Math.Min(0.1, most - clock.Elapsed.TotalSeconds);
            if (Poll(items, rest))
            {
                return sockets[Array.FindIndex(items, i => i.found != 0)];
            }
            if (most >= 0 && clock.Elapsed.TotalSeconds >= most)
            {
                return null;
            }
        }
    }

    /// Whether something can be sent, after so many seconds at most.
    public bool TakesMore(double most)
    {
        return Poll(new[] { new Item { socket = handle, events = writable } }, most);
    }

    static bool Poll(Item[] items, double seconds)
    {
        int n = zmq_poll(items, items.Length, (IntPtr)(long)Math.Ceiling(1000 * Math.Max(0, seconds)));
        if (n < 0 && Marshal.GetLastWin32Error() != interrupted)
        {
            throw Error("cannot wait");
        }
        return n > 0;
    }

    public static NodeError Error(string what)
    {
        return new NodeError(what + ": " + Marshal.PtrToStringAnsi(zmq_strerror(Marshal.GetLastWin32Error())));
    }

    /// What libzmq's own thread tells of a socket. It is to end before that.
    public sealed class Monitor : IDisposable
    {
        public const int Disconnected = 0x0200, FailedNoDetail = 0x0800, Succeeded = 0x1000, FailedProtocol = 0x2000,
                         FailedAuth = 0x4000;
        public readonly Socket events;
        readonly Socket watched;
        static int monitors;

        public Monitor(IntPtr context, Socket socket, int kinds)
        {
            string name = "inproc://fledge-monitor-" + Interlocked.Increment(ref monitors);
            if (zmq_socket_monitor(socket.handle, name, kinds) != 0)
            {
                throw Error("cannot watch a socket");
            }
            watched = socket;
            events = new Socket(context, Pair, 0);
            events.Connect(name);
        }

        public void Dispose()
        {
            zmq_socket_monitor(watched.handle, null, 0);
            events.Dispose();
        }
    }

    const string zmq = "libzmq.so.5";
    [DllImport(zmq)] public static extern IntPtr zmq_ctx_new();
    [DllImport(zmq)] public static extern int zmq_ctx_term(IntPtr context);
    [DllImport(zmq, SetLastError = true)] static extern IntPtr zmq_socket(IntPtr context, int type);
    [DllImport(zmq)] static extern int zmq_close(IntPtr socket);
    [DllImport(zmq, SetLastError = true)]
    static extern int zmq_setsockopt(IntPtr socket, int option, byte[] value, UIntPtr size);
    [DllImport(zmq, SetLastError = true)] static extern int zmq_connect(IntPtr socket, string address);
    [DllImport(zmq, SetLastError = true)]
    static extern int zmq_socket_monitor(IntPtr socket, string address, int events);
    [DllImport(zmq, SetLastError = true)]
    static extern int zmq_send(IntPtr socket, byte[] data, UIntPtr size, int flags);
    [DllImport(zmq)] static extern int zmq_msg_init(IntPtr message);
    [DllImport(zmq, SetLastError = true)] static extern int zmq_msg_recv(IntPtr message, IntPtr socket, int flags);
    [DllImport(zmq)] static extern IntPtr zmq_msg_data(IntPtr message);
    [DllImport(zmq)] static extern UIntPtr zmq_msg_size(IntPtr message);
    [DllImport(zmq)] static extern int zmq_msg_more(IntPtr message);
    [DllImport(zmq)] static extern int zmq_msg_close(IntPtr message);
    [DllImport(zmq, SetLastError = true)] static extern int zmq_poll([In, Out] Item[] items, int n, IntPtr most);
    [DllImport(zmq)] static extern IntPtr zmq_strerror(int error);
}

// ---- keys

/// What a program needs that goes to a controller with keys: files as cosim/keys.h describes them, in Z85.
sealed class Keys
{
    public readonly string Own, Secret, Controller;

    public Keys(string place, string name)
    {
        string secret = place;
        if (Directory.Exists(place))
        {
            secret = Path.Combine(place, name + ".secret");
            if (name.Contains("/") || !File.Exists(secret))
            {
                string[] others = Directory.GetFiles(place, "*.secret");
                others = others.Where(o => Path.GetFileName(o) != "controller.secret").OrderBy(o => o).ToArray();
                if (others.Length != 1)
                {
                    throw new NodeError(place + " holds no " + name + ".secret" +
                                        (others.Length > 1
                                             ? " but several others; say which by FLEDGE_KEYS=" + others[0]
                                             : "; ./fledge keys new " + name + " makes a pair of keys"));
                }
                secret = others[0];
            }
        }
        if (!File.Exists(secret))
        {
            throw new NodeError(secret + ": there are no keys; ./fledge keys new " + name + " makes a pair");
        }
        if ((Mode(secret) & 0x3f) != 0)
        {
            throw new NodeError(secret + ": others may read this secret key; chmod 600 keeps it yours, and if they " +
                                "might have, make a new one");
        }
        string controller = Path.Combine(Path.GetDirectoryName(Path.GetFullPath(secret)), "controller.public");
        Own = Key(secret, "public-key");
        Secret = Key(secret, "secret-key");
        Controller = Key(controller, "public-key");
    }

    static string Key(string file, string which)
    {
        try
        {
            Match match = Regex.Match(File.ReadAllText(file), @"^\s*" + which + @"\s*=\s*""([^""]{40})""",
                                      RegexOptions.Multiline);
            if (!match.Success)
            {
                throw new NodeError(file + " holds no " + which + " of 40 characters; it is no file of a key");
            }
            return match.Groups[1].Value;
        }
        catch (IOException error)
        {
            throw new NodeError("keys: " + error.Message);
        }
    }

    /// Permissions of a file, by Linux' statx, whose struct is the same on all machines; 0 elsewhere.
    static int Mode(string file)
    {
        try
        {
            var found = new byte[256];
            const int modeWanted = 2, place = 28, here = -100;
            return statx(here, file, 0, modeWanted, found) == 0 ? BitConverter.ToUInt16(found, place) : 0;
        }
        catch (EntryPointNotFoundException)
        {
            return 0;
        }
        catch (DllNotFoundException)
        {
            return 0;
        }
    }

    [DllImport("libc.so.6")] static extern int statx(int folder, string file, int flags, uint mask, byte[] found);
}

/// What Fledge's messages begin with.
static class Head
{
    /// A message with its head, where it begins with one; what is given stays.
    public static Message FilledIn(Schema schema, Message message, long t, uint sequence)
    {
        if (schema.Fields.Count == 0 || schema.Fields[0].Name != "head.t")
        {
            return message;
        }
        var whole = new Message { ["head.t"] = t, ["head.quality"] = 3, ["head.sequence"] = (long)sequence };
        foreach (var field in message)
        {
            whole[field.Key] = field.Value;
        }
        return whole;
    }
}

// ---- greeting

/// Watches a socket that connects: libzmq itself would try for ever, and tell nobody why.
sealed class Handshake : IDisposable
{
    public bool Made { get; private set; }
    public Stopwatch Lost { get; private set; } ///< since it was; null if it is not
    readonly Socket.Monitor monitor;
    readonly bool keyed;
    int brokenOff;

    public Handshake(IntPtr context, Socket socket, Keys keys)
    {
        keyed = keys != null;
        monitor = new Socket.Monitor(context, socket, Socket.Monitor.Disconnected | Socket.Monitor.Succeeded |
                                                          Socket.Monitor.FailedAuth | Socket.Monitor.FailedProtocol |
                                                          Socket.Monitor.FailedNoDetail);
    }

    public void Dispose() { monitor.Dispose(); }

    /// Whether something comes to the socket in time [s]. Throws if this program is not let in.
    public bool Wait(Socket socket, double most, Action look, string where)
    {
        var clock = Stopwatch.StartNew();
        for (;;)
        {
            Socket first = Socket.First(clock, most, look, socket, monitor.events);
            if (first != monitor.events)
            {
                return first != null;
            }
            string why = Refusal(monitor.events.Receive()[0]);
            if (why != null)
            {
                throw new NodeError(where + " does not let this program in: " + why);
            }
        }
    }

    string Refusal(byte[] told)
    {
        const uint mechanismMismatch = 0x11000002;
        switch (BitConverter.ToUInt16(told, 0))
        {
        case Socket.Monitor.Succeeded:
            Made = true;
            Lost = null;
            brokenOff = 0;
            return null;
        case Socket.Monitor.Disconnected:
            if (Made)
            {
                Made = false;
                Lost = Stopwatch.StartNew();
            }
            return null;
        case Socket.Monitor.FailedAuth:
            return "it does not know this key: ./fledge keys allow, where the controller runs, lets it in";
        case Socket.Monitor.FailedProtocol:
            if (BitConverter.ToUInt32(told, 2) == mechanismMismatch)
            {
                return keyed ? "it uses no keys, and this program does"
                             : "it asks for keys, and this program has none: give it some by FLEDGE_KEYS " +
                                   "(./fledge keys new makes them)";
            }
            break;
        }
        if (++brokenOff < 5) // it may have been killed just now; again and again it is something else
        {
            return null;
        }
        return keyed ? "what listens there breaks off when it sees these keys: controller.public here is not that of " +
                           "this controller, or it uses no keys"
                     : "what listens there breaks off: it is no controller, or it asks for keys";
    }
}

/// What nodes and observers do first.
sealed class Greeting
{
    public readonly string Simulation, Name, Address;
    public readonly double Patience;
    public readonly Keys Keys;

    public Greeting(string simulation, string name, string address, double patience, string keys)
    {
        Simulation = Given("simulation", simulation, "FLEDGE_SIMULATION");
        Name = Given("name", name, "FLEDGE_NODE");
        Address = Given("address", address, "FLEDGE_ADDRESS");
        Patience = patience;
        string place = string.IsNullOrEmpty(keys) ? Environment.GetEnvironmentVariable("FLEDGE_KEYS") : keys;
        Keys = string.IsNullOrEmpty(place) ? null : new Keys(place, Name);
    }

    static string Given(string what, string value, string variable)
    {
        value = string.IsNullOrEmpty(value) ? Environment.GetEnvironmentVariable(variable) : value;
        if (string.IsNullOrEmpty(value))
        {
            throw new NodeError("a node needs its " + what + ", given here or by " + variable);
        }
        return value;
    }

    public byte[] Hello(int role)
    {
        return new Frame("Hello", 1, Frame.Version, Frame.Version, role, 0, Simulation, Name).Encode();
    }

    /// The controller's answer, of this kind.
    public Frame Ask(IntPtr context, int role, string expected, Action look)
    {
        using (var lobby = new Socket(context, Socket.Dealer, 0, Keys))
        using (var handshake = new Handshake(context, lobby, Keys))
        {
            lobby.Connect(Address);
            lobby.Send(Hello(role));
            if (!handshake.Wait(lobby, Patience, look, "the controller at " + Address))
            {
                throw new NodeError(handshake.Made ? "the controller at " + Address +
                                                         " has no answer: not all nodes are there"
                                                   : "no controller answers at " + Address);
            }
            Frame frame = Frame.Decode(lobby.Receive()[0]);
            if (frame.Kind == "Refused")
            {
                throw new NodeError("the controller refuses " + Name + ": " + frame.Body[0]);
            }
            if (frame.Kind != expected)
            {
                throw new NodeError("the controller answers a Hello with " + frame.Kind);
            }
            return frame;
        }
    }

    /// A controller that listens everywhere does not know by which name it is reached.
    public string Reachable(string address)
    {
        return address.StartsWith("tcp://0.0.0.0:", StringComparison.Ordinal)
                   ? Address.Substring(0, Address.LastIndexOf(':')) + address.Substring(address.LastIndexOf(':'))
                   : address;
    }
}

// ---- the node

/// One program's part in a run. Not for several threads.
public sealed class Node
{
    /// simulation, name, address: null: what FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS say
    /// every, offset: [ns] it steps at offset + k every
    /// patience: [s] for the controller to be there
    /// keys: a folder or file of `fledge keys`, for a controller that asks for them; null: FLEDGE_KEYS
    public Node(string simulation = null, string name = null, string address = null, long every = 0, long offset = 0,
                double patience = 60, string keys = null)
    {
        greeting = new Greeting(simulation, name, address, patience, keys);
        if (every <= 0 || offset < 0)
        {
            throw new NodeError(Name + ": it steps at offset + k every, with every > 0 and offset >= 0, found " +
                                offset + " and " + every);
        }
        this.every = every;
        this.offset = offset;
    }

    public string Simulation { get { return greeting.Simulation; } }
    public string Name { get { return greeting.Name; } }
    public ulong Seed { get; private set; }    ///< of the run, once it has begun
    public long End { get; private set; }      ///< [ns] of the run
    public string Reason { get; private set; } ///< of its end; "" at the regular one
    public Action<long> Step;                  ///< called with each instant [ns]

    /// What returns all that another program of this name needs to go on from here, and what takes it
    /// before the first step of that one. With both, one that was lost is started again without all its
    /// steps from the beginning.
    public Func<byte[]> Saves;
    public Action<byte[]> Restores;

    /// Read a topic. Without a definition, it is as its writer says.
    public void Reads(string topic, Latency latency = Latency.SameInstant, bool optional = false, string name = "",
                      string text = "")
    {
        wants.RemoveAll(w => w.topic == topic);
        wants.Add(new Want { topic = topic, latency = latency, optional = optional, schema = new Schema(name, text) });
    }

    /// Write a topic, which holds `initial` before the first step; all zero unless it is given. Without a
    /// definition, it is as its reader says.
    public void Writes(string topic, string name = "", string text = "", Message initial = null)
    {
        outputs[topic] = new Output { schema = new Schema(name, text), latest = initial ?? new Message() };
    }

    /// What was read last; null where nobody writes an optional topic. Or write a message, now.
    public Message this[string topic]
    {
        get
        {
            Want want = wants.Find(w => w.topic == topic);
            if (want == null)
            {
                throw new NodeError(Name + " does not read " + topic + "; it reads " +
                                    List(wants.Select(w => w.topic)));
            }
            if (want.value == null && want.payload != null) // nobody has looked at it yet
            {
                want.value = want.schema.Unpack(want.payload);
            }
            return want.value;
        }
        set
        {
            Output output;
            if (!outputs.TryGetValue(topic, out output))
            {
                throw new NodeError(Name + " does not write " + topic + "; it writes " + List(outputs.Keys));
            }
            output.latest = new Message(value);
            output.t = now;
            output.sequence++;
            if (output.asked)
            {
                output.payload = Packed(output);
                if (!output.written)
                {
                    output.written = true;
                    written.Add(output);
                }
            }
        }
    }

    /// Take no further part in the run: what this step writes is the last. Run() returns then.
    public void Leave() { leaving = true; }

    /// End the part in the run with an error, from any thread. Ctrl-C is left to the program: unless it
    /// handles it, it ends at once, which the controller notices. (Under Mono, Console.CancelKeyPress
    /// takes hold of the terminal, and stops programs that run in the background.)
    public void Stop() { stopped = true; }

    /// Take part in a run, to its end. Returns its reason, "" at the regular one. Throws NodeError, and
    /// what the step throws.
    public string Run()
    {
        IntPtr context = Socket.zmq_ctx_new();
        try
        {
            // What follows the address is for shared memory, which C# leaves alone.
            Frame welcome = greeting.Ask(context, 0, "Welcome", Look);
            using (var link = new Socket(context, Socket.Pair, 1000, greeting.Keys))
            using (var monitor = new Socket.Monitor(context, link, Socket.Monitor.Disconnected))
            {
                link.Connect(greeting.Reachable((string)welcome.Body[0]));
                link.Send(greeting.Hello(0));
                Serve(link, monitor.events);
            }
        }
        finally
        {
            Socket.zmq_ctx_term(context);
        }
        return Reason;
    }

    sealed class Want
    {
        public string topic;
        public Latency latency;
        public bool optional;
        public Schema schema;
        public byte[] payload; // as last seen
        public Message value;
        public uint count;
    }

    sealed class Output
    {
        public Schema schema;
        public Message latest; // as last written, at t, or what it holds at first; null: from a snapshot
        public long t;
        public uint sequence;
        public bool asked, written;
        public uint channel, count;
        public byte[] payload;
    }

    struct Coming
    {
        public long t;
        public Want want;
        public byte[] payload;
    }

    readonly List<Want> wants = new List<Want>();
    readonly Dictionary<string, Output> outputs = new Dictionary<string, Output>(); // by topic
    readonly Dictionary<uint, Want> channels = new Dictionary<uint, Want>();        // of what is read
    readonly List<Output> written = new List<Output>();                             // in this step
    readonly Greeting greeting;
    readonly long every, offset;
    List<Coming> coming = new List<Coming>(); // that no instant has seen
    long next, now = -1;
    bool leaving;
    volatile bool stopped;

    static string List(IEnumerable<string> names)
    {
        string list = string.Join(", ", names);
        return list == "" ? "nothing" : list;
    }

    void Look()
    {
        if (stopped)
        {
            throw new NodeError("the program ended it");
        }
    }

    void Serve(Socket link, Socket monitor)
    {
        var clock = Stopwatch.StartNew();
        for (double most = greeting.Patience; Reason == null; most = -1) // the first request comes in time
        {
            uint number = 0;
            try
            {
                // In this order: what was sent before the controller went counts.
                Socket from = Socket.First(clock, most, Look, link, monitor);
                if (from != link)
                {
                    throw new Gone(from == null ? "the controller let this program in, but asks nothing of it"
                                                : "the controller is gone");
                }
                List<byte[]> parts = link.Receive();
                if (parts.Count != 1)
                {
                    throw new NodeError("a frame is one part, not " + parts.Count);
                }
                Frame request = Frame.Decode(parts[0]);
                number = request.Number;
                link.Send(Answer(request).Encode());
            }
            catch (Gone gone)
            {
                throw new NodeError(gone.Message);
            }
            catch (Exception error)
            {
                string why = (error.GetType().Name + ": " + error.Message).Replace("\0", "");
                link.Send(new Frame("Failed", number, why).Encode());
                throw;
            }
        }
    }

    sealed class Gone : Exception
    {
        public Gone(string text) : base(text) {}
    }

    /// The reply to a request.
    Frame Answer(Frame request)
    {
        List<object> body = request.Body;
        uint number = request.Number;
        switch (request.Kind)
        {
        case "Initialize": return new Frame("Initialized", number, Initialize(body));
        case "ProvideDesired": return new Frame("Desired", number, Desired());
        case "Match": return new Frame("Matched", number, Match((List<List<object>>)body[0]));
        case "Start":
            Start((List<List<object>>)body[0]);
            return new Frame("Ready", number);
        case "Tick": return new Frame("Tock", number, Tick((long)body[0], (List<List<object>>)body[1]));
        case "Save": return new Frame("Saved", number, Snapshot());
        case "Finish":
            Reason = (string)body[0];
            return new Frame("Finished", number);
        }
        throw new NodeError("the controller sent " + request.Kind + ", which is no request");
    }

    static List<object> Items(params object[] items) { return new List<object>(items); }
    static void AddSchema(List<object> to, Schema schema)
    {
        to.AddRange(Items(schema.Name, schema.Text, schema.Size, schema.Hash));
    }

    object[] Initialize(List<object> body)
    {
        Seed = (ulong)body[0];
        End = (long)body[1];
        var start = (long)body[2];
        var snapshot = (byte[])body[5];
        if (Step == null)
        {
            throw new NodeError("there is no step function");
        }
        next = offset;
        if (start >= offset) // in the place of one that was lost
        {
            next += ((start - offset) / every + 1) * every;
        }
        if (snapshot.Length > 0)
        {
            GoOnFrom(snapshot);
        }
        int saves = Saves != null && Restores != null ? 1 : 0;
        return new object[] { new List<List<object>> { Items(every, offset) }, 0, saves };
    }

    const string ofSnapshot = "[np][nqIp]p"; // what was seen; what was written; the program's own

    byte[] Snapshot()
    {
        if (Saves == null || Restores == null || outputs.Values.Any(o => o.sequence > 0 && !o.schema.Given))
        {
            return new byte[0]; // it cannot
        }
        var seen = new List<List<object>>();
        foreach (Want want in wants.Where(w => w.payload != null))
        {
            seen.Add(Items(want.topic, want.payload));
        }
        var said = new List<List<object>>();
        foreach (var output in outputs.Where(o => o.Value.sequence > 0))
        {
            said.Add(Items(output.Key, output.Value.t, output.Value.sequence, Packed(output.Value)));
        }
        return Frame.Pack(ofSnapshot, seen, said, Saves());
    }

    void GoOnFrom(byte[] snapshot)
    {
        if (Restores == null)
        {
            throw new NodeError("there is a snapshot to go on from, but no Restores");
        }
        List<object> body = Frame.Unpack(ofSnapshot, snapshot);
        foreach (List<object> item in (List<List<object>>)body[0])
        {
            Want want = wants.Find(w => w.topic == (string)item[0]);
            if (want != null)
            {
                want.payload = (byte[])item[1];
            }
        }
        foreach (List<object> item in (List<List<object>>)body[1])
        {
            Output output;
            if (outputs.TryGetValue((string)item[0], out output))
            {
                output.latest = null;
                output.t = (long)item[1];
                output.sequence = (uint)item[2];
                output.payload = (byte[])item[3];
            }
        }
        Restores((byte[])body[2]);
    }

    List<List<object>> Desired()
    {
        var desired = new List<List<object>>();
        foreach (Want want in wants)
        {
            List<object> item = Items(want.topic, (ulong)want.latency, want.optional ? 1 : 0);
            AddSchema(item, want.schema);
            desired.Add(item);
        }
        return desired;
    }

    List<List<object>> Match(List<List<object>> asked)
    {
        var offers = new List<List<object>>();
        foreach (Output output in outputs.Values)
        {
            output.asked = false;
        }
        foreach (List<object> channel in asked)
        {
            Output output;
            if (!outputs.TryGetValue((string)channel[1], out output))
            {
                continue;
            }
            output.asked = true;
            output.channel = (uint)channel[0];
            if (!output.schema.Given)
            {
                output.schema = Schema.AsSent((string)channel[2], (string)channel[3]);
            }
            List<object> offer = Items(output.channel);
            AddSchema(offer, output.schema);
            offer.Add(Packed(output));
            offers.Add(offer);
        }
        return offers;
    }

    /// The message as it was last written, with a head where it begins with one.
    static byte[] Packed(Output output)
    {
        Message message = output.latest;
        if (message == null)
        {
            return output.payload;
        }
        if (output.sequence > 0)
        {
            message = Head.FilledIn(output.schema, message, output.t, output.sequence);
        }
        return output.schema.Pack(message);
    }

    void Start(List<List<object>> wired)
    {
        channels.Clear(); // all counts begin again
        coming.Clear();
        foreach (Output output in outputs.Values)
        {
            output.count = 0;
        }
        foreach (List<object> channel in wired)
        {
            Want want = wants.Find(w => w.topic == (string)channel[1]);
            if (want == null)
            {
                throw new NodeError("the controller wires " + channel[1] + ", which is not wanted");
            }
            want.schema = Schema.AsSent((string)channel[2], (string)channel[3]);
            want.count = 0;
            channels[(uint)channel[0]] = want;
        }
    }

    object[] Tick(long until, List<List<object>> records)
    {
        foreach (List<object> record in records)
        {
            Want want;
            var count = (uint)record[2];
            if (!channels.TryGetValue((uint)record[1], out want) || count != want.count + 1)
            {
                throw new NodeError("message " + count + " on channel " + record[1] + " is not the next one");
            }
            want.count = count;
            coming.Add(new Coming { t = (long)record[0], want = want, payload = (byte[])record[3] });
        }
        coming = coming.OrderBy(record => record.t).ToList(); // stable
        var tock = new List<List<object>>();
        var clock = Stopwatch.StartNew();
        int seen = 0;
        for (; next <= until; next += every)
        {
            now = next;
            for (; seen < coming.Count && coming[seen].t <= now; seen++)
            {
                coming[seen].want.payload = coming[seen].payload;
                coming[seen].want.value = null;
            }
            Step(now);
            foreach (Output output in written)
            {
                output.written = false;
                tock.Add(Items(now, output.channel, ++output.count, output.payload));
            }
            written.Clear();
            until = leaving ? now : until;
        }
        coming.RemoveRange(0, seen);
        long compute = (long)(clock.ElapsedTicks * (1e9 / Stopwatch.Frequency));
        return new object[] { until, compute, leaving ? 1 : 0, tock };
    }
}

// ---- the observer

/// A message of some node, as it was written.
public sealed class Seen
{
    public string Topic, Node;
    public long T;             ///< [ns] of writing; -1: before the first step
    public uint Count, Missed; ///< on its topic (0: what it held at the beginning); since the one seen before
    public Message Message;
    public Value this[string field] { get { return Message[field]; } }
}

/// A program that steps with nobody. It comes and goes as it likes, sees what nodes write, and may write
/// what nodes read and the controller's configuration says comes from it. The run never waits for it:
/// what it does not take in time it misses, and is told how much.
///
///     using (var observer = new Observer("spring", "ground", "tcp://127.0.0.1:7000"))
///     {
///         observer.Subscribe("/mass/");
///         foreach (Seen mass in observer) // until the run is over
///             observer.Write("/ground/stiffness", new Message { ["k"] = 2 });
///     }
///
/// It is for one thread, but Write() may be called by others.
public sealed class Observer : IEnumerable<Seen>, IDisposable
{
    /// As for a node; patience [s] also for the nodes to have met.
    public Observer(string simulation = null, string name = null, string address = null, double patience = 60,
                    string keys = null)
    {
        greeting = new Greeting(simulation, name, address, patience, keys);
        context = Socket.zmq_ctx_new();
        try
        {
            Attach();
            socket = new Socket(context, Socket.Subscriber, 0, greeting.Keys);
            handshake = new Handshake(context, socket, greeting.Keys);
            socket.Subscribe("finish");
            socket.Connect(backend);
        }
        catch
        {
            Dispose();
            throw;
        }
    }

    public readonly Dictionary<string, Schema> Topics = new Dictionary<string, Schema>(); ///< all that there are
    public ulong Missed { get; private set; }  ///< messages, of all topics
    public string Reason { get; private set; } ///< of the end of the run, once it is over; "" at the regular one
    public long T { get; private set; }        ///< [ns] of the newest message

    /// See all topics that begin like one of these; "": all. Of each the last comes at once.
    public void Subscribe(params string[] topics)
    {
        foreach (string topic in topics)
        {
            socket.Subscribe(topic);
        }
    }

    /// The next message. Null if none comes in time [s] (negative: any), or the run is over. Throws NodeError
    /// if the controller is gone.
    public Seen Next(double most = -1)
    {
        var clock = Stopwatch.StartNew();
        while (Reason == null)
        {
            double rest = most < 0 ? 0.1 : Math.Max(0, Math.Min(0.1, most - clock.Elapsed.TotalSeconds));
            if (handshake.Wait(socket, rest, () => {}, "the broker at " + backend))
            {
                Seen seen = Read(socket.Receive());
                if (seen != null)
                {
                    return seen;
                }
            }
            else if (handshake.Lost != null && handshake.Lost.Elapsed.TotalSeconds > 2)
            {
                throw new NodeError("the controller is gone"); // one that was stopped for long would be let in again
            }
            else if (most >= 0 && clock.Elapsed.TotalSeconds >= most)
            {
                break;
            }
        }
        return null;
    }

    public IEnumerator<Seen> GetEnumerator()
    {
        for (Seen seen; (seen = Next()) != null;)
        {
            yield return seen;
        }
    }
    IEnumerator IEnumerable.GetEnumerator() { return GetEnumerator(); }

    /// Write a message. Where it begins with a Fledge head, that is filled in unless it is given.
    public void Write(string topic, Message message)
    {
        lock (mutex)
        {
            Schema schema = SchemaOf(topic);
            uint count;
            counts.TryGetValue(topic, out count);
            count++;
            byte[] payload = schema.Pack(Head.FilledIn(schema, message, T, count));
            if (written == null)
            {
                PrepareWriting();
            }
            if (!written.TakesMore(greeting.Patience))
            {
                throw new NodeError("the broker at " + frontend + " takes no more");
            }
            written.Send(Encoding.UTF8.GetBytes(topic),
                         new Frame("Published", 0, 0L, 0U, count, payload, greeting.Name).Encode());
            counts[topic] = count;
        }
    }

    public void Dispose()
    {
        if (context == IntPtr.Zero)
        {
            return;
        }
        foreach (IDisposable part in new IDisposable[] { handshake, socket, written })
        {
            if (part != null)
            {
                part.Dispose();
            }
        }
        Socket.zmq_ctx_term(context);
        context = IntPtr.Zero;
    }

    struct Place
    {
        public uint count;
        public long t;
    }

    readonly Greeting greeting;
    readonly Socket socket;
    readonly Handshake handshake;
    readonly Dictionary<string, Place> places = new Dictionary<string, Place>(); // by topic: what was seen last
    readonly Dictionary<string, uint> counts = new Dictionary<string, uint>();   // by topic: messages written
    readonly object mutex = new object();
    IntPtr context;
    string frontend, backend;
    Socket written;

    void Attach()
    {
        Frame attached = greeting.Ask(context, 1, "Attached", () => {});
        frontend = greeting.Reachable((string)attached.Body[0]);
        backend = greeting.Reachable((string)attached.Body[1]);
        foreach (List<object> channel in (List<List<object>>)attached.Body[2])
        {
            Topics[(string)channel[1]] = Schema.AsSent((string)channel[2], (string)channel[3]);
        }
    }

    Schema SchemaOf(string topic)
    {
        if (!Topics.ContainsKey(topic))
        {
            Attach(); // nodes may have joined
        }
        Schema schema;
        if (!Topics.TryGetValue(topic, out schema))
        {
            throw new NodeError("there is no topic " + topic + "; there are " +
                                (Topics.Count == 0 ? "none" : string.Join(", ", Topics.Keys)));
        }
        return schema;
    }

    /// Null for what has been seen already, and for the end.
    Seen Read(List<byte[]> parts)
    {
        if (parts.Count != 2)
        {
            throw new NodeError("the broker sends a message that is not of two parts");
        }
        Frame frame = Frame.Decode(parts[1]);
        if (frame.Kind == "Finish")
        {
            Reason = (string)frame.Body[0];
            return null;
        }
        if (frame.Kind != "Published")
        {
            throw new NodeError("the broker sends " + frame.Kind);
        }
        string topic = Encoding.UTF8.GetString(parts[0]);
        var t = (long)frame.Body[0];
        var count = (uint)frame.Body[2];
        Place before;
        bool known = places.TryGetValue(topic, out before);
        if (known && before.count == count && before.t == t)
        {
            return null; // it came again for another, who subscribed
        }
        places[topic] = new Place { count = count, t = t };
        uint missed = !known || count == 0 ? 0 : count > before.count ? count - before.count - 1 : count - 1;
        Missed += missed;
        T = Math.Max(T, t);
        lock (mutex)
        {
            return new Seen { Topic = topic, Node = (string)frame.Body[4], T = t, Count = count, Missed = missed,
                              Message = SchemaOf(topic).Unpack((byte[])frame.Body[3]) };
        }
    }

    /// What is sent before the broker has said that it listens would be lost.
    void PrepareWriting()
    {
        var publisher = new Socket(context, Socket.Publisher, 1000, greeting.Keys);
        try
        {
            using (var made = new Handshake(context, publisher, greeting.Keys))
            {
                publisher.Connect(frontend);
                if (!made.Wait(publisher, greeting.Patience, () => {}, "the broker at " + frontend))
                {
                    throw new NodeError("no broker listens at " + frontend);
                }
                publisher.Receive();
            }
        }
        catch
        {
            publisher.Dispose();
            throw;
        }
        written = publisher;
    }
}

} // namespace Fledge
