// SPDX-License-Identifier: Apache-2.0
// Judges formulas of signal temporal logic on numbers of messages, modes and events: while a simulation runs, as a
// watcher of its recorder, or on samples that the caller gives. Each expression and comparison is computed once a
// sample, however many formulas have it.
#pragma once

#include "sim/carrier.h"
#include "sim/recorder.h"
#include "sim/temporal.h"

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace fledge::sim {

struct Event;
class Process;

class Judge : public Watcher {
public:
    /// What an expression computes, of its operands a and b.
    enum Operation {
        SOURCE,   ///< the numbers of a source, whose number is a
        CONSTANT, ///< numbers that do not change: constant()
        ELEMENT,  ///< of a, at the place b
        NORM,
        MAX_ABS,
        MAGNITUDE, ///< of each element
        SUM,
        DIFFERENCE,
        SCALED, ///< a times the number
        ANGLE,  ///< [rad] between two vectors
        TURNED, ///< the vector b, in the frame to which the attitude a (MRP) turns its own
    };
    enum Relation { LESS, LESS_EQUAL, GREATER, GREATER_EQUAL, EQUAL, NOT_EQUAL };

    // ---- build; each returns a number, from 0. Throw std::invalid_argument on operands that do not fit.

    /// Numbers of a message, read at each sample. No head: of no message that has a quality. A message that was never
    /// written, or is stale, gives NaN, which is unknown.
    int source(std::shared_ptr<Instance> instance, std::uint32_t offset, FledgeType type, std::size_t elements,
               std::optional<std::uint32_t> head);
    /// 1 at a sample up to which an event has fired since the sample before; else 0.
    int source(const Process &process, std::shared_ptr<const Event> event);
    /// The same of what became of commands: executed, accepted, or refused at either time. code: -1: of any.
    enum Became { ACCEPTED, EXECUTED, REFUSED };
    int source(const Recorder &recorder, const Process &process, int code, Became became);
    /// The same of packets of a stream of telemetry.
    int source(Process &process, std::uint16_t stream);
    /// Numbers of the newest packet of a stream, `offset` bytes from its beginning, big-endian; before the first packet
    /// they are unknown. head: as above, in the packet.
    int source(Process &process, std::uint16_t stream, std::uint32_t offset, FledgeType type, std::size_t elements,
               std::optional<std::uint32_t> head);
    /// Numbers that the caller gives.
    int source(std::size_t elements);
    int constant(std::span<const double> numbers);
    int expression(Operation operation, int a, int b = -1, double number = 0.0);
    /// value, an expression of one number, against a limit; the robustness is divided by the scale.
    int atom(int value, Relation relation, double limit, double scale);
    int formula(const std::vector<FormulaNode> &nodes);

    // ---- judge

    bool stops = false;  ///< end the run at the first violation: no sample waits
    bool traces = false; ///< keep what the atoms' expressions were
    void take(Ns t) override;
    void rewind(Ns now) override;
    bool is_early(const std::function<bool(const Instance &)> &waits) const override;
    /// Samples at these times: of each source its elements, one row a sample.
    void play(std::span<const Ns> times, const std::vector<std::span<const double>> &sources);
    void finish(Ns t);

    Robustness value(int formula);
    bool went_back() const { return went_back_; } ///< the simulation did, so that nothing is known
    const std::vector<Ns> &times();
    std::vector<double> trace(int atom); ///< by times()

private:
    struct Source {
        std::shared_ptr<Instance> instance;
        const Process *process = nullptr;
        std::shared_ptr<const Event> event;
        std::uint32_t offset = 0;
        FledgeType type = FLEDGE_F64;
        std::size_t elements = 1, at = 0; ///< at: its first row of columns_
        std::optional<std::uint32_t> head;
        std::uint64_t fired = 0; ///< so far; of commands how many rows of the log, of packets their count
        const Recorder *recorder = nullptr;
        int code = -1;
        Became became = EXECUTED;
        std::shared_ptr<const Log> log; ///< of what happened in the process, once something has
        std::shared_ptr<Newest> packet;
        std::vector<double> numbers; ///< of the packet; none: whether it was sent counts
    };
    struct Expression {
        Operation operation = SOURCE;
        std::size_t a = 0, b = 0; ///< the first rows of the operands
        std::size_t elements = 1, at = 0;
        double number = 0.0;
        bool compared = false;    ///< an atom has it
        std::int64_t unknown = 0; ///< of such an one: a number of the block is, or one was in its place
    };
    struct Atom {
        std::size_t expression;
        Relation relation;
        double limit, scale;
    };

    std::size_t rows(std::size_t elements); ///< more of columns_
    int add(Source source);
    void read(Source &source);
    bool became(Source &source) const;
    static void read_packet(Source &source, double *to);
    void compute_all(); ///< columns_ and margins_
    void compute(Expression &expression);
    void compare(const Atom &atom, double *to);
    void judge();
    void forget();
    double *row(std::size_t at) { return columns_.data() + at * Instants::most; }

    std::vector<Source> sources_;
    std::vector<Expression> expressions_;
    std::vector<Atom> atoms_;
    TemporalMonitor formulas_;
    std::vector<double> columns_; ///< of each number a row of the samples that wait
    std::vector<double> margins_; ///< of each atom
    std::vector<unsigned char> unknown_;
    std::array<Ns, Instants::most> waiting_{};
    std::size_t count_ = 0; ///< how many wait
    std::vector<Ns> times_;
    std::vector<double> traces_;
    Ns last_ = -1;
    bool went_back_ = false;
};

} // namespace fledge::sim
