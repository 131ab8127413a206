// SPDX-License-Identifier: BSD-3-Clause
// A million points and 50 000 lines: size of the page, seconds to open it, milliseconds of a frame, on
// this machine and without a graphics processor. HOLBA=PROGRAM node test/million.mjs [FOLDER]
import { execFileSync } from "node:child_process";
import { createWriteStream, mkdirSync, mkdtempSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { launch } from "./browser.mjs";

const numPoints = 1_000_000, numLines = 50_000, numImages = 500, seenBy = 4;
const folder = process.argv[2] ?? mkdtempSync(join(tmpdir(), "holba-million-"));
const model = join(folder, "model");
mkdirSync(model, { recursive: true });

// A town of blocks: points and lines on their walls, cameras in its streets.
let state = 1;
const random = () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32);
const wall = () => {
  const [i, j] = [Math.floor(random() * 30), Math.floor(random() * 30)];
  const height = 10 + ((i * 7 + j * 13) % 20);
  const side = random() < 0.5;
  const at = random() * 20, up = -random() * height;
  return [i * 30 + (side ? at : 0), up, j * 30 + (side ? 0 : at)];
};
async function write(name, rows) {
  const stream = createWriteStream(join(model, name));
  let text = "";
  for (const row of rows) {
    text += row + "\n";
    if (text.length > 1 << 22) {
      if (!stream.write(text)) await new Promise((done) => stream.once("drain", done));
      text = "";
    }
  }
  stream.end(text);
  await new Promise((done) => stream.once("finish", done));
}
const seenPoints = Array.from({ length: numImages }, () => []), seenLines = Array.from({ length: numImages }, () => []);
const short = (v) => v.map((x) => x.toFixed(4)).join(" ");
function* points() {
  for (let id = 1; id <= numPoints; ++id) {
    const track = [];
    for (let k = 0; k < seenBy; ++k) {
      const image = (id * 37 + k * 101) % numImages;
      track.push(`${image + 1} ${seenPoints[image].length}`);
      seenPoints[image].push(id);
    }
    const shade = Math.floor(random() * 200);
    yield `${id} ${short(wall())} ${shade} ${shade} ${(shade + id) % 256} ${(random() * 2).toFixed(3)} ${track.join(" ")}`;
  }
}
function* lines() {
  for (let id = 1; id <= numLines; ++id) {
    const a = wall(), axis = id % 3, b = a.map((v, k) => (k === axis ? v + 2 + random() * 5 : v));
    const d = [0, 1, 2].map((k) => (k === axis ? 1 : 0));
    const m = [a[1] * d[2] - a[2] * d[1], a[2] * d[0] - a[0] * d[2], a[0] * d[1] - a[1] * d[0]];
    const track = [];
    for (let k = 0; k < seenBy; ++k) {
      const image = (id * 53 + k * 77) % numImages;
      track.push(`${image + 1} ${seenLines[image].length}`);
      seenLines[image].push(id);
    }
    yield `${id} ${d.join(" ")} ${m.join(" ")} ${a.join(" ")} ${b.join(" ")} 200 200 200 0.5 ${track.join(" ")}`;
  }
}
function* images() {
  for (let i = 0; i < numImages; ++i) {
    yield `${i + 1} 1 0 0 0 ${short([-(i % 25) * 36, 2, -Math.floor(i / 25) * 36])} 1 image${i}.jpg`;
    yield seenPoints[i].map((id) => `${(random() * 1000).toFixed(2)} ${(random() * 750).toFixed(2)} ${id}`).join(" ");
  }
}
function* segments() {
  for (let i = 0; i < numImages; ++i)
    yield `${i + 1} ${seenLines[i].length} ${seenLines[i].map((id) => `${short([0, 0, 0, 0].map(() => random() * 700))} ${id}`).join(" ")}`;
}
function* groups() {
  for (let axis = 0; axis < 3; ++axis) {
    const ids = [];
    for (let id = 1; id <= numLines; ++id) if (id % 3 === axis) ids.push(id);
    yield `${axis + 1} VP 3 ${[0, 1, 2].map((k) => (k === axis ? 1 : 0)).join(" ")} 0 ${ids.length} ${ids.join(" ")} 0`;
  }
}
await write("cameras.txt", ["1 PINHOLE 1000 750 800 800 500 375"]);
await write("points3D.txt", points());
await write("lines3D.txt", lines());
await write("images.txt", images());
await write("lines2D.txt", segments());
await write("groups3D.txt", groups());
for (const name of ["groups2D", "wireframe", "relations"]) await write(`${name}.txt`, []);

const page = join(folder, "million.html");
const began = performance.now();
execFileSync(process.env.HOLBA, ["view", "--input_path", model, "--output_path", page, "--quiet"]);
console.log(`written in ${((performance.now() - began) / 1000).toFixed(1)} s, ${(statSync(page).size / 1e6).toFixed(1)} MB`);

const browser = await launch();
try {
  const tab = await (await browser.newContext({ viewport: { width: 1280, height: 800 }, offline: true })).newPage();
  tab.on("pageerror", (error) => console.error(String(error)));
  const opening = performance.now();
  await tab.goto(pathToFileURL(page).href, { waitUntil: "commit" });
  await tab.waitForFunction(() => document.body?.dataset.ready || document.body?.dataset.failed, null, { timeout: 300000 });
  console.log(`read and ready to be drawn after ${((performance.now() - opening) / 1000).toFixed(1)} s`);
  const drawn = await tab.evaluate(() => {
    const { stage, view } = window.holba.views ? { stage: window.holba.stage, view: window.holba.views[0] } : {};
    const gl = stage.canvas.getContext("webgl2");
    // A pixel that is read waits for all that was drawn; finish() does not, where another process draws.
    const frame = (part) => {
      view.points.showPart(part);
      const begin = performance.now();
      stage.render();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
      return performance.now() - begin;
    };
    frame(1);
    return { all: frame(1), part: frame(0.05), points: view.model.points.count, lines: view.model.lines.count };
  });
  console.log(`a frame of all ${drawn.points} points and ${drawn.lines} lines: ${drawn.all.toFixed(0)} ms; with a twentieth of the points, as ` +
    `while it is turned on a slow machine: ${drawn.part.toFixed(0)} ms (drawn by the processor alone)`);
} finally {
  await browser.close();
}
