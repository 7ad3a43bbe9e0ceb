// A grid of numbers as shade and contour lines, for the map and the section alike.

import { label } from "./shown.js";

const patch = document.createElement("canvas");

/** Shades `values` of a grid; `corner` and `far` are the places of its first and last cell on the canvas, `shade` gives
 * red, green, blue and cover of a value. */
export function shadeGrid(ctx, grid, values, corner, far, shade) {
  patch.width = grid.columns; patch.height = grid.rows;
  const paint = patch.getContext("2d"), image = paint.createImageData(grid.columns, grid.rows);
  for (let r = 0; r < grid.rows; r++) for (let c = 0; c < grid.columns; c++) {
    image.data.set(shade(values, r, c), 4 * ((grid.rows - 1 - r) * grid.columns + c));
  }
  paint.putImageData(image, 0, 0);
  const dx = (far[0] - corner[0]) / (grid.columns - 1), dy = (corner[1] - far[1]) / (grid.rows - 1);
  ctx.imageSmoothingEnabled = true; ctx.imageSmoothingQuality = "high";
  ctx.drawImage(patch, corner[0] - dx / 2, far[1] - dy / 2, dx * grid.columns, dy * grid.rows);
}

/** The shade of the plume: the darker the more of it there is. */
export const plumeShade = unit => (values, r, c, columns) => {
  const excess = Math.max(0, values[r * columns + c]);
  return [47, 111, 159, 165 * (1 - Math.exp(-excess / (160 * unit)))];
};

/** Contour line of one value by marching squares, as pieces between points in columns and rows. */
export function contour(grid, values, level, piece) {
  // Through a cell of which a corner is not known goes no line.
  const at = (c, r) => (values[r * grid.columns + c] ?? NaN) - level;
  const cut = (a, b) => a / (a - b);
  for (let r = 0; r + 1 < grid.rows; r++) for (let c = 0; c + 1 < grid.columns; c++) {
    const sw = at(c, r), se = at(c + 1, r), ne = at(c + 1, r + 1), nw = at(c, r + 1), ends = [];
    if (Number.isNaN(sw + se + ne + nw)) continue;
    if (sw < 0 !== se < 0) ends.push([c + cut(sw, se), r]);
    if (se < 0 !== ne < 0) ends.push([c + 1, r + cut(se, ne)]);
    if (nw < 0 !== ne < 0) ends.push([c + cut(nw, ne), r + 1]);
    if (sw < 0 !== nw < 0) ends.push([c, r + cut(sw, nw)]);
    for (let i = 0; i + 1 < ends.length; i += 2) piece(ends[i], ends[i + 1]);
  }
}

/** Draws contour lines at `levels`, each with its label where it is furthest from `source` and on the canvas. */
export function drawContours(ctx, grid, values, place, levels, style) {
  for (const level of levels) {
    let furthest = null;
    ctx.beginPath();
    contour(grid, values, level, (a, b) => {
      const [p, q] = [place(...a), place(...b)];
      ctx.moveTo(...p); ctx.lineTo(...q);
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
