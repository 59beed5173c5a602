// SPDX-License-Identifier: Apache-2.0
// Displays of a mission's files: rows, large values, plots and buttons of commands (ground/server/displays.py).
import {of} from "../api.js";
import {attempt, dress, h, put} from "../dom.js";
import {Curves, chart, data} from "../curves.js";
import {bare, ns, seconds, span as ago} from "../format.js";
import {Followed, inWords, reached, send} from "../forms.js";
import {answerLine, button, concern} from "../parts.js";
import {Shown} from "../shown.js";
import {theme} from "../theme.js";
import {CONCERNS} from "../words.js";

export const title = "Displays", key = "d";

const POINTS = 1000, HEIGHT = 230;

/** A number with its digits behind the point; null: no such number. */
const rounded = (number, about, digits) => {
    if (digits == null || about?.kind !== "real" || !Number.isFinite(number)) return null;
    return number.toFixed(digits).replace(/^-(0[.0]*)$/, "$1").replace("-", "\u2212");
};

const hasProblem = ({problems, panels}) => problems.length > 0 ||
    panels.some(({items}) => items.some(({problem}) => problem));

export async function open(context) {
    const {root, api, live, time, craft, keys, selection, select} = context, store = await live.slots(craft);
    let displays = [], shown = null, ends = [], draws = [], loads = [];
    const wish = context.want([]), values = new Shown(context, store);
    const tabs = h("div", {class: "row tabs", role: "group", "aria-label": "displays"}),
          holder = h("div", {class: "display"});
    root.append(tabs, values.note, holder);

    function choose(display) {
        for (const end of ends) end();
        ends = [];
        draws = [];
        loads = [];
        shown = display;
        select(display.name);
        tabs.replaceChildren(...displays.map((other) => button([other.title, hasProblem(other) && " \u26a0"],
            () => choose(other), {"aria-pressed": String(other === display)})));
        holder.replaceChildren(...display.problems.map((text) => h("p", {class: "problem wide", role: "alert"}, text)),
            ...display.panels.map(panel));
        wish.change(wanted());
        draw();
        if (!time.isLive) attempt(root, remember);
    }
    const wanted = () => [...new Set(shown.panels.flatMap(({items}) => items.map(({slot}) => slot))
        .filter((slot) => slot != null))];
    /** An item's value as text. */
    function text({slot, digits}) {
        const value = values.get(slot);
        return value ? rounded(value.number, store.slots[slot], digits) ?? (value.text || "\u2013") : "\u2013";
    }
    const level = (slot) => values.get(slot)?.level ?? 0;
    /** Show an item's state; if it has none, the age of a stale value. */
    function judge({slot}, value, state, name) {
        const [age, stale] = values.age(slot), how = level(slot), old = age > 0 && stale;
        concern(how, state);
        if (old && !how) put(state, `${ago(age)} old`);
        dress(value, `${name} ${old ? "soft" : `c${how}`}`.trim());
    }
    const hasNumber = (slot) => !["text", "binary"].includes(store.slots[slot]?.kind);
    async function remember() {
        values.past = null;
        if (shown) await values.remember(wanted());
        draw();
    }
    const wrong = (item) =>
        h("p", {class: "problem", title: item.problem}, h("strong", {}, item.label || item.name), " ", item.problem);
    function panel(about) {
        const make = {values: rows, large, plot, commands}[about.kind];
        return h("section",
            {class: `panel ${about.kind}${about.wide ? " wide" : ""}`, "aria-label": about.title || about.kind},
            about.title && h("h3", {}, about.title), make(about));
    }
    const unit = (slot) => bare(store.slots[slot]?.unit);

    function rows({items}) {
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
        const good = [...new Map(items.filter(({slot}) => slot != null && hasNumber(slot))
            .map((item) => [item.name, item])).values()], span = 60 * minutes;
        const curves = new Curves(context, store, POINTS, () => show()), holder = h("div", {class: "curve", role: "img",
            "aria-label": `plot of ${name || good.map(({label}) => label).join(", ")}`});
        const section = h("div", {}, items.filter(({problem}) => problem).map(wrong), holder);
        if (!good.length) return section;
        curves.have(good.map((item) => item.name));
        let drawn = null, last = 0;
        const build = () => {
            drawn?.destroy();
            drawn = chart({
                holder,
                curves: curves.list,
                slots: good.map(({slot}) => store.slots[slot]),
                theme: theme(),
                height: HEIGHT,
                words: (t) => time.text(ns(t), 3),
                tick: (t) => time.ofDay(ns(t), 0),
                now: () => seconds(time.at),
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
            const to = seconds(time.at);
            drawn.setData(data(curves.list), false);
            drawn.setScale("x", {min: time.utc ? to - span : Math.max(0, to - span), max: to});
            if (drawn.cursor.left < 0) drawn.setLegend({idx: drawn.data[0].length - 1}, false);
        };
        const load = async () => {  // the samples before the page was opened
            const to = seconds(time.at);
            if (await curves.load(to - span, to)) show();
        };
        const fit = new ResizeObserver(() => {
            if (!holder.clientWidth) return;
            if (drawn) drawn.setSize({width: holder.clientWidth, height: HEIGHT});
            else build();
        });
        fit.observe(holder);
        ends.push(() => {
            curves.close();
            fit.disconnect();
            drawn?.destroy();
            drawn = null;
        }, context.onTheme(build));
        loads.push(() => attempt(section, load));
        attempt(section, load);
        draws.push(() => {
            if (!time.isLive) return;
            const fresh = curves.add(seconds(time.at) - span);
            if (!fresh || performance.now() - last < 95) return;
            last = performance.now();
            show();
        });
        return section;
    }
    function commands({items}) {
        const may = context.can("command"), answer = answerLine();
        const followed = new Followed(context, ([row], {state, text}) =>
            answer.say(`${row.name}: ${state === "bad" ? `\u2717 ${text}` : reached([row])}`, state === "bad"));
        ends.push(() => followed.close());
        const act = async (item) => {
            answer.say("");
            try {
                const id = await send(api, craft, item.command, item.arguments);
                answer.say(id === null ? "Not sent." : `${item.command}: sent`);
                await followed.begin(id === null ? [] : [id]);
            } catch (error) {
                answer.say(error.message, true);
            }
        };
        return h("div", {class: "buttons"}, items.map((item) => (item.problem ? wrong(item) : button(item.label,
            () => act(item), {disabled: !may, title: `${item.command} ${inWords(item.arguments)}`.trim()}))), answer);
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
