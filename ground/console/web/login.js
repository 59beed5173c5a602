// SPDX-License-Identifier: Apache-2.0
// The form that a user logs in with, where the server has users.
import {attempt, h} from "./dom.js";
import {field, form as formOf} from "./parts.js";

/** Resolves when a user has logged in. */
export function login(api) {
    return new Promise((done) => {
        const name = h("input", {name: "user", autocomplete: "username", required: true, autofocus: true});
        const password =
            h("input", {name: "password", type: "password", autocomplete: "current-password", required: true});
        const form = formOf(() => attempt(form, async () => {
            await api.post("/api/login", {user: name.value, password: password.value});
            password.value = "";
            await api.begin();
            form.parentNode.remove();
            done();
        }), {}, h("h1", {}, "Control room"), field("User", name), field("Password", password),
            h("button", {class: "primary"}, "Log in"));
        document.body.append(h("main", {class: "login"}, form));
        name.focus();
    });
}
