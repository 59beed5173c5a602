// SPDX-License-Identifier: Apache-2.0
#include "cosim/node/simulation_node.h"

#include "sim/text.h"

#include <algorithm>
#include <cstring>

namespace fledge::cosim {

namespace {

/// The model of a stand-in: the node writes its output.
class ExternalInput final : public sim::Model {
public:
    void prepare(const sim::Setup &) override {}
    void reset(sim::Ns) override {}
    void update(::Tick) override {}
};

std::unique_ptr<sim::Model> make_external_input(void *)
{
    return std::make_unique<ExternalInput>();
}

std::string topic_of(const sim::Instance &instance, const FledgeField &field)
{
    std::string topic = "/" + instance.path + "/" + field.name;
    std::replace(topic.begin(), topic.end(), '.', '/');
    return topic;
}

} // namespace

/// [byte] for units that arrive within a time, at a rate [1/s] of bits: the least unit has 7 bytes.
std::size_t room_for(double rate, Ns every)
{
    return static_cast<std::size_t>(std::clamp(3e-9 / 8 * rate * static_cast<double>(every), 16384.0, 262144.0));
}

/// An instance with one output, and the tables that describe it.
struct SimulationNode::StandIn {
    explicit StandIn(const FledgeStruct &message)
    {
        field.name = "message";
        field.size = message.size;
        field.type = FLEDGE_STRUCT;
        field.group = FLEDGE_OUT;
        field.sub = &message;
        field.unit = "";
        field.ctype = message.name;
        field.doc = message.doc;
        interface.name = "StandIn";
        interface.doc = "holds another node's output";
        interface.header = interface.folder = "";
        interface.kind = FLEDGE_MODEL;
        interface.size = message.size;
        interface.align = message.align;
        interface.n = 1;
        interface.fields = &field;
        type = {&interface, make_external_input};
        instance = std::make_shared<sim::Instance>(type);
    }

