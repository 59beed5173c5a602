// SPDX-License-Identifier: Apache-2.0
// The viewer: the picture, its controls, the map and the plots, in an element of the class fledge-view.
import "uplot/dist/uPlot.min.css";
import "./view.css";

import * as THREE from "three";

import {append, growing, modeAt, position, sunlight} from "./data.js";
import {passes} from "./geo.js";
import {GroundMap} from "./map.js";
import {clock, Plots} from "./plots.js";
import {numbers, overGround} from "./readout.js";
import {LAYERS, PRESETS, Stage} from "./stage.js";

export {unpack} from "./data.js";

const MODES = ["#5b8fc7", "#d98e4a", "#62b06f", "#a878c4", "#c9a93a", "#4fb3ad", "#cc6478", "#8a97a3"];
const SPEEDS = [0.1, 1, 5, 10, 30, 60, 120, 300, 600, 1800, 3600];
const WHOLE_RUN = 75;  // [s] of the whole run at about the first speed
const TURN = 0.006;  // [rad] of the camera per pixel of the pointer
const STEEPEST = 1.55;  // [rad] of the camera's elevation
const ZOOM = 0.0012;  // of the distance's logarithm per pixel of the wheel
const FARTHEST = 1e12;  // [m]
const TOO_SLOW = 0.042, QUICK = 0.018;  // [s] of a frame: above the first fewer pixels, below the second more
const READABLE = 90;  // [ms] for which a number is shown at least
const REDRAWN = 1000;  // [ms] between two drawings of all samples, in a live view
const LAG = 0.3;  // [s] of wall time by which a live picture is late, so that it moves evenly
const PAUSE = 5;  // [s] of wall time without samples, after which the pace is measured anew
const KEYS = [
    ["Space", "play or pause"], ["← →", "a hundredth back or on"], ["Home End", "begin, end"],
    [", .", "slower, faster"], ["1 … 6", "cameras"], ["C", "next spacecraft"], ["I", "look inside"], ["P", "plots"],
    ["M", "map"], ["N", "now, of a live view"],
    ["T", "dark or light"], ["H", "hide everything but the picture"], ["S", "save a picture"],
    ["drag, wheel", "turn, come nearer"]
];

export const make = (tag, name, text) => {
    const element = document.createElement(tag);
    if (name) element.className = name;
    if (text !== undefined) element.textContent = text;
    return element;
};
const button = (text, title, act) => {
    const element = make("button", "", text);
    element.type = "button";
    element.title = title;
    element.setAttribute("aria-label", title);
    element.onclick = act;
    return element;
};

/** The link of the page itself, which holds the time and the camera. */
const pageLink = {
    read: () => new URLSearchParams(location.hash.includes("=") ? location.hash.slice(1) : ""),
    write: (parameters) => history.replaceState(null, "", `#${parameters.toString().replaceAll("%2C", ",")}`)
};

