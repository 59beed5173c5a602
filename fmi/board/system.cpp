// SPDX-License-Identifier: Apache-2.0
// Flight on the emulated LEON3 as the system of an FMU. Its resources are board.toml, the program flight.elf and
// token.txt; beside its library is mission.so, the mission as data (board.h).
//
// The mission's memory is in the computer, and there is an image of it, as it would be on this host, for the importer.
// After each instant the image becomes that memory, but for the inputs; before the next instant, what has been changed
// of the image since then is written into the computer: parameters, what they publish, and the requested mode.
#include <algorithm>
#include <cstring>
#include <dlfcn.h>

#include "emulator/board.h"
#include "emulator/devices/apbuart.h"
#include "emulator/elf.h"
#include "emulator/error.h"
#include "emulator/mission/link.h"
#include "emulator/report.h"
#include "flight/exec/event.h"
#include "flight/exec/order.h"
#include "fmi/board/board.h"
#include "fmi/fmu/flight.h"

namespace {

using namespace fledge;
using namespace fledge::emulator;

/// The folder of this library.
std::string own_folder()
{
    Dl_info info;
    const std::string path = dladdr(&fmu_system, &info) != 0 ? info.dli_fname : "";
    return path.substr(0, path.find_last_of('/') + 1);
}

class Flight {
public:
    explicit Flight(const FmuHost &host)
        : host_(host),
          board_(std::static_pointer_cast<const FmuBoard>(load_symbol(own_folder() + "mission.so", "fmu_board"))),
          program_(Program::read(resource("flight.elf"))), machine_(BoardDescription::read(resource("board.toml"))),
          link_(machine_, {board_, board_->host}), image_(board_->size), fired_(board_->layout->n_events)
    {
        machine_.load(program_);
        address_ = mission_address(machine_, program_);
        if (auto *uart = machine_.device_of<Apbuart>()) {
            uart->transmit = [this](std::uint8_t byte) { print(static_cast<char>(byte)); };
        }
        list_parts();
        exchange(-1);
        machine_.on_reset = [this] { log(FMU_WARNING, "events", "the computer was reset"); };
        booted_ = machine_.snapshot();
        booted_link_ = link_.save();
        booted_image_ = given_ = image_;
    }
    Flight(const Flight &) = delete;
    Flight &operator=(const Flight &) = delete;

    const FmuLayout *layout() const { return board_->layout; }
    std::uint8_t *memory(std::uint32_t block)
    {
        const std::uint32_t n = commands().n_blocks;
        return &image_[block < n ? board_->parameters[block].offset : io().messages[block - n].offset];
    }
    /// Whether the parameters of a block keep its rules.
    bool check(std::uint32_t block)
    {
        return flight_keeps_rules(&host_, &commands().blocks[block], board_->parameters[block].path, memory(block)) !=
               0;
    }

    /// From the state behind the boot: the parameters of the image count, and flight is reset. Those that flight itself
    /// has changed, after a beginning before this one, are again as they were.
    void begin()
    {
        machine_.restore(*booted_);
        link_.restore(booted_link_);
        for (const TelemetryOutput &part : std::span(parts_).first(commands().n_blocks)) {
            for (std::uint32_t k = part.offset; k < part.offset + part.size; k++) {
                image_[k] = image_[k] == seen_[k] ? given_[k] : image_[k];
            }
        }
        for (const TelemetryOutput &part : std::span(parts_).subspan(commands().n_blocks)) {
            std::copy_n(&booted_image_[part.offset], part.size, &image_[part.offset]);
        }
        seen_ = booted_image_;
        given_ = image_;
        write();
        exchange(-1);
        std::ranges::fill(fired_, 0u);
        counts_ = {0, commands().n_modes > 0, 0};
        sent_.clear();
        instant(0);
    }

