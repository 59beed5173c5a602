// SPDX-License-Identifier: Apache-2.0
#include "sim/commands.h"

#include "sim/runtime.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace fledge::sim {

Commands::Commands(Runtime &runtime, Process &process, std::shared_ptr<const Dictionary> dictionary)
    : runtime_(runtime), process_(process), dictionary_(std::move(dictionary)), queue_(dictionary_->room)
{
    lay_out_blocks();
    lay_out_calls();
    lay_out_outputs();
    lay_out_services();
    procedures_ = {slots_.data(), slot_room, slots, 0, start, stop, nullptr};
    table_.procedures = &procedures_;
    carriers_ = runtime.structure.carriers(process);
    begin();
}

void Commands::lay_out_blocks()
{
    const Dictionary &d = *dictionary_;
    std::size_t largest = 0;
    for (const Dictionary::Block &block : d.blocks) {
        blocks_.push_back({block.runs.data(), block.rules.data(), block.size,
                           static_cast<std::uint16_t>(block.runs.size()),
                           static_cast<std::uint16_t>(block.rules.size()), block.configuration, 0});
        largest = std::max<std::size_t>(largest, block.size);
    }
    staged_.resize(largest);
    table_.stream = d.stream;
    table_.version = d.version;
    table_.n_blocks = static_cast<std::uint16_t>(blocks_.size());
    table_.n_modes = static_cast<std::uint16_t>(process_.modes().size());
    table_.n_events = static_cast<std::uint16_t>(process_.events().size());
    table_.n_outputs = static_cast<std::uint16_t>(d.outputs.size());
    table_.blocks = blocks_.data();
    table_.staged = staged_.data();
    table_.queue = queue_.data();
    table_.room = static_cast<std::uint32_t>(queue_.size());
}

/// What the code of flight/command calls here.
void Commands::lay_out_calls()
{
    table_.parameters = [](void *c, std::uint16_t block) -> void * {
        auto &me = *static_cast<Commands *>(c);
        const Dictionary::Block &of = me.dictionary_->blocks[block];
        return me.process_.find(of.instance)->memory() + of.offset;
    };
    table_.enter = [](void *c, std::uint16_t mode) {
        static_cast<Commands *>(c)->runtime_.enter(static_cast<Commands *>(c)->process_, mode);
    };
    table_.may_enter = [](void *c, std::uint16_t mode) -> int {
        return static_cast<Commands *>(c)->process_.may_enter(mode);
    };
    table_.mode = [](const void *c) { return static_cast<const Commands *>(c)->mode(); };
    table_.publish = [](void *c, std::uint16_t block, std::int64_t t) {
        auto &me = *static_cast<Commands *>(c);
        me.runtime_.publish(*me.process_.find(me.dictionary_->blocks[block].instance), t);
    };
    table_.arm = [](void *c, std::uint16_t event, int on) {
        auto &me = *static_cast<Commands *>(c);
        me.runtime_.of(me.process_).events[event].state.armed = on != 0;
    };
    table_.reset = [](void *c, std::int64_t t) {
        auto &me = *static_cast<Commands *>(c);
        me.end_procedure(t, false, "flight begins anew");
        me.runtime_.restart(me.runtime_.of(me.process_), t);
    };
    table_.telemetry = [](void *c, std::uint16_t output, int on, std::uint16_t every) {
        telemetry_rate(&static_cast<Commands *>(c)->telemetry_, output, on, every);
    };
}

std::uint16_t Commands::mode() const
{
    return static_cast<std::uint16_t>(std::max(runtime_.of(process_).mode, 0));
}

