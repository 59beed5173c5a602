/* SPDX-License-Identifier: Apache-2.0 */
/* Hinged panels: their angles and what drives them. */
#ifndef FLIGHT_MSG_PANELS_H
#define FLIGHT_MSG_PANELS_H

#include "flight/msg/head.h"

#define PANELS_MAX 8

/** What drives hinged panels. */
typedef struct PanelCommand {
    Head head;
    double theta[PANELS_MAX]; ///< [rad] angle at which the hinge's spring is at rest
    double u[PANELS_MAX];     ///< [N m] torque of a motor on the panel, about its hinge
} PanelCommand;

/** The angles of hinged panels about their hinges. */
typedef struct PanelAngles {
    Head head;
    double theta[PANELS_MAX];  ///< [rad]
    double dtheta[PANELS_MAX]; ///< [rad/s]
} PanelAngles;

#endif
