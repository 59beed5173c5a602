// SPDX-License-Identifier: Apache-2.0
// The reports of the executive of a process, as messages (flight/command/activity.h): its mode, and what happened.
#pragma once

#include "flight/command/activity.h"
#include "sim/instance.h"
#include "sim/recorder.h"

#include <functional>
#include <memory>
#include <span>
#include <string>

namespace fledge::sim {

struct Messages;

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
    /// refused: it does not enter its mode
    void event(Ns t, std::size_t index, const std::string &name, const std::string &cause, bool refused);
    void command(const CommandReport &report);
    void reset(Ns t, std::uint32_t count);

    /// From now on it publishes the messages of a process that flew elsewhere, and no others.
    void play(std::shared_ptr<const Messages> modes, std::shared_ptr<const Messages> happenings);
    void play_as(const Executive &other) { play(other.played_modes_, other.played_happenings_); }
    bool plays() const { return played_modes_ != nullptr; }
    /// Publish those that are later than `after` and not later than t, and call with the time and the index of each
    /// mode that began, and of each event that fired.
    using Call = std::function<void(Ns, std::uint32_t)>;
    void publish_played(Ns after, Ns t, const Call &mode, const Call &event);

    /// The messages that were written last, which a snapshot has; forget() them.
    std::span<std::byte> memory() const;
    void forget();

    const std::shared_ptr<Instance> &instance() const { return instance_; } ///< or null

private:
    struct Written {
        ProcessMode mode;
        Activity activity;
    };
    template <class Write> void write(std::shared_ptr<Log> &log, std::size_t output, Ns t, const Write &write);
    template <class Write> void publish(std::shared_ptr<Log> &log, std::size_t output, Ns t, const Write &write);

    Recorder &recorder_;
    std::shared_ptr<Instance> instance_;
    std::shared_ptr<Log> modes_, happenings_;
    std::shared_ptr<const Messages> played_modes_, played_happenings_;
};

} // namespace fledge::sim
