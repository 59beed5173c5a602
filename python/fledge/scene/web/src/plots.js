// SPDX-License-Identifier: Apache-2.0
// Plots of recorded fields. All of them and the picture share one time axis and one cursor.
import uPlot from "uplot";

import {TIME_STEPS, aroundConstant} from "./axis.js";
import {age, level} from "./data.js";

const COLOURS = {
    dark: ["#58b7ff", "#ff9d5c", "#7ee08a", "#e58cff", "#ffd75e", "#5ee0d6", "#ff7f97", "#b7c4d0"],
    light: ["#1f6fb5", "#c8581a", "#2f8a45", "#8c3fb0", "#a07800", "#0c8a82", "#bf3350", "#5b6874"]
};

export class Plots {
    /** seek(t): the user has chosen a time. */
    constructor(data, panel, seek) {
        Object.assign(this, {data, seek, t: data.begin, theme: "dark", charts: new Map()});
        this.span = [data.begin, data.end];
        this.choice = document.createElement("details");
        this.choice.className = "choice";
        this.choice.innerHTML = "<summary>Fields</summary><input type=search placeholder='find a field'><div></div>";
        this.grid = document.createElement("div");
        this.grid.className = "charts";
        panel.append(this.choice, this.grid);
        this.fill();
        this.observer = new ResizeObserver(() => this.fit());
        this.observer.observe(this.grid);
    }

    fill() {
        const list = this.choice.querySelector("div"), search = this.choice.querySelector("input");
        for (const plot of this.data.plots) {
            const row = document.createElement("label"), box = document.createElement("input");
            box.type = "checkbox";
            box.onchange = () => (box.checked ? this.add(plot) : this.remove(plot));
            plot.box = box;
            row.append(box, ` ${plot.name}${plot.unit && plot.unit !== "-" ? ` [${plot.unit}]` : ""}`);
            row.title = plot.meaning;
            list.append(row);
        }
        search.oninput = () => {
            for (const row of list.children)
                row.hidden = !row.textContent.toLowerCase().includes(search.value.toLowerCase());
        };
    }

    /** Show the first plots: errors and actuators before states. */
    begin(count) {
        const worth = (name) => [/error\.sigma/, /speeds\.Omega$/, /command\.u$/, /output\.thrust$/, /error\.omega/,
                                 /sigma_BN$/, /omega_BN_B$/]
                                    .findIndex((pattern) => pattern.test(name)) >>>
            0;
        const rank = ({name, signal}) => worth(name) + (signal.time.n ? 0 : 2 ** 32);
        for (const plot of [...this.data.plots].sort((a, b) => rank(a) - rank(b)).slice(0, count)) {
            plot.box.checked = true;
            this.add(plot);
        }
    }

    add(plot) {
        if (this.charts.has(plot)) return;
        const {signal} = plot, n = signal.values.k, rows = signal.time.n;
        plot.table ??= table(signal);
        const holder = document.createElement("div");
        this.grid.append(holder);
        const css = getComputedStyle(this.grid), ink = css.getPropertyValue("--soft"),
              line = css.getPropertyValue("--line");
        const axis =
            {stroke: ink, grid: {stroke: line, width: 1}, ticks: {stroke: line, width: 1}, font: "11px system-ui"};
        const field = shortest(plot, this.data.plots);
        const chart = new uPlot({
            width: 320, height: 170,
            title: `${field}${plot.unit && plot.unit !== "-" ? ` [${plot.unit}]` : ""}${rows ? "" : ", never written"}`,
            scales: { x: { time: false, min: this.span[0], max: this.span[1] }, y: { range: (_, low, high) =>
                aroundConstant(low, high) ?? (low == null ? [null, null] : uPlot.rangeNum(low, high, 0.1, true)) } },
            padding: [8, 28, 0, 0],      // half of the last mark's words
            axes: [{ ...axis, size: 26, space: 60, incrs: TIME_STEPS, values: (_, ticks) => ticks.map(clock) },
                { ...axis, size: 58, values: (_, ticks) => ticks.map((tick) => short(tick)) }],
            series: [{ label: "t", value: (_, t) => (t == null ? "" : clock(t)) },
                ...Array.from({ length: n }, (_, k) => ({
                label: plot.labels[k] || field, stroke: COLOURS[this.theme][k % 8], width: 1.4, points: { show: false },
                value: (_, y) => (y == null ? "" : y.toPrecision(5)) }))],
            cursor: { sync: { key: "fledge", setSeries: false }, drag: { x: true, y: false }, points: { size: 5 } },
            hooks: {
                drawClear: [(drawn) => {
                    drawn.ctx.fillStyle = css.getPropertyValue("--stale");
                    const {left, top, width, height} = drawn.bbox;
                    for (const ends of stale(signal)) {
                        const [a, b] = ends.map((t) => Math.max(left, Math.min(left + width,
                                                                              drawn.valToPos(t, "x", true))));
                        drawn.ctx.fillRect(a, top, b - a, height);
                    }
                }],
                draw: [(drawn) => {
                    const x = drawn.valToPos(this.t, "x", true), { left, top, width, height } = drawn.bbox;
                    if (x < left || x > left + width) return;
                    drawn.ctx.fillStyle = css.getPropertyValue("--accent");
                    drawn.ctx.fillRect(x - 0.75, top, 1.5, height);
                }],
                setScale: [(zoomed, key) => key === "x" && this.zoom(zoomed, zoomed.scales.x.min, zoomed.scales.x.max)],
                ready: [(opened) => opened.over.addEventListener("click", (event) => {
                    if (!opened.select.width) this.seek(opened.posToVal(event.offsetX, "x"));
                })],
            },
        }, plot.table, holder);
        chart.root.title = plot.meaning;
        chart.over.addEventListener("dblclick", () => this.zoom(null, this.data.begin, this.data.end));
        this.charts.set(plot, {chart, holder});
        this.fit();
    }

