// SPDX-License-Identifier: BSD-3-Clause
// The objects of one model in the scene, their colours and what of them is shown.
import * as THREE from "three";
import { Model, photographUrl } from "./model";
import { category, css, type Rgb, scale } from "./palette";
import { PointCloud, Segments, Surfaces } from "./shaders";
import { addTextures } from "./textures";

// What pictures for picking hold in alpha; those of a second model are greater by `secondModel`.
export const Kind = { point: 1, line: 2, surface: 3, camera: 4 } as const;
export type KindName = keyof typeof Kind;
export const secondModel = 8;
const segmentsOfCamera = 10;

export const pointColours = ["colour", "error", "uncertainty", "track", "origin", "group", "height", "plain"] as const;
export const lineColours = ["direction", "colour", "error", "uncertainty", "track", "group", "plain"] as const;
export type PointColour = (typeof pointColours)[number];
export type LineColour = (typeof lineColours)[number];
export const originNames = ["detected", "imported", "junction", "corner"];

export interface Settings {
  layers: Record<Layer, boolean>;
  pointColour: PointColour;
  lineColour: LineColour;
  pointSize: number;
  lineWidth: number;
  cameraSize: number;
  opacity: number;
  minTrack: number;
  maxError: number; // pixels; Infinity: all
}
export const layers = [
  "points", "lines", "surfaces", "textures", "directions", "wireframe", "relations", "cameras", "photographs",
] as const;
export type Layer = (typeof layers)[number];

export interface Legend {
  low: string;
  high: string;
  unit: string;
}

export class ModelView {
  readonly root = new THREE.Group();
  readonly points: PointCloud;
  readonly lines: Segments;
  readonly surfaces: Surfaces;
  readonly outlines: Segments;
  readonly junctions: PointCloud;
  readonly edges: Segments;
  readonly relations: Segments;
  readonly directions: Segments;
  cameras: Segments;
  readonly photographs = new THREE.Group();
  readonly textures = new THREE.Group();
  readonly radius: number;
  readonly middle: THREE.Vector3;
  pointLegend: Legend | null = null;
  lineLegend: Legend | null = null;
  // Drawn alone in an image: null: all.
  private onlyPoints: Set<number> | null = null;
  private onlyLines: Set<number> | null = null;
  private photographsLoaded = false;
  private texturesLoaded = false;

  constructor(readonly model: Model, readonly second: boolean, public tint: Rgb | null) {
    const shift = second ? secondModel : 0;
    const { meta } = model;
    this.middle = new THREE.Vector3(...meta.low).add(new THREE.Vector3(...meta.high)).multiplyScalar(0.5);
    this.radius = Math.max(new THREE.Vector3(...meta.high).distanceTo(new THREE.Vector3(...meta.low)) / 2, 1e-9);
    if (this.radius <= 1e-9) this.radius = 1;
    this.points = new PointCloud(model.pointXyz, Kind.point + shift, { shuffle: true });
    this.lines = new Segments(model.lineEnds, Kind.line + shift);
    this.surfaces = this.makeSurfaces(Kind.surface + shift);
    this.outlines = this.makeOutlines();
    this.junctions = this.makeJunctions();
    this.edges = this.makeEdges();
    this.relations = this.makeRelations();
    this.directions = this.makeDirections();
    this.cameras = this.makeCameras(0.06);
    for (const drawn of [
      this.points, this.lines, this.surfaces, this.outlines, this.junctions, this.edges, this.relations, this.directions, this.cameras,
    ])
      this.root.add(drawn.object);
    this.root.add(this.photographs, this.textures);
  }

  groupColour(group: number): Rgb {
    const groups = this.model.meta.groups;
    const same = groups[group].parallelism;
    let index = 0;
    for (let g = 0; g < group; ++g) if (groups[g].parallelism === same) ++index;
    return category(same ? index : index + 1);
  }
  groupColours(): Rgb[] {
    return this.model.meta.groups.map((_, g) => this.groupColour(g));
  }

