// SPDX-License-Identifier: Apache-2.0
#include "emulator/machine.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "emulator/board.h"
#include "emulator/cpu/step.h"
#include "emulator/debug/observer.h"
#include "emulator/devices/apbuart.h"
#include "emulator/devices/debug_unit.h"
#include "emulator/devices/gptimer.h"
#include "emulator/devices/irqmp.h"
#include "emulator/devices/memory_controller.h"
#include "emulator/devices/plug_and_play.h"
#include "emulator/devices/register_space.h"
#include "emulator/devices/spacewire.h"
#include "emulator/devices/test_report.h"
#include "emulator/elf.h"
#include "emulator/report.h"
#include "emulator/snapshot.h"

namespace fledge::emulator {

namespace {

constexpr std::uint64_t ns_per_second = 1'000'000'000;

std::unique_ptr<Engine> make_engine(EngineKind kind)
{
    switch (kind) {
    case EngineKind::interpreter: return make_interpreter();
    case EngineKind::threaded: return make_threaded();
    default: return make_translator();
    }
}

bool all_zero(std::span<const std::byte> bytes)
{
    return std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0}; });
}

} // namespace

struct Machine::Impl final : DeviceHost {
    Impl(Machine &of, const BoardDescription &description, EngineKind kind)
        : machine(of), board(description), engine(make_engine(kind))
    {
        bus.add_memory(board.ram.base, board.ram.size, true, board.ram.edac);
        if (board.rom.size > 0) {
            bus.add_memory(board.rom.base, board.rom.size, false, false);
        }
        bus.code_changed = [this](std::uint32_t address, std::uint32_t size) { engine->invalidate(address, size); };
        bus.error = [this](const BusError &error) {
            if (ahb_status) {
                ahb_status->note(error);
            }
        };
        core.bus = &bus;
        bus.cycles = &core.state.cycles;
        core.timing = board.leon3_timing ? leon3_timing() : plain_timing();
        core.fpu = board.grfpu ? FpuPersonality::grfpu : FpuPersonality::qemu;
        core.user = this;
        core.acknowledge = [](void *user, std::uint32_t level) {
            static_cast<Impl *>(user)->irqmp->acknowledge(level);
        };
        for (const DeviceDescription &d : board.devices) {
            add(d);
        }
        add_tables();
        start_from_zero();
        start_processor();
    }

    // ---- construction

    void add(const DeviceDescription &d)
    {
        std::unique_ptr<Device> device;
        switch (d.kind) {
        case DeviceKind::irqmp:
            device = std::make_unique<Irqmp>(d.name, [this](std::uint32_t level) {
                core.attention = core.attention || level > core.interrupt_level;
                core.interrupt_level = level;
            });
            irqmp = static_cast<Irqmp *>(device.get());
            break;
        case DeviceKind::gptimer: {
            // As a boot loader leaves it: a tick is a microsecond.
            Gptimer::Settings settings{d.timers, d.interrupt, std::max(board.clock / 1'000'000, 1u) - 1, d.watchdog, 0};
            const double ticks = d.watchdog_after_reset * board.clock / (settings.scaler + 1.0);
            settings.watchdog_after_reset =
                ticks > 0 ? static_cast<std::uint32_t>(std::clamp(std::round(ticks), 1.0, 4294967295.0)) : 0;
            device = std::make_unique<Gptimer>(d.name, *this, settings);
            break;
        }
        case DeviceKind::apbuart:
            device = std::make_unique<Apbuart>(d.name, *this, Apbuart::Settings{d.interrupt, d.timed});
            break;
        case DeviceKind::ahbstat:
            device = std::make_unique<AhbStatus>(d.name, *this, d.interrupt);
            ahb_status = static_cast<AhbStatus *>(device.get());
            break;
        case DeviceKind::ftmctrl: device = std::make_unique<MemoryController>(d.name, bus); break;
        case DeviceKind::scrubber: device = std::make_unique<Scrubber>(d.name, *this, bus, d.period); break;
        case DeviceKind::protection: device = std::make_unique<WriteProtection>(d.name, bus); break;
        case DeviceKind::registers: device = std::make_unique<RegisterSpace>(d.name, *this, d.registers); break;
        case DeviceKind::report: device = std::make_unique<TestReport>(d.name); break;
        case DeviceKind::grspw2: device = std::make_unique<SpaceWire>(d.name, bus); break;
        case DeviceKind::dsu: device = std::make_unique<DebugUnit>(d.name, core.state); break;
        }
        bus.add_device(d.address, d.size, *device, d.wait);
        devices.push_back(std::move(device));
    }

