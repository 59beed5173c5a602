// SPDX-License-Identifier: Apache-2.0
#include "sim/executive.h"

#include "sim/structure.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace fledge::sim {

namespace {

/// An interface of two outputs.
struct Type {
    std::array<FledgeField, 2> fields{};
    FledgeStruct table{};
} interface_type;

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
    interface_type.fields = {output("mode", 0, sizeof(ProcessMode), mode),
                             output("activity", sizeof(ProcessMode), sizeof(Activity), activity)};
    interface_type.table.name = "Executive";
    interface_type.table.doc = "What the executive of a process says of itself.";
    interface_type.table.header = interface_type.table.folder = "";
    interface_type.table.kind = FLEDGE_MODULE;
    interface_type.table.size = sizeof(ProcessMode) + sizeof(Activity);
    interface_type.table.align = alignof(ProcessMode);
    interface_type.table.n = 2;
    interface_type.table.fields = interface_type.fields.data();
}

void Executive::begin(const std::string &process)
{
    if (!interface_type.table.n) {
        return;
    }
    instance_ = std::make_shared<Instance>(interface_type.table);
    instance_->name = instance_->path = process;
}

std::span<std::byte> Executive::memory() const
{
    return instance_ ? std::span{instance_->memory(), sizeof(Written)} : std::span<std::byte>{};
}

void Executive::forget()
{
    std::ranges::fill(memory(), std::byte{});
}

template <class Write> void Executive::write(std::shared_ptr<Log> &log, std::size_t output, Ns t, const Write &write)
{
    if (instance_) {
        // By its own type: of another extension's copy of this file, the type above is empty.
        log = log ? log : recorder_.follow(instance_, instance_->type().fields[output]);
        write(*reinterpret_cast<Written *>(instance_->memory()));
        recorder_.written(*log, std::max<Ns>(t, 0));
    }
}

template <class Write> void Executive::publish(std::shared_ptr<Log> &log, std::size_t output, Ns t, const Write &write)
{
    if (!plays()) {
        this->write(log, output, t, write);
    }
}

void Executive::play(std::shared_ptr<const Messages> modes, std::shared_ptr<const Messages> happenings)
{
    played_modes_ = std::move(modes);
    played_happenings_ = std::move(happenings);
}

void Executive::publish_played(Ns after, Ns t, const Call &mode, const Call &event)
{
    const auto each = [&](const Messages &played, std::shared_ptr<Log> &log, std::size_t output, auto member,
                          const auto &call) {
        for (std::size_t i = played.until(after), end = played.until(t); i < end; i++) {
            write(log, output, played.times[i], [&](Written &written) {
                std::memcpy(&(written.*member), played.message(i), sizeof(written.*member));
                call(played.times[i], written.*member);
            });
        }
    };
    each(*played_modes_, modes_, 0, &Written::mode, [&](Ns at, const ProcessMode &m) { mode(at, m.index); });
    each(*played_happenings_, happenings_, 1, &Written::activity, [&](Ns at, const Activity &a) {
        if (a.kind == ACTIVITY_EVENT) {
            event(at, a.index);
        }
    });
}

void Executive::mode(Ns t, int index, const std::string &name)
{
    const auto number = static_cast<std::uint32_t>(index);
    if (!instance_) {
        return;
    }
    if (activity_mode_began(&reinterpret_cast<const Written *>(instance_->memory())->mode, number)) {
        publish(modes_, 0, t, [&](Written &m) { activity_mode(&m.mode, t, number, name.c_str()); });
    }
}

void Executive::event(Ns t, std::size_t index, const std::string &name, const std::string &cause, bool refused)
{
    publish(happenings_, 1, t, [&](Written &m) {
        activity_event(&m.activity, t, static_cast<std::uint32_t>(index), name.c_str(), cause.c_str(), refused);
    });
}

void Executive::command(const CommandReport &report)
{
    publish(happenings_, 1, report.t, [&](Written &m) { activity_command(&m.activity, &report); });
}

void Executive::reset(Ns t, std::uint32_t count)
{
    publish(happenings_, 1, t, [&](Written &m) { activity_reset(&m.activity, t, count); });
}

} // namespace fledge::sim