    std::int64_t advance(std::int64_t until, bool stop)
    {
        sent_.clear();
        for (Ns t = link_.next(counts_.t); t <= until; t = link_.next(t)) {
            if (instant(t) && stop) {
                return t;
            }
        }
        counts_.t = until;
        return until;
    }

    std::int32_t mode() const { return commands().n_modes > 0 ? executive().mode(image_.data()) : -1; }
    bool enter(std::uint16_t mode)
    {
        if (!flight_may_enter(&host_, &commands(), image_.data(), mode, executive().modes[mode])) {
            return false;
        }
        commands().enter(image_.data(), mode);
        return true;
    }
    std::uint32_t fired(std::uint32_t event) const { return fired_[event]; }
    std::uint32_t entered() const { return static_cast<std::uint32_t>(counts_.entered); }

    void log(FmuSeverity severity, const char *category, const std::string &text) const
    {
        host_.log(host_.user, severity, category, text.c_str());
    }

    /// Space packets for flight, or a unit where it speaks frames: they wait in its registers.
    bool uplink(std::span<const std::uint8_t> units)
    {
        const CommandServices *services = commands().services;
        const bool framed = services && services->unwrap;
        while (!units.empty()) {
            const std::size_t size = flight_unit_size(units.data(), units.size(), framed);
            if (!link_.send(std::as_bytes(units.first(size)))) {
                log(FMU_WARNING, "commands", "there is no room for what shall go to flight, or it is too long");
                return false;
            }
            units = units.subspan(size);
        }
        return true;
    }
    /// Those from flight in the last step.
    std::span<const std::uint8_t> downlink() const { return sent_; }

    /// The bytes of a state: counters, image and link, then the machine's.
    std::vector<std::byte> save()
    {
        std::vector<std::byte> bytes, machine = machine_.save();
        counts_.sent = sent_.size();
        MissionLink::State link = link_.save();
        each_piece(link, [&](void *piece, std::size_t n) {
            const auto *from = static_cast<const std::byte *>(piece);
            bytes.insert(bytes.end(), from, from + n);
        });
        bytes.insert(bytes.end(), machine.begin(), machine.end());
        return bytes;
    }
    void restore(std::span<const std::byte> bytes)
    {
        MissionLink::State link = link_.save();
        each_piece(link, [&](void *piece, std::size_t n) {
            if (n > bytes.size()) {
                throw Error("the state is truncated");
            }
            std::copy_n(bytes.data(), n, static_cast<std::byte *>(piece));
            bytes = bytes.subspan(n);
        });
        machine_.load_snapshot(bytes);
        link_.restore(link);
    }

    std::vector<std::byte> saved; ///< for save() behind state_size()

private:
    const MissionIo &io() const { return *board_->host->io; }
    const CommandTable &commands() const { return *board_->host->commands; }
    const MissionExecutive &executive() const { return *board_->host->executive; }
    std::string resource(const char *name) const { return std::string(host_.resources) + "/" + name; }

    void print(char letter)
    {
        if (letter == '\n') {
            log(FMU_OK, "console", line_);
            line_.clear();
        } else {
            line_ += letter;
        }
    }

    /// The first of them are the parameters.
    void list_parts()
    {
        const TelemetryTable &telemetry = *board_->host->telemetry;
        for (std::uint32_t i = 0; i < commands().n_blocks; i++) {
            const CommandBlock &block = commands().blocks[i];
            parts_.push_back({block.runs, block.n_runs, board_->parameters[i].offset, block.size});
        }
        parts_.insert(parts_.end(), board_->parts, board_->parts + board_->n_parts);
        parts_.insert(parts_.end(), telemetry.outputs, telemetry.outputs + telemetry.n_outputs);
    }
    bool is_changed(const TelemetryOutput &part) const
    {
        return std::memcmp(&image_[part.offset], &seen_[part.offset], part.size) != 0;
    }