    /// The plug-and-play tables.
    void add_tables()
    {
        auto ahb = std::make_unique<PlugAndPlay>("ahb"), apb = std::make_unique<PlugAndPlay>("apb");
        ahb->add_master({{0x01, 0x003, 0}, 0, 0, 0}); // the LEON3
        ahb->add_slave({{0x01, 0x006, 0}, PlugAndPlay::apb_base, PlugAndPlay::apb_size, 0});
        for (std::size_t i = 0; i < devices.size(); i++) {
            const DeviceDescription &d = board.devices[i];
            const PlugAndPlayEntry entry{devices[i]->identity(), d.address, d.size, d.interrupt};
            if (d.address - PlugAndPlay::apb_base < PlugAndPlay::apb_size) {
                apb->add_apb(entry);
            } else {
                ahb->add_slave(entry);
            }
        }
        bus.add_bridge(PlugAndPlay::apb_base, PlugAndPlay::apb_size);
        bus.add_device(PlugAndPlay::ahb_address, PlugAndPlay::table_size, *ahb);
        bus.add_device(PlugAndPlay::apb_address, PlugAndPlay::table_size, *apb);
        devices.push_back(std::move(ahb));
        devices.push_back(std::move(apb));
    }

    /// The snapshot before anything was written.
    void start_from_zero()
    {
        const auto empty = std::make_shared<Snapshot>();
        empty->pages.resize(bus.pages());
        base = empty;
    }

    // ---- DeviceHost

    std::uint64_t cycles() const override { return core.state.cycles; }
    void raise(std::uint32_t line) override { irqmp->raise(line); }
    void changed() override { core.attention = true; }
    void reset() override
    {
        reset_requested = true;
        core.attention = true;
    }

    // ---- resets

    /// The registers of the processor, as a boot loader leaves them for the program.
    void start_processor()
    {
        CpuState &s = core.state;
        CpuState fresh;
        fresh.cycles = fresh.counts_from = s.cycles;
        fresh.instructions = s.instructions;
        fresh.traps = s.traps;
        s = fresh;
        s.pc = boot ? boot->entry : board.rom.size > 0 ? board.rom.base : board.ram.base;
        s.npc = s.pc + 4;
        s.wim = 2;
        if (s.pc != board.rom.base) {
            s.psr |= psr::enable_fpu | psr::previous_supervisor | psr::enable_traps; // programs of BCC rely on it
            s.cache_control = 0x0081000F; // on, with snooping: RTEMS for several processors looks for it
            for (const auto &device : devices) {
                if (auto *timers = dynamic_cast<Gptimer *>(device.get()); timers && (timers->read(8) & 7) > 1) {
                    timers->write(0x14, ~0u); // the clock of BCC is the first timer, which counts microseconds
                    timers->write(0x18, 7);
                }
            }
        }
        Banks r(s);
        r[14] = (board.ram.base + board.ram.size - 96) & ~7u;
        at_breakpoint = false;
    }

    void copy_program()
    {
        for (const BootImage::Segment &segment : boot->segments) {
            bus.poke(segment.address, segment.bytes);
        }
    }

    void reset_now()
    {
        reset_requested = false;
        core.attention = false;
        resets++;
        if (!board.ram.kept) {
            bus.set_flips({});
            const std::vector<std::byte> zeros(page_size);
            for (std::uint32_t offset = 0; offset < board.ram.size; offset += page_size) {
                if (!all_zero(bus.memory(board.ram.base + offset, page_size))) {
                    bus.poke(board.ram.base + offset, zeros);
                }
            }
        }
        for (const auto &device : devices) {
            device->reset();
        }
        if (boot) {
            copy_program();
        }
        start_processor();
        if (machine.on_reset) {
            machine.on_reset();
        }
    }

    // ---- time

