// SPDX-License-Identifier: Apache-2.0
// The spacecraft in 3-D: the viewer of `fledge view` with data of the server. Console and viewer share their time; the
// page's selection holds the camera.
import {of} from "../api.js";
import {h} from "../dom.js";
import {theme} from "../theme.js";

export const title = "3-D view", key = "v";

const AGAIN = 3000;  // [ms] between two requests for the scene, while there is none

export async function open(context) {
    const {root, api, live, time, craft, select} = context;
    const style = h("link", {rel: "stylesheet", href: "/assets/view.css"});
    const status = h("p", {class: "none", role: "status"});
    const holder = h("div", {class: "fledge-view guest"}), frame = h("div", {class: "view3d"}, holder);
    root.append(style, status, frame);
    const {Viewer, unpack} = await import("/assets/viewer.js");
    const zero = BigInt((live.craft(craft)?.clock === "utc" && live.craft(craft).epoch_ns) || 0);
    const seconds = (ns) => Number(ns - zero) / 1e9;
    let viewer = null, early = [], camera = context.selection, ended = false, loading = false;

    const link = {
        read: () => {
            const about = new URLSearchParams(camera);
            if (!time.isLive) about.set("t", String(seconds(time.t)));
            return about;
        },
        write: (about) => {
            about.delete("t");
            select(camera = about.toString().replaceAll("%2C", ","));
        },
    };
    const moved = (t) => (t === null ? time.now() : time.seek(zero + BigInt(Math.round(1e9 * t))));

    async function begin() {
        if (loading || ended) return;
        loading = true;
        try {
            const data = unpack(await api.bytes(of(craft, "scene")));
            viewer?.destroy();
            viewer = null;
            if (ended) return;
            frame.hidden = false;
            viewer = new Viewer(holder, data, {live: true, link, theme: theme(), moved});
            holder.viewer = viewer;     // for tests, and the browser's tools
            for (const message of early) viewer.extend(message);
            early = [];
            status.hidden = true;
        } catch (error) {
            status.textContent = error.message;
            status.hidden = false;
        } finally {
            loading = false;
            frame.hidden = !viewer;
        }
    }

    context.on("truth", (message) => {
        if (message.again) {
            early = [];
            begin();
        } else if (viewer && !loading) {
            viewer.extend(message);
        } else {
            early = [...early.slice(-63), message];
        }
    });
    context.want([], 4, true);
    context.onTime(() => {
        if (!viewer) return;
        if (!time.isLive) viewer.seek(seconds(time.t));
        else if (!viewer.following) viewer.follow();
    });
    context.onTheme((name) => viewer?.setTheme(name));
    context.every(AGAIN, () => viewer || begin());
    frame.hidden = true;
    await begin();
    return () => {
        ended = true;
        viewer?.destroy();
    };
}
