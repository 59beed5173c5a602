// SPDX-License-Identifier: Apache-2.0
// What scripts ask the operators: shown over each page until somebody answers.
import {of} from "./api.js";
import {attempt, h} from "./dom.js";

export class Questions {
    constructor(live) {
        Object.assign(this, {live, element: h("div", {class: "questions", role: "alert"}), open: new Map()});
        live.on("question", (one) => this.merge(one));
        live.on("crafts", () => this.load(live.crafts));
    }

    async load(crafts) {
        const found = await Promise.all(
            crafts.map(({name}) => this.live.rows(name, "questions", "question").catch(() => [])));
        for (const one of found.flat()) this.merge(one);
    }

    merge(one) {
        this.open.get(one.id)?.remove();
        this.open.delete(one.id);
        if (one.answer !== null) return;
        const {api} = this.live;
        const reply = (answer) => () => attempt(
            node, () => api.post(of(one.craft, "questions", one.id), {answer}).then((row) => this.merge(row)));
        const node = h("div", {class: "question"}, h("p", {}, h("strong", {}, one.craft),
            ` \u00b7 a script of ${one.user} asks`), h("p", {class: "asked"}, one.text),
            h("div", {}, h("button", {onclick: reply(true)}, "Yes, go on"), " ",
                h("button", {onclick: reply(false)}, "No, stop it")));
        this.open.set(one.id, node);
        this.element.append(node);
    }
}