    std::uint64_t cycles_at(Ns t) const
    {
        const auto product = static_cast<unsigned __int128>(std::max<Ns>(t, 0)) * board.clock + (ns_per_second - 1);
        return static_cast<std::uint64_t>(std::min<unsigned __int128>(product / ns_per_second, never - 1));
    }

    std::uint64_t next_event() const
    {
        std::uint64_t next = never;
        for (const auto &device : devices) {
            next = std::min(next, device->next_event());
        }
        return next;
    }

    bool watchdog_runs() const
    {
        return std::ranges::any_of(devices, [](const auto &device) {
            const auto *timer = dynamic_cast<const Gptimer *>(device.get());
            return timer && timer->watchdog_runs();
        });
    }

    void act_on_events()
    {
        for (const auto &device : devices) {
            while (device->next_event() <= core.state.cycles) {
                device->act();
            }
        }
    }

    StopReason run(std::uint64_t until, bool step_over)
    {
        running = true;
        const StopReason reason = loop(until, step_over);
        running = false;
        at_breakpoint = reason == StopReason::breakpoint;
        return reason;
    }

    StopReason loop(std::uint64_t until, bool step_over)
    {
        CpuState &s = core.state;
        for (;; step_over = false) {
            act_on_events();
            if (reset_requested) {
                reset_now();
                continue;
            }
            if (stop_requested) {
                stop_requested = false;
                return StopReason::early;
            }
            const bool halted = s.mode == Mode::error;
            if (halted && !watchdog_runs()) {
                return StopReason::error;
            }
            if (s.cycles >= until) {
                return StopReason::time;
            }
            const std::uint64_t next = std::min(until, next_event());
            if (halted || (s.mode == Mode::power_down && !core.interrupted())) {
                s.cycles = next;
                continue;
            }
            switch (observer ? observed(next, step_over) : engine->run(core, next, step_over)) {
            case Exit::breakpoint: return StopReason::breakpoint;
            case Exit::watchpoint: return StopReason::watchpoint;
            case Exit::error:
                if (machine.on_error) {
                    machine.on_error();
                }
                break;
            default: break;
            }
        }
    }

    /// As Engine::run, one step after the other.
    Exit observed(std::uint64_t until, bool step_over)
    {
        const CpuState &s = core.state;
        for (;; step_over = false) {
            const std::uint64_t begun = s.cycles, instructions = s.instructions, traps = s.traps;
            const std::uint32_t pc = s.pc;
            std::uint32_t word = 0;
            for (const std::byte b : bus.memory(pc, 4)) {
                word = word << 8 | static_cast<std::uint32_t>(b);
            }
            const std::uint32_t address = effective_address(core.state, decode(word));
            const Exit exit = engine->run(core, begun + 1, step_over);
            if (s.instructions != instructions || s.traps != traps) {
                observer->executed({pc, word, begun, address, s.traps != traps, s});
            }
            if (exit != Exit::time || s.cycles >= until) {
                return exit;
            }
        }
    }

    Machine &machine;
    BoardDescription board;
    SystemBus bus;
    Core core;
    std::unique_ptr<Engine> engine;
    Observer *observer = nullptr;
    std::vector<std::unique_ptr<Device>> devices;
    Irqmp *irqmp = nullptr;
    AhbStatus *ahb_status = nullptr;
    std::shared_ptr<const BootImage> boot;
    std::shared_ptr<const Snapshot> base; ///< memory is equal to it but for the changed pages
    std::uint64_t resets = 0;
    bool running = false, stop_requested = false, reset_requested = false, at_breakpoint = false;
};

Machine::Machine(const BoardDescription &board, EngineKind engine) : impl_(std::make_unique<Impl>(*this, board, engine))
{
}

Machine::~Machine() = default;

const BoardDescription &Machine::board() const
{
    return impl_->board;
}

