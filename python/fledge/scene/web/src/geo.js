// SPDX-License-Identifier: Apache-2.0
// Places on the ground of a planet: latitude and longitude, stations and their passes, the orbit of a moment.
import * as THREE from "three";

import {attitude, cross, dot, known, level, norm, position, sub, unit} from "./data.js";

const STEP = 20;  // [s] between two samples of the elevation in the search for passes
const MOST_STEPS = 20000;
const POINTS = 240;  // of an orbit
const TURN = 2 * Math.PI;
const turn = new THREE.Quaternion(), spare = new THREE.Quaternion(), vector = new THREE.Vector3();

/** A place in N as one in the frame of a planet [m]. */
export function fixed(planet, place, t) {
    attitude(planet.turning, t, turn, spare);
    return vector.set(...sub(place, position(planet.motion, t))).applyQuaternion(turn.conjugate()).toArray();
}

/** A place in the frame of a planet as one in N [m]. */
export function inertial(planet, place, t) {
    attitude(planet.turning, t, turn, spare);
    return vector.set(...place).applyQuaternion(turn).toArray().map((x, k) => x + position(planet.motion, t)[k]);
}

/** {latitude, longitude [rad], altitude [m]}, geodetic, of a place in the frame of a planet. */
export function geodetic({radius, flattening}, [x, y, z]) {
    const square = flattening * (2 - flattening), flat = Math.hypot(x, y);
    let latitude = Math.atan2(z, flat * (1 - square));
    for (let k = 0; k < 6; k++) {
        const sine = Math.sin(latitude);
        latitude = Math.atan2(z + (square * radius * sine) / Math.sqrt(1 - square * sine * sine), flat);
    }
    const sine = Math.sin(latitude);
    return {
        latitude,
        longitude: Math.atan2(y, x),
        altitude: flat * Math.cos(latitude) + z * sine - radius * Math.sqrt(1 - square * sine * sine)
    };
}

/** {azimuth, elevation [rad], range [m]} of a place in N, seen from a station. */
export function lookAngles(scene, station, place, t) {
    const planet = planetOf(scene, station), way = sub(fixed(planet, place, t), station.place), range = norm(way);
    const east = unit(cross([0, 0, 1], station.up)), north = cross(station.up, east);
    const azimuth = Math.atan2(dot(way, east), dot(way, north));
    return {azimuth: azimuth < 0 ? azimuth + TURN : azimuth, elevation: Math.asin(dot(way, station.up) / range), range};
}

export const planetOf = (scene, station) => scene.planets.find((planet) => planet.name === station.planet);

/** The passes of a motion over a station's mask from one time to another: [{rise, set [s], peak [rad]}]. */
export function passes(scene, station, motion, begin, end) {
    const step = Math.max(STEP, (end - begin) / MOST_STEPS), contacts = [];
    const over = (t) => lookAngles(scene, station, position(motion, t), t).elevation - station.mask;
    const crossing = (low, high) => {
        const rising = over(high) > 0;
        for (let k = 0; k < 30; k++) {
            const middle = (low + high) / 2;
            if (over(middle) > 0 === rising)
                high = middle;
            else
                low = middle;
        }
        return high;
    };
    const highest = (low, high) => {    // of one summit
        for (let k = 0; k < 40; k++) {
            const third = (high - low) / 3;
            if (over(low + third) < over(high - third))
                low += third;
            else
                high -= third;
        }
        return over(low) + station.mask;
    };
    let open = null, best = 0;
    for (let t = begin, before = begin;; before = t, t = Math.min(end, t + step)) {
        const height = over(t);
        if (height > 0 && !open) contacts.push(open = {rise: t > begin ? crossing(before, t) : begin, set: end, at: t});
        if (open && (open.at === t || height > best)) [open.at, best] = [t, height];
        if (height <= 0 && open) open.set = crossing(before, t);
        if (open && (height <= 0 || t >= end))
            open.peak = highest(Math.max(open.rise, open.at - step), Math.min(open.set, open.at + step));
        if (height <= 0) open = null;
        if (t >= end) return contacts;
    }
}

/** The state of a station's radio link at a time. locked: whether a direction is locked; text: both directions. */
export function linkState(link, t) {
    const ways = ["down", "up"].filter((way) => link[way]).map((way) => {
        if (!known(link[way], t)) return [false, `${way} \u2013`];
        const locked = level(link[way], t) > 0.5;
        return [locked, locked ? `${way} locked, ${level(link[way], t, 1).toFixed(1)} dB` : `${way} not locked`];
    });
    return {
        locked: ways.some(([locked]) => locked),
        text: ways.map(([, text]) => text).join("; ") || "not recorded"
    };
}

/** The osculating orbit of a spacecraft about a planet at a time t, as the motion of one revolution; null if it is no
    ellipse. */
export function osculating(planet, place, speed, t) {
    if (!planet?.mu) return null;
    const centre = position(planet.motion, t), r = sub(place, centre), distance = norm(r), {mu} = planet;
    const axis = 1 / (2 / distance - dot(speed, speed) / mu), momentum = cross(r, speed);
    if (!(axis > 0 && norm(momentum) > 0)) return null;
    const toPeriapsis = cross(speed, momentum).map((x, k) => x / mu - r[k] / distance), e = norm(toPeriapsis);
    if (!(e < 0.999)) return null;
    const first = e > 1e-9 ? unit(toPeriapsis) : unit(r), second = cross(unit(momentum), first);
    const minor = axis * Math.sqrt(1 - e * e), rate = Math.sqrt(mu / axis ** 3);
    const start = Math.atan2(dot(r, second) / minor, dot(r, first) / axis + e);
    const mean = (anomaly) => anomaly - e * Math.sin(anomaly), n = POINTS + 1;
    const motion = {
        time: {data: new Float64Array(n), n, k: 1},
        r: {data: new Float64Array(3 * n), n, k: 3},
        v: {data: new Float64Array(3 * n), n, k: 3}
    };
    for (let i = 0; i < n; i++) {
        const anomaly = start + (TURN * i) / POINTS, x = axis * (Math.cos(anomaly) - e), y = minor * Math.sin(anomaly);
        const pace = rate / (1 - e * Math.cos(anomaly));
        const vx = -axis * Math.sin(anomaly) * pace, vy = minor * Math.cos(anomaly) * pace;
        motion.time.data[i] = t + (mean(anomaly) - mean(start)) / rate;
        for (let k = 0; k < 3; k++) {
            motion.r.data[3 * i + k] = centre[k] + x * first[k] + y * second[k];
            motion.v.data[3 * i + k] = vx * first[k] + vy * second[k];
        }
    }
    return motion;
}

/** [rad/s] The rate of a planet about its third axis, by its turning up to a time. */
export function spin(planet, t) {
    const {turning} = planet;
    if (!turning || turning.time.n < 2) return 0;
    const last = turning.time.data[turning.time.n - 1], at = Math.min(t, last), first = turning.time.data[0];
    const later = at > first ? at : Math.min(last, first + 60), before = Math.max(first, later - 600);
    const q = attitude(turning, before, new THREE.Quaternion(), spare).conjugate();
    q.multiply(attitude(turning, later, turn, spare));
    return (2 * Math.atan2(Math.sign(q.w || 1) * q.z, Math.abs(q.w))) / (later - before);
}
