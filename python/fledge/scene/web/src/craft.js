// SPDX-License-Identifier: Apache-2.0
// A spacecraft from its parts. Lengths are in metres, in the frame of its body.
import * as THREE from "three";
import {RoundedBoxGeometry} from "three/addons/geometries/RoundedBoxGeometry.js";
import {GLTFLoader} from "three/addons/loaders/GLTFLoader.js";
import {OBJLoader} from "three/addons/loaders/OBJLoader.js";

import {level} from "./data.js";

const UP = new THREE.Vector3(0, 1, 0);
const STALE = "#8a949e";  // of a stale estimate or reference
export const COLOURS = {
    sensor: "#4fb3ff",
    "keep-out": "#ff5a4d",
    estimate: "#ffb02e",
    reference: "#b48cff",
    wheel: "#8fa3b8"
};

function picture(size, paint) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = size;
    paint(canvas.getContext("2d"), size);
    const texture = new THREE.CanvasTexture(canvas);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
    texture.anisotropy = 4;
    return texture;
}

let pictures;

function textures() {
    pictures ??= {
        foil: picture(
            256,
            (brush, n) => {
                brush.fillStyle = "#e3bb62";
                brush.fillRect(0, 0, n, n);
                let seed = 7;
                const next = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
                for (let k = 0; k < 260; k++) {
                    const x = n * next(), y = n * next(), size = 8 + 34 * next(), turn = 6.3 * next();
                    brush.fillStyle = `rgba(${next() > 0.5 ? "255,232,170" : "96,62,10"}, ${0.05 + 0.16 * next()})`;
                    brush.beginPath();
                    for (let corner = 0; corner < 3; corner++) {
                        const angle = turn + 2.1 * corner;
                        brush.lineTo(x + size * Math.cos(angle), y + size * Math.sin(angle) * next());
                    }
                    brush.fill();
                }
            }),
        cells: picture(
            256,
            (brush, n) => {
                brush.fillStyle = "#0d1b3e";
                brush.fillRect(0, 0, n, n);
                for (let i = 0; i < 4; i++)
                    for (let j = 0; j < 8; j++) {
                        const shade = brush.createLinearGradient(0, j * 32, 0, j * 32 + 32);
                        shade.addColorStop(0, "#21408c");
                        shade.addColorStop(1, "#172c66");
                        brush.fillStyle = shade;
                        brush.fillRect(i * 64 + 2, j * 32 + 1.5, 60, 29);
                    }
                brush.fillStyle = "rgba(190, 205, 230, .45)";
                for (let i = 0; i < 4; i++)
                    for (let bar = 1; bar < 3; bar++) brush.fillRect(i * 64 + bar * 21, 0, 1, n);
            }),
        wheel: picture(
            128,
            (brush, n) => {
                brush.fillStyle = "#ffffff";
                brush.fillRect(0, 0, n, n);
                brush.fillStyle = "#5b6570";
                for (let k = 0; k < 3; k++) {
                    brush.save();
                    brush.translate(n / 2, n / 2);
                    brush.rotate((k * Math.PI) / 3);
                    brush.fillRect(-n / 2, -n / 18, n, n / 9);
                    brush.restore();
                }
            }),
    };
    return pictures;
}

function box(part, size) {
    const edge = Math.min(...size), geometry = new RoundedBoxGeometry(...size, 2, 0.025 * edge);
    const foil = textures().foil.clone();
    const material = new THREE.MeshStandardMaterial({
        map: part.color ? null : foil,
        color: part.color || 0xffffff,
        metalness: 0.08,
        roughness: 0.38,
        transparent: true
    });
    const hub = new THREE.Group(), body = new THREE.Mesh(geometry, material);
    hub.add(body);
    const lines = new THREE.LineSegments(
        new THREE.EdgesGeometry(new THREE.BoxGeometry(...size)),
        new THREE.LineBasicMaterial({color: 0x2b2418, transparent: true, opacity: 0.55}));
    hub.add(lines);
    const plate = new THREE.MeshStandardMaterial({color: 0xd9dee3, metalness: 0.2, roughness: 0.6, transparent: true});
    for (const side of [1, -1]) {  // two ends, which show how the body turns
        const end = new THREE.Mesh(new THREE.BoxGeometry(0.86 * size[0], 0.86 * size[1], 0.02 * edge), plate);
        end.position.z = side * (size[2] / 2 + 0.004 * edge);
        hub.add(end);
    }
    hub.showInside = (through) => {
        material.opacity = plate.opacity = through ? 0.16 : 1;
        material.depthWrite = plate.depthWrite = !through;
        lines.material.color.set(through ? 0x9fb4c8 : 0x2b2418);
    };
    return hub;
}

