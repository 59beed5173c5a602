// SPDX-License-Identifier: Apache-2.0
// The path of a spacecraft as a line of constant width on the screen.
//
// A place is a sum of two single-precision numbers, and so is the eye: their difference is exact enough near the eye,
// even where both are a planet's radius from the origin. Around the present time, the line is drawn from the motion
// itself, so that it passes through the spacecraft.
import * as THREE from "three";

import {position} from "./data.js";

const POINTS = 1500, NEAR = 64;

const VERTEX = `
#include <common>
#include <logdepthbuf_pars_vertex>
attribute vec3 aHigh, aLow, bHigh, bLow;
attribute vec2 times;
uniform vec3 eyeHigh, eyeLow;
uniform vec2 screen;
uniform float width;
varying float vTime, vFar;
void main() {
    vec3 a = (aHigh - eyeHigh) + (aLow - eyeLow), b = (bHigh - eyeHigh) + (bLow - eyeLow);
    vec4 p = projectionMatrix * vec4(mat3(viewMatrix) * a, 1.0), q = projectionMatrix * vec4(mat3(viewMatrix) * b, 1.0);
    float near = 0.05, s = 0.0, e = 1.0;      // parts behind the eye are cut off
    if (p.w < near && q.w > near) s = (near - p.w) / (q.w - p.w);
    if (q.w < near && p.w > near) e = (near - p.w) / (q.w - p.w);
    vec4 from = mix(p, q, s), to = mix(p, q, e);
    vec4 place = position.x < 0.5 ? from : to;
    vec2 along = (to.xy / to.w - from.xy / from.w) * screen;
    vec2 across = length(along) > 1e-6 ? normalize(vec2(-along.y, along.x)) : vec2(0.0, 1.0);
    place.xy += position.y * width * across / screen * place.w;
    if (p.w < near && q.w < near) place = vec4(2.0, 2.0, 2.0, 1.0);
    float share = position.x < 0.5 ? s : e;
    vTime = mix(times.x, times.y, share);
    vFar = length(mix(a, b, share));
    gl_Position = place;
    #include <logdepthbuf_vertex>
}`;
const FRAGMENT = `
#include <common>
#include <logdepthbuf_pars_fragment>
uniform float now, tail, faint, reach;
uniform vec2 hole;
uniform vec3 colour;
varying float vTime, vFar;
void main() {
    #include <logdepthbuf_fragment>
    if (vTime > hole.x && vTime < hole.y) discard;
    float past = now - vTime;
    float share = past >= 0.0 ? max(0.3, 0.95 * exp(-past / tail)) : faint;
    gl_FragColor = vec4(colour, share * exp(-vFar / reach));
    #include <colorspace_fragment>
}`;

/** A piece of the path: n segments with 4 corners each; each corner has both ends of its segment. */
function piece(n, uniforms) {
    const geometry = new THREE.BufferGeometry(), corners = [], order = [];
    for (let k = 0; k < n; k++) {
        corners.push(0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0);
        order.push(...[0, 1, 2, 0, 2, 3].map((corner) => 4 * k + corner));
    }
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
    geometry.setIndex(order);
    const data = new THREE.InterleavedBuffer(new Float32Array(4 * 14 * n), 14);
    ["aHigh", "aLow", "bHigh", "bLow"].forEach(
        (name, k) => geometry.setAttribute(name, new THREE.InterleavedBufferAttribute(data, 3, 3 * k)));
    geometry.setAttribute("times", new THREE.InterleavedBufferAttribute(data, 2, 12));
    const line = new THREE.Mesh(geometry, new THREE.ShaderMaterial({
        uniforms,
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        transparent: true,
        depthWrite: false,
        side: THREE.DoubleSide
    }));
    line.frustumCulled = false;
    line.set = (motion, start, end) => {
        const here = [0, 0, 0], ends = Array.from({length: n + 1}, (_, k) => {
            const t = start + ((end - start) * k) / n;
            position(motion, t, here);
            const high = here.map(Math.fround);
            return [...high, ...here.map((x, c) => x - high[c]), t];
        });
        for (let k = 0; k < n; k++) {
            const segment = [...ends[k].slice(0, 6), ...ends[k + 1].slice(0, 6), ends[k][6], ends[k + 1][6]];
            for (let corner = 0; corner < 4; corner++) data.array.set(segment, 14 * (4 * k + corner));
        }
        data.needsUpdate = true;
    };
    return line;
}

/** The path of a motion over a span of time.
    extend(motion, begin, end): set another motion or span
    update(t, eye in N, size of the screen [px], width [px], distance at which it fades [m]) */
export function makePath(motion, begin, end, colour) {
    const shared = {
        eyeHigh: {value: new THREE.Vector3()},
        eyeLow: {value: new THREE.Vector3()},
        screen: {value: new THREE.Vector2()},
        width: {value: 1.5},
        now: {value: 0},
        tail: {value: 1},
        faint: {value: 0.3},
        reach: {value: 1},
        colour: {value: new THREE.Color(colour)}
    };
    const hole = {value: new THREE.Vector2()};
    const far = piece(POINTS, {...shared, hole});
    const near = piece(NEAR, {...shared, hole: {value: new THREE.Vector2(1, -1)}});
    const group = new THREE.Group();
    group.add(far, near);
    group.extend = (other, from, to) => {
        [motion, begin, end] = [other, from, to];
        shared.tail.value = (end - begin) / 6 || 1;
        far.set(motion, begin, end);
    };
    group.extend(motion, begin, end);
    group.update = (t, eye, size, width, reach) => {
        shared.reach.value = reach;
        eye.forEach((x, c) => {
            const high = Math.fround(x);
            shared.eyeHigh.value.setComponent(c, high);
            shared.eyeLow.value.setComponent(c, x - high);
        });
        shared.screen.value.set(...size);
        shared.width.value = width;
        shared.now.value = t;
        const step = (end - begin) / POINTS || 1;
        hole.value.set(Math.max(begin, t - 2 * step), Math.min(end, t + 2 * step));
        near.set(motion, hole.value.x, hole.value.y);
    };
    return group;
}
