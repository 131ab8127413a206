// SPDX-License-Identifier: BSD-3-Clause
// Elements without a framework. Texts are set as texts: nothing of a model is ever read as HTML.

type Child = Node | string | null | undefined | false;

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Record<string, unknown> = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === false) continue;
    if (name.startsWith("on") && typeof value === "function") element.addEventListener(name.slice(2), value as EventListener);
    else if (name === "class") element.className = String(value);
    else if (name in element && typeof value !== "string") (element as unknown as Record<string, unknown>)[name] = value;
    else element.setAttribute(name, String(value));
  }
  for (const child of children) if (child) element.append(child);
  return element;
}

// In place of what an element holds.
export function fill(element: Element, ...children: Child[]): void {
  element.replaceChildren(...(children.filter(Boolean) as (Node | string)[]));
}

export function slider(
  label: string, value: number, [low, high, step]: [number, number, number], text: (v: number) => string, changed: (v: number) => void, id?: string,
): HTMLElement {
  const shown = el("output", {}, text(value));
  const input = el("input", {
    type: "range", min: String(low), max: String(high), step: String(step), value: String(value), "aria-label": label, id,
    oninput: () => {
      shown.textContent = text(Number(input.value));
      changed(Number(input.value));
    },
  });
  return el("label", { class: "slider" }, el("span", {}, label), input, shown);
}

export function choice<T extends string>(
  label: string, options: readonly (readonly [T, string])[], value: T, changed: (v: T) => void, id?: string,
): HTMLElement {
  const select = el("select", { "aria-label": label, id, onchange: () => changed(select.value as T) });
  for (const [name, text] of options) select.append(el("option", { value: name, selected: name === value }, text));
  return el("label", { class: "choice" }, el("span", {}, label), select);
}

export function toggle(label: string, value: boolean, changed: (v: boolean) => void, note = "", id?: string): HTMLElement {
  const input = el("input", { type: "checkbox", checked: value, id, onchange: () => changed(input.checked) });
  return el("label", { class: "toggle" }, input, el("span", { class: "box" }), el("span", { class: "name" }, label), el("span", { class: "note" }, note));
}

export function button(text: string, title: string, pressed: () => void, attributes: Record<string, unknown> = {}): HTMLButtonElement {
  return el("button", { type: "button", title, onclick: pressed, ...attributes }, text);
}