    /// The computer's memory into the image.
    void read()
    {
        if (!machine_.peek(address_, std::as_writable_bytes(std::span(raw_)))) {
            throw Error("the mission's memory is not in the computer's");
        }
        for (const auto &[runs, n_runs, offset, size] : parts_) {
            std::memcpy(&image_[offset], &raw_[offset], size);
            exec_big_endian(runs, n_runs, &image_[offset], 0, size);
        }
    }

    /// What was changed of the image into the computer's memory.
    void write()
    {
        for (const TelemetryOutput &part : parts_) {
            if (is_changed(part)) {
                std::uint8_t *const bytes = &raw_[part.offset];
                std::copy_n(&image_[part.offset], part.size, bytes);
                exec_big_endian(part.runs, part.n_runs, bytes, 0, part.size);
                (void)machine_.poke(address_ + part.offset, std::as_bytes(std::span(bytes, part.size)));
            }
        }
    }

    /// A tick of the computer, with the inputs of the image; then the image has what came of it.
    void exchange(Ns t)
    {
        const std::uint64_t missed = link_.loop().state.missed;
        const bool lives = link_.tick(t);
        if (!lives || link_.loop().state.missed != missed) {
            const std::string report = machine_.report(&program_);
            char when[64];
            std::snprintf(when, sizeof when, ", in the tick at %g s: ", static_cast<double>(t) * 1e-9);
            throw Error((lives ? "flight did not answer before its next instant" : "the computer has failed") +
                        std::string(t < 0 ? ", as it starts: " : when) + report.substr(0, report.find('\n')));
        }
        read();
        for (std::uint32_t id = 0; id < io().n_messages; id++) {
            if (io().messages[id].direction != MISSION_IN && link_.carries(id)) {
                link_.take(id, &image_[io().messages[id].offset]);
            }
        }
        seen_ = image_;
        for (auto packet = link_.receive(); !packet.empty(); packet = link_.receive()) {
            sent_.insert(sent_.end(), packet.begin(), packet.end());
        }
    }

    /// Publish the configuration whose parameters were changed.
    void publish(Ns t)
    {
        for (std::uint16_t i = 0; i < commands().n_blocks; i++) {
            if (commands().blocks[i].configuration != 0 && is_changed(parts_[i])) {
                commands().publish(image_.data(), i, t);
            }
        }
    }

    /// Returns whether a mode changed or an event fired.
    bool instant(Ns t)
    {
        const std::int32_t before = mode();
        counts_.t = t;
        for (std::uint32_t id = 0; id < io().n_messages; id++) {
            if (io().messages[id].direction == MISSION_IN) {
                link_.put(id, &image_[io().messages[id].offset]);
            }
        }
        if (link_.is_down(t)) {
            return false;
        }
        publish(t);
        write();
        exchange(t);
        bool happened = false;
        if (mode() != before) {
            counts_.entered++;
            happened = true;
            log(FMU_OK, "modes", executive().modes[mode()]);
        }
        for (std::uint16_t i = 0; i < fired_.size(); i++) {
            if (executive().event(image_.data(), i)->fired_at == t) {
                fired_[i]++;
                happened = true;
                log(FMU_OK, "events", executive().events[i].name);
            }
        }
        return happened;
    }

    /// The pieces of a state, but for the machine's.
    template <typename F> void each_piece(MissionLink::State &link, F f)
    {
        f(&counts_, sizeof counts_);
        sent_.resize(counts_.sent);
        f(sent_.data(), sent_.size());
        f(fired_.data(), fired_.size() * sizeof fired_[0]);
        f(image_.data(), image_.size());
        f(seen_.data(), seen_.size());
        f(given_.data(), given_.size());
        f(&link.reached, sizeof link.reached);
        f(&link.line, sizeof link.line);
        f(&link.loop, sizeof link.loop);
        f(link.outside.data(), link.outside.size());
        f(link.packets.data(), link.packets.size());
    }

