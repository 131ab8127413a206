// SPDX-License-Identifier: BSD-3-Clause
// What the page is doing: the state, and the verbs that keys, buttons and tests call.
import * as THREE from "three";
import { button, el, fill, slider, toggle } from "./dom";
import { ImageView, type ImageLayers } from "./imageview";
import { covarianceAxes, describe, infoPanel } from "./info";
import { Measure } from "./measure";
import { type Model, photographUrl } from "./model";
import { type Layer, layers, ModelView, type Settings } from "./modelview";
import type { Rgb } from "./palette";
import { buildPanel, helpDialog } from "./panel";
import { fillReport } from "./report";
import { PointCloud, Segments, shared } from "./shaders";
import { ScaleBar } from "./scalebar";
import { type Pick, type Split, Stage } from "./stage";

const themes = {
  dark: { back: 0x14171c, line: [205, 213, 224] as Rgb, dim: [120, 132, 150] as Rgb, camera: [150, 165, 190] as Rgb },
  light: { back: 0xf4f6f8, line: [70, 82, 98] as Rgb, dim: [125, 136, 150] as Rgb, camera: [60, 72, 92] as Rgb },
};
const secondTint: Rgb = [240, 178, 30];
const highlight: Rgb = [255, 60, 120];

export class App {
  readonly views: ModelView[];
  readonly stage: Stage;
  readonly settings: Settings;
  readonly imageLayers: ImageLayers = { photograph: 1, keypoints: true, segments: true, unused: false, residuals: 1, onlySeen: true, surfaces: false };
  readonly clip = { on: false, range: [[0, 1], [0, 1], [0, 1]] as [number, number][] };
  readonly photographCount: number;
  readonly measure: Measure;
  readonly imageView: ImageView;
  selection: Pick | null = null;
  currentImage = -1; // that is stood in
  theme: "dark" | "light";
  private left = el("aside", { class: "left" });
  private right = el("aside", { class: "right", hidden: true });
  private imageBar = el("div", { class: "badge", id: "imagebar", hidden: true });
  private strip = el("div", { class: "badge", id: "strip", hidden: true });
  private status = el("div", { class: "badge", id: "status" });
  private tip = el("div", { class: "badge", id: "tip", hidden: true });
  private sideNames = el("div", { id: "side-names", hidden: true });
  private report = el("div", { id: "report", hidden: true });
  private scaleBar = new ScaleBar();
  private stageElement: HTMLElement;
  private canvas = el("canvas", { tabindex: "0", "aria-label": "The model in three dimensions" });
  private help = helpDialog();
  private search = el("input", { type: "search", placeholder: "Id or image name   /", "aria-label": "Search", list: "image-names" });
  private buttons: Record<string, HTMLButtonElement> = {};
  private marked = new THREE.Group();

  constructor(root: HTMLElement, model: Model, second: Model | null) {
    this.views = [new ModelView(model, false, null)];
    if (second) this.views.push(new ModelView(second, true, secondTint));
    this.theme = matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
    const many = model.points.count;
    this.photographCount = model.meta.images.filter((_, i) => document.getElementById(`holba-photograph-${i}`)).length;
    this.settings = {
      layers: Object.fromEntries(layers.map((l) => [l, l !== "relations" && l !== "textures" && l !== "photographs" && l !== "wireframe" && l !== "directions"])) as Record<Layer, boolean>,
      pointColour: "colour", lineColour: model.meta.groups.some((g) => g.parallelism) ? "direction" : "plain",
      pointSize: many > 300000 ? 1.5 : many > 20000 ? 2 : 3, lineWidth: 2,
      cameraSize: model.meta.images.length > 300 ? 0.03 : 0.07, opacity: 0.2, minTrack: 0, maxError: Infinity,
    };
    this.stageElement = el("div", { class: "stage" }, this.canvas, this.sideNames, this.status, this.strip, this.imageBar, this.tip);
    const measurePanel = el("div", { class: "badge", id: "measure" });
    this.stageElement.append(measurePanel, this.scaleBar.element, this.report);
    root.replaceChildren(this.header(), this.left, this.stageElement, this.right, this.help);
    if (window.innerWidth < 760) this.left.hidden = true;
    this.stage = new Stage(this.canvas, this.views);
    this.measure = new Measure(this.stage, measurePanel, () => this.updateButtons());
    this.imageView = new ImageView(this.stage, this.view);
    this.marked.userData.unpickable = true;
    this.stage.upright.add(this.marked);
    this.setCameraSize(this.settings.cameraSize, false);
    this.setTheme(this.theme);
    this.listen();
    this.stage.onMoved = () => this.saveAddress();
    this.stage.onFrame = () => this.showStatus();
    if (this.photographCount > 0 && this.photographCount <= 60) this.setLayer("photographs", true);
    this.restoreAddress();
  }
  get view(): ModelView {
    return this.views[0];
  }

