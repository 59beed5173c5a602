// SPDX-License-Identifier: Apache-2.0
// Times, spans and counts as text; and the words of a search.

const SECOND = 1000000000n;     // [ns]

const pad = (n, width = 2) => String(n).padStart(width, "0");

/** ns as text. utc: "2026-11-23 01:30:55.123"; else the time since the start: "1:02:03.5". */
export function clock(ns, utc, digits = 3) {
    if (ns === null || ns === undefined) return "\u2013";
    const t = BigInt(ns);
    if (!utc) {
        const size = t < 0n ? -t : t, seconds = size / 1000000000n;
        const part = digits ? `.${pad(size % 1000000000n, 9).slice(0, digits)}` : "";
        const days = seconds / 86400n,
              rest = `${seconds / 3600n % 24n}:${pad(seconds / 60n % 60n)}:${pad(seconds % 60n)}`;
        return `${t < 0n ? "\u2212" : ""}${days ? `${days} d ` : ""}${rest}${part}`;
    }
    const part = (t % SECOND + SECOND) % SECOND, date = new Date(Number((t - part) / 1000000n));
    if (Number.isNaN(date.getTime())) return `${t} ns`;
    return date.toISOString().replace("T", " ").slice(0, 19) + (digits ? `.${pad(part, 9).slice(0, digits)}` : "");
}

/** ns as a date with all its digits: "2026-11-23 01:30:55.123"; and as seconds: "12.5". */
export const dateText = (ns) => clock(ns, true, BigInt(ns) % 1000000n ? BigInt(ns) % 1000n ? 9 : 6 : 3);
export function secondsText(ns) {
    const t = BigInt(ns), size = t < 0n ? -t : t, part = pad(size % SECOND, 9).replace(/0+$/, "");
    return `${t < 0n ? "\u2212" : ""}${size / SECOND}${part && `.${part}`}`;
}

/**
 * Parse a time into ns: "2026-11-23 01:30:55", "01:30:55" of today, or "1:02:03.5" since the start; null if it is none.
 */
export function ticks(text, utc) {
    const match =
        text.trim().match(/^(?:(\d{4}-\d\d-\d\d)[ T])?(?:(\d+) d )?(\d+):(\d\d)(?::(\d\d)(?:\.(\d{1,9}))?)?$/);
    if (!match) return null;
    const [, day, days, hours, minutes, seconds = "0", part = ""] = match;
    const rest =
        (BigInt(days ?? 0) * 86400n + BigInt(hours) * 3600n + BigInt(minutes) * 60n + BigInt(seconds)) * 1000000000n +
        BigInt(part.padEnd(9, "0"));
    if (!utc) return rest;
    const midnight = Date.parse(`${day ?? new Date().toISOString().slice(0, 10)}T00:00:00Z`);
    return Number.isNaN(midnight) ? null : BigInt(midnight) * 1000000n + rest;
}

const WHOLE = /^[+-]?\d+$/;
const TIMES = {
    time: {form: /^\d{4}-\d\d-\d\d([T ]\d\d:\d\d:\d\d(\.\d+)?)?(Z|[+-]\d\d:\d\d)?$/,
        words: "a date of UTC is needed, as in 2026-03-01 12:00:00.5, or ns since 1970"},
    duration: {form: /^[+-]?\d+(\.\d+)? ?(s|ms|us|ns)$|^-?P/,
        words: "a duration is needed, as in 1.5 s, or ns"},
};

/** Check the text of a command's time or duration: {value} for the server, or {problem}. */
export function timeGiven(kind, text) {
    const {form, words} = TIMES[kind];
    return WHOLE.test(text) || form.test(text) ? {value: text.replace(/^\+/, "")} :
                                                 {problem: `${words}; found "${text}"`};
}

/** A span of seconds as text: "0.2 s", "3 min", "2.5 h". */
export function span(seconds) {
    const size = Math.abs(seconds), sign = seconds < 0 ? "\u2212" : "";
    if (size < 100) return `${sign}${size.toFixed(size < 10 ? 1 : 0)} s`;
    if (size < 6000) return `${sign}${(size / 60).toFixed(0)} min`;
    return size < 172800 ? `${sign}${(size / 3600).toFixed(1)} h` : `${sign}${(size / 86400).toFixed(1)} d`;
}

/** 1234567 -> "1 234 567", with narrow spaces */
export const count = (n) => String(n ?? 0).replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");

/** A unit as text; "" for a number without unit. */
export const bare = (unit) => (unit === "-" ? "" : unit ?? "");

/** A number for display: with two decimals, or three significant digits. */
export function digits(value) {
    if (!Number.isFinite(value)) return "\u2013";
    const size = Math.abs(value);
    const text = size && (size < 1e-3 || size >= 1e6) ? value.toExponential(2) :
        size < 1                                      ? String(+value.toPrecision(3)) :
                                                        value.toFixed(2);
    return text.replaceAll("-", "\u2212");
}

/** [s] of a time in ns; and the reverse, in whole us. */
export const seconds = (ns) => Number(ns) / 1e9;
export const ns = (t) => BigInt(Math.round(t * 1e6)) * 1000n;

/** Whether a text has all words of a search, in any case. */
export function matcher(search) {
    const words = search.toLowerCase().split(/\s+/).filter(Boolean);
    return (text) => words.every((word) => text.toLowerCase().includes(word));
}
