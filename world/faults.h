// SPDX-License-Identifier: Apache-2.0
// The faults of a sensor or an actuator: what its parameters plan, and what a message injects.
//
// A model has the input `FaultSet injected`, the parameters `n_faults` and `faults`, and a Faults<channels> in its
// memory(). At each update it calls begin(); then add() where biases and drifts act, and replace() on what the channels
// give. What is replaced may exceed the limits of a channel by a bias: the model limits it.
#pragma once

#include "sim/random.h"
#include "world/delay.h"
#include "world/msg/fault.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>

namespace fledge::world {

inline constexpr double unlimited = std::numeric_limits<double>::infinity();

/// Throws SetupError that begins with name.faults if a planned fault makes no sense. limited: every channel has limits.
void check_faults(const std::string &name, std::span<const Fault> faults, std::size_t channels, bool limited);

template <std::size_t channels> class Faults {
    static_assert(channels <= 32);

public:
    /// seeded: the stream of the model, from which the faults have one of their own.
    void reset(sim::Random seeded)
    {
        *this = {};
        reseed(seeded);
    }

    /// That stream begins anew; the rest stays.
    void reseed(sim::Random seeded)
    {
        random_ = sim::Random({seeded.bits(), seeded.bits(), seeded.bits(), seeded.bits()});
    }

    /// Choose what acts at time t. Returns whether there is any fault, now or at another time.
    bool begin(sim::Ns t, std::uint32_t n, const Fault *planned, const FaultSet &injected)
    {
        const bool any = n > 0 || head_written(injected.head);
        if (any_ && !any) {
            known_ = 0;
            past_.clear();
        }
        any_ = any;
        acting_ = 0;
        if (!any) {
            return false;
        }
        t_ = t;
        delay_ = 0;
        take({planned, n});
        if (head_written(injected.head)) {
            take({injected.list, std::min<std::size_t>(injected.n, FAULTS_MAX)});
        }
        if (delay_ > 0) {
            past_.open(t, delay_);
        } else {
            past_.clear();
        }
        return true;
    }

    /// Whether there is any fault, now or at another time.
    bool any() const { return any_; }

    /// Biases and drifts of the channels first, first + 1, ... are added to x.
    void add(std::size_t first, std::span<double> x) const
    {
        for (const Fault &fault : acting()) {
            const double size = fault.kind == FAULT_BIAS    ? fault.size
                                : fault.kind == FAULT_DRIFT ? fault.size * tick_seconds(tick_since(t_, fault.begin))
                                                            : 0.0;
            for (std::size_t i = 0; i < x.size(); i++) {
                x[i] += of(fault, first + i) ? size : 0.0;
            }
        }
    }

    /// All other faults act on x, the values of the channels first, first + 1, ... Returns whether any of them speaks:
    /// where all are dead or dropped out, a sensor with a message writes none.
    bool replace(std::size_t first, std::span<double> x, double low = -unlimited, double high = unlimited)
    {
        if (!any_) {
            return true;
        }
        if (delay_ > 0 && past_.opened()) {
            std::copy(x.begin(), x.end(), past_.newest().begin() + first);
        }
        std::size_t speaking = x.size();
        for (std::size_t i = 0; i < x.size(); i++) {
            const std::size_t channel = first + i;
            bool speaks = true;
            for (const Fault &fault : acting()) {
                if (!of(fault, channel) || fault.kind == FAULT_BIAS || fault.kind == FAULT_DRIFT) {
                    continue;
                }
                const double top = std::isfinite(high) ? high : fault.size;
                const double bottom = std::isfinite(low) ? low : -fault.size;
                speaks = fault.kind != FAULT_DROPOUT && fault.kind != FAULT_DEAD;
                switch (fault.kind) {
                case FAULT_HIGH: x[i] = top; break;
                case FAULT_LOW: x[i] = bottom; break;
                case FAULT_BABBLE: x[i] = bottom + (top - bottom) * random_.uniform(); break;
                case FAULT_DROPOUT: x[i] = known_ >> channel & 1 ? last_[channel] : x[i]; break;
                case FAULT_DELAY: x[i] = past_.before(t_ - delay_of(fault))[channel]; break;
                default: x[i] = 0.0;
                }
            }
            speaking -= !speaks;
            last_[channel] = x[i];
            known_ |= 1u << channel;
        }
        return speaking > 0;
    }

    bool apply(std::size_t first, std::span<double> x, double low = -unlimited, double high = unlimited)
    {
        add(first, x);
        return replace(first, x, low, high);
    }

private:
    static bool of(const Fault &fault, std::size_t channel)
    {
        return fault.channels == 0 || (fault.channels >> channel & 1);
    }
    static sim::Ns delay_of(const Fault &fault) { return static_cast<sim::Ns>(std::clamp(fault.size, 0.0, 1e9) * 1e9); }

    /// Copy those that act now. A drop-out draws once for all its channels. A message may hold anything.
    void take(std::span<const Fault> faults)
    {
        for (const Fault &fault : faults) {
            std::int32_t kind;
            std::memcpy(&kind, &fault.kind, sizeof kind);
            const bool known = kind > FAULT_NONE && kind <= FAULT_DEAD && std::abs(fault.size) <= 1e100 &&
                               (kind != FAULT_DELAY || delay_of(fault) > 0);
            const std::int64_t age = tick_since(t_, fault.begin);
            if (!known || t_ < fault.begin || (fault.lasts != 0 && age >= fault.lasts)) {
                continue;
            }
            if (kind == FAULT_DROPOUT && fault.size != 0.0 && random_.uniform() >= fault.size) {
                continue;
            }
            delay_ = kind == FAULT_DELAY ? std::max(delay_, delay_of(fault)) : delay_;
            acting_list_[acting_++] = fault;
        }
    }
    std::span<const Fault> acting() const { return {acting_list_.data(), acting_}; }

    sim::Random random_;
    std::array<Fault, 2 * FAULTS_MAX> acting_list_{};
    std::uint64_t acting_ = 0; ///< of the list
    sim::Ns t_ = 0;
    sim::Ns delay_ = 0;       ///< the longest
    std::uint32_t any_ = 0;   ///< there are faults, now or at another time
    std::uint32_t known_ = 0; ///< channels with a last value, a bit for each
    std::array<double, channels> last_{};
    Delay<std::array<double, channels>> past_;
};

} // namespace fledge::world
