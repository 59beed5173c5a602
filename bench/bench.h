// SPDX-License-Identifier: Apache-2.0
// What bench/*.py measures in C++, as plain functions for ctypes.
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

/// Fly the nadir spin for `steps` steps of 0.1 s; `end` takes r, v, sigma, omega and the four
/// wheels' speeds, 16 numbers.
__attribute__((visibility("default"))) void hand_written_loop(long steps, double *end);

/// Call one flight module's update n times on inputs of the nadir spin; seconds per call, or a
/// negative number if there is no module of that name.
__attribute__((visibility("default"))) double time_flight_update(const char *module, long n);

/// The same for modules of control and actuation, on inputs of a small spacecraft with four wheels, eight thrusters and
/// three rods.
__attribute__((visibility("default"))) double time_control_update(const char *module, long n);

/// The same for filters and ephemerides, of which each has a case or several from 0 on: bench/filters.py lists them.
__attribute__((visibility("default"))) double time_filter_update(const char *module, int kind, long n);

/// Send a packet of 200 bytes through a layer of the link, which bench/ground.py names, n times; seconds per packet, or
/// a negative number if there is no such layer.
__attribute__((visibility("default"))) double time_link_layer(const char *layer, long n);

/// Decode n packets by a database: "369 integers" of 32 bits, "mixed" or "mixed, of varying size"; seconds per
/// parameter, or a negative number if there is no such packet.
__attribute__((visibility("default"))) double time_decoder(const char *packet, long n);

/// Monitor n packets of 369 integers, in batches of 200, with limits or none, and keep them in an archive in a folder,
/// if one is given; seconds of processor time per packet, or a negative number if packets were not decoded.
__attribute__((visibility("default"))) double time_monitor(const char *folder, int limits, long n);

/// Write 10,000 values that changed into a frame, n times; seconds of processor time per frame.
__attribute__((visibility("default"))) double time_changes(long n);

/// Gravity of a field of a degree along a low orbit, n times; seconds of processor time per evaluation.
__attribute__((visibility("default"))) double time_harmonics(int degree, long n);

/// fm_sin(x) for "sin", and so on; NaN if there is no function of one argument of that name.
__attribute__((visibility("default"))) double elementary(const char *function, double x);

/// A published value of a law of the air, and what the law gives: [kg/m^3], [K], NaN where none is published.
typedef struct PublishedAir {
    const char *set;
    double km, density, density_found, temperature, temperature_found;
} PublishedAir;

/// The value of that index, from 0 on; 0 if there is none.
__attribute__((visibility("default"))) int published_air(int index, PublishedAir *row);

#ifdef __cplusplus
}
#endif
