// SPDX-License-Identifier: Apache-2.0
// Charts of curves, which follow live values and the archive.
import uPlot from "uplot";
import {of, series} from "./api.js";
import {Curve, Mender, room} from "./curve.js";
import {visible} from "./dom.js";
import {bare, clock, dateText, ns, seconds, span} from "./format.js";
import {isStale, real} from "./store.js";
import {CONCERNS, SHAPES} from "./words.js";

const MARK = 6;     // [px] the mark of a value beyond limits

const COLOURS = {   // which colour-blind users can distinguish, too
    dark: ["#56b4e9", "#e69f00", "#33c79a", "#f0e442", "#e08ab8", "#ff7a45", "#c9d1d9"],
    light: ["#0062a3", "#b86b00", "#007a5a", "#8a7a00", "#a8457d", "#c03f00", "#3c4650"],
};

/** Curves in one chart.
 *
 *  words(t): a time in s as text;  now(): the time that is shown, in s;  mark(): the time of the line, in s, or null
 *  gaps(): [[from, to], ...] in s;  zoom(from, to), seek(t), whole(): called after a drag, a click, a double click
 */
export function chart({holder, curves, slots, theme, words, tick, now, mark, gaps, zoom, seek, whole, height}) {
    const css = getComputedStyle(holder), ink = css.getPropertyValue("--soft"), line = css.getPropertyValue("--line");
    const axis = {stroke: ink, grid: {stroke: line, width: 1}, ticks: {stroke: line, width: 1}, font: "11px system-ui"};
    const colour = (k) => COLOURS[theme][k % COLOURS[theme].length];
    const labels = slots[0]?.labels ?? [];
    const shown = (slot, y) => (y === null || y === undefined ? "\u2013" :
        slot?.labels?.[y] ??
        `${slot?.kind === "time" ? dateText(ns(y)) : real(y, slot?.single)} ${bare(slot?.unit)}`.trim());
    /** Numbers of an axis, with as many digits as distinguish them. */
    const numbers = (all, step) => {
        if (slots.every((slot) => slot?.kind === "time")) return all.map((y) => clock(ns(y), true, 0).slice(-8));
        const size = Math.max(...all.map(Math.abs)), digits = Math.max(1, Math.ceil(Math.log10(size / step)) + 1);
        return all.map((y) => (labels.length ? labels[y] ?? "" : y && (size >= 1e6 || size < 1e-3) ?
            y.toExponential(Math.min(digits - 1, 12)) : String(+y.toPrecision(Math.min(digits + 1, 15)))));
    };
    const state = (text, level) => (level ? `${text} ${SHAPES[level]} ${CONCERNS[level]}` : text);
    /** A curve's value at the time that is shown, with its age if it is stale. */
    const newest = (curve, slot) => {
        let k = curve.t.length - 1;
        while (k > 0 && (curve.t[k] > now() || curve.value[k] === null)) k--;
        const age = now() - curve.t[k];
        return k < 0 ? "\u2013" : state(shown(slot, curve.value[k]), curve.worst[k]) +
            (isStale(slot, age) ? `, ${span(age)} old` : "");
    };
    /** Mark the steps of time in which values were beyond limits. */
    const beyond = (u, curve) => curve.worst.forEach((level, k) => {
        const x = level && curve.value[k] !== null && u.valToPos(curve.t[k], "x", true);
        if (!level || !(x >= u.bbox.left && x <= u.bbox.left + u.bbox.width)) return;
        const [high, low] = [curve.high[k], curve.low[k]].map((y) => u.valToPos(y, "y", true));
        u.ctx.fillStyle = css.getPropertyValue(`--${CONCERNS[level]}`);
        u.ctx.fillRect(x - MARK / 2, high - MARK / 2, MARK, low - high + MARK);
    });
    const units = new Set(slots.filter((slot) => !slot?.labels?.length).map((slot) => bare(slot?.unit) || "[-]"));
    const {base, labels: names} = named(curves.map((curve) => curve.name));
    const edge = {stroke: null, points: {show: false}, width: 0};
    const steps = (k) => (["label", "boolean"].includes(slots[k]?.kind) ? uPlot.paths.stepped({align: 1}) : undefined);
    return new uPlot({
        title: visible(base),
        width: Math.max(200, holder.clientWidth),
        height,
        padding: [8, 26, 0, 0],
        tzDate: (t) => uPlot.tzDate(new Date(t * 1e3), "Etc/UTC"),
        scales: {x: {time: true, auto: false}, y: {range: (_, low, high) => room(low, high)}},
        axes: [
            {...axis, size: 28, space: 70, values: (_, all, __, ___, step) => all.map((t) => tick(t, step))},
            {...axis, size: 62, label: visible([...units].join(", ")) || " ", labelSize: 18, labelGap: 2,
                labelFont: axis.font, values: (_, all, __, ___, step) => numbers(all, step)}
        ],
        series: [
            {label: "t", value: (_, t) => (t === null || t === undefined ? "" : words(t))},
            ...curves.flatMap((curve, k) => [{
                label: visible(names[k]),
                stroke: colour(k),
                width: 1.5,
                paths: steps(k),
                value: (u, y, _, i) => (u.cursor.left < 0 ? newest(curve, slots[k]) :
                    state(shown(slots[k], y), curve.worst[curve.t.lastIndexOf(u.data[0][i])]))
            },
                                  {...edge, label: "low", show: true}, {...edge, label: "high", show: true}])
        ],
        bands: curves.map((_, k) => ({series: [3 * k + 3, 3 * k + 2], fill: `${colour(k)}38`})),
        cursor:
            {sync: {key: "console", setSeries: false}, drag: {x: true, y: false, setScale: false}, points: {size: 5}},
        legend: {live: true, markers: {width: 2}},
        hooks: {
            drawClear: [(u) => {
                u.ctx.fillStyle = css.getPropertyValue("--gap");
                for (const [from, to] of gaps()) {
                    const a = Math.max(u.bbox.left, u.valToPos(from, "x", true));
                    const b = Math.min(u.bbox.left + u.bbox.width, u.valToPos(to, "x", true));
                    if (b > a)
                        u.ctx.fillRect(a, u.bbox.top, b - a, u.bbox.height);
                }
            }],
            draw: [(u) => {
                for (const curve of curves) beyond(u, curve);
                const t = mark();
                if (t === null)
                    return;
                const x = u.valToPos(t, "x", true);
                if (x < u.bbox.left || x > u.bbox.left + u.bbox.width)
                    return;
                u.ctx.fillStyle = css.getPropertyValue("--past");
                u.ctx.fillRect(x - 1, u.bbox.top, 2, u.bbox.height);
            }],
            setSelect: [(u) => {
                if (u.select.width < 4)
                    return;
                zoom(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x"));
                u.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
            }],
            ready: [(u) => {
                let down = 0;
                u.over.addEventListener("mousedown", (event) => { down = event.clientX; });
                u.over.addEventListener("click", (event) => {
                    if (Math.abs(event.clientX - down) < 4 && event.detail === 1) seek(u.posToVal(event.offsetX, "x"));
                });
                u.over.addEventListener("dblclick", (event) => {
                    event.stopImmediatePropagation();
                    whole();
                }, true);
            }],
        },
    },
        data(curves), holder);
}

/** The curves of a page by their names: samples of the archive, and live values after them. changed(): samples that did
 *  not come live were read */
export class Curves {
    constructor({api, time, craft}, store, points, changed) {
        Object.assign(this, {api, time, craft, store, points, all: new Map(), request: 0});
        this.mender = new Mender(async (from, to) => {
            const {request} = this, archived = await this.read(from, to);
            return request === this.request && archived;
        }, changed);
    }

    /** Have a curve of each of these names. */
    have(names) {
        for (const name of [...this.all.keys()]) if (!names.includes(name)) this.all.delete(name);
        for (const name of names) if (!this.all.has(name)) this.all.set(name, new Curve(name));
    }

    get list() { return [...this.all.values()]; }

    async read(from, to) {
        return series(await this.api.bytes(of(this.craft, "history"), {
            names: [...this.all.keys()].join(","), from_ns: ns(from), to_ns: ns(to) + 1000n, points: this.points,
            session: this.time.session, format: "binary"}));
    }

    /** Read the samples of a span of time [s]. Returns whether no later request has begun. */
    async load(from, to) {
        const turn = ++this.request, shown = this.store.t, archived = await this.read(from, to);
        if (turn === this.request) this.list.forEach((curve, k) => curve.fill(archived[k], shown));
        return turn === this.request;
    }

    /** Add the newest values up to `end`; `begin`: of the view [s]. Returns whether one is new. */
    add(begin, end = Infinity) {
        const {store} = this;
        let fresh = false;
        for (const [name, curve] of this.all) {
            const value = store.get(store.byName.get(name));
            if (!value || seconds(value.t) > end) continue;
            fresh = curve.add(seconds(value.t), value.number, value.number, value.number, value.level) || fresh;
            curve.drop(begin - 5);
        }
        this.mender.check(this.list, begin);
        return fresh;
    }

    close() { this.request = NaN; }     // no answer is shown any more
}

/** The common beginning of the names of curves in one chart, and the rest of each. */
export function named(names) {
    const parts = names.map((name) => name.split(/(?=[.[])/)), [first] = parts;
    const most = Math.min(...parts.map((part) => part.length - 1));
    let same = 0;
    while (same < most && parts.every((part) => part[same] === first[same])) same++;
    return {base: names.length > 1 && same ? first.slice(0, same).join("") : names.length > 1 ? "" : names[0] ?? "",
            labels: names.length > 1 ? parts.map((part) => part.slice(same).join("").replace(/^\./, "")) :
                                       names.map((name) => name.split(".").at(-1))};
}

/** The table of all curves over one axis of time. */
export const data = (curves) => (curves.length === 1 ? curves[0].table : uPlot.join(curves.map(({table}) => table)));
