// SPDX-License-Identifier: Apache-2.0
// The page of a record: the viewer in the element #fledge-view, with the data in #fledge-data.
import {load} from "./data.js";
import {Plots} from "./plots.js";
import {make, Viewer} from "./viewer.js";

/** The plots alone, of a record without an attitude. */
function showPlots(root, data) {
    const drawer = make("section", "drawer"), light = matchMedia("(prefers-color-scheme: light)");
    const plots = new Plots(data, drawer, () => {});
    const dress = () => {
        root.dataset.theme = light.matches ? "light" : "dark";
        plots.setTheme(root.dataset.theme);
    };
    root.append(drawer);
    root.classList.add("drawn");
    light.addEventListener("change", dress);
    dress();
    plots.begin(6);
    root.dataset.opened = Math.round(performance.now());
    return plots;
}

const root = document.getElementById("fledge-view");
try {
    if (!window.DecompressionStream) throw new Error("this browser is too old: it cannot unpack the record");
    const data = await load(document.getElementById("fledge-data").textContent);
    window.fledgeView = data.crafts.length ? new Viewer(root, data) : showPlots(root, data);
} catch (error) {
    root.append(make("p", "failure", `The 3-D view cannot be shown: ${error.message}`));
    console.error(error);
}
