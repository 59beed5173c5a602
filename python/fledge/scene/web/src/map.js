// SPDX-License-Identifier: Apache-2.0
// An equirectangular map of the ground with the ground tracks of the spacecraft, stations, and the night.
import {norm, position, primary, sub, toSun, velocity} from "./data.js";
import {fixed, geodetic, linkState, lookAngles, osculating, planetOf, spin} from "./geo.js";
import {surface} from "./planet.js";

const AROUND = 1.0;  // revolutions of the track before and after the present
const STEPS = 180;  // of each
const CIRCLE = 96;  // points of the limit of a station's view
const DAY = 86400;  // [s] of a track without a revolution
const TURN = 2 * Math.PI, QUARTER = Math.PI / 2;

export class GroundMap {
    constructor(data, canvas) {
        Object.assign(this, {data, canvas, brush: canvas.getContext("2d"), theme: "dark"});
    }

    /** The planet below a spacecraft; null for the Sun, and for a planet whose turning is not known. */
    below(craft, t) {
        const planet = primary(this.data, position(craft.motion, t), t);
        return planet && planet.name !== "SUN" && planet.turning ? planet : null;
    }

    /** The ground track of a spacecraft, [{t, latitude, longitude}], from one revolution before a time to one after. It
        starts with the record; beyond its end it follows the osculating orbit. */
    track(craft, planet, t) {
        const {motion} = craft, place = position(motion, t), last = motion.time.data[motion.time.n - 1];
        const moves = sub(velocity(motion, t), velocity(planet.motion, t)), orbit = osculating(planet, place, moves, t);
        const period = orbit ? orbit.time.data[orbit.time.n - 1] - t : DAY, points = [];
        for (let k = -STEPS; k <= STEPS; k++) {
            const at = t + (AROUND * period * k) / STEPS;
            if (at < motion.time.data[0] || (at > last && !orbit)) continue;
            const where = at > last ?
                geodetic(planet, fixed(planet, position(orbit, at), t)) :
                geodetic(planet, fixed(planet, position(motion, at), at));
            if (at > last) where.longitude -= this.spin * (at - t);
            points.push({t: at, latitude: where.latitude, longitude: around(where.longitude)});
        }
        return points;
    }

