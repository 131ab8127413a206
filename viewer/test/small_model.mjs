// SPDX-License-Identifier: BSD-3-Clause
// A small model as text with photographs, written without holba: a lens that distorts, three points,
// lines and a plane, and in each photograph a coloured square where a point is seen.
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";

export const width = 640, height = 480, f = 400, k = -0.18;
export const hostile = "</script><script>window.harmed=1</script>\"'&\u{1F4F7}.ppm";
export const points = [
  { id: 11, xyz: [-1.6, -1.1, 5], colour: [255, 0, 0] },
  { id: 22, xyz: [1.9, 1.2, 5], colour: [0, 255, 0] },
  { id: 33, xyz: [0.2, 0.1, 4], colour: [0, 0, 255] },
];
export const lines = [
  { id: 5, ends: [[-1.5, 1, 5], [1.5, 1, 5]], direction: 0 },
  { id: 6, ends: [[-1.5, -1, 5], [-1.5, 1, 5]], direction: 1 },
];
export const centres = [[0, 0, 0], [0.8, 0, 0], [-0.7, 0.2, 0]];

// SIMPLE_RADIAL.
export function project(image, [x, y, z]) {
  const c = centres[image];
  const u = (x - c[0]) / (z - c[2]), v = (y - c[1]) / (z - c[2]);
  const d = 1 + k * (u * u + v * v);
  return [f * d * u + width / 2, f * d * v + height / 2];
}

export function writeSmallModel(folder, names = ["one.ppm", hostile, "three.ppm"]) {
  const model = join(folder, "model"), images = join(folder, "images");
  mkdirSync(model, { recursive: true });
  mkdirSync(images, { recursive: true });
  const write = (name, rows) => writeFileSync(join(model, `${name}.txt`), rows.join("\n") + "\n");
  write("cameras", [`1 SIMPLE_RADIAL ${width} ${height} ${f} ${width / 2} ${height / 2} ${k}`]);
  const rows = [];
  centres.forEach((c, i) => {
    rows.push(`${i + 1} 1 0 0 0 ${c.map((v) => -v).join(" ")} 1 ${names[i]}`);
    rows.push(points.map((p) => `${project(i, p.xyz).join(" ")} ${p.id}`).join(" "));
  });
  write("images", rows);
  write("points3D", points.map((p) => `${p.id} ${p.xyz.join(" ")} ${p.colour.join(" ")} 0.25 ${centres.map((_, i) => `${i + 1} ${points.indexOf(p)}`).join(" ")}`));
  write("lines2D", centres.map((_, i) => `${i + 1} ${lines.length} ${lines.map((l) => `${project(i, l.ends[0]).join(" ")} ${project(i, l.ends[1]).join(" ")} ${l.id}`).join(" ")}`));
  write("lines3D", lines.map((l) => {
    const [a, b] = l.ends;
    const d = a.map((v, q) => b[q] - v), n = Math.hypot(...d), u = d.map((v) => v / n);
    const m = [a[1] * u[2] - a[2] * u[1], a[2] * u[0] - a[0] * u[2], a[0] * u[1] - a[1] * u[0]];
    return `${l.id} ${u.join(" ")} ${m.join(" ")} ${a.join(" ")} ${b.join(" ")} 200 200 200 0.5 ${centres.map((_, i) => `${i + 1} ${lines.indexOf(l)}`).join(" ")}`;
  }));
  write("groups2D", []);
  write("groups3D", ["1 VP 3 1 0 0 0 1 5 0", "2 VP 3 0 1 0 0 1 6 0", "3 PLANE 4 0 0 1 -5 2 11 22 2 5 6 0"]);
  write("wireframe", []);
  write("relations", ["1 2 ORTHOGONAL"]);
  centres.forEach((_, i) => {
    if (names[i].includes("/")) return; // no file can have that name
    writePhotograph(join(images, names[i]), i);
  });
  return { model, images };
}

function writePhotograph(path, image) {
  const pixels = Buffer.alloc(3 * width * height, 128);
  for (const point of points) {
    const [x, y] = project(image, point.xyz).map(Math.floor);
    for (let dy = -9; dy <= 9; ++dy)
      for (let dx = -9; dx <= 9; ++dx) {
        const row = y + dy, column = x + dx;
        if (row < 0 || row >= height || column < 0 || column >= width) continue;
        point.colour.forEach((c, q) => (pixels[3 * (row * width + column) + q] = c));
      }
  }
  writeFileSync(path, Buffer.concat([Buffer.from(`P6\n${width} ${height}\n255\n`), pixels]));
}
