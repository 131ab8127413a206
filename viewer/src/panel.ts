// SPDX-License-Identifier: BSD-3-Clause
// The panel on the left: what is shown, how large, in which colours.
import type { App } from "./app";
import { button, choice, el, slider, toggle } from "./dom";
import { type Layer, lineColours, originNames, pointColours, type Legend } from "./modelview";
import { category, css, scaleCss } from "./palette";
import { groupName } from "./info";
import type { Split } from "./stage";

const colourNames: Record<string, string> = {
  colour: "photographs", error: "error", uncertainty: "uncertainty", track: "number of observations", origin: "origin",
  group: "group", height: "height", plain: "one colour", direction: "vanishing direction",
};

function scaleBar(legend: Legend | null): HTMLElement | null {
  return legend && el("div", { class: "scale" }, el("div", { class: "bar", style: `background:${scaleCss}` }),
    el("div", { class: "ends" }, el("span", {}, legend.low), el("span", {}, legend.unit), el("span", {}, legend.high)));
}

function originLegend(app: App): HTMLElement {
  const used = new Set(app.view.model.pointOrigin);
  return el("div", { class: "legend origins" }, ...originNames.flatMap((name, origin) => !used.has(origin) ? [] : [el("span", {},
    el("span", { class: "dot", style: `background:${origin === 0 ? "var(--soft)" : css(category(origin - 1))}` }), name)]));
}

export function buildPanel(app: App): HTMLElement[] {
  const { settings, view, views } = app;
  const { model } = view;
  const count = (n: number) => n.toLocaleString("en");
  const groups = model.meta.groups;
  const vps = groups.filter((g) => g.parallelism).length;
  const rows: [Layer, string, number][] = [
    ["points", "Points", model.points.count],
    ["lines", "Lines", model.lines.count],
    ["surfaces", "Planes and surfaces", groups.length - vps],
    ["textures", "Photographs on surfaces", app.photographCount > 0 ? groups.length - vps : 0],
    ["directions", "Vanishing directions", vps],
    ["wireframe", "Wireframe and junctions", model.wireframe.length / 3],
    ["relations", "Relations of surfaces", model.meta.relations.filter(([a, b]) => !groups[a].parallelism && !groups[b].parallelism).length],
    ["cameras", "Cameras", model.meta.images.length],
    ["photographs", "Photographs on cameras", app.photographCount],
  ];
  const sections: HTMLElement[] = [];
  const set = <K extends keyof typeof settings>(key: K) => (value: (typeof settings)[K]) => {
    settings[key] = value;
    app.refresh();
  };
  sections.push(el("section", {}, el("h2", {}, "Layers"),
    ...rows.filter(([, , n]) => n > 0).map(([layer, name, n]) =>
      toggle(name, settings.layers[layer], (on) => app.setLayer(layer, on), count(n), `layer-${layer}`))));
  if (views.length > 1) {
    sections.push(el("section", {}, el("h2", {}, "Two models"),
      choice<Split>("Show", [["both", "one over the other"], ["side", "side by side"], ["first", "the first"], ["second", "the second"]], app.stage.split, (s) => app.setSplit(s), "split"),
      toggle("Tint the second", views[1].tint !== null, (on) => app.setTint(on)),
      el("p", { class: "hint" }, `Second: ${views[1].model.meta.title}`)));
  }
  const has = (name: string) =>
    name !== "group" && name !== "direction" ? name !== "origin" || model.pointOrigin.some((o) => o > 0) : groups.length > 0;
  const points = pointColours.filter((c) => has(c) && (c !== "group" || groups.some((g) => g.points > 0)));
  const lines = lineColours.filter(has);
  const look: (HTMLElement | null)[] = [];
  if (model.points.count > 0) {
    look.push(
      choice("Points by", points.map((c) => [c, colourNames[c]] as const), settings.pointColour, set("pointColour"), "point-colour"),
      scaleBar(view.pointLegend),
      settings.pointColour === "origin" ? originLegend(app) : null,
      slider("Point size", settings.pointSize, [1, 10, 0.5], (v) => `${v} px`, set("pointSize"), "point-size"));
  }
  if (model.lines.count > 0) {
    look.push(
      choice("Lines by", lines.map((c) => [c, colourNames[c]] as const), settings.lineColour, set("lineColour"), "line-colour"),
      scaleBar(view.lineLegend),
      slider("Line width", settings.lineWidth, [1, 8, 0.5], (v) => `${v} px`, set("lineWidth"), "line-width"));
  }
  if (model.meta.images.length > 0)
    look.push(slider("Camera size", settings.cameraSize, [0.005, 0.25, 0.005], (v) => v.toFixed(3), (v) => app.setCameraSize(v), "camera-size"));
  if (groups.length > vps) look.push(slider("Surfaces", settings.opacity, [0.03, 0.9, 0.01], (v) => `${Math.round(v * 100)} %`, set("opacity")));
  sections.push(el("section", {}, el("h2", {}, "Look"), ...look));
  if (groups.length > 0) {
    const list = el("div", { class: "legend", id: "groups" });
    for (const { name, colour, count: n, group } of view.legendOfGroups())
      list.append(el("button", { type: "button", title: name, onclick: () => app.select({ kind: "surface", index: group, second: false }) },
        el("span", { class: "dot", style: `background:${colour}` }), `${groupName(groups[group].type)} ${groups[group].id}`, el("span", { class: "count" }, count(n))));
    sections.push(el("details", { open: groups.length <= 14 }, el("summary", {}, "Groups"), list));
  }
  const worst = 8;
  sections.push(el("details", {}, el("summary", {}, "Filter"),
    slider("Seen at least", settings.minTrack, [0, 20, 1], (v) => `${v} x`, set("minTrack"), "min-track"),
    slider("Error up to", Number.isFinite(settings.maxError) ? settings.maxError : worst, [0.1, worst, 0.1], (v) => (v >= worst ? "all" : `${v} px`),
      (v) => set("maxError")(v >= worst ? Infinity : v), "max-error")));
  sections.push(el("details", { open: app.clip.on, id: "clip" }, el("summary", {}, "Clipping box"), ...clipSliders(app)));
  return sections;
}

