// SPDX-License-Identifier: Apache-2.0
// An FMU that others made, for co-simulation: its library, loaded, and an instance that is stepped, whether it speaks
// FMI 2.0 or 3.0.
//
// Example:
//
//     double height_after_a_second(const importer::FmuFile &file)
//     {
//         const auto fmu = importer::load(file, "ball");
//         fmu->initialize(0.0);
//         fmu->begin();
//         fmu->step_to(1.0);
//         const std::uint32_t reference = 1;
//         double height = 0.0;
//         fmu->get(importer::Kind::F64, std::span(&reference, 1), &height, 1);
//         return height;
//     }
#pragma once

#include "flight/exec/element.h"
#include "sim/crash.h"
#include "sim/error.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace fledge::importer {

/// What the importer needs of a model description, and where the FMU was unpacked.
struct FmuFile {
    std::string file;      ///< "ball.fmu", for messages
    std::string library;   ///< the path of the library for this system
    std::string resources; ///< the path of the folder
    std::string token;     ///< instantiationToken, or guid
    int version = 3;       ///< 2 or 3
    bool event_mode = false;
    bool saves = false;                  ///< its state can be had, set and made bytes of
    bool single = false;                 ///< there may be a single instance in a program
    std::vector<std::uint32_t> clocks{}; ///< output clocks, which are counted
};

/// The types of variables: numbers as of FledgeType.
enum class Kind { F64, F32, I8, U8, I16, U16, I32, U32, I64, U64, TEXT, ENUMERATION, BOOLEAN };

/// An instance. Functions that fail throw RunError, which begins with its name and file, and ends with what it logged.
class Fmu {
public:
    virtual ~Fmu() = default;

    /// As what get() and set() carry values of a kind.
    virtual FledgeType carried(Kind kind) const = 0;
    /// n elements, behind one another, of the variables with these references.
    virtual void get(Kind kind, std::span<const std::uint32_t> references, void *values, std::size_t n) = 0;
    virtual void set(Kind kind, std::span<const std::uint32_t> references, const void *values, std::size_t n) = 0;
    virtual std::string text(std::uint32_t reference) = 0;
    virtual void set_text(std::uint32_t reference, const char *text) = 0;

    /// Enter initialization mode, at this time [s], with the values set so far as starts.
    virtual void initialize(double start) = 0;
    /// Leave it: the instant of the start is over.
    virtual void begin() = 0;
    /// Advance to a time [s], by shorter steps where the FMU wants them.
    void step_to(double end);
    /// Before discrete inputs and parameters are set, and after that; nothing without event mode.
    virtual void open_event() {}
    virtual void close_event() {}
    /// As new, for other starts and initialize().
    virtual void reset() = 0;

    /// The bytes of its state, and back to it.
    virtual std::vector<std::byte> save() = 0;
    virtual void restore(std::span<const std::byte> bytes) = 0;

    bool dead() const { return dead_; }   ///< it has had a fatal error
    double time() const { return time_; } ///< [s] the communication point that it has reached
    void set_time(double time) { time_ = time; }
    std::vector<std::uint32_t> ticks; ///< how often each of FmuFile::clocks ticked

protected:
    Fmu(const FmuFile &file, std::string name);

    /// One step from time(); time_ becomes what was reached. Returns whether the FMU refused so long a step.
    virtual bool step(double size) = 0;

    /// A function of the library.
    template <class F> class Function {
    public:
        Function(const Fmu &of, const char *name, bool needed = true)
            : name_(name), fmu_(of.file_.file.c_str()), f_(reinterpret_cast<F *>(of.symbol(name, needed)))
        {
        }
        template <class... A> auto operator()(A... arguments) const
        {
            const sim::Inside inside(name_, fmu_);
            return f_(arguments...);
        }
        const char *name() const { return name_; }

    private:
        const char *name_, *fmu_;
        F *f_;
    };

    /// Call it and throw RunError if it fails; returns false if it discards.
    template <class F, class... A> bool call(const Function<F> &f, A... arguments)
    {
        const int status = static_cast<int>(f(arguments...));
        if (status < 0 || status > discard) {
            dead_ |= status != error;
            fail(f.name(), status == error   ? "an error"
                           : status == fatal ? "a fatal error"
                                             : "status " + std::to_string(status) +
                                                   "; known are OK (0), warning, discard, error and fatal (4)");
        }
        return status != discard;
    }
    /// The same for what may not discard.
    template <class F, class... A> void need(const Function<F> &f, A... arguments)
    {
        if (!call(f, arguments...)) {
            fail(f.name(), "discard");
        }
    }

    /// save() and restore() by the functions of a version.
    template <class Byte, class Get, class Size, class Serialize, class Free>
    std::vector<std::byte> saved_by(void *instance, const Get &get, const Size &size, const Serialize &serialize,
                                    const Free &free)
    {
        void *state = nullptr;
        need(get, instance, &state);
        std::size_t n = 0;
        need(size, instance, state, &n);
        if (n > most_state) {
            fail(size.name(), "a state of " + std::to_string(n) + " bytes");
        }
        std::vector<std::byte> bytes(n);
        need(serialize, instance, state, reinterpret_cast<Byte *>(bytes.data()), n);
        need(free, instance, &state);
        return bytes;
    }
    template <class Byte, class Deserialize, class Set, class Free>
    void restore_by(void *instance, std::span<const std::byte> bytes, const Deserialize &deserialize, const Set &set,
                    const Free &free)
    {
        void *state = nullptr;
        need(deserialize, instance, reinterpret_cast<const Byte *>(bytes.data()), bytes.size(), &state);
        need(set, instance, state);
        need(free, instance, &state);
    }

    void *symbol(const char *function, bool needed) const; ///< throws SetupError
    [[noreturn]] void no_instance(const char *function) const;
    void check_version(const char *function, const char *found) const;
    [[noreturn]] void fail(const char *function, const std::string &answer);
    [[noreturn]] void terminate(); ///< the FMU has ended the simulation
    void log(int status, const char *text);
    std::string logged() const;

    static constexpr int discard = 2, error = 3, fatal = 4;
    static constexpr std::size_t most_state = std::size_t{1} << 30; ///< [bytes]
    FmuFile file_;
    std::string name_;
    double time_ = 0.0;
    bool dead_ = false; ///< after a fatal error no function may be called

private:
    std::shared_ptr<void> library_;
    std::shared_ptr<void> only_; ///< of what may have one instance
    std::string lines_;          ///< of the log, the last ones
};

/// A new instance. Throws SetupError.
std::unique_ptr<Fmu> load(const FmuFile &file, const std::string &name);

} // namespace fledge::importer
