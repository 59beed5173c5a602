// SPDX-License-Identifier: Apache-2.0
// The pages of the console, in the order of the menu. A page is a module with
//     title, key        its name, and the letter after "g" that opens it
//     open(context)     fills context.root; returns a function that closes it, or a promise of one
import * as commands from "./pages/commands.js";
import * as displays from "./pages/displays.js";
import * as files from "./pages/files.js";
import * as overview from "./pages/overview.js";
import * as parameters from "./pages/parameters.js";
import * as run from "./pages/run.js";
import * as stacks from "./pages/stacks.js";
import * as stored from "./pages/stored.js";
import * as tables from "./pages/tables.js";

export const pages = new Map(Object.entries({
    overview,
    parameters,
    displays,
    commands,
    stacks,
    stored,
    files,
    tables,
    run,
}));