  private header(): HTMLElement {
    const { meta } = this.view.model;
    const make = (name: string, text: string, title: string, pressed: () => void) => (this.buttons[name] = button(text, title, pressed, { id: `button-${name}` }));
    const names = el("datalist", { id: "image-names" });
    for (const image of meta.images.slice(0, 5000)) names.append(el("option", { value: image.name }));
    this.search.addEventListener("change", () => this.find(this.search.value));
    document.title = `${meta.title} - holba`;
    return el("header", {},
      button("\u2630", "Show or hide the panels (H)", () => this.togglePanels(), { "aria-label": "Panels" }),
      el("span", { class: "mark" }, el("b", {}, "hol"), "ba"), el("span", { class: "title" }, meta.title),
      this.search, names,
      el("span", { class: "group" },
        make("fit", "All", "See all (F)", () => this.stage.fit()), make("front", "Front", "Along a vanishing direction (1)", () => this.along("front")),
        make("side", "Side", "Along a vanishing direction (3)", () => this.along("side")), make("plan", "Plan", "From above (7)", () => this.along("plan")),
        make("ortho", "Ortho", "Perspective or orthographic (O)", () => this.toggleOrthographic())),
      el("span", { class: "group" },
        make("measure", "Measure", "Lengths and angles (M)", () => this.measure.toggle()), make("clip", "Clip", "Clipping box (B)", () => this.setClip(!this.clip.on)),
        make("picture", "Picture", "Save a picture (G)", () => this.savePicture())),
      el("span", { class: "group" },
        make("report", "Report", "Numbers and report (R)", () => this.toggleReport()), make("theme", "\u25d0", "Dark or light", () => this.setTheme(this.theme === "dark" ? "light" : "dark")),
        make("help", "?", "Keys (?)", () => this.help.showModal())));
  }
  private updateButtons(): void {
    const on = (name: string, value: boolean) => {
      this.buttons[name].classList.toggle("on", value);
      this.buttons[name].setAttribute("aria-pressed", String(value));
    };
    on("ortho", this.stage.isOrthographic);
    on("measure", this.measure.active);
    on("clip", this.clip.on);
    on("report", !this.report.hidden);
    this.stageElement.classList.toggle("measuring", this.measure.active);
  }

