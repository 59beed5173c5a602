// SPDX-License-Identifier: Apache-2.0
// Curves of parameters over time: from the archive, and what comes since; with gaps where the archive has them.

const FAR = 5;      // so many times the usual step apart, two samples of the archive have a gap between them
const LEAST = 2;    // [s] of a gap
const MISSED = 1.5; // so many times the step apart, something may lie between two values that came live
const AGAIN = 500;  // [ms] between two questions for what did not come live; 10 times that after one that failed
const COLUMNS = ["t", "value", "low", "high", "worst"];

/** One parameter's samples: time in s, value, the least, the largest and the worst state of each step of time. Up to
 *  `whole` it has what the archive has; what came live behind that may lack values, which are not lost: a gap is where
 *  the archive has one.
 */
export class Curve {
    constructor(name) {
        Object.assign(this, {name, t: [], value: [], low: [], high: [], worst: [], step: NaN, far: NaN, whole: NaN});
    }

    /** Take what the archive has, in place of all. shown: [ns] of the newest value that the server has shown, or null:
        up to there its archive is whole. */
    fill(found, shown) {
        for (const key of COLUMNS) this[key] = [];
        Object.assign(this, {step: NaN, far: NaN});
        this.mend(found, -Infinity, shown === null ? -Infinity : Number(shown) / 1e9);
    }

    /** Take what the archive has behind a time and up to another one, in place of what came live there. */
    mend({t, value, low, high, worst}, from, to) {
        const steps = Array.from(t).slice(1).map((one, k) => one - t[k]).sort((a, b) => a - b), n = steps.length - 1;
        if (n > 0) Object.assign(this, {step: steps[n >> 1], far: steps[Math.floor(0.9 * n)]});
        const at = (bound) => {
            const k = this.t.findIndex((one) => one > bound);
            return k < 0 ? this.t.length : k;
        };
        const begin = at(from), later = COLUMNS.map((key) => this[key].splice(begin, Infinity).slice(at(to) - begin));
        this.whole = Math.max(to, t.at(-1) ?? to);
        for (let k = 0; k < t.length; k++)
            if (t[k] > from) this.append(t[k], value[k], low[k], high[k], worst[k]);
        later[0].forEach((_, k) => this.add(...later.map((one) => one[k])));
    }

    /** Take a value that came live. */
    add(t, value, low = value, high = value, worst = 0) {
        const last = this.t.at(-1) ?? -Infinity;
        if (t <= last) return false;
        const near = this.whole >= last && t - Math.max(last, this.whole) <= MISSED * this.step;
        if (near) this.whole = t;
        this.append(t, value, low, high, worst);
        return true;
    }

    /** Whether something may be missing that the archive has. */
    get isOpen() { return this.whole < this.t.at(-1); }

    append(t, value, low, high, worst) {
        const last = this.t.at(-1);
        if (t <= this.whole && t - last > Math.max(FAR * this.far, LEAST))
            this.push((last + t) / 2, null, null, null, 0);
        const real = (one) => (Number.isNaN(one) ? null : one);
        this.push(t, real(value), real(low), real(high), worst);
    }

    push(...all) { COLUMNS.forEach((key, k) => this[key].push(all[k])); }

    /** Forget what is before a time. */
    drop(before) {
        let n = 0;
        while (this.t[n] < before) n++;
        if (n > 100) for (const key of COLUMNS) this[key].splice(0, n);
    }

    get table() { return [this.t, this.value, this.low, this.high]; }
}

/** Reads from the archive what curves did not get live. read(from, to) [s]: the archive's series of each curve;
 *  done(): they are drawn anew */
export class Mender {
    constructor(read, done) { Object.assign(this, {read, done, busy: false, next: 0}); }

    /** Look whether something may be missing of what is in view, from a time on. */
    async look(curves, begin) {
        const open = curves.filter((curve) => curve.isOpen);
        if (this.busy || !open.length || performance.now() < this.next) return;
        const from = Math.max(begin, Math.min(...open.map(({whole}) => whole)));
        const to = Math.max(...curves.map((curve) => curve.t.at(-1) ?? -Infinity));
        this.busy = true;
        let pause = 10 * AGAIN;
        try {
            const found = await this.read(from, to);
            if (found) curves.forEach((one, k) => one.mend(found[k], Math.max(from, one.whole), to));
            this.done();
            pause = AGAIN;
        } catch { // it is asked for again
        } finally {
            this.busy = false;
            this.next = performance.now() + pause;
        }
    }
}
