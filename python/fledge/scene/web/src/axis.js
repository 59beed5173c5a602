// SPDX-License-Identifier: Apache-2.0
// The axes of the plots.

/** [s] The steps between marks of time, so that these are whole minutes, hours and days. */
export const TIME_STEPS = [
    ...[-3, -2, -1].flatMap((power) => [1, 2, 5].map((step) => Number(`${step}e${power}`))),
    ...[1, 60].flatMap((unit) => [1, 2, 5, 10, 15, 20, 30].map((step) => step * unit)),
    ...[1, 2, 3, 6, 12].map((hours) => 3600 * hours),
    ...[0, 1, 2, 3, 4, 5, 6].flatMap((power) => [1, 2, 5].map((step) => 86400 * step * 10 ** power)),
];

/** The ends of the axis of a constant, which has it in its middle; null: the values from low to high differ, or there
 *  is none. */
export function aroundConstant(low, high) {
    if (low === null || low !== high) return null;
    const edge = 0.1 * Math.abs(low) || 1;
    return [low - edge, low + edge];
}