  // --- What is shown.
  refresh(rebuild = true): void {
    for (const view of this.views) view.apply(this.settings, themes[this.theme]);
    if (this.stage.imageMode) {
      const { view } = this;
      view.cameras.object.visible = view.photographs.visible = false;
      if (!this.imageLayers.surfaces) view.surfaces.object.visible = view.outlines.object.visible = false;
    }
    if (rebuild) this.rebuildPanel();
    this.stage.draw();
  }
  private rebuildPanel(): void {
    // A control that is being used stays: its replacement would not have the pointer.
    const active = document.activeElement as HTMLElement | null;
    const id = active && this.left.contains(active) ? active.id : "";
    const dragging = active instanceof HTMLInputElement && active.type === "range" && this.left.contains(active);
    if (dragging) return;
    const top = this.left.scrollTop;
    const open = [...this.left.querySelectorAll("details")].map((d) => d.open);
    this.left.replaceChildren(...buildPanel(this));
    const details = [...this.left.querySelectorAll("details")];
    if (open.length === details.length) details.forEach((d, k) => (d.open = open[k] || (d.id === "clip" && this.clip.on)));
    this.left.scrollTop = top;
    if (id) document.getElementById(id)?.focus();
    this.updateButtons();
  }
  setLayer(layer: Layer, on: boolean): void {
    this.settings.layers[layer] = on;
    if (layer === "photographs" && on) this.view.loadPhotographs(this.settings.cameraSize, () => this.stage.draw());
    if (layer === "textures" && on) this.view.loadTextures(() => this.stage.draw());
    this.refresh();
  }
  setCameraSize(size: number, draw = true): void {
    this.settings.cameraSize = size;
    for (const view of this.views) view.setCameraSize(size);
    if (draw) this.refresh();
  }
  setTheme(theme: "dark" | "light"): void {
    this.theme = theme;
    document.documentElement.dataset.theme = theme;
    this.stage.renderer.setClearColor(themes[theme].back, 1);
    this.refresh();
  }
  setSplit(split: Split): void {
    this.stage.split = split;
    this.sideNames.hidden = split !== "side" || this.stage.imageMode;
    this.sideNames.replaceChildren(...this.views.map((v) => el("span", {}, v.model.meta.title)));
    this.stage.resize();
    this.refresh();
  }
  setTint(on: boolean): void {
    this.views[1].tint = on ? secondTint : null;
    this.refresh();
  }
  togglePanels(): void {
    this.left.hidden = !this.left.hidden;
  }
  toggleReport(): void {
    this.report.hidden = !this.report.hidden;
    if (!this.report.hidden && !this.report.firstChild)
      fillReport(this.report, this.view, () => this.toggleReport(), (image) => {
        this.toggleReport();
        this.enter(image);
      });
    this.updateButtons();
  }
  toggleOrthographic(): void {
    this.leave();
    this.stage.setOrthographic(!this.stage.isOrthographic);
    this.updateButtons();
  }
  along(direction: "front" | "side" | "plan" | "back" | "left"): void {
    this.leave();
    this.stage.setOrthographic(true);
    // From above a little of the front, so that up stays defined.
    const from = { front: [0, 0, 1], side: [1, 0, 0], plan: [0, 1, 1e-5], back: [0, 0, -1], left: [-1, 0, 0] }[direction];
    this.stage.fit(new THREE.Vector3(...from).normalize());
    this.updateButtons();
  }
  setClip(on: boolean): void {
    this.clip.on = on;
    const { low, high } = this.sceneBox();
    const size = high.clone().sub(low);
    const [x, y, z] = this.clip.range;
    const at = (t: number, k: 0 | 1 | 2) => low.getComponent(k) + t * size.getComponent(k);
    if (on) {
      shared.clipLow.value.set(at(x[0], 0), at(y[0], 1), at(z[0], 2));
      shared.clipHigh.value.set(at(x[1], 0), at(y[1], 1), at(z[1], 2));
    } else {
      shared.clipLow.value.setScalar(-1e30);
      shared.clipHigh.value.setScalar(1e30);
    }
    this.rebuildPanel();
    this.updateButtons();
    this.stage.draw();
  }
  resetClip(): void {
    this.clip.range.splice(0, 3, [0, 1], [0, 1], [0, 1]);
    this.setClip(this.clip.on);
  }
  // Axes of the upright scene: what the extent of the model becomes there, with room around.
  private sceneBox(): { low: THREE.Vector3; high: THREE.Vector3 } {
    const { low, high } = this.view.model.meta;
    const box = new THREE.Box3();
    for (let k = 0; k < 8; ++k)
      box.expandByPoint(this.stage.toScene([0, 1, 2].map((a) => ((k >> a) & 1 ? high[a] : low[a])) as [number, number, number]));
    box.expandByScalar(0.02 * this.view.radius);
    return { low: box.min, high: box.max };
  }

