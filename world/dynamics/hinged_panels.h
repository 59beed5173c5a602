/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_DYNAMICS_HINGED_PANELS_H
#define WORLD_DYNAMICS_HINGED_PANELS_H

#include "flight/math/vec.h"
#include "flight/msg/panels.h"

/** Rigid panels, each on a hinge with a spring and a damper, a part of a spacecraft. A modal model of a flexible panel
 *  is a hinge with the mode's frequency. A motor or a command that turns the spring's rest drives them.
 *  Assumptions: the hinge's axis is fixed in the body; nothing stops a panel. A spring is at rest at theta = 0 until a
 *  command says otherwise.
 *  Source: derived in docs/dynamics.md. */
typedef struct HingedPanels {
    struct {
        PanelCommand command; ///< optional: without it the motors are off
    } in;
    struct {
        PanelAngles angles;
    } out;
    struct {
        uint32_t n; ///< [-] in [1, 8]: number of panels
        uint32_t spare;
        double mass[PANELS_MAX];   ///< [kg] required, initial, count n, in [1e-6, 1e6]: mass, not in the craft's
        Mat3 I_B[PANELS_MAX];      ///< [kg m^2] required, initial, count n, inertia: about its own centre, at theta = 0
        Vec3 hinge_B[PANELS_MAX];  ///< [m] required, initial, count n, in [-1e3, 1e3]: a point of the hinge's axis
        Vec3 axes_B[PANELS_MAX];   ///< [-] required, initial, count n, non-zero: the axis
        Vec3 center_B[PANELS_MAX]; ///< [m] count n, in [-1e3, 1e3], initial: its centre from the hinge at theta = 0
        double stiffness[PANELS_MAX]; ///< [N m] count n, >= 0: torque of the spring per angle
        double damping[PANELS_MAX];   ///< [N m s] count n, >= 0: torque of the damper per rate
        double theta[PANELS_MAX];     ///< [rad] count n, in [-1e6, 1e6], initial: angles
        double dtheta[PANELS_MAX];    ///< [rad/s] count n, initial: rates
    } par;
} HingedPanels;

#endif
