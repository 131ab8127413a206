// SPDX-License-Identifier: BSD-3-Clause
// A bar of known length, where one scale holds for all that is seen: in orthographic views.
import { el } from "./dom";
import { number } from "./modelview";
import type { Stage } from "./stage";

export class ScaleBar {
  readonly element = el("div", { id: "scale-bar", hidden: true });
  private bar = el("div", { class: "bar" });
  private label = el("span", {});
  constructor() {
    this.element.append(this.label, this.bar);
  }
  update(stage: Stage): void {
    this.element.hidden = !stage.isOrthographic || stage.imageMode;
    if (this.element.hidden) return;
    const { top, bottom, zoom } = stage.orthographic;
    const pixelsPerUnit = (stage.canvas.clientHeight * zoom) / (top - bottom);
    // 1, 2 or 5 times a power of ten, 80 to 200 pixels.
    const power = 10 ** Math.floor(Math.log10(200 / pixelsPerUnit));
    const length = [5, 2, 1].map((step) => step * power).find((l) => l * pixelsPerUnit <= 200)!;
    this.bar.style.width = `${length * pixelsPerUnit}px`;
    this.label.textContent = `${number(length)} ${length === 1 ? "unit" : "units"}`;
  }
}
