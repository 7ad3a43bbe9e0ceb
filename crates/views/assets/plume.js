// A grid of numbers on a canvas, for the map and the section.

import { label } from "./shown.js";
import { contourLines, paintGrid } from "./grid.js";

const patch = document.createElement("canvas");

/** Shades `values` of a grid; `corner` and `far` are the places of its first and last cell on the canvas. */
export function shadeGrid(ctx, grid, values, corner, far, shade) {
  paintGrid(patch, grid, values, shade);
  const dx = (far[0] - corner[0]) / (grid.columns - 1), dy = (corner[1] - far[1]) / (grid.rows - 1);
  ctx.imageSmoothingEnabled = true; ctx.imageSmoothingQuality = "high";
  ctx.drawImage(patch, corner[0] - dx / 2, far[1] - dy / 2, dx * grid.columns, dy * grid.rows);
}

/** Draws contour lines at `levels`, each with its label where it is furthest from `source` and on the canvas. */
export function drawContours(ctx, grid, values, place, levels, style) {
  for (const level of levels) {
    let furthest = null;
    ctx.beginPath();
    for (const line of contourLines(grid, values, level)) line.forEach((corner, i) => {
      const p = place(...corner);
      if (i === 0) ctx.moveTo(...p); else ctx.lineTo(...p);
      const d = style.source && style.inside(p) ? Math.hypot(p[0] - style.source[0], p[1] - style.source[1]) : -1;
      if (d >= 0 && (!furthest || d > furthest[0])) furthest = [d, p];
    });
    ctx.lineWidth = style.width || 1; ctx.strokeStyle = style.line; ctx.stroke();
    if (furthest && style.word) {
      ctx.font = "10.5px system-ui, sans-serif"; ctx.textAlign = "center";
      label(ctx, style.word(level), furthest[1][0], furthest[1][1] + 3, style.text);
    }
  }
}
