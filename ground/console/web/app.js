// SPDX-License-Identifier: Apache-2.0
// The console: its frame around the pages, and the link that holds page, craft, time and selection:
//     #/parameters?craft=imager&t=1234000000000&session=2&sel=flight.a.b
import "uplot/dist/uPlot.min.css";
import "./style.css";

import {Alarms} from "./alarms.js";
import {Api} from "./api.js";
import {attempt, dress, h, put, showWhole} from "./dom.js";
import {Keys} from "./keys.js";
import {Live} from "./live.js";
import {login} from "./login.js";
import {pages} from "./pages.js";
import {button, putAlarms} from "./parts.js";
import {Questions} from "./questions.js";
import {onTheme, turn} from "./theme.js";
import {Time} from "./time.js";

const api = new Api(), live = new Live(api), keys = new Keys(), alarms = new Alarms(live);
const time = new Time(live, keys, () => write(true));
const place = {page: "overview", craft: "", sel: ""};    // the parts of the link, besides the time
let close = () => {}, opening = 0;

const main = h("main", {tabIndex: -1});
const toasts = h("div", {class: "toasts", role: "status"});
const menu = h("nav", {"aria-label": "pages"});
const chooser = h("select", {"aria-label": "spacecraft", onchange: () => go({craft: chooser.value, sel: ""})});
const bell = h("a", {class: "alarms"}), link = h("span", {class: "link"});
const skipped = h("span", {class: "skipped", title: "updates that the server left out, as this browser was slow"});
const user = h("span", {class: "soft user"});

/** Go to another page, craft or selection; the parts of the link that `change` lacks stay. */
function go(change) {
    Object.assign(place, change);
    if (change.page && change.sel === undefined) place.sel = "";
    write(false);
    show();
}

/** Write the link. quiet: without an entry in the browser's history. */
function write(quiet) {
    const about = new URLSearchParams();
    if (place.craft) about.set("craft", place.craft);
    if (!time.isLive) about.set("t", String(time.t));
    if (time.session >= 0) about.set("session", String(time.session));
    if (place.sel) about.set("sel", place.sel);
    const hash = `#/${place.page}${String(about) && `?${about}`}`;
    if (hash !== location.hash) history[quiet ? "replaceState" : "pushState"](null, "", hash);
}

