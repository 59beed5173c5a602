// SPDX-License-Identifier: Apache-2.0
#include "sim/executive.h"

#include <algorithm>
#include <array>

namespace fledge::sim {

namespace {

/// An interface of two outputs.
struct Type {
    std::array<FledgeField, 2> fields{};
    FledgeStruct table{};
} type;

FledgeField output(const char *name, std::size_t offset, std::size_t size, const FledgeStruct &message)
{
    FledgeField field{};
    field.name = name;
    field.offset = static_cast<std::uint32_t>(offset);
    field.size = static_cast<std::uint32_t>(size);
    field.type = FLEDGE_STRUCT;
    field.group = FLEDGE_OUT;
    field.sub = &message;
    field.unit = "";
    field.ctype = message.name;
    field.doc = "";
    return field;
}

} // namespace

void set_executive_types(const FledgeStruct &mode, const FledgeStruct &activity)
{
    type.fields = {output("mode", 0, sizeof(ProcessMode), mode),
                   output("activity", sizeof(ProcessMode), sizeof(Activity), activity)};
    type.table.name = "Executive";
    type.table.doc = "What the executive of a process says of itself.";
    type.table.header = type.table.folder = "";
    type.table.kind = FLEDGE_MODULE;
    type.table.size = sizeof(ProcessMode) + sizeof(Activity);
    type.table.align = alignof(ProcessMode);
    type.table.n = 2;
    type.table.fields = type.fields.data();
}

void Executive::begin(const std::string &process)
{
    if (!type.table.n) {
        return;
    }
    instance_ = std::make_shared<Instance>(type.table);
    instance_->name = instance_->path = process;
}

std::span<std::byte> Executive::memory() const
{
    return instance_ ? std::span{instance_->memory(), sizeof(Messages)} : std::span<std::byte>{};
}

void Executive::forget()
{
    std::ranges::fill(memory(), std::byte{});
}

template <class Say> void Executive::say(std::shared_ptr<Log> &log, std::size_t output, Ns t, const Say &write)
{
    if (instance_) {
        // By its own type: of another extension's copy of this file, the type above is empty.
        log = log ? log : recorder_.follow(instance_, instance_->type().fields[output]);
        write(*reinterpret_cast<Messages *>(instance_->memory()));
        recorder_.written(*log, std::max<Ns>(t, 0));
    }
}

void Executive::mode(Ns t, int index, const std::string &name)
{
    const auto number = static_cast<std::uint32_t>(index);
    if (!instance_) {
        return;
    }
    if (activity_mode_began(&reinterpret_cast<const Messages *>(instance_->memory())->mode, number)) {
        say(modes_, 0, t, [&](Messages &m) { activity_mode(&m.mode, t, number, name.c_str()); });
    }
}

void Executive::event(Ns t, std::size_t index, const std::string &name, const std::string &cause)
{
    say(happenings_, 1, t, [&](Messages &m) {
        activity_event(&m.activity, t, static_cast<std::uint32_t>(index), name.c_str(), cause.c_str());
    });
}

void Executive::command(const CommandReport &report)
{
    say(happenings_, 1, report.t, [&](Messages &m) { activity_command(&m.activity, &report); });
}

void Executive::reset(Ns t, std::uint32_t count)
{
    say(happenings_, 1, t, [&](Messages &m) { activity_reset(&m.activity, t, count); });
}

} // namespace fledge::sim
