// SPDX-License-Identifier: BSD-3-Clause
// The panel that says what something is: which images see it, with which error, what it belongs to.
import { button, el } from "./dom";
import { photographUrl } from "./model";
import { number, originNames, type ModelView } from "./modelview";
import { css } from "./palette";
import type { Pick } from "./stage";

export interface InfoActions {
  select(pick: Pick): void;
  enter(image: number): void;
  focus(pick: Pick): void;
  close(): void;
}

const maxListed = 200;

export function describe(view: ModelView, pick: Pick): string {
  const { model } = view;
  const groups = model.meta.groups;
  switch (pick.kind) {
    case "point":
      return `Point ${model.points.id(pick.index)}`;
    case "line":
      return `Line ${model.lines.id(pick.index)}`;
    case "surface":
      return `${groupName(groups[pick.index].type)} ${groups[pick.index].id}`;
    case "camera":
      return model.meta.images[pick.index].name;
  }
}

export function groupName(type: string): string {
  return type === "VP" ? "Direction" : type.charAt(0) + type.slice(1).toLowerCase();
}

export function infoPanel(view: ModelView, pick: Pick, actions: InfoActions): HTMLElement[] {
  const kinds = { point: "Point", line: "Line", surface: "Group", camera: "Image" };
  const head = el(
    "section", {},
    button("\u2715", "Close (Esc)", actions.close, { class: "close", "aria-label": "Close" }),
    el("h1", { id: "info-title" }, describe(view, pick)),
    el("p", { class: "sub" }, kinds[pick.kind] + (pick.second ? " of the second model" : "")),
  );
  switch (pick.kind) {
    case "point":
      return ofPoint(view, pick, actions, head);
    case "line":
      return ofLine(view, pick, actions, head);
    case "surface":
      return ofGroup(view, pick, actions, head);
    case "camera":
      return ofImage(view, pick, actions, head);
  }
}

function facts(rows: [string, string | Node | null][]): HTMLElement {
  const table = el("table", { class: "facts" });
  for (const [name, value] of rows) if (value !== null) table.append(el("tr", {}, el("td", {}, name), el("td", {}, value)));
  return table;
}
function focusButton(pick: Pick, actions: InfoActions): HTMLElement {
  return el("div", { class: "actions" }, button("Zoom to it", "Bring it to the middle (Z)", () => actions.focus(pick)));
}
function position(view: ModelView, p: [number, number, number]): string {
  return p.map((x, k) => number(x + view.model.meta.origin[k])).join(", ");
}
function error(value: number): string {
  return value >= 0 ? `${number(value)} px` : "not set";
}

function seenBy(view: ModelView, features: ModelView["model"]["points"], i: number, actions: InfoActions): HTMLElement {
  const list = el("div", { class: "list", id: "seen-by" });
  const observations: [number, number][] = [];
  for (let k = features.start[i]; k < features.start[i + 1]; ++k) observations.push([features.obsImage[k], features.obsError[k]]);
  observations.sort((a, b) => b[1] - a[1]);
  for (const [image, value] of observations.slice(0, maxListed)) list.append(imageButton(view, image, value >= 0 ? `${number(value)} px` : "not in view", actions));
  const more = observations.length - maxListed;
  return el("section", {}, el("h2", {}, `Seen in ${observations.length} places, worst first`), list, more > 0 && el("p", { class: "hint" }, `and ${more} more`));
}
function imageButton(view: ModelView, image: number, value: string, actions: InfoActions): HTMLElement {
  const url = view.second ? null : photographUrl(image);
  const img = url ? el("img", { alt: "", loading: "lazy", decoding: "async" }) : null;
  if (img && url) new IntersectionObserver((entries, observer) => {
    if (!entries[0].isIntersecting) return;
    img.src = url;
    observer.disconnect();
  }).observe(img);
  return el(
    "button", { type: "button", title: "Look from there", onclick: () => (view.second ? actions.select({ kind: "camera", index: image, second: true }) : actions.enter(image)) },
    img, el("span", { class: "name" }, view.model.meta.images[image].name), el("span", { class: "value" }, value),
  );
}
function groupButtons(view: ModelView, groups: number[], second: boolean, actions: InfoActions): HTMLElement | null {
  if (groups.length === 0) return null;
  const list = el("div", { class: "legend" });
  for (const g of groups) {
    const group = view.model.meta.groups[g];
    list.append(
      el("button", { type: "button", onclick: () => actions.select({ kind: "surface", index: g, second }) },
        el("span", { class: "dot", style: `background:${css(view.groupColour(g))}` }), `${groupName(group.type)} ${group.id}`),
    );
  }
  return el("section", {}, el("h2", {}, "Belongs to"), list);
}
function groupsOf(lists: Uint32Array[], item: number): number[] {
  return lists.map((list, g) => (list.includes(item) ? g : -1)).filter((g) => g >= 0);
}

