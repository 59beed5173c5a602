// SPDX-License-Identifier: Apache-2.0
// Celestial bodies, stars and the Sun.
import * as THREE from "three";
import {feature} from "topojson-client";
import land from "world-atlas/land-110m.json";

const PALETTES = {
    EARTH: ["#123a5e", "#2f6f9f", 0x6fb4ff],
    MARS: ["#8f4a2b", "#c98354", 0xe0a27c],
    MOON: ["#6b6b6b", "#b5b3ae", 0],
    VENUS: ["#b99a5c", "#e7d3a0", 0xffe9b8],
    MERCURY: ["#6f655c", "#a79a8c", 0],
    JUPITER: ["#a07b58", "#e0c9a8", 0xd8c0a0],
    SATURN: ["#b39b68", "#e9d8a9", 0xe8d8a8],
    URANUS: ["#7fb6bd", "#b4e0e2", 0xb0e8e8],
    NEPTUNE: ["#2f55a8", "#5c86d8", 0x88a8ff],
    PLUTO: ["#8b7765", "#cdb9a3", 0],
};

/** Numbers from 0 to 1 that are the same in every browser (mulberry32). */
function random(seed) {
    return () => {
        seed = (seed + 0x6d2b79f5) | 0;
        let bits = Math.imul(seed ^ (seed >>> 15), 1 | seed);
        bits = (bits + Math.imul(bits ^ (bits >>> 7), 61 | bits)) ^ bits;
        return ((bits ^ (bits >>> 14)) >>> 0) / 2 ** 32;
    };
}

const smooth = (x) => x ** 2 * (3 - 2 * x);

/** Smooth noise over a sphere in an equirectangular picture, 0 to 1, that meets itself at its left and right edge. */
function noise(width, height, seed, cells) {
    const sum = new Float32Array(width * height);
    let weight = 0;
    for (let octave = 0; octave < 5; octave++) {
        const columns = cells << octave, rows = Math.max(2, columns >> 1), next = random(seed + octave);
        const grid = Float32Array.from({length: columns * (rows + 1)}, next), share = 0.55 ** octave;
        weight += share;
        for (let y = 0; y < height; y++) {
            const down = (y / height) * rows, row = Math.floor(down), lower = smooth(down - row);
            for (let x = 0; x < width; x++) {
                const along = (x / width) * columns, left = Math.floor(along), right = (left + 1) % columns;
                const further = smooth(along - left), top = row * columns, low = (row + 1) * columns;
                sum[y * width + x] += share *
                    ((1 - lower) * ((1 - further) * grid[top + left] + further * grid[top + right]) +
                     lower * ((1 - further) * grid[low + left] + further * grid[low + right]));
            }
        }
    }
    return sum.map((share) => share / weight);
}

function canvas(width, height) {
    const picture = document.createElement("canvas");
    picture.width = width;
    picture.height = height;
    return [picture, picture.getContext("2d")];
}

/** A picture of colours that paint(share of noise, latitude in [-1, 1]) gives as [r, g, b]. */
function shaded(seed, cells, paint) {
    const width = 512, height = 256, [picture, brush] = canvas(width, height);
    const field = noise(width, height, seed, cells), image = brush.createImageData(width, height);
    field.forEach((share, pixel) => {
        const latitude = 1 - Math.floor(pixel / width) / (height / 2);
        image.data.set([...paint(share, latitude).slice(0, 3), 255], 4 * pixel);
    });
    brush.putImageData(image, 0, 0);
    return picture;
}

const mix = (a, b, share) => a.map((x, k) => x + (b[k] - x) * Math.max(0, Math.min(1, share)));
const rgb = (text) => new THREE.Color(text).convertLinearToSRGB().toArray().map((share) => 255 * share);

/** A ring on the map with longitudes that do not jump; one around a pole includes the pole. Each point says whether the
    line to it is a coast, and not an edge of the map. */
function unwrapped(ring) {
    const points = [];
    let turn = 0;
    ring.forEach(([lon, lat], k) => {
        const before = k ? ring[k - 1][0] : lon, edge = Math.abs(lon) > 179.9 && Math.abs(before) > 179.9;
        if (lon - before > 180) turn -= 360;
        if (lon - before < -180) turn += 360;
        points.push([lon + turn, lat, lat > -89.9 && !edge]);
    });
    if (turn) {
        const pole = Math.sign(points[0][1]) * 90;
        points.push([points.at(-1)[0], pole, false], [points[0][0], pole, false]);
    }
    return points;
}

const ICE = [235, 240, 244];

