// SPDX-License-Identifier: Apache-2.0
// What the executive of a process says of itself, as messages (flight/command/activity.h): its mode, and what happened.
#pragma once

#include "flight/command/activity.h"
#include "sim/instance.h"
#include "sim/recorder.h"

#include <memory>
#include <span>
#include <string>

namespace fledge::sim {

/// The types of the messages that executives write. Without a call of it, they write none.
void set_executive_types(const FledgeStruct &mode, const FledgeStruct &activity);

/// The executive of a process as an instance with the outputs `mode` and `activity`, whose path is the process' name.
/// Its messages go into the records when they are written.
class Executive {
public:
    explicit Executive(Recorder &recorder) : recorder_(recorder) {}

    /// Name it. Without types it stays empty. Its records begin with their first messages.
    void begin(const std::string &process);

    void mode(Ns t, int index, const std::string &name); ///< if it is another one than that of the last message
    void event(Ns t, std::size_t index, const std::string &name, const std::string &cause);
    void command(const CommandReport &report);
    void reset(Ns t, std::uint32_t count);

    /// The messages that were written last, which a snapshot has; forget() them.
    std::span<std::byte> memory() const;
    void forget();

    const std::shared_ptr<Instance> &instance() const { return instance_; } ///< or null

private:
    struct Messages {
        ProcessMode mode;
        Activity activity;
    };
    template <class Say> void say(std::shared_ptr<Log> &log, std::size_t output, Ns t, const Say &write);

    Recorder &recorder_;
    std::shared_ptr<Instance> instance_;
    std::shared_ptr<Log> modes_, happenings_;
};

} // namespace fledge::sim