void Machine::load(const Program &program)
{
    const MemoryDescription &ram = impl_->board.ram, &rom = impl_->board.rom;
    const auto image = std::make_shared<BootImage>();
    image->entry = program.entry();
    for (const Program::Segment &s : program.segments()) {
        if (impl_->bus.memory(s.address, s.memory_size).empty()) {
            const auto range = [](const MemoryDescription &m) {
                char text[64];
                std::snprintf(text, sizeof text, "0x%08x to 0x%08x", m.base, m.base + (m.size - 1));
                return std::string(text);
            };
            throw Error(program.path() + ": a segment lies at " + range({s.address, s.memory_size}) +
                        "; the board has RAM at " + range(ram) + (rom.size > 0 ? " and ROM at " + range(rom) : ""));
        }
    }
    for (const Program::Segment &s : program.segments()) {
        std::vector<std::byte> bytes = s.bytes;
        bytes.resize(s.memory_size);
        impl_->bus.poke(s.address, bytes);
        if (s.address - rom.base < rom.size) {
            image->entry = rom.base;
        } else {
            image->segments.push_back({s.address, s.bytes});
        }
    }
    if (image->entry == rom.base && rom.size > 0) {
        image->segments.clear();
    }
    impl_->boot = image;
    impl_->start_processor();
}

void Machine::reset()
{
    if (impl_->running) {
        impl_->reset();
    } else {
        impl_->reset_now();
    }
}

void Machine::reset_until(Ns t)
{
    std::uint64_t &cycles = impl_->core.state.cycles;
    cycles = std::max(cycles, impl_->cycles_at(t));
    impl_->reset_now();
}

StopReason Machine::run_until(Ns t)
{
    return impl_->run(impl_->cycles_at(t), impl_->at_breakpoint);
}

StopReason Machine::step()
{
    Impl &m = *impl_;
    std::uint64_t until = m.core.state.cycles + 1;
    if (m.core.state.mode != Mode::running && !m.core.interrupted() && m.next_event() != never) {
        until = std::max(until, m.next_event());
    }
    return m.run(until, true);
}

StopReason Machine::run_to_instruction(std::uint64_t n, Ns limit)
{
    Impl &m = *impl_;
    const CpuState &s = m.core.state;
    const std::uint64_t last = m.cycles_at(limit);
    StopReason reason = StopReason::time;
    // An instruction costs at least a cycle, so none too many is executed.
    while (reason == StopReason::time && s.instructions < n && s.cycles < last) {
        const bool waits = s.mode != Mode::running && !m.core.interrupted();
        const std::uint64_t next = waits ? m.next_event() : s.cycles + (n - s.instructions);
        if (next == never) {
            break;
        }
        reason = m.run(std::min(last, next), m.at_breakpoint);
    }
    return reason;
}

void Machine::stop()
{
    impl_->stop_requested = true;
    impl_->core.attention = true;
}

Ns Machine::now() const
{
    return static_cast<Ns>(static_cast<unsigned __int128>(impl_->core.state.cycles) * ns_per_second /
                           impl_->board.clock);
}

std::uint64_t Machine::instructions() const
{
    return impl_->core.state.instructions;
}

std::uint64_t Machine::resets() const
{
    return impl_->resets;
}

std::uint64_t Machine::watchdog_resets() const
{
    std::uint64_t n = 0;
    for (const auto &device : impl_->devices) {
        const auto *timer = dynamic_cast<const Gptimer *>(device.get());
        n += timer ? timer->watchdog_resets() : 0;
    }
    return n;
}

Core &Machine::core()
{
    return impl_->core;
}

const Core &Machine::core() const
{
    return impl_->core;
}

SystemBus &Machine::bus()
{
    return impl_->bus;
}

void Machine::select(EngineKind engine)
{
    impl_->engine = make_engine(engine);
    impl_->bus.forget_code();
    for (const std::uint32_t address : impl_->core.breakpoints) {
        impl_->engine->set_breakpoint(impl_->core, address, true);
    }
}

void Machine::observe(Observer *observer)
{
    impl_->observer = observer;
    if (observer) {
        select(EngineKind::interpreter);
    }
}

std::shared_ptr<const Snapshot> Machine::snapshot()
{
    Impl &m = *impl_;
    const auto s = std::make_shared<Snapshot>();
    s->board = m.board.hash;
    s->cpu = m.core.state;
    s->resets = m.resets;
    s->boot = m.boot;
    s->flips = m.bus.flips();
    for (const auto &device : m.devices) {
        const auto state = device->state();
        s->devices.emplace_back(state.begin(), state.end());
    }
    s->pages = m.base->pages;
    for (const std::uint32_t index : m.bus.changed()) {
        std::shared_ptr<Snapshot::Page> page;
        if (const auto bytes = m.bus.page(index); !all_zero(bytes)) {
            page = std::make_shared<Snapshot::Page>();
            std::ranges::copy(bytes, page->begin());
        }
        s->pages[index] = std::move(page);
    }
    m.bus.all_unchanged();
    m.base = s;
    return s;
}

