// SPDX-License-Identifier: Apache-2.0
// Plots: live and back in time on one axis; after a zoom the page reads the archive anew.
import {attempt, h, put} from "../dom.js";
import {Curves, chart, data} from "../curves.js";
import {matcher, ns, seconds} from "../format.js";
import {button, choice, head, search} from "../parts.js";
import {together} from "../store.js";
import {theme} from "../theme.js";

export const title = "Plots", key = "l";

const SPANS = [[60, "1 min"], [300, "5 min"], [1800, "30 min"], [7200, "2 h"], [86400, "1 day"], [0, "session"]];
const POINTS = 1200, OFFERS = 12, LEAST = 0.1;

export async function open(context) {
    const {root, live, time, craft, keys} = context, store = await live.slots(craft);
    /** The parameters of each chart; in the link, "a,b;c". */
    let names = context.selection.split(";")
        .map((chart) => chart.split(",").filter(Boolean).flatMap(
            (name) => (store.byName.has(name) ? [name] : together(store, `${name}[0]`))))
        .filter((chart) => chart.length);
    let charts = [], fixed = null, drawn = 0, behind = false;
    const problem = h("div"), grid = h("div", {class: "charts"}), loading = h("span", {class: "soft", role: "status"});
    const wish = context.want([], 20), curves = new Curves(context, store, POINTS, () => show(true));
    const span = choice("span of time", SPANS, () => follow(), {value: 300});
    const offers = h("div", {class: "offers", hidden: true});
    const added = search("add a parameter", "add a parameter  ( / )", () => offer(), {size: 34, onfocus: () => offer(),
        onkeydown: (event) => event.key === "Enter" &&
            offers.querySelectorAll("button")[event.shiftKey ? 1 : 0]?.click()});

    function offer() {
        const fits = matcher(added.value), indexed = /\[\d+\]$/, wanted = added.value.trim(), fit = [];
        const known = new Set();
        for (const {name, kind} of wanted ? store.slots.filter(Boolean) : []) {
            if (["text", "binary"].includes(kind) || known.has(name) || !fits(name)) continue;
            const all = indexed.test(wanted) ? [name] : together(store, name);
            for (const component of all) known.add(component);
            fit.push({name: all.length > 1 ? `${name.replace(indexed, "")}, ${all.length} components` : name, all});
            if (fit.length === OFFERS) break;
        }
        offers.hidden = !wanted;
        offers.replaceChildren(...fit.map((match) => h("div", {},
            button(match.name, () => add(match.all, false), {class: "branch", title: "in a plot of its own (Enter)"}),
            button("onto the last", () => add(match.all, true),
                {class: "small", disabled: !names.length, title: "into the last plot (Shift Enter)"}))));
        if (!fit.length) offers.append(h("p", {class: "soft"}, "No parameter that has a number fits"));
    }

    function add(all, onto) {
        if (onto && names.length) names.at(-1).push(...all.filter((name) => !names.at(-1).includes(name)));
        else names.push(all);
        added.value = "";
        offers.hidden = true;
        rebuild();
    }

    // --- the time in view ---
    const now = () => seconds(time.at);
    function view() {
        if (fixed) return fixed;
        const at = now(), [begin, end] = time.extent().map(seconds);
        const long = Number(span.value) || Math.max(1, end - begin), first = time.sessions.length ? begin : -Infinity;
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
        curves.have(names.flat());
        wish.change([...curves.all.keys()].map((name) => store.byName.get(name)).filter((slot) => slot !== undefined));
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
            grid.append(h("section", {class: "panel chart"}, button("\u00d7", () => {
                names.splice(place, 1);
                rebuild();
            }, {class: "small remove", "aria-label": `remove the plot of ${group.join(", ")}`}), holder));
            const shown = group.map((name) => curves.all.get(name));
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
                now,
                mark: () => (time.isLive ? null : now()),
                gaps: () => time.entry?.gaps?.map(([from, to]) => [seconds(from), seconds(to)]) ?? [],
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

    /** Read the samples in view from the archive. */
    async function load() {
        clearTimeout(behind);
        show(false);
        if (!curves.all.size) return;
        put(loading, "reading\u2026");
        const newest = await attempt(problem, () => curves.load(...view()));
        if (newest === false) return;
        put(loading, "");
        show(true);
    }

    function tick() {
        if (!time.isLive) return;
        const fresh = curves.add(view()[0], fixed?.[1]), at = performance.now();
        if (fixed ? !fresh : at - drawn < 95) return;
        drawn = at;
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
    root.append(head(title, h("div", {class: "searching"}, added, offers), span,
        button("Whole span", follow, {title: "follow the time again (0)"}), loading),
        problem, none, grid);
    keys.add("0", "follow the time again", follow);
    keys.add("+", "zoom in", () => scale(0.5));
    keys.add("-", "zoom out", () => scale(2));
    keys.add("ArrowLeft", "look earlier", () => shift(-0.25));
    keys.add("ArrowRight", "look later", () => shift(0.25));
    keys.add("x", "remove the last plot", () => { names.pop(); rebuild(); });
    context.onFrame(tick);
    context.onTime(() => {
        if (fixed && (time.isLive || now() < fixed[0] || now() > fixed[1])) fixed = null;
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
        curves.close();
        fit.disconnect();
        document.removeEventListener("visibilitychange", awake);
        for (const chart of charts) chart.plot.destroy();
    };
}