    /** Draw the ground below the spacecraft number `focus` at a time. crafts: those of the picture, with colours. */
    draw(t, crafts, focus) {
        const {data, brush, canvas} = this, planet = this.below(crafts[focus].craft, t);
        canvas.dataset.planet = planet?.name ?? "";
        if (!planet) return false;
        const ratio = Math.min(devicePixelRatio, 2), width = canvas.clientWidth, height = canvas.clientHeight;
        if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
            canvas.width = Math.round(width * ratio);
            canvas.height = Math.round(height * ratio);
        }
        brush.setTransform(ratio, 0, 0, ratio, 0, 0);
        this.x = (longitude) => (longitude / TURN + 0.5) * width;
        this.y = (latitude) => (0.5 - latitude / Math.PI) * height;
        this.width = width;
        this.spin = spin(planet, t);
        brush.globalAlpha = 1;
        brush.drawImage(surface(planet.name), 0, 0, width, height);
        if (this.theme === "light") {
            brush.fillStyle = "rgba(255, 255, 255, .28)";
            brush.fillRect(0, 0, width, height);
        }
        this.grid(height);
        this.night(planet, t, height);
        for (const station of data.stations)
            if (station.planet === planet.name) this.station(station, crafts[focus], t);
        crafts.forEach((drawn, k) => {
            if (this.below(drawn.craft, t) !== planet) return;
            const points = this.track(drawn.craft, planet, t), here = points.findIndex((point) => point.t >= t - 1e-6);
            this.line(points.slice(0, here + 1), drawn.colour, 1);
            this.line(points.slice(Math.max(0, here)), drawn.colour, 0.55, [4, 3]);
            if (here >= 0) this.mark(points[here], drawn, k === focus, crafts.length > 1);
        });
        return true;
    }

    grid(height) {
        const {brush, width} = this;
        brush.strokeStyle = "rgba(220, 235, 250, .16)";
        brush.lineWidth = 1;
        brush.beginPath();
        for (let k = 1; k < 12; k++) brush.rect((k * width) / 12, -1, 0, height + 2);
        for (let k = 1; k < 6; k++) brush.rect(-1, (k * height) / 6, width + 2, 0);
        brush.stroke();
    }

    night(planet, t, height) {
        const sun = toSun(this.data, position(planet.motion, t), t), {brush, width} = this;
        if (!sun) return;
        const [x, y, z] = fixed(planet, position(planet.motion, t).map((c, k) => c + sun[k]), t);
        const longitude = Math.atan2(y, x), slope = Math.hypot(x, y) / (Math.abs(z) < 1e-6 ? 1e-6 : z);
        brush.beginPath();
        for (let k = 0; k <= width; k += 2)
            brush.lineTo(k, this.y(Math.atan(-slope * Math.cos((k / width - 0.5) * TURN - longitude))));
        brush.lineTo(width, z >= 0 ? height : 0);
        brush.lineTo(0, z >= 0 ? height : 0);
        brush.closePath();
        brush.fillStyle = "rgba(3, 8, 20, .5)";
        brush.fill();
    }

    /** A station, and the limit of its view at the altitude of the spacecraft. */
    station(station, {craft}, t) {
        const {brush, data} = this, planet = planetOf(data, station), place = position(craft.motion, t);
        const {latitude, longitude} = geodetic(planet, station.place);
        const away = norm(sub(place, position(planet.motion, t)));
        const seen = lookAngles(data, station, place, t).elevation >= station.mask;
        const reach = Math.acos(Math.min(1, (planet.radius / away) * Math.cos(station.mask))) - station.mask;
        const points = Array.from({length: CIRCLE + 1}, (_, k) => {
            const way = (k * TURN) / CIRCLE, sine = Math.sin(latitude) * Math.cos(reach) +
                Math.cos(latitude) * Math.sin(reach) * Math.cos(way);
            return {
                latitude: Math.asin(sine),
                longitude: around(longitude + Math.atan2(Math.sin(way) * Math.sin(reach) * Math.cos(latitude),
                                                         Math.cos(reach) - Math.sin(latitude) * sine))
            };
        });
        this.line(points, seen ? "#7ee08a" : "#dfe8f0", seen ? 0.95 : 0.5, seen ? [] : [2, 3]);
        const x = this.x(longitude), y = this.y(latitude);
        brush.fillStyle = seen ? "#7ee08a" : "#ffffff";
        brush.strokeStyle = "rgba(0, 0, 0, .7)";
        brush.beginPath();
        [[0, -5], [4.5, 3.5], [-4.5, 3.5]].forEach(([dx, dy]) => brush.lineTo(x + dx, y + dy));
        brush.closePath();
        brush.stroke();
        brush.fill();
        const link = station.links.find((link) => link.craft === craft.name);
        const locked = link && (link.down || link.up) && linkState(link, t).locked;
        const state = locked ? ", locked" : seen ? ", in view" : "";
        this.text(`${station.name}${state}`, x, y < 24 ? y + 15 : y - 8);
    }

    /** A line that leaves the map at one side and comes back at the other. */
    line(points, colour, alpha, dashes = []) {
        const {brush} = this;
        Object.assign(brush, {strokeStyle: colour, globalAlpha: alpha, lineWidth: 1.6, lineJoin: "round"});
        brush.setLineDash(dashes);
        brush.beginPath();
        points.forEach((point, k) => {
            const before = points[k - 1], step = before ? point.longitude - before.longitude : 0;
            if (Math.abs(step) > Math.PI) {
                const turn = Math.sign(step) * TURN;
                brush.lineTo(this.x(point.longitude - turn), this.y(point.latitude));
                brush.moveTo(this.x(before.longitude + turn), this.y(before.latitude));
            }
            brush[k ? "lineTo" : "moveTo"](this.x(point.longitude), this.y(point.latitude));
        });
        brush.stroke();
        brush.setLineDash([]);
        brush.globalAlpha = 1;
    }

    mark({latitude, longitude}, {craft, colour}, focused, named) {
        const {brush} = this, x = this.x(longitude), y = this.y(latitude);
        brush.beginPath();
        brush.arc(x, y, focused ? 5 : 3.5, 0, TURN);
        Object.assign(brush, {fillStyle: colour, strokeStyle: "#ffffff", lineWidth: focused ? 2 : 1});
        brush.fill();
        brush.stroke();
        if (named) this.text(craft.label, x, y - 9);
    }

    text(words, x, y) {
        const {brush} = this, half = brush.measureText(words).width / 2 + 3;
        Object.assign(brush, {font: "600 11px system-ui, sans-serif", textAlign: "center", lineWidth: 3,
                              strokeStyle: "rgba(5, 10, 18, .8)", fillStyle: "#ffffff", lineJoin: "round"});
        const at = Math.max(half, Math.min(this.width - half, x));
        brush.strokeText(words, at, y);
        brush.fillText(words, at, y);
    }
}

/** A longitude in [-pi, pi). */
const around = (longitude) => longitude - TURN * Math.floor((longitude + 2 * QUARTER) / TURN);