function panel(part, extent) {
    const [width, height] = part.size, thick = 0.02 * Math.min(width, height), cells = textures().cells.clone();
    cells.repeat.set(Math.max(1, Math.round(width / 0.5)), Math.max(1, Math.round(height / 0.5)));
    const dark = new THREE.MeshStandardMaterial({color: 0x8d949b, metalness: 0.3, roughness: 0.6});
    const front =
        new THREE.MeshStandardMaterial({map: cells, metalness: 0.3, roughness: 0.28, color: part.color || 0xffffff});
    const wing = new THREE.Group();
    wing.add(new THREE.Mesh(new THREE.BoxGeometry(width, height, thick), [dark, dark, dark, dark, front, dark]));
    const normal = new THREE.Vector3(...part.axis), at = new THREE.Vector3(...part.at);
    // Its first edge points away from the body, where that is across the normal.
    const out = at.clone().addScaledVector(normal, -at.dot(normal));
    if (out.length() < 1e-3 * extent)
        out.set(...(Math.abs(normal.x) < 0.9 ? [1, 0, 0] : [0, 1, 0]))
            .addScaledVector(normal, -(Math.abs(normal.x) < 0.9 ? normal.x : normal.y));
    out.normalize();
    const turn = new THREE.Matrix4().makeBasis(out, normal.clone().cross(out), normal);
    wing.quaternion.setFromRotationMatrix(turn);
    const reach = at.dot(out) - width / 2;
    if (reach > 0) {
        const yoke = new THREE.Mesh(new THREE.CylinderGeometry(0.4 * thick, 0.4 * thick, reach, 8), dark);
        yoke.rotation.z = Math.PI / 2;
        yoke.position.x = -width / 2 - reach / 2;
        wing.add(yoke);
    }
    const hinge = new THREE.Group(), at0 = new THREE.Vector3(...(part.hinge ?? part.at));
    hinge.position.copy(at0);
    wing.position.copy(at).sub(at0);
    hinge.add(wing);
    const axis = new THREE.Vector3(...(part.hinge_axis ?? [1, 0, 0]));
    hinge.update = (t) => {
        if (part.level) hinge.quaternion.setFromAxisAngle(axis, level(part.level, t) || 0);
    };
    return hinge;
}

function wheel(part, extent) {
    const group = new THREE.Group(), radius = 0.14 * extent, axis = new THREE.Vector3(...part.axis);
    const rim = new THREE.MeshStandardMaterial(
        {color: COLOURS.wheel, metalness: 0.6, roughness: 0.35, emissiveIntensity: 0.55});
    const face = new THREE.MeshStandardMaterial(
        {map: textures().wheel, metalness: 0.3, roughness: 0.5, emissiveIntensity: 0.45});
    const disc = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 0.3 * radius, 40), [rim, face, face]);
    group.add(disc);
    group.quaternion.setFromUnitVectors(UP, axis);
    group.position.set(...part.at);
    if (!part.at.some((x) => x)) group.position.addScaledVector(axis, 0.27 * extent);
    const slow = new THREE.Color("#5aa9ff"), fast = new THREE.Color("#ff6a4d"), none = new THREE.Color("#000000");
    let angle = 0;
    group.update = (t, since) => {
        const speed = level(part.level, t) || 0, share = Math.min(1, Math.abs(speed) / (part.full || 1));
        angle += Math.sign(speed) * share * 7 * since;  // slow enough to be seen
        disc.rotation.y = angle;
        rim.emissive.copy(none).lerp(speed < 0 ? slow : fast, share);
        face.emissive.copy(rim.emissive);
    };
    return group;
}

const PLUME = `
#include <common>
#include <logdepthbuf_pars_vertex>
varying float along; varying vec3 vNormal; varying vec3 vToEye;
void main() {
    along = uv.y;
    vec4 place = modelMatrix * vec4(position, 1.0);
    vNormal = mat3(modelMatrix) * normal; vToEye = cameraPosition - place.xyz;
    gl_Position = projectionMatrix * viewMatrix * place;
    #include <logdepthbuf_vertex>
}`;
const FLAME = `
#include <common>
#include <logdepthbuf_pars_fragment>
uniform float share; uniform vec3 colour;
varying float along; varying vec3 vNormal; varying vec3 vToEye;
void main() {
    #include <logdepthbuf_fragment>
    float facing = abs(dot(normalize(vNormal), normalize(vToEye)));
    gl_FragColor = vec4(mix(colour, vec3(1.0), pow(along, 6.0)), share * along * along * (0.25 + 0.75 * facing));
    #include <colorspace_fragment>
}`;

