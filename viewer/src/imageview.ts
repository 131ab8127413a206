// SPDX-License-Identifier: BSD-3-Clause
// What one image sees: its photograph as a surface of rays, so that it lies under the model whatever
// its lens, and what was observed in it beside what the model projects to.
import * as THREE from "three";
import { photographUrl } from "./model";
import type { ModelView } from "./modelview";
import type { Rgb } from "./palette";
import { PointCloud, Segments } from "./shaders";
import type { Stage } from "./stage";

export interface ImageLayers {
  photograph: number; // opacity
  keypoints: boolean;
  segments: boolean;
  unused: boolean; // segments that no line was made of
  residuals: number; // times as long as they are; 0: not drawn
  onlySeen: boolean;
  surfaces: boolean;
}

export class ImageView {
  image = -1;
  private group = new THREE.Group();
  private photograph: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial> | null = null;
  private drawn: (PointCloud | Segments)[] = [];

  constructor(private stage: Stage, private view: ModelView) {
    stage.upright.add(this.group);
    this.group.userData.unpickable = true;
  }

  show(image: number, layers: ImageLayers, colourOfLine: (line: number) => Rgb): void {
    this.clear();
    this.image = image;
    this.view.restrictTo(null, null);
    if (layers.onlySeen) {
      const { model } = this.view;
      this.view.restrictTo(
        new Set(model.pointsSeenBy(image).map((s) => s.feature)), new Set(model.linesSeenBy(image).map((s) => s.feature)),
      );
    }
    this.addPhotograph(image, layers.photograph);
    this.addPoints(image, layers);
    this.addSegments(image, layers, colourOfLine);
    this.stage.draw();
  }
  hide(): void {
    this.clear();
    this.image = -1;
    this.view.restrictTo(null, null);
    this.stage.draw();
  }
  private clear(): void {
    for (const drawn of this.drawn) drawn.dispose();
    this.drawn = [];
    this.photograph?.geometry.dispose();
    this.photograph = null;
    this.group.clear();
  }
  set opacity(value: number) {
    if (this.photograph) this.photograph.material.uniforms.opacity.value = value;
    this.stage.draw();
  }

