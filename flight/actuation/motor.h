/* SPDX-License-Identifier: Apache-2.0 */
/* Private to flight/actuation: a direct-current motor. */
#ifndef FLIGHT_ACTUATION_MOTOR_H
#define FLIGHT_ACTUATION_MOTOR_H

/** [V] that give the torque u at the speed Omega: R u / k + e Omega. */
static inline double motor_volts(double u, double Omega, double resistance, double torque_constant, double back_emf)
{
    return resistance * u / torque_constant + back_emf * Omega;
}

#endif