  private makeSurfaces(kind: number): Surfaces {
    const { model } = this;
    const item = new Uint32Array(model.groupVertices.length / 3);
    const triangles = new Uint32Array(model.groupTriangles.length);
    let vertex = 0, triangle = 0;
    model.meta.groups.forEach((group, g) => {
      item.fill(g, vertex, vertex + group.vertices);
      for (let k = 0; k < 3 * group.triangles; ++k)
        triangles[3 * triangle + k] = model.groupTriangles[3 * triangle + k] + vertex;
      vertex += group.vertices;
      triangle += group.triangles;
    });
    return new Surfaces(model.groupVertices, triangles, item, kind);
  }

  // Of planes and boxes: edges of one triangle alone, or between triangles of different planes.
  private makeOutlines(): Segments {
    const { model } = this;
    const ends: number[] = [];
    this.outlineItem = [];
    let vertex = 0, at = 0;
    const vertices = model.groupVertices;
    const position = (i: number) => new THREE.Vector3(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]);
    model.meta.groups.forEach((group, g) => {
      if (group.triangles > 0 && group.triangles <= 24) {
        const edges = new Map<string, { a: number; b: number; normals: THREE.Vector3[] }>();
        for (let t = 0; t < group.triangles; ++t) {
          const corners = [0, 1, 2].map((k) => model.groupTriangles[at + 3 * t + k] + vertex);
          const [p, q, r] = corners.map(position);
          const normal = q.clone().sub(p).cross(r.clone().sub(p)).normalize();
          for (let k = 0; k < 3; ++k) {
            // By place: corners of a box may be several vertices.
            const a = corners[k], b = corners[(k + 1) % 3];
            const names = [a, b].map((i) => position(i).toArray().join()).sort();
            const name = names.join("|");
            const edge = edges.get(name) ?? { a, b, normals: [] };
            edge.normals.push(normal);
            edges.set(name, edge);
          }
        }
        for (const { a, b, normals } of edges.values()) {
          if (normals.length === 2 && Math.abs(normals[0].dot(normals[1])) > 0.99) continue;
          ends.push(...position(a).toArray(), ...position(b).toArray());
          this.outlineItem.push(g);
        }
      }
      vertex += group.vertices;
      at += 3 * group.triangles;
    });
    return new Segments(new Float32Array(ends), 0, { width: 1.25 });
  }
  outlineItem: number[] = [];

  private makeJunctions(): PointCloud {
    const points = [...this.model.edgesOfPoint.keys()];
    const cloud = new PointCloud(new Float32Array(points.flatMap((i) => this.model.point(i))), 0, { ring: true });
    cloud.size = 9;
    return cloud;
  }
  // From junctions to where their lines begin.
  private makeEdges(): Segments {
    const { model } = this;
    const ends: number[] = [];
    for (let e = 0; 3 * e < model.wireframe.length; ++e) {
      const x = model.point(model.wireframe[3 * e]), line = model.wireframe[3 * e + 1];
      const a = model.lineEnd(line, 0), b = model.lineEnd(line, 1);
      const d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
      const square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      let t = ((x[0] - a[0]) * d[0] + (x[1] - a[1]) * d[1] + (x[2] - a[2]) * d[2]) / (square || 1);
      t = Math.min(Math.max(t, 0), 1);
      ends.push(...x, a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]);
    }
    return new Segments(new Float32Array(ends), 0, { width: 1.25 });
  }

  private placeOfGroup(group: number): THREE.Vector3 {
    const { model } = this;
    const sum = new THREE.Vector3();
    let count = 0;
    for (const i of model.memberPoints[group].subarray(0, 500)) {
      sum.add(new THREE.Vector3(...model.point(i)));
      ++count;
    }
    for (const i of model.memberLines[group].subarray(0, 500)) {
      sum.add(new THREE.Vector3(...model.lineEnd(i, 0)).lerp(new THREE.Vector3(...model.lineEnd(i, 1)), 0.5));
      ++count;
    }
    return count ? sum.divideScalar(count) : this.middle.clone();
  }
  private makeRelations(): Segments {
    const ends: number[] = [];
    const groups = this.model.meta.groups;
    this.shownRelations = this.model.meta.relations.filter(([a, b]) => !groups[a].parallelism && !groups[b].parallelism);
    for (const [a, b] of this.shownRelations)
      ends.push(...this.placeOfGroup(a).toArray(), ...this.placeOfGroup(b).toArray());
    return new Segments(new Float32Array(ends), 0, { width: 1.5, dashed: true });
  }
  private shownRelations: [number, number, number][] = [];

  // Axes of the vanishing points beside the scene's middle.
  private makeDirections(): Segments {
    const ends: number[] = [];
    this.directionGroup = [];
    this.model.meta.groups.forEach((group, g) => {
      if (!group.parallelism || !group.direction) return;
      const d = new THREE.Vector3(...group.direction).multiplyScalar(0.35 * this.radius);
      ends.push(...this.middle.clone().sub(d).toArray(), ...this.middle.clone().add(d).toArray());
      this.directionGroup.push(g);
    });
    return new Segments(new Float32Array(ends), 0, { width: 3 });
  }
  private directionGroup: number[] = [];

  // Rays through the corners and the middles of the sides of its photograph, and a mark at its top.
  private makeCameras(size: number): Segments {
    const { model } = this;
    const images = model.meta.images.length;
    const ends = new Float32Array(images * segmentsOfCamera * 6);
    let at = 0;
    const put = (a: number[], b: number[]) => {
      ends.set(a, at);
      ends.set(b, at + 3);
      at += 6;
    };
    for (let i = 0; i < images; ++i) {
      const corners = this.photographCorners(i, size);
      const centre = model.centre(i);
      for (const corner of corners) put(centre, corner);
      for (let k = 0; k < 4; ++k) put(corners[k], corners[(k + 1) % 4]);
      const top = [0, 1, 2].map((k) => 0.5 * (corners[0][k] + corners[1][k]) + 0.22 * (corners[0][k] - corners[3][k]));
      put(corners[0], top);
      put(top, corners[1]);
    }
    return new Segments(ends, Kind.camera + (this.second ? secondModel : 0), { perItem: segmentsOfCamera, width: 1.25 });
  }
  // Top left, top right, bottom right, bottom left.
  photographCorners(image: number, size: number): [number, number, number][] {
    const { model } = this;
    const camera = model.camera(image);
    // Of a lens that sees more than half of all around, what a narrower one would.
    const limit = 1.2;
    const rays = ([[0, 0], [1, 0], [1, 1], [0, 1]] as const).map(([u, v]) => {
      const ray = model.ray(camera, u * camera.width, v * camera.height);
      const fallback: [number, number, number] = [u ? 0.8 : -0.8, v ? 0.6 : -0.6, 1];
      if (!ray || ray[2] < 0.3) return fallback;
      return [ray[0] / ray[2], ray[1] / ray[2], 1] as [number, number, number];
    });
    const widest = Math.max(...rays.map((r) => Math.max(Math.abs(r[0]), Math.abs(r[1]))), 1e-6);
    const scaleDown = widest > limit ? limit / widest : 1;
    return rays.map((r) => model.alongRay(image, [r[0] * scaleDown, r[1] * scaleDown, 1], size * this.radius));
  }
  setCameraSize(size: number): void {
    const visible = this.cameras.object.visible;
    this.root.remove(this.cameras.object);
    this.cameras.dispose();
    this.cameras = this.makeCameras(size);
    this.cameras.object.visible = visible;
    this.root.add(this.cameras.object);
    this.placePhotographs(size);
  }

  // Small photographs upon the cameras; made when they are first wanted.
  loadPhotographs(size: number, changed: () => void): void {
    if (this.photographsLoaded || this.second) return;
    this.photographsLoaded = true;
    const geometry = () => {
      const g = new THREE.BufferGeometry();
      g.setAttribute("position", new THREE.BufferAttribute(new Float32Array(12), 3));
      g.setAttribute("uv", new THREE.BufferAttribute(new Float32Array([0, 1, 1, 1, 1, 0, 0, 0]), 2));
      g.setIndex([0, 3, 2, 0, 2, 1]);
      return g;
    };
    this.model.meta.images.forEach(async (_, i) => {
      const url = photographUrl(i);
      if (!url) return;
      const bitmap = await createImageBitmap(await (await fetch(url)).blob(), { resizeWidth: 192, resizeQuality: "medium", imageOrientation: "flipY" });
      const texture = new THREE.CanvasTexture(bitmap);
      texture.flipY = false;
      const mesh = new THREE.Mesh(geometry(), new THREE.MeshBasicMaterial({ map: texture, side: THREE.DoubleSide }));
      mesh.frustumCulled = false;
      mesh.userData.image = i;
      this.photographs.add(mesh);
      this.placePhotographs(size);
      changed();
    });
  }
  // Photographs upon surfaces; made when they are first wanted.
  loadTextures(changed: () => void): void {
    if (this.texturesLoaded || this.second) return;
    this.texturesLoaded = true;
    void addTextures(this.model, this.textures, changed);
  }
  private placePhotographs(size: number): void {
    for (const mesh of this.photographs.children as THREE.Mesh[]) {
      const position = mesh.geometry.getAttribute("position");
      this.photographCorners(mesh.userData.image, size).forEach((corner, k) => position.setXYZ(k, ...corner));
      position.needsUpdate = true;
    }
  }

  restrictTo(points: Set<number> | null, lines: Set<number> | null): void {
    this.onlyPoints = points;
    this.onlyLines = lines;
  }

  apply(settings: Settings, theme: { line: Rgb; dim: Rgb; camera: Rgb }): void {
    const { layers: on } = settings;
    this.points.object.visible = on.points;
    this.lines.object.visible = on.lines;
    this.surfaces.object.visible = this.outlines.object.visible = on.surfaces;
    this.junctions.object.visible = this.edges.object.visible = on.wireframe;
    this.relations.object.visible = on.relations;
    this.directions.object.visible = on.directions;
    this.cameras.object.visible = on.cameras;
    this.photographs.visible = on.photographs && on.cameras;
    this.points.size = settings.pointSize;
    this.lines.width = settings.lineWidth;
    this.textures.visible = on.textures;
    // They are still there to be clicked on.
    this.surfaces.opacity = on.textures ? 0.04 : settings.opacity;
    const groupColours = this.groupColours();
    const solid = (rgb: Rgb) => (_: number, out: Uint8Array, at: number) => set(out, at, rgb);
    this.paintPoints(settings, theme.dim, groupColours);
    this.paintLines(settings, theme.line, groupColours);
    this.surfaces.paint((g, out, at) => set(out, at, this.tint ?? groupColours[g]));
    this.outlines.paint((s, out, at) => set(out, at, this.tint ?? groupColours[this.outlineItem[s]]));
    this.junctions.paint(solid(this.tint ?? theme.line));
    this.edges.paint(solid(theme.dim));
    this.relations.paint((s, out, at) => set(out, at, this.shownRelations[s][2] === 0 ? [230, 97, 60] : [60, 140, 230]));
    this.directions.paint((s, out, at) => set(out, at, groupColours[this.directionGroup[s]]));
    this.cameras.paint(solid(this.tint ?? theme.camera));
  }

  private shown(features: Model["points"], i: number, settings: Settings): boolean {
    return features.trackLength(i) >= settings.minTrack && !(features.error[i] > settings.maxError);
  }

  private paintPoints(settings: Settings, plain: Rgb, groupColours: Rgb[]): void {
    const { model } = this;
    const features = model.points;
    const mode = this.tint ? "plain" : settings.pointColour;
    const base = this.tint ?? plain;
    const [paint, legend] = this.painter(mode, features, (i) => model.groupOfPoint[i], groupColours, base);
    this.pointLegend = legend;
    this.points.paint((i, out, at) => {
      if ((this.onlyPoints && !this.onlyPoints.has(i)) || !this.shown(features, i, settings)) out[at + 3] = 0;
      else paint(i, out, at);
    });
  }
  private paintLines(settings: Settings, plain: Rgb, groupColours: Rgb[]): void {
    const { model } = this;
    const features = model.lines;
    const mode = this.tint ? "plain" : settings.lineColour;
    const ofGroup = mode === "group" ? model.surfaceOfLine : model.groupOfLine;
    const base = this.tint ?? plain;
    const [paint, legend] = this.painter(mode, features, (i) => ofGroup[i], groupColours, base);
    this.lineLegend = legend;
    this.lines.paint((i, out, at) => {
      if ((this.onlyLines && !this.onlyLines.has(i)) || !this.shown(features, i, settings)) out[at + 3] = 0;
      else paint(i, out, at);
    });
  }

  private painter(
    mode: PointColour | LineColour, features: Model["points"], groupOf: (i: number) => number, groupColours: Rgb[], plain: Rgb,
  ): [(i: number, out: Uint8Array, at: number) => void, Legend | null] {
    const { model } = this;
    switch (mode) {
      case "colour": {
        // A model whose points have no colours is not black on black.
        const some = features.rgb.some((c) => c > 0);
        return [(i, out, at) => set(out, at, some ? [features.rgb[3 * i], features.rgb[3 * i + 1], features.rgb[3 * i + 2]] : plain), null];
      }
      case "origin":
        return [(i, out, at) => set(out, at, model.pointOrigin[i] === 0 ? plain : category(model.pointOrigin[i] - 1)), null];
      case "direction":
      case "group":
        return [(i, out, at) => set(out, at, groupOf(i) < 0 ? plain : groupColours[groupOf(i)]), null];
      case "error":
        return scaled(features.count, (i) => features.error[i], (v) => v >= 0, plain, "px");
      case "uncertainty":
        return scaled(features.count, (i) => features.sigma[i], (v) => v > 0, plain, "units (1 sigma)", true);
      case "track":
        return scaled(features.count, (i) => features.trackLength(i), () => true, plain, "observations", true);
      case "height": {
        const down = model.meta.down;
        const xyz = model.pointXyz;
        return scaled(
          features.count, (i) => -(down[0] * xyz[3 * i] + down[1] * xyz[3 * i + 1] + down[2] * xyz[3 * i + 2]), () => true, plain, "up",
        );
      }
      default:
        return [(_, out, at) => set(out, at, plain), null];
    }
  }

  legendOfGroups(): { name: string; colour: string; count: number; group: number }[] {
    return this.model.meta.groups.map((group, g) => ({
      name: `${group.type} ${group.id}`, colour: css(this.groupColour(g)), count: group.parallelism ? group.lines : group.points + group.lines, group: g,
    }));
  }
}