    const FmuHost &host_;
    std::shared_ptr<const FmuBoard> board_;
    Program program_;
    Machine machine_;
    MissionLink link_;
    std::uint32_t address_ = 0;              ///< of the mission's memory
    std::string line_;                       ///< of the console
    std::vector<TelemetryOutput> parts_;     ///< of the mission's memory, with their numbers
    std::vector<std::uint8_t> image_, seen_; ///< what is in the computer, and the inputs; what was read of it last
    std::vector<std::uint8_t> raw_ = std::vector<std::uint8_t>(image_.size());
    struct {
        Ns t;
        std::uint64_t entered, sent;
    } counts_{};
    std::vector<std::uint32_t> fired_;
    std::vector<std::uint8_t> sent_; ///< by flight, in the last step
    std::shared_ptr<const Snapshot> booted_;
    MissionLink::State booted_link_;
    std::vector<std::uint8_t> booted_image_;
    std::vector<std::uint8_t> given_; ///< the image at the last beginning
};

Flight &of(void *self)
{
    return *static_cast<Flight *>(self);
}
const Flight &of(const void *self)
{
    return *static_cast<const Flight *>(self);
}

/// Call a function that may throw; then the log says why. It returns whether it did what it should.
template <typename F> int guarded(void *self, F f)
{
    try {
        return f(of(self)) ? 0 : -1;
    } catch (const std::exception &error) {
        of(self).log(FMU_ERROR, "errors", error.what());
        return -1;
    }
}

void *create(const FmuHost *host)
{
    try {
        return new Flight(*host);
    } catch (const std::exception &error) {
        host->log(host->user, FMU_ERROR, "errors", error.what());
        return nullptr;
    }
}

int advance(void *self, std::int64_t until, int stop, std::int64_t *reached)
{
    return guarded(self, [&](Flight &flight) {
        *reached = flight.advance(until, stop != 0);
        return true;
    });
}

int begin(void *self)
{
    return guarded(self, [](Flight &flight) {
        flight.begin();
        return true;
    });
}

std::size_t state_size(void *self)
{
    of(self).saved.clear();
    (void)guarded(self, [](Flight &flight) {
        flight.saved = flight.save();
        return true;
    });
    return of(self).saved.size();
}

int save(void *self, void *bytes)
{
    const std::vector<std::byte> saved = std::move(of(self).saved);
    std::ranges::copy(saved, static_cast<std::byte *>(bytes));
    return saved.empty() ? -1 : 0;
}

int restore(void *self, const void *bytes, std::size_t size)
{
    return guarded(self, [&](Flight &flight) {
        flight.restore({static_cast<const std::byte *>(bytes), size});
        return true;
    });
}

} // namespace

const FmuSystem fmu_system = {
    .token = nullptr,
    .create = create,
    .destroy = [](void *self) { delete static_cast<Flight *>(self); },
    .layout = [](const void *self) { return of(self).layout(); },
    .memory = [](void *self, std::uint32_t block) -> void * { return of(self).memory(block); },
    .changed = [](void *self, std::uint32_t block) { return of(self).check(block) ? 0 : -1; },
    .begin = begin,
    .advance = advance,
    .mode = [](const void *self, std::uint32_t) { return of(self).mode(); },
    .enter = [](void *self, std::uint32_t,
                std::int32_t mode) { return of(self).enter(static_cast<std::uint16_t>(mode)) ? 0 : -1; },
    .fired = [](const void *self, std::uint32_t event) { return of(self).fired(event); },
    .entered = [](const void *self, std::uint32_t) { return of(self).entered(); },
    .state_size = state_size,
    .save = save,
    .restore = restore,
    .uplink =
        [](void *self, const std::uint8_t *packets, std::size_t n) {
            return of(self).uplink({packets, n}) ? 0 : -1;
        },
    .downlink =
        [](const void *self, std::size_t *n) {
            const auto sent = of(self).downlink();
            *n = sent.size();
            return sent.data();
        },
};