  private addPhotograph(image: number, opacity: number): void {
    const url = photographUrl(image);
    if (!url) return;
    const { model } = this.view;
    const camera = model.camera(image);
    const positions: number[] = [], uvs: number[] = [], triangles: number[] = [];
    const usable: boolean[] = [];
    for (let r = 0; r < camera.rows; ++r) {
      for (let c = 0; c < camera.columns; ++c) {
        const at = camera.ray + 3 * (r * camera.columns + c);
        const ray = [...model.rays.subarray(at, at + 3)] as [number, number, number];
        usable.push(ray[2] > 0.02);
        positions.push(...model.alongRay(image, ray, this.view.radius));
        uvs.push(c / (camera.columns - 1), 1 - r / (camera.rows - 1));
      }
    }
    for (let r = 0; r + 1 < camera.rows; ++r) {
      for (let c = 0; c + 1 < camera.columns; ++c) {
        const a = r * camera.columns + c, b = a + 1, d = a + camera.columns, e = d + 1;
        if (usable[a] && usable[b] && usable[d] && usable[e]) triangles.push(a, d, e, a, e, b);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute(uvs, 2));
    geometry.setIndex(triangles);
    const texture = new THREE.TextureLoader().load(url, () => this.stage.draw());
    texture.generateMipmaps = false;
    texture.minFilter = THREE.LinearFilter;
    const material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      uniforms: { map: { value: texture }, opacity: { value: opacity } },
      vertexShader: "out vec2 at; void main() { at = uv; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
      fragmentShader: "in vec2 at; uniform sampler2D map; uniform float opacity; out vec4 result; void main() { result = vec4(texture(map, at).rgb, opacity); }",
      // Not among what is transparent, as that is drawn after all else.
      blending: THREE.CustomBlending, depthTest: false, depthWrite: false, side: THREE.DoubleSide,
    });
    this.photograph = new THREE.Mesh(geometry, material);
    this.photograph.frustumCulled = false;
    this.photograph.renderOrder = -10;
    this.group.add(this.photograph);
  }

  // Where a pixel is at the depth of a point, so that the way between them is what is seen.
  private lifted(image: number, x: number, y: number, point: [number, number, number] | null): [number, number, number] | null {
    const { model } = this.view;
    const camera = model.camera(image);
    const ray = model.ray(camera, x, y);
    if (!ray) return null;
    if (!point) return model.alongRay(image, ray, this.view.radius / Math.hypot(...ray));
    const inCamera = model.toCamera(image, point);
    const t = ray[2] > 0.1 ? inCamera[2] / ray[2] : Math.hypot(...inCamera) / Math.hypot(...ray);
    return model.alongRay(image, ray, t);
  }

  private add(drawn: PointCloud | Segments): void {
    this.drawn.push(drawn);
    this.group.add(drawn.object);
  }

  private addPoints(image: number, layers: ImageLayers): void {
    const { model } = this.view;
    const positions = model.pointPositions;
    if (!positions || !(layers.keypoints || layers.residuals)) return;
    const camera = model.camera(image);
    const rings: number[] = [], ways: number[] = [];
    for (const { feature, observation } of model.pointsSeenBy(image)) {
      const X = model.point(feature);
      const at = this.lifted(
        image, model.pixel(positions[2 * observation], camera), model.pixel(positions[2 * observation + 1], camera), X,
      );
      if (!at) continue;
      rings.push(...at);
      const times = layers.residuals || 1;
      ways.push(...at, ...([0, 1, 2].map((k) => at[k] + times * (X[k] - at[k])) as [number, number, number]));
    }
    if (layers.residuals) {
      const segments = new Segments(new Float32Array(ways), 0, { onTop: true, width: 1.5 });
      segments.paint((_, out, at) => out.set([255, 80, 60, 255], at));
      this.add(segments);
    }
    if (layers.keypoints) {
      const cloud = new PointCloud(new Float32Array(rings), 0, { ring: true, onTop: true });
      cloud.size = 7;
      cloud.paint((_, out, at) => out.set([255, 230, 60, 255], at));
      this.add(cloud);
    }
  }

  private addSegments(image: number, layers: ImageLayers, colourOfLine: (line: number) => Rgb): void {
    const { model } = this.view;
    const camera = model.camera(image);
    const put = (positions: Uint16Array, first: number, ends: number[]): boolean => {
      const [x1, y1, x2, y2] = positions.subarray(first, first + 4);
      const a = this.lifted(image, model.pixel(x1, camera), model.pixel(y1, camera), null);
      const b = this.lifted(image, model.pixel(x2, camera), model.pixel(y2, camera), null);
      if (!a || !b) return false;
      ends.push(...a, ...b);
      return true;
    };
    if (layers.unused && model.segments) {
      const ends: number[] = [];
      for (let s = model.segmentStart[image]; s < model.segmentStart[image + 1]; ++s) put(model.segments, 4 * s, ends);
      const segments = new Segments(new Float32Array(ends), 0, { onTop: true, width: 1 });
      segments.paint((_, out, at) => out.set([150, 150, 150, 255], at));
      this.add(segments);
    }
    if (layers.segments && model.linePositions) {
      const ends: number[] = [], lines: number[] = [];
      for (const { feature, observation } of model.linesSeenBy(image))
        if (put(model.linePositions, 4 * observation, ends)) lines.push(feature);
      const edge = new Segments(new Float32Array(ends), 0, { onTop: true, width: 5 });
      edge.paint((_, out, at) => out.set([255, 255, 255, 255], at));
      this.add(edge);
      const segments = new Segments(new Float32Array(ends), 0, { onTop: true, width: 2.5 });
      segments.paint((s, out, at) => out.set([...colourOfLine(lines[s]), 255], at));
      this.add(segments);
    }
  }
}
