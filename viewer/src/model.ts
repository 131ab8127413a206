// SPDX-License-Identifier: BSD-3-Clause
// A model as the page holds it: the counterpart of src/holba/view/{array_bundle,view_model}.h.

export interface CameraRecord {
  id: number;
  model: string;
  names: string;
  width: number;
  height: number;
  params: number[];
  columns: number;
  rows: number;
  planar: boolean;
  ray: number; // where its rays begin in camera_rays
}
export interface ImageRecord {
  id: number;
  name: string;
  camera: number;
  q: [number, number, number, number]; // w x y z, world to camera
  points: number;
  lines: number;
}
export interface GroupRecord {
  id: string;
  type: string;
  names: string;
  params: number[];
  points: number;
  lines: number;
  observations: number;
  vertices: number;
  triangles: number;
  direction?: [number, number, number];
  parallelism: boolean;
}
interface Meta {
  title: string;
  report: string;
  origin: [number, number, number];
  sigma_px: number;
  sigma_scale: number;
  low: [number, number, number];
  high: [number, number, number];
  down: [number, number, number];
  right: [number, number, number];
  cameras: CameraRecord[];
  images: ImageRecord[];
  unregistered: string[];
  groups: GroupRecord[];
  relations: [number, number, number][];
  has_positions: boolean;
}

type Vec = [number, number, number];

// Points or lines: what both have.
export class Features {
  readonly start: Uint32Array; // observations of feature i: start[i] to start[i + 1]
  private ids: { low: Uint32Array; high: Uint32Array };
  private rows: Map<string, number> | null = null;
  constructor(
    readonly count: number,
    readonly rgb: Uint8Array,
    readonly error: Float32Array,
    readonly sigma: Float32Array, // model units; 0: unknown
    length: Uint32Array,
    readonly obsImage: Uint16Array | Uint32Array,
    readonly obsError: Float32Array,
    steps: Uint32Array,
    high: Uint32Array,
  ) {
    this.start = new Uint32Array(count + 1);
    for (let i = 0; i < count; ++i) this.start[i + 1] = this.start[i] + length[i];
    const low = new Uint32Array(count);
    let last = 0;
    for (let i = 0; i < count; ++i) low[i] = last = (last + steps[i]) >>> 0;
    this.ids = { low, high };
  }
  id(i: number): string {
    const { low, high } = this.ids;
    return high[i] === 0 ? String(low[i]) : ((BigInt(high[i]) << 32n) | BigInt(low[i])).toString();
  }
  find(id: string): number {
    if (!this.rows) {
      this.rows = new Map();
      for (let i = 0; i < this.count; ++i) this.rows.set(this.id(i), i);
    }
    return this.rows.get(id) ?? -1;
  }
  trackLength(i: number): number {
    return this.start[i + 1] - this.start[i];
  }
}

const half = (() => {
  let table: Float32Array | null = null;
  return (): Float32Array => {
    if (table) return table;
    table = new Float32Array(65536);
    for (let h = 0; h < 65536; ++h) {
      const exponent = (h >> 10) & 31;
      const fraction = h & 1023;
      const magnitude = exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15);
      table[h] = h & 0x8000 ? -magnitude : magnitude;
    }
    return table;
  };
})();

