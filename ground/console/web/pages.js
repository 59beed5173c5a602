// SPDX-License-Identifier: Apache-2.0
// The pages of the console, in the order of the menu. A page is a module with
//     title, key        its name, and the letter after "g" that opens it
//     role              that it needs, if it is not for all users
//     open(context)     fills context.root; returns a function that closes it, or a promise of one
import * as alarms from "./pages/alarms.js";
import * as archive from "./pages/archive.js";
import * as commands from "./pages/commands.js";
import * as displays from "./pages/displays.js";
import * as events from "./pages/events.js";
import * as files from "./pages/files.js";
import * as log from "./pages/log.js";
import * as overview from "./pages/overview.js";
import * as packets from "./pages/packets.js";
import * as parameters from "./pages/parameters.js";
import * as plots from "./pages/plots.js";
import * as run from "./pages/run.js";
import * as server from "./pages/server.js";
import * as stacks from "./pages/stacks.js";
import * as stored from "./pages/stored.js";
import * as tables from "./pages/tables.js";
import * as view from "./pages/view.js";

export const pages = new Map(Object.entries({
    overview,
    view,
    parameters,
    plots,
    displays,
    alarms,
    events,
    commands,
    stacks,
    stored,
    files,
    tables,
    run,
    packets,
    archive,
    log,
    server,
}));
