// SPDX-License-Identifier: BSD-3-Clause
// A page of the viewer in Debian's chromium without a screen.
import { existsSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const places = [process.env.HOLBA_CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
export const browserPath = places.find((path) => path && existsSync(path));

export async function launch() {
  return chromium.launch({
    executablePath: browserPath,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"],
  });
}

// Opens a page from its file, with the network off: a request is an error, and so is one on its console.
export async function open(browser, path, { width = 1280, height = 800, theme = "dark", hash = "", timeout = 120000 } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: theme, offline: true });
  const page = await context.newPage();
  page.faults = [];
  page.on("pageerror", (error) => page.faults.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") page.faults.push(message.text());
  });
  page.on("request", (request) => {
    if (/^https?:/.test(request.url())) page.faults.push(`it asks for ${request.url()}`);
  });
  await page.goto(pathToFileURL(path).href + hash);
  await page.waitForFunction(() => document.body?.dataset.ready || document.body?.dataset.failed, null, { timeout });
  const failed = await page.evaluate(() => document.body.dataset.failed);
  if (failed) throw new Error(failed);
  await settle(page);
  return page;
}

// What was asked for is drawn.
export async function settle(page) {
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}
