// SPDX-License-Identifier: Apache-2.0
// Curves of parameters over time: samples of the archive, then live values; with gaps where the archive has gaps.

const FAR = 5;      // two samples of the archive that are so many usual steps apart have a gap between them
const LEAST = 2;    // [s] of a gap
const MISSED = 1.5; // so many times the step apart, the archive may have a sample between two live values
const AGAIN = 500;  // [ms] between two requests for samples that did not come live; 10 times that after a failure
const LEAST_AXIS = 2 ** -44;    // [-] least length of an axis, divided by its largest number
const COLUMNS = ["t", "value", "low", "high", "worst"];

/** A parameter's samples: time in s, value, the least, the largest and the worst state of each step of time. Up to the
 *  time `whole`, the curve has all samples of the archive. Behind it are live values, of which the server may have left
 *  out some; they are no gap, as the archive has them.
 */
export class Curve {
    constructor(name) {
        Object.assign(this, {name, t: [], value: [], low: [], high: [], worst: [], step: NaN, far: NaN, whole: NaN});
    }

    /** Replace all samples by those of the archive. shown: [ns] the newest time that the server has sent, or null; the
        archive is complete up to it. */
    fill(archived, shown) {
        for (const key of COLUMNS) this[key] = [];
        Object.assign(this, {step: NaN, far: NaN});
        this.mend(archived, -Infinity, shown === null ? -Infinity : Number(shown) / 1e9);
    }

    /** Replace the samples after `from` and up to `to` by those of the archive. */
    mend({t, value, low, high, worst}, from, to) {
        const steps = Array.from(t).slice(1).map((next, k) => next - t[k]).sort((a, b) => a - b), n = steps.length - 1;
        if (n > 0) Object.assign(this, {step: steps[n >> 1], far: steps[Math.floor(0.9 * n)]});
        const at = (bound) => {
            const k = this.t.findIndex((t) => t > bound);
            return k < 0 ? this.t.length : k;
        };
        const begin = at(from), later = COLUMNS.map((key) => this[key].splice(begin, Infinity).slice(at(to) - begin));
        this.whole = Math.max(to, t.at(-1) ?? to);
        for (let k = 0; k < t.length; k++)
            if (t[k] > from) this.append(t[k], value[k], low[k], high[k], worst[k]);
        later[0].forEach((_, k) => this.add(...later.map((column) => column[k])));
    }

    /** Append a live value. Returns false if it is not newer than the last one. */
    add(t, value, low = value, high = value, worst = 0) {
        const last = this.t.at(-1) ?? -Infinity;
        if (t <= last) return false;
        const near = this.whole >= last && t - Math.max(last, this.whole) <= MISSED * this.step;
        if (near) this.whole = t;
        this.append(t, value, low, high, worst);
        return true;
    }

    /** Whether the archive may have samples that are missing here. */
    get isOpen() { return this.whole < this.t.at(-1); }

    append(t, value, low, high, worst) {
        const last = this.t.at(-1);
        if (t <= this.whole && t - last > Math.max(FAR * this.far, LEAST))
            this.push((last + t) / 2, null, null, null, 0);
        const real = (number) => (Number.isNaN(number) ? null : number);
        this.push(t, real(value), real(low), real(high), worst);
    }

    push(...all) { COLUMNS.forEach((key, k) => this[key].push(all[k])); }

    /** Drop the samples before a time. */
    drop(before) {
        let n = 0;
        while (this.t[n] < before) n++;
        if (n > 100) for (const key of COLUMNS) this[key].splice(0, n);
    }

    /** What is drawn: an infinite value has no place in a chart, which would scale to it. */
    get table() {
        const finite = (y) => (Number.isFinite(y) ? y : null);
        return [this.t, this.value.map(finite), this.low.map(finite), this.high.map(finite)];
    }
}

/** The least and the largest value of an axis with all values from low to high. It is so long that the doubles between
 *  its marks differ: the chart adds step to step, and would not end where that changes nothing. */
export function room(low, high) {
    if (low === null || high === null) return [0, 1];
    const size = Math.max(Math.abs(low), Math.abs(high));
    const edge = Math.max(0.06 * (high - low) || 0.1 * size || 1, size * LEAST_AXIS);
    return [low - edge, high + edge];
}

/** Reads from the archive the samples that curves did not get live. read(from, to) [s]: the archive's series of each
 *  curve; done(): draw them anew */
export class Mender {
    constructor(read, done) { Object.assign(this, {read, done, busy: false, next: 0}); }

    /** Read the samples that may be missing in view, which starts at `begin`. */
    async check(curves, begin) {
        const open = curves.filter((curve) => curve.isOpen);
        if (this.busy || !open.length || performance.now() < this.next) return;
        const from = Math.max(begin, Math.min(...open.map(({whole}) => whole)));
        const to = Math.max(...curves.map((curve) => curve.t.at(-1) ?? -Infinity));
        this.busy = true;
        let pause = 10 * AGAIN;
        try {
            const archived = await this.read(from, to);
            if (archived) curves.forEach((curve, k) => curve.mend(archived[k], Math.max(from, curve.whole), to));
            this.done();
            pause = AGAIN;
        } catch { // the next check reads again
        } finally {
            this.busy = false;
            this.next = performance.now() + pause;
        }
    }
}