export class Viewer {
    /** live: extend() adds samples
        link: {read(), write(URLSearchParams)} of the link that holds time and camera; null: none is written
        theme: "dark" or "light"; else that of the system
        moved(t): called when the user has chosen a time; null: now, in a live view */
    constructor(root, data, {live = false, link, theme, moved = () => {}} = {}) {
        Object.assign(this, {root, data, live, moved, following: false, pace: 0, ended: new AbortController()});
        this.page = root.classList.contains("page");
        this.link = link !== undefined ? link : this.page ? pageLink : null;
        this.hash = (this.link ?? pageLink).read();
        this.tracks = growing(data);
        this.t = data.begin;
        this.playing = false;
        this.frames = [];
        const pace = live ? 1 : (data.end - data.begin) / WHOLE_RUN;
        this.speed = SPEEDS.reduce(
            (best, speed) => (Math.abs(Math.log(speed / pace)) < Math.abs(Math.log(best / pace)) ? speed : best), 1);
        this.lay();
        this.stage = new Stage(data, this.canvas, this.labels);
        if (live) this.stage.shown.orbit = true;
        this.map = new GroundMap(data, this.mapCanvas);
        this.passes = [];
        root.classList.toggle("plain", this.stage.software);
        this.legend();
        this.plots = new Plots(data, this.drawer, (t) => this.goto(t));
        this.listen();
        const light = matchMedia("(prefers-color-scheme: light)");
        this.setTheme(theme ?? this.hash.get("theme") ?? (light.matches ? "light" : "dark"));
        if (!theme)
            light.addEventListener(
                "change", (event) => this.setTheme(event.matches ? "light" : "dark"), {signal: this.ended.signal});
        this.open(this.page || live ? this.hash.get("plots") === "1" : true);
        if (this.hash.has("craft"))
            this.stage.focus = Math.max(0, data.crafts.findIndex((craft) => craft.name === this.hash.get("craft")));
        this.choose(this.hash.get("camera") in PRESETS ? this.hash.get("camera") : "hill");
        for (const key of (this.hash.get("show") ?? "").split(",").filter(Boolean)) this.toggle(key, true);
        for (const key of (this.hash.get("hide") ?? "").split(",").filter(Boolean)) this.toggle(key, false);
        if (this.hash.get("ui") === "0") root.classList.add("bare");
        const around = (this.hash.get("around") ?? "").split(",").map(Number);
        if (around.length === 3 && around.every(Number.isFinite))
            [this.stage.view.azimuth, this.stage.view.elevation, this.stage.view.distance] = around;
        if (this.hash.has("map") || innerWidth <= 760 || !(this.page || live))
            this.openMap(this.hash.get("map") === "1");
        if (live && !this.hash.has("t")) this.follow();
        else this.seek(Number(this.hash.get("t") ?? data.begin));
        if (this.hash.get("play") === "1") this.play(true);
        this.redraw();
        this.last = performance.now();
        this.request = requestAnimationFrame((now) => this.frame(now));
    }

    /** Stop, and empty the element. */
    destroy() {
        this.ended.abort();
        cancelAnimationFrame(this.request);
        clearTimeout(this.writing);
        this.recorder?.stop();
        for (const observer of [this.observer, this.plots.observer]) observer.disconnect();
        for (const plot of [...this.plots.charts.keys()]) this.plots.remove(plot);
        this.stage.dispose();
        this.root.replaceChildren();
    }

    // --- a live view --------------------------------------------------------------------------------

    /** Add samples: {end [s], tracks: {number: [times, numbers]}, modes: {process: [t, name]}}, as the server sends. */
    extend({end, tracks, modes = {}}) {
        const {data} = this;
        for (const [process, mode] of Object.entries(modes)) {
            let entry = data.modes.find((candidate) => candidate.process === process);
            if (!entry) data.modes.push(entry = {process, began: []});
            if (entry.began.at(-1)?.[1] !== mode[1]) entry.began.push(mode);
        }
        for (const [id, [times, numbers]] of Object.entries(tracks)) {
            const track = this.tracks.get(Number(id));
            if (track) append(track, times, numbers);
        }
        if (!(end > data.end)) return;
        const now = performance.now(), since = this.arrived ? (now - this.arrived) / 1000 : Infinity;
        if (since < PAUSE) {
            const pace = (end - data.end) / Math.max(since, LAG / 6);
            this.pace += (this.pace ? 0.2 : 1) * (pace - this.pace);
        }
        this.arrived = now;
        data.end = end;
        if (this.following) this.dirty = true;
        if (now - (this.redrawn ?? -REDRAWN) > REDRAWN) this.redraw();
    }

    /** Draw the parts that show all times. */
    redraw() {
        const {data, stage} = this, before = this.shownEnd ?? data.end;
        this.redrawn = performance.now();
        this.shownEnd = data.end;
        if (this.live) {
            stage.extend();
            if (this.drawn) this.plots.extend(before);
        }
        this.findPasses();
        this.drawShadow();
        this.drawModes();
        this.dirty = true;
    }