    remove(plot) {
        const shown = this.charts.get(plot);
        shown?.chart.destroy();
        shown?.holder.remove();
        this.charts.delete(plot);
    }

    /** Show the new samples, up to data.end. Charts that showed all times show the new times, too. */
    extend(before) {
        const whole = this.span[0] <= this.data.begin && this.span[1] >= before;
        for (const plot of this.data.plots) plot.table = null;
        for (const [plot, {chart}] of this.charts) chart.setData(plot.table = table(plot.signal), false);
        if (whole) this.zoom(null, this.data.begin, this.data.end);
    }

    /** Give all charts the same span of time. */
    zoom(source, min, max) {
        if (this.zooming || !(max > min)) return;
        this.zooming = true;
        this.span = [min, max];
        for (const {chart} of this.charts.values())
            if (chart !== source) chart.setScale("x", {min, max});
        this.zooming = false;
    }

    fit() {
        for (const {chart, holder} of this.charts.values()) {
            const width = holder.clientWidth;
            if (width > 60 && Math.abs(width - chart.width) > 1) chart.setSize({width, height: 170});
        }
    }

    /** Move the line of the present time. */
    show(t) {
        this.t = t;
        for (const [plot, {chart}] of this.charts) {
            chart.redraw(false);
            if (chart.cursor.left >= 0) continue;  // else it shows the values at the pointer
            const cells = chart.root.querySelectorAll(".u-value");
            const since = age(plot.signal, t);
            cells[0].textContent = clock(Math.round(10 * t) / 10) + (since ? `, ${since.toFixed(0)} s old` : "");
            for (let k = 1; k < cells.length; k++)
                cells[k].textContent = number(level(plot.signal, t, k - 1), (y) => y.toPrecision(5));
            chart.root.classList.toggle("stale", since > 0);
        }
    }

    setTheme(theme) {
        this.theme = theme;
        const open = [...this.charts.keys()];
        for (const plot of open) this.remove(plot);
        for (const plot of open) this.add(plot);
    }
}

/** The shortest unique ending of a field's name: "error.sigma_BR", or "tracking.error.sigma_BR". */
function shortest({name}, plots) {
    const parts = name.split(".");
    for (let n = 2; n < parts.length; n++) {
        const end = parts.slice(-n).join(".");
        if (plots.every((plot) => plot.name === name || !plot.name.endsWith(`.${end}`))) return end;
    }
    return name;
}

/** [[from, to], ...] [s] when a signal was stale. */
function stale({time, written}) {
    const periods = [];
    for (let i = 0, on = false; written && i < time.n; i++) {
        if (Number.isNaN(written.data[i])) {
            on = false;
        } else if (on) {
            periods.at(-1)[1] = time.data[i];
        } else {
            periods.push([time.data[i], time.data[i]]);
            on = true;
        }
    }
    return periods;
}

/** The columns of a signal, as uPlot has them. */
function table({time, values}) {
    const columns = Array.from({length: values.k}, (_, k) => {
        const column = new Float64Array(time.n);
        for (let i = 0; i < time.n; i++) column[i] = values.data[values.k * i + k];
        return column.some(Number.isNaN) ? Array.from(column, (y) => (Number.isNaN(y) ? null : y)) : column;
    });
    return [time.data.subarray(0, time.n), ...columns];
}

/** A number in words; a dash where there is none. */
export const number = (value, words) => (Number.isNaN(value) ? "\u2013" : words(value));

/** 3723.5 -> "1:02:03.5" */
export function clock(t) {
    const sign = t < 0 ? "\u2212" : "", whole = Math.abs(t), hours = Math.floor(whole / 3600);
    const minutes = Math.floor(whole / 60) % 60, seconds = whole % 60;
    const shown = Math.abs(seconds - Math.round(seconds)) <= 1e-6 ? String(Math.round(seconds)) : seconds.toFixed(2);
    return `${sign}${hours}:${String(minutes).padStart(2, "0")}:${shown.replace(/^(\d)(?=\.|$)/, "0$1")}`;
}

function short(value) {
    const size = Math.abs(value);
    return size && (size >= 1e5 || size < 1e-3) ? value.toExponential(1) : String(+value.toPrecision(4));
}