/// The outputs, in an image of a mission's memory: the address of this object, then their messages.
void Commands::lay_out_outputs()
{
    const Dictionary &d = *dictionary_;
    void *self = this;
    image_.resize(sizeof self);
    std::memcpy(image_.data(), &self, sizeof self);
    std::size_t longest = TELEMETRY_REPORT_MAX;
    for (const Dictionary::Output &output : d.outputs) {
        outputs_.push_back({output.runs.data(), static_cast<std::uint32_t>(output.runs.size()),
                            static_cast<std::uint32_t>(image_.size()), output.size});
        const Instance &from = *process_.find(output.instance);
        live_.push_back(from.memory() + output.offset);
        for (const FledgeField &field : fields(from.type())) {
            if (field.offset == output.offset && field.sub != nullptr &&
                field.sub->name == std::string_view("FlightEvent")) {
                events_.push_back(static_cast<std::uint16_t>(outputs_.size() - 1));
            }
        }
        image_.resize(image_.size() + output.size);
        longest = std::max<std::size_t>(longest, TELEMETRY_HEADER + output.size);
    }
    rates_.resize(outputs_.size() + 3 + COMMAND_STREAMS);
    packet_.resize(longest);
    telemetry_ = {d.telemetry, table_.n_outputs, outputs_.data(), rates_.data(), packet_.data(), nullptr, nullptr};
    telemetry_.mode = [](const void *image) {
        void *place;
        std::memcpy(&place, image, sizeof place);
        return static_cast<const Commands *>(place)->mode();
    };
}

void Commands::lay_out_services()
{
    for (const auto &instance : process_.instances()) {
        if (const CommandService *service = instance->type().service) {
            services_.push_back(service);
            service_modules_.push_back(instance.get());
        }
    }
    table_of_services_ = {services_.data(),
                          static_cast<std::uint32_t>(services_.size()),
                          [](void *c, std::uint32_t place) -> void * {
                              return static_cast<Commands *>(c)->service_modules_[place]->memory();
                          },
                          [](const void *c, std::uint16_t place, std::uint32_t *size) -> const void * {
                              const auto &me = *static_cast<const Commands *>(c);
                              *size = me.outputs_[place].size;
                              return me.live_[place];
                          },
                          events_.data(),
                          static_cast<std::uint32_t>(events_.size()),
                          nullptr,
                          nullptr,
                          command_service_check,
                          command_service_execute,
                          command_service_run,
                          telemetry_services,
                          nullptr,
                          nullptr};
    if (std::any_of(services_.begin(), services_.end(), [](const auto *s) { return s->wrap; })) {
        table_of_services_.unwrap = command_service_unwrap;
        table_of_services_.wrap = command_service_wrap;
    }
    table_.services = services_.empty() ? nullptr : &table_of_services_;
}

void Commands::begin()
{
    runs_ = false;
    command_begin(&state_);
    telemetry_begin(&telemetry_);
    reports_.clear();
    place_ = played_ = 0;
    reported_ = -1;
}

void Commands::forget(Ns t)
{
    for (Carrier *carrier : carriers_) {
        carrier->receive(t, [](Unit) {});
    }
    runs_ = false;
    command_begin(&state_);
    telemetry_begin(&telemetry_);
}

CommandReason Commands::accept(std::span<const std::uint8_t> packet, Ns last)
{
    state_.t = last;
    const CommandContext context{&state_, &table_, this, last, 0};
    table_of_services_.keys = process_.keys.get();
    return command_receive(&context, packet.data(), static_cast<std::uint32_t>(packet.size()), report, this);
}

/// The packet with the next sequence of a link, and its checksum.
static std::vector<std::uint8_t> counted_on(std::vector<std::uint8_t> packet, const CommandLink &link)
{
    const std::uint32_t sequence = link.begun ? link.last + 1u : 0u;
    const auto high = static_cast<std::uint8_t>((packet.at(2) & 0xC0u) | (sequence >> 8 & 0x3Fu));
    const auto low = static_cast<std::uint8_t>(sequence);
    packet.at(7) = static_cast<std::uint8_t>(packet[7] ^ packet[2] ^ packet[3] ^ high ^ low);
    packet[2] = high;
    packet[3] = low;
    return packet;
}

void Commands::accept_due(Ns t, Ns last)
{
    reported_ = t; // the reports leave the computer now, though they bear the time of the last instant
    for (Carrier *carrier : carriers_) {
        carrier->receive(t, [&](Unit unit) {
            if (!table_of_services_.unwrap) {
                process_.received.put(t - 1, unit);
            }
            accept(unit, last);
        });
    }
    for (; scripted() < t; place_++) {
        const ScriptedCommand &command = process_.script()[place_];
        accept(command.counts_on ? counted_on(command.packet, state_.ground) : command.packet, last);
    }
}

Ns Commands::scripted() const
{
    return place_ < process_.script().size() ? process_.script()[place_].after : Runtime::never;
}