    /** Follow the present, in a live view. */
    follow() {
        this.play(false);
        this.following = true;
        this.t = this.data.end;
        this.moved(null);
        this.changed();
    }

    /** [s] The time of a picture that follows: it moves evenly, and is soon at the newest sample. */
    followed(since) {
        const {t, data: {end}, pace} = this, behind = end - LAG * pace - t;
        if (behind > 2 * pace) return end;
        return Math.min(end, t + Math.max(0, since * pace + Math.min(1, 2 * since) * behind));
    }

    // --- the link -----------------------------------------------------------------------------------

    /** Write a change of the time or the camera into the link. */
    changed() {
        this.dirty = true;
        if (!this.link) return;
        this.writing ??= setTimeout(() => {
            this.writing = undefined;
            const {stage, hash} = this, {azimuth, elevation, distance} = stage.view;
            hash.set("camera", stage.preset);
            hash.set("around", [azimuth, elevation, distance].map((x) => Number(x.toPrecision(5))).join(","));
            if (this.data.crafts.length > 1) hash.set("craft", stage.focused.craft.name);
            if (this.following) hash.delete("t");
            else hash.set("t", String(Math.round(1e3 * this.t) / 1e3));
            this.link.write(hash);
        }, 250);
    }

    // --- layout -------------------------------------------------------------------------------------

    lay() {
        const {root, data} = this;
        this.picture = make("div", "picture");
        this.canvas = make("canvas");
        this.canvas.tabIndex = 0;
        this.canvas.setAttribute("aria-label", "3-D view of the run");
        this.labels = make("div", "labels");
        const head = make("header");
        const title = make("div", "title");
        title.append(make("strong", "", data.title), make("span", "", data.about.replaceAll("_", " ")));
        this.tools = make("div", "tools");
        this.tools.append(
            this.mapButton = button("Map", "Map of the ground below (M)", () => this.openMap(this.mapFrame.hidden)),
            this.plotButton = button("Plots", "Plots (P)", () => this.open(!this.drawn)),
            button("PNG", "Save a picture (S)", () => this.savePicture()),
            this.filmButton = button("WebM", "Record a film of the picture", () => this.film()),
            this.themeButton = button(
                "◐", "Dark or light (T)", () => this.setTheme(this.stage.theme === "dark" ? "light" : "dark")),
            button("?", "Keys", () => (this.help.hidden = !this.help.hidden)));
        this.themeButton.className = "theme";
        head.append(title, this.tools);
        this.aside = make("details", "legend");
        this.aside.open = innerWidth > 760;
        this.readout = make("dl", "readout");
        this.mapFrame = make("figure", "map");
        this.mapCanvas = make("canvas");
        this.mapCanvas.setAttribute("role", "img");
        this.mapCanvas.setAttribute("aria-label", "Map with the ground tracks");
        this.mapWords = make("figcaption");
        this.mapFrame.append(this.mapCanvas, this.mapWords);
        this.mapButton.classList.add("on");
        this.help = make("div", "help");
        this.help.hidden = true;
        const table = make("table");
        for (const [key, action] of KEYS) {
            const row = table.insertRow();
            row.insertCell().append(make("kbd", "", key));
            row.insertCell().textContent = action;
        }
        const {position: place, attitude, share} = data.bounds;
        this.rate = make("p");
        this.help.append(
            table, this.rate,
            make(
                "p", "",
                `Shown positions are within ${place} m of the recorded ones, ` +
                    `attitudes within ${attitude} rad, plotted numbers within ${
                        100 * share} % of their range. The stars are decoration.`));
        for (const note of data.notes) this.help.append(make("p", "note", note));
        this.picture.append(this.canvas, this.labels, head, this.aside, this.readout, this.mapFrame, this.help);
        this.drawer = make("section", "drawer");
        root.append(this.picture, this.timeline(), this.drawer);
    }

