/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLIGHT_SENSING_SUN_PYRAMIDS_H
#define FLIGHT_SENSING_SUN_PYRAMIDS_H

#include "flight/msg/avionics.h"
#include "flight/msg/event.h"
#include "flight/msg/navigation.h"
#include "flight/msg/sun.h"

#define SUN_PYRAMID (SUN_SENSORS_MAX / 2)

/** What geometry shows of two converters, each of a pyramid of sun sensors. */
typedef struct SunPyramidsStatus {
    Head head;
    uint32_t faulty;   ///< [-] converters that were found faulty: 1: A, 2: B
    uint32_t unused;   ///< [-] sensors that are out of use, a bit for each: 0x0F: those of A, 0xF0: those of B
    uint32_t suspects; ///< [-] where the readings of this update contradict each other: 1: by A, 2: by B, 3: by either
    uint32_t unresolved; ///< [-] updates in a row with a contradiction that may be of either
} SunPyramidsStatus;

/** Its events. */
typedef enum SunPyramidsEventId {
    SUN_PYRAMIDS_FAULTY = 1, ///< high, converter [-], sensors [-]: a converter (1: A, 2: B) has been found faulty; the
                             ///< sensors, a bit for each, are out of use from now on
    SUN_PYRAMIDS_UNRESOLVED = 2 ///< medium: the readings have contradicted each other for long, and it may be by either
} SunPyramidsEventId;

/** The direction to the Sun by two pyramids of four coarse sun sensors, each read by a converter of its own, of which
 *  one may fail, whole or by one sensor. The direction is the unit vector whose cosines are nearest to the readings,
 *  in the sum of weighted squares; a dark sensor says that the Sun is behind it, if no albedo and no obstacle is
 *  there.
 *  Readings that no direction explains within `differ`, nor an eclipse, nor, for up to `persistence` updates, a Sun
 *  that is evenly dimmed by one, are a contradiction. Each fault that may cause it is tried: each sensor alone, by the
 *  direction that the seven others have; each converter, if the other one has a direction or is dark, while it itself
 *  has none, is dark, or stands still. A contradiction that only faults of one converter explain, those of the other
 *  not even within twice `differ`, counts against that one. `persistence` such updates, fewer sound ones in a row
 *  between them, and it is found faulty: its one sensor that explains most of them is out of use, or else, or at its
 *  next contradiction, all four; until a reset of the module.
 *  Where faults of either explain it, or none, no one is blamed and the direction is held, degraded; after
 *  `persistence` updates it is that of the one pyramid that is lit, if the other is dark. A converter that repeats its
 *  counts is no witness against a dark one, and a dark one is blamed only if it was lit when both last agreed.
 *  Not seen at all is what has a direction, or looks like an eclipse: a fault within `differ`, a sensor in the dark
 *  that reads low, all that are lit reading low. A converter whose readings are those of another Sun, late or all
 *  drifting, may look like a fault of one sensor of the other. `differ` is to be beyond the noise and below `dark`,
 *  `persistence` longer than half-shadows.
 *  Between a contradiction and the finding, the direction is that of the others, degraded. With one lit sensor it is
 *  held, degraded.
 *  Source: least squares; thesis section 5.4.3 for the faults. */
typedef struct SunPyramids {
    struct {
        SunSensorCounts a; ///< the first four counts: of the sensors 0 to 3
        SunSensorCounts b; ///< the first four counts: of the sensors 4 to 7
    } in;
    struct {
        SunHeading heading;
        SunCosines cosines; ///< lit: without sensors that are out of use or suspected
        SunPyramidsStatus status;
        FlightEvent event;
    } out;
    struct {
        Vec3 axes_B[SUN_SENSORS_MAX];    ///< [-] required, non-zero: where they look; those of A first
        double current[SUN_SENSORS_MAX]; ///< [A] required, > 0: of a sensor that faces the Sun
        double scale[2];                 ///< [A] required, > 0: of one count of A and of B
        double offset[2];                ///< [A] of the count 0
        double weight[SUN_SENSORS_MAX];  ///< [-] >= 0: proportional to the inverse of the variance of a sensor's error;
                                         ///< 0: 1
        double dark;                     ///< [-] required, in [0, 1]: below this cosine a sensor counts as dark
        double differ;        ///< [-] required, > 0: contradiction, the root of the sum of weighted squares of cosines
        uint32_t persistence; ///< [-] required, > 0: updates with a contradiction until a converter is found faulty
        uint32_t spare;
    } par;
    struct {
        uint16_t counts[SUN_SENSORS_MAX]; ///< [-] of the last update
        uint32_t still[2];                ///< [-] updates since a count of A and of B changed
        uint32_t suspected[2];            ///< [-] updates that spoke against A and B
        uint32_t alone[SUN_SENSORS_MAX];  ///< [-] and that one sensor alone explains
        uint32_t sound;                   ///< [-] updates in a row without a contradiction
        uint32_t dimmed;                  ///< [-] updates in a row that only a dimmed Sun explains
        uint32_t lit;                     ///< [-] sensors that were lit when both last agreed; 0: they have differed
        uint32_t spare;
    } mem;
} SunPyramids;

void sun_pyramids_reset(SunPyramids *m);
void sun_pyramids_update(SunPyramids *m, Tick t);

#endif