class Bundle {
  readonly meta: Meta;
  private arrays: Record<string, { type: string; offset: number; length: number }>;
  private begin: number;
  constructor(private buffer: ArrayBuffer) {
    const magic = new TextDecoder().decode(new Uint8Array(buffer, 0, 4));
    if (magic !== "HVB1") throw new Error("The data of this page are damaged.");
    const length = new DataView(buffer).getUint32(4, true);
    const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
    this.meta = json.meta;
    this.arrays = json.arrays;
    this.begin = Math.ceil((8 + length) / 8) * 8;
  }
  has(name: string): boolean {
    return name in this.arrays;
  }
  private at(name: string, type: string): [ArrayBuffer, number, number] {
    const array = this.arrays[name];
    if (!array || array.type !== type) throw new Error(`The page has no array ${name} (${type}).`);
    return [this.buffer, this.begin + array.offset, array.length];
  }
  f32 = (name: string) => new Float32Array(...this.at(name, "f32"));
  u32 = (name: string) => new Uint32Array(...this.at(name, "u32"));
  u16 = (name: string) => new Uint16Array(...this.at(name, "u16"));
  i16 = (name: string) => new Int16Array(...this.at(name, "i16"));
  u8 = (name: string) => new Uint8Array(...this.at(name, "u8"));
  f16(name: string): Float32Array {
    const table = half();
    const halves = new Uint16Array(...this.at(name, "f16"));
    const values = new Float32Array(halves.length);
    for (let i = 0; i < halves.length; ++i) values[i] = table[halves[i]];
    return values;
  }
  index(name: string): Uint16Array | Uint32Array {
    return this.arrays[name].type === "u16" ? this.u16(name) : this.u32(name);
  }
}

export interface Seen {
  feature: number; // point or line
  observation: number; // its place among the observations
}

export class Model {
  readonly meta: Meta;
  readonly points: Features;
  readonly lines: Features;
  readonly pointXyz: Float32Array; // relative to meta.origin, as all positions
  readonly pointOrigin: Uint8Array;
  readonly pointCovariance: Int16Array | null;
  readonly lineEnds: Float32Array;
  readonly imageCentre: Float32Array;
  readonly rays: Float32Array;
  readonly wireframe: Uint32Array; // point, line, number of images
  readonly pointPositions: Uint16Array | null;
  readonly linePositions: Uint16Array | null;
  readonly segments: Uint16Array | null; // of no line
  readonly segmentStart: Uint32Array;
  readonly groupVertices: Float32Array;
  readonly groupTriangles: Uint32Array;
  readonly groupOfLine: Int32Array; // vanishing point, -1: none
  readonly groupOfPoint: Int32Array; // first group that it is a member of, -1: none
  readonly surfaceOfLine: Int32Array;
  readonly memberPoints: Uint32Array[];
  readonly memberLines: Uint32Array[];
  readonly groupImages: Uint32Array[];
  readonly edgesOfPoint = new Map<number, number[]>();
  readonly edgesOfLine = new Map<number, number[]>();
  private seenPoints: Seen[][] | null = null;
  private seenLines: Seen[][] | null = null;

  constructor(buffer: ArrayBuffer) {
    const bundle = new Bundle(buffer);
    this.meta = bundle.meta;
    const features = (name: string, count: number) => {
      const sigma = bundle.f16(`${name}_sigma`).map((s) => s * this.meta.sigma_scale);
      return new Features(
        count, bundle.u8(`${name}_rgb`), bundle.f16(`${name}_error`), sigma,
        bundle.u32(`${name}_obs_length`), bundle.index(`${name}_obs_image`), bundle.f16(`${name}_obs_error`),
        bundle.u32(`${name}_id_steps`), bundle.u32(`${name}_id_high`),
      );
    };
    this.pointXyz = bundle.f32("point_xyz");
    this.pointOrigin = bundle.u8("point_origin");
    this.lineEnds = bundle.f32("line_ends");
    this.points = features("point", this.pointXyz.length / 3);
    this.lines = features("line", this.lineEnds.length / 6);
    this.pointCovariance = bundle.has("point_covariance") ? bundle.i16("point_covariance") : null;
    this.imageCentre = bundle.f32("image_centre");
    this.rays = bundle.f32("camera_rays");
    this.wireframe = bundle.u32("wireframe");
    this.groupVertices = bundle.f32("group_vertices");
    this.groupTriangles = bundle.u32("group_triangles");
    const positions = this.meta.has_positions;
    this.pointPositions = positions ? bundle.u16("point_obs_position") : null;
    this.linePositions = positions ? bundle.u16("line_obs_position") : null;
    this.segments = positions ? bundle.u16("image_segments") : null;
    this.segmentStart = new Uint32Array(this.meta.images.length + 1);
    if (positions) {
      const counts = bundle.u32("image_segment_count");
      counts.forEach((count, i) => (this.segmentStart[i + 1] = this.segmentStart[i] + count));
    }
    const groups = this.meta.groups;
    const split = (name: string, count: (g: GroupRecord) => number) => {
      const all = bundle.u32(name);
      let at = 0;
      return groups.map((g) => all.subarray(at, (at += count(g))));
    };
    this.memberPoints = split("group_points", (g) => g.points);
    this.memberLines = split("group_lines", (g) => g.lines);
    this.groupImages = split("group_images", (g) => g.observations);
    this.groupOfLine = new Int32Array(this.lines.count).fill(-1);
    this.surfaceOfLine = new Int32Array(this.lines.count).fill(-1);
    this.groupOfPoint = new Int32Array(this.points.count).fill(-1);
    for (let g = groups.length - 1; g >= 0; --g) {
      const ofLine = groups[g].parallelism ? this.groupOfLine : this.surfaceOfLine;
      for (const line of this.memberLines[g]) ofLine[line] = g;
      for (const point of this.memberPoints[g]) this.groupOfPoint[point] = g;
    }
    for (let e = 0; 3 * e < this.wireframe.length; ++e) {
      const [point, line] = this.wireframe.subarray(3 * e, 3 * e + 2);
      append(this.edgesOfPoint, point, e);
      append(this.edgesOfLine, line, e);
    }
  }