function earth() {
    const width = 2048, height = 1024, [picture, brush] = canvas(width, height);
    const x = (lon) => ((lon + 180) / 360) * width, y = (lat) => ((90 - lat) / 180) * height;
    const ocean = shaded(
        3, 8,
        (n, lat) => mix(mix([9, 38, 74], [24, 82, 124], 1.6 * n - 0.3), [58, 98, 128], 4 * (Math.abs(lat) - 0.75)));
    const ground = shaded(11, 16, (n, lat) => {
        const degrees = Math.abs(lat * 90 + 14 * (n - 0.5));  // of latitude, with ragged edges of the zones
        const forest = [46, 84, 44], desert = [176, 152, 96], meadow = [64, 92, 56], tundra = [112, 118, 100];
        let colour = mix(forest, desert, 1 - Math.abs(degrees - 24) / 11);
        colour = mix(colour, meadow, (degrees - 34) / 10);
        colour = mix(colour, tundra, (degrees - 58) / 8);
        return mix(mix(colour, ICE, (degrees - 68) / 5), colour.map((share) => 0.7 * share), 0.55 - n);
    });
    brush.drawImage(ocean, 0, 0, width, height);
    const shape = new Path2D(), coast = new Path2D();
    for (const {geometry: country} of feature(land, land.objects.land).features)
        for (const polygon of country.type === "Polygon" ? [country.coordinates] : country.coordinates)
            for (const ring of polygon) {
                const points = unwrapped(ring);
                for (const turn of [-360, 0, 360]) {
                    points.forEach(([lon, lat, coastal], k) => {
                        shape[k ? "lineTo" : "moveTo"](x(lon + turn), y(lat));
                        coast[k && coastal ? "lineTo" : "moveTo"](x(lon + turn), y(lat));
                    });
                    shape.closePath();
                }
            }
    brush.save();
    brush.clip(shape, "evenodd");
    brush.drawImage(ground, 0, 0, width, height);
    brush.restore();
    brush.strokeStyle = "rgba(210, 232, 245, .35)";
    brush.lineWidth = 1.2;
    brush.stroke(coast);
    return picture;
}

const surfaces = new Map();

/** The surface of a body as an equirectangular picture. */
export function surface(name) {
    if (!surfaces.has(name)) surfaces.set(name, paint(name));
    return surfaces.get(name);
}

function paint(name) {
    const [dark, light] = (PALETTES[name] ?? ["#666a70", "#a8acb2"]).map(rgb);
    const bands = {JUPITER: 22, SATURN: 16, URANUS: 6, NEPTUNE: 8}[name];
    return name === "EARTH" ?
        earth() :
        shaded(
            name.length * 77 + name.charCodeAt(0), bands ? 4 : 10,
            (n, lat) => mix(dark, light, bands ? 0.5 + 0.5 * Math.sin(bands * lat + 3 * n) : 2.2 * n - 0.6));
}

function texture(name, sharpness) {
    const image = new THREE.CanvasTexture(surface(name));
    image.colorSpace = THREE.SRGBColorSpace;
    image.anisotropy = sharpness;
    image.wrapS = THREE.RepeatWrapping;
    return image;
}

const VERTEX = `
#include <common>
#include <logdepthbuf_pars_vertex>
varying vec2 vUv; varying vec3 vNormal; varying vec3 vToEye;
void main() {
    vUv = uv;
    vNormal = mat3(modelMatrix) * normal;
    vec4 place = modelMatrix * vec4(position, 1.0);
    vToEye = cameraPosition - place.xyz;
    gl_Position = projectionMatrix * viewMatrix * place;
    #include <logdepthbuf_vertex>
}`;
const SURFACE = `
#include <common>
#include <logdepthbuf_pars_fragment>
uniform sampler2D map; uniform vec3 toSun; uniform vec3 rim; uniform float shine; uniform float night;
varying vec2 vUv; varying vec3 vNormal; varying vec3 vToEye;
void main() {
    #include <logdepthbuf_fragment>
    vec3 n = normalize(vNormal), e = normalize(vToEye);
    float sun = dot(n, toSun), lit = smoothstep(-0.08, 0.28, sun) * (0.35 + 0.65 * max(sun, 0.0));
    vec3 colour = texture2D(map, vUv).rgb;
    vec2 cell = vUv * vec2(24.0, 12.0), from = abs(fract(cell - 0.5) - 0.5) / max(fwidth(cell), vec2(1e-6));
    float row = step(0.5, cell.y) * step(cell.y, 11.5);      // every 15 degrees
    colour += 0.045 * (1.0 - min(min(from.x, mix(2.0, from.y, row)), 1.0));
    float edge = pow(1.0 - max(dot(n, e), 0.0), 3.5);
    float glint = shine * pow(max(dot(n, normalize(e + toSun)), 0.0), 40.0) * step(colour.r * 1.35, colour.b);
    vec3 air = rim * edge * (0.03 + 0.5 * smoothstep(-0.15, 0.35, sun));
    vec3 seen = colour * (night + 1.25 * lit) + air + vec3(0.35 * glint * lit);
    gl_FragColor = vec4(seen, 1.0);
    #include <colorspace_fragment>
}`;
const HALO = `
#include <common>
#include <logdepthbuf_pars_fragment>
uniform vec3 toSun; uniform vec3 rim;
varying vec2 vUv; varying vec3 vNormal; varying vec3 vToEye;
void main() {
    #include <logdepthbuf_fragment>
    vec3 n = normalize(vNormal), e = normalize(vToEye);
    float thin = clamp(-dot(n, e) * 4.2, 0.0, 1.0), sun = smoothstep(-0.25, 0.4, dot(n, toSun));
    gl_FragColor = vec4(rim, thin * thin * (0.04 + 0.6 * sun));
    #include <colorspace_fragment>
}`;

