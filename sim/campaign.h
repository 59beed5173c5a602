// SPDX-License-Identifier: Apache-2.0
// Dispersed runs of one simulation: each differs in its parameters and in its random streams.
//
// A run is fixed by (seed, index) alone: which thread flies it, how many there are and in what order
// they finish changes no bit of it. Each thread flies a clone of its own, so nothing is shared.
#pragma once

#include "sim/judge.h"
#include "sim/simulation.h"

#include <atomic>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fledge::sim {

/// Where a run has no number: it was not flown, or drew none.
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

/// The distribution of a parameter. Numbers are SI.
struct Distribution {
    enum class Kind {
        uniform,  ///< between a and b
        normal,   ///< mean a, standard deviation b; cut to [lo, hi]
        attitude, ///< of an MRP vector: uniform over all attitudes
        choice,   ///< one of `choices`, each with equal probability
        grid,     ///< of the run's point: the next of `choices` after every `stride` points, from the first again
    };
    Kind kind = Kind::uniform;
    double a = 0.0, b = 0.0;
    double lo, hi;         ///< of a normal distribution: draws outside are repeated
    bool relative = false; ///< a and b (lo, hi) are factors of the nominal value
    bool about = false;    ///< a and b (lo, hi) are added to the nominal value
    std::vector<double> choices;
    std::size_t stride = 1;

    Distribution();
};

/// A parameter that differs from run to run, or some of its elements. Each element has a random stream of its own. An
/// inertia stays symmetric: a draw sets an element and its mirror image. Of whole numbers, uniform() gives each one
/// between its ends the same probability, and others are rounded.
struct Dispersion {
    std::string path; ///< "world.craft.I_B", "flight.camera.parts[2].phase"
    std::vector<std::size_t> elements;
    Distribution distribution;
};

/// Numbers that are drawn together, and of which a function makes parameters: the elements of an orbit, and its state;
/// or commands: which, and when.
struct Composition {
    /// Its path names its random stream and its column.
    struct Number {
        std::string path;
        double nominal = 0.0;
        Distribution distribution;
    };
    std::vector<Number> numbers;
    std::vector<std::string> parameters; ///< "world.craft.r_BN_N"; all elements of each
    /// The elements of the parameters, one after the other. Throws SetupError. Many threads call it.
    std::function<std::vector<double>(const std::vector<double> &)> values;
    std::string process; ///< that gets the commands besides its script; "": none does
    /// In place of values. Throws SetupError. Many threads call it.
    std::function<std::vector<ScriptedCommand>(const std::vector<double> &)> commands;
};

/// What the result retains at each sample: a field of a message, numbers of a packet, or whether something happened, an
/// event, a command or a packet, since the sample before.
struct Retained {
    std::string port;         ///< "flight.tracking.error"
    std::uint32_t offset = 0; ///< of the field, bytes from the start of the message
    std::size_t elements = 1;
    FledgeType type = FLEDGE_F64;
    bool raw = false; ///< also the zeros of messages that were never written, whose samples are NaN otherwise
    enum class Kind { field, numbers, happened } kind = Kind::field;
};

/// Makes a judge that keeps traces look at a simulation, as often as the plan retains samples. Returns it, and of each
/// Retained that is no field, in their order, the atoms whose traces are its elements.
using Watched = std::pair<std::shared_ptr<Judge>, std::vector<std::vector<int>>>;
using Watch = std::function<Watched(Simulation *)>;

struct CampaignPlan {
    std::uint64_t seed = 0;
    std::size_t first = 0, runs = 0; ///< indices first, first + 1, ...
    std::size_t points = 1;          ///< of a grid, each of which flies once before any flies again: the index of a run
                                     ///< is its point, plus `points` times the index of its draws and random streams
    Ns duration = 0;
    Ns every = 0; ///< between retained samples, > 0
    std::vector<Dispersion> dispersions;
    std::vector<Composition> compositions; ///< their draws follow those of the dispersions
    std::vector<Retained> retained;
};

struct CampaignResult {
    std::size_t samples = 0;                  ///< at 0, every, 2 every, ...
    std::vector<std::uint8_t> flown;          ///< by run: 0 if the campaign was stopped before its end
    std::vector<std::string> failures;        ///< by run; "" if it flew to its end
    std::vector<std::vector<Finding>> health; ///< by run: Simulation::health() at its end
    std::vector<double> draws;                ///< by run, then by dispersed element; NaN if not flown
    std::vector<double> entered; ///< [s] by run, then as mode_names(): when the mode first began; NaN: it did not
    /// By run: how often, up to 255, one mode followed another, each event fired, and, in the build that counts them,
    /// each edge of flight code's branches was taken.
    std::vector<std::uint8_t> seen;
    /// By variable: run, sample, element; NaN if not flown, after a failure, or where the message was never written.
    /// Between two instants a sample is that of the first.
    std::vector<std::vector<double>> retained;
};

/// The progress of a campaign.
struct CampaignProgress {
    std::size_t finished = 0; ///< runs, failed ones included
    std::size_t failed = 0;
};

/// The events and modules that have a callable. Callables may share data, so threads must not fly such runs.
/// sharing: only those that may
std::vector<std::string> callables(const Simulation &simulation, bool sharing = false);

/// Throws SetupError on a path that is no dispersible parameter (with the valid ones), elements
/// outside it, or a distribution that cannot keep the parameter's own rule: a bounded one must lie
/// within it, any other must reach into it.
void check_dispersion(const Simulation &nominal, const Dispersion &dispersion);

/// Throws SetupError unless a composition can set its parameters, nominally too.
void check_composition(const Simulation &nominal, const Composition &composition);

/// Throws SetupError on a port that is not there, or a field outside its message.
void check_retained(const Simulation &nominal, const Retained &variable);

/// All of these for a plan, which must have runs and disperse no element twice.
void check_plan(const Simulation &nominal, const CampaignPlan &plan);

/// "flight.mode.SAFE" of each mode of each process that has several.
std::vector<std::string> mode_names(const Simulation &simulation);

/// How many numbers of each run are drawn.
std::size_t dispersed_elements(const CampaignPlan &plan);

/// Bring a clone that may have run back to before its run, with the nominal parameters: events, commands and the caller
/// may have changed some.
void begin_anew(const Simulation &nominal, Simulation &clone);

/// Set the parameters and the seed of one run in a simulation that has not run yet. `nominal` has the nominal values
/// and does not change. Returns the draws.
std::vector<double> disperse(const Simulation &nominal, Simulation &simulation, const CampaignPlan &plan,
                             std::size_t index);

/// Fly one run in a simulation that has not run yet and has the nominal values, which the run overwrites. Use it for
/// simulations that cannot be cloned, and that the caller builds again for each run.
CampaignResult fly_one(Simulation &simulation, CampaignPlan plan, std::size_t index, const Watch &watch = {});

/// Fly all runs on this many threads. The calling thread calls `progress` about ten times a second; it must not
/// throw. If it returns false, the campaign stops and keeps the finished runs. An exception in a run makes only that
/// run fail. The calling thread also calls `watch`, once for each thread, before the first run.
CampaignResult fly(const Simulation &nominal, const CampaignPlan &plan, unsigned threads,
                   const std::function<bool(CampaignProgress)> &progress = {}, const Watch &watch = {});

} // namespace fledge::sim