Ns Commands::played() const
{
    const auto &packets = process_.played_telemetry();
    return packets && played_ < packets->size() ? (*packets)[played_].t : Runtime::never;
}

Ns Commands::next(Ns now) const
{
    Ns after = state_.waiting > 0 ? now : scripted();
    for (std::size_t i = 0; i < services_.size(); i++) {
        const Ns due = services_[i]->next ? services_[i]->next(service_modules_[i]->memory()) : Runtime::never;
        after = due == Runtime::never ? after : std::min(after, due - 1);
    }
    for (const Carrier *carrier : carriers_) {
        const Ns due = carrier->next_up();
        after = due == Runtime::never ? after : std::min(after, due - 1);
    }
    return std::max(after, now);
}

void Commands::find_place(Ns t)
{
    for (place_ = 0; scripted() < t; place_++) {
    }
    for (played_ = 0; t >= 0 && played() <= t; played_++) { // the first instant sends what was before it
    }
}

void Commands::execute(Ns t)
{
    command_execute(&state_, &table_, this, t, report, this);
}

// --- procedures ------------------------------------------------------------------------------------

CommandReason Commands::start(const CommandContext *context, std::uint16_t slot, std::uint32_t n, std::uint32_t turns)
{
    auto &me = *static_cast<Commands *>(context->mission);
    const std::uint8_t *code = me.slots_.data() + slot * slot_room;
    if (me.runs_ || !me.process_.procedure_host().start) {
        return me.runs_ ? COMMAND_RUNNING : COMMAND_ABSENT;
    }
    const auto reason =
        static_cast<CommandReason>(me.process_.procedure_host().start({code, code + n}, context->sequence, turns));
    me.context_ = *context;
    me.slot_ = slot;
    me.runs_ = reason == COMMAND_OK;
    return reason;
}

CommandReason Commands::stop(const CommandContext *context, std::uint16_t slot)
{
    auto &me = *static_cast<Commands *>(context->mission);
    if (!me.runs_ || me.slot_ != slot) {
        return COMMAND_RUNNING;
    }
    me.end_procedure(context->t, false, "by command");
    return COMMAND_OK;
}

void Commands::end_procedure(Ns t, bool killed, const std::string &why)
{
    if (std::exchange(runs_, false)) {
        process_.procedure_host().end(t, killed, why);
    }
}

bool Commands::run_procedure(Ns t)
{
    if (!runs_) {
        return false;
    }
    std::vector<std::vector<std::byte>> before;
    for (const auto &instance : process_.instances()) {
        before.emplace_back(instance->memory(), instance->memory() + instance->type().size);
    }
    context_.t = t;
    const int turn = process_.procedure_host().turn(t);
    const auto restore = [&] {
        for (std::size_t i = 0; i < before.size(); i++) {
            std::copy(before[i].begin(), before[i].end(), process_.instances()[i]->memory());
        }
    };
    if (turn == ProcedureHost::FAILED) {
        runs_ = false;
        restore();
        return false;
    }
    for (std::size_t i = 0; i < before.size(); i++) {
        const Instance &instance = *process_.instances()[i];
        for (const FledgeField &field : fields(instance.type())) {
            if (field.group != FLEDGE_PAR &&
                !std::equal(instance.memory() + field.offset, instance.memory() + field.offset + field.size,
                            before[i].data() + field.offset)) {
                restore();
                end_procedure(t, true,
                              instance.path + "." + field.name + " is no parameter: a procedure cannot set it");
                return false;
            }
        }
    }
    const std::string wrong = write_changes(before);
    if (!wrong.empty()) {
        end_procedure(t, true, wrong);
    } else if (turn == ProcedureHost::ENDED) {
        runs_ = false;
    }
    return true;
}

std::string Commands::write_changes(const std::vector<std::vector<std::byte>> &before)
{
    for (std::size_t place = 0; place < blocks_.size(); place++) {
        const Dictionary::Block &block = dictionary_->blocks[place];
        for (std::size_t i = 0; i < before.size(); i++) {
            if (process_.instances()[i]->name != block.instance) {
                continue;
            }
            std::string wrong =
                write_changes(block, static_cast<std::uint16_t>(place), before[i].data() + block.offset);
            if (!wrong.empty()) {
                return wrong;
            }
        }
    }
    return "";
}