  point(i: number): Vec {
    return [this.pointXyz[3 * i], this.pointXyz[3 * i + 1], this.pointXyz[3 * i + 2]];
  }
  centre(image: number): Vec {
    return [this.imageCentre[3 * image], this.imageCentre[3 * image + 1], this.imageCentre[3 * image + 2]];
  }
  lineEnd(i: number, end: 0 | 1): Vec {
    const at = 6 * i + 3 * end;
    return [this.lineEnds[at], this.lineEnds[at + 1], this.lineEnds[at + 2]];
  }
  lineLength(i: number): number {
    const a = this.lineEnd(i, 0), b = this.lineEnd(i, 1);
    return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  }
  pointsSeenBy(image: number): Seen[] {
    return (this.seenPoints ??= this.invert(this.points))[image];
  }
  linesSeenBy(image: number): Seen[] {
    return (this.seenLines ??= this.invert(this.lines))[image];
  }
  private invert(features: Features): Seen[][] {
    const lists: Seen[][] = this.meta.images.map(() => []);
    for (let i = 0; i < features.count; ++i) {
      for (let k = features.start[i]; k < features.start[i + 1]; ++k)
        lists[features.obsImage[k]].push({ feature: i, observation: k });
    }
    return lists;
  }

  camera(image: number): CameraRecord {
    return this.meta.cameras[this.meta.images[image].camera];
  }
  // What was stored in 65536 steps, in pixels of the camera.
  pixel(stored: number, camera: CameraRecord): number {
    return ((stored / 65535) * 1.25 - 0.125) * Math.max(camera.width, camera.height, 1);
  }
  // Ray in the camera frame; null: it has none.
  ray(camera: CameraRecord, x: number, y: number): Vec | null {
    const { columns, rows } = camera;
    const u = (x / Math.max(camera.width, 1)) * (columns - 1), v = (y / Math.max(camera.height, 1)) * (rows - 1);
    const c = Math.min(Math.max(Math.floor(u), 0), columns - 2), r = Math.min(Math.max(Math.floor(v), 0), rows - 2);
    const sum: Vec = [0, 0, 0];
    for (const [dr, dc] of [[0, 0], [0, 1], [1, 0], [1, 1]]) {
      const at = camera.ray + 3 * ((r + dr) * columns + c + dc);
      const weight = (dc ? u - c : 1 - (u - c)) * (dr ? v - r : 1 - (v - r));
      const node = this.rays.subarray(at, at + 3);
      if (node[0] === 0 && node[1] === 0 && node[2] === 0) return null;
      for (let k = 0; k < 3; ++k) sum[k] += weight * node[k];
    }
    return sum;
  }
  // Where a place is in a photograph, 0 to 1 from its top left; null: nowhere. Newton's steps from
  // the middle, on the rays of the grid.
  project(image: number, p: Vec): [number, number] | null {
    const camera = this.camera(image);
    const X = this.toCamera(image, p);
    const size = Math.hypot(...X);
    if (!(size > 0) || (camera.planar && X[2] <= 1e-6 * size)) return null;
    const want: Vec = camera.planar ? [X[0] / X[2], X[1] / X[2], 1] : [X[0] / size, X[1] / size, X[2] / size];
    const { width, height } = camera;
    const step = 1e-3;
    let u = 0.5, v = 0.5;
    for (let round = 0; round < 12; ++round) {
      const at = this.ray(camera, u * width, v * height);
      const right = this.ray(camera, (u + step) * width, v * height), below = this.ray(camera, u * width, (v + step) * height);
      if (!at || !right || !below) return null;
      const a = [0, 1, 2].map((k) => (right[k] - at[k]) / step), b = [0, 1, 2].map((k) => (below[k] - at[k]) / step);
      const r = [0, 1, 2].map((k) => want[k] - at[k]);
      const dot = (x: number[], y: number[]) => x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
      const aa = dot(a, a), ab = dot(a, b), bb = dot(b, b), ar = dot(a, r), br = dot(b, r);
      const det = aa * bb - ab * ab;
      if (!(det > 0)) return null;
      const du = (bb * ar - ab * br) / det, dv = (aa * br - ab * ar) / det;
      u = Math.min(Math.max(u + du, -0.3), 1.3);
      v = Math.min(Math.max(v + dv, -0.3), 1.3);
      if (Math.abs(du) + Math.abs(dv) < 1e-6) return [u, v];
    }
    return null;
  }
  // A direction or offset of a camera in the world.
  toWorld(image: number, [x, y, z]: Vec): Vec {
    const [w, a, b, c] = this.meta.images[image].q; // world to camera; its inverse is applied
    const tx = 2 * (-b * z + c * y), ty = 2 * (-c * x + a * z), tz = 2 * (-a * y + b * x);
    return [x + w * tx - b * tz + c * ty, y + w * ty - c * tx + a * tz, z + w * tz - a * ty + b * tx];
  }
  toCamera(image: number, p: Vec): Vec {
    const o = this.centre(image);
    const [w, a, b, c] = this.meta.images[image].q;
    const x = p[0] - o[0], y = p[1] - o[1], z = p[2] - o[2];
    const tx = 2 * (b * z - c * y), ty = 2 * (c * x - a * z), tz = 2 * (a * y - b * x);
    return [x + w * tx + b * tz - c * ty, y + w * ty + c * tx - a * tz, z + w * tz + a * ty - b * tx];
  }
  // Where a world ray of an image is, at the depth (planar cameras) or distance `t`.
  alongRay(image: number, ray: Vec, t: number): Vec {
    const d = this.toWorld(image, ray), o = this.centre(image);
    return [o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]];
  }
}

function append(map: Map<number, number[]>, key: number, value: number): void {
  const list = map.get(key);
  if (list) list.push(value);
  else map.set(key, [value]);
}

export async function loadModel(name: string): Promise<Model | null> {
  const element = document.getElementById(`holba-${name}`);
  if (!element) return null;
  const bytes = await (await fetch(`data:application/octet-stream;base64,${element.textContent}`)).arrayBuffer();
  element.textContent = ""; // the text is as large as the model
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Model(await new Response(stream).arrayBuffer());
}

export function photographUrl(image: number): string | null {
  const element = document.getElementById(`holba-photograph-${image}`);
  return element ? `data:image/jpeg;base64,${element.textContent}` : null;
}