void Machine::restore(const Snapshot &snapshot)
{
    Impl &m = *impl_;
    bool fits = snapshot.board == m.board.hash && snapshot.devices.size() == m.devices.size() &&
                snapshot.pages.size() == m.bus.pages();
    for (std::size_t i = 0; fits && i < m.devices.size(); i++) {
        fits = snapshot.devices[i].size() == m.devices[i]->state().size();
    }
    if (!fits) {
        throw Error("the snapshot is of another board, or of other boards in its register space");
    }
    const auto copy = [&](std::uint32_t index) {
        const auto to = m.bus.page(index);
        if (const auto &page = snapshot.pages[index]) {
            std::ranges::copy(*page, to.begin());
        } else {
            std::ranges::fill(to, std::byte{0});
        }
        m.bus.page_changed(index);
    };
    const std::vector<std::uint32_t> changed = m.bus.changed();
    std::ranges::for_each(changed, copy);
    if (m.base.get() != &snapshot) {
        for (std::uint32_t i = 0; i < m.bus.pages(); i++) {
            if (m.base->pages[i] != snapshot.pages[i]) {
                copy(i);
            }
        }
        m.base = snapshot.shared_from_this();
    }
    m.bus.all_unchanged();
    m.bus.set_flips(snapshot.flips);
    m.core.state = snapshot.cpu;
    keep_possible(m.core.state);
    m.resets = snapshot.resets;
    m.boot = snapshot.boot;
    m.reset_requested = m.stop_requested = m.at_breakpoint = false;
    for (std::size_t i = 0; i < m.devices.size(); i++) {
        std::ranges::copy(snapshot.devices[i], m.devices[i]->state().begin());
        m.devices[i]->restored();
    }
    m.core.attention = false;
}

std::vector<std::byte> Machine::save()
{
    return snapshot()->write();
}

void Machine::load_snapshot(std::span<const std::byte> s)
{
    const auto snapshot = Snapshot::read(s, impl_->board.hash);
    if (impl_->boot && snapshot->boot && *impl_->boot != *snapshot->boot) {
        throw Error("the snapshot is of another program than the one that was loaded");
    }
    restore(*snapshot);
}

bool Machine::peek(std::uint32_t address, std::span<std::byte> bytes) const
{
    return impl_->bus.peek(address, bytes);
}

bool Machine::poke(std::uint32_t address, std::span<const std::byte> bytes)
{
    return impl_->bus.poke(address, bytes);
}

void Machine::set_breakpoint(std::uint32_t address, bool on)
{
    if (on && (address % 4 != 0 || impl_->bus.memory(address, 4).empty())) {
        char text[120];
        std::snprintf(text, sizeof text, "breakpoint: expected a multiple of 4 in RAM or ROM; found 0x%08x", address);
        throw Error(text);
    }
    impl_->engine->set_breakpoint(impl_->core, address, on);
}

void Machine::set_watchpoint(std::uint32_t address, std::uint32_t size, bool on_read, bool on_write, bool on)
{
    if (impl_->bus.memory(address, size).empty() || (!on_read && !on_write)) {
        char text[160];
        std::snprintf(text, sizeof text,
                      "watchpoint: expected reads or writes of bytes of RAM or ROM; found %s of %u bytes at 0x%08x",
                      on_read    ? "reads"
                      : on_write ? "writes"
                                 : "neither",
                      size, address);
        throw Error(text);
    }
    impl_->bus.watch(address, size, on_read, on_write, on);
}

Device *Machine::device(std::string_view name)
{
    const auto found = std::ranges::find_if(impl_->devices, [&](const auto &device) { return device->name() == name; });
    return found == impl_->devices.end() ? nullptr : found->get();
}

const std::vector<std::unique_ptr<Device>> &Machine::devices() const
{
    return impl_->devices;
}

std::string Machine::report(const Program *program) const
{
    return describe(*this, impl_->core, program);
}

} // namespace fledge::emulator