std::string Commands::write_changes(const Dictionary::Block &block, std::uint16_t place, const std::byte *before)
{
    auto *live = static_cast<std::uint8_t *>(table_.parameters(this, place));
    const std::vector<std::uint8_t> now(live, live + block.size);
    std::memcpy(live, before, block.size);
    std::uint32_t low = 0, high = block.size;
    while (low < high && now[low] == live[low]) {
        low++;
    }
    while (high > low && now[high - 1] == live[high - 1]) {
        high--;
    }
    if (low == high) {
        return "";
    }
    const auto begins = [&](std::uint32_t at) {
        return exec_number_at(block.runs.data(), static_cast<std::uint32_t>(block.runs.size()), at) != 0;
    };
    while (!begins(low)) {
        low--;
    }
    while (high < block.size && !begins(high)) {
        high++;
    }
    std::uint16_t detail = 0;
    const CommandReason reason = command_write(&context_, place, low, now.data() + low, high - low, &detail);
    const std::string path = process_.find(block.instance)->path;
    return reason == COMMAND_OK        ? ""
           : reason == COMMAND_RULE    ? path + ": a parameter breaks its rule"
           : reason == COMMAND_INITIAL ? path + ": an initial value counts only before flight's first instant"
                                       : path + ": more than " + std::to_string(COMMAND_DATA_MAX) +
                                             " bytes of parameters from the first change to the last; yield in between";
}

bool Commands::used() const
{
    return state_.waiting || state_.staging || state_.counters.accepted || state_.counters.refused || state_.framed;
}

// --- telemetry -------------------------------------------------------------------------------------

void Commands::send_telemetry(Ns t)
{
    for (std::size_t i = 0; i < outputs_.size(); i++) { // of one that is off, only whether it was written counts
        std::memcpy(image_.data() + outputs_[i].offset, live_[i], rates_[2 + i].on ? outputs_[i].size : sizeof(Head));
    }
    reported_ = t;
    telemetry_send(&telemetry_, image_.data(), t, &state_, keep, this);
    if (table_.services) {
        const CommandContext context{&state_, &table_, this, t, 0};
        telemetry_services(&telemetry_, &context, report, keep, this);
        if (table_of_services_.wrap && !process_.played_telemetry()) {
            wrap(nullptr, 0);
        }
    }
    for (; played() <= t; played_++) {
        const Packet &packet = (*process_.played_telemetry())[played_];
        send(packet.t, packet.bytes);
    }
}

void Commands::keep(void *self, const std::uint8_t *packet, std::uint32_t n)
{
    auto &me = *static_cast<Commands *>(self);
    if (me.process_.played_telemetry()) {
        return;
    }
    if (me.table_of_services_.wrap) {
        me.process_.telemetry.put(me.reported_, {packet, n});
        me.wrap(packet, n);
    } else {
        me.send(me.reported_, {packet, n});
    }
}

void Commands::send(Ns t, Unit unit)
{
    for (Carrier *carrier : carriers_) {
        carrier->send_down(t, unit);
    }
    process_.units.put(t, unit);
    if (!table_of_services_.wrap) {
        process_.telemetry.put(t, unit);
    }
}

void Commands::wrap(const std::uint8_t *packet, std::uint32_t n)
{
    const CommandContext context{&state_, &table_, this, reported_, 0};
    table_of_services_.keys = process_.keys.get();
    table_of_services_.wrap(
        &context, packet, n,
        [](void *self, const std::uint8_t *unit, std::uint32_t size) {
            auto &me = *static_cast<Commands *>(self);
            me.send(me.reported_, {unit, size});
        },
        this);
}

void Commands::visit_state(const std::function<void(void *, std::size_t)> &block)
{
    block(&state_, sizeof state_);
    block(staged_.data(), staged_.size());
    block(queue_.data(), queue_.size());
    block(rates_.data(), rates_.size() * sizeof rates_[0]);
}

void Commands::report(void *self, const CommandReport *report, const std::uint8_t *data)
{
    auto &me = *static_cast<Commands *>(self);
    me.reports_.push_back({*report, {data, data + report->n}});
    if (report->executed <= COMMAND_DONE) {
        me.process_.executive().command(*report);
    }
    me.reported_ = std::max(me.reported_, report->t);
    telemetry_report(&me.telemetry_, report, data, keep, self);
}

} // namespace fledge::sim