function clipSliders(app: App): HTMLElement[] {
  const names = [["left", "right"], ["bottom", "top"], ["back", "front"]];
  const rows: HTMLElement[] = [toggle("Clip", app.clip.on, (on) => app.setClip(on), "B", "clip-on")];
  for (let axis = 0; axis < 3; ++axis) {
    for (const end of [0, 1] as const) {
      rows.push(slider(names[axis][end], app.clip.range[axis][end], [-0.1, 1.1, 0.005], (v) => `${Math.round(100 * v)} %`, (v) => {
        app.clip.range[axis][end] = v;
        app.setClip(true);
      }, `clip-${names[axis][end]}`));
    }
  }
  rows.push(el("div", { class: "actions" }, button("Whole scene", "Open the box", () => app.resetClip())));
  return rows;
}

export function helpDialog(): HTMLDialogElement {
  const keys: [string, string][] = [
    ["drag", "turn"], ["right drag", "move"], ["wheel, pinch", "zoom to the pointer"], ["click", "what is this?"],
    ["double click", "turn about it"], ["F", "see all"], ["Z", "zoom to what is selected"], ["1 3 7", "front, side, plan"],
    ["4 6", "left, back"], ["O", "perspective or orthographic"], ["Enter", "look from the selected image"], ["\u2190 \u2192", "image before, next"],
    ["Esc", "back"], ["P L S C", "points, lines, surfaces, cameras"], ["W D", "wireframe, directions"], ["T E", "photographs on cameras, on surfaces"], ["M", "measure"],
    ["B", "clipping box"], ["X", "first, second, both models"], ["/", "search: id or image name"], ["R", "report"],
    ["G", "save a picture"], ["H", "hide the panels"], ["+ \u2212", "larger, smaller points"], ["?", "this page"],
  ];
  const dialog = el("dialog", { id: "help" }, el("h1", {}, "Keys, mouse, touch"),
    el("div", { class: "keys" }, ...keys.flatMap(([key, what]) => [el("span", {}, el("kbd", {}, key)), el("span", {}, what)])),
    el("p", { class: "hint" }, "One finger turns, two move and zoom. The address of the page holds the view: copy it to come back."),
    button("Close", "Close", () => dialog.close(), { class: "on" }));
  return dialog;
}
