// SPDX-License-Identifier: Apache-2.0
// Questions of scripts, shown over each page until an operator answers.
import {of} from "./api.js";
import {attempt, h} from "./dom.js";
import {button} from "./parts.js";

export class Questions {
    constructor(live) {
        Object.assign(this, {live, element: h("div", {class: "questions", role: "alert"}), open: new Map()});
        live.on("question", (question) => this.merge(question));
        live.on("crafts", () => this.load(live.crafts));
    }

    async load(crafts) {
        const lists = await Promise.all(
            crafts.map(({name}) => this.live.rows(name, "questions", "question").catch(() => [])));
        for (const question of lists.flat()) this.merge(question);
    }

    merge(question) {
        this.open.get(question.id)?.remove();
        this.open.delete(question.id);
        if (question.answer !== null) return;
        const {api} = this.live;
        const reply = (answer) => () => attempt(
            node, async () => this.merge(await api.post(of(question.craft, "questions", question.id), {answer})));
        const node = h("div", {class: "question"}, h("p", {}, h("strong", {}, question.craft),
            ` \u00b7 a script of ${question.user} asks`), h("p", {class: "text"}, question.text),
            h("div", {}, button("Yes, go on", reply(true)), " ", button("No, stop it", reply(false))));
        this.open.set(question.id, node);
        this.element.append(node);
    }
}