function thruster(part, extent, strongest) {
    const group = new THREE.Group(), size = extent * (0.035 + 0.05 * Math.sqrt(part.full / (strongest || 1)));
    const shape =
        [[0.25, 0], [0.3, 0.25], [0.55, 0.7], [0.7, 1.2]].map(([x, y]) => new THREE.Vector2(x * size, -y * size));
    const nozzle = new THREE.Mesh(
        new THREE.LatheGeometry(shape, 20),
        new THREE.MeshStandardMaterial({color: 0x5d6269, metalness: 0.8, roughness: 0.35, side: THREE.DoubleSide}));
    group.add(nozzle);
    const flame = new THREE.ShaderMaterial({
        uniforms: {share: {value: 0}, colour: {value: new THREE.Color("#6db7ff")}},
        vertexShader: PLUME,
        fragmentShader: FLAME,
        transparent: true,
        depthWrite: false,
        side: THREE.DoubleSide,
        blending: THREE.AdditiveBlending
    });
    const plume = new THREE.Mesh(new THREE.CylinderGeometry(0.6 * size, 1.9 * size, 9 * size, 24, 8, true), flame);
    plume.position.y = -1.2 * size - 4.5 * size;
    const holder = new THREE.Group();
    holder.add(plume);
    group.add(holder);
    group.quaternion.setFromUnitVectors(UP, new THREE.Vector3(...part.axis));
    group.position.set(...part.at);
    group.update = (t) => {
        const share = Math.max(0, Math.min(1, (level(part.level, t) || 0) / (part.full || 1)));
        flame.uniforms.share.value = share > 0.002 ? 0.35 + 0.65 * share : 0;
        holder.visible = share > 0.002;
        holder.scale.y = 0.35 + 0.65 * share;
    };
    group.tag = "plume";
    return group;
}

function rod(part, extent) {
    const material = new THREE.MeshStandardMaterial({color: 0xb6bec6, metalness: 0.6, roughness: 0.4});
    const bar = new THREE.Mesh(new THREE.CylinderGeometry(0.018 * extent, 0.018 * extent, 0.7 * extent, 12), material);
    const axis = new THREE.Vector3(...part.axis);
    bar.quaternion.setFromUnitVectors(UP, axis);
    const side = new THREE.Vector3(axis.y, axis.z, axis.x).cross(axis);
    bar.position.set(...part.at).addScaledVector(side.normalize(), 0.3 * extent);
    const plus = new THREE.Color("#ff8a4d"), minus = new THREE.Color("#57c2ff");
    bar.update = (t) => {
        const dipole = level(part.level, t) || 0;
        material.emissive.set(0).lerp(dipole < 0 ? minus : plus, Math.min(1, Math.abs(dipole) / (part.full || 1)));
    };
    return bar;
}

function cone(part) {
    const group = new THREE.Group(), radius = part.length * Math.tan(part.half_angle);
    const colour = part.color || COLOURS[part.keep_out ? "keep-out" : "sensor"];
    const skin = new THREE.MeshBasicMaterial(
        {color: colour, transparent: true, opacity: 0.13, side: THREE.DoubleSide, depthWrite: false});
    const side = new THREE.Mesh(new THREE.ConeGeometry(radius, part.length, 64, 1, true), skin);
    side.position.y = -part.length / 2;
    const circle = Array.from(
        {length: 97},
        (_, k) => new THREE.Vector3(
            radius * Math.cos((k * Math.PI) / 48), -part.length, radius * Math.sin((k * Math.PI) / 48)));
    const line = new THREE.LineBasicMaterial({color: colour, transparent: true, opacity: 0.75});
    group.add(side, new THREE.Line(new THREE.BufferGeometry().setFromPoints(circle), line));
    const rays = [];
    for (let k = 0; k < 4; k++) rays.push(new THREE.Vector3(), circle[24 * k].clone());
    const faint = line.clone();
    faint.opacity = 0.35;
    group.add(new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(rays), faint));
    group.quaternion.setFromUnitVectors(UP, new THREE.Vector3(...part.axis).negate());
    group.position.set(...part.at);
    group.warn = (inside) => {
        skin.opacity = inside ? 0.38 : 0.13;
        line.opacity = inside ? 1 : 0.75;
    };
    return group;
}

