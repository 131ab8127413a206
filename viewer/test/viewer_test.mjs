// SPDX-License-Identifier: BSD-3-Clause
// The viewer in a real browser: node --test test/viewer_test.mjs, with HOLBA naming the program.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { launch, open, settle } from "./browser.mjs";
import { centres, height, hostile, lines, points, project, width, writeSmallModel } from "./small_model.mjs";

const holba = process.env.HOLBA;
const folder = mkdtempSync(join(tmpdir(), "holba-viewer-test-"));
const small = join(folder, "small.html"), compared = join(folder, "compared.html");
let browser;

before(async () => {
  const { model, images } = writeSmallModel(folder);
  execFileSync(holba, ["view", "--input_path", model, "--image_path", images, "--output_path", small, "--quiet"]);
  execFileSync(holba, ["view", "--input_path", model, "--compare_path", model, "--output_path", compared, "--quiet"]);
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

// Of the canvas as it is drawn now.
async function pixels(page) {
  const { width, base64 } = await page.evaluate(() => {
    const app = window.holba;
    app.stage.render();
    const canvas = app.stage.canvas;
    const copy = document.createElement("canvas");
    copy.width = canvas.width;
    copy.height = canvas.height;
    const context = copy.getContext("2d");
    context.drawImage(canvas, 0, 0);
    // As JSON numbers some megabytes of pixels take half a minute.
    const { data } = context.getImageData(0, 0, copy.width, copy.height);
    let bytes = "";
    for (let i = 0; i < data.length; i += 32768) bytes += String.fromCharCode(...data.subarray(i, i + 32768));
    return { width: copy.width, base64: btoa(bytes) };
  });
  return { width, data: Buffer.from(base64, "base64") };
}
const at = ({ width, data }, x, y) => data.slice(4 * (Math.round(y) * width + Math.round(x)), 4 * (Math.round(y) * width + Math.round(x)) + 3);
async function drawn(page) {
  const { data } = await pixels(page);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i] !== data[0] || data[i + 1] !== data[1] || data[i + 2] !== data[2]) ++count;
  return count;
}
// Where on the canvas a place of the model is; the page adds where the canvas is on it.
const place = (page, kind, index) =>
  page.evaluate(([kind, index]) => {
    const app = window.holba;
    const box = app.stage.canvas.getBoundingClientRect();
    const p = app.stage.project(app.stage.toScene(app.placeOf({ kind, index, second: false })));
    return { x: p.x + box.left, y: p.y + box.top, localX: p.x, localY: p.y };
  }, [kind, index]);
const title = (page) => page.textContent("#info-title");
async function withPage(path, options, body) {
  const page = await open(browser, path, options);
  try {
    await body(page);
    assert.deepEqual(page.faults, []);
  } finally {
    await page.context().close();
  }
}

test("layers are drawn, and are gone when they are turned off by keys and clicks", async () => {
  await withPage(small, {}, async (page) => {
    const all = await drawn(page);
    assert.ok(all > 500, `${all} pixels`);
    await page.click("label:has(#layer-lines)");
    assert.ok((await drawn(page)) < all);
    await page.keyboard.press("c");
    for (const key of ["s", "p"]) await page.keyboard.press(key);
    assert.equal(await drawn(page), 0);
    await page.keyboard.press("p");
    assert.ok((await drawn(page)) > 0);
  });
});

test("a click says what a line is, which images see it with which error; a click on one goes there", async () => {
  await withPage(small, {}, async (page) => {
    const { x, y } = await place(page, "line", 0);
    await page.mouse.click(x, y);
    assert.equal(await title(page), "Line 5");
    const rows = await page.$$eval("#seen-by button", (buttons) => buttons.map((b) => [b.querySelector(".name").textContent, b.querySelector(".value").textContent]));
    assert.equal(rows.length, centres.length);
    assert.deepEqual(rows.map((r) => r[0]).sort(), ["one.ppm", hostile, "three.ppm"].sort());
    for (const [, value] of rows) assert.ok(parseFloat(value) < 0.02, value); // the segments are exact
    await page.click("#seen-by button:first-child");
    assert.equal(await page.isVisible("#imagebar"), true);
    const name = await page.textContent("#image-name");
    await page.keyboard.press("ArrowRight");
    assert.notEqual(await page.textContent("#image-name"), name);
    await page.click("#previous-image");
    assert.equal(await page.textContent("#image-name"), name);
    await page.keyboard.press("Escape");
    assert.equal(await page.isVisible("#imagebar"), false);
  });
});

