/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_CONTROL_NEURAL_FEEDBACK_H
#define FLIGHT_CONTROL_NEURAL_FEEDBACK_H

#include "flight/msg/attitude.h"
#include "flight/msg/vehicle.h"

#define NEURAL_INPUTS 6
#define NEURAL_OUTPUTS 3
#define NEURAL_HIDDEN_MAX 2
#define NEURAL_NEURONS_MAX 32
/* Any number of layers and neurons has room: 32 x (6 + 1) + 32 x (32 + 1) + 3 x (32 + 1). */
#define NEURAL_WEIGHTS_MAX 1379

/** The function of the neurons in hidden layers. */
typedef enum NeuralActivation {
    NEURAL_TANH = 0, ///< the hyperbolic tangent
    NEURAL_RELU = 1  ///< max(0, x)
} NeuralActivation;

/** Track an attitude reference with a small neural network, which was trained elsewhere: dense layers
 *     x = (sigma_BR / sigma_unit, omega_BR_B / omega_unit),   y = f(W0 x + b0),   z = W1 y + b1
 *     u = torque_max z,   each z_i cut to [-1, 1]
 *  or none or two hidden layers f(W x + b). The weights are parameters, so that a new network is an upload of numbers.
 *  A network without biases is an odd function, which gives no torque where there is no error. Whether the loop is
 *  stable is for its training and its verification to show. Where no torque can be computed, the last one is held,
 *  degraded; after `hold` without new data it is zero, degraded.
 *  Source: Goodfellow, Bengio and Courville 2016, chapter 6. */
typedef struct NeuralFeedback {
    struct {
        AttError error;
    } in;
    struct {
        BodyTorque torque; ///< wanted control torque on the body
    } out;
    struct {
        double sigma_unit;                   ///< [-] required, > 0: MRP error that is 1 for the network
        double omega_unit;                   ///< [rad/s] required, > 0: rate error that is 1 for it
        double torque_max;                   ///< [N m] required, > 0: torque about an axis for its output 1
        double hold;                         ///< [s] >= 0: how long the torque goes on without new data; 0: ten updates
        NeuralActivation activation;         ///< [-] of the hidden layers
        uint32_t hidden;                     ///< [-] in [0, 2]: how many of them
        uint32_t neurons[NEURAL_HIDDEN_MAX]; ///< [-] count hidden, in [1, 32]: of each
        double weights[NEURAL_WEIGHTS_MAX];  ///< [-] required, in [-1e6, 1e6]: layer after layer, the one of the
                                             ///< outputs last: W by rows, of a neuron each, then b
    } par;
    struct {
        int64_t newest; ///< [ns] the time of the newest error that was used
    } mem;
} NeuralFeedback;

void neural_feedback_reset(NeuralFeedback *m);
void neural_feedback_update(NeuralFeedback *m, Tick t);

#endif