function mesh(part) {
    const group = new THREE.Group(), data = part.data.data;
    group.position.set(...part.at);
    group.scale.setScalar(part.scale);
    if (part.name.toLowerCase().endsWith(".obj")) {
        const model = new OBJLoader().parse(new TextDecoder().decode(data));
        model.traverse((node) => {
            if (node.isMesh)
                node.material = new THREE.MeshStandardMaterial({color: 0xc9ced4, metalness: 0.3, roughness: 0.5});
        });
        group.add(model);
    } else {
        new GLTFLoader().parse(data.slice().buffer, "", (model) => {
            group.add(model.scene);
            group.dispatchEvent({type: "ready"});
        }, (error) => console.error(`${part.name}: ${error.message}`));
    }
    return group;
}

/** The boxes and panels of a spacecraft as edges, for an estimate or a reference. */
export function makeGhost(craft, colour) {
    const group = new THREE.Group();
    const skin = new THREE.MeshBasicMaterial({color: colour, transparent: true, opacity: 0.1, depthWrite: false});
    const line = new THREE.LineBasicMaterial({color: colour, transparent: true, opacity: 0.95});
    for (const part of craft.parts) {
        if (part.kind !== "box") continue;
        const size = part.size.map((edge) => 1.03 * edge), shape = new THREE.BoxGeometry(...size);
        const body = new THREE.Group();
        body.add(new THREE.Mesh(shape, skin), new THREE.LineSegments(new THREE.EdgesGeometry(shape), line));
        body.position.set(...part.at);
        group.add(body);
    }
    const length = 1.9 * craft.extent;
    for (const axis of [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
        group.add(new THREE.Line(
            new THREE.BufferGeometry().setFromPoints(
                [new THREE.Vector3(), new THREE.Vector3(...axis).multiplyScalar(length)]),
            line));
    const fresh = new THREE.Color(colour), old = new THREE.Color(STALE);
    group.grey = (stale) => {
        for (const material of [skin, line]) material.color.copy(stale ? old : fresh);
    };
    return group;
}

/** An arrow of length 1 along its y axis. */
export function makeArrow(colour, width = 0.012) {
    const group = new THREE.Group(), material = new THREE.MeshBasicMaterial({color: colour});
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(width, width, 0.88, 12), material);
    shaft.position.y = 0.44;
    const head = new THREE.Mesh(new THREE.ConeGeometry(3.4 * width, 0.14, 20), material);
    head.position.y = 0.93;
    group.add(shaft, head);
    group.along = (direction) => group.quaternion.setFromUnitVectors(UP, direction);
    return group;
}

/** Three arrows of a frame. */
export function makeFrame(length, colours, width) {
    const group = new THREE.Group();
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, k) => {
        const arrow = makeArrow(colours[k], width);
        arrow.along(new THREE.Vector3(...axis));
        group.add(arrow);
    });
    group.scale.setScalar(length);
    return group;
}

/** A spacecraft: a group whose children have a `tag`, their key in the legend. update(t, seconds of real time). */
export function makeCraft(craft) {
    const group = new THREE.Group(), kinds = {box, panel, wheel, thruster, rod, cone, mesh};
    const strongest = Math.max(0, ...craft.parts.filter((part) => part.kind === "thruster").map((part) => part.full));
    group.boxes = [];
    group.cones = [];
    for (const part of craft.parts) {
        const child = part.kind === "box" ? box(part, part.size) : kinds[part.kind](part, craft.extent, strongest);
        child.tag ??= {
            box: "body",
            mesh: "body",
            panel: "body",
            wheel: "inside",
            rod: "inside",
            cone: part.keep_out ? "keepout" : "cones"
        }[part.kind];
        if (part.kind === "box") {
            child.position.set(...part.at);
            group.boxes.push(child);
        }
        if (part.kind === "cone") group.cones.push({part, shape: child});
        group.add(child);
    }
    group.update = (t, since) => {
        for (const child of group.children) child.update?.(t, since);
    };
    group.showInside = (through) => {
        for (const hub of group.boxes) hub.showInside(through);
    };
    return group;
}
