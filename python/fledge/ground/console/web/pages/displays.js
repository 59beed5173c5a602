// SPDX-License-Identifier: Apache-2.0
// Displays of a mission's files: rows, large values, plots and buttons of commands (ground/server/displays.py).
import {of, series, valuesAt} from "../api.js";
import {CONCERNS, attempt, concern, dress, h, put} from "../dom.js";
import {Curve, Mender} from "../curve.js";
import {chart, data} from "../curves.js";
import {bare, span as ago} from "../format.js";
import {inWords, outcome, send, STAGES} from "../forms.js";
import {ageOf, isStale, valueText} from "../store.js";
import {theme} from "../theme.js";

export const title = "Displays", key = "d";

const POINTS = 1000, HEIGHT = 230;
const ns = (t) => BigInt(Math.round(t * 1e6)) * 1000n;

/** A number with its digits behind the point; null: no such number. */
const rounded = (number, about, digits) => {
    if (digits == null || about?.kind !== "real" || !Number.isFinite(number)) return null;
    return number.toFixed(digits).replace(/^-(0[.0]*)$/, "$1").replace("-", "\u2212");
};

const hasProblem = ({problems, panels}) => problems.length > 0 ||
    panels.some(({items}) => items.some(({problem}) => problem));

export async function open(context) {
    const {root, api, live, time, craft, keys, selection, select} = context, store = await live.slots(craft);
    let displays = [], shown = null, ends = [], draws = [], loads = [], past = null;
    const wish = context.want([]);
    const tabs = h("div", {class: "row tabs", role: "group", "aria-label": "displays"}),
          holder = h("div", {class: "display"});
    root.append(tabs, holder);

    function choose(display) {
        for (const end of ends) end();
        ends = [];
        draws = [];
        loads = [];
        shown = display;
        select(display.name);
        tabs.replaceChildren(...displays.map(
            (other) => h("button", {"aria-pressed": String(other === display), onclick: () => choose(other)},
                other.title, hasProblem(other) && " \u26a0")));
        holder.replaceChildren(...display.problems.map((text) => h("p", {class: "problem wide", role: "alert"}, text)),
            ...display.panels.map(panel));
        const slots = display.panels.flatMap(({items}) => items.map(({slot}) => slot));
        wish.change([...new Set(slots.filter((slot) => slot != null))]);
        draw();
        if (!time.isLive) attempt(root, remember);
    }
    /** An item's value as text: the newest, or that at the time that is shown. */
    function text({slot, digits}) {
        const about = store.slots[slot];
        if (time.isLive) return rounded(store.number(slot), about, digits) ?? (store.text(slot) || "\u2013");
        const old = past?.get(slot);
        return old === undefined ? "\u2013" : rounded(old.value ?? NaN, about, digits) ?? valueText(about, old);
    }
    /** [s] The age of an item's value if it is stale, else 0. */
    function old({slot}) {
        const t = time.isLive ? store.seen[slot] && store.at(slot) : past?.get(slot)?.t;
        const age = typeof t === "bigint" ? ageOf(t, time.at) : 0;
        return isStale(store.slots[slot], age) ? age : 0;
    }
    /** Show an item's state; if it has none, the age of a stale value. */
    function judge(item, value, state, name) {
        const age = old(item), how = level(item.slot);
        concern(how, state);
        if (age && !how) put(state, `${ago(age)} old`);
        dress(value, `${name} ${age ? "soft" : `c${how}`}`.trim());
    }
    const hasNumber = (slot) => !["text", "binary"].includes(store.slots[slot]?.kind);
    const level = (slot) => (time.isLive ? store.concern[slot] : past?.get(slot)?.concern ?? 0);
    async function remember() {
        const {at} = time, items = shown?.panels.flatMap((panel) => panel.items).filter(({slot}) => slot != null) ?? [];
        past = null;
        if (!time.isLive && items.length) {
            const values = await valuesAt(api, craft, [...new Set(items.map(({name}) => name))], at, time.session);
            if (at !== time.at) return;
            past = new Map(items.filter(({name}) => values.has(name)).map(({name, slot}) => [slot, values.get(name)]));
        }
        draw();
    }
    const wrong = (item) =>
        h("p", {class: "problem", title: item.problem}, h("strong", {}, item.label || item.name), " ", item.problem);
    function panel(about) {
        const make = {values, large, plot, commands}[about.kind];
        return h("section",
            {class: `panel ${about.kind}${about.wide ? " wide" : ""}`, "aria-label": about.title || about.kind},
            about.title && h("h3", {}, about.title), make(about));
    }
    const unit = (slot) => bare(store.slots[slot]?.unit);

    function values({items}) {
        return h("table", {class: "plain"}, h("tbody", {}, items.map((item) => {
            if (item.problem) return h("tr", {}, h("td", {colSpan: 4}, wrong(item)));
            const value = h("td", {class: "num value"}), state = h("span");
            draws.push(() => {
                put(value, text(item));
                judge(item, value, state, "num value");
            });
            return h("tr", {title: item.name}, h("td", {class: "name"}, item.label), value,
                h("td", {class: "soft"}, unit(item.slot)), h("td", {class: "state"}, state));
        })));
    }
    function large({items}) {
        return h("div", {class: "numbers"}, items.map((item) => {
            if (item.problem) return wrong(item);
            const value = h("strong"), state = h("span");
            draws.push(() => {
                put(value, text(item));
                judge(item, value, state, "");
                value.title = CONCERNS[level(item.slot)];
            });
            return h("div", {title: item.name}, h("span", {class: "soft"}, item.label),
                h("div", {}, value, h("span", {class: "soft"}, ` ${unit(item.slot)}`)), state);
        }));
    }
    function plot({items, minutes, title: name}) {
        const good = items.filter(({slot}) => slot != null && hasNumber(slot)), span = 60 * minutes;
        const curves = good.map((item) => new Curve(item.name)), holder = h("div", {
            class: "curve",
            role: "img",
            "aria-label": `plot of ${name || good.map(({label}) => label).join(", ")}`
        });
        const section = h("div", {}, items.filter(({problem}) => problem).map(wrong), holder);
        if (!good.length) return section;
        let drawn = null, over = false, last = 0;
        const build = () => {
            drawn?.destroy();
            drawn = chart({
                holder,
                curves,
                slots: good.map(({slot}) => store.slots[slot]),
                theme: theme(),
                height: HEIGHT,
                words: (t) => time.text(ns(t), 3),
                tick: (t) => time.text(ns(t), 0).slice(time.utc ? 11 : 0),
                now: () => Number(time.at) / 1e9,
                mark: () => null,
                gaps: () => [],
                zoom() {},
                seek() {},
                whole() {},
            });
            show();
        };
        const show = () => {
            if (!drawn) return;
            const to = Number(time.at) / 1e9;
            drawn.setData(data(curves), false);
            drawn.setScale("x", {min: time.utc ? to - span : Math.max(0, to - span), max: to});
            if (drawn.cursor.left < 0) drawn.setLegend({idx: drawn.data[0].length - 1}, false);
        };
        let request = 0;
        const read = async (from, to) => series(await api.bytes(of(craft, "history"), {
            names: good.map((item) => item.name).join(","), from_ns: from, to_ns: to + 1n, points: POINTS,
            session: time.session, format: "binary"}));
        const mender = new Mender(async (from, to) => {
            const turn = request, archived = await read(ns(from), ns(to) + 1000n);
            return !over && turn === request && archived;
        }, show);
        const load = async () => {  // the samples before the page was opened
            const {at} = time, turn = ++request, shown = store.t, archived = await read(at - ns(span), at);
            if (over || turn !== request) return;
            curves.forEach((curve, k) => curve.fill(archived[k], shown));
            show();
        };
        const fit = new ResizeObserver(() => {
            if (!drawn && !over && holder.clientWidth)
                build();
            else if (drawn && holder.clientWidth)
                drawn.setSize({width: holder.clientWidth, height: HEIGHT});
        });
        fit.observe(holder);
        ends.push(() => {
            over = true;
            fit.disconnect();
            drawn?.destroy();
        }, context.onTheme(build));
        loads.push(() => attempt(section, load));
        attempt(section, load);
        draws.push(() => {
            if (!time.isLive) return;
            let fresh = false;
            good.forEach(({slot}, k) => {
                if (!store.seen[slot]) return;
                const value = store.number(slot), t = Number(store.at(slot)) / 1e9;
                fresh = curves[k].add(t, value, value, value, store.concern[slot]) || fresh;
                curves[k].drop(Number(time.newest) / 1e9 - span - 5);
            });
            mender.check(curves, Number(time.newest) / 1e9 - span);
            if (!fresh || performance.now() - last < 95) return;
            last = performance.now();
            show();
        });
        return section;
    }
    function commands({items}) {
        const may = context.can("command"), answer = h("p", {class: "answer", role: "status"});
        let id = null;
        const follow = (row) => {
            if (row.id !== id || (row.craft ?? craft) !== craft) return;
            const {state, text} = outcome(row);
            put(answer,
                `${row.name}: ${
                    state === "bad" ? `\u2717 ${text}` :
                                      STAGES.filter((stage) => row.stages.some((reached) => reached.stage === stage))
                                          .map((stage) => `\u2713 ${stage}`)
                                          .join("  ")}`);
            dress(answer, `answer ${state === "bad" ? "problem" : ""}`);
        };
        ends.push(live.on("sent", follow));
        return h("div", {class: "buttons"},
            items.map((item) => (item.problem ?
                              wrong(item) :
                              h("button", {
                                  disabled: !may,
                                  title: `${item.command} ${inWords(item.arguments)}`.trim(),
                                  onclick: async () => {
                                      put(answer, "");
                                      dress(answer, "answer");
                                      try {
                                          id = await send(api, craft, item.command, item.arguments);
                                          put(answer, id === null ? "Not sent." : `${item.command}: sent`);
                                          for (const row of id === null ? [] : await live.rows(craft, "sent", "sent"))
                                              follow(row);
                                      } catch (error) {
                                          put(answer, error.message);
                                          dress(answer, "answer problem");
                                      }
                                  }
                              },
                                  item.label))),
            answer);
    }
    const draw = () => {
        for (const draw of draws) draw();
    };
    context.onFrame(draw);
    context.onTime(() => {
        attempt(root, remember);
        for (const load of loads) load();
    });
    for (let k = 1; k < 10; k++) keys.add(String(k), `display ${k}`, () => displays[k - 1] && choose(displays[k - 1]));
    await attempt(root, async () => {
        displays = await api.get(of(craft, "displays"));
        if (displays.length)
            choose(displays.find(({name}) => name === selection) ?? displays[0]);
        else
            holder.append(h("p", {class: "none soft wide"},
                "There are no displays. One is a file displays/NAME.toml beside the control room's file, or in the " +
                    "mission's folder."));
    });
    return () => {
        for (const end of ends) end();
    };
}
