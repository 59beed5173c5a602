// SPDX-License-Identifier: Apache-2.0
// The 3-D picture. Places are in double precision until they are relative to the place of the focus.
import * as THREE from "three";

import {COLOURS, makeArrow, makeCraft, makeFrame, makeGhost} from "./craft.js";
import {
    age, attitude, cross, dot, known, level, norm, position, primary, sub, sunlight, toSun, unit, velocity
} from "./data.js";
import {inertial, linkState, lookAngles, osculating, planetOf} from "./geo.js";
import {makePath} from "./path.js";
import {makePlanet, makeStars, makeSun} from "./planet.js";

export const CRAFT_COLOURS = ["#58b7ff", "#ff9d5c", "#7ee08a", "#e58cff", "#ffd75e", "#5ee0d6", "#ff7f97", "#b7c4d0"];
const AXES = ["#ff5d5d", "#5fd068", "#9cc2ff"];
export const PRESETS = {
    hill: "Hill frame",
    follow: "Inertial",
    body: "Body-fixed",
    orbit: "Orbit",
    sun: "From the Sun",
    boresight: "Boresight",
};
// The layers that the legend shows and hides: key, words, whether it is shown at first.
export const LAYERS = [
    ["path", "Orbit and trajectory", true],
    ["orbit", "Orbit of the moment", false],
    ["stations", "Stations and radio links", true],
    ["labels", "Names", true],
    ["bodyAxes", "Body axes", true],
    ["directions", "Sun, nadir, velocity", true],
    ["hill", "Hill frame", false],
    ["inertial", "Inertial frame", false],
    ["cones", "Fields of view", true],
    ["keepout", "Keep-out cones", true],
    ["plume", "Thrusters", true],
    ["inside", "Wheels and rods inside", false],
    ["enlarged", "Enlarged from afar", false],
    ["estimate", "Estimate", true],
    ["reference", "Reference", false],
];
// [-] Lengths in extents of the spacecraft:
const AXIS = 1.9, ARROW = 2.4, FRAME = 2.6;
const ENLARGED = 18;  // an enlarged spacecraft looks as from this distance at most
const CLOSE = 250;  // the parts and names of a spacecraft are shown below this distance
const FIELD_OF_VIEW = 40;  // [deg] of the camera, upright
const LOCKED = "#7ee08a", SEEN = "#c8d4e0";
const ORBIT_HOLDS = 5;  // [s] of the run after which the orbit of the moment is computed anew
const SKY = 1e13, SUN_GLOW = 9e12;  // [m] distances of decoration
const BEHIND = -1e-9;  // [m] along the camera's axis
const FALLBACK_LIGHT = unit([0.6, -0.5, 0.62]);