  // --- What is selected.
  select(pick: Pick | null): void {
    this.selection = pick;
    this.marked.clear();
    this.right.hidden = pick === null;
    this.marked.visible = !(this.stage.imageMode && pick?.kind === "camera");
    if (pick) {
      this.right.replaceChildren(...infoPanel(this.views[pick.second ? 1 : 0], pick, {
        select: (p) => this.select(p), enter: (i) => this.enter(i), focus: (p) => this.focus(p), close: () => this.select(null),
      }));
      this.right.scrollTop = 0;
      this.mark(pick);
    }
    this.stage.draw();
    this.saveAddress();
  }
  private mark(pick: Pick): void {
    const view = this.views[pick.second ? 1 : 0];
    const { model } = view;
    const paint = (_: number, out: Uint8Array, at: number) => out.set([...highlight, 255], at);
    const addPoints = (xyz: number[], size: number, ring: boolean) => {
      const cloud = new PointCloud(new Float32Array(xyz), 0, { ring, onTop: true });
      cloud.size = size;
      cloud.paint(paint);
      this.marked.add(cloud.object);
    };
    const addSegments = (ends: number[], width: number, onTop = true) => {
      const segments = new Segments(new Float32Array(ends), 0, { onTop, width });
      segments.paint(paint);
      this.marked.add(segments.object);
    };
    switch (pick.kind) {
      case "point": {
        const X = model.point(pick.index);
        addPoints(X, 13, true);
        const axes = covarianceAxes(view, pick.index);
        if (axes) addSegments(ellipsoid(X, axes), 1);
        // From the cameras that see it.
        if (!this.stage.imageMode) addSegments(this.rays(view, view.model.points, pick.index, X), 1, false);
        break;
      }
      case "line": {
        addSegments([...model.lineEnd(pick.index, 0), ...model.lineEnd(pick.index, 1)], this.settings.lineWidth + 3);
        break;
      }
      case "surface": {
        const points = [...model.memberPoints[pick.index]].slice(0, 20000).flatMap((i) => model.point(i));
        const lines = [...model.memberLines[pick.index]].flatMap((i) => [...model.lineEnd(i, 0), ...model.lineEnd(i, 1)]);
        if (points.length > 0) addPoints(points, this.settings.pointSize + 2, false);
        if (lines.length > 0) addSegments(lines, this.settings.lineWidth + 1.5);
        break;
      }
      case "camera": {
        const centre = model.centre(pick.index);
        const corners = view.photographCorners(pick.index, this.settings.cameraSize * 1.02);
        addSegments(corners.flatMap((c, k) => [...centre, ...c, ...c, ...corners[(k + 1) % 4]]), 3);
        break;
      }
    }
  }
  private rays(view: ModelView, features: Model["points"], i: number, X: [number, number, number]): number[] {
    const ends: number[] = [];
    for (let k = features.start[i]; k < Math.min(features.start[i + 1], features.start[i] + 60); ++k)
      ends.push(...X, ...view.model.centre(features.obsImage[k]));
    return ends;
  }
  placeOf(pick: Pick): THREE.Vector3 {
    const { model } = this.views[pick.second ? 1 : 0];
    switch (pick.kind) {
      case "point":
        return new THREE.Vector3(...model.point(pick.index));
      case "line":
        return new THREE.Vector3(...model.lineEnd(pick.index, 0)).lerp(new THREE.Vector3(...model.lineEnd(pick.index, 1)), 0.5);
      case "camera":
        return new THREE.Vector3(...model.centre(pick.index));
      case "surface": {
        const box = new THREE.Box3();
        for (const i of model.memberPoints[pick.index]) box.expandByPoint(new THREE.Vector3(...model.point(i)));
        for (const i of model.memberLines[pick.index])
          for (const end of [0, 1] as const) box.expandByPoint(new THREE.Vector3(...model.lineEnd(i, end)));
        return box.isEmpty() ? this.view.middle.clone() : box.getCenter(new THREE.Vector3());
      }
    }
  }
  focus(pick: Pick, zoom = true): void {
    this.leave();
    const target = this.stage.toScene(this.placeOf(pick));
    const direction = this.stage.camera.position.clone().sub(this.stage.controls.target);
    let distance = direction.length();
    if (zoom) distance = Math.min(distance, (pick.kind === "surface" || pick.kind === "camera" ? 1.2 : 0.5) * this.stage.radius);
    this.stage.look(target.clone().addScaledVector(direction.normalize(), distance), target);
    if (zoom && this.stage.isOrthographic) {
      this.stage.orthographic.zoom = Math.max(this.stage.orthographic.zoom, 3);
      this.stage.resize();
    }
  }
  // By id of a point, line, group or image, "line 12" and the like, or the name of an image.
  find(text: string): boolean {
    const { model } = this.view;
    const query = text.trim();
    if (!query) return false;
    const found = (pick: Pick): boolean => {
      this.select(pick);
      if (pick.kind !== "camera") this.focus(pick);
      this.search.setCustomValidity("");
      return true;
    };
    const images = model.meta.images;
    const lower = query.toLowerCase();
    let image = images.findIndex((i) => i.name === query);
    if (image < 0) image = images.findIndex((i) => i.name.toLowerCase().includes(lower));
    const match = /^(?:(point|line|group|image|plane|p|l|g|i)[\s:#]*)?(\d+)$/i.exec(query);
    if (match) {
      const want = (match[1] ?? "").charAt(0).toLowerCase();
      const id = match[2];
      const group = model.meta.groups.findIndex((g) => g.id === id);
      const byId = images.findIndex((i) => String(i.id) === id);
      if ((want === "" || (want === "p" && match[1].toLowerCase() !== "plane")) && model.points.find(id) >= 0)
        return found({ kind: "point", index: model.points.find(id), second: false });
      if ((want === "" || want === "l") && model.lines.find(id) >= 0) return found({ kind: "line", index: model.lines.find(id), second: false });
      if ((want === "" || want === "g" || want === "p") && group >= 0) return found({ kind: "surface", index: group, second: false });
      if ((want === "" || want === "i") && byId >= 0) return found({ kind: "camera", index: byId, second: false });
    }
    if (image >= 0) return found({ kind: "camera", index: image, second: false });
    this.search.setCustomValidity("Nothing of this model has that id or name.");
    this.search.reportValidity();
    return false;
  }

  // --- Standing in an image.
  enter(image: number): void {
    this.measure.toggle(false);
    this.stage.enterImage(this.view, image);
    this.currentImage = image;
    this.showImage(image);
    if (this.selection?.kind === "camera" || !this.selection) this.select({ kind: "camera", index: image, second: false });
    else this.select(this.selection);
    this.sideNames.hidden = true;
    this.fillImageBar();
    this.saveAddress();
  }
  private showImage(image: number): void {
    this.imageView.show(image, this.imageLayers, (line) => {
      const g = this.view.model.groupOfLine[line];
      return g < 0 ? [90, 200, 250] : this.view.groupColour(g);
    });
    this.refresh(false);
  }
  leave(): void {
    if (!this.stage.imageMode) return;
    this.stage.leaveImage();
    this.imageView.hide();
    this.currentImage = -1;
    this.imageBar.hidden = this.strip.hidden = true;
    this.marked.visible = true;
    this.setSplit(this.stage.split);
    this.refresh(false);
    this.saveAddress();
  }
  step(by: number): void {
    const images = this.view.model.meta.images.length;
    if (images === 0) return;
    const from = this.stage.imageMode ? this.currentImage : this.selection?.kind === "camera" ? this.selection.index : -by;
    this.enter((from + by + images) % images);
  }
  private fillImageBar(): void {
    const image = this.currentImage;
    const { model } = this.view;
    const record = model.meta.images[image];
    const flags: [keyof ImageLayers, string][] = [["keypoints", "keypoints"], ["segments", "segments"], ["unused", "unused segments"], ["onlySeen", "only what it sees"], ["surfaces", "surfaces"]];
    this.imageBar.hidden = false;
    fill(
      this.imageBar,
      button("\u2039", "Image before (left arrow)", () => this.step(-1), { id: "previous-image" }),
      el("span", { class: "name", id: "image-name", title: record.name }, record.name),
      button("\u203a", "Next image (right arrow)", () => this.step(1), { id: "next-image" }),
      photographUrl(image) ? slider("Photograph", this.imageLayers.photograph, [0, 1, 0.05], String, (v) => (this.imageView.opacity = this.imageLayers.photograph = v)) : null,
      ...(model.pointPositions ? [slider("Residuals x", this.imageLayers.residuals, [0, 20, 1], String, (v) => { this.imageLayers.residuals = v; this.showImage(image); })] : []),
      ...flags.filter(([flag]) => flag === "onlySeen" || flag === "surfaces" || model.pointPositions).map(([flag, name]) =>
        toggle(name, this.imageLayers[flag] as boolean, (on) => { (this.imageLayers[flag] as boolean) = on; this.showImage(image); })),
      button("Leave", "Back to the model (Esc)", () => this.leave(), { id: "leave-image" }));
    this.strip.hidden = window.innerHeight < 520;
    if (!this.strip.firstChild) this.fillStrip();
    [...this.strip.children].forEach((child, i) => child.classList.toggle("on", i === image));
    this.strip.children[image]?.scrollIntoView({ block: "nearest", inline: "center" });
  }
  private fillStrip(): void {
    const observer = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        if (!entry.isIntersecting) continue;
        const frame = entry.target as HTMLElement;
        observer.unobserve(frame);
        const url = photographUrl(Number(frame.dataset.image));
        if (url) frame.replaceChildren(el("img", { src: url, alt: "" }));
      }
    });
    this.view.model.meta.images.slice(0, 2000).forEach((image, i) => {
      const frame = button(image.name, image.name, () => this.enter(i), { "data-image": String(i) });
      this.strip.append(frame);
      observer.observe(frame);
    });
  }

  // --- Pointer and keys.
  private listen(): void {
    let down: { x: number; y: number; time: number } | null = null;
    this.canvas.addEventListener("pointerdown", (e) => {
      down = { x: e.clientX, y: e.clientY, time: performance.now() };
      this.canvas.focus();
    });
    this.canvas.addEventListener("pointerup", (e) => {
      if (!down || e.button !== 0 || Math.hypot(e.clientX - down.x, e.clientY - down.y) > 4 || performance.now() - down.time > 600) return;
      this.click(e.clientX, e.clientY);
    });
    this.canvas.addEventListener("dblclick", (e) => {
      const pick = this.pickAt(e.clientX, e.clientY);
      if (!pick || this.stage.imageMode) return;
      if (pick.kind === "camera" && !pick.second) this.enter(pick.index);
      else this.focus(pick, false);
    });
    let hover = 0;
    this.canvas.addEventListener("pointermove", (e) => {
      clearTimeout(hover);
      this.tip.hidden = true;
      if (e.buttons || e.pointerType === "touch") return;
      hover = window.setTimeout(() => this.showTip(e.clientX, e.clientY), 140);
    });
    this.canvas.addEventListener("pointerleave", () => {
      clearTimeout(hover);
      this.tip.hidden = true;
    });
    window.addEventListener("keydown", (e) => this.key(e));
  }
  private pickAt(clientX: number, clientY: number): Pick | null {
    const box = this.canvas.getBoundingClientRect();
    return this.stage.pick(clientX - box.left, clientY - box.top);
  }
  click(clientX: number, clientY: number): void {
    const pick = this.pickAt(clientX, clientY);
    if (this.measure.active) {
      if (pick && pick.kind !== "surface") this.measureAt(pick, clientX, clientY);
      return;
    }
    this.select(pick);
  }
  private measureAt(pick: Pick, clientX: number, clientY: number): void {
    const view = this.views[pick.second ? 1 : 0];
    const name = describe(view, pick);
    if (pick.kind !== "line") return this.measure.add({ position: this.placeOf(pick), name });
    const box = this.canvas.getBoundingClientRect();
    const [a, b] = ([0, 1] as const).map((end) => this.stage.toScene(view.model.lineEnd(pick.index, end)));
    const at = this.stage.nearestOnLine(a, b, clientX - box.left, clientY - box.top);
    this.measure.add({ position: this.stage.toModel(at), name, direction: this.stage.toModel(b.clone().sub(a)) });
  }
  private showTip(clientX: number, clientY: number): void {
    if (this.stage.lastFrameMs > 60) return; // it would stutter
    const pick = this.pickAt(clientX, clientY);
    if (!pick) return;
    const box = this.canvas.getBoundingClientRect();
    this.tip.textContent = describe(this.views[pick.second ? 1 : 0], pick);
    this.tip.hidden = false;
    this.tip.style.left = `${Math.min(clientX - box.left + 14, box.width - 160)}px`;
    this.tip.style.top = `${clientY - box.top + 14}px`;
  }
  private key(e: KeyboardEvent): void {
    const typing = e.target instanceof HTMLInputElement && e.target.type !== "checkbox" && e.target.type !== "range";
    if (typing || e.target instanceof HTMLSelectElement || e.ctrlKey || e.metaKey || e.altKey || this.help.open) {
      if (e.key === "Escape") (e.target as HTMLElement).blur();
      return;
    }
    const flip = (layer: Layer) => () => this.setLayer(layer, !this.settings.layers[layer]);
    const size = (by: number) => () => {
      this.settings.pointSize = Math.min(Math.max(this.settings.pointSize + by, 1), 10);
      this.refresh();
    };
    const actions: Record<string, () => void> = {
      f: () => { this.leave(); this.stage.fit(); }, z: () => this.selection && this.focus(this.selection), o: () => this.toggleOrthographic(),
      "1": () => this.along("front"), "3": () => this.along("side"), "4": () => this.along("left"), "6": () => this.along("back"), "7": () => this.along("plan"),
      p: flip("points"), l: flip("lines"), s: flip("surfaces"), c: flip("cameras"), w: flip("wireframe"), d: flip("directions"), t: flip("photographs"), e: flip("textures"),
      m: () => this.measure.toggle(), b: () => this.setClip(!this.clip.on), r: () => this.toggleReport(), g: () => this.savePicture(), h: () => this.togglePanels(),
      "+": size(0.5), "=": size(0.5), "-": size(-0.5), "?": () => this.help.showModal(), "/": () => this.search.focus(),
      x: () => this.views.length > 1 && this.setSplit(({ both: "first", first: "second", second: "both", side: "both" } as const)[this.stage.split]),
      ArrowRight: () => this.step(1), ArrowLeft: () => this.step(-1),
      Enter: () => this.selection?.kind === "camera" && !this.selection.second && this.enter(this.selection.index),
      Escape: () => {
        if (!this.report.hidden) this.toggleReport();
        else if (this.measure.active) this.measure.toggle(false);
        else if (this.stage.imageMode) this.leave();
        else this.select(null);
      },
    };
    const action = actions[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!action || (e.target instanceof HTMLButtonElement && e.key === "Enter")) return;
    e.preventDefault();
    action();
  }

  savePicture(): void {
    this.stage.render(); // what is drawn is gone with the frame
    const link = el("a", { href: this.canvas.toDataURL("image/png"), download: `${this.view.model.meta.title.replace(/[^\w.-]+/g, "_")}.png` });
    link.click();
  }
  private showStatus(): void {
    this.scaleBar.update(this.stage);
    const { model } = this.view;
    this.status.textContent = this.stage.imageMode ? "" :
      `${model.points.count.toLocaleString("en")} points, ${model.lines.count.toLocaleString("en")} lines, ${model.meta.images.length.toLocaleString("en")} images`;
  }

  // --- The address: where one stands, what is selected.
  private addressTimer = 0;
  private saveAddress(): void {
    clearTimeout(this.addressTimer);
    this.addressTimer = window.setTimeout(() => {
      const numbers = (v: THREE.Vector3) => v.toArray().map((x) => Number(x.toPrecision(6))).join(",");
      const camera = this.stage.isOrthographic ? this.stage.orthographic : this.stage.perspective;
      const parts = [`at=${numbers(camera.position)}`, `to=${numbers(this.stage.controls.target)}`];
      if (this.stage.isOrthographic) parts.push(`ortho=${Number(this.stage.orthographic.zoom.toPrecision(5))}`);
      if (this.stage.imageMode) parts.push(`image=${this.currentImage}`);
      if (this.selection) parts.push(`select=${this.selection.kind}.${this.selection.index}.${Number(this.selection.second)}`);
      try {
        history.replaceState(null, "", `#${parts.join("&")}`);
      } catch {
        // Some browsers do not let pages from files do this; the view is then not kept.
      }
    }, 250);
  }
  private restoreAddress(): void {
    const parts = new URLSearchParams(location.hash.slice(1));
    const vector = (name: string): THREE.Vector3 | null => {
      const numbers = (parts.get(name) ?? "").split(",").map(Number);
      return numbers.length === 3 && numbers.every(Number.isFinite) ? new THREE.Vector3(...(numbers as [number, number, number])) : null;
    };
    const at = vector("at"), to = vector("to");
    const zoom = Number(parts.get("ortho"));
    if (zoom > 0) this.stage.setOrthographic(true);
    if (at && to) this.stage.look(at, to);
    if (zoom > 0) {
      this.stage.orthographic.zoom = zoom;
      this.stage.resize();
    }
    const [kind, index, second] = (parts.get("select") ?? "").split(".");
    const { model } = this.views[second === "1" && this.views.length > 1 ? 1 : 0];
    const counts = { point: model.points.count, line: model.lines.count, surface: model.meta.groups.length, camera: model.meta.images.length };
    if (kind in counts && Number(index) < counts[kind as keyof typeof counts])
      this.select({ kind: kind as Pick["kind"], index: Number(index), second: second === "1" && this.views.length > 1 });
    const image = parts.get("image");
    if (image !== null && Number(image) < this.view.model.meta.images.length) this.enter(Number(image));
    this.updateButtons();
  }
}

// Three ellipses through the axes.
function ellipsoid(centre: [number, number, number], axes: { direction: [number, number, number]; length: number }[]): number[] {
  const ends: number[] = [];
  const steps = 40;
  for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
    const at = (k: number) => {
      const c = Math.cos((2 * Math.PI * k) / steps) * axes[p].length, s = Math.sin((2 * Math.PI * k) / steps) * axes[q].length;
      return [0, 1, 2].map((a) => centre[a] + c * axes[p].direction[a] + s * axes[q].direction[a]);
    };
    for (let k = 0; k < steps; ++k) ends.push(...at(k), ...at(k + 1));
  }
  return ends;
}
