// SPDX-License-Identifier: Apache-2.0
#include "fmi/importer/fmu_model.h"

#include "flight/msg/head.h"

#include <algorithm>
#include <cstring>

namespace fledge::importer {

namespace {

/// [bytes] of a field in the interface.
std::size_t bytes(const FmuField &field)
{
    return std::size_t{field.n} * element_size(field.type);
}

/// n elements from one type and unit to another. Whole numbers of the same type keep their bits.
void convert(FledgeType from, const std::byte *a, FledgeType to, std::byte *b, std::uint32_t n, double factor,
             double shift)
{
    if (from == to && factor == 1.0 && shift == 0.0) {
        std::memcpy(b, a, std::size_t{n} * element_size(to));
        return;
    }
    for (std::uint32_t i = 0; i < n; i++) {
        element_write(to, b + std::size_t{i} * element_size(to),
                      factor * element_read(from, a + std::size_t{i} * element_size(from)) + shift);
    }
}

} // namespace

void FmuModel::put(const FmuField &field)
{
    std::byte *const at = memory_ + field.offset;
    if (field.kind == Kind::TEXT) {
        const auto *text = reinterpret_cast<const char *>(at);
        fmu_->set_text(field.references[0], std::string(text, strnlen(text, field.n)).c_str());
        return;
    }
    convert(field.type, at, fmu_->carried(field.kind), values_.data(), field.n, 1.0 / field.factor,
            -field.shift / field.factor);
    fmu_->set(field.kind, field.references, values_.data(), field.n);
}

void FmuModel::take(const FmuField &field)
{
    std::byte *const at = memory_ + field.offset;
    if (field.kind == Kind::TEXT) {
        const std::string text = fmu_->text(field.references[0]);
        if (text.size() >= field.n) {
            throw sim::RunError(about() + ": a text of " + std::to_string(text.size()) +
                                " characters; there is room for " + std::to_string(field.n - 1));
        }
        std::memset(at, 0, field.n);
        std::memcpy(at, text.data(), text.size());
        return;
    }
    fmu_->get(field.kind, field.references, values_.data(), field.n);
    convert(fmu_->carried(field.kind), values_.data(), field.type, at, field.n, field.factor, field.shift);
}

void FmuModel::put_parameters(std::size_t n)
{
    std::for_each_n(plan_->fields.begin(), n, [&](const FmuField &field) { put(field); });
}

void FmuModel::put_inputs(bool discrete)
{
    std::byte *written = written_.data();
    for (std::size_t i = 0; i < plan_->inputs.size(); i++) {
        const FmuPort &port = plan_->inputs[i];
        Head head;
        std::memcpy(&head, memory_ + port.offset, sizeof head);
        const bool there = !fed_[i] || head_written(head); // else the FMU keeps its start
        std::for_each_n(plan_->fields.begin() + static_cast<std::ptrdiff_t>(port.first), port.n,
                        [&](const FmuField &field) {
                            if (there && (discrete || !field.discrete)) {
                                put(field);
                            }
                            if (field.discrete) {
                                std::memcpy(written, memory_ + field.offset, bytes(field));
                                written += bytes(field);
                            }
                        });
    }
}

bool FmuModel::inputs_changed() const
{
    const std::byte *written = written_.data();
    return std::ranges::any_of(plan_->fields, [&](const FmuField &field) {
        const bool differs = field.discrete && std::memcmp(written, memory_ + field.offset, bytes(field)) != 0;
        written += field.discrete ? bytes(field) : 0;
        return differs;
    });
}

void FmuModel::take_outputs(sim::Ns t)
{
    for (const FmuPort &port : plan_->outputs) {
        std::for_each_n(plan_->fields.begin() + static_cast<std::ptrdiff_t>(port.first), port.n,
                        [&](const FmuField &field) { take(field); });
        if (port.headed) {
            Head head;
            std::memcpy(&head, memory_ + port.offset, sizeof head);
            head = head_next(head, t, QUALITY_GOOD);
            std::memcpy(memory_ + port.offset, &head, sizeof head);
        }
    }
    for (std::size_t i = 0; i < plan_->counters.size(); i++) {
        std::memcpy(memory_ + plan_->counters[i], &fmu_->ticks[i], sizeof fmu_->ticks[i]);
    }
}

void FmuModel::prepare(const sim::Setup &setup)
{
    if (!plan_) {
        throw sim::SetupError(setup.name + ": an FMU without a file; make it by world.Fmu");
    }
    name_ = setup.name;
    fed_.clear();
    for (const FmuPort &port : plan_->inputs) {
        fed_.push_back(std::ranges::find(setup.wired, port.name) != setup.wired.end());
    }
    std::size_t most = 0, discrete = 0;
    for (const FmuField &field : plan_->fields) {
        most = std::max(most, std::size_t{field.n} * sizeof(double));
        discrete += field.discrete ? bytes(field) : 0;
    }
    values_.resize(most);
    fmu_.reset();
    fmu_ = load(plan_->file, name_);
    phase_ = FRESH;
    discrete = (discrete + 7) / 8 * 8;
    state_.assign(sizeof(State) + discrete, {});
    written_ = std::span(state_).subspan(sizeof(State));
    try {
        if (plan_->file.saves) { // how large its state is after the start
            put_parameters(plan_->parameters);
            fmu_->initialize(0.0);
            put_inputs(true);
            fmu_->begin();
            state_.resize(state_.size() + (fmu_->save().size() + 7) / 8 * 8);
            written_ = std::span(state_).subspan(sizeof(State), discrete);
            fmu_->reset();
        }
    } catch (const sim::RunError &failed) {
        throw sim::SetupError(failed.what());
    }
}

void FmuModel::reset(sim::Ns t)
{
    if (fmu_->dead()) {
        fmu_.reset();
        fmu_ = load(plan_->file, name_);
    } else if (phase_ != FRESH) {
        fmu_->reset();
    }
    phase_ = FRESH;
    put_parameters(plan_->parameters);
    fmu_->initialize(tick_seconds(t));
    phase_ = INITIALIZING;
    put_inputs(true);
    for (const FmuPort &port : plan_->outputs) {
        std::memset(memory_ + port.offset, 0, sizeof(Head));
    }
    take_outputs(t);
}

void FmuModel::refresh()
{
    if (phase_ == STEPPING) {
        fmu_->open_event();
        put_parameters(plan_->tunable);
        fmu_->close_event();
    } else if (phase_ == INITIALIZING) {
        put_parameters(plan_->parameters);
    }
}

void FmuModel::update(Tick tick)
{
    if (phase_ == INITIALIZING) {
        put_inputs(true);
        fmu_->begin();
        phase_ = STEPPING;
    } else if (inputs_changed()) {
        fmu_->open_event();
        put_inputs(true);
        fmu_->close_event();
    } else {
        put_inputs(false);
    }
    fmu_->step_to(tick_seconds(tick.t));
    take_outputs(tick.t);
}

void FmuModel::save()
{
    State state{fmu_ ? fmu_->time() : 0.0, 0, phase_, 0};
    const auto room = std::span(state_).subspan(sizeof state + written_.size());
    if (phase_ != FRESH) {
        if (!plan_->file.saves) {
            throw sim::SetupError(about() + ": no snapshot, because the FMU cannot " +
                                  (plan_->file.version == 2 ? "canGetAndSetFMUstate and canSerializeFMUstate"
                                                            : "canGetAndSetFMUState and canSerializeFMUState"));
        }
        std::vector<std::byte> bytes;
        try {
            bytes = fmu_->save();
        } catch (const sim::RunError &failed) {
            throw sim::SetupError(failed.what());
        }
        if (bytes.size() > room.size()) {
            throw sim::SetupError(about() + ": its state has grown to " + std::to_string(bytes.size()) +
                                  " bytes; a snapshot has room for " + std::to_string(room.size()) +
                                  ", which it had after its start");
        }
        state.size = bytes.size();
        std::ranges::fill(room, std::byte{});
        std::ranges::copy(bytes, room.begin());
    }
    std::memcpy(state_.data(), &state, sizeof state);
}

void FmuModel::restored()
{
    State state;
    std::memcpy(&state, state_.data(), sizeof state);
    if (state.phase == FRESH) {
        return; // a reset comes before the next update
    }
    fmu_->restore(std::span(state_).subspan(sizeof state + written_.size(), state.size));
    fmu_->set_time(state.time);
    phase_ = static_cast<Phase>(state.phase);
    for (std::size_t i = 0; i < plan_->counters.size(); i++) {
        std::memcpy(&fmu_->ticks[i], memory_ + plan_->counters[i], sizeof fmu_->ticks[i]);
    }
}

} // namespace fledge::importer
