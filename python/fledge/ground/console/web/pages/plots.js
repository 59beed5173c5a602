// SPDX-License-Identifier: Apache-2.0
// Plots: live and back in time on one axis; after a zoom the page reads the archive anew.
import {of, series} from "../api.js";
import {attempt, h, put} from "../dom.js";
import {Curve, Mender} from "../curve.js";
import {chart, data} from "../curves.js";
import {together} from "../store.js";
import {theme} from "../theme.js";

export const title = "Plots", key = "l";

const SPANS = [[60, "1 min"], [300, "5 min"], [1800, "30 min"], [7200, "2 h"], [86400, "1 day"], [0, "session"]];
const POINTS = 1200, OFFERS = 12, LEAST = 0.1;
const ns = (t) => BigInt(Math.round(t * 1e6)) * 1000n;

export async function open(context) {
    const {root, api, live, time, craft, keys} = context, store = await live.slots(craft);
    /** The parameters of each chart; in the link, "a,b;c". */
    let names = context.selection.split(";")
        .map((chart) => chart.split(",").filter(Boolean).flatMap(
            (name) => (store.byName.has(name) ? [name] : together(store, `${name}[0]`))))
        .filter((chart) => chart.length);
    let charts = [], curves = new Map(), fixed = null, request = 0, drawn = 0, behind = false;
    const problem = h("div"), grid = h("div", {class: "charts"}), loading = h("span", {class: "soft", role: "status"});
    const wish = context.want([], 20);

    const span = h("select", {"aria-label": "span of time", onchange: () => follow()},
        SPANS.map(([value, text]) => h("option", {value, selected: value === 300}, text)));
    const offers = h("div", {class: "offers", hidden: true});
    const search = h("input", {
        type: "search",
        placeholder: "add a parameter  ( / )",
        "aria-label": "add a parameter",
        size: 34,
        oninput: () => offer(),
        onfocus: () => offer(),
        onkeydown: (event) => {
            if (event.key === "Enter")
                offers.querySelectorAll("button")[event.shiftKey ? 1 : 0]?.click();
        }
    });

    function offer() {
        const words = search.value.toLowerCase().split(/\s+/).filter(Boolean), fit = [], known = new Set();
        for (const {name, kind} of words.length ? store.slots.filter(Boolean) : []) {
            if (["text", "binary"].includes(kind) || known.has(name)) continue;
            if (!words.every((part) => name.toLowerCase().includes(part))) continue;
            const all = /\[\d+\]$/.test(words.at(-1)) ? [name] : together(store, name);
            for (const component of all) known.add(component);
            fit.push({name: all.length > 1 ? `${name.replace(/\[\d+\]$/, "")}, ${all.length} components` : name, all});
            if (fit.length === OFFERS) break;
        }
        offers.hidden = !words.length;
        offers.replaceChildren(...(fit.length ? fit.map((match) => h("div", {},
                                                            h("button", {
                                                                class: "branch",
                                                                title: "in a plot of its own (Enter)",
                                                                onclick: () => add(match.all, false)
                                                            },
                                                                match.name),
                                                            h("button", {
                                                                class: "small",
                                                                disabled: !names.length,
                                                                title: "into the last plot (Shift Enter)",
                                                                onclick: () => add(match.all, true)
                                                            },
                                                                "onto the last")))
                                              : [h("p", {class: "soft"}, "No parameter that has a number fits")]));
    }

    function add(all, onto) {
        if (onto && names.length) names.at(-1).push(...all.filter((name) => !names.at(-1).includes(name)));
        else names.push(all);
        search.value = "";
        offers.hidden = true;
        rebuild();
    }

    // --- the time in view ---
    const seconds = () => Number(time.at) / 1e9;
    const length = () => {
        if (Number(span.value)) return Number(span.value);
        const [first, last] = time.extent();
        return Math.max(1, Number(last - first) / 1e9);
    };
    function view() {
        if (fixed) return fixed;
        const at = seconds(), long = length();
        const first = time.sessions.length ? Number(time.extent()[0]) / 1e9 : -Infinity;
        if (time.isLive) return [Math.min(Math.max(at - long, first), at - 10), at];
        return [at - 0.75 * long, at + 0.25 * long];
    }

    function zoom(from, to) {
        if (to - from < LEAST) [from, to] = [(from + to - LEAST) / 2, (from + to + LEAST) / 2];
        fixed = [from, to];
        load();
    }

    function follow() {
        fixed = null;
        load();
    }

    // --- charts ---
    function rebuild() {
        context.select(names.map((chart) => chart.join(",")).join(";"));
        const wanted = new Set(names.flat());
        for (const name of [...curves.keys()]) if (!wanted.has(name)) curves.delete(name);
        for (const name of wanted) if (!curves.has(name)) curves.set(name, new Curve(name));
        wish.change([...wanted].map((name) => store.byName.get(name)).filter((slot) => slot !== undefined));
        draw();
        load();
    }

    function draw() {
        for (const chart of charts) chart.plot.destroy();
        grid.replaceChildren();
        const room = root.getBoundingClientRect().bottom - grid.getBoundingClientRect().top;
        const height = Math.max(150, Math.min(460, Math.floor(room / Math.max(1, names.length)) - 90));
        charts = names.map((group, place) => {
            const holder = h("div", {class: "holder"});
            grid.append(h("section", {class: "panel chart"},
                h("button", {
                    class: "small remove",
                    "aria-label": `remove the plot of ${group.join(", ")}`,
                    onclick: () => {
                        names.splice(place, 1);
                        rebuild();
                    }
                },
                    "\u00d7"),
                holder));
            const shown = group.map((name) => curves.get(name));
            const gap = (period) => [Number(BigInt(period[0])) / 1e9, Number(BigInt(period[1])) / 1e9];
            const plot = chart({
                holder,
                curves: shown,
                slots: group.map((name) => store.slots[store.byName.get(name)]),
                theme: theme(),
                height,
                words: (t) => time.text(ns(t), 3),
                tick: (t, step) => {
                    const text = time.text(ns(t), step < 1 ? 2 : 0);
                    return time.utc ? (step >= 86400 ? text.slice(5, 10) : text.slice(11)) : text;
                },
                now: seconds,
                mark: () => (time.isLive ? null : seconds()),
                gaps: () => (time.sessions.find((session) => session.session === time.session) ?? time.sessions.at(-1))
                                ?.gaps?.map(gap) ??
                            [],
                zoom,
                seek: (t) => time.seek(ns(t)),
                whole: follow,
            });
            holder.plot = plot;     // for tests, and the browser's tools
            return {plot, holder, shown};
        });
        none.hidden = names.length > 0;
        show(true);
    }

    function show(all) {
        const [min, max] = view();
        for (const {plot, shown, holder} of charts) {
            holder.classList.toggle("empty", shown.every((curve) => !curve.t.length));
            if (all) plot.setData(data(shown), false);
            plot.setScale("x", {min, max});
            if (plot.cursor.left < 0) plot.setLegend({idx: plot.data[0].length - 1}, false);
        }
    }

    const read = async (from, to) => series(await api.bytes(of(craft, "history"), {
        names: [...curves.keys()].join(","), from_ns: ns(from), to_ns: ns(to) + 1000n, points: POINTS,
        session: time.session, format: "binary"}));
    const mender = new Mender(async (from, to) => {
        const turn = request, archived = await read(from, to);
        return turn === request && archived;
    }, () => show(true));

    /** Read the samples in view from the archive. */
    async function load() {
        clearTimeout(behind);
        const turn = ++request, wanted = [...curves.keys()];
        show(false);
        if (!wanted.length) return;
        const [from, to] = view();
        put(loading, "reading\u2026");
        await attempt(problem, async () => {
            const shown = store.t, archived = await read(from, to);
            if (turn !== request) return;
            for (const [k, name] of wanted.entries()) curves.get(name)?.fill(archived[k], shown);
        });
        if (turn !== request) return;
        put(loading, "");
        show(true);
    }

    function tick() {
        if (!time.isLive) return;
        let fresh = false;
        for (const [name, curve] of curves) {
            const slot = store.byName.get(name);
            if (slot === undefined || !store.seen[slot]) continue;
            const t = Number(store.at(slot)) / 1e9;
            if (fixed && t > fixed[1]) continue;
            const value = store.number(slot);
            fresh = curve.add(t, value, value, value, store.concern[slot]) || fresh;
            curve.drop(view()[0] - 5);
        }
        mender.check([...curves.values()], view()[0]);
        const now = performance.now();
        if (fixed ? !fresh : now - drawn < 95) return;
        drawn = now;
        show(fresh);
    }

    /** Load after the last of several actions. */
    const soon = () => {
        show(false);
        clearTimeout(behind);
        behind = setTimeout(load, 200);
    };
    const shift = (share) => {
        const [from, to] = view(), by = share * (to - from);
        fixed = [from + by, to + by];
        soon();
    };
    const scale = (by) => {
        const [from, to] = view(), middle = time.isLive && !fixed ? to : (from + to) / 2;
        fixed = [middle + (from - middle) * by, middle + (to - middle) * by];
        soon();
    };
    const none = h("p", {class: "none soft"},
        "Name a parameter above, or choose Plot at one. Drag to zoom, double-click to follow again.");
    root.append(h("div", {class: "head"}, h("h1", {}, title), h("div", {class: "searching"}, search, offers), span,
                    h("button", {onclick: follow, title: "follow the time again (0)"}, "Whole span"), loading),
        problem, none, grid);
    keys.add("0", "follow the time again", follow);
    keys.add("+", "zoom in", () => scale(0.5));
    keys.add("-", "zoom out", () => scale(2));
    keys.add("ArrowLeft", "look earlier", () => shift(-0.25));
    keys.add("ArrowRight", "look later", () => shift(0.25));
    keys.add("x", "remove the last plot", () => { names.pop(); rebuild(); });
    context.onFrame(tick);
    context.onTime(() => {
        if (fixed && (time.isLive || seconds() < fixed[0] || seconds() > fixed[1])) fixed = null;
        soon();
    });
    context.onTheme(draw);
    const awake = () => document.hidden || load();      // nothing came while the browser slept
    document.addEventListener("visibilitychange", awake);
    const fit = new ResizeObserver(() => {
        for (const {plot, holder} of charts)
            if (Math.abs(holder.clientWidth - plot.width) > 1)
                plot.setSize({width: holder.clientWidth, height: plot.height});
    });
    fit.observe(grid);
    rebuild();
    return () => {
        clearTimeout(behind);
        request++;
        fit.disconnect();
        document.removeEventListener("visibilitychange", awake);
        for (const chart of charts) chart.plot.destroy();
    };
}
