// SPDX-License-Identifier: BSD-3-Clause
// Pictures of a page, for people to look at:
//   node test/shot.mjs PAGE.html PICTURE.png [JavaScript that is run before, with `app`] [PICTURE.png JavaScript]...
// HOLBA_THEME=light, HOLBA_SIZE=1280x800.
import { launch, open, settle } from "./browser.mjs";

const [pagePath, ...rest] = process.argv.slice(2);
const [width, height] = (process.env.HOLBA_SIZE ?? "1280x800").split("x").map(Number);
const browser = await launch();
try {
  const page = await open(browser, pagePath, { theme: process.env.HOLBA_THEME ?? "dark", width, height });
  for (let k = 0; k < rest.length; k += 2) {
    if (rest[k + 1]) await page.evaluate(`(async () => { const app = window.holba; ${rest[k + 1]} })()`);
    await page.waitForTimeout(900);
    await settle(page);
    await page.screenshot({ path: rest[k] });
  }
  for (const fault of page.faults) console.error(fault);
} finally {
  await browser.close();
}
