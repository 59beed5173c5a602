// SPDX-License-Identifier: Apache-2.0
// Words of the server that pages compare and show: levels of limits, severities of events, stages of commands.

/** The levels of a parameter by its limits. Events have them as severities; one that is not here, "info", is normal. */
export const CONCERNS = ["normal", "watch", "warning", "distress", "critical", "severe"];
export const SHAPES = ["", "\u25cb", "\u25b3", "\u25c7", "\u25a0", "\u2b23"];

export const levelOf = ({severity}) => Math.max(0, CONCERNS.indexOf(severity));

/** The stages of a command, in their order; instead of the last one it may have failed, or the end is unknown. */
export const STAGES = [
    "released", "transferred", "sent", "received", "delivered", "accepted", "queued", "started", "progress", "completed"
];
export const RARE = ["transferred", "sent", "received", "queued"];  // stages that few databases have
