// SPDX-License-Identifier: BSD-3-Clause
// What is drawn: points as discs, segments as bands of even width, surfaces. Each can be drawn with
// the numbers of its items in place of colours, for picking.
import * as THREE from "three";

// Shared by all of them.
export const shared = {
  resolution: { value: new THREE.Vector2(1, 1) }, // pixels of the target
  pixelRatio: { value: 1 },
  picking: { value: 0 },
  clipFrom: { value: new THREE.Matrix4() }, // model to the axes of the box
  clipLow: { value: new THREE.Vector3(-1e30, -1e30, -1e30) },
  clipHigh: { value: new THREE.Vector3(1e30, 1e30, 1e30) },
};

export const common = /* glsl */ `
  uniform vec2 resolution;
  uniform float pixelRatio;
  uniform mat4 clipFrom;
  uniform vec3 clipLow, clipHigh;
  bool clipped(vec3 p) {
    vec3 q = (clipFrom * vec4(p, 1.0)).xyz;
    return any(lessThan(q, clipLow)) || any(greaterThan(q, clipHigh));
  }
  vec4 numberOf(int item, int kind) {
    int n = item + 1;
    return vec4(float(n & 255), float((n >> 8) & 255), float((n >> 16) & 255), float(kind)) / 255.0;
  }
`;
const nowhere = "gl_Position = vec4(0.0, 0.0, 2.0, 1.0);";

function material(
  uniforms: Record<string, THREE.IUniform>, vertexShader: string, fragmentShader: string,
  parameters: THREE.ShaderMaterialParameters = {},
): THREE.ShaderMaterial {
  return new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    uniforms: { ...shared, ...uniforms },
    vertexShader: common + vertexShader,
    fragmentShader: "uniform int picking; out vec4 result;\n" + fragmentShader,
    ...parameters,
  });
}

function colourAttribute(count: number): THREE.BufferAttribute {
  return new THREE.BufferAttribute(new Uint8Array(4 * count), 4, true);
}

