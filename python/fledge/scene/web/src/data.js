// SPDX-License-Identifier: Apache-2.0
// The data of a scene, as page.py packs them, and their values at a time.

/** The scene in a text. */
export async function load(text) {
    const packed = await fetch("data:application/octet-stream;base64," + text.trim());
    return unpack(await new Response(packed.body.pipeThrough(new DecompressionStream("deflate-raw"))).arrayBuffer());
}

/** The scene in a buffer: its arrays are {data, n, k}. */
export function unpack(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const start = Math.ceil((4 + length) / 8) * 8;
    const kinds = {f8: Float64Array, f4: Float32Array, u1: Uint8Array};
    return JSON.parse(
        new TextDecoder().decode(new Uint8Array(buffer, 4, length)),
        (_, value) => value && value.as in kinds ?
            {data: new kinds[value.as](buffer, start + value.at, value.n * value.k), n: value.n, k: value.k} :
            value);
}

const MOST = 8192;  // samples of a track that grows

/** Add samples to a track: times [s], and the numbers of its other columns in one row after the other, null for NaN.
    Samples that are not later than its last one are left out. When it has MOST samples, all but the newest quarter are
    thinned to an even spacing: so memory has a bound, and a sample costs a constant time on average. */
export function append(track, times, numbers) {
    const {time, ...others} = track, columns = Object.values(others).filter((other) => other?.data);
    const width = columns.reduce((sum, column) => sum + column.k, 0);
    times.forEach((t, i) => {
        if (time.n && !(t > time.data[time.n - 1])) return;
        if (time.n === time.data.length) {
            if (time.n < MOST)
                for (const column of [time, ...columns]) enlarge(column, Math.min(MOST, Math.max(64, 2 * time.n)));
            else
                thin(track, [time, ...columns]);
        }
        let from = width * i;
        time.data[time.n] = t;
        for (const column of columns)
            for (let k = 0; k < column.k; k++) column.data[column.k * time.n + k] = numbers[from++] ?? NaN;
        for (const column of [time, ...columns]) column.n++;
    });
}

function enlarge(column, rows) {
    const data = new column.data.constructor(rows * column.k);
    data.set(column.data.subarray(0, column.n * column.k));
    column.data = data;
}

function thin(track, columns) {
    const {data: times, n} = track.time, newest = n - MOST / 4, gap = (times[newest] - times[0]) / (MOST / 2);
    let rows = 0, last = -Infinity;
    for (let i = 0; i < n; i++) {
        if (i < newest && times[i] - last < gap) continue;
        last = times[i];
        for (const column of columns) column.data.copyWithin(column.k * rows, column.k * i, column.k * (i + 1));
        rows++;
    }
    for (const column of columns) column.n = rows;
    track.last = 0;
}

/** All tracks that grow, by their numbers. */
export function growing(scene) {
    const tracks = new Map();
    const walk = (node) => {
        if (!node || typeof node !== "object" || ArrayBuffer.isView(node)) return;
        if (node.time?.data && node.id !== undefined) tracks.set(node.id, node);
        else Object.values(node).forEach(walk);
    };
    walk(scene);
    return tracks;
}

/** The samples around a time t. span() writes its result into this object, as it is called for each frame. */
const interval = {
    before: 0,  // the samples on both sides of the time
    after: 0,
    share: 0,  // of the step between both that has passed
    step: 1  // [s]
};

function span(track, t) {
    const time = track.time.data, last = track.time.n - 1;
    let before = track.last ?? 0;
    if (!(time[before] <= t && (before === last || t < time[before + 1]))) {
        let low = 0, high = last;
        while (low < high) {
            const middle = (low + high + 1) >> 1;
            if (time[middle] <= t)
                low = middle;
            else
                high = middle - 1;
        }
        before = low;
    }
    before = Math.max(0, Math.min(before, last - 1));
    track.last = before;
    interval.before = before;
    interval.after = Math.min(before + 1, last);
    interval.step = last ? time[before + 1] - time[before] : 1;
    interval.share = last ? Math.min(1, Math.max(0, (t - time[before]) / interval.step)) : 0;
    return interval;
}

/** Whether a track has a value at a time: it has none before its first sample, and from one that is NaN. */
export function known(track, t, values = track?.values ?? track?.q ?? track?.r) {
    if (!track?.time.n || t < track.time.data[0]) return false;
    return !values || !Number.isNaN(values.data[values.k * span(track, t).before]);
}

