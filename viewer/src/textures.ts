// SPDX-License-Identifier: BSD-3-Clause
// Surfaces as the photographs show them: each small piece of a surface is drawn with the photograph
// that sees it largest, of those that observe what the surface is made of. What stands in front of
// a surface in a photograph is seen upon it: nothing is known of it.
import * as THREE from "three";
import type { Model } from "./model";
import { photographUrl } from "./model";
import { common, shared } from "./shaders";

type Vec = [number, number, number];

// Pieces along the sides of a rectangle; other meshes are fine enough as they are.
const piecesOfRectangle = 24;
const imagesOfSurface = 8;
// Another photograph must see a piece so many times as large as the one that sees most of the
// surface: pieces of many photographs beside each other do not look like a wall.
const betterBy = 1.8;
const longerSide = 1024;

interface Piece {
  corners: Vec[]; // three or four, in a row around it
}

function pieces(model: Model): Piece[][] {
  let vertex = 0, at = 0;
  return model.meta.groups.map((group) => {
    const corner = (k: number): Vec => {
      const i = 3 * (model.groupTriangles[at + k] + vertex);
      return [model.groupVertices[i], model.groupVertices[i + 1], model.groupVertices[i + 2]];
    };
    const result: Piece[] = [];
    if (group.triangles === 2 && group.vertices === 4) {
      const [a, b, c, d] = [0, 1, 2, 3].map((k): Vec => {
        const i = 3 * (vertex + k);
        return [model.groupVertices[i], model.groupVertices[i + 1], model.groupVertices[i + 2]];
      });
      const place = (s: number, t: number): Vec =>
        [0, 1, 2].map((q) => (1 - s) * ((1 - t) * a[q] + t * d[q]) + s * ((1 - t) * b[q] + t * c[q])) as Vec;
      const n = piecesOfRectangle;
      for (let i = 0; i < n; ++i)
        for (let j = 0; j < n; ++j)
          result.push({ corners: [place(i / n, j / n), place((i + 1) / n, j / n), place((i + 1) / n, (j + 1) / n), place(i / n, (j + 1) / n)] });
    } else {
      for (let t = 0; t < group.triangles; ++t) result.push({ corners: [corner(3 * t), corner(3 * t + 1), corner(3 * t + 2)] });
    }
    vertex += group.vertices;
    at += 3 * group.triangles;
    return result;
  });
}

// The images that observe most of a group's members.
function observers(model: Model, group: number): number[] {
  const counts = new Map<number, number>();
  for (const [features, members] of [[model.points, model.memberPoints[group]], [model.lines, model.memberLines[group]]] as const)
    for (const i of members)
      for (let k = features.start[i]; k < features.start[i + 1]; ++k)
        counts.set(features.obsImage[k], (counts.get(features.obsImage[k]) ?? 0) + 1);
  return [...counts].filter(([image]) => document.getElementById(`holba-photograph-${image}`))
    .sort((a, b) => b[1] - a[1] || a[0] - b[0]).slice(0, imagesOfSurface).map(([image]) => image);
}

// Places of a piece in a photograph, 0 to 1 from its top left; null: not all of it is in it.
function placesIn(model: Model, image: number, corners: Vec[]): [number, number][] | null {
  const places: [number, number][] = [];
  for (const corner of corners) {
    const place = model.project(image, corner);
    if (!place || place[0] < 0 || place[0] > 1 || place[1] < 0 || place[1] > 1) return null;
    places.push(place);
  }
  return places;
}
function areaOf(places: [number, number][]): number {
  let sum = 0;
  places.forEach(([x, y], k) => {
    const [u, v] = places[(k + 1) % places.length];
    sum += x * v - u * y;
  });
  return Math.abs(sum) / 2;
}

// What each photograph shows: corners of triangles in the model and in the photograph.
export function texturedTriangles(model: Model): Map<number, { positions: number[]; places: number[] }> {
  const shown = new Map<number, { positions: number[]; places: number[] }>();
  pieces(model).forEach((ofGroup, group) => {
    if (ofGroup.length === 0) return;
    const images = observers(model, group);
    // The photograph that sees most of it, by area.
    const sums = images.map((image) => ofGroup.reduce((sum, piece) => {
      const places = placesIn(model, image, piece.corners);
      return sum + (places ? Math.sqrt(areaOf(places)) : 0);
    }, 0));
    const main = images[sums.indexOf(Math.max(...sums))];
    for (const { corners } of ofGroup) {
      let best = 0, chosen = -1;
      let where: [number, number][] = [];
      for (const image of images) {
        const places = placesIn(model, image, corners);
        if (!places) continue;
        const size = areaOf(places) * (image === main ? betterBy : 1);
        if (size > best) [best, chosen, where] = [size, image, places];
      }
      if (chosen < 0) continue;
      const list = shown.get(chosen) ?? { positions: [], places: [] };
      for (let k = 2; k < corners.length; ++k)
        for (const c of [0, k - 1, k]) {
          list.positions.push(...corners[c]);
          list.places.push(...where[c]);
        }
      shown.set(chosen, list);
    }
  });
  return shown;
}

export async function addTextures(model: Model, root: THREE.Group, changed: () => void): Promise<void> {
  root.userData.unpickable = true;
  for (const [image, { positions, places }] of texturedTriangles(model)) {
    const url = photographUrl(image);
    if (!url) continue;
    const blob = await (await fetch(url)).blob();
    let bitmap = await createImageBitmap(blob);
    const side = Math.max(bitmap.width, bitmap.height);
    if (side > longerSide) {
      const resizeWidth = Math.round((bitmap.width * longerSide) / side);
      bitmap = await createImageBitmap(blob, { resizeWidth, resizeQuality: "medium" });
    }
    const texture = new THREE.CanvasTexture(bitmap);
    texture.flipY = false;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute(places, 2));
    const material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      uniforms: { ...shared, map: { value: texture } },
      vertexShader: "out vec2 at; out vec3 place; void main() { at = uv; place = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
      fragmentShader: `in vec2 at; in vec3 place; uniform sampler2D map; out vec4 result; ${common}
        void main() { if (clipped(place)) discard; result = vec4(texture(map, at).rgb, 1.0); }`,
      // Lines and points that lie in the surface are in front of it.
      side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4,
    });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    root.add(mesh);
    changed();
  }
}