/** Whether there is no graphics processor, so that smooth edges would cost too much. */
function drawsInSoftware() {
    const gl = document.createElement("canvas").getContext("webgl2");
    if (!gl) throw new Error("this browser has no WebGL 2");
    const about = gl.getExtension("WEBGL_debug_renderer_info");
    const name = gl.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

export class Stage {
    constructor(data, canvas, labels) {
        this.data = data;
        this.labels = labels;
        this.software = drawsInSoftware();
        // Without alpha the browser need not blend the picture with the page.
        const context = canvas.getContext(
            "webgl2", {alpha: false, antialias: !this.software, powerPreference: "high-performance"});
        this.renderer = new THREE.WebGLRenderer({canvas, context, logarithmicDepthBuffer: true});
        this.renderer.toneMapping = THREE.NeutralToneMapping;
        this.world = new THREE.Scene();
        this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 1e14);
        this.ratio = Math.min(devicePixelRatio, 2);
        this.preset = "hill";
        this.focus = 0;
        this.boresight = 0;
        this.exaggerate = 1;
        this.shown = Object.fromEntries(LAYERS.map(([key, , on]) => [key, on]));
        this.view = {azimuth: 0.7, elevation: 0.35, distance: 1};
        this.build();
    }

    build() {
        const {data, world} = this;
        this.stars = makeStars();
        this.sunGlow = makeSun();
        this.light = new THREE.DirectionalLight(0xffffff, 3);
        this.bounce = new THREE.DirectionalLight(0x9fc4e8, 0);
        this.fill = new THREE.HemisphereLight(0xbfd4ea, 0x3a3f46, 0.55);
        world.add(this.stars, this.sunGlow, this.light, this.light.target, this.bounce, this.bounce.target, this.fill);
        this.planets = data.planets.map((planet) => {
            const group = makePlanet(planet.name, this.software);
            group.scale.setScalar(planet.radius);
            world.add(group);
            return {planet, group, label: this.label(planet.name[0] + planet.name.slice(1).toLowerCase(), "planet")};
        });
        this.stations = data.stations.map((station) => {
            const line = (material) => {
                const drawn = new THREE.Line(new THREE.BufferGeometry(), material);
                drawn.frustumCulled = false;
                world.add(drawn);
                return drawn;
            };
            return {
                station, label: this.label(station.name, "station"),
                locked: line(new THREE.LineBasicMaterial({color: LOCKED})),
                seen: line(new THREE.LineDashedMaterial({color: SEEN, transparent: true, opacity: 0.7}))
            };
        });
        this.crafts = data.crafts.map((craft, k) => this.buildCraft(craft, CRAFT_COLOURS[k % CRAFT_COLOURS.length]));
        this.resetView();
    }

    buildCraft(craft, colour) {
        const {world, data} = this, body = makeCraft(craft), axes = makeFrame(AXIS * craft.extent, AXES);
        body.add(axes);
        world.add(body);
        const drawn = {craft, colour, body, axes, place: [0, 0, 0], speed: [0, 0, 0], sunlight: 1};
        const soft = AXES.map((axis) => new THREE.Color(axis).lerp(new THREE.Color("#c8d0d8"), 0.55));
        drawn.hill = makeFrame(FRAME * craft.extent, soft, 0.006);
        drawn.inertial = makeFrame(FRAME * craft.extent, ["#9aa5b0", "#9aa5b0", "#9aa5b0"], 0.006);
        drawn.arrows = [
            ["Sun", "#ffd34d"], ["nadir", "#ff6fae"], ["velocity", "#b7e36a"],
            ...craft.directions.map((direction) => [direction.name, "#e58cff"])
        ].map(([name, tint]) => {
            const arrow = makeArrow(tint, 0.007);
            world.add(arrow);
            return {name, arrow, label: this.label(name, "tip", tint)};
        });
        drawn.ghosts = craft.poses.map((pose) => {
            const ghost = makeGhost(craft, COLOURS[pose.kind]);
            world.add(ghost);
            return {pose, ghost, shown: true};
        });
        world.add(drawn.hill, drawn.inertial);
        if (craft.motion.time.n > 1 || craft.motion.id !== undefined) {
            drawn.path = makePath(craft.motion, data.begin, data.end, colour);
            world.add(drawn.path);
        }
        drawn.label = this.label(craft.label, "craft", colour);
        drawn.label.style.marginTop = `${- 0.7 + 1.25 * (data.crafts.indexOf(craft) % 6)}em`;
        drawn.axisLabels = ["b1", "b2", "b3"].map((name, k) => this.label(name, "tip", AXES[k]));
        return drawn;
    }

    label(text, kind, colour) {
        const element = document.createElement("span");
        element.className = `label ${kind}`;
        element.textContent = text;
        element.dataset.name = text;
        if (colour) element.style.setProperty("--tint", colour);
        this.labels.append(element);
        return element;
    }

    get focused() { return this.crafts[this.focus]; }

    /** The fields of view of the spacecraft in focus, along which the camera can look. */
    get boresights() { return this.focused.body.cones.filter(({part}) => !part.keep_out).map(({part}) => part); }

    resize(width, height) {
        this.size = [Math.max(1, width), Math.max(1, height)];
        this.renderer.setPixelRatio(this.ratio);
        this.renderer.setSize(width, height, false);
        this.camera.aspect = width / height;
    }

    /** Set the first view of a preset. */
    resetView() {
        const {extent} = this.focused.craft, view = this.view;
        view.azimuth = {follow: 2.6, hill: 2.6, sun: 0, body: 0.8, orbit: 0.6}[this.preset] ?? 0.7;
        view.elevation = {sun: 0, orbit: 0.75}[this.preset] ?? 0.3;
        this.anchor = null;  // "follow" keeps the Hill frame of the moment at which it begins
        view.distance = 7 * extent;
        if (this.preset === "orbit") {
            const {data} = this, centre = primary(data, position(this.focused.craft.motion, data.begin), data.begin);
            let far = centre ? 1.4 * centre.radius : 10 * extent;
            for (let k = 0; k <= 60; k++) {
                const t = data.begin + ((data.end - data.begin) * k) / 60;
                far = Math.max(far, norm(sub(position(this.focused.craft.motion, t), position(centre?.motion, t))));
            }
            view.distance = 2.7 * far;
        }
    }

    setPreset(preset) {
        this.preset = preset;
        this.resetView();
    }

    /** The quaternion of the camera's frame, and the place in the middle of the picture. */
    frame(t) {
        const {craft, place, speed, body} = this.focused, turn = new THREE.Quaternion();
        let target = place;
        if (this.preset === "body" || this.preset === "boresight") turn.copy(body.quaternion);
        if (this.preset === "hill") turn.copy(this.horizon(place, speed, t));
        if (this.preset === "follow") turn.copy(this.anchor ??= this.horizon(place, speed, t));
        if (this.preset === "orbit") {
            const centre = primary(this.data, place, t);
            if (centre) target = position(centre.motion, t);
        }
        if (this.preset === "sun") {
            const sun = toSun(this.data, place, t) ?? FALLBACK_LIGHT, side = unit(cross([0, 0, 1], sun));
            turn.setFromRotationMatrix(basis(sun, side, cross(sun, side)));
        }
        return {turn, target: [...target]};
    }

    /** The frame of a local observer, with its first axis along the velocity and its third up; N without an orbit. */
    horizon(place, speed, t) {
        const hill = this.hillFrame(place, speed, t), turn = new THREE.Quaternion();
        return hill ? hill.multiply(turn.setFromRotationMatrix(basis([0, 1, 0], [0, 0, 1], [1, 0, 0]))) : turn;
    }

    /** The Hill frame, with axes radial, along the velocity, along the orbit's momentum; null without an orbit. */
    hillFrame(place, speed, t) {
        const centre = primary(this.data, place, t), away = sub(place, position(centre?.motion, t));
        const momentum = cross(away, sub(speed, velocity(centre?.motion, t)));
        if (!centre || norm(momentum) < 1e-6 * norm(away)) return null;
        const out = unit(away), normal = unit(momentum);
        return new THREE.Quaternion().setFromRotationMatrix(basis(out, cross(normal, out), normal));
    }

    render(t, since) {
        const {data, camera, shown} = this, spare = new THREE.Quaternion();
        for (const drawn of this.crafts) {
            position(drawn.craft.motion, t, drawn.place);
            velocity(drawn.craft.motion, t, drawn.speed);
            attitude(drawn.craft.turning, t, drawn.body.quaternion, spare);
            drawn.sunlight = sunlight(data, drawn.place, t);
        }
        const {turn, target} = this.frame(t), {azimuth, elevation, distance} = this.view, here = this.focused;
        const offset = new THREE
                           .Vector3(
                               Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth),
                               Math.sin(elevation))
                           .multiplyScalar(distance);
        const cone =
            this.preset === "boresight" ? this.boresights[this.boresight % (this.boresights.length || 1)] : null;
        camera.up.set(0, 0, 1);
        camera.fov = FIELD_OF_VIEW;
        if (cone) {
            const axis = new THREE.Vector3(...cone.axis);
            camera.up.set(...(Math.abs(axis.z) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
            camera.position.set(...cone.at).addScaledVector(axis, 1e-3).applyQuaternion(turn);
            camera.fov = Math.min(120, THREE.MathUtils.radToDeg(2.5 * cone.half_angle));
            camera.up.applyQuaternion(turn);
            camera.lookAt(camera.position.clone().add(axis.applyQuaternion(turn)));
        } else {
            camera.up.applyQuaternion(turn);
            camera.position.copy(offset.applyQuaternion(turn));
            camera.lookAt(0, 0, 0);
        }
        camera.updateProjectionMatrix();
        camera.updateMatrixWorld();
        this.origin = target;
        const eye = camera.position.toArray().map((x, k) => x + target[k]);
        const relative = (place) => sub(place, target);

        const sun = toSun(data, here.place, t), light = sun ?? FALLBACK_LIGHT;
        this.light.position.set(...light);
        this.light.intensity = 0.15 + 3.1 * here.sunlight;
        const centre = primary(data, here.place, t);
        this.bounce.intensity = 0;
        if (centre) {
            const down = unit(sub(position(centre.motion, t), here.place));
            this.bounce.position.set(...down);
            this.bounce.intensity = 1.1 * Math.max(0, -dot(down, light)) * (centre.name === "SUN" ? 0 : 1);
        }
        this.stars.position.copy(camera.position);
        this.stars.scale.setScalar(SKY);
        this.sunGlow.visible = Boolean(sun);
        this.sunGlow.position.copy(camera.position).addScaledVector(new THREE.Vector3(...light), SUN_GLOW);
        this.sunGlow.scale.setScalar(SUN_GLOW * (this.theme === "light" ? 0.12 : 0.2) * (camera.fov / FIELD_OF_VIEW));

        for (const {planet, group, label} of this.planets) {
            const place = position(planet.motion, t), near = relative(place);
            group.position.set(...near);
            attitude(planet.turning, t, group.quaternion, spare);
            const size = (planet.radius / norm(sub(place, eye))) * this.size[1];
            group.visible = size > 0.3;
            group.update(data.sun ? toSun(data, place, t) : light, this.theme === "light", size);
            this.put(label, near, shown.labels && size < 60);
        }
        for (const drawn of this.crafts) this.renderCraft(drawn, t, since, relative, eye, light, cone, spare);
        for (const station of this.stations) this.renderStation(station, t, relative, cone);
        this.renderer.render(this.world, camera);
    }

    renderCraft(drawn, t, since, relative, eye, light, cone, spare) {
        const {shown, data} = this, {craft, body, place, speed} = drawn, near = relative(place);
        const far = norm(sub(place, eye)), focused = drawn === this.focused;
        const grown = shown.enlarged ? Math.max(1, far / (ENLARGED * craft.extent)) : 1, extent = grown * craft.extent;
        const close = far < CLOSE * extent;
        body.position.set(...near);
        body.scale.setScalar(grown);
        body.update(t, since);
        const through = shown.inside || (focused && Boolean(cone));
        body.showInside(through);
        for (const child of body.children) {
            if (child === drawn.axes)
                child.visible = shown.bodyAxes && close && !cone;
            else if (child.tag === "body")
                child.visible = !(focused && cone);
            else if (child.tag)
                child.visible = shown[child.tag] && !(focused && cone && child.tag !== "inside");
        }
        for (const {part, shape} of body.cones)
            if (part.keep_out) shape.warn(this.inside(drawn, part, t));
        const centre = primary(data, place, t);
        const ways = [
            toSun(data, place, t), centre && unit(sub(position(centre.motion, t), place)),
            norm(speed) > 0 ? unit(sub(speed, velocity(centre?.motion, t))) : null,
            ...craft.directions.map(
                ({signal}) => (known(signal, t) ? [0, 1, 2].map((k) => level(signal, t, k)) : null))
        ];
        drawn.arrows.forEach(({arrow, label}, k) => {
            arrow.visible = Boolean(shown.directions && ways[k] && close && !cone);
            if (!arrow.visible) return this.put(label, null, false);
            arrow.position.set(...near);
            arrow.scale.setScalar(ARROW * extent);
            arrow.along(new THREE.Vector3(...ways[k]));
            this.put(label, near.map((x, c) => x + 2.5 * extent * ways[k][c]), shown.labels);
        });
        const hill = this.hillFrame(place, speed, t);
        drawn.hill.visible = Boolean(shown.hill && close && hill && !cone);
        if (drawn.hill.visible) drawn.hill.quaternion.copy(hill);
        drawn.hill.position.set(...near);
        drawn.inertial.visible = shown.inertial && close && !cone;
        drawn.inertial.position.set(...near);
        for (const {pose, ghost, shown: chosen} of drawn.ghosts) {
            ghost.visible = shown[pose.kind] && chosen && close && !cone && known(pose.turning, t) &&
                (!pose.motion || known(pose.motion, t));
            if (!ghost.visible) continue;
            ghost.grey(age(pose.turning, t) > 0);
            attitude(pose.turning, t, ghost.quaternion, spare);
            let away = pose.motion ? sub(position(pose.motion, t), place) : [0, 0, 0];
            if (pose.kind === "estimate" && this.exaggerate !== 1) {
                const error = ghost.quaternion.clone().multiply(body.quaternion.clone().invert());
                if (error.w < 0) error.set(-error.x, -error.y, -error.z, -error.w);
                const size = Math.hypot(error.x, error.y, error.z), angle = 2 * Math.atan2(size, error.w);
                if (size > 0)
                    error.setFromAxisAngle(
                        new THREE.Vector3(error.x, error.y, error.z).divideScalar(size),
                        Math.min(Math.PI, this.exaggerate * angle));
                ghost.quaternion.copy(error.multiply(body.quaternion));
                away = away.map((x) => this.exaggerate * x);
            }
            ghost.position.set(...near.map((x, k) => x + away[k]));
        }
        if (drawn.path) {
            drawn.path.visible = shown.path && !cone;
            drawn.path.position.set(0, 0, 0);
            drawn.path.update(t, eye, this.size, close ? 1.2 : 1.6, 300 * this.view.distance);
        }
        if (shown.orbit && !drawn.orbit) {
            drawn.orbit = makePath({time: {n: 0}}, 0, 1, drawn.colour);
            this.world.add(drawn.orbit);
        }
        if (shown.orbit && !(Math.abs(t - drawn.orbit.of) < ORBIT_HOLDS)) {
            const moves = sub(speed, velocity(centre?.motion, t)), orbit = osculating(centre, place, moves, t);
            if (orbit) drawn.orbit.extend(orbit, t, orbit.time.data[orbit.time.n - 1]);
            Object.assign(drawn.orbit, {of: t, known: Boolean(orbit)});
        }
        if (drawn.orbit) {
            drawn.orbit.visible = shown.orbit && !cone && drawn.orbit.known;
            drawn.orbit.update(Math.max(t, drawn.orbit.of), eye, this.size, 1.2, 300 * this.view.distance);
        }
        drawn.label.classList.toggle("far", !close);
        this.put(drawn.label, near, shown.labels && !(focused && cone));
        drawn.axisLabels.forEach((label, k) => {
            const tip =
                new THREE.Vector3().setComponent(k, 2 * extent).applyQuaternion(body.quaternion).toArray();
            this.put(label, near.map((x, c) => x + tip[c]), shown.labels && shown.bodyAxes && close && !cone);
        });
    }

    /** A station, and its line to the spacecraft in focus: solid while the radio is locked, dashed if only in view. */
    renderStation({station, label, locked, seen}, t, relative, cone) {
        const {shown, data, focused} = this, planet = planetOf(data, station), {craft, place} = focused;
        const on = shown.stations && !cone;
        const sight = lookAngles(data, station, place, t);
        const link = station.links.find((link) => link.craft === craft.name);
        const radio = link && (link.down || link.up) ? linkState(link, t) : null;
        const line = radio?.locked ? locked : sight.elevation >= station.mask ? seen : null;
        for (const candidate of [locked, seen]) candidate.visible = on && candidate === line;
        const ends = [relative(inertial(planet, station.place, t)), relative(place)];
        if (on && line) {
            line.geometry.setFromPoints(ends.map((end) => new THREE.Vector3(...end)));
            if (line === seen) {
                line.computeLineDistances();
                line.material.dashSize = line.material.gapSize = sight.range / 60;
            }
        }
        label.textContent = station.name + (line === locked ? ", locked" : line ? ", in view" : "");
        this.put(label, ends[0], on && shown.labels);
    }

    /** Extend the paths to data.end. */
    extend() {
        const {begin, end} = this.data;
        for (const {path, craft} of this.crafts) path?.extend(craft.motion, begin, end);
    }

    /** Free the picture's resources on the graphics processor. */
    dispose() {
        this.world.traverse((node) => {
            node.geometry?.dispose();
            for (const material of [node.material ?? []].flat()) {
                material.map?.dispose();
                material.dispose();
            }
        });
        this.renderer.dispose();
        this.renderer.forceContextLoss();
    }

    /** Whether the body that a cone must keep out is in it. */
    inside(drawn, part, t) {
        const name = part.keep_out.toUpperCase();
        const planet = this.data.planets.find((candidate) => candidate.name === name);
        const way = name === "SUN" ? toSun(this.data, drawn.place, t) :
                                     planet && unit(sub(position(planet.motion, t), drawn.place));
        if (!way) return false;
        const axis = new THREE.Vector3(...part.axis).applyQuaternion(drawn.body.quaternion);
        return dot(axis.toArray(), way) > Math.cos(part.half_angle);
    }

    /** The place on the screen [px] of a place relative to the origin; null behind the camera. */
    project(near) {
        const seen = new THREE.Vector3(...near).applyMatrix4(this.camera.matrixWorldInverse);
        if (seen.z > BEHIND) return null;
        const focal = this.size[1] / 2 / Math.tan(THREE.MathUtils.degToRad(this.camera.fov) / 2);
        return [this.size[0] / 2 - (focal * seen.x) / seen.z, this.size[1] / 2 + (focal * seen.y) / seen.z];
    }

    /** Put a name at a place, unless that is behind the camera or behind a planet. */
    put(label, near, shown) {
        let at = shown && near ? this.project(near) : null;
        if (at && !(at[0] > -200 && at[0] < this.size[0] + 200 && at[1] > -50 && at[1] < this.size[1] + 50)) at = null;
        if (at)
            for (const {group, planet} of this.planets) {
                const eye = this.camera.position.toArray(), way = sub(near, eye), far = norm(way), sight = unit(way);
                const to = sub(group.position.toArray(), eye), along = dot(to, sight);
                if (along > 0 && along < far - 0.5 * planet.radius && norm(cross(to, sight)) < planet.radius) at = null;
                if (!at) break;
            }
        label.hidden = !at;
        if (at) label.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
    }

    setTheme(theme) {
        this.theme = theme;
        this.world.background = new THREE.Color(theme === "light" ? "#e9eef3" : "#05070b");
        this.stars.visible = theme !== "light";
    }
}

function basis(x, y, z) {
    return new THREE.Matrix4().makeBasis(new THREE.Vector3(...x), new THREE.Vector3(...y), new THREE.Vector3(...z));
}
