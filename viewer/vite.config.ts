// SPDX-License-Identifier: BSD-3-Clause
// One file, page/viewer.html, that goes into the program: no requests, ASCII only.
import { renameSync } from "node:fs";
import { defineConfig } from "vite";
import { viteSingleFile } from "vite-plugin-singlefile";

export default defineConfig({
  esbuild: { charset: "ascii", legalComments: "inline" },
  plugins: [
    viteSingleFile(),
    {
      name: "rename",
      closeBundle() {
        renameSync("page/index.html", "page/viewer.html");
      },
    },
  ],
  build: { outDir: "page", target: "es2022", emptyOutDir: true, reportCompressedSize: false },
});
