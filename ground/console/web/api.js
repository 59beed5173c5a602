// SPDX-License-Identifier: Apache-2.0
// The server's HTTP interface. Errors carry the server's sentence.

export class ApiError extends Error {
    constructor(status, body) {
        super(body?.error ?? `The server answered ${status}`);
        Object.assign(this, {status, body: body ?? {}});
    }
}

const wire = (value) => (typeof value === "bigint" ? String(value) : value);

export class Api {
    constructor() {
        this.session = null;
        this.refused = () => {};    // called when the user is no longer logged in
    }

    /** The session: {user, roles, csrf, version}; user is null where no user is logged in. */
    async begin() {
        this.session = await this.get("/api/session");
        return this.session;
    }

    /** GET as JSON. query: {name: value}; undefined and null are left out. */
    async get(path, query = {}, options = {}) {
        return (await this.request("GET", path + search(query), undefined, options)).json();
    }

    /** GET, or POST of a body, as JSON. Integers beyond 2^53 become BigInt, if the browser's parser has their text. */
    async exact(path, body) {
        const response = await this.request(body ? "POST" : "GET", path, body);
        return JSON.parse(await response.text(), (_, value, from) => (typeof value === "number" &&
            Number.isInteger(value) && !Number.isSafeInteger(value) && /^-?\d+$/.test(from?.source) ?
            BigInt(from.source) : value));
    }

    /** GET as an ArrayBuffer. */
    async bytes(path, query = {}, options = {}) {
        return (await this.request("GET", path + search(query), undefined, options)).arrayBuffer();
    }

    async post(path, body = {}, method = "POST") {
        const response = await this.request(method, path, body);
        const text = await response.text();
        return text ? JSON.parse(text) : {};
    }

    put(path, body) { return this.post(path, body, "PUT"); }
    delete(path) { return this.post(path, undefined, "DELETE"); }

    async request(method, path, body, options = {}) {
        const headers = {};
        if (method !== "GET") headers["X-Fledge-CSRF"] = this.session?.csrf ?? "";
        const raw = body instanceof Blob || body instanceof ArrayBuffer;
        if (body !== undefined && !raw) headers["Content-Type"] = "application/json";
        let response;
        try {
            response = await fetch(path, {
                method, headers, signal: options.signal, credentials: "same-origin",
                body: body === undefined || raw ? body : JSON.stringify(body, (_, value) => wire(value)),
            });
        } catch (error) {
            if (error.name === "AbortError") throw error;
            throw new Error("The server does not answer");
        }
        if (!response.ok) {
            const problem = await response.json().catch(() => null);
            if (response.status === 401 && !path.startsWith("/api/login")) this.refused();
            throw new ApiError(response.status, problem);
        }
        return response;
    }
}

function search(query) {
    const given = Object.entries(query).filter(([, value]) => value !== undefined && value !== null && value !== "");
    return given.length ? `?${new URLSearchParams(given.map(([name, value]) => [name, String(value)]))}` : "";
}

/** A path below a craft: of("imager", "alarms", 3) -> "/api/crafts/imager/alarms/3" */
export const of = (craft, ...rest) => `/api/crafts/${[craft, ...rest].map(encodeURIComponent).join("/")}`;

const MOST = 100;       // names in one request
export const LOOK_BACK = 600n * 1000000000n;     // [ns] a value at a time is the newest one within this span before it

/** The values of parameters at a time, from the server's history: name -> {t in ns, value, text, concern}. */
export async function valuesAt(api, craft, names, at, session) {
    const parts = Array.from({length: Math.ceil(names.length / MOST)}, (_, k) => names.slice(MOST * k, MOST * (k + 1)));
    const answers = await Promise.all(parts.map((part) => api.get(of(craft, "history"), {
        names: part.join(","), from_ns: at - LOOK_BACK, to_ns: at + 1n, points: 1, session})));
    const all = Object.entries(Object.assign({}, ...answers)).filter(([, {t_ns}]) => t_ns.length);
    return new Map(all.map(([name, samples]) => [name, {
        t: BigInt(samples.t_ns.at(-1)), value: samples.value.at(-1), text: samples.text?.at(-1),
        concern: samples.concern.at(-1)}]));
}

/** The series of a binary history answer: [{t: Float64Array in s, t_ns: BigInt64Array, value, low, high, worst}]. */
export function series(buffer) {
    const head = new Uint32Array(buffer, 0, 2), rows = [];
    if (head[0] !== 0x32484c46) throw new Error("This is no history of the server");
    for (let k = 0, at = 8; k < head[1]; k++) {
        const n = new Uint32Array(buffer, at, 1)[0];
        at += 8;
        const column = (Kind) => new Kind(buffer, (at += 8 * n) - 8 * n, n);
        const t_ns = column(BigInt64Array), value = column(Float64Array), low = column(Float64Array),
              high = column(Float64Array), worst = new Uint8Array(buffer, at, n);
        at += n + 7 & ~7;
        rows.push({t_ns, t: Float64Array.from(t_ns, (ns) => Number(ns) / 1e9), value, low, high, worst});
    }
    return rows;
}
