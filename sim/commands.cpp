// SPDX-License-Identifier: Apache-2.0
#include "sim/commands.h"

#include "sim/runtime.h"

#include <algorithm>
#include <utility>

namespace fledge::sim {

Commands::Commands(Runtime &runtime, Process &process, std::shared_ptr<const Dictionary> dictionary)
    : runtime_(runtime), process_(process), dictionary_(std::move(dictionary)), queue_(dictionary_->room)
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
    table_.n_modes = static_cast<std::uint16_t>(process.modes().size());
    table_.n_events = static_cast<std::uint16_t>(process.events().size());
    table_.n_outputs = d.n_outputs;
    table_.blocks = blocks_.data();
    table_.staged = staged_.data();
    table_.queue = queue_.data();
    table_.room = static_cast<std::uint32_t>(queue_.size());
    table_.parameters = [](void *c, std::uint16_t block) -> void * {
        const Dictionary::Block &one = static_cast<Commands *>(c)->dictionary_->blocks[block];
        return static_cast<Commands *>(c)->process_.find(one.instance)->memory() + one.offset;
    };
    table_.enter = [](void *c, std::uint16_t mode) {
        static_cast<Commands *>(c)->runtime_.enter(static_cast<Commands *>(c)->process_, mode);
    };
    table_.publish = [](void *c, std::uint16_t block, std::int64_t t) {
        auto &me = *static_cast<Commands *>(c);
        me.runtime_.publish(*me.process_.find(me.dictionary_->blocks[block].instance), t);
    };
    table_.arm = [](void *c, std::uint16_t event, int on) {
        auto &me = *static_cast<Commands *>(c);
        me.process_.arm(*me.process_.events()[event], on != 0);
    };
    table_.reset = [](void *c, std::int64_t t) {
        auto &me = *static_cast<Commands *>(c);
        me.runtime_.restart(me.runtime_.of(me.process_), t);
    };
    table_.telemetry = [](void *, std::uint16_t, int, std::uint16_t) {}; // the desktop records without packets
    begin();
}

void Commands::begin()
{
    command_begin(&state_);
    reports_.clear();
    place_ = 0;
}

void Commands::forget()
{
    command_begin(&state_);
}

CommandReason Commands::accept(const std::vector<std::uint8_t> &packet, Ns last)
{
    state_.t = last;
    return command_accept(&state_, &table_, packet.data(), static_cast<std::uint32_t>(packet.size()), report, this);
}

void Commands::accept_script(Ns t, Ns last)
{
    for (; scripted() < t; place_++) {
        accept(process_.script()[place_].packet, last);
    }
}

Ns Commands::scripted() const
{
    return place_ < process_.script().size() ? process_.script()[place_].after : Runtime::never;
}

void Commands::find_place(Ns t)
{
    for (place_ = 0; scripted() < t; place_++) {
    }
}

void Commands::execute(Ns t)
{
    command_execute(&state_, &table_, this, t, report, this);
}

bool Commands::used() const
{
    return state_.waiting || state_.staging || state_.counters.accepted || state_.counters.refused;
}

void Commands::visit_state(const std::function<void(void *, std::size_t)> &block)
{
    block(&state_, sizeof state_);
    block(staged_.data(), staged_.size());
    block(queue_.data(), queue_.size());
}

void Commands::report(void *self, const CommandReport *report, const std::uint8_t *data)
{
    static_cast<Commands *>(self)->reports_.push_back({*report, {data, data + report->n}});
}

} // namespace fledge::sim