function read() {
    const [, page, text = ""] = location.hash.match(/^#\/([^?]*)\??(.*)$/s) ?? [null, ""];
    const about = new URLSearchParams(text), t = about.get("t");
    Object.assign(place,
        {page: pages.has(page) ? page : "overview", craft: about.get("craft") ?? "", sel: about.get("sel") ?? ""});
    return {t: /^-?\d+$/.test(t ?? "") ? BigInt(t) : null, session: Number(about.get("session") ?? -1)};
}

/** Show the page of the link. */
async function show(at = {t: time.t, session: time.session}) {
    const number = ++opening;
    if (!live.craft(place.craft)) place.craft = live.crafts[0]?.name ?? "";
    if (place.craft !== time.craft) at = live.craft(time.craft) ? {t: null, session: -1} : at;
    write(true);
    close();
    close = () => {};
    keys.page.clear();
    const page = pages.get(place.page), ends = [], {craft} = place;
    const opened = time.open(place.craft, at.t, at.session);
    document.title = `${page.title} \u00b7 ${place.craft || "control room"}`;
    for (const child of menu.children) {
        if (child.dataset.page === place.page) {
            child.setAttribute("aria-current", "page");
            child.scrollIntoView({block: "nearest", inline: "nearest"});
        } else child.removeAttribute("aria-current");
        child.href = `#/${child.dataset.page}?craft=${encodeURIComponent(place.craft)}`;
    }
    frame();
    const root = h("div", {class: `page ${place.page}`});
    main.replaceChildren(root);
    if (!place.craft) {
        root.append(h("p", {class: "none"}, "The server has no spacecraft yet."));
        return;
    }
    if (at.t !== null) await opened;
    if (number !== opening) return;
    const own = (end) => {
        ends.push(end);
        return end;
    };
    const why = page.role && lacks(page.role);
    if (why) root.before(h("p", {class: "soft lacks", role: "note"}, why));
    const end = await attempt(root, () => page.open({
        root, api, live, alarms, time, keys, go, notify, craft, selection: place.sel,
        /** Write the page's new selection into the link. */
        select: (sel) => { place.sel = sel; write(true); },
        /** Listen to messages of this spacecraft and of none; onAny: to those of all. */
        on: (kind, listener) => own(live.on(kind, (message) =>
            (message.craft ?? place.craft) === craft && listener(message))),
        onAny: (kind, listener) => own(live.on(kind, listener)), onFrame: (draw) => own(live.onFrame(draw)),
        onTime: (listener) => own(time.on(listener)), onTheme: (listener) => own(onTheme(listener)),
        want: (slots, hz, truth) => {
            const wish = live.want(craft, slots, hz, truth);
            own(() => wish.end());
            return wish;
        },
        /** Call `action` every `ms` milliseconds while the page is open. */
        every: (ms, action) => {
            const timer = setInterval(action, ms);
            own(() => clearInterval(timer));
        },
        can: (role) => !lacks(role),
    }));
    const finish = () => {
        for (const end of ends) end();
        end?.();
    };
    if (number === opening) close = finish;
    else finish();
}

/** Why this user may not use a role for the spacecraft; "" if he may. */
function lacks(role) {
    const {user, roles, crafts} = api.session, {can} = live.craft(place.craft) ?? {};
    if (!roles.includes(role) || crafts && !crafts.includes(place.craft.split("@")[0]))
        return `You look on: ${user} lacks the role '${role}' for ${place.craft}.`;
    return role === "command" && can && !can.includes(role) ? `You look on: ${place.craft} takes no commands.` : "";
}

/** Show a message below the page for some seconds. */
function notify(text, bad = false) {
    const note = h("p", {class: bad ? "problem" : "good"}, text);
    toasts.append(note);
    setTimeout(() => note.remove(), bad ? 12000 : 5000);
}

/** Draw the top: spacecraft, connection, alarms and user. */
function frame() {
    const names = live.crafts.map((craft) => craft.name);
    if (chooser.names !== names.join("\n")) {
        chooser.names = names.join("\n");
        chooser.replaceChildren(...names.map((name) => h("option", {value: name}, name)));
    }
    chooser.value = chooser.title = place.craft;
    const ok = live.state === "connected";
    dress(link, `link ${ok ? "good" : "bad"}`);
    put(link, ok ? "\u25cf connected" : "\u25b2 no connection");
    put(skipped, live.skipped ? `${live.skipped} skipped` : "");
    bell.href = `#/alarms?craft=${encodeURIComponent(place.craft)}`;
    putAlarms(bell, alarms.waiting(place.craft), "alarms soft");
    put(user, api.session.user ?? "");
}

async function begin() {
    document.body.replaceChildren();
    if (!(await api.begin()).user) await login(api);
    for (const [name, {title, key}] of pages) {
        menu.append(h("a", {href: `#/${name}`}, h("span", {}, title), h("kbd", {"aria-hidden": "true"}, key)));
        menu.lastChild.dataset.page = name;
        keys.pages.set(key, {text: title, action: () => go({page: name})});
    }
    keys.always("/", "search", () => {
        const field = main.querySelector("input[type=search]");
        if (field) field.select();
        else go({page: "parameters", sel: "/"});
    });
    const neighbour = (step) => {
        const names = live.crafts.map((craft) => craft.name), at = names.indexOf(place.craft);
        if (names.length) go({craft: names[(at + step + names.length) % names.length], sel: ""});
    };
    keys.always("]", "next spacecraft", () => neighbour(1));
    keys.always("[", "previous spacecraft", () => neighbour(-1));
    keys.always("T", "light or dark", turn);
    keys.always("m", "to the page's main part", () => (main.querySelector(".scroll") ?? main).focus());
    document.body.append(
        h("header", {class: "top"}, h("strong", {}, "Control room"), chooser, bell, h("span", {class: "grow"}),
            skipped, link, user,
            button("\u25d0", turn, {title: "light or dark (T)", "aria-label": "light or dark"}),
            button("?", () => keys.help(), {title: "keys (?)", "aria-label": "keys"}),
            api.session.user && api.session.login !== false && button("Log out", leave)),
        menu, main, time.element, toasts, new Questions(live).element);
    document.addEventListener("pointerover", showWhole);
    for (const kind of ["state", "skipped", "craft", "crafts", "alarms"]) live.on(kind, frame);
    live.on("crafts", () => live.craft(place.craft) || !main.firstChild || show());
    live.on("again", () => show());
    api.refused = () => location.reload();
    const at = read();
    await attempt(main, () => live.begin());
    window.addEventListener("popstate", () => show(read()));
    await show(at);
    document.documentElement.dataset.opened = "yes";
}

async function leave() {
    await api.post("/api/logout").catch(() => {});
    location.reload();
}

window.controlRoom = {live, time};     // for the browser's tools, and for tests
begin().catch((error) => document.body.append(h("p", {class: "problem", role: "alert"}, error.message)));