/** [s] The age of a track's value at a time; 0 if it is not stale. */
export function age(track, t) {
    if (!track?.written || !track.time.n || t < track.time.data[0]) return 0;
    const {before, after} = span(track, t), written = track.written.data[t < track.time.data[after] ? before : after];
    return Number.isNaN(written) ? 0 : t - written;
}

/** The mode of a process at a time: the last of `began`, [t, name], until then; "" before the first. */
export function modeAt({began}, t) {
    return began.findLast(([start]) => start <= t + 1e-9)?.[1] ?? "";
}

/** [m] The position of a motion at a time, in double precision. */
export function position(motion, t, out = [0, 0, 0]) {
    if (!motion?.time.n) return out.fill(0);
    const {before, after, share: x, step} = span(motion, t), r = motion.r.data, v = motion.v.data;
    // The cubic polynomial through both places with both speeds.
    const ofBefore = (1 + 2 * x) * (1 - x) * (1 - x), ofAfter = x * x * (3 - 2 * x), ofSpeeds = step * x * (1 - x);
    for (let k = 0; k < 3; k++)
        out[k] = ofBefore * r[3 * before + k] + ofAfter * r[3 * after + k] +
            ofSpeeds * ((1 - x) * v[3 * before + k] - x * v[3 * after + k]);
    return out;
}

/** [m/s] Its velocity. */
export function velocity(motion, t, out = [0, 0, 0]) {
    if (!motion) return out.fill(0);
    const {before, after, share: x, step} = span(motion, t), r = motion.r.data, v = motion.v.data;
    for (let k = 0; k < 3; k++)
        out[k] = (6 * x * (1 - x) * (r[3 * after + k] - r[3 * before + k])) / step +
            (1 - x) * (1 - 3 * x) * v[3 * before + k] + x * (3 * x - 2) * v[3 * after + k];
    return out;
}

/** The quaternion of a turning at a time, written into `out`. */
export function attitude(turning, t, out, spare) {
    if (!turning?.time.n) return out.identity();
    const {before, after, share} = span(turning, t), quaternions = turning.q.data;
    out.fromArray(quaternions, 4 * before);
    if (Number.isNaN(quaternions[4 * after]) || age(turning, t)) return out;
    return out.slerp(spare.fromArray(quaternions, 4 * after), share);
}

/** An element of a signal; NaN where it has no value. */
export function level(signal, t, k = 0) {
    if (!known(signal, t)) return NaN;
    const {before, after, share} = span(signal, t), {data, k: elements} = signal.values;
    const first = data[elements * before + k], next = data[elements * after + k];
    return Number.isNaN(next) || (share < 1 && age(signal, t)) ? first : (1 - share) * first + share * next;
}

export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => {
    const length = norm(a) || 1;
    return [a[0] / length, a[1] / length, a[2] / length];
};
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** The unit vector from a place to the Sun; null if it is not known. */
export function toSun(scene, place, t) {
    if (scene.sun) return unit(sub(position(scene.sun, t), place));
    return scene.sun_N ? unit(scene.sun_N) : null;
}

const SUN_RADIUS = 6.957e8;  // [m]
const SUN_SIZE = 0.00465;  // [rad] half its angle, seen from 1 AU

/** [-] The share of the Sun that no body hides from a place. */
export function sunlight(scene, place, t) {
    const sun = toSun(scene, place, t);
    if (!sun) return 1;
    const own =
        scene.sun ? Math.asin(Math.min(1, SUN_RADIUS / norm(sub(position(scene.sun, t), place)))) : SUN_SIZE;
    let share = 1;
    for (const planet of scene.planets) {
        if (planet.name === "SUN") continue;
        const way = sub(position(planet.motion, t), place), distance = norm(way);
        const size = Math.asin(Math.min(1, planet.radius / distance));
        const off = Math.acos(Math.max(-1, Math.min(1, dot(way, sun) / distance)));
        share = Math.min(share, Math.max(0, Math.min(1, 0.5 + (off - size) / (2 * own))));
    }
    return share;
}

/** The celestial body with the smallest distance in its own radii; null without bodies. */
export function primary(scene, place, t) {
    let best = null, least = Infinity;
    for (const planet of scene.planets) {
        const distance = norm(sub(position(planet.motion, t), place)) / planet.radius;
        if (distance < least) [best, least] = [planet, distance];
    }
    return best;
}