    FledgeField field{};
    FledgeStruct interface {
    };
    sim::ModelType type{};
    std::shared_ptr<sim::Instance> instance;
};

SimulationNode::SimulationNode(sim::Simulation &simulation, const std::string &process)
    : simulation_(simulation), process_(simulation.process(process)), others_(simulation.add_process("others"))
{
    others_.stands_in = true;
}

SimulationNode::~SimulationNode() = default;

void SimulationNode::read(const std::string &topic, const sim::Port &to, Latency latency, Ns stale_after)
{
    auto &stand_in = stand_ins_[topic];
    if (!stand_in) {
        stand_in = std::make_unique<StandIn>(*to.field->sub);
        std::string name = topic.substr(topic.find_first_not_of('/'));
        std::replace(name.begin(), name.end(), '/', '_');
        others_.add(name, stand_in->instance);
        subscriptions_.push_back({topic, latency, (to.field->flags & FLEDGE_OPTIONAL) != 0,
                                  make_schema(to.field->sub->name, to.field->sub->schema)});
    }
    Subscription &subscription = *std::find_if(subscriptions_.begin(), subscriptions_.end(),
                                               [&](const Subscription &s) { return s.topic == topic; });
    if (subscription.latency != latency) {
        throw sim::SetupError(to.path() + " reads " + topic + " at another latency than other inputs here");
    }
    subscription.optional = subscription.optional && (to.field->flags & FLEDGE_OPTIONAL);
    simulation_.connect({stand_in->instance, &stand_in->field}, to, {0, stale_after});
}

Ns SimulationNode::Served::every() const
{
    return std::min_element(rates.begin(), rates.end(), [](auto a, auto b) { return a.period < b.period; })->period;
}

void SimulationNode::carry(const std::string &flight, std::vector<Rate> rates)
{
    Served served{flight, std::move(rates), {}, {}, {}, {}};
    for (const auto &instance : process_.instances()) {
        auto *carrier = dynamic_cast<sim::Carrier *>(instance->model());
        if (carrier && carrier->serves() == flight) {
            std::string topic = "/" + instance->path;
            std::replace(topic.begin(), topic.end(), '.', '/');
            served.radios.push_back({carrier, topic, {}, {}, {}});
        }
    }
    for (const Rate &rate : served.rates) {
        const auto steps = [&](const sim::Task &task) {
            return rate.period % task.period == 0 && rate.offset >= task.offset &&
                   (rate.offset - task.offset) % task.period == 0;
        };
        if (std::ranges::none_of(process_.tasks(), steps)) {
            throw sim::SetupError(process_.name + " has a radio of " + flight + ", which steps every " +
                                  sim::format_time(rate.period) + ": let " + process_.name +
                                  " step at these instants, too, by a task whose period divides that");
        }
    }
    if (!served.radios.empty() && !served.rates.empty()) {
        served_.push_back(std::move(served));
    }
}

Initialized SimulationNode::initialize(const Initialize &request)
{
    // Stand-ins are models, and models have to step: with the process, so that no instant is added.
    if (!stand_ins_.empty() && others_.tasks().empty() && !process_.tasks().empty()) {
        const sim::Task &first = process_.tasks().front();
        others_.add_task({"stand", first.period, first.offset, 0, others_.instances()});
    }
    end_ = request.end;
    stepped_ = false;
    simulation_.set_seed(request.seed);
    simulation_.prepare();
    if (request.start >= 0 && request.snapshot.empty()) {
        simulation_.begin_after(request.start); // it joins a run
    }
    if (!request.snapshot.empty()) {
        McapMark mark;
        std::span<const std::byte> snapshot = request.snapshot;
        if (snapshot.size() < sizeof mark) {
            throw sim::SetupError("its snapshot is cut off");
        }
        std::memcpy(&mark, snapshot.last<sizeof mark>().data(), sizeof mark);
        snapshot = snapshot.first(snapshot.size() - sizeof mark);
        for (auto *units : arrived()) {
            std::uint64_t n = 0;
            std::memcpy(&n, snapshot.last<sizeof n>().data(), sizeof n);
            snapshot = snapshot.first(snapshot.size() - sizeof n);
            *units = unpacked(snapshot.last(n));
            snapshot = snapshot.first(snapshot.size() - n);
        }
        simulation_.restore(snapshot);
        simulation_.recorder().resume_from(mark);
        if (simulation_.now() > request.start || simulation_.next() <= request.start) {
            throw sim::SetupError("its snapshot is of " + sim::format_time(simulation_.now()) +
                                  ", but it has to begin after " + sim::format_time(request.start));
        }
    }
    Initialized answer;
    answer.saves = std::ranges::all_of(
        process_.instances(), [](const auto &instance) { return !instance->model() || instance->model()->saves(); });
    for (const sim::Task &task : process_.tasks()) {
        answer.rates.push_back({task.period, task.offset});
    }
    return answer;
}

std::vector<Subscription> SimulationNode::desired()
{
    std::vector<Subscription> all = subscriptions_;
    for (const Served &served : served_) {
        all.push_back({"/" + served.flight + "/downlink", Latency::next_instant, true, {}});
        for (const Radio &radio : served.radios) {
            all.push_back({radio.topic + "/uplink", Latency::next_instant, true,
                           units_schema(room_for(radio.carrier->up_rate(), served.every()))});
        }
    }
    return all;
}

std::vector<Publication> SimulationNode::match(const std::vector<Channel> &channels)
{
    std::vector<Publication> publications;
    outbox_.clear();
    for (const auto &instance : process_.instances()) {
        for (const FledgeField &field : sim::fields(instance->type())) {
            const auto channel = std::find_if(channels.begin(), channels.end(), [&](const Channel &c) {
                return field.group == FLEDGE_OUT && c.topic == topic_of(*instance, field);
            });
            if (channel != channels.end()) {
                const std::span<const std::byte> bytes(instance->memory() + field.offset, field.size);
                publications.push_back(
                    {channel->channel, make_schema(field.sub->name, field.sub->schema), make_payload(bytes)});
                outbox_.add(channel->channel, bytes);
            }
        }
    }
    for (Served &served : served_) {
        const auto open = [&](UnitsOut &out, const std::string &topic, double rate) {
            out.close();
            for (const Channel &channel : channels) {
                if (channel.topic == topic) {
                    publications.push_back(out.open(channel.channel, room_for(rate, served.every()), served.every()));
                }
            }
        };
        double up = 0.0;
        for (Radio &radio : served.radios) {
            up += radio.carrier->up_rate();
            open(radio.downlink, radio.topic + "/downlink", radio.carrier->down_rate());
        }
        open(served.uplink, "/" + served.flight + "/uplink", up);
    }
    return publications;
}

/// The stand-ins hold the last inputs; the controller sends again what the node has not seen. A program that goes on
/// from the snapshot goes on with the record, too: so all of it until now must stay, whatever becomes of this program.
Bytes SimulationNode::save()
{
    Bytes snapshot = simulation_.snapshot();
    const auto lists = arrived();
    for (auto units = lists.rbegin(); units != lists.rend(); ++units) { // it is read from its end
        const Bytes all = packed(**units);
        const std::uint64_t n = all.size();
        snapshot.insert(snapshot.end(), all.begin(), all.end());
        const auto *size = reinterpret_cast<const std::byte *>(&n);
        snapshot.insert(snapshot.end(), size, size + sizeof n);
    }
    const McapMark mark = simulation_.recorder().save_archive();
    const auto *bytes = reinterpret_cast<const std::byte *>(&mark);
    snapshot.insert(snapshot.end(), bytes, bytes + sizeof mark);
    return snapshot;
}

void SimulationNode::start(const std::vector<Channel> &wired)
{
    inbox_.open(wired);
    inputs_.clear();
    for (Served &served : served_) {
        served.downlink.reset();
        for (Radio &radio : served.radios) {
            radio.uplink.reset();
            if (radio.downlink) {
                (void)radio.carrier->take(std::max<Ns>(simulation_.now(), 0)); // they are kept from now on
            }
        }
    }
    for (const Channel &channel : wired) {
        if (listen(channel)) {
            continue;
        }
        const auto found = stand_ins_.find(channel.topic);
        if (found == stand_ins_.end() || found->second->field.size != channel.schema.size) {
            throw ProtocolError("the controller sends " + channel.topic + " of " + std::to_string(channel.schema.size) +
                                " bytes, which this node did not ask for");
        }
        const StandIn &stand_in = *found->second;
        inputs_[channel.channel] = {{stand_in.instance->memory(), stand_in.field.size}, fields_of(channel.schema)};
    }
}

Tock SimulationNode::tick(const Tick &tick)
{
    inbox_.take(tick.records);
    Tock tock;
    tock.reached = tick.until;
    while (simulation_.next() <= tick.until) {
        const Ns t = simulation_.next();
        inbox_.see(t, [this](const Record &record) {
            if (send(record)) {
                return;
            }
            const Input &input = inputs_.at(record.channel);
            read_payload(record.payload, input.fields, input.bytes);
        });
        simulation_.run_until(t, {0.0, {}, stepped_});
        stepped_ = true;
        outbox_.collect(t, tock.records);
        hand_over(t, tock.records);
    }
    simulation_.reach(tick.until);
    return tock;
}

/// What has arrived and was not handed over, of all radios: a part of the node's state.
std::vector<std::vector<sim::Packet> *> SimulationNode::arrived()
{
    std::vector<std::vector<sim::Packet> *> lists;
    for (Served &served : served_) {
        lists.push_back(&served.arrived);
        for (Radio &radio : served.radios) {
            lists.push_back(&radio.arrived);
        }
    }
    return lists;
}

/// Whether the channel brings units for a radio.
bool SimulationNode::listen(const Channel &channel)
{
    for (Served &served : served_) {
        if (channel.topic == "/" + served.flight + "/downlink") {
            served.downlink = channel.channel;
            return true;
        }
        for (Radio &radio : served.radios) {
            if (channel.topic == radio.topic + "/uplink") {
                radio.uplink = channel.channel;
                return true;
            }
        }
    }
    return false;
}

/// Units of flight or of the ground, which were sent at the last instant. Whether they are that.
bool SimulationNode::send(const Record &record)
{
    const Ns t = std::max<Ns>(simulation_.now(), 0);
    for (Served &served : served_) {
        for (Radio &radio : served.radios) {
            if (record.channel == served.downlink || record.channel == radio.uplink) {
                for (const sim::Packet &unit : units_of(record.payload)) {
                    record.channel == radio.uplink ? radio.carrier->send_up(t, unit.bytes)
                                                   : radio.carrier->send_down(t, unit.bytes);
                }
            }
        }
        const auto up = [&](const Radio &radio) { return record.channel == radio.uplink; };
        if (record.channel == served.downlink || std::ranges::any_of(served.radios, up)) {
            return true;
        }
    }
    return false;
}

/// After the instant t: what has arrived, at flight's instants.
void SimulationNode::hand_over(Ns t, std::vector<Record> &records)
{
    for (Served &served : served_) {
        for (Radio &radio : served.radios) {
            if (radio.downlink) {
                for (sim::Packet &packet : radio.carrier->take(t)) {
                    radio.arrived.push_back(std::move(packet));
                }
            }
        }
        if (std::ranges::none_of(served.rates,
                                 [t](Rate rate) { return t >= rate.offset && (t - rate.offset) % rate.period == 0; })) {
            continue;
        }
        for (Radio &radio : served.radios) {
            if (served.uplink) {
                radio.carrier->receive(t, [&](sim::Unit unit) {
                    served.arrived.push_back({t, {unit.begin(), unit.end()}});
                });
            }
            if (radio.downlink) {
                radio.downlink.write(t, radio.arrived, records);
            }
        }
        if (served.uplink) {
            served.uplink.write(t, served.arrived, records);
        }
    }
}

void SimulationNode::finish(const std::string &reason)
{
    if (reason.empty()) {
        simulation_.reach(end_); // no task of this process need run there
    }
}

} // namespace fledge::cosim