    timeline() {
        const bar = make("footer");
        this.playButton = button("▶", "Play (space)", () => this.play(!this.playing));
        this.playButton.className = "play";
        this.nowButton = button("Now", "Back to now (N)", () => this.follow());
        this.nowButton.className = "live";
        this.nowButton.hidden = !this.live;
        this.speedChoice = make("select", "speed");
        this.speedChoice.title = "Simulated seconds per second";
        for (const speed of SPEEDS) this.speedChoice.add(new Option(`${speed}×`, speed, false, speed === this.speed));
        this.speedChoice.onchange = () => (this.speed = Number(this.speedChoice.value));
        this.now = make("output", "now");
        const track = make("div", "track");
        this.shadow = make("canvas");
        this.slider = make("input");
        Object.assign(this.slider, {type: "range", min: 0, max: 1, step: "any"});
        this.slider.setAttribute("aria-label", "time");
        this.slider.oninput = () => this.goto(this.data.begin + this.slider.value * (this.data.end - this.data.begin));
        this.strip = make("canvas", "modes");
        this.strip.onpointermove = (event) => this.describeModes(event);
        track.append(this.strip, this.shadow, this.slider);
        this.cameras = make("select");
        this.cameras.title = "Camera (1 to 6)";
        for (const [key, name] of Object.entries(PRESETS)) this.cameras.add(new Option(name, key));
        this.cameras.onchange = () => this.choose(this.cameras.value);
        bar.append(this.playButton, this.now, track, this.nowButton, this.speedChoice, this.cameras);
        return bar;
    }

    legend() {
        const {aside, stage, data} = this;
        aside.append(make("summary", "", "Legend"));
        const crafts = make("div", "crafts");
        data.crafts.forEach((craft, k) => {
            const choice = button(craft.label, "Look at it (C)", () => this.focusOn(k));
            choice.style.setProperty("--tint", stage.crafts[k].colour);
            crafts.append(choice);
        });
        aside.append(crafts);
        this.boxes = {};
        const has = (test) => data.crafts.some(test), part = (test) => has((craft) => craft.parts.some(test));
        const there = {
            cones: part((part) => part.kind === "cone" && !part.keep_out),
            keepout: part((part) => part.keep_out),
            plume: part((part) => part.kind === "thruster"),
            inside: part((part) => part.kind === "wheel" || part.kind === "rod"),
            estimate: has((craft) => craft.poses.some((pose) => pose.kind === "estimate")),
            reference: has((craft) => craft.poses.some((pose) => pose.kind === "reference")),
            hill: data.planets.length > 0,
            orbit: data.planets.some((planet) => planet.mu > 0),
            stations: data.stations.length > 0
        };
        for (const [key, words] of LAYERS) {
            if (there[key] === false) continue;
            const row = make("label", `layer of-${key}`), box = make("input");
            box.type = "checkbox";
            box.checked = stage.shown[key];
            box.onchange = () => this.toggle(key, box.checked);
            this.boxes[key] = box;
            row.append(box, make("i"), words);
            aside.append(row);
            if (key === "estimate") {
                const scale = make("select");
                scale.title = "Show the error of the estimate larger";
                for (const factor of [1, 10, 100, 1000, 10000]) scale.add(new Option(`error ×${factor}`, factor));
                scale.onchange = () => {
                    stage.exaggerate = Number(scale.value);
                    this.dirty = true;
                };
                row.append(scale);
            }
        }
        if (data.notes.length)
            aside.append(button(
                `${data.notes.length} note${data.notes.length > 1 ? "s" : ""} on the record`, "What the record lacks",
                () => (this.help.hidden = !this.help.hidden)));
    }

    // --- actions of the user ------------------------------------------------------------------------

