// SPDX-License-Identifier: Apache-2.0
// The data of a scene, as page.py packs them, and their values at a time.

/** The scene in a text: its arrays are {data, n, k}. */
export async function load(text) {
    const packed = await fetch("data:application/octet-stream;base64," + text.trim());
    const plain = packed.body.pipeThrough(new DecompressionStream("deflate-raw"));
    const buffer = await new Response(plain).arrayBuffer();
    const length = new DataView(buffer).getUint32(0, true);
    const start = Math.ceil((4 + length) / 8) * 8;
    const kinds = {f8: Float64Array, f4: Float32Array, u1: Uint8Array};
    return JSON.parse(
        new TextDecoder().decode(new Uint8Array(buffer, 4, length)),
        (_, value) => value && value.as in kinds ?
            {data: new kinds[value.as](buffer, start + value.at, value.n * value.k), n: value.n, k: value.k} :
            value);
}

/** The index of the last time not after t, and the share of the way to the next. Answers in `found`. */
const found = {
    i: 0,
    j: 0,
    x: 0,
    h: 1
};

function span(track, t) {
    const time = track.time.data, last = time.length - 1;
    let i = track.last ?? 0;
    if (!(time[i] <= t && (i === last || t < time[i + 1]))) {
        let low = 0, high = last;
        while (low < high) {
            const middle = (low + high + 1) >> 1;
            if (time[middle] <= t)
                low = middle;
            else
                high = middle - 1;
        }
        i = low;
    }
    i = Math.max(0, Math.min(i, last - 1));
    track.last = i;
    found.i = i;
    found.j = Math.min(i + 1, last);
    found.h = last ? time[i + 1] - time[i] : 1;
    found.x = last ? Math.min(1, Math.max(0, (t - time[i]) / found.h)) : 0;
    return found;
}

/** [m] Where a motion is at a time, in double precision. */
export function position(motion, t, out = [0, 0, 0]) {
    if (!motion) return out.fill(0);
    const {i, j, x, h} = span(motion, t), r = motion.r.data, v = motion.v.data;
    const a = (1 + 2 * x) * (1 - x) * (1 - x), b = x * x * (3 - 2 * x), c = h * x * (1 - x);
    for (let k = 0; k < 3; k++)
        out[k] = a * r[3 * i + k] + b * r[3 * j + k] + c * ((1 - x) * v[3 * i + k] - x * v[3 * j + k]);
    return out;
}

/** [m/s] How fast it moves. */
export function velocity(motion, t, out = [0, 0, 0]) {
    if (!motion) return out.fill(0);
    const {i, j, x, h} = span(motion, t), r = motion.r.data, v = motion.v.data;
    for (let k = 0; k < 3; k++)
        out[k] = (6 * x * (1 - x) * (r[3 * j + k] - r[3 * i + k])) / h + (1 - x) * (1 - 3 * x) * v[3 * i + k] +
            x * (3 * x - 2) * v[3 * j + k];
    return out;
}

/** The quaternion of a turning, as three.js has it, into `out`. */
export function attitude(turning, t, out, spare) {
    if (!turning) return out.identity();
    const {i, j, x} = span(turning, t), q = turning.q.data;
    out.fromArray(q, 4 * i);
    return out.slerp(spare.fromArray(q, 4 * j), x);
}

/** An element of a signal. */
export function level(signal, t, k = 0) {
    if (!signal || !signal.time.n) return 0;
    const {i, j, x} = span(signal, t), v = signal.values.data, n = signal.values.k;
    return (1 - x) * v[n * i + k] + x * v[n * j + k];
}

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => {
    const s = norm(a) || 1;
    return [a[0] / s, a[1] / s, a[2] / s];
};
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export {sub};

/** The unit vector from a place to the Sun; null if nobody knows it. */
export function toSun(scene, r, t) {
    if (scene.sun) return unit(sub(position(scene.sun, t), r));
    return scene.sun_N ? unit(scene.sun_N) : null;
}

const SUN_RADIUS = 6.957e8;

/** [-] The share of the Sun that no body hides from a place. */
export function sunlight(scene, r, t) {
    const s = toSun(scene, r, t);
    if (!s) return 1;
    const own = scene.sun ? Math.asin(Math.min(1, SUN_RADIUS / norm(sub(position(scene.sun, t), r)))) : 0.00465;
    let share = 1;
    for (const planet of scene.planets) {
        if (planet.name === "SUN") continue;
        const d = sub(position(planet.motion, t), r), distance = norm(d);
        const size = Math.asin(Math.min(1, planet.radius / distance));
        const off = Math.acos(Math.max(-1, Math.min(1, dot(d, s) / distance)));
        share = Math.min(share, Math.max(0, Math.min(1, 0.5 + (off - size) / (2 * own))));
    }
    return share;
}

/** The celestial body that the spacecraft is nearest to, by its radii; null without any. */
export function primary(scene, r, t) {
    let best = null, least = Infinity;
    for (const planet of scene.planets) {
        const distance = norm(sub(position(planet.motion, t), r)) / planet.radius;
        if (distance < least) [best, least] = [planet, distance];
    }
    return best;
}