// Items in a random order, so that the first ones of any number stand for all.
export class PointCloud {
  readonly object: THREE.Points<THREE.BufferGeometry, THREE.ShaderMaterial>;
  readonly order: Uint32Array | null;
  constructor(xyz: Float32Array, kind: number, options: { shuffle?: boolean; ring?: boolean; onTop?: boolean } = {}) {
    const count = xyz.length / 3;
    this.order = options.shuffle ? permutation(count) : null;
    let positions = xyz;
    if (this.order) {
      positions = new Float32Array(xyz.length);
      for (let i = 0; i < count; ++i) {
        const from = 3 * this.order[i];
        positions[3 * i] = xyz[from];
        positions[3 * i + 1] = xyz[from + 1];
        positions[3 * i + 2] = xyz[from + 2];
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("colour", colourAttribute(count));
    this.object = new THREE.Points(
      geometry,
      material(
        { size: { value: 3 }, kind: { value: kind }, ring: { value: options.ring ? 1 : 0 } },
        /* glsl */ `
        in vec4 colour;
        uniform float size;
        uniform int kind;
        flat out vec4 vColour;
        flat out vec4 vNumber;
        flat out float vSize;
        void main() {
          vColour = colour;
          vNumber = numberOf(gl_VertexID, kind);
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
          vSize = max(size * pixelRatio, 1.0);
          gl_PointSize = vSize;
          if (colour.a < 0.5 || clipped(position)) { ${nowhere} }
        }`,
        /* glsl */ `
        flat in vec4 vColour;
        flat in vec4 vNumber;
        flat in float vSize;
        uniform int ring;
        void main() {
          float r = length(gl_PointCoord - 0.5) * 2.0;
          if (vSize > 2.5 && r > 1.0) discard;
          if (ring == 1 && r < 1.0 - 4.0 / vSize) discard;
          result = picking == 1 ? vNumber : vec4(vColour.rgb, 1.0);
        }`,
        { depthTest: !options.onTop, depthWrite: !options.onTop },
      ),
    );
    this.object.frustumCulled = false;
    if (options.onTop) this.object.renderOrder = 20;
  }
  get count(): number {
    return this.object.geometry.getAttribute("position").count;
  }
  // `colourOf` writes r, g, b, a (0: hidden) of an item.
  paint(colourOf: (item: number, out: Uint8Array, at: number) => void): void {
    const attribute = this.object.geometry.getAttribute("colour") as THREE.BufferAttribute;
    const out = attribute.array as Uint8Array;
    for (let i = 0, n = attribute.count; i < n; ++i) colourOf(this.order ? this.order[i] : i, out, 4 * i);
    attribute.needsUpdate = true;
  }
  set size(pixels: number) {
    this.object.material.uniforms.size.value = pixels;
  }
  showPart(share: number): void {
    this.object.geometry.setDrawRange(0, share >= 1 ? Infinity : Math.ceil(this.count * share));
  }
  item(drawn: number): number {
    return this.order ? this.order[drawn] : drawn;
  }
  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}

// A permutation that is the same each time.
function permutation(count: number): Uint32Array {
  const order = new Uint32Array(count);
  for (let i = 0; i < count; ++i) order[i] = i;
  let state = 0x9e3779b9;
  for (let i = count - 1; i > 0; --i) {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    const k = (state >>> 0) % (i + 1);
    const other = order[k];
    order[k] = order[i];
    order[i] = other;
  }
  return order;
}

export interface SegmentOptions {
  perItem?: number; // segments of one item, for picking
  onTop?: boolean;
  width?: number;
  dashed?: boolean;
}

export class Segments {
  readonly object: THREE.Mesh<THREE.InstancedBufferGeometry, THREE.ShaderMaterial>;
  constructor(ends: Float32Array, kind: number, options: SegmentOptions = {}) {
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute(
      "position",
      new THREE.BufferAttribute(new Float32Array([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0]), 3),
    );
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const interleaved = new THREE.InstancedInterleavedBuffer(ends, 6, 1);
    geometry.setAttribute("start", new THREE.InterleavedBufferAttribute(interleaved, 3, 0));
    geometry.setAttribute("end", new THREE.InterleavedBufferAttribute(interleaved, 3, 3));
    const count = ends.length / 6;
    geometry.setAttribute("colour", new THREE.InstancedBufferAttribute(new Uint8Array(4 * count).fill(255), 4, true));
    geometry.instanceCount = count;
    this.object = new THREE.Mesh(
      geometry,
      material(
        {
          width: { value: options.width ?? 2 }, kind: { value: kind }, perItem: { value: options.perItem ?? 1 },
          dashed: { value: options.dashed ? 1 : 0 },
        },
        /* glsl */ `
        in vec3 start, end;
        in vec4 colour;
        uniform float width;
        uniform int kind, perItem;
        out vec3 vPosition;
        out float vAlong;
        flat out vec4 vColour;
        flat out vec4 vNumber;
        void main() {
          vColour = colour;
          vNumber = numberOf(gl_InstanceID / perItem, kind);
          vec4 a = modelViewMatrix * vec4(start, 1.0), b = modelViewMatrix * vec4(end, 1.0);
          vec3 s = start, e = end;
          // In front of the near plane: what is behind a perspective camera would be mirrored.
          if (projectionMatrix[2][3] < 0.0) {
            float near = projectionMatrix[3][2] / (projectionMatrix[2][2] - 1.0);
            if (a.z > -near && b.z > -near) { ${nowhere} return; }
            if (a.z > -near) { float t = (-near - a.z) / (b.z - a.z); a = mix(a, b, t); s = mix(start, end, t); }
            else if (b.z > -near) { float t = (-near - b.z) / (a.z - b.z); b = mix(b, a, t); e = mix(end, start, t); }
          }
          vec4 p = projectionMatrix * a, q = projectionMatrix * b;
          vec2 along = (q.xy / q.w - p.xy / p.w) * resolution;
          float pixels = length(along);
          along = pixels > 1e-6 ? along / pixels : vec2(1.0, 0.0);
          vAlong = position.x * pixels * 0.5 / pixelRatio;
          vPosition = mix(s, e, position.x);
          vec4 at = mix(p, q, position.x);
          vec2 offset = (vec2(-along.y, along.x) * position.y + along * (2.0 * position.x - 1.0)) * width * pixelRatio;
          at.xy += offset / resolution * at.w;
          gl_Position = at;
          if (colour.a < 0.01) { ${nowhere} }
        }`,
        /* glsl */ `
        in vec3 vPosition;
        in float vAlong;
        flat in vec4 vColour;
        flat in vec4 vNumber;
        uniform int dashed;
        ${common}
        void main() {
          if (clipped(vPosition) || (dashed == 1 && mod(vAlong, 9.0) > 5.0)) discard;
          result = picking == 1 ? vNumber : vec4(vColour.rgb, 1.0);
        }`,
        { depthTest: !options.onTop, depthWrite: !options.onTop, side: THREE.DoubleSide },
      ),
    );
    this.object.frustumCulled = false;
    if (options.onTop) this.object.renderOrder = 15;
  }
  get count(): number {
    return this.object.geometry.instanceCount;
  }
  paint(colourOf: (segment: number, out: Uint8Array, at: number) => void): void {
    const attribute = this.object.geometry.getAttribute("colour") as THREE.InstancedBufferAttribute;
    for (let i = 0; i < attribute.count; ++i) colourOf(i, attribute.array as Uint8Array, 4 * i);
    attribute.needsUpdate = true;
  }
  set width(pixels: number) {
    this.object.material.uniforms.width.value = pixels;
  }
  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}

// Translucent, shaded a little so that their shape is seen.
export class Surfaces {
  readonly object: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  constructor(vertices: Float32Array, triangles: Uint32Array, private itemOfVertex: Uint32Array, kind: number) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(vertices, 3));
    geometry.setAttribute("colour", colourAttribute(vertices.length / 3));
    geometry.setAttribute("item", new THREE.BufferAttribute(Float32Array.from(itemOfVertex), 1));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    this.object = new THREE.Mesh(
      geometry,
      material(
        { opacity: { value: 0.22 }, kind: { value: kind } },
        /* glsl */ `
        in vec4 colour;
        in float item;
        uniform int kind;
        out vec3 vPosition;
        out vec3 vInView;
        flat out vec4 vColour;
        flat out vec4 vNumber;
        void main() {
          vColour = colour;
          vNumber = numberOf(int(item + 0.5), kind);
          vPosition = position;
          vInView = (modelViewMatrix * vec4(position, 1.0)).xyz;
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        }`,
        /* glsl */ `
        in vec3 vPosition;
        in vec3 vInView;
        flat in vec4 vColour;
        flat in vec4 vNumber;
        uniform float opacity;
        ${common}
        void main() {
          if (vColour.a < 0.5 || clipped(vPosition)) discard;
          vec3 n = normalize(cross(dFdx(vInView), dFdy(vInView)));
          float light = 0.75 + 0.25 * abs(n.z);
          result = picking == 1 ? vNumber : vec4(vColour.rgb * light, opacity);
        }`,
        { transparent: true, depthWrite: false, side: THREE.DoubleSide },
      ),
    );
    this.object.frustumCulled = false;
    this.object.renderOrder = 5;
  }
  paint(colourOf: (item: number, out: Uint8Array, at: number) => void): void {
    const attribute = this.object.geometry.getAttribute("colour") as THREE.BufferAttribute;
    for (let i = 0; i < attribute.count; ++i) colourOf(this.itemOfVertex[i], attribute.array as Uint8Array, 4 * i);
    attribute.needsUpdate = true;
  }
  set opacity(value: number) {
    this.object.material.uniforms.opacity.value = value;
  }
}