/** A body of radius 1 whose third axis is its pole.
    update(direction to the Sun, whether the sky is light, size on the screen [px]); software: draw it cheaply */
export function makePlanet(name, software) {
    const group = new THREE.Group();
    if (name === "SUN") {
        group.add(new THREE.Mesh(new THREE.SphereGeometry(1, 64, 32), new THREE.MeshBasicMaterial({color: 0xfff1c9})));
        group.update = () => {};
        return group;
    }
    const rim = new THREE.Color((PALETTES[name] ?? [])[2] || 0x000000), toSun = new THREE.Vector3(1, 0, 0);
    const uniforms = {
        map: {value: texture(name, software ? 1 : 8)},
        toSun: {value: toSun},
        rim: {value: rim},
        shine: {value: name === "EARTH" ? 1 : 0},
        night: {value: 0.035}
    };
    const surface = new THREE.ShaderMaterial({uniforms, vertexShader: VERTEX, fragmentShader: SURFACE});
    const balls = [[160, 80], [32, 16]].map(
        (parts) => new THREE.Mesh(new THREE.SphereGeometry(1, ...parts).rotateX(Math.PI / 2), surface));
    group.add(...balls);
    if (rim.getHex()) {
        const halo =
            new THREE.Mesh(new THREE.SphereGeometry(1.022, 64, 32).rotateX(Math.PI / 2), new THREE.ShaderMaterial({
                uniforms: {toSun: uniforms.toSun, rim: uniforms.rim},
                vertexShader: VERTEX,
                fragmentShader: HALO,
                side: THREE.BackSide,
                transparent: true,
                depthWrite: false
            }));
        group.add(halo);
    }
    group.update = (direction, light, size) => {
        balls[0].visible = size > 60;
        balls[1].visible = size <= 60;
        toSun.set(...direction);
        uniforms.night.value = light ? 0.25 : 0.035;
    };
    return group;
}

/** Points that stand for stars; they are decoration, not a catalogue. */
export function makeStars() {
    const next = random(5), places = [], colours = [];
    for (let k = 0; k < 2600; k++) {
        const z = 2 * next() - 1, longitude = 2 * Math.PI * next(), across = Math.sqrt(1 - z * z),
              bright = 0.25 + 0.75 * next() ** 6;
        places.push(across * Math.cos(longitude), across * Math.sin(longitude), z);
        const warm = next();
        colours.push(bright * (0.85 + 0.15 * warm), bright * 0.92, bright * (1 - 0.15 * warm));
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
    const stars = new THREE.Points(geometry, new THREE.PointsMaterial({
        size: 1.7,
        sizeAttenuation: false,
        vertexColors: true,
        depthWrite: false,
        depthTest: true,
        transparent: true
    }));
    stars.frustumCulled = false;
    stars.renderOrder = -2;
    return stars;
}

/** The Sun as a glow in the sky. */
export function makeSun() {
    const [image, brush] = canvas(256, 256), glow = brush.createRadialGradient(128, 128, 0, 128, 128, 128);
    for (const [at, colour] of [
             [0, "rgba(255,255,255,1)"], [0.045, "rgba(255,252,240,1)"], [0.07, "rgba(255,236,190,.5)"],
             [0.2, "rgba(255,214,140,.16)"], [1, "rgba(255,200,120,0)"]])
        glow.addColorStop(at, colour);
    brush.fillStyle = glow;
    brush.fillRect(0, 0, 256, 256);
    const picture = new THREE.CanvasTexture(image);
    picture.colorSpace = THREE.SRGBColorSpace;
    const sun = new THREE.Sprite(new THREE.SpriteMaterial({map: picture, transparent: true, depthWrite: false}));
    sun.renderOrder = -1;
    return sun;
}
