// SPDX-License-Identifier: Apache-2.0
#include "sim/testing/toys.h"

#include "sim/error.h"

#include <cmath>
#include <cstddef>

namespace fledge::sim::toys {

std::vector<Update> *updates = nullptr;

namespace {

void note(const void *memory, Ns t)
{
    if (updates) {
        updates->push_back({memory, t});
    }
}

void source_reset(Source *m)
{
    m->out = {};
}

void source_update(Source *m, Tick t)
{
    note(m, t.t);
    m->out.number.x = m->par.value + m->par.ramp * m->out.number.head.sequence;
    m->out.number.head = head_next(m->out.number.head, t.t, QUALITY_GOOD);
}

void scale_reset(Scale *m)
{
    m->out = {};
    m->mem = {};
}

void scale_update(Scale *m, Tick t)
{
    note(m, t.t);
    m->mem = {t.t, t.dt, m->mem.updates + 1, m->mem.saturated};
    double x = m->par.gain * m->in.number.x + m->in.offset.x;
    if (m->par.limit > 0.0 && std::abs(x) > m->par.limit) {
        x = std::copysign(m->par.limit, x);
        m->mem.saturated++;
    }
    m->out.number = {head_next(m->out.number.head, t.t, m->in.number.head.quality), x};
}

class LeakModel final : public Model {
public:
    explicit LeakModel(void *memory) : interface(*static_cast<Leak *>(memory)) {}
    void prepare(const Setup &) override {}
    void reset(Ns) override { interface.out = {}; }
    const char *part_of() const override { return "tank"; }
    void update(Tick tick) override
    {
        interface.out.flow = {head_next(interface.out.flow.head, tick.t, QUALITY_GOOD), interface.in.command.x};
    }
    Leak &interface;
};

class TankModel final : public Model {
public:
    explicit TankModel(void *memory) : interface_(*static_cast<Tank *>(memory)) {}
    void prepare(const Setup &setup) override
    {
        if (interface_.par.initial < 0.0) {
            throw SetupError(setup.name + ".initial must be >= 0");
        }
    }
    void reset(Ns t) override
    {
        level_ = interface_.par.initial;
        interface_.out = {};
        if (leak_) {
            leak_->reset(t);
        }
        publish(t);
    }
    void update(Tick tick) override
    {
        note(&interface_, tick.t);
        if (leak_) {
            leak_->update(tick);
        }
        const double out = leak_ ? leak_->interface.out.flow.x : 0.0;
        level_ += (interface_.in.flow.x - out) * tick_seconds(tick.dt);
        publish(tick.t);
    }
    std::vector<Model *> parts() const override { return leak_ ? std::vector<Model *>{leak_} : std::vector<Model *>{}; }
    std::span<std::byte> memory() override { return std::as_writable_bytes(std::span{&level_, 1}); }
    void copy_setup(const Model &original, const std::function<Model *(const Model *)> &counterpart) override
    {
        if (const auto *leak = dynamic_cast<const TankModel &>(original).leak_) {
            leak_ = dynamic_cast<LeakModel *>(counterpart(leak));
        }
    }
    LeakModel *leak_ = nullptr;

private:
    void publish(Ns t) { interface_.out.level = {head_next(interface_.out.level.head, t, QUALITY_GOOD), level_}; }
    Tank &interface_;
    double level_ = 0.0;
};

template <class T> std::unique_ptr<Model> create(void *interface)
{
    return std::make_unique<T>(interface);
}

FledgeField field(const char *name, std::size_t offset, std::size_t size, FledgeType type, FledgeGroup group,
                  const char *doc)
{
    FledgeField f{};
    f.name = name;
    f.offset = static_cast<std::uint32_t>(offset);
    f.size = static_cast<std::uint32_t>(size);
    f.type = type;
    f.group = group;
    f.unit = type == FLEDGE_STRUCT ? "" : "-";
    f.doc = doc;
    if (type == FLEDGE_STRUCT) {
        f.sub = &number_type;
    }
    return f;
}

FledgeField required(FledgeField f)
{
    f.flags = FLEDGE_REQUIRED;
    f.bounds = FLEDGE_HAS_LO | FLEDGE_LO_OPEN;
    return f;
}

FledgeField flagged(FledgeField f, std::uint32_t flags)
{
    f.flags = flags;
    return f;
}

FledgeField distinct(const char *other, FledgeField f)
{
    f.distinct = other;
    return f;
}

const FledgeField number_fields[] = {
    field("x", offsetof(Number, x), 8, FLEDGE_F64, FLEDGE_NONE, "the number"),
};
const FledgeField source_fields[] = {
    field("number", offsetof(Source, out.number), sizeof(Number), FLEDGE_STRUCT, FLEDGE_OUT, "the value"),
    required(field("value", offsetof(Source, par.value), 8, FLEDGE_F64, FLEDGE_PAR, "what is put out")),
    field("ramp", offsetof(Source, par.ramp), 8, FLEDGE_F64, FLEDGE_PAR, "its growth per update"),
};
const FledgeField scale_fields[] = {
    field("number", offsetof(Scale, in.number), sizeof(Number), FLEDGE_STRUCT, FLEDGE_IN, "what is scaled"),
    distinct("number",
             flagged(field("offset", offsetof(Scale, in.offset), sizeof(Number), FLEDGE_STRUCT, FLEDGE_IN, "added"),
                     FLEDGE_OPTIONAL)),
    field("product", offsetof(Scale, out.number), sizeof(Number), FLEDGE_STRUCT, FLEDGE_OUT, "the product"),
    field("gain", offsetof(Scale, par.gain), 8, FLEDGE_F64, FLEDGE_PAR, "the factor"),
    field("limit", offsetof(Scale, par.limit), 8, FLEDGE_F64, FLEDGE_PAR, "of the product"),
    field("saturated", offsetof(Scale, mem.saturated), 8, FLEDGE_U64, FLEDGE_MEM, "updates at the limit"),
};
const FledgeField tank_fields[] = {
    flagged(field("flow", offsetof(Tank, in.flow), sizeof(Number), FLEDGE_STRUCT, FLEDGE_IN, "into it"),
            FLEDGE_OPTIONAL),
    field("level", offsetof(Tank, out.level), sizeof(Number), FLEDGE_STRUCT, FLEDGE_OUT, "its level"),
    flagged(field("initial", offsetof(Tank, par.initial), 8, FLEDGE_F64, FLEDGE_PAR, "level at the start"),
            FLEDGE_ASSUMED | FLEDGE_INITIAL),
};
const FledgeField leak_fields[] = {
    flagged(field("command", offsetof(Leak, in.command), sizeof(Number), FLEDGE_STRUCT, FLEDGE_IN, "wanted"),
            FLEDGE_OPTIONAL),
    field("flow", offsetof(Leak, out.flow), sizeof(Number), FLEDGE_STRUCT, FLEDGE_OUT, "out of the tank"),
};

template <class T, std::size_t N>
FledgeStruct table(const char *name, FledgeKind kind, std::uint64_t hash, const FledgeField (&list)[N])
{
    FledgeStruct s{};
    s.name = name;
    s.doc = s.header = s.folder = "";
    s.kind = kind;
    s.size = sizeof(T);
    s.align = alignof(T);
    s.hash = hash;
    s.n = N;
    s.fields = list;
    return s;
}

FledgeStruct module(FledgeStruct s, void (*reset)(void), void (*update)(void))
{
    s.reset = reset;
    s.update = update;
    return s;
}

FledgeStruct message(FledgeStruct s)
{
    s.schema = "fledge/Head head\nfloat64 x  # x [-] the number\n" // as the emitter writes it
               "================================================================================\n"
               "MSG: fledge/Head\n"
               "int64 t  # t [ns] time\nuint32 quality  # quality [-] quality\nuint32 sequence  # sequence [-] count\n";
    return s;
}

} // namespace

const FledgeStruct number_type = message(table<Number>("Number", FLEDGE_MESSAGE, 1, number_fields));
const FledgeStruct source_type =
    module(table<Source>("Source", FLEDGE_MODULE, 2, source_fields), reinterpret_cast<void (*)(void)>(source_reset),
           reinterpret_cast<void (*)(void)>(source_update));
const FledgeStruct scale_type =
    module(table<Scale>("Scale", FLEDGE_MODULE, 3, scale_fields), reinterpret_cast<void (*)(void)>(scale_reset),
           reinterpret_cast<void (*)(void)>(scale_update));
const FledgeStruct tank_interface = table<Tank>("Tank", FLEDGE_MODEL, 4, tank_fields);
const FledgeStruct leak_interface = table<Leak>("Leak", FLEDGE_MODEL, 5, leak_fields);
const ModelType tank_type{&tank_interface, create<TankModel>};
const ModelType leak_type{&leak_interface, create<LeakModel>};

void attach(const Instance &tank, const Instance &leak)
{
    dynamic_cast<TankModel &>(*tank.model()).leak_ = dynamic_cast<LeakModel *>(leak.model());
}

Loop::Loop(WireOptions command, WireOptions level)
{
    Process &world = sim.add_process("world");
    Process &flight = sim.add_process("flight");
    world.add("tank", tank);
    flight.add("control", control);
    interface<Tank>(tank).par.initial = 8.0;
    interface<Scale>(control).par.gain = -0.5;
    world.add_task({"dynamics", 100 * ms, 0, 0, {tank}});
    flight.add_task({"gnc", 500 * ms, 0, 0, {control}});
    sim.connect(port(tank, "level"), port(control, "number"), level);
    sim.connect(port(control, "product"), port(tank, "flow"), command);
}

std::shared_ptr<const Messages> messages(std::vector<Ns> times, std::initializer_list<double> values)
{
    Messages made{std::move(times), {}};
    std::size_t i = 0;
    for (const double x : values) {
        const Number number{{i < made.times.size() ? made.times[i] : 0, QUALITY_GOOD, static_cast<std::uint32_t>(++i)},
                            x};
        const auto *first = reinterpret_cast<const std::byte *>(&number);
        made.bytes.insert(made.bytes.end(), first, first + sizeof number);
    }
    return std::make_shared<Messages>(std::move(made));
}

Condition below(const std::shared_ptr<Instance> &tank, double x)
{
    Operand level;
    level.instance = tank;
    level.offset = offsetof(Tank, out.level.x);
    return {{level, Operand::of(x), EXEC_LESS}, "world.tank.level.x < " + std::to_string(x)};
}

} // namespace fledge::sim::toys