function ofPoint(view: ModelView, pick: Pick, actions: InfoActions, head: HTMLElement): HTMLElement[] {
  const { model } = view;
  const i = pick.index;
  const axes = covarianceAxes(view, i);
  head.append(
    facts([
      ["Position", position(view, model.point(i))],
      ["Origin", originNames[model.pointOrigin[i]] ?? "other"],
      ["Mean error", error(model.points.error[i])],
      ["Observations", String(model.points.trackLength(i))],
      ["Uncertainty", model.points.sigma[i] > 0 ? `${number(model.points.sigma[i])} (1 sigma)` : "unknown"],
      ["Its axes", axes && axes.map((a) => number(a.length)).join(", ")],
      ["Colour", el("span", {}, `${[...model.points.rgb.subarray(3 * i, 3 * i + 3)].join(" ")}`)],
    ]),
    focusButton(pick, actions),
  );
  const lines = (model.edgesOfPoint.get(i) ?? []).map((e) => model.wireframe[3 * e + 1]);
  const joined = lines.length > 0 && el("section", {}, el("h2", {}, "Lies on lines"), el("div", { class: "list" },
    ...lines.map((line) => el("button", { type: "button", onclick: () => actions.select({ kind: "line", index: line, second: pick.second }) }, `Line ${model.lines.id(line)}`))));
  return [head, joined, groupButtons(view, groupsOf(model.memberPoints, i), pick.second, actions), seenBy(view, model.points, i, actions)].filter(Boolean) as HTMLElement[];
}

function ofLine(view: ModelView, pick: Pick, actions: InfoActions, head: HTMLElement): HTMLElement[] {
  const { model } = view;
  const i = pick.index;
  head.append(
    facts([
      ["Length", number(model.lineLength(i))],
      ["From", position(view, model.lineEnd(i, 0))],
      ["To", position(view, model.lineEnd(i, 1))],
      ["Mean error", error(model.lines.error[i])],
      ["Segments", String(model.lines.trackLength(i))],
      ["Uncertainty", model.lines.sigma[i] > 0 ? `${number(model.lines.sigma[i])} across (1 sigma)` : "unknown"],
    ]),
    focusButton(pick, actions),
  );
  const points = (model.edgesOfLine.get(i) ?? []).map((e) => model.wireframe[3 * e]);
  const joined = points.length > 0 && el("section", {}, el("h2", {}, "Junctions on it"), el("div", { class: "list" },
    ...points.slice(0, 50).map((point) => el("button", { type: "button", onclick: () => actions.select({ kind: "point", index: point, second: pick.second }) }, `Point ${model.points.id(point)}`))));
  return [head, groupButtons(view, groupsOf(model.memberLines, i), pick.second, actions), joined, seenBy(view, model.lines, i, actions)].filter(Boolean) as HTMLElement[];
}

