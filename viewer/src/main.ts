// SPDX-License-Identifier: BSD-3-Clause
import { App } from "./app";
import { loadModel } from "./model";
import "./style.css";

declare global {
  interface Window {
    holba?: App; // for tests and for the curious
  }
}

async function start(): Promise<void> {
  const root = document.getElementById("app")!;
  try {
    const model = await loadModel("model");
    if (!model) throw new Error("This page holds no model. 'holba view --input_path MODEL --output_path page.html' writes one that does.");
    window.holba = new App(root, model, await loadModel("compare"));
    document.body.dataset.ready = "1";
  } catch (error) {
    const loading = document.getElementById("loading");
    const text = error instanceof Error ? error.message : String(error);
    if (loading) {
      loading.classList.add("failed");
      loading.textContent = text;
    }
    document.body.dataset.failed = text;
    throw error;
  }
}
void start();