test("points are told with their places, errors and uncertainty", async () => {
  await withPage(small, {}, async (page) => {
    const { x, y } = await place(page, "point", 2);
    await page.mouse.click(x, y);
    assert.equal(await title(page), "Point 33");
    const facts = Object.fromEntries(await page.$$eval("aside.right table.facts tr", (rows) => rows.map((r) => [...r.children].map((c) => c.textContent))));
    assert.equal(facts.Position, "0.2, 0.1, 4");
    assert.equal(facts["Mean error"], "0.25 px");
    assert.equal(facts.Observations, "3");
    assert.match(facts.Uncertainty, /^[0-9.e-]+ \(1 sigma\)$/);
  });
});

test("the photograph of a lens that distorts lies under what projects into it", async () => {
  for (const image of [0, 2]) {
    await withPage(small, {}, async (page) => {
      await page.evaluate((i) => {
        const app = window.holba;
        Object.assign(app.imageLayers, { keypoints: false, segments: false, residuals: 0 });
        for (const layer of ["points", "lines", "surfaces"]) app.setLayer(layer, false);
        app.enter(i);
      }, image);
      await page.waitForTimeout(300);
      await settle(page);
      const seen = await pixels(page);
      for (const [index, point] of points.entries()) {
        const { localX, localY } = await place(page, "point", index);
        const colour = at(seen, localX, localY);
        point.colour.forEach((c, q) => assert.ok(Math.abs(colour[q] - c) < 60, `image ${image}, point ${point.id}: ${colour}`));
      }
    });
  }
});

test("what was observed is where the model projects to", async () => {
  await withPage(small, {}, async (page) => {
    const far = await page.evaluate(() => {
      const app = window.holba;
      app.enter(0);
      const { model } = app.view;
      let worst = 0;
      for (const { feature, observation } of model.pointsSeenBy(0)) {
        const camera = model.camera(0);
        const ray = model.ray(camera, model.pixel(model.pointPositions[2 * observation], camera), model.pixel(model.pointPositions[2 * observation + 1], camera));
        const a = app.stage.project(app.stage.toScene(model.alongRay(0, ray, 1)));
        const b = app.stage.project(app.stage.toScene(model.point(feature)));
        worst = Math.max(worst, Math.hypot(a.x - b.x, a.y - b.y));
      }
      return worst;
    });
    assert.ok(far < 0.3, `${far} px`);
  });
});

test("a surface shows what the photographs show of it", async () => {
  await withPage(small, {}, async (page) => {
    await page.evaluate(() => {
      const app = window.holba;
      for (const layer of ["points", "lines", "cameras", "surfaces"]) app.setLayer(layer, false);
      app.setLayer("textures", true);
      app.along("front");
    });
    await page.waitForFunction(() => window.holba.view.textures.children.length > 0);
    await page.waitForTimeout(300);
    await settle(page);
    const seen = await pixels(page);
    // Points 11 and 22 lie in the plane, beside its corners: a little inside of it is their colour.
    for (const index of [0, 1]) {
      const inside = await page.evaluate((i) => {
        const app = window.holba;
        const [x, y, z] = app.view.model.point(i);
        const p = app.stage.project(app.stage.toScene([x * 0.985, y * 0.985, z]));
        return { x: p.x, y: p.y };
      }, index);
      points[index].colour.forEach((c, q) => {
        const colour = at(seen, inside.x, inside.y);
        assert.ok(Math.abs(colour[q] - c) < 60, `point ${points[index].id}: ${colour}`);
      });
    }
  });
});

