// SPDX-License-Identifier: Apache-2.0
// The form that a user logs in with, where the server has users.
import {attempt, h} from "./dom.js";

/** Resolves when a user has logged in. */
export function login(api) {
    return new Promise((done) => {
        const name = h("input", {name: "user", autocomplete: "username", required: true, autofocus: true});
        const password =
            h("input", {name: "password", type: "password", autocomplete: "current-password", required: true});
        const form = h("form", {
            onsubmit: async (event) => {
                event.preventDefault();
                await attempt(form, async () => {
                    await api.post("/api/login", {user: name.value, password: password.value});
                    password.value = "";
                    await api.begin();
                    form.parentNode.remove();
                    done();
                });
            }
        },
            h("h1", {}, "Control room"), h("label", {class: "field"}, h("span", {}, "User"), name),
            h("label", {class: "field"}, h("span", {}, "Password"), password),
            h("button", {class: "primary"}, "Log in"));
        document.body.append(h("main", {class: "login"}, form));
        name.focus();
    });
}
