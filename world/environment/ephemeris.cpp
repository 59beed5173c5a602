// SPDX-License-Identifier: Apache-2.0
#include "world/environment/ephemeris.h"

#include "sim/error.h"
#include "sim/text.h"
#include "world/environment/bodies.h"
#include "world/environment/de405.h"
#include "world/environment/spk.h"
#include "world/environment/spk_types.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace fledge::world {

using Eigen::Vector3d;

namespace {

/// sum_k c_k T_k(x) and its first derivatives with respect to x, by Clenshaw's recurrence
/// b_k = c_k + 2 x b_{k+1} - b_{k+2} and the derivatives of that.
template <int derivatives> inline void chebyshev(const double *c, int n, double x, double *value)
{
    const double x2 = 2.0 * x;
    double b1 = 0.0, b2 = 0.0, d1 = 0.0, d2 = 0.0, e1 = 0.0, e2 = 0.0;
    for (int k = n - 1; k > 0; k--) {
        if constexpr (derivatives > 1) {
            const double e = (4.0 * d1 - e2) + x2 * e1;
            e2 = e1;
            e1 = e;
        }
        if constexpr (derivatives > 0) {
            const double d = (2.0 * b1 - d2) + x2 * d1;
            d2 = d1;
            d1 = d;
        }
        const double b = (c[k] - b2) + x2 * b1;
        b2 = b1;
        b1 = b;
    }
    value[0] = (c[0] - b2) + x * b1;
    if constexpr (derivatives > 0) {
        value[1] = (b1 - d2) + x * d1;
    }
    if constexpr (derivatives > 1) {
        value[2] = (2.0 * d1 - e2) + x * e1;
    }
}

const double *record_at(const EphemerisSegment &s, const Instant &t)
{
    const double at = std::floor(t.since(s.start) / s.length);
    const double last = static_cast<double>(s.count - 1);
    return s.records + static_cast<std::size_t>(std::clamp(at, 0.0, last)) * s.record_words;
}

void add_any(const EphemerisSegment &s, const Instant &t, double sign, BodyState &state);

/// Adds sign times the position [km].
void add_position(const EphemerisSegment &s, const Instant &t, double sign, Vector3d &r)
{
    if (!s.is_plain()) {
        BodyState state{r, r, r};
        add_any(s, t, sign, state);
        r = state.r;
        return;
    }
    const double *record = record_at(s, t);
    const double x = t.since(record[0]) / record[1];
    for (int i = 0; i < 3; i++) {
        double value;
        chebyshev<0>(record + 2 + i * s.coefficients, s.coefficients, x, &value);
        r[i] += sign * value;
    }
}

/// Adds sign times the state [km, km/s, km/s^2] of Chebyshev polynomials, in their axes.
void add_polynomials(const EphemerisSegment &s, const Instant &t, double sign, BodyState &state)
{
    const double *record = record_at(s, t);
    const double rate = 1.0 / record[1];
    const double x = t.since(record[0]) / record[1];
    const int n = s.coefficients;
    for (int i = 0; i < 3; i++) {
        double r[3], v[3];
        if (s.has_velocity) {
            chebyshev<0>(record + 2 + i * n, n, x, r);
            chebyshev<1>(record + 2 + (3 + i) * n, n, x, v);
            state.v[i] += sign * v[0];
            state.a[i] += sign * (v[1] * rate);
        } else {
            chebyshev<2>(record + 2 + i * n, n, x, r);
            state.v[i] += sign * (r[1] * rate);
            state.a[i] += sign * (r[2] * (rate * rate));
        }
        state.r[i] += sign * r[0];
    }
}

/// Adds sign times the state, by any method, in the axes of the ICRF.
void add_any(const EphemerisSegment &s, const Instant &t, double sign, BodyState &state)
{
    BodyState own{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    if (s.method == EphemerisSegment::Method::chebyshev) {
        add_polynomials(s, t, 1.0, own);
    } else {
        own = state_between(s, t);
    }
    for (auto member : {&BodyState::r, &BodyState::v, &BodyState::a}) {
        state.*member += sign * (s.dcm_NF * own.*member);
    }
}

void add_state(const EphemerisSegment &s, const Instant &t, double sign, BodyState &state)
{
    if (s.is_plain()) {
        add_polynomials(s, t, sign, state);
    } else {
        add_any(s, t, sign, state);
    }
}

/// The barycentre of its system for a planet whose moons hardly move it, else -1.
int stand_in(int body)
{
    return body == 199 || body == 299 || body == 499 ? body / 100 : -1;
}

/// "... TDB to ... TDB in FILE": segments of one file that join count as one; of many, lists the first
/// few.
std::string spans_text(std::vector<const EphemerisSegment *> segments)
{
    std::stable_sort(segments.begin(), segments.end(), [](auto *a, auto *b) { return a->first < b->first; });
    std::vector<std::string> spans;
    for (std::size_t i = 0; i < segments.size();) {
        const std::size_t begin = i;
        double last = segments[i]->last;
        for (i++; i < segments.size() && segments[i]->first <= last && segments[i]->file == segments[begin]->file;
             i++) {
            last = std::max(last, segments[i]->last);
        }
        if (spans.size() == 6) {
            spans.push_back("so on");
            break;
        }
        spans.push_back(format_tdb(segments[begin]->first) + " to " + format_tdb(last) + " in " +
                        segments[begin]->file);
    }
    return sim::format_list(spans);
}

} // namespace

void Librations::angles(Epoch epoch, double tau, double *angles, double *rates) const
{
    BodyState state{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    add_state(segment, Instant(epoch, tau), 1.0, state);
    for (int i = 0; i < 3; i++) {
        angles[i] = state.r[i];
        rates[i] = state.v[i];
    }
}

void Librations::require(Epoch from, Epoch to) const
{
    for (const Epoch &epoch : {from, to}) {
        if (!(epoch.seconds() >= segment.first && epoch.seconds() <= segment.last)) {
            throw sim::SetupError("the librations of the Moon are given from " + spans_text({&segment}) +
                                  "; asked for at " + format_tdb(epoch.seconds()));
        }
    }
}

/// From a body to the next one up the tree.
struct Ephemeris::Step {
    int up = -1;                                            ///< -1: there is none
    const EphemerisSegment *segment = nullptr;              ///< null: `up` stands in for the body
    double from = -std::numeric_limits<double>::infinity(); ///< it is this segment
    double to = std::numeric_limits<double>::infinity();    ///< from, to
};

void Ephemeris::add_spk(const std::string &path)
{
    auto spk = read_spk(path);
    add(std::move(spk.segments), std::move(spk.memory));
}

void Ephemeris::add_de405(const std::string &folder)
{
    auto de405 = read_de405(folder);
    add(std::move(de405.segments), std::move(de405.memory));
}

void Ephemeris::add(std::vector<EphemerisSegment> segments, std::shared_ptr<const void> memory)
{
    for (EphemerisSegment &segment : segments) {
        if (files_.empty() || files_.back() != segment.file) {
            files_.push_back(segment.file);
        }
        segments_.push_back(std::move(segment));
        of_body_[segments_.back().target].push_back(&segments_.back());
    }
    memory_.push_back(std::move(memory));
}

Ephemeris::Step Ephemeris::step_up(int body, double t) const
{
    Step step;
    const auto found = of_body_.find(body);
    if (found == of_body_.end()) {
        step.up = stand_in(body);
        return step;
    }
    const auto &segments = found->second;
    for (auto it = segments.rbegin(); it != segments.rend(); ++it) {
        const EphemerisSegment &s = **it;
        if (s.first <= t && t <= s.last) {
            step.up = s.center;
            step.segment = &s;
            step.from = std::max(step.from, s.first);
            step.to = std::min(step.to, s.last);
            return step;
        }
        // A segment of higher rank that begins later or ended earlier: this way is valid up to its limit.
        if (s.last < t) {
            step.from = std::max(step.from, std::nextafter(s.last, t));
        } else {
            step.to = std::min(step.to, std::nextafter(s.first, t));
        }
    }
    return step;
}

bool Ephemeris::find_way(int target, int center, double t, Cursor &cursor) const
{
    struct Node {
        int body;
        Step step;
    };
    Node ways[2][Cursor::most];
    int lengths[2];
    for (int i = 0; i < 2; i++) {
        int body = i == 0 ? target : center;
        int n = 0;
        while (n < Cursor::most) {
            ways[i][n] = {body, step_up(body, t)};
            body = ways[i][n++].step.up;
            if (body < 0) {
                break;
            }
        }
        lengths[i] = n;
    }
    for (int i = 0; i < lengths[0]; i++) {
        for (int j = 0; j < lengths[1]; j++) {
            if (ways[0][i].body != ways[1][j].body) {
                continue;
            }
            cursor.target = target;
            cursor.center = center;
            cursor.count = 0;
            cursor.from = -std::numeric_limits<double>::infinity();
            cursor.to = std::numeric_limits<double>::infinity();
            for (int k = 0; k < 2; k++) {
                for (int l = 0; l < (k == 0 ? i : j); l++) {
                    const Step &step = ways[k][l].step;
                    cursor.from = std::max(cursor.from, step.from);
                    cursor.to = std::min(cursor.to, step.to);
                    if (step.segment) {
                        if (cursor.count == Cursor::most) {
                            return false;
                        }
                        cursor.legs[cursor.count++] = {step.segment, k == 0 ? 1.0 : -1.0};
                    }
                }
            }
            return true;
        }
    }
    return false;
}

const Ephemeris::Cursor &Ephemeris::way(int target, int center, double t, Cursor &cursor) const
{
    if (!(cursor.target == target && cursor.center == center && cursor.from <= t && t <= cursor.to) &&
        !find_way(target, center, t, cursor)) {
        cursor = {};
        throw sim::SetupError(why_not(target, center, t, "at " + format_tdb(t)));
    }
    return cursor;
}

Vector3d Ephemeris::position(int target, int center, Epoch epoch, double tau, Cursor &cursor) const
{
    const Instant t(epoch, tau);
    const Cursor &route = way(target, center, t.total(), cursor);
    Vector3d r(0, 0, 0);
    for (int i = 0; i < route.count; i++) {
        add_position(*route.legs[i].segment, t, route.legs[i].sign, r);
    }
    return r * 1e3;
}

BodyState Ephemeris::state(int target, int center, Epoch epoch, double tau, Cursor &cursor) const
{
    const Instant t(epoch, tau);
    const Cursor &route = way(target, center, t.total(), cursor);
    BodyState state{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    for (int i = 0; i < route.count; i++) {
        add_state(*route.legs[i].segment, t, route.legs[i].sign, state);
    }
    state.r *= 1e3;
    state.v *= 1e3;
    state.a *= 1e3;
    return state;
}

BodyState Ephemeris::state(int target, int center, Epoch epoch) const
{
    Cursor cursor;
    return state(target, center, epoch, 0.0, cursor);
}

/// The first instant without a way, or NaN.
double Ephemeris::first_gap(int target, int center, Epoch from, Epoch to) const
{
    const double end = to.seconds();
    double t = from.seconds();
    Cursor cursor;
    for (;;) {
        if (!find_way(target, center, t, cursor)) {
            return t;
        }
        if (cursor.to >= end) {
            return std::numeric_limits<double>::quiet_NaN();
        }
        t = std::nextafter(cursor.to, end);
    }
}

bool Ephemeris::covers(int target, int center, Epoch from, Epoch to) const
{
    return std::isnan(first_gap(target, center, from, to));
}

void Ephemeris::require(int target, int center, Epoch from, Epoch to) const
{
    const double gap = first_gap(target, center, from, to);
    if (!std::isnan(gap)) {
        throw sim::SetupError(why_not(target, center, gap,
                                      from == to
                                          ? "at " + format_tdb(gap)
                                          : "from " + format_tdb(from.seconds()) + " to " + format_tdb(to.seconds())));
    }
}

std::vector<int> Ephemeris::bodies() const
{
    std::set<int> all;
    for (const EphemerisSegment &s : segments_) {
        all.insert({s.target, s.center});
    }
    return {all.begin(), all.end()};
}

std::string Ephemeris::why_not(int target, int center, double t, const std::string &when) const
{
    const std::string request = "; asked for " + body_name(target) + " relative to " + body_name(center) + " " + when;
    if (segments_.empty()) {
        return "ephemeris: no file was added" + request;
    }
    const std::string files = sim::format_list(files_);
    const std::vector<int> known = bodies();
    int roots[2];
    for (int i = 0; i < 2; i++) {
        int body = i == 0 ? target : center;
        const int barycentre = body > 100 && body < 1000 && body % 100 == 99 ? body / 100 : -1;
        if (!std::binary_search(known.begin(), known.end(), body) &&
            !std::binary_search(known.begin(), known.end(), stand_in(body))) {
            std::vector<std::string> names;
            names.reserve(known.size());
            for (const int id : known) {
                names.push_back(body_name(id));
            }
            std::string text = files + ": no " + body_name(body) + request;
            if (std::binary_search(known.begin(), known.end(), barycentre)) {
                text += ". The barycentre of its system is there: " + body_name(barycentre);
            }
            return text + ". There are " + sim::format_list(names);
        }
        for (int n = 0; n < Cursor::most; n++) {
            const int up = step_up(body, t).up;
            if (up < 0) {
                break;
            }
            body = up;
        }
        roots[i] = body;
    }
    for (const int root : roots) {
        const auto found = of_body_.find(root);
        if (found == of_body_.end()) {
            continue;
        }
        return body_name(root) + " is given from " + spans_text(found->second) + request;
    }
    return files + ": nothing connects " + body_name(roots[0]) + " with " + body_name(roots[1]) + request;
}

} // namespace fledge::world