function ofGroup(view: ModelView, pick: Pick, actions: InfoActions, head: HTMLElement): HTMLElement[] {
  const { model } = view;
  const group = model.meta.groups[pick.index];
  const names = group.names.split(" ");
  head.append(
    facts([
      ["Type", group.type === "VP" ? "vanishing point" : group.type.toLowerCase()],
      ["Points", String(group.points)],
      ["Lines", String(group.lines)],
      ["Observations", String(group.observations)],
      ...group.params.map((value, k) => [names[k] ?? String(k), number(value)] as [string, string]),
    ]),
    focusButton(pick, actions),
  );
  const related = model.meta.relations.filter(([a, b]) => a === pick.index || b === pick.index);
  const relations = related.length > 0 && el("section", {}, el("h2", {}, "Relations"), el("div", { class: "legend" },
    ...related.map(([a, b, type]) => {
      const other = a === pick.index ? b : a;
      const record = model.meta.groups[other];
      return el("button", { type: "button", onclick: () => actions.select({ kind: "surface", index: other, second: pick.second }) },
        el("span", { class: "dot", style: `background:${css(view.groupColour(other))}` }),
        `${type === 0 ? "orthogonal to" : "parallel to"} ${groupName(record.type)} ${record.id}`);
    })));
  const images = [...new Set(model.groupImages[pick.index])].sort((a, b) => a - b);
  const seen = images.length > 0 && el("section", {}, el("h2", {}, `Observed in ${images.length} images`), el("div", { class: "list", id: "seen-by" },
    ...images.slice(0, maxListed).map((image) => imageButton(view, image, "", actions))));
  return [head, relations, seen].filter(Boolean) as HTMLElement[];
}

function ofImage(view: ModelView, pick: Pick, actions: InfoActions, head: HTMLElement): HTMLElement[] {
  const { model } = view;
  const image = model.meta.images[pick.index];
  const camera = model.camera(pick.index);
  const names = camera.names.split(" ");
  const points = model.pointsSeenBy(pick.index), lines = model.linesSeenBy(pick.index);
  const mean = (values: number[]) => values.reduce((a, b) => a + b, 0) / values.length;
  const known = points.map((s) => model.points.obsError[s.observation]).filter((v) => v >= 0);
  const url = pick.second ? null : photographUrl(pick.index);
  if (url) head.append(el("img", { src: url, alt: "", style: "width:100%;border-radius:8px;margin-bottom:8px;cursor:pointer", onclick: () => actions.enter(pick.index) }));
  head.append(
    facts([
      ["Image id", String(image.id)],
      ["Centre", position(view, model.centre(pick.index))],
      ["Points seen", `${points.length} of ${image.points} keypoints`],
      ["Their mean error", known.length ? `${number(mean(known))} px` : "-"],
      ["Segments used", `${lines.length} of ${image.lines}`],
      ["Camera", `${camera.id}: ${camera.model}`],
      ["Size", `${camera.width} x ${camera.height}`],
      ...camera.params.map((value, k) => [names[k] ?? String(k), number(value)] as [string, string]),
    ]),
    el("div", { class: "actions" },
      !pick.second && button("Look from there", "Stand where it was taken (Enter)", () => actions.enter(pick.index), { id: "enter-image" }),
      button("Zoom to it", "Bring it to the middle (Z)", () => actions.focus(pick))),
  );
  return [head];
}

// Half axes of the ellipsoid of one standard deviation, by Jacobi's rotations; null: unknown.
export function covarianceAxes(view: ModelView, point: number): { direction: [number, number, number]; length: number }[] | null {
  const stored = view.model.pointCovariance;
  const sigma = view.model.points.sigma[point];
  if (!stored || !(sigma > 0)) return null;
  const [xx, xy, xz, yy, yz, zz] = [...stored.subarray(6 * point, 6 * point + 6)].map((v) => v / 32767);
  const a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 24; ++sweep) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-12) continue;
      const theta = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
      const c = Math.cos(theta), s = Math.sin(theta);
      for (let k = 0; k < 3; ++k) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; ++k) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; ++k) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  // Steps of the stored numbers are a thirty-thousandth of the greatest variance.
  return [0, 1, 2]
    .map((k) => ({ direction: [v[0][k], v[1][k], v[2][k]] as [number, number, number], length: sigma * Math.sqrt(Math.max(a[k][k], 1e-5)) }))
    .sort((x, y) => y.length - x.length);
}
