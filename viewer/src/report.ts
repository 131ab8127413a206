// SPDX-License-Identifier: BSD-3-Clause
// The tab with numbers: what the model holds, how errors are spread, each image, the run's report.
import { button, el, fill } from "./dom";
import type { Features } from "./model";
import { number, type ModelView } from "./modelview";

function median(values: number[]): number {
  if (values.length === 0) return NaN;
  values.sort((a, b) => a - b);
  return values[Math.floor(values.length / 2)];
}

function histogram(title: string, values: number[], unit: string, whole: boolean): HTMLElement | null {
  if (values.length === 0) return null;
  values.sort((a, b) => a - b);
  const high = Math.max(values[Math.floor(0.985 * (values.length - 1))], whole ? 3 : 1e-9);
  const bins = whole ? Math.min(Math.ceil(high) + 1, 32) : 32;
  const width = (whole ? Math.ceil((high + 1) / bins) * bins : high) / bins;
  const counts = new Array(bins).fill(0);
  for (const value of values) ++counts[Math.min(Math.floor(value / width), bins - 1)];
  const most = Math.max(...counts);
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("viewBox", "0 0 320 120");
  counts.forEach((count, k) => {
    const bar = document.createElementNS(space, "rect");
    const height = (100 * count) / most;
    bar.setAttribute("x", String((320 / bins) * k + 1));
    bar.setAttribute("width", String(320 / bins - 1.5));
    bar.setAttribute("y", String(102 - height));
    bar.setAttribute("height", String(height));
    bar.setAttribute("rx", "1");
    bar.setAttribute("fill", "var(--accent)");
    const label = document.createElementNS(space, "title");
    label.textContent = `${number(k * width)} to ${number((k + 1) * width)} ${unit}: ${count}`;
    bar.append(label);
    svg.append(bar);
  });
  for (const [x, anchor, value] of [[1, "start", 0], [160, "middle", (width * bins) / 2], [319, "end", width * bins]] as const) {
    const text = document.createElementNS(space, "text");
    text.setAttribute("x", String(x));
    text.setAttribute("y", "116");
    text.setAttribute("text-anchor", anchor);
    text.textContent = `${number(value)}${value === 0 ? "" : " " + unit}`;
    svg.append(text);
  }
  return el("figure", {}, el("figcaption", {}, `${title}, median ${number(values[Math.floor(values.length / 2)])} ${unit}`), svg);
}

function errorsOf(features: Features): number[] {
  const values: number[] = [];
  const step = Math.max(1, Math.floor(features.obsError.length / 300000));
  for (let k = 0; k < features.obsError.length; k += step) if (features.obsError[k] >= 0) values.push(features.obsError[k]);
  return values;
}
function tracksOf(features: Features): number[] {
  return Array.from({ length: features.count }, (_, i) => features.trackLength(i));
}

export function fillReport(root: HTMLElement, view: ModelView, close: () => void, enter: (image: number) => void): void {
  const { model } = view;
  const { meta } = model;
  const card = (value: string, name: string) => el("div", { class: "card" }, el("b", {}, value), el("span", {}, name));
  const count = (n: number) => n.toLocaleString("en");
  const pointErrors = errorsOf(model.points), lineErrors = errorsOf(model.lines);
  fill(
    root,
    button("Back to the model", "Back (R)", close, { class: "on", style: "float:right" }),
    el("h2", {}, meta.title),
    el("div", { class: "cards" },
      card(count(meta.images.length), "images with a pose"),
      card(count(meta.unregistered.length), "images without"),
      card(count(meta.cameras.length), "cameras"),
      card(count(model.points.count), "points"),
      card(count(model.points.obsImage.length), "their observations"),
      card(count(model.lines.count), "lines"),
      card(count(meta.groups.filter((g) => g.parallelism).length), "directions"),
      card(count(meta.groups.filter((g) => !g.parallelism).length), "surfaces"),
      card(count(model.wireframe.length / 3), "edges of the wireframe"),
      card(`${number(meta.sigma_px)} px`, "noise of keypoints")),
    el("div", { class: "charts" },
      histogram("Error of points' observations", pointErrors, "px", false),
      histogram("Error of lines' segments", lineErrors, "px", false),
      histogram("Observations of a point", tracksOf(model.points), "", true),
      histogram("Segments of a line", tracksOf(model.lines), "", true)),
  );
  if (meta.report) root.append(el("h2", {}, "What the run reported"), el("pre", { id: "run-report" }, meta.report));
  root.append(el("h2", {}, "Images"), imageTable(view, enter));
  if (meta.unregistered.length > 0)
    root.append(el("h2", {}, "Images without a pose"), el("p", { class: "hint" }, meta.unregistered.slice(0, 500).join(", ")));
}

function imageTable(view: ModelView, enter: (image: number) => void): HTMLElement {
  const { model } = view;
  const rows = model.meta.images.slice(0, 3000).map((image, i) => {
    const points = model.pointsSeenBy(i), lines = model.linesSeenBy(i);
    const known = points.map((s) => model.points.obsError[s.observation]).filter((v) => v >= 0);
    return { i, values: [image.name, points.length, image.points, lines.length, median(known), model.camera(i).model] as (string | number)[] };
  });
  const names = ["Image", "Points", "Keypoints", "Lines", "Median error, px", "Camera"];
  const body = el("tbody");
  let order = 0;
  const show = () =>
    body.replaceChildren(...rows.map(({ i, values }) =>
      el("tr", {}, ...values.map((value, k) => el("td", {}, k === 0
        ? button(String(value), "Look from there", () => enter(i), { style: "padding:0 2px;color:var(--accent)" })
        : typeof value === "number" ? number(value) : value)))));
  const table = el("table", { class: "images" }, el("thead", {}, el("tr", {}, ...names.map((name, k) =>
    el("th", { onclick: () => {
      order = order === k + 1 ? -(k + 1) : k + 1;
      const sign = order > 0 ? 1 : -1;
      rows.sort((a, b) => sign * (typeof a.values[k] === "string" ? String(a.values[k]).localeCompare(String(b.values[k])) : (b.values[k] as number) - (a.values[k] as number)));
      show();
    } }, name)))), body);
  show();
  return table;
}
