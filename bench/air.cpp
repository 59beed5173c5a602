// SPDX-License-Identifier: Apache-2.0
// What is published of the laws of the Earth's upper air, and what the laws give.
#include "bench/bench.h"
#include "world/environment/air/published_dtm2000.h"
#include "world/environment/air/published_jb2008.h"
#include "world/environment/air/published_met.h"
#include "world/environment/air/published_nrlmsise00.h"

#include <vector>

using fledge::world::AirComposition;

namespace {

/// Rows that have a temperature, and those that have none.
template <typename Rows, typename Of>
void add(std::vector<PublishedAir> &all, const char *set, const Rows &rows, const Of &of)
{
    for (const auto &row : rows) {
        const AirComposition air = of(row);
        PublishedAir line{set, row.km, row.density, air.density, NAN, NAN};
        if constexpr (requires { row.temperature; }) {
            line.temperature = row.temperature;
            line.temperature_found = air.temperature;
        }
        all.push_back(line);
    }
}

std::vector<PublishedAir> published()
{
    using namespace fledge::world;
    std::vector<PublishedAir> all;
    for (const auto &row : published_nrlmsise00::published) {
        const AirComposition air = published_nrlmsise00::of(row);
        all.push_back({"NRLMSISE-00", row.km, 1e3 * row.density, published_nrlmsise00::plain_density(air),
                       row.temperature, air.temperature});
    }
    add(all, "JB2008, 2017", published_jb2008::rows_2017, published_jb2008::of_2017);
    add(all, "JB2008, 2009", published_jb2008::rows_2009, published_jb2008::of_2009);
    add(all, "JB2008, strong Sun", published_jb2008::rows_2001, published_jb2008::of_2001);
    add(all, "JB2008, storms", published_jb2008::storms, [](const auto &row) { return published_jb2008::of(row); });
    add(all, "DTM2000, CNES", published_dtm2000::rows, [](const auto &row) { return published_dtm2000::of(row); });
    add(all, "DTM2000, Orekit", published_dtm2000::orekit_rows,
        [](const auto &row) { return published_dtm2000::of(row); });
    add(all, "MET, 120 to 140 km", published_met::cape_rows, published_met::at_cape);
    add(all, "MET, 100 to 1000 km", published_met::north_rows, published_met::at_north);
    for (const auto &row : published_met::latitude_rows) {
        const AirComposition air = published_met::of(row);
        all.push_back({"MET, by latitude", 650.0, row.density, air.density, row.temperature, air.temperature});
    }
    return all;
}

} // namespace

int published_air(int index, PublishedAir *row)
{
    static const std::vector<PublishedAir> all = published();
    if (index < 0 || index >= static_cast<int>(all.size())) {
        return 0;
    }
    *row = all[static_cast<std::size_t>(index)];
    return 1;
}
