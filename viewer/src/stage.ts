// SPDX-License-Identifier: BSD-3-Clause
// The canvas: cameras, what moves them, drawing when something has changed, picking.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { Kind, type KindName, type ModelView, secondModel } from "./modelview";
import { shared } from "./shaders";

export interface Pick {
  kind: KindName;
  index: number;
  second: boolean;
}
export type Split = "both" | "first" | "second" | "side";

THREE.ColorManagement.enabled = false;

// Pixels around the pointer in which something is found.
const reach = 8;
const kinds = Object.keys(Kind) as KindName[];

export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  // Turns models: right is +x, up is +y.
  readonly upright = new THREE.Group();
  readonly perspective = new THREE.PerspectiveCamera(50, 1, 0.01, 1000);
  readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, -1000, 1000);
  // Where an image was taken, as it sees.
  readonly imageCamera = new THREE.PerspectiveCamera(50, 1, 0.01, 1000);
  controls: OrbitControls;
  imageMode = false;
  split: Split = "both";
  onFrame: (() => void) | null = null;
  onMoved: (() => void) | null = null;
  lastFrameMs = 0;
  private pan = { x: 0, y: 0, zoom: 1 };
  private wanted = false;
  private moving = 0;
  private share = 1; // of points, while it moves
  private target = new THREE.WebGLRenderTarget(2 * reach + 1, 2 * reach + 1);
  private ortho = false;

  constructor(readonly canvas: HTMLCanvasElement, readonly views: ModelView[]) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    const { down, right } = views[0].model.meta;
    const up = new THREE.Vector3(...down).negate().normalize();
    const x = new THREE.Vector3(...right);
    x.addScaledVector(up, -x.dot(up)).normalize();
    const basis = new THREE.Matrix4().makeBasis(x, up, x.clone().cross(up)); // columns in the model
    this.upright.quaternion.setFromRotationMatrix(basis).invert();
    this.upright.updateMatrixWorld(true);
    shared.clipFrom.value.makeRotationFromQuaternion(this.upright.quaternion);
    for (const view of views) this.upright.add(view.root);
    this.scene.add(this.upright);
    this.controls = this.makeControls(this.perspective);
    this.fit();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.resize();
    this.followImagePointer();
  }

  get radius(): number {
    return this.views[0].radius;
  }
  get camera(): THREE.PerspectiveCamera | THREE.OrthographicCamera {
    return this.imageMode ? this.imageCamera : this.ortho ? this.orthographic : this.perspective;
  }
  get isOrthographic(): boolean {
    return this.ortho;
  }
  toScene(p: THREE.Vector3 | [number, number, number]): THREE.Vector3 {
    const v = Array.isArray(p) ? new THREE.Vector3(...p) : p.clone();
    return v.applyQuaternion(this.upright.quaternion);
  }
  toModel(p: THREE.Vector3): THREE.Vector3 {
    return p.clone().applyQuaternion(this.upright.quaternion.clone().invert());
  }

  private makeControls(camera: THREE.Camera): OrbitControls {
    const controls = new OrbitControls(camera, this.canvas);
    controls.enableDamping = false;
    controls.zoomToCursor = true;
    controls.screenSpacePanning = true;
    controls.zoomSpeed = 1.4;
    controls.addEventListener("start", () => this.moves(true));
    controls.addEventListener("end", () => this.moves(false));
    controls.addEventListener("change", () => {
      this.touched();
      this.onMoved?.();
    });
    return controls;
  }
  private moves(starts: boolean): void {
    this.moving = starts ? Infinity : performance.now() + 150;
    this.draw();
  }
  private touched(): void {
    if (this.moving !== Infinity) this.moving = performance.now() + 200;
    this.draw();
  }

  fit(direction?: THREE.Vector3): void {
    const middle = this.toScene(this.views[0].middle);
    const from = direction ?? this.fromTheCameras(middle);
    const distance = (1.15 * this.radius) / Math.sin(THREE.MathUtils.degToRad(this.perspective.fov / 2));
    this.look(middle.clone().addScaledVector(from, distance), middle);
    this.orthographic.zoom = 1;
    this.resize();
  }
  // As those who took the photographs saw it, a little aside and from above.
  private fromTheCameras(middle: THREE.Vector3): THREE.Vector3 {
    const { model } = this.views[0];
    const sum = new THREE.Vector3();
    model.meta.images.forEach((_, i) => {
      const ahead = this.toScene(model.toWorld(i, [0, 0, 1]));
      sum.sub(ahead);
    });
    sum.y = 0;
    if (sum.length() < 0.2 * model.meta.images.length) {
      // They look all around: from where most of them stand.
      sum.set(0, 0, 0);
      model.meta.images.forEach((_, i) => sum.add(this.toScene(model.centre(i)).sub(middle).divideScalar(this.radius)));
      sum.y = 0;
    }
    if (!(sum.length() > 1e-3 * Math.max(model.meta.images.length, 1))) sum.set(0, 0, 1);
    return sum.normalize().applyAxisAngle(new THREE.Vector3(0, 1, 0), 0.45).setY(0.42).normalize();
  }
  look(position: THREE.Vector3, target: THREE.Vector3): void {
    for (const camera of [this.perspective, this.orthographic]) {
      camera.position.copy(position);
      camera.lookAt(target);
    }
    this.controls.target.copy(target);
    this.controls.update();
    this.touched();
    this.onMoved?.();
  }
  // Keeps the size of what is at the target.
  setOrthographic(on: boolean): void {
    if (on === this.ortho) return;
    const from = this.camera as THREE.PerspectiveCamera | THREE.OrthographicCamera;
    const target = this.controls.target.clone();
    const slope = Math.tan(THREE.MathUtils.degToRad(this.perspective.fov / 2));
    this.ortho = on;
    if (on) {
      this.orthographic.position.copy(from.position);
      this.orthographic.quaternion.copy(from.quaternion);
      const height = from.position.distanceTo(target) * slope;
      this.orthographic.zoom = this.orthographic.top / Math.max(height, 1e-12);
    } else {
      const height = this.orthographic.top / this.orthographic.zoom;
      const direction = from.position.clone().sub(target).normalize();
      this.perspective.position.copy(target).addScaledVector(direction, height / slope);
      this.perspective.quaternion.copy(from.quaternion);
    }
    this.controls.dispose();
    this.controls = this.makeControls(this.camera);
    this.controls.target.copy(target);
    this.controls.update();
    this.resize();
    this.onMoved?.();
  }

  resize(): void {
    const parent = this.canvas.parentElement!;
    const width = Math.max(parent.clientWidth, 1), height = Math.max(parent.clientHeight, 1);
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    const aspect = (this.split === "side" && !this.imageMode ? 0.5 : 1) * (width / height);
    this.perspective.aspect = aspect;
    const half = 1.15 * this.radius;
    this.orthographic.left = -half * aspect;
    this.orthographic.right = half * aspect;
    this.orthographic.top = half;
    this.orthographic.bottom = -half;
    this.orthographic.updateProjectionMatrix();
    this.perspective.updateProjectionMatrix();
    if (this.imageMode) this.frameImage();
    this.draw();
  }

  // --- Standing where an image was taken.
  private imageFov = { x: 1, y: 1 }; // tangents of half the angles
  enterImage(view: ModelView, image: number): void {
    const { model } = view;
    const camera = model.camera(image);
    let x = 1e-3, y = 1e-3;
    for (let k = 0; k < camera.columns * camera.rows; ++k) {
      const [a, b, c] = model.rays.subarray(camera.ray + 3 * k, camera.ray + 3 * k + 3);
      if (c < 0.3) continue;
      x = Math.max(x, Math.abs(a / c));
      y = Math.max(y, Math.abs(b / c));
    }
    this.imageFov = { x: Math.min(x, 2.2), y: Math.min(y, 2.2) };
    const [w, qx, qy, qz] = model.meta.images[image].q;
    // Of COLMAP's camera (y down, looks along +z) to that of the scene.
    const worldFromCamera = new THREE.Quaternion(qx, qy, qz, w).invert();
    this.imageCamera.position.copy(this.toScene(model.centre(image)));
    this.imageCamera.quaternion.copy(this.upright.quaternion).multiply(worldFromCamera).multiply(new THREE.Quaternion(1, 0, 0, 0));
    this.imageMode = true;
    this.controls.enabled = false;
    this.pan = { x: 0, y: 0, zoom: 1 };
    this.resize();
  }
  leaveImage(): void {
    if (!this.imageMode) return;
    this.imageMode = false;
    this.controls.enabled = true;
    // Goes on from behind the camera.
    this.resize();
    this.onMoved?.();
  }
  private frameImage(): void {
    const width = this.canvas.clientWidth || 1, height = this.canvas.clientHeight || 1;
    const aspect = width / height;
    const slope = Math.max(this.imageFov.y, this.imageFov.x / aspect) * 1.06;
    const c = this.imageCamera;
    c.aspect = aspect;
    c.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(slope));
    c.near = this.radius * 1e-3;
    c.far = this.radius * 1e3;
    c.zoom = this.pan.zoom;
    c.setViewOffset(width, height, this.pan.x, this.pan.y, width, height);
    c.updateProjectionMatrix();
  }
  zoomImage(factor: number, x: number, y: number): void {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    const zoom = Math.min(Math.max(this.pan.zoom * factor, 0.5), 60);
    const f = zoom / this.pan.zoom;
    // What is under the pointer stays there.
    this.pan.x = (this.pan.x + x - width / 2) * f - (x - width / 2);
    this.pan.y = (this.pan.y + y - height / 2) * f - (y - height / 2);
    this.pan.zoom = zoom;
    this.frameImage();
    this.draw();
  }
  private followImagePointer(): void {
    const down = new Map<number, { x: number; y: number }>();
    this.canvas.addEventListener("pointerdown", (e) => {
      if (this.imageMode) down.set(e.pointerId, { x: e.clientX, y: e.clientY });
    });
    window.addEventListener("pointermove", (e) => {
      const last = down.get(e.pointerId);
      if (!last || !this.imageMode) return;
      if (down.size === 2) {
        const other = [...down].find(([id]) => id !== e.pointerId)![1];
        const before = Math.hypot(last.x - other.x, last.y - other.y);
        const after = Math.hypot(e.clientX - other.x, e.clientY - other.y);
        const box = this.canvas.getBoundingClientRect();
        this.zoomImage(after / Math.max(before, 1), (e.clientX + other.x) / 2 - box.left, (e.clientY + other.y) / 2 - box.top);
      } else {
        this.pan.x -= e.clientX - last.x;
        this.pan.y -= e.clientY - last.y;
        this.frameImage();
        this.draw();
      }
      down.set(e.pointerId, { x: e.clientX, y: e.clientY });
    });
    const up = (e: PointerEvent) => down.delete(e.pointerId);
    window.addEventListener("pointerup", up);
    window.addEventListener("pointercancel", up);
    this.canvas.addEventListener("wheel", (e) => {
      if (!this.imageMode) return;
      e.preventDefault();
      const box = this.canvas.getBoundingClientRect();
      this.zoomImage(Math.exp(-e.deltaY * 0.0015), e.clientX - box.left, e.clientY - box.top);
    }, { passive: false });
  }

  // --- Drawing.
  draw(): void {
    if (this.wanted) return;
    this.wanted = true;
    requestAnimationFrame(() => {
      this.wanted = false;
      this.render();
      this.onFrame?.();
    });
  }
  private setDepths(): void {
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.perspective.near = Math.max(distance * 2e-3, this.radius * 1e-5);
    this.perspective.far = distance + this.radius * 200;
    this.perspective.updateProjectionMatrix();
    this.orthographic.near = -this.radius * 100;
    this.orthographic.far = distance + this.radius * 100;
    this.orthographic.updateProjectionMatrix();
  }
  render(): void {
    const begin = performance.now();
    const isMoving = begin < this.moving;
    this.setDepths();
    const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    shared.pixelRatio.value = this.renderer.getPixelRatio();
    shared.picking.value = 0;
    for (const view of this.views) view.points.showPart(isMoving ? this.share : 1);
    this.renderer.setRenderTarget(null);
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    this.renderer.setScissorTest(false);
    this.renderer.setViewport(0, 0, width, height);
    this.renderer.clear();
    const two = this.views.length > 1;
    if (two && this.split === "side" && !this.imageMode) {
      this.renderer.setScissorTest(true);
      this.views.forEach((view, side) => {
        this.views.forEach((other) => (other.root.visible = other === view));
        const left = side * Math.floor(width / 2);
        this.renderer.setViewport(left, 0, width / 2, height);
        this.renderer.setScissor(left, 0, width / 2, height);
        shared.resolution.value.set(size.x / 2, size.y);
        this.renderer.render(this.scene, this.camera);
      });
      this.renderer.setScissorTest(false);
    } else {
      this.views.forEach((view, i) => (view.root.visible = !two || this.split === "both" || (this.split === "second") === (i === 1) || (this.split === "side" && i === 0)));
      shared.resolution.value.copy(size);
      this.renderer.render(this.scene, this.camera);
    }
    if (this.waitForGpu) this.renderer.getContext().finish();
    this.lastFrameMs = performance.now() - begin;
    if (isMoving) {
      this.adapt();
      if (this.moving !== Infinity) setTimeout(() => this.draw(), Math.max(this.moving - performance.now(), 0) + 5);
    }
  }
  // While it moves, as many points as 30 frames a second allow: by the time between two frames,
  // which holds what the graphics processor takes.
  private lastBegin = 0;
  waitForGpu = false;
  private adapt(): void {
    const now = performance.now();
    const between = now - this.lastBegin;
    this.lastBegin = now;
    if (between > 500) return;
    if (between > 40) this.share = Math.max(0.02, this.share * 0.7);
    else if (between < 22) this.share = Math.min(1, this.share * 1.15);
  }

  // --- Picking, at a place of the canvas in its pixels.
  pick(x: number, y: number): Pick | null {
    const size = 2 * reach + 1;
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    const side = this.split === "side" && this.views.length > 1 && !this.imageMode;
    const half = Math.floor(width / 2);
    const fullWidth = side ? width / 2 : width;
    const localX = side && x >= half ? x - half : x;
    if (side) this.views.forEach((view, i) => (view.root.visible = (i === 1) === x >= half));
    const camera = this.camera.clone() as THREE.PerspectiveCamera;
    const [panX, panY] = this.imageMode ? [this.pan.x, this.pan.y] : [0, 0];
    camera.setViewOffset(fullWidth, height, panX + localX - reach, panY + y - reach, size, size);
    camera.updateProjectionMatrix();
    shared.picking.value = 1;
    shared.pixelRatio.value = 1;
    shared.resolution.value.set(size, size);
    const hidden: [THREE.Object3D, boolean][] = [];
    const hide = (object: THREE.Object3D) => {
      hidden.push([object, object.visible]);
      object.visible = false;
    };
    this.scene.traverse((object) => {
      if (object.userData.unpickable) hide(object);
    });
    for (const view of this.views) {
      for (const object of [view.photographs, view.junctions.object, view.edges.object, view.relations.object, view.directions.object]) hide(object);
    }
    for (const view of this.views) hide(view.outlines.object);
    const surfaces = this.views.map((view) => view.surfaces.object);
    const shown = surfaces.map((object) => object.visible);
    surfaces.forEach((object) => (object.visible = false));
    let found = this.readPick(camera, size);
    if (!found && shown.some(Boolean)) {
      surfaces.forEach((object, i) => (object.visible = shown[i]));
      for (const view of this.views) view.surfaces.object.material.blending = THREE.NoBlending;
      for (const view of this.views) for (const object of [view.points.object, view.lines.object, view.cameras.object]) hide(object);
      found = this.readPick(camera, size);
      for (const view of this.views) view.surfaces.object.material.blending = THREE.NormalBlending;
    }
    surfaces.forEach((object, i) => (object.visible = shown[i]));
    for (const [object, visible] of hidden.reverse()) object.visible = visible;
    shared.picking.value = 0;
    this.draw();
    return found;
  }
  private readPick(camera: THREE.Camera, size: number): Pick | null {
    this.renderer.setRenderTarget(this.target);
    const before = this.renderer.getClearAlpha();
    const colour = this.renderer.getClearColor(new THREE.Color());
    this.renderer.setClearColor(0x000000, 0);
    this.renderer.clear();
    this.renderer.render(this.scene, camera);
    const pixels = new Uint8Array(4 * size * size);
    this.renderer.readRenderTargetPixels(this.target, 0, 0, size, size, pixels);
    this.renderer.setRenderTarget(null);
    this.renderer.setClearColor(colour, before);
    let best = Infinity, at = -1;
    for (let k = 0; k < size * size; ++k) {
      if (pixels[4 * k + 3] === 0) continue;
      const distance = Math.hypot((k % size) - reach, Math.floor(k / size) - reach);
      if (distance < best) [best, at] = [distance, k];
    }
    if (at < 0) return null;
    const kind = pixels[4 * at + 3];
    const second = kind >= secondModel;
    const name = kinds.find((k) => Kind[k] === kind - (second ? secondModel : 0));
    const number = pixels[4 * at] + 256 * pixels[4 * at + 1] + 65536 * pixels[4 * at + 2] - 1;
    const view = this.views[second ? 1 : 0];
    if (!name || number < 0 || !view) return null;
    let index = number;
    if (name === "point") index = view.points.item(number);
    return { kind: name, index, second };
  }
  // The place of a pointer on a line of the scene: the point of it nearest to the pointer's ray.
  nearestOnLine(a: THREE.Vector3, b: THREE.Vector3, x: number, y: number): THREE.Vector3 {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / this.canvas.clientWidth - 1, 1 - (2 * y) / this.canvas.clientHeight), this.camera as THREE.Camera);
    const result = new THREE.Vector3();
    ray.ray.distanceSqToSegment(a, b, undefined, result);
    return result;
  }
  project(p: THREE.Vector3): { x: number; y: number; visible: boolean } {
    this.camera.updateMatrixWorld(); // it may have moved since the last frame
    const q = p.clone().project(this.camera as THREE.Camera);
    return { x: ((q.x + 1) / 2) * this.canvas.clientWidth, y: ((1 - q.y) / 2) * this.canvas.clientHeight, visible: q.z > -1 && q.z < 1 };
  }
}