test("a place is in a photograph where its lens puts it", async () => {
  await withPage(small, {}, async (page) => {
    const xyz = [[0.4, -0.7, 5], [-1.2, 0.9, 4.5], [1.7, 1.0, 5]];
    const found = await page.evaluate((places) => {
      const { model } = window.holba.view;
      const { origin } = model.meta;
      return places.map((p) => model.project(1, p.map((v, q) => v - origin[q])));
    }, xyz);
    xyz.forEach((p, k) => {
      const [x, y] = project(1, p);
      assert.ok(Math.hypot(found[k][0] * width - x, found[k][1] * height - y) < 0.2);
    });
    assert.equal(await page.evaluate(() => window.holba.view.model.project(1, [0, 0, -50])), null);
  });
});

test("a bar tells lengths where one scale holds", async () => {
  await withPage(small, {}, async (page) => {
    assert.equal(await page.isVisible("#scale-bar"), false);
    await page.keyboard.press("7");
    await settle(page);
    const length = Number((await page.textContent("#scale-bar span")).split(" ")[0]);
    const pixelsOfBar = await page.evaluate(() => document.querySelector("#scale-bar .bar").getBoundingClientRect().width);
    const pixelsOfUnit = await page.evaluate(() => {
      const { stage, view } = window.holba;
      const right = view.model.meta.right;
      const a = stage.project(stage.toScene([0, 0, 0])), b = stage.project(stage.toScene(right));
      return Math.hypot(a.x - b.x, a.y - b.y);
    });
    assert.ok(Math.abs(pixelsOfBar - length * pixelsOfUnit) < 2, `${pixelsOfBar} ${length * pixelsOfUnit}`);
    await page.keyboard.press("o");
    await settle(page);
    assert.equal(await page.isVisible("#scale-bar"), false);
  });
});

test("fingers turn the model, zoom it and say what a point is", async () => {
  const context = await browser.newContext({ viewport: { width: 420, height: 760 }, hasTouch: true, isMobile: true, offline: true });
  try {
    const page = await context.newPage();
    await page.goto(pathToFileURL(small).href);
    await page.waitForFunction(() => document.body.dataset.ready);
    await settle(page);
    const { x, y } = await place(page, "point", 2);
    await page.touchscreen.tap(x, y);
    assert.equal(await title(page), "Point 33");
    const client = await context.newCDPSession(page);
    const send = (type, touchPoints) => client.send("Input.dispatchTouchEvent", { type, touchPoints });
    const camera = () => page.evaluate(() => window.holba.stage.camera.position.toArray());
    const distance = () => page.evaluate(() => window.holba.stage.camera.position.distanceTo(window.holba.stage.controls.target));
    const before = await camera();
    await send("touchStart", [{ x: 150, y: 200 }]);
    for (let k = 1; k <= 5; ++k) await send("touchMove", [{ x: 150 + 12 * k, y: 200 }]);
    await send("touchEnd", []);
    await settle(page);
    assert.ok((await camera()).some((v, q) => Math.abs(v - before[q]) > 1e-3));
    const far = await distance();
    await send("touchStart", [{ x: 180, y: 200, id: 1 }, { x: 220, y: 200, id: 2 }]);
    for (let k = 1; k <= 5; ++k) await send("touchMove", [{ x: 180 - 15 * k, y: 200, id: 1 }, { x: 220 + 15 * k, y: 200, id: 2 }]);
    await send("touchEnd", []);
    await settle(page);
    assert.ok((await distance()) < 0.8 * far);
  } finally {
    await context.close();
  }
});

test("search finds ids and names", async () => {
  await withPage(small, {}, async (page) => {
    const find = async (text) => {
      await page.keyboard.press("/");
      await page.fill("input[type=search]", text);
      await page.keyboard.press("Enter");
      await page.evaluate(() => document.activeElement.blur());
      return title(page);
    };
    assert.equal(await find("22"), "Point 22");
    assert.equal(await find("line 6"), "Line 6");
    assert.equal(await find("plane 3"), "Plane 3");
    assert.equal(await find("three"), "three.ppm");
  });
});

