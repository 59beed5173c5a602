// SPDX-License-Identifier: Apache-2.0
// The US Standard Atmosphere 1976, from its equations.
//
// To 86 km: layers of constant gradient of the molecular-scale temperature over geopotential height, in hydrostatic
// equilibrium. From 86 to 1000 km: the temperature profile of the standard, and number densities of N2, O, O2, Ar, He
// and H from the balance of gravity, diffusion and turbulence (equations 33 to 41 of the standard), integrated once in
// steps of 50 m. Above 1000 km the density goes on falling with the scale height that it has there; below -5 km
// all is as at -5 km.
#pragma once

#include <vector>

namespace fledge::world {

struct Air {
    double temperature = 0.0; ///< [K] kinetic
    double pressure = 0.0;    ///< [Pa]
    double density = 0.0;     ///< [kg/m^3]
};

class StandardAtmosphere {
public:
    /// The only one; made at the first call.
    static const StandardAtmosphere &get();

    /// At a geometric altitude [m].
    Air at(double altitude) const;

private:
    StandardAtmosphere();

    /// At a whole number of km from 86 to 1000, logarithms and their slopes per km.
    struct Knot {
        double density, pressure, density_slope, pressure_slope;
    };
    std::vector<Knot> knots_;
};

} // namespace fledge::world