    listen() {
        const {canvas, stage} = this, fingers = new Map();
        this.observer = new ResizeObserver(() => this.fit());
        this.observer.observe(this.picture);
        this.fit();
        canvas.onpointerdown = (event) => {
            canvas.setPointerCapture(event.pointerId);
            fingers.set(event.pointerId, event);
        };
        canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
        canvas.onpointermove = (event) => {
            const before = fingers.get(event.pointerId);
            if (!before) return;
            if (fingers.size === 2) {
                const other = [...fingers.values()].find((finger) => finger !== before);
                const apart = (finger) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY);
                this.nearer(apart(before) / Math.max(1, apart(event)));
            } else {
                stage.view.azimuth -= TURN * (event.clientX - before.clientX);
                const elevation = stage.view.elevation + TURN * (event.clientY - before.clientY);
                stage.view.elevation = Math.max(-STEEPEST, Math.min(STEEPEST, elevation));
                this.changed();
            }
            fingers.set(event.pointerId, event);
        };
        canvas.addEventListener("wheel", (event) => {
            event.preventDefault();
            this.nearer(Math.exp(ZOOM * event.deltaY));
        }, {passive: false});
        (this.page ? window : this.root).addEventListener("keydown", (event) => {
            if (event.target.matches?.("input[type=search], select") || event.ctrlKey || event.metaKey || event.altKey)
                return;
            const step = (this.data.end - this.data.begin) / 100, cameras = Object.keys(PRESETS);
            const act = {
                " ": () => this.play(!this.playing),
                ArrowRight: () => this.goto(this.t + step),
                ArrowLeft: () => this.goto(this.t - step),
                Home: () => this.goto(this.data.begin),
                End: () => (this.live ? this.follow() : this.goto(this.data.end)),
                n: () => this.live && this.follow(),
                m: () => this.openMap(this.mapFrame.hidden),
                ".": () => this.faster(1),
                ",": () => this.faster(-1),
                c: () => this.focusOn((stage.focus + 1) % this.data.crafts.length),
                i: () => this.toggle("inside", !stage.shown.inside),
                p: () => this.open(!this.drawn),
                t: () => this.setTheme(stage.theme === "dark" ? "light" : "dark"),
                h: () => this.root.classList.toggle("bare"),
                s: () => this.savePicture(),
                Escape: () => this.root.classList.remove("bare")
            }[event.key] ??
                (cameras[event.key - 1] && (() => this.choose(cameras[event.key - 1], true)));
            if (!act) return;
            event.preventDefault();
            event.stopPropagation();
            act();
        }, {signal: this.ended.signal});
    }

    nearer(factor) {
        const {view, focused} = this.stage;
        view.distance = Math.max(1.2 * focused.craft.extent, Math.min(FARTHEST, view.distance * factor));
        this.changed();
    }

    faster(way) {
        const at = SPEEDS.indexOf(this.speed) + way;
        this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at))];
        this.speedChoice.value = this.speed;
    }

    toggle(key, on) {
        this.stage.shown[key] = on;
        if (this.boxes[key]) this.boxes[key].checked = on;
        this.dirty = true;
    }

    choose(preset, again) {
        if (preset === "boresight" && !this.stage.boresights.length)
            return void (this.cameras.value = this.stage.preset);
        if (preset === "boresight" && again && this.stage.preset === preset) this.stage.boresight++;
        this.stage.setPreset(preset);
        this.cameras.value = preset;
        this.changed();
    }

    focusOn(k) {
        this.stage.focus = k;
        this.choose(this.stage.preset);
        this.findPasses();
        this.drawShadow();
        this.drawModes();
    }

    openMap(shown) {
        this.mapFrame.hidden = !shown;
        this.mapButton.classList.toggle("on", shown);
        this.dirty = true;
    }

    open(drawn) {
        this.drawn = drawn;
        this.root.classList.toggle("drawn", drawn);
        this.plotButton.classList.toggle("on", drawn);
        if (drawn && this.live) this.plots.extend(this.data.end);
        if (drawn && !this.plots.charts.size) this.plots.begin(this.page || this.live ? 3 : 6);
        this.plots.fit();
    }

    play(playing) {
        if (playing && this.t >= this.data.end) this.seek(this.data.begin);
        if (playing) this.following = false;
        if (playing !== this.playing) {  // a still picture has all its pixels
            const {stage} = this, full = Math.min(devicePixelRatio, 2);
            if (!playing) this.ratio = stage.ratio;
            stage.ratio = playing ? this.ratio ?? full : full;
            stage.resize(...stage.size);
            this.dirty = true;
        }
        this.playing = playing;
        this.playButton.textContent = playing ? "❚❚" : "▶";
        this.frames = [];
    }

    /** Go to a time that the user has chosen. */
    goto(t) {
        if (this.live && t >= this.data.end) return void this.follow();
        this.seek(t);
        this.moved(this.t);
    }

    seek(t) {
        this.following = false;
        this.t = Math.max(this.data.begin, Math.min(this.data.end, Number.isFinite(t) ? t : 0));
        this.changed();
    }

    setTheme(theme) {
        this.root.dataset.theme = theme;
        this.stage.setTheme(theme);
        this.plots.setTheme(theme);
        this.map.theme = theme;
        this.drawShadow();
        this.drawModes();
        this.dirty = true;
    }

    fit() {
        const {clientWidth, clientHeight} = this.picture;
        if (!clientWidth || !clientHeight) return;
        this.stage.resize(clientWidth, clientHeight);
        this.drawShadow();
        this.drawModes();
        this.dirty = true;
    }

    /** Compute the passes of the spacecraft in focus over the times of the record. */
    findPasses() {
        const {data, stage} = this, {motion} = stage.focused.craft;
        this.passes = data.stations.map((station) => ({
            station,
            passes: motion.time.n > 1 ? passes(data, station, motion, motion.time.data[0], data.end) : []
        }));
    }

    /** Draw modes and passes above the slider, and marks for events, commands and resets. */
    drawModes() {
        const {strip, data} = this, width = Math.max(1, strip.clientWidth), row = 7, span = data.end - data.begin || 1;
        const rows = data.modes.length + this.passes.length;
        const brush = strip.getContext("2d"), colour = getComputedStyle(this.root), at = (t) => (t - data.begin) / span;
        strip.width = width;
        strip.height = Math.max(1, row * rows + (data.happened.length ? 4 : 0));
        strip.style.height = `${strip.height}px`;
        data.modes.forEach(({began}, k) => {
            const names = [...new Set(began.map(([, name]) => name))];
            began.forEach(([t, name], i) => {
                const end = began[i + 1]?.[0] ?? data.end;
                brush.fillStyle = MODES[names.indexOf(name) % MODES.length];
                brush.fillRect(width * at(t), row * k, Math.max(1, width * (at(end) - at(t))), row - 1);
            });
        });
        this.passes.forEach(({passes}, k) => {
            const top = row * (data.modes.length + k);
            brush.fillStyle = colour.getPropertyValue("--pass");
            for (const {rise, set} of passes)
                brush.fillRect(width * at(rise), top, Math.max(2, width * (at(set) - at(rise))), row - 2);
        });
        brush.fillStyle = colour.getPropertyValue("--accent");
        for (const {t} of data.happened) brush.fillRect(width * at(t) - 0.5, strip.height - 4, 1.5, 4);
    }

    /** Show in words what the strip has at the pointer. */
    describeModes(event) {
        const {data, strip} = this, share = event.offsetX / Math.max(1, strip.clientWidth);
        const t = data.begin + share * (data.end - data.begin), near = (data.end - data.begin) / 100;
        strip.title = [
            ...data.modes.map((modes) => `${modes.process}: ${modeAt(modes, t) || "\u2013"}`),
            ...this.passes.flatMap(({station, passes}) => passes
                .filter(({rise, set}) => t > rise - near && t < set + near)
                .map(({rise, set, peak}) =>
                    `${station.name}: ${clock(Math.round(rise))} to ${clock(Math.round(set))}, ` +
                    `up to ${THREE.MathUtils.radToDeg(peak).toFixed(0)}°`)),
            ...data.happened.filter((event) => Math.abs(event.t - t) < near)
                .slice(0, 6).map((event) => `${clock(event.t)} ${event.text}`)
        ].join("\n");
    }

    /** Draw the times in shadow, below the slider. */
    drawShadow() {
        const {shadow, data, stage} = this, width = Math.max(1, shadow.clientWidth), brush = shadow.getContext("2d");
        shadow.width = width;
        shadow.height = 6;
        const colour = getComputedStyle(this.root), craft = data.crafts[stage.focus];
        for (let x = 0; x < width; x++) {
            const t = data.begin + ((data.end - data.begin) * (x + 0.5)) / width;
            const lit = data.sun || data.sun_N ? sunlight(data, position(craft.motion, t), t) : 1;
            brush.fillStyle = colour.getPropertyValue(lit < 0.5 ? "--night" : "--day");
            brush.fillRect(x, 0, 1, 6);
        }
    }

    // --- pictures and films -------------------------------------------------------------------------

    download(blob, ending) {
        const link = make("a");
        link.href = URL.createObjectURL(blob);
        link.download = `${this.data.title}-${Math.round(this.t)}s.${ending}`;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    }

    /** Save the picture with its names, and the map if it is open. */
    savePicture() {
        const {stage, labels} = this, before = stage.ratio, ratio = stage.ratio = Math.max(2, before);
        stage.resize(...stage.size);
        stage.render(this.t, 0);
        const canvas = make("canvas"), brush = canvas.getContext("2d"), [width, height] = stage.size;
        canvas.width = this.canvas.width;
        canvas.height = this.canvas.height;
        brush.drawImage(this.canvas, 0, 0);
        stage.ratio = before;
        brush.setTransform(ratio, 0, 0, ratio, 0, 0);
        const frame = this.picture.getBoundingClientRect();
        const ground = getComputedStyle(this.root).getPropertyValue("--ground");
        Object.assign(brush, {lineJoin: "round", lineWidth: 3, strokeStyle: ground});
        for (const label of labels.querySelectorAll(".label:not([hidden])")) {
            const style = getComputedStyle(label), place = label.getBoundingClientRect();
            if (style.visibility === "hidden") continue;
            const font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
            Object.assign(brush, {font, textBaseline: "middle", fillStyle: style.color});
            const x = place.left - frame.left + parseFloat(style.paddingLeft);
            const y = place.top - frame.top + place.height / 2;
            brush.strokeText(label.textContent, x, y);
            brush.fillText(label.textContent, x, y);
        }
        if (!this.mapFrame.hidden && this.mapCanvas.dataset.planet) {
            const place = this.mapCanvas.getBoundingClientRect();
            brush.drawImage(this.mapCanvas, place.left - frame.left, place.top - frame.top, place.width, place.height);
        }
        const when = this.now.textContent, words = `${this.data.title}  ${when}`;
        Object.assign(brush, {font: "600 13px system-ui, sans-serif", textBaseline: "bottom",
                              fillStyle: getComputedStyle(this.root).color});
        brush.strokeText(words, 10, height - 8, width - 20);
        brush.fillText(words, 10, height - 8, width - 20);
        canvas.toBlob((blob) => this.download(blob, "png"));
        this.fit();
    }

    film() {
        if (this.recorder) return void this.recorder.stop();
        const kinds = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];
        const kind = kinds.find((type) => window.MediaRecorder?.isTypeSupported(type));
        if (!kind) return void (this.filmButton.title = "This browser cannot record films");
        this.parts = [];
        this.recorder = new MediaRecorder(this.canvas.captureStream(60), {mimeType: kind, videoBitsPerSecond: 12e6});
        this.recorder.ondataavailable = (event) => event.data.size && this.parts.push(event.data);
        this.recorder.onstop = () => {
            this.download(new Blob(this.parts, {type: "video/webm"}), "webm");
            this.recorder = null;
            this.filmButton.classList.remove("on");
        };
        this.recorder.start(500);
        this.filmButton.classList.add("on");
        if (!this.following) this.play(true);
    }

    // --- each frame ---------------------------------------------------------------------------------

    frame(now) {
        const passed = (now - this.last) / 1000, since = Math.min(0.25, passed), before = this.t;
        this.last = now;
        if (this.following) this.t = this.followed(passed);
        if (this.following && this.t !== before) {
            this.keepPace(since);
            this.dirty = true;
        }
        if (this.playing) {
            this.t = Math.min(this.data.end, this.t + this.speed * since);
            if (this.t >= this.data.end) {
                this.play(false);
                if (this.live) this.follow();
                else this.recorder?.stop();
                this.changed();
            }
            this.keepPace(since);
            this.dirty = true;
        }
        if (this.dirty && this.stage.size) {
            this.dirty = false;
            this.stage.render(this.t, this.playing || this.following ? since : 0);
            this.plots.show(this.t);
            if (!(this.playing || this.following) || now - (this.shownAt ?? 0) > READABLE) {
                this.shownAt = now;
                this.showNumbers();
            }
            if (!this.root.dataset.opened) {
                this.root.dataset.opened = Math.round(performance.now());
                this.rate.textContent = `Opened in ${(performance.now() / 1000).toFixed(2)} s.`;
            }
        }
        this.request = requestAnimationFrame((next) => this.frame(next));
    }

    /** Draw fewer pixels where frames are too slow, more where there is time. */
    keepPace(since) {
        const {frames, stage} = this;
        frames.push(since);
        if (frames.length < 20) return;
        const mean = frames.reduce((a, b) => a + b) / frames.length;
        this.root.dataset.rate = (1 / mean).toFixed(1);
        this.rate.textContent =
            `Opened in ${(this.root.dataset.opened / 1000).toFixed(2)} s, ${this.root.dataset.rate} frames/s.`;
        this.frames = [];
        const least = 0.5, most = Math.min(devicePixelRatio, 2);
        const ratio = mean > TOO_SLOW ? Math.max(least, 0.8 * stage.ratio) :
            mean < QUICK ? Math.min(most, 1.15 * stage.ratio) :
                                     stage.ratio;
        if (ratio !== stage.ratio) {
            stage.ratio = ratio;
            stage.resize(...stage.size);
        }
    }

    /** Show the numbers of the present time. */
    showNumbers() {
        const {data, stage, t} = this;
        this.readout.replaceChildren(
            ...numbers(data, stage, t).flatMap(
                ([name, value, kind]) => [make("dt", kind, name), make("dd", kind, value)]));
        if (!this.mapFrame.hidden) {
            const there = this.map.draw(t, stage.crafts, stage.focus);
            this.mapCanvas.hidden = !there;
            this.mapWords.textContent = there ?
                overGround(this.map.below(stage.focused.craft, t), stage.focused.place, t) :
                "No map: the run does not say how the body below turns. Give the spacecraft a sky.";
        }
        this.nowButton.classList.toggle("on", this.following);
        this.nowButton.textContent = this.following ? "\u25cf Live" : "Now";
        const date = data.epoch ?
            new Date(Date.parse(`${data.epoch}Z`) + 1000 * t).toISOString().replace("T", " ").slice(0, 19) :
            "";
        this.now.textContent = clock(Math.round(10 * t) / 10);
        this.now.title = date && `${date} UTC`;
        if (date) this.now.append(make("small", "", `${date} UTC`));
        this.slider.value = (t - data.begin) / (data.end - data.begin || 1);
        this.slider.setAttribute("aria-valuetext", `${clock(t)}`);
    }
}