test("lengths are those of the model", async () => {
  await withPage(small, {}, async (page) => {
    await page.keyboard.press("s");
    await page.keyboard.press("c");
    await page.keyboard.press("m");
    for (const index of [0, 1]) {
      const { x, y } = await place(page, "point", index);
      await page.mouse.click(x, y);
    }
    const [a, b] = points.map((p) => p.xyz);
    const length = Math.hypot(...a.map((v, q) => v - b[q]));
    assert.ok(Math.abs(Number(await page.textContent("#measured")) - length) < 0.005);
  });
});

test("plan is from above, orthographic; the clipping box takes away", async () => {
  await withPage(small, {}, async (page) => {
    await page.keyboard.press("7");
    const up = await page.evaluate(() => window.holba.stage.camera.getWorldDirection(new window.holba.stage.camera.position.constructor()).toArray());
    assert.ok(up[1] < -0.999);
    assert.equal(await page.getAttribute("#button-ortho", "aria-pressed"), "true");
    await page.keyboard.press("c");
    const whole = await drawn(page);
    await page.evaluate(() => {
      window.holba.clip.range[0] = [0, 0.5];
      window.holba.setClip(true);
    });
    const part = await drawn(page);
    assert.ok(part > 0 && part < 0.8 * whole, `${part} of ${whole}`);
    await page.keyboard.press("b");
    const again = await drawn(page);
    // The camera still comes to rest: edges of what is drawn move by a fraction of a pixel.
    assert.ok(Math.abs(again - whole) < 0.02 * whole, `${again} of ${whole}`);
  });
});

test("the address keeps the view, the image and the selection", async () => {
  let hash, before;
  await withPage(small, {}, async (page) => {
    await page.keyboard.press("3");
    await page.evaluate(() => window.holba.select({ kind: "point", index: 1, second: false }));
    await page.waitForTimeout(500);
    hash = new URL(page.url()).hash;
    before = await page.evaluate(() => window.holba.stage.camera.position.toArray());
  });
  await withPage(small, { hash }, async (page) => {
    assert.equal(await title(page), "Point 22");
    const position = await page.evaluate(() => window.holba.stage.camera.position.toArray());
    position.forEach((v, q) => assert.ok(Math.abs(v - before[q]) < 1e-3 * (1 + Math.abs(v))));
  });
});

test("hostile names are text", async () => {
  await withPage(small, {}, async (page) => {
    await page.evaluate(() => window.holba.enter(1));
    assert.equal(await page.textContent("#image-name"), hostile);
    await page.keyboard.press("r");
    assert.ok((await page.textContent("#report")).includes(hostile));
    assert.equal(await page.evaluate(() => window.harmed), undefined);
  });
});

test("two models are seen over each other, beside each other, one by one", async () => {
  await withPage(compared, {}, async (page) => {
    const both = await drawn(page);
    await page.keyboard.press("x");
    const first = await drawn(page);
    assert.ok(first > 0 && both > 0);
    await page.selectOption("#split", "side");
    const { width, data } = await pixels(page);
    let left = 0, right = 0;
    for (let i = 0; i < data.length; i += 4)
      if (data[i] !== data[0] || data[i + 1] !== data[1]) (i / 4) % width < width / 2 ? ++left : ++right;
    assert.ok(left > 100 && right > 100, `${left} ${right}`);
  });
});

test("dark and light follow the system, and the button", async () => {
  for (const theme of ["dark", "light"]) {
    await withPage(small, { theme }, async (page) => {
      const brightness = async () => at(await pixels(page), 2, 2)[0];
      assert.equal((await brightness()) > 128, theme === "light");
      await page.click("#button-theme");
      assert.equal((await brightness()) > 128, theme !== "light");
    });
  }
});

test("a narrow screen has no panel over the model", async () => {
  await withPage(small, { width: 400, height: 720 }, async (page) => {
    assert.equal(await page.isVisible("aside.left"), false);
    const { x, y } = await place(page, "point", 2);
    await page.mouse.click(x, y);
    assert.equal(await title(page), "Point 33");
  });
});

test("the page is small and holds all", () => {
  assert.ok(statSync(small).size < 1.2e6);
  assert.equal(lines.length + points.length, 5);
});
