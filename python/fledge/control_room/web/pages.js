// SPDX-License-Identifier: Apache-2.0
// The pages of the console, in the order of the menu. A page is a module with
//     title, key        its name, and the letter after "g" that opens it
//     open(context)     fills context.root; returns a function that closes it, or a promise of one
import * as overview from "./pages/overview.js";
import * as parameters from "./pages/parameters.js";

export const pages = new Map(Object.entries({
    overview,
    parameters,
}));
