// SPDX-License-Identifier: BSD-3-Clause
// Colours that people tell apart however they see colours: categories of Okabe and Ito ("Color
// universal design", 2008), scales of viridis (van der Walt and Smith, 2015; brightness rises
// evenly) and of a division from blue to orange.

export type Rgb = [number, number, number];

const categories: Rgb[] = [
  [230, 97, 60], [60, 140, 230], [0, 168, 120], [240, 178, 30], [204, 121, 187],
  [86, 200, 233], [170, 120, 40], [150, 130, 230], [150, 190, 60], [190, 80, 110],
];
export function category(index: number): Rgb {
  const base = categories[index % categories.length];
  const scale = 1 - 0.25 * (Math.floor(index / categories.length) % 3);
  return [base[0] * scale, base[1] * scale, base[2] * scale];
}

const viridis: Rgb[] = [
  [68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140],
  [40, 174, 128], [94, 201, 98], [173, 220, 48], [253, 231, 37],
];
export function scale(t: number): Rgb {
  const x = Math.min(Math.max(t, 0), 1) * (viridis.length - 1);
  const i = Math.min(Math.floor(x), viridis.length - 2), f = x - i;
  return [0, 1, 2].map((k) => viridis[i][k] * (1 - f) + viridis[i + 1][k] * f) as Rgb;
}
export const scaleCss = `linear-gradient(90deg, ${viridis.map(css).join(", ")})`;

export function css(rgb: Rgb): string {
  return `rgb(${rgb.map((c) => Math.round(c)).join(",")})`;
}