function set(out: Uint8Array, at: number, rgb: Rgb): void {
  out[at] = rgb[0];
  out[at + 1] = rgb[1];
  out[at + 2] = rgb[2];
  out[at + 3] = 255;
}

// From the 2nd to the 98th percentile of what is known, by a table.
function scaled(
  count: number, value: (i: number) => number, known: (v: number) => boolean, plain: Rgb, unit: string, logarithmic = false,
): [(i: number, out: Uint8Array, at: number) => void, Legend | null] {
  const step = Math.max(1, Math.floor(count / 20000));
  const sample: number[] = [];
  for (let i = 0; i < count; i += step) if (known(value(i))) sample.push(value(i));
  if (sample.length === 0) return [(_, out, at) => set(out, at, plain), null];
  sample.sort((a, b) => a - b);
  const low = sample[Math.floor(0.02 * (sample.length - 1))];
  let high = sample[Math.ceil(0.98 * (sample.length - 1))];
  if (!(high > low)) high = low + (Math.abs(low) || 1);
  const table = Array.from({ length: 256 }, (_, k) => scale(k / 255));
  const logs = logarithmic && low > 0;
  const [a, b] = logs ? [Math.log(low), Math.log(high)] : [low, high];
  const paint = (i: number, out: Uint8Array, at: number) => {
    const v = value(i);
    if (!known(v)) return set(out, at, plain);
    const t = ((logs ? Math.log(v) : v) - a) / (b - a);
    set(out, at, table[Math.round(255 * Math.min(Math.max(t, 0), 1))]);
  };
  return [paint, { low: number(low), high: number(high), unit }];
}

export function number(value: number): string {
  if (!Number.isFinite(value)) return "-";
  if (value === 0) return "0";
  const magnitude = Math.abs(value);
  if (magnitude >= 1e5 || magnitude < 1e-3) return value.toExponential(2);
  return String(Number(value.toPrecision(magnitude >= 1000 ? 5 : 3)));
}
