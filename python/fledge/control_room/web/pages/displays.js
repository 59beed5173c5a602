// SPDX-License-Identifier: Apache-2.0
// Displays that a mission composes: rows, large values, plots and buttons of commands (control_room/displays.py).
import uPlot from "uplot";
import {of, series} from "../api.js";
import {CONCERNS, attempt, concern, dress, h, put} from "../dom.js";
import {clock} from "../format.js";
import {inWords, outcome, send, STAGES} from "../forms.js";

export const title = "Displays", key = "d";

const POINTS = 1000, COLOURS = 6;

/** A value with its digits behind the point; other texts as they are. */
export function rounded(store, slot, digits) {
    const number = store.number(slot), kind = store.slots[slot]?.kind;
    return digits == null || kind !== "real" || !Number.isFinite(number) ?
        store.text(slot) :
        number.toFixed(digits).replace("-", "\u2212");
}

export async function open(context) {
    const {root, api, live, craft, keys, selection, select} = context, store = await live.slots(craft);
    let displays = [], shown = null, ends = [], draws = [];
    const wish = context.want([]);
    const tabs = h("div", {class: "row tabs", role: "group", "aria-label": "displays"}),
          holder = h("div", {class: "display"});
    root.append(tabs, holder);

    function choose(one) {
        for (const end of ends) end();
        ends = [];
        draws = [];
        shown = one;
        select(one.name);
        tabs.replaceChildren(...displays.map(
            (other) => h("button", {"aria-pressed": String(other === one), onclick: () => choose(other)}, other.title,
                (other.problems.length > 0 || other.panels.some(({items}) => items.some(({problem}) => problem))) &&
                    " \u26a0")));
        holder.replaceChildren(...one.problems.map((text) => h("p", {class: "problem wide", role: "alert"}, text)),
            ...one.panels.map(panel));
        wish.change(
            [...new Set(one.panels.flatMap(({items}) => items.map(({slot}) => slot).filter((slot) => slot != null)))]);
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
    const unit = (slot) => (["", "-", undefined].includes(store.slots[slot]?.unit) ? "" : store.slots[slot].unit);

    function values({items}) {
        return h("table", {class: "plain"}, h("tbody", {}, items.map((item) => {
            if (item.problem) return h("tr", {}, h("td", {colSpan: 4}, wrong(item)));
            const value = h("td", {class: "num value"}), state = h("span");
            draws.push(() => {
                put(value, rounded(store, item.slot, item.digits) || "\u2013");
                concern(store.concern[item.slot], state);
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
                put(value, rounded(store, item.slot, item.digits) || "\u2013");
                concern(store.concern[item.slot], state);
                dress(value, `c${store.concern[item.slot]}`);
                value.title = CONCERNS[store.concern[item.slot]];
            });
            return h("div", {title: item.name}, h("span", {class: "soft"}, item.label),
                h("div", {}, value, h("span", {class: "soft"}, ` ${unit(item.slot)}`)), state);
        }));
    }
    function plot({items, minutes, title: name}) {
        const good = items.filter(({problem}) => !problem), place = h("div", {class: "curve"}),
              made = h("div", {}, items.filter(({problem}) => problem).map(wrong), place);
        if (!good.length) return made;
        const utc = live.craft(craft)?.clock === "utc", span = 60 * minutes, data = [[], ...good.map(() => [])];
        const common = good.every(({slot}) => unit(slot) === unit(good[0].slot)) ? unit(good[0].slot) : "";
        const colour = (word) => getComputedStyle(document.documentElement).getPropertyValue(word).trim();
        let chart = null, last = -Infinity, over = false;
        const build = () => {
            chart?.destroy();
            const axis = {
                stroke: colour("--soft"),
                grid: {stroke: colour("--line"), width: 1},
                ticks: {stroke: colour("--line"), width: 1},
                font: "11px system-ui"
            };
            chart = new uPlot({
                width: place.clientWidth || 400,
                height: 220,
                legend: {live: false},
                cursor: {drag: {x: false, y: false}},
                scales: {x: {time: false}},
                axes: [
                    {
                        ...axis,
                        values: (_, all) =>
                            all.map((t) => clock(BigInt(Math.round(t * 1e9)), utc, 0).slice(utc ? 11 : 0)),
                        space: 80
                    },
                    {...axis, size: 62, label: common, labelSize: common ? 16 : 0, labelFont: "11px system-ui"}
                ],
                series: [
                    {}, ...good.map(({label}, k) => ({
                        label,
                        stroke: colour(`--plot-${k % COLOURS + 1}`),
                        width: 1.5,
                        spanGaps: true,
                        dash: k >= COLOURS ? [6, 4] : undefined
                    }))
                ]
            },
                data, place);
        };
        const size = new ResizeObserver(
            () => chart && place.clientWidth && chart.setSize({width: place.clientWidth, height: 220}));
        ends.push(() => {
            over = true;
            size.disconnect();
            chart?.destroy();
        }, context.onTheme(build));
        place.setAttribute("role", "img");
        place.setAttribute("aria-label", `plot of ${name || good.map(({label}) => label).join(", ")}`);
        requestAnimationFrame(() => {
            if (over) return;
            build();
            size.observe(place);
        });
        attempt(made, async () => {  // what was before
            const newest = BigInt(live.craft(craft)?.t_ns ?? 0);
            const found = series(await api.bytes(of(craft, "history"), {
                names: good.map(({name: one}) => one).join(","),
                from_ns: String(newest - BigInt(Math.round(span * 1e9))),
                to_ns: String(newest + 1n),
                points: POINTS,
                format: "binary"
            }));
            if (over) return;
            const times = [...new Set(found.flatMap(({t}) => [...t]))]
                              .filter((t) => !data[0].length || t < data[0][0])
                              .sort((a, b) => a - b);
            const at = found.map(({t, value}) => new Map(Array.from(t, (one, k) => [one, value[k]])));
            data[0].unshift(...times);
            good.forEach((_, k) => data[k + 1].unshift(...times.map((t) => at[k]?.get(t) ?? null)));
            chart?.setData(data);
        });
        draws.push(() => {
            const t = Math.max(...good.map(({slot}) => (store.seen[slot] ? Number(store.at(slot)) / 1e9 : -Infinity)));
            if (!(t > last) && t > last - 1) return;
            if (t < last - 1)
                for (const one of data) one.length = 0;  // the craft began again
            last = t;
            data[0].push(t);
            good.forEach(({slot}, k) => data[k + 1].push(store.seen[slot] ? store.number(slot) : null));
            const old = data[0].findIndex((one) => one >= t - span);
            if (old > 0)
                for (const one of data) one.splice(0, old);
            chart?.setData(data);
        });
        return made;
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
                                      STAGES.filter((stage) => row.stages.some((one) => one.stage === stage))
                                          .map((one) => `\u2713 ${one}`)
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
                                          for (const row of id === null ? [] : await api.get(of(craft, "sent")))
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
        for (const one of draws) one();
    };
    context.onFrame(draw);
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
