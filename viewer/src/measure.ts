// SPDX-License-Identifier: BSD-3-Clause
// Lengths between picked places, angles between three of them or two lines.
import * as THREE from "three";
import { button, el, fill } from "./dom";
import { number } from "./modelview";
import { PointCloud, Segments } from "./shaders";
import type { Stage } from "./stage";

export interface Place {
  position: THREE.Vector3; // model
  name: string;
  direction?: THREE.Vector3; // of a line
}

export class Measure {
  active = false;
  places: Place[] = [];
  private unit = 1; // what a length of the model is shown as
  private group = new THREE.Group();
  private drawn: (PointCloud | Segments)[] = [];

  constructor(private stage: Stage, readonly panel: HTMLElement, private changed: () => void) {
    this.group.userData.unpickable = true;
    stage.upright.add(this.group);
    panel.hidden = true;
  }
  toggle(on = !this.active): void {
    this.active = on;
    if (!on) this.places = [];
    this.update();
    this.changed();
  }
  add(place: Place): void {
    this.places.push(place);
    if (this.places.length > 8) this.places.shift();
    this.update();
  }
  length(): number {
    const n = this.places.length;
    return n < 2 ? NaN : this.places[n - 1].position.distanceTo(this.places[n - 2].position) * this.unit;
  }
  private angle(u: THREE.Vector3, v: THREE.Vector3): string {
    return `${number(THREE.MathUtils.radToDeg(u.angleTo(v)))}\u00b0`;
  }

  update(): void {
    for (const drawn of this.drawn) drawn.dispose();
    this.drawn = [];
    this.group.clear();
    this.panel.hidden = !this.active;
    if (this.places.length > 0) {
      const xyz = new Float32Array(this.places.flatMap((p) => p.position.toArray()));
      const cloud = new PointCloud(xyz, 0, { onTop: true });
      cloud.size = 9;
      cloud.paint((_, out, at) => out.set([255, 80, 60, 255], at));
      const ends: number[] = [];
      for (let k = 1; k < this.places.length; ++k) ends.push(...this.places[k - 1].position.toArray(), ...this.places[k].position.toArray());
      const ways = new Segments(new Float32Array(ends), 0, { onTop: true, width: 2, dashed: true });
      ways.paint((_, out, at) => out.set([255, 80, 60, 255], at));
      this.drawn = [cloud, ways];
      for (const drawn of this.drawn) this.group.add(drawn.object);
    }
    this.stage.draw();
    const n = this.places.length;
    const rows: string[] = [];
    if (n >= 3) {
      const [a, b, c] = this.places.slice(-3).map((p) => p.position);
      rows.push(`Angle at the middle one of the last three: ${this.angle(a.clone().sub(b), c.clone().sub(b))}`);
    }
    const last = this.places.slice(-2);
    if (n >= 2 && last[0].direction && last[1].direction) {
      const angle = last[0].direction.angleTo(last[1].direction);
      rows.push(`Angle of the last two lines: ${number(THREE.MathUtils.radToDeg(Math.min(angle, Math.PI - angle)))}\u00b0`);
    }
    fill(
      this.panel,
      button("\u2715", "Stop measuring (M)", () => this.toggle(false), { class: "close" }),
      el("b", {}, "Measure"),
      n < 2 ? el("p", { class: "hint" }, "Click points, lines or cameras, one after the other.") : el("div", { class: "big", id: "measured" }, number(this.length())),
      n >= 2 && el("p", { class: "hint" }, "Between the last two", this.unit === 1 ? ", in units of the model" : ", scaled"),
      ...rows.map((row) => el("p", { class: "hint" }, row)),
      n > 0 && el("ol", {}, ...this.places.map((p) => el("li", {}, p.name))),
      el("div", { class: "tool", style: "display:flex;gap:6px" },
        n > 0 && button("Clear", "Forget the places", () => { this.places = []; this.update(); }),
        n >= 2 && button("This is known\u2026", "Say how long the last length is", () => {
          const answer = Number(window.prompt("How long is it? All lengths are scaled alike.", number(this.length())));
          if (answer > 0) {
            this.unit *= answer / this.length();
            this.update();
          }
        })),
    );
  }
}
