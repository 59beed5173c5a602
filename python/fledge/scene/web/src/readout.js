// SPDX-License-Identifier: Apache-2.0
// The numbers of the spacecraft in focus at a time.
import * as THREE from "three";

import {age, attitude, known, level, modeAt, norm, position, primary, sub, velocity} from "./data.js";
import {fixed, geodetic, linkState, lookAngles} from "./geo.js";
import {number} from "./plots.js";

const degrees = THREE.MathUtils.radToDeg;

/** The rows of the read-out: [[name, words, class], ...]. */
export function numbers(data, stage, t) {
    const {craft, body, place, speed, sunlight} = stage.focused, rows = [];
    const centre = primary(data, place, t);
    if (centre) {
        const altitude = norm(sub(place, position(centre.motion, t))) - centre.radius;
        rows.push(
            ["altitude", `${(altitude / 1e3).toFixed(2)} km`],
            ["speed", `${(norm(sub(speed, velocity(centre.motion, t))) / 1e3).toFixed(4)} km/s`]);
    }
    for (const mode of data.modes) rows.push([`${mode.process} mode`, modeAt(mode, t) || "\u2013"]);
    const {rate, ...others} = craft.signals;
    if (rate) {
        const turn = degrees(Math.hypot(...[0, 1, 2].map((k) => level(rate, t, k))));
        rows.push(["body rate", number(turn, (x) => `${x.toFixed(4)} °/s`)]);
    }
    for (const [name, signal] of Object.entries(others))
        rows.push([name, ...aged(signal, t, number(degrees(level(signal, t)), (x) => `${x.toPrecision(4)}°`))]);
    if (data.sun || data.sun_N) rows.push(["sunlight", `${(100 * sunlight).toFixed(0)} %`]);
    const estimate = craft.poses.find((pose) => pose.kind === "estimate")?.turning;
    if (estimate && stage.shown.estimate) {
        const estimated = attitude(estimate, t, new THREE.Quaternion(), new THREE.Quaternion());
        rows.push(["estimate off by", ...aged(estimate, t,
            known(estimate, t) ? angle(degrees(body.quaternion.angleTo(estimated))) : "\u2013")]);
    }
    const levels = (kind) => craft.parts.filter((part) => part.kind === kind && part.level)
        .map((part) => level(part.level, t));
    const wheels = levels("wheel"), thrusts = levels("thruster");
    if (wheels.length)
        rows.push(["wheels", wheels.map((speed) => number((speed * 30) / Math.PI, Math.round)).join("  ") + " rpm"]);
    if (thrusts.length)
        rows.push(["thrust", number(thrusts.reduce((sum, thrust) => sum + thrust, 0), (x) => `${x.toFixed(3)} N`)]);
    stage.crafts.forEach((other, k) => {
        if (k !== stage.focus && stage.crafts.length < 5)
            rows.push([`to ${other.craft.label}`, `${(norm(sub(other.place, place)) / 1e3).toFixed(3)} km`]);
    });
    for (const station of data.stations.slice(0, 4)) {
        const {elevation, range} = lookAngles(data, station, place, t), seen = elevation >= station.mask;
        const radio = station.links.find((link) => link.craft === craft.name);
        rows.push([station.name, seen ? `${degrees(elevation).toFixed(1)}°, ${(range / 1e3).toFixed(0)} km` :
                                        "not in view"]);
        if (radio && (radio.down || radio.up)) rows.push(["radio", linkState(radio, t).text]);
    }
    for (const {part} of body.cones)
        if (part.keep_out && stage.inside(stage.focused, part, t))
            rows.push([part.name, `${part.keep_out} inside`, "warn"]);
    return rows;
}

/** A place in N over the ground of a planet, in words. */
export function overGround(planet, place, t) {
    const {latitude, longitude, altitude} = geodetic(planet, fixed(planet, place, t));
    const half = (value, names) => `${degrees(Math.abs(value)).toFixed(2)}° ${names[value < 0 ? 1 : 0]}`;
    return `${half(latitude, "NS")}, ${half(longitude, "EW")}, ${(altitude / 1e3).toFixed(1)} km`;
}

/** [words, class] of a track's value at a time: with its age and in grey if it is stale. */
function aged(track, t, words) {
    const since = age(track, t);
    return since ? [`${words}, ${since.toFixed(0)} s old`, "stale"] : [words];
}

function angle(degrees) {
    return degrees > 0.5 ? `${degrees.toFixed(2)}°` :
        degrees > 1 / 120 ? `${(60 * degrees).toFixed(2)}′` :
                            `${(3600 * degrees).toFixed(1)}″`;
}
